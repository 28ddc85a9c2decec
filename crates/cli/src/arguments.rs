//! The command line as a whole: commands, the options that all of them have, and what is generated from it.

use std::ffi::{OsStr, OsString};
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context as _, Result};
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Args, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use clap_complete::Shell;
use etalon::gpu::keep_pipelines_in;
use etalon::image::file::cache_folder;
use etalon::plan::Knob;
use etalon::scene::EXTENSIONS;
use tracing::Level;
use tracing_subscriber::filter::Targets;

use super::exit_codes::EXIT_CODES;
use super::heading;
use super::options::When;
use super::{
    cost, desktop, devices, diff, eval, farm, lists, merge, passport, picture, plan, plot, print, render, verify, view,
};

/// A Vulkan renderer written directly against ash: glTF in, radiance out.
#[derive(Parser)]
#[command(name = "etalon", version, propagate_version = true, after_help = EXAMPLES)]
pub struct Arguments {
    /// What is to be done.
    #[command(subcommand)]
    pub command: Command,
    /// Print errors only
    #[arg(short, long, global = true, conflicts_with = "verbose", help_heading = heading::MESSAGES)]
    pub quiet: bool,
    /// Say more: -v for whole tables, times and decisions, -vv for everything
    #[arg(short, long, global = true, action = clap::ArgAction::Count, help_heading = heading::MESSAGES)]
    pub verbose: u8,
    /// Colour in messages (NO_COLOR is honoured)
    #[arg(long, global = true, value_enum, default_value_t = When::Auto, help_heading = heading::MESSAGES)]
    pub color: When,
}

impl Arguments {
    /// Which messages are printed. Those of other libraries (the window's, about its screen) only where they are errors
    /// or more is asked for: users cannot act on them.
    #[must_use]
    pub fn messages(&self) -> Targets {
        let (own, others) = match (self.quiet, self.verbose) {
            (true, _) => (Level::ERROR, Level::ERROR),
            (_, 0) => (Level::WARN, Level::ERROR),
            (_, 1) => (Level::INFO, Level::INFO),
            _ => (Level::DEBUG, Level::DEBUG),
        };
        // Targets are compared by their beginnings: every crate of this workspace.
        Targets::new().with_default(others).with_target("etalon", own)
    }
}

const EXAMPLES: &str = "\
Examples:
    etalon scenes
    etalon render study:pool -o pool.png
    etalon plan study:pool
    etalon knobs reflection

`etalon FILE` opens FILE in the window, as `etalon view FILE` does.";

/// The commands.
#[derive(Subcommand)]
#[expect(missing_docs, reason = "clap would print a variant's documentation in place of the command's own")]
pub enum Command {
    Render(Box<picture::RenderArgs>),
    Scenes(lists::ScenesArgs),
    Knobs(lists::KnobsArgs),
    Plan(Box<plan::PlanArgs>),
    Diff(diff::DiffArgs),
    Devices(devices::DevicesArgs),
    Verify(verify::VerifyArgs),
    Passport(passport::PassportArgs),
    View(Box<view::ViewArgs>),
    Cost(Box<cost::CostArgs>),
    Merge(merge::MergeArgs),
    Farm(farm::FarmArgs),
    Eval(eval::EvalArgs),
    Plot(plot::PlotArgs),
    Desktop(desktop::DesktopArgs),
    Completions(CompletionsArgs),
    Manual(ManualArgs),
}

/// Print completions for a shell, to be put where it looks for them
#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:\n    etalon completions bash")]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

/// Print the manual page in roff, for `man -l -`
#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:\n    etalon manual")]
pub struct ManualArgs {}

/// The command line as data, for help, manual and completions.
#[must_use]
pub fn command() -> clap::Command {
    Arguments::command()
}

