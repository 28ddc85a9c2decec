//! `etalon farm`: writes job files for render-farm engines, and a report about the workers. See docs/farm.md.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, Result, anyhow, ensure};
use clap::{Args, Parser, Subcommand};
use serde_json::Value;

use super::choices::one_of;
use super::picture::{RenderArgs, default_stem, differs, format_of};
use super::sequence::wanted;
use super::shard::only_output;
use super::{print, usage};
use etalon::image::file;
use etalon_farm::account::{Account, Shift};
use etalon_farm::frames::Frames;
use etalon_farm::job::{Engine, JobWork};

/// Write job files for engines that split work over machines, and a report about their workers
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
    etalon farm job --engine slurm --tasks 4 -- study:pool --model global
    etalon farm job --engine openjd --minutes 5 --seconds 20 -o job.yaml -- study:pool --turntable 90 -o {frame:04}.png")]
pub struct FarmArgs {
    #[command(subcommand)]
    command: FarmCommand,
}

#[derive(Debug, Clone, Subcommand)]
enum FarmCommand {
    /// Write a job file for an engine: tasks that each draw a share, and a task that joins parts
    Job(JobArgs),
    /// Write an HTML page about the processes, with time line, scaling and devices, from parts and from reports of
    /// sequences and merges
    Report(ReportArgs),
}

#[derive(Debug, Clone, Args)]
struct JobArgs {
    /// Engine that runs the tasks
    #[arg(long, value_parser = one_of::<Engine>())]
    engine: Engine,
    /// Number of tasks
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), required_unless_present = "minutes")]
    tasks: Option<u32>,
    /// Minutes that a task should take: the number of tasks follows from the seconds of --cost or --seconds
    #[arg(long, value_name = "MINUTES", conflicts_with = "tasks")]
    minutes: Option<f64>,
    /// Measurements of this scene by `etalon cost`: the folder, or its cost.json
    #[arg(long, value_name = "DIR", requires = "minutes", conflicts_with = "seconds")]
    cost: Option<PathBuf>,
    /// Seconds that one picture takes
    #[arg(long, value_name = "SECONDS", requires = "minutes")]
    seconds: Option<f64>,
    /// Path of the program on the workers
    #[arg(long, value_name = "PATH", default_value = "etalon")]
    program: String,
    /// Folder in which workers run the program [default: the current folder]
    #[arg(long, value_name = "DIR")]
    here: Option<PathBuf>,
    /// Job file to write [default: standard output]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Arguments of `etalon render`, after `--`
    #[arg(last = true, required = true, value_name = "ARGUMENTS")]
    arguments: Vec<String>,
}

#[derive(Debug, Clone, Args)]
struct ReportArgs {
    /// Parts, and reports of sequences and merged pictures
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// HTML page to write
    #[arg(short, long, value_name = "FILE.html")]
    output: PathBuf,
}

impl JobArgs {
    /// Refuses a folder for engines whose files name none.
    fn check_folder(&self) -> Result<()> {
        let is_named = !matches!(self.engine, Engine::Slurm | Engine::Hyperqueue | Engine::Kubernetes);
        ensure!(
            self.here.is_none() || is_named,
            "--here: tasks of this engine run where the job file says or is submitted"
        );
        Ok(())
    }
}

/// The command line of `render`, to parse its arguments the same way.
#[derive(Parser)]
#[command(name = "etalon render", no_binary_name = true)]
struct Render {
    #[command(flatten)]
    render: RenderArgs,
}

/// Runs the command.
///
/// # Errors
/// One sentence with the action, its object and the cause.
pub fn run(args: &FarmArgs) -> Result<ExitCode> {
    match &args.command {
        FarmCommand::Job(job) => write_job(job),
        FarmCommand::Report(report) => write_report(report),
    }?;
    Ok(ExitCode::SUCCESS)
}

fn write_report(args: &ReportArgs) -> Result<()> {
    usage(args.files.iter().try_for_each(|file| differs("--output", &args.output, file)))?;
    file::check_writable(&args.output)?;
    let mut shifts = Vec::new();
    for path in &args.files {
        shifts.extend(Shift::read(path)?);
    }
    let account = Account::of(shifts)?;
    if account.devices.len() > 1 {
        let all: Vec<&str> = account.devices.keys().map(String::as_str).collect();
        tracing::warn!("the workers used different devices, whose rounding may differ: {}", all.join("; "));
    }
    file::write(&args.output, account.page().as_bytes())?;
    print(&args.output.display().to_string())
}

/// Removes the options of these names and their values from the arguments.
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

