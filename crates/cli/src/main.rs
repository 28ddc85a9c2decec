//! The program `etalon`: arguments and exit codes, nothing else.

use std::io::IsTerminal as _;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use etalon_cli::options::When;
use etalon_cli::{cost, devices, diff, plan, render, verify, view};

/// A Vulkan renderer written directly against ash: glTF in, radiance out.
#[derive(Parser)]
#[command(version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Say only what went wrong
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Say more: -v for times and decisions, -vv for everything
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
    /// Colour in messages (NO_COLOR is honoured)
    #[arg(long, global = true, value_enum, default_value_t = When::Auto)]
    color: When,
}

#[derive(Subcommand)]
enum Command {
    Render(Box<render::RenderArgs>),
    Plan(Box<plan::PlanArgs>),
    Diff(diff::DiffArgs),
    Devices(devices::DevicesArgs),
    Verify(verify::VerifyArgs),
    View(Box<view::ViewArgs>),
    Cost(Box<cost::CostArgs>),
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let color = match arguments.color {
        When::Always => true,
        When::Never => false,
        When::Auto => std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none(),
    };
    let level = match (arguments.quiet, arguments.verbose) {
        (true, _) => tracing::Level::ERROR,
        (_, 0) => tracing::Level::WARN,
        (_, 1) => tracing::Level::INFO,
        _ => tracing::Level::DEBUG,
    };
    tracing_subscriber::fmt()
        .with_max_level(level)
        .with_writer(std::io::stderr)
        .with_ansi(color)
        .with_target(false)
        .without_time()
        .init();
    let result = match &arguments.command {
        Command::Render(args) => render::run(args, arguments.quiet),
        Command::Diff(args) => diff::run(args),
        Command::Devices(args) => devices::run(args),
        Command::View(args) => view::run(args),
        Command::Plan(args) => plan::run(args),
        Command::Cost(args) => cost::run(args, arguments.quiet),
        Command::Verify(args) => verify::run(args, arguments.quiet),
    };
    result.unwrap_or_else(|error| {
        let label = if color { "\x1b[1;31merror:\x1b[0m" } else { "error:" };
        eprintln!("{label} {}", etalon_cli::told(&error));
        ExitCode::FAILURE
    })
}
