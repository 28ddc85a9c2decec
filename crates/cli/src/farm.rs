//! `etalon farm`: job files for engines that split work, and a page about what their workers did.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use clap::{Args, Parser, Subcommand};
use serde_json::Value;

use super::choices::one_of;
use super::picture::RenderArgs;
use super::print;
use etalon::image::file;
use etalon_farm::account::{Account, Shift};
use etalon_farm::frames::Frames;
use etalon_farm::job::{Engine, Work};

/// Write job files for engines that split work over machines, and account for what their workers did
#[derive(Debug, Clone, Args)]
pub struct FarmArgs {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Clone, Subcommand)]
enum Command {
    /// Write a file that an engine reads: tasks that each draw their share, and one that joins parts
    Job(JobArgs),
    /// A page about processes: time line, scaling, devices; of parts, of `render --report` of sequences, of `merge --report`
    Report(ReportArgs),
}

#[derive(Debug, Clone, Args)]
struct JobArgs {
    /// What runs the tasks
    #[arg(long, value_parser = one_of::<Engine>())]
    engine: Engine,
    /// Tasks
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), required_unless_present = "minutes")]
    tasks: Option<u32>,
    /// Minutes that a task should take: as many tasks as that makes, by the seconds that --cost or --seconds says
    #[arg(long, value_name = "MINUTES", conflicts_with = "tasks")]
    minutes: Option<f64>,
    /// What `etalon cost` measured of this scene: the folder, or its cost.json
    #[arg(long, value_name = "DIR", requires = "minutes", conflicts_with = "seconds")]
    cost: Option<PathBuf>,
    /// Seconds of one picture
    #[arg(long, value_name = "SECONDS", requires = "minutes")]
    seconds: Option<f64>,
    /// The program, as workers find it
    #[arg(long, value_name = "PATH", default_value = "etalon")]
    program: String,
    /// The folder in which workers run it [default: this one]
    #[arg(long, value_name = "DIR")]
    here: Option<PathBuf>,
    /// The job file [default: standard output]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Arguments of `etalon render`, after --
    #[arg(last = true, required = true, value_name = "ARGUMENTS")]
    arguments: Vec<String>,
}

#[derive(Debug, Clone, Args)]
struct ReportArgs {
    /// Parts, and accounts of sequences and merged pictures
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The page
    #[arg(short, long, value_name = "FILE.html")]
    output: PathBuf,
}

/// `render` alone, to read its arguments as it does.
#[derive(Parser)]
#[command(name = "etalon render", no_binary_name = true)]
struct Render {
    #[command(flatten)]
    render: RenderArgs,
}

/// Runs the command.
///
/// # Errors
/// One sentence with what was being done, to what, and the cause.
pub fn run(args: &FarmArgs) -> Result<ExitCode> {
    match &args.command {
        Command::Job(job) => write_job(job),
        Command::Report(report) => write_report(report),
    }?;
    Ok(ExitCode::SUCCESS)
}

fn write_report(args: &ReportArgs) -> Result<()> {
    file::check_writable(&args.output)?;
    let mut shifts = Vec::new();
    for path in &args.files {
        shifts.extend(Shift::read(path)?);
    }
    let account = Account::of(shifts)?;
    if account.devices.len() > 1 {
        let all: Vec<&str> = account.devices.keys().map(String::as_str).collect();
        tracing::warn!("a mixed farm, of devices that round otherwise: {}", all.join("; "));
    }
    file::write(&args.output, account.page().as_bytes())?;
    print(&args.output.display().to_string())
}

/// Arguments without the options of these names and their values.
fn without(arguments: &[String], names: &[&str]) -> Vec<String> {
    let mut left = Vec::new();
    let mut all = arguments.iter();
    while let Some(argument) = all.next() {
        let (name, value) =
            argument.split_once('=').map_or((argument.as_str(), None), |(name, value)| (name, Some(value)));
        if names.contains(&name) {
            if value.is_none() {
                all.next();
            }
        } else if !names
            .iter()
            .any(|short| short.len() == 2 && argument.starts_with(short) && !argument.starts_with("--"))
        {
            left.push(argument.clone());
        }
    }
    left
}

