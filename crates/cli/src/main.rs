//! The program `etalon`: arguments and exit codes, nothing else.

use std::io::IsTerminal as _;
use std::process::ExitCode;

use etalon_cli::arguments::{self, Command};
use etalon_cli::exit_codes::{AGAIN, WRONG};
use etalon_cli::options::When;
use etalon_cli::progress::ProgressForm;
use tracing_subscriber::fmt;
use tracing_subscriber::prelude::*;

fn main() -> ExitCode {
    let arguments = arguments::parse(std::env::args_os().collect()).unwrap_or_else(|error| error.exit());
    let color = match arguments.color {
        When::Always => true,
        When::Never => false,
        When::Auto => std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none(),
    };
    let lines = fmt::layer().with_writer(std::io::stderr).with_ansi(color).with_target(false).without_time();
    tracing_subscriber::registry().with(lines).with(arguments.messages()).init();
    let result = arguments::run(&arguments);
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
        match &error {
            error if etalon_cli::is_wrong_usage(error) => ExitCode::from(WRONG),
            error if etalon_cli::is_worth_another_try(error) => ExitCode::from(AGAIN),
            _ => ExitCode::FAILURE,
        }
    })
}
