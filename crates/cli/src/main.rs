//! The program `etalon`: arguments and exit codes, nothing else.

use std::io::IsTerminal as _;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use etalon_cli::options::When;
use etalon_cli::progress::ProgressForm;
use etalon_cli::{cost, devices, diff, farm, merge, picture, plan, render, verify, view};

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
    Render(Box<picture::RenderArgs>),
    Plan(Box<plan::PlanArgs>),
    Diff(diff::DiffArgs),
    Devices(devices::DevicesArgs),
    Verify(verify::VerifyArgs),
    View(Box<view::ViewArgs>),
    Cost(Box<cost::CostArgs>),
    Merge(merge::MergeArgs),
    Farm(farm::FarmArgs),
}

/// Worth trying again: EX_TEMPFAIL of sysexits.h.
const AGAIN: u8 = 75;

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
        Command::Merge(args) => merge::run(args),
        Command::Farm(args) => farm::run(args),
    };
    let form = match &arguments.command {
        Command::Render(args) => args.progress,
        Command::Cost(args) => args.progress,
        _ => ProgressForm::Auto,
    };
    result.unwrap_or_else(|error| {
        let label = if color { "\x1b[1;31merror:\x1b[0m" } else { "error:" };
        let text = etalon_cli::told(&error);
        eprintln!("{label} {text}");
        if form == ProgressForm::Openjd {
            etalon_cli::fail_openjd(&text);
        }
        if etalon_cli::is_worth_another_try(&error) { ExitCode::from(AGAIN) } else { ExitCode::FAILURE }
    })
}