fn write_job(args: &JobArgs) -> Result<()> {
    args.output.iter().try_for_each(|path| file::check_writable(path))?;
    // What it prints is the sentence about the mistake, as `etalon render` would have it.
    let Render { render } = Render::try_parse_from(&args.arguments).map_err(|error| anyhow!("{}", error.render()))?;
    let sequence = &render.sequence;
    ensure!(sequence.shard.is_none(), "--shard: the job file gives each task its share");
    let settings = render.render_settings()?;
    let frames = match (&sequence.frames, sequence.turntable) {
        (Some(frames), _) => Some(frames.clone()),
        (None, Some(count)) => Some(Frames::first(count)),
        (None, None) => None,
    };
    let pictures = frames.as_ref().map_or(1, |frames| frames.numbers().len());
    let is_still = frames.is_none();
    ensure!(
        !is_still || sequence.cameras.is_empty(),
        "--cameras: a job of several pictures is divided by frames; add --frames or --turntable"
    );
    ensure!(
        is_still || !render.output.is_empty(),
        "name the files of the frames with -o, such as -o frame.{{frame:04}}.png"
    );
    ensure!(
        is_still || !render.output.iter().any(|path| path.extension().is_some_and(|e| e == "apng")),
        "an animated preview is made by one process, of all frames: run the command itself once more when they are there"
    );
    let seconds_of_task = args.minutes.map_or(300.0, |minutes| minutes * 60.0);
    ensure!(seconds_of_task >= 1.0 && seconds_of_task.is_finite(), "--minutes: a task takes a second at least");
    let count = match (args.tasks, &args.cost, args.seconds) {
        (Some(count), _, _) => count,
        (None, Some(path), _) => {
            let seconds = seconds_by_cost(path, &settings)?;
            tracing::info!("{seconds:.1} s a picture by {}", path.display());
            tasks(seconds * pictures as f64, seconds_of_task)?
        }
        (None, None, Some(seconds)) => tasks(seconds * pictures as f64, seconds_of_task)?,
        (None, None, None) => {
            bail!("--minutes: how long a picture takes is not known; add --cost DIR of `etalon cost`, or --seconds")
        }
    };
    let count = if is_still { count } else { count.min(pictures as u32) };
    let name = render.scene.scene.strip_prefix("study:").map_or_else(|| Path::new(&render.scene.scene), Path::new);
    let name = name.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let here = match &args.here {
        Some(here) => here.clone(),
        None => std::env::current_dir().context("looking for this folder")?,
    };
    let mut outputs: Vec<String> = render.output.iter().map(|path| path.display().to_string()).collect();
    if is_still && outputs.is_empty() {
        outputs.push(format!("{name}.png"));
    }
    let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let work = Work {
        program: args.program.clone(),
        here: here.display().to_string(),
        arguments: if is_still { without(&args.arguments, &["-o", "--output"]) } else { args.arguments.clone() },
        arguments_alone: without(&args.arguments, &["--frames"]),
        outputs: if is_still { outputs } else { Vec::new() },
        frames,
        count,
        seconds: seconds_of_task as u32,
        folder: format!("{plain}.parts"),
        name,
    };
    let text = work.file(args.engine)?;
    match &args.output {
        Some(path) => {
            file::write(path, text.as_bytes())?;
            print(&path.display().to_string())
        }
        None => print(text.trim_end()),
    }
}

/// As many as make tasks of so many seconds.
fn tasks(seconds: f64, of_task: f64) -> Result<u32> {
    ensure!(seconds.is_finite() && seconds > 0.0, "--seconds: expected a number above 0");
    Ok((seconds / of_task).ceil().clamp(1.0, 10_000.0) as u32)
}

/// Seconds that a picture of these knobs took when it was measured, scaled by pixels.
fn seconds_by_cost(path: &Path, settings: &etalon::frame::Settings) -> Result<f64> {
    let path = if path.is_dir() { path.join("cost.json") } else { path.to_owned() };
    let table: Value =
        serde_json::from_slice(&file::read(&path)?).with_context(|| format!("reading {}", path.display()))?;
    let place = path.display();
    let pixels = |size: [u32; 2]| f64::from(size[0]) * f64::from(size[1]);
    let size: [u32; 2] = serde_json::from_value(table["size"].clone()).with_context(|| format!("{place}: its size"))?;
    let knobs = settings.knobs.list();
    // Samples are proportional to time; all else has to be the same.
    let same = |point: &&Value| {
        knobs
            .iter()
            .all(|(knob, rung)| *knob == "samples" || point["knobs"][knob].as_str().is_none_or(|known| known == *rung))
    };
    let all = table["points"].as_array().map_or(&[][..], Vec::as_slice);
    let point = all.iter().find(same).ok_or_else(|| {
        anyhow!("{place} has no picture with these knobs; say --seconds, or run `etalon cost --budget` for longer")
    })?;
    let ms = point["gpu_ms"]["median"].as_f64().ok_or_else(|| anyhow!("{place}: a point without a time"))?;
    let samples: f64 = point["knobs"]["samples"].as_str().and_then(|text| text.parse().ok()).unwrap_or(1.0);
    Ok(ms * 1e-3 * f64::from(settings.knobs.samples.count()) / samples * pixels(settings.size) / pixels(size))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_taken_out_with_their_values() {
        let all = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
        let left =
            without(&all("a.glb -o b.png --output=c.exr --set samples=4 -oe.png --output f.exr"), &["-o", "--output"]);
        assert_eq!(left, all("a.glb --set samples=4"));
        assert_eq!(without(&all("a.glb --frames 1-5 --fps 12"), &["--frames"]), all("a.glb --fps 12"));
    }

    #[test]
    fn tasks_are_as_long_as_asked_for() {
        assert_eq!(tasks(1000.0, 300.0).expect("tasks"), 4);
        assert_eq!(tasks(1.0, 300.0).expect("tasks"), 1);
        assert!(tasks(f64::NAN, 300.0).is_err());
    }
}