/// The arguments of `etalon render`, parsed and checked.
fn rendering(arguments: &[String]) -> Result<RenderArgs> {
    // The error sentence is that of `etalon render`.
    let Render { render } = Render::try_parse_from(arguments).map_err(|error| anyhow!("{}", error.render()))?;
    let sequence = &render.sequence;
    ensure!(sequence.shard.is_none(), "--shard: the job file gives each task its own share; leave this option out");
    ensure!(render.scene.scene != "-", "-: each task reads the scene again; name a file");
    let is_still = sequence.frames.is_none() && sequence.turntable.is_none();
    ensure!(
        !is_still || sequence.cameras.is_empty(),
        "--cameras: several pictures are divided by frames; add --frames or --turntable"
    );
    ensure!(
        is_still || !render.output.is_empty(),
        "--output: name the files of the frames, for example -o frame.{{frame:04}}.png"
    );
    ensure!(
        is_still || !render.output.iter().any(|path| path.extension().is_some_and(|e| e == "apng")),
        "--output: one process makes an animated preview from all frames; when they are drawn, run `etalon render` itself once more"
    );
    ensure!(!render.keep, "--keep: a task that is ended keeps what it has drawn; leave this option out");
    if is_still {
        ensure!(sequence.fps.is_none(), "--fps: the command draws no frames; add --frames or --turntable");
        ensure!(render.format.is_none(), "--format: parts are joined to .png and .exr; leave this option out");
        render.output.iter().try_for_each(|path| format_of(path).map(|_| ()))?;
        // What a task is given: a share, and one file for its part.
        let part = RenderArgs { output: vec![PathBuf::from("1.part")], ..render.clone() };
        only_output(&part, [1, 1], &render.render_settings()?)?;
    } else {
        wanted(&render)?;
    }
    Ok(render)
}

fn write_job(args: &JobArgs) -> Result<()> {
    let render = usage(rendering(&args.arguments))?;
    usage(args.check_folder())?;
    args.output.iter().try_for_each(|path| file::check_writable(path))?;
    let settings = render.render_settings()?;
    let frames = match (&render.sequence.frames, render.sequence.turntable) {
        (Some(frames), _) => Some(frames.clone()),
        (None, Some(count)) => Some(Frames::first(count)),
        (None, None) => None,
    };
    let pictures = frames.as_ref().map_or(1, |frames| frames.numbers().len());
    let is_still = frames.is_none();
    let seconds_of_task = args.minutes.map_or(300.0, |minutes| minutes * 60.0);
    ensure!(seconds_of_task >= 1.0 && seconds_of_task.is_finite(), "--minutes: a task must take at least one second");
    let count = match (args.tasks, &args.cost, args.seconds) {
        (Some(count), _, _) => count,
        (None, Some(path), _) => {
            let seconds = seconds_by_cost(path, &settings)?;
            tracing::info!("{seconds:.1} s per picture according to {}", path.display());
            tasks(seconds * pictures as f64, seconds_of_task)?
        }
        (None, None, Some(seconds)) => tasks(seconds * pictures as f64, seconds_of_task)?,
        (None, None, None) => {
            let why = "--minutes: the time of a picture is unknown; add --cost DIR of `etalon cost`, or --seconds";
            return usage(Err(anyhow!("{why}")));
        }
    };
    let count = if is_still { count } else { count.min(pictures as u32) };
    let name = default_stem(&render.scene.scene)?;
    let here = match &args.here {
        Some(here) => here.clone(),
        None => std::env::current_dir().context("finding the current folder")?,
    };
    let mut outputs: Vec<String> = render.output.iter().map(|path| path.display().to_string()).collect();
    if is_still && outputs.is_empty() {
        outputs.push(format!("{name}.png"));
    }
    let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let work = JobWork {
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

/// Number of tasks of `of_task` seconds that `seconds` of work make, from 1 to 10,000.
fn tasks(seconds: f64, of_task: f64) -> Result<u32> {
    ensure!(seconds.is_finite() && seconds > 0.0, "--seconds: expected a number above 0");
    Ok((seconds / of_task).ceil().clamp(1.0, 10_000.0) as u32)
}

/// Seconds of a picture with these knobs, from a measurement of `etalon cost`, scaled by pixels and samples.
fn seconds_by_cost(path: &Path, settings: &etalon::frame::Settings) -> Result<f64> {
    let path = if path.is_dir() { path.join("cost.json") } else { path.to_owned() };
    let table: Value =
        serde_json::from_slice(&file::read(&path)?).with_context(|| format!("reading {}", path.display()))?;
    let place = path.display();
    let pixels = |size: [u32; 2]| f64::from(size[0]) * f64::from(size[1]);
    let size: [u32; 2] =
        serde_json::from_value(table["size"].clone()).with_context(|| format!("{place}: reading \"size\""))?;
    let knobs = settings.knobs.list();
    // Time is proportional to samples; all other knobs have to be equal.
    let same = |point: &&Value| {
        knobs
            .iter()
            .all(|(knob, rung)| *knob == "samples" || point["knobs"][knob].as_str().is_none_or(|known| known == *rung))
    };
    let all = table["points"].as_array().map_or(&[][..], Vec::as_slice);
    let point = all.iter().find(same).ok_or_else(|| {
        anyhow!("{place} has no picture with these knobs; give --seconds, or run `etalon cost` with a larger --budget")
    })?;
    let ms = point["gpu_ms"]["median"].as_f64().ok_or_else(|| anyhow!("{place}: a point has no time"))?;
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