/// The words of a command line, where a scene in place of a command means `view`: `etalon scene.glb`.
#[must_use]
pub fn with_command(mut words: Vec<OsString>) -> Vec<OsString> {
    let is_option = |word: &OsString| word.len() > 1 && word.as_encoded_bytes().starts_with(b"-");
    let mut at = 1;
    while let Some(option) = words.get(at).filter(|word| is_option(word)) {
        at += if option == "--color" { 2 } else { 1 };
    }
    if words.get(at).is_some_and(|word| is_scene(word)) {
        words.insert(at, "view".into());
    }
    words
}

/// Whether a word is a scene and no command: a study scene, an existing file, or a name as files of scenes have it.
fn is_scene(word: &OsStr) -> bool {
    let text = word.to_string_lossy();
    if command().get_subcommands().any(|sub| sub.get_name() == text) || text == "help" {
        return false;
    }
    let is_known = |extension: &OsStr| EXTENSIONS.iter().any(|known| extension.eq_ignore_ascii_case(known));
    text.starts_with("study:") || Path::new(word).extension().is_some_and(is_known) || Path::new(word).is_file()
}

/// Parses a command line. An option that has the name of a knob gets a tip about `--set`; clap's tip to pass an unknown
/// option as a value is left out, because no scene and no picture is meant by it.
///
/// # Errors
/// clap's, which also stand for `--help` and `--version`.
pub fn parse(words: Vec<OsString>) -> Result<Arguments, clap::Error> {
    let parsed = command().try_get_matches_from(with_command(words)).and_then(|matches| {
        let mut arguments = Arguments::from_arg_matches(&matches)?;
        if let (Command::View(view), Some(matches)) = (&mut arguments.command, matches.subcommand_matches("view")) {
            view.complete(matches);
        }
        Ok(arguments)
    });
    parsed.map_err(|mut error| {
        if error.kind() != ErrorKind::UnknownArgument {
            return error;
        }
        if let Some(ContextValue::StyledStrs(mut tips)) = error.remove(ContextKind::Suggested) {
            tips.retain(|tip| !tip.to_string().contains("as a value"));
            if !tips.is_empty() {
                error.insert(ContextKind::Suggested, ContextValue::StyledStrs(tips));
            }
        }
        let wrong = match error.get(ContextKind::InvalidArg) {
            Some(ContextValue::String(name)) => name.trim_start_matches('-').to_owned(),
            _ => String::new(),
        };
        if let Some(knob) = Knob::named(&wrong) {
            let tip = format!("{wrong} is a knob: --set {wrong}={}", knob.presets[1]);
            error.remove(ContextKind::SuggestedArg);
            // clap's usage line is about the option that it would have suggested.
            error.remove(ContextKind::Usage);
            error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![StyledStr::from(tip)]));
        }
        error
    })
}

/// Runs the command that was chosen.
///
/// # Errors
/// Those of the command.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let (quiet, whole) = (arguments.quiet, arguments.verbose > 0);
    // These measure how long the driver compiles.
    if !matches!(arguments.command, Command::Passport(_) | Command::Cost(_))
        && let Some(folder) = cache_folder()
    {
        keep_pipelines_in(folder.join("pipelines"));
    }
    match &arguments.command {
        Command::Render(args) => render::run(args, quiet),
        Command::Scenes(args) => lists::scenes(args),
        Command::Knobs(args) => lists::knobs(args),
        Command::Diff(args) => diff::run(args, whole),
        Command::Devices(args) => devices::run(args),
        Command::View(args) => view::run(args),
        Command::Plan(args) => plan::run(args, whole),
        Command::Cost(args) => cost::run(args, quiet),
        Command::Verify(args) => verify::run(args, quiet, whole),
        Command::Passport(args) => passport::run(args, quiet, whole),
        Command::Merge(args) => merge::run(args),
        Command::Farm(args) => farm::run(args),
        Command::Eval(args) => eval::run(args),
        Command::Plot(args) => plot::run(args),
        Command::Desktop(args) => desktop::run(args, quiet),
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
