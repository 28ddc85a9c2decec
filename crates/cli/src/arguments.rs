//! The command line as a whole: commands, the options that all of them have, and what is generated from it.

use std::process::ExitCode;

use anyhow::{Context as _, Result};
use clap::{Args, CommandFactory as _, Parser, Subcommand};
use clap_complete::Shell;

use super::options::When;
use super::{cost, devices, diff, eval, farm, merge, picture, plan, plot, print, render, verify, view};

/// A Vulkan renderer written directly against ash: glTF in, radiance out.
#[derive(Parser)]
#[command(name = "etalon", version, propagate_version = true)]
pub struct Arguments {
    /// What is to be done.
    #[command(subcommand)]
    pub command: Command,
    /// Print errors only
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say more: -v for times and decisions, -vv for everything
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
    /// Colour in messages (NO_COLOR is honoured)
    #[arg(long, global = true, value_enum, default_value_t = When::Auto)]
    pub color: When,
}

/// The commands.
#[derive(Subcommand)]
#[expect(missing_docs, reason = "clap would print a variant's documentation in place of the command's own")]
pub enum Command {
    Render(Box<picture::RenderArgs>),
    Plan(Box<plan::PlanArgs>),
    Diff(diff::DiffArgs),
    Devices(devices::DevicesArgs),
    Verify(verify::VerifyArgs),
    View(Box<view::ViewArgs>),
    Cost(Box<cost::CostArgs>),
    Merge(merge::MergeArgs),
    Farm(farm::FarmArgs),
    Eval(eval::EvalArgs),
    Plot(plot::PlotArgs),
    Completions(CompletionsArgs),
    Manual(ManualArgs),
}

/// Print completions for a shell, to be put where it looks for them
#[derive(Debug, Clone, Args)]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

/// Print the manual page in roff, for `man -l -`
#[derive(Debug, Clone, Args)]
pub struct ManualArgs {}

/// What the program's exit codes mean; the first three are those of every command.
pub const EXIT_CODES: [(u8, &str); 6] = [
    (0, "done"),
    (
        1,
        "failed, with a sentence; or `diff` found more than `--max`, `verify` a broken bound, `devices` no usable device",
    ),
    (2, "the command line does not parse: an unknown option, a missing or malformed value"),
    (AGAIN, "worth trying again: the device was lost, or the disk is full"),
    (130, "ended by Ctrl-C"),
    (ENDED, "a part of a picture that was ended by SIGTERM, with the samples it had"),
];

/// Worth trying again: EX_TEMPFAIL of sysexits.h.
pub const AGAIN: u8 = 75;

/// Ended by SIGTERM, as shells report it: 128 and the signal's number.
pub const ENDED: u8 = 143;

/// The command line as data, for help, manual and completions.
#[must_use]
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Runs the command that was chosen.
///
/// # Errors
/// Those of the command.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    match &arguments.command {
        Command::Render(args) => render::run(args, arguments.quiet),
        Command::Diff(args) => diff::run(args),
        Command::Devices(args) => devices::run(args),
        Command::View(args) => view::run(args),
        Command::Plan(args) => plan::run(args),
        Command::Cost(args) => cost::run(args, arguments.quiet),
        Command::Verify(args) => verify::run(args, arguments.quiet),
        Command::Merge(args) => merge::run(args),
        Command::Farm(args) => farm::run(args),
        Command::Eval(args) => eval::run(args),
        Command::Plot(args) => plot::run(args),
        Command::Completions(args) => {
            let mut script = Vec::new();
            clap_complete::generate(args.shell, &mut command(), "etalon", &mut script);
            print(String::from_utf8(script).context("completions that are no text")?.trim_end())?;
            Ok(ExitCode::SUCCESS)
        }
        Command::Manual(_) => {
            print(manual()?.trim_end())?;
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// The manual page: the program, its commands with their options, and the exit codes.
fn manual() -> Result<String> {
    let mut command = command();
    command.build();
    let mut page = Vec::new();
    let man = clap_mangen::Man::new(command.clone());
    man.render(&mut page)?;
    for sub in command.get_subcommands().filter(|sub| sub.get_name() != "help") {
        let man = clap_mangen::Man::new(sub.clone());
        page.extend(format!(".SH \"ETALON {}\"\n", sub.get_name().to_uppercase()).bytes());
        man.render_description_section(&mut page)?;
        man.render_options_section(&mut page)?;
    }
    page.extend(b".SH \"EXIT STATUS\"\n");
    for (code, meaning) in EXIT_CODES {
        page.extend(format!(".TP\n{code}\n{}\n", meaning.replace('`', "")).bytes());
    }
    String::from_utf8(page).context("a manual that is no text")
}
