//! `etalon passport`: what the device here is, keeps and breaks, in one JSON file that can be mailed. See
//! docs/passport.md.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, Result, bail};
use clap::Args;
use clap::builder::PossibleValuesParser;

use super::choices::one_of;
use super::options::DeviceOptions;
use super::progress::{ProgressForm, Steps};
use super::{heading, print};
use etalon::gpu::{Device, Severity};
use etalon::image::file;
use etalon::study;
use etalon_passport::{Passport, Scope, Section, measure};

/// Measure what the device here is, keeps and breaks, in some minutes: one JSON file to look at or to mail
///
/// It holds what the device says of itself, the errors of its arithmetic, the bounds of `verify`, the study scenes and
/// speeds. Nothing of it tells who measured.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
    etalon passport -o card.json
    etalon passport --only arithmetic --only speed
    etalon passport --check card.json")]
pub struct PassportArgs {
    /// Output file
    #[arg(short, long, value_name = "FILE.json", default_value = "passport.json", conflicts_with = "check")]
    pub output: PathBuf,
    /// Read this file and check it: its form, and its verdicts against its measurements; nothing is measured
    #[arg(long, value_name = "FILE.json", conflicts_with_all = ["only", "scene", "device", "validate"])]
    pub check: Option<PathBuf>,
    /// Only this part; repeatable. What the device says of itself is always there
    #[arg(long, value_name = "PART", value_parser = one_of::<Section>())]
    pub only: Vec<Section>,
    /// Only this study scene; repeatable [default: all]
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(study::NAMES))]
    pub scene: Vec<String>,
    /// Device and validation
    #[command(flatten)]
    pub device: DeviceOptions,
    /// Progress on standard error
    #[arg(long, value_enum, default_value_t = ProgressForm::Auto, help_heading = heading::MESSAGES)]
    pub progress: ProgressForm,
}

/// Runs the command: exit 0 when the file is written, or is in order.
///
/// # Errors
/// When the device cannot be opened, when the file cannot be written, or with `--check` when it is not in order.
pub fn run(args: &PassportArgs, quiet: bool, whole: bool) -> Result<ExitCode> {
    if let Some(path) = &args.check {
        let text = String::from_utf8(file::read(path)?).context("reading a passport")?;
        let passport = Passport::read(&text).with_context(|| path.display().to_string())?;
        account(&passport, whole)?;
        return Ok(ExitCode::SUCCESS);
    }
    let choice = args.device.choice();
    let device = Device::open(&choice, args.device.validate)?;
    let mut scope = Scope::of(&device);
    if !args.only.is_empty() {
        scope.sections = args.only.clone();
    }
    if !args.scene.is_empty() {
        scope.scenes = args.scene.iter().map(|name| format!("study:{name}")).collect();
    }
    let steps = Steps::new(args.progress, quiet);
    let passport = measure(&device, &choice, &scope, &mut |step| steps.step(step, 1))?;
    drop(steps);
    file::write(&args.output, passport.to_json()?.as_bytes())?;
    account(&passport, whole)?;
    print(&format!("{}: written in {:.0} s", args.output.display(), passport.seconds))?;
    let errors = device.messages().into_iter().find(|message| message.severity == Severity::Error);
    if let Some(first) = errors {
        bail!("validation: {}", first.text);
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints the device and what it breaks; with `whole`, also what it keeps.
fn account(passport: &Passport, whole: bool) -> Result<()> {
    let device = &passport.device;
    print(&format!("{} ({}, {}, Vulkan {})", device.name, device.kind, device.driver, device.api))?;
    for promise in passport.promises.iter().filter(|promise| whole || !promise.held) {
        let verdict = if promise.held { "held  " } else { "BROKEN" };
        print(&format!("{verdict}  {}: {}", promise.promise, promise.figure))?;
    }
    let held = passport.promises.iter().filter(|promise| promise.held).count();
    print(&format!("{held} of {} promises are held", passport.promises.len()))
}
