//! `etalon cost`: measures the error and the GPU time of every rung that a scene calls for, and writes the report with
//! the Pareto frontier. The measurements are made by the crate `etalon_cost`; docs/cost.md describes them.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, Result, ensure};
use clap::Args;

use super::budget::{command, keep, kept};
use super::exposure;
use super::heading;
use super::interrupt::Interrupt;
use super::options::{DeviceOptions, PictureOptions, PlanExtent as Planned, SceneOptions, shard};
use super::print;
use super::progress::{ProgressForm, Steps};
use super::setup::{Setup, validated};
use super::usage;
use etalon::frame::Settings;
use etalon::image::file;
use etalon::image::metric::AnyPicture;
use etalon::scene::Prune;
use etalon_cost::beside::Beside;
use etalon_cost::compare::{Compared, compare_rungs, pair};
use etalon_cost::pace::Step;
use etalon_cost::reference::NotMeasured;
use etalon_cost::report;
use etalon_cost::sweep::{Listener, Sweep, SweepExtent, merge};
use etalon_cost::table::Table;

/// Measure what each approximation costs in a scene: its error against the scene's reference, and its GPU time
#[derive(Debug, Clone, Args)]
// Both are refused here, with a sentence.
#[command(mut_arg("max_error", |arg| arg.hide(true)), mut_arg("plan", |arg| arg.hide(true)))]
#[command(after_help = "\
Examples:
    etalon cost study:nested --compare fresnel=schlick,exact --size 320x180
    etalon cost study:nested --size 320x180 -o nested-cost")]
pub struct CostArgs {
    #[command(flatten)]
    scene: SceneOptions,
    /// Folder for report.html, cost.json, cost.csv and the pictures; an interrupted run in this folder is continued
    #[arg(short, long, value_name = "DIR", required_unless_present_any = ["compare", "beside"])]
    output: Option<PathBuf>,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    device: DeviceOptions,
    /// Time budget in seconds: it determines the samples of the reference; pictures for which there is no time are left
    /// out
    #[arg(long, value_name = "SECONDS", default_value_t = 240, value_parser = clap::value_parser!(u32).range(1..), help_heading = heading::SWEEP)]
    budget: u32,
    /// Samples of the reference, regardless of the budget
    #[arg(long, value_name = "N", value_parser = reference_samples, help_heading = heading::SWEEP)]
    reference_samples: Option<u32>,
    /// Draw only the I-th of N parts; each part needs its own folder, and --merge joins the folders
    #[arg(long, value_name = "I/N", value_parser = shard, requires = "reference_samples", help_heading = heading::SWEEP)]
    shard: Option<[u32; 2]>,
    /// Join the parts of a run from these folders instead of measuring
    #[arg(long, value_name = "DIR", num_args = 1.., conflicts_with_all = ["shard", "reference_samples", "budget", "compare", "SceneOptions", "PictureOptions", "DeviceOptions"], help_heading = heading::SWEEP)]
    merge: Vec<PathBuf>,
    /// Compare two finished runs of one scene, for example on two devices, instead of measuring
    #[arg(long, value_names = ["DIR", "DIR"], num_args = 2, conflicts_with_all = ["shard", "reference_samples", "budget", "compare", "merge", "SceneOptions", "PictureOptions", "DeviceOptions"], help_heading = heading::COMPARISON)]
    beside: Vec<PathBuf>,
    /// Also compare a picture of another program with the reference: OpenEXR or PNG of the same size
    #[arg(long, value_name = "FILE", conflicts_with_all = ["merge", "compare", "beside"], help_heading = heading::COMPARISON)]
    judge: Vec<PathBuf>,
    /// Compare two rungs of one knob only: interleaved timing, two lines and a verdict; with -o also both pictures and
    /// their difference
    #[arg(long, value_name = "KNOB=A,B", conflicts_with_all = ["shard", "reference_samples", "budget"], help_heading = heading::COMPARISON)]
    compare: Option<String>,
    /// Print cost.json as well
    #[arg(long)]
    json: bool,
    /// Form of the progress messages
    #[arg(long, value_enum, default_value_t = ProgressForm::Auto, help_heading = heading::MESSAGES)]
    pub progress: ProgressForm,
}

impl CostArgs {
    /// Checks what can be checked before the scene is loaded.
    fn check(&self, settings: &Settings) -> Result<()> {
        match &self.compare {
            Some(wanted) => {
                pair(&settings.knobs, wanted)?;
            }
            None => ensure!(
                self.picture.set.is_empty() && self.picture.model.is_none(),
                "--model and --set: cost chooses the rungs itself; only with --compare KNOB=A,B do they set the other knobs"
            ),
        }
        ensure!(self.picture.plan == Planned::Scene, "--plan: cost always plans the effects that the scene calls for");
        ensure!(self.compare.is_some() || self.output.is_some(), "--output: name a folder for the report");
        ensure!(
            settings.max_error.is_none(),
            "--max-error: cost draws many pictures and ends none of them by its error"
        );
        Ok(())
    }
}

/// Number of samples of a reference.
fn reference_samples(text: &str) -> Result<u32, String> {
    let is_power_of_four =
        |n: &u32| n.is_power_of_two() && n.trailing_zeros().is_multiple_of(2) && (4..=4096).contains(n);
    text.parse().ok().filter(is_power_of_four).ok_or_else(|| "expected 4, 16, 64, 256, 1024 or 4096".to_owned())
}

/// Runs the command.
///
/// # Errors
/// One sentence with the action, its object and the cause.
pub fn run(args: &CostArgs, quiet: bool) -> Result<ExitCode> {
    let output = args.output.clone().unwrap_or_default();
    if !args.merge.is_empty() {
        let table = merge(&args.merge, &output)?;
        return write(args, &output, &table);
    }
    if let [a, b] = &args.beside[..] {
        return beside(args, [a, b]);
    }
    let settings = args.picture.settings(&args.scene)?;
    usage(args.check(&settings))?;
    let others: Vec<(String, AnyPicture)> = args
        .judge
        .iter()
        .map(|path| Ok((path.display().to_string(), AnyPicture::load(path)?)))
        .collect::<Result<_>>()?;
    let steps = Steps::new(args.progress, quiet);
    steps.step(&format!("loading {}", args.scene.label()), 1);
    let mut setup = Setup::load(&args.scene, Prune::Nothing, &args.device)?;
    // All pictures are compared in one light.
    setup.opened.keep_light(&settings.knobs);
    for warning in &setup.opened.warnings {
        tracing::warn!("{warning}");
    }
    let camera = args.scene.choose_camera(setup.opened.scene(), settings.size)?;
    let exposure = exposure::choose(args.picture.exposure, &setup.opened, &setup.device, &settings, &camera)?;
    exposure.sentence.iter().for_each(|line| steps.tell(line));
    let settings = Settings { exposure: exposure.stops, ..settings };
    let picture = args.picture.with_exposure(&exposure);
    let scene = args.scene.with_light_of(&setup.opened, &settings.knobs);
    if let Some(wanted) = &args.compare {
        let mut knobs = settings.knobs.clone();
        args.picture.colour_of(setup.opened.scene(), &mut knobs)?;
        let compared = setup.bench(&args.scene, settings, |bench| compare_rungs(&bench, &knobs, wanted))?;
        drop(steps);
        validated(&setup.device)?;
        if let Some(folder) = &args.output {
            std::fs::create_dir_all(folder).with_context(|| format!("creating {}", folder.display()))?;
            let [a, b] = compared.rungs.map(|rung| format!("{}-{}", compared.knob, rung.replace(':', "-")));
            for (name, bytes) in [a, b, format!("{}-difference", compared.knob)].iter().zip(&compared.pictures) {
                let path = folder.join(format!("{name}.png"));
                file::write(&path, bytes)?;
                print(&path.display().to_string())?;
            }
        }
        return say(args, &compared);
    }
    let contents = setup.contents();
    let sized = |size: [u32; 2]| command(&scene, &PictureOptions { size, ..picture.clone() }, &args.device);
    let interrupt = Interrupt::listen("stopping after this picture; results so far are kept");
    let measured = setup.bench(&args.scene, settings, |bench| {
        let sweep = Sweep {
            bench,
            folder: &output,
            extent: SweepExtent {
                budget_s: args.budget,
                reference_samples: args.reference_samples,
                shard: args.shard.unwrap_or([1, 1]),
            },
            command: &sized,
            scene: &args.scene.scene,
            contents: &contents,
            kept: &|command| kept(command, &setup),
            may_shrink: true,
            others: &others,
            stopped: &|| interrupt.is_asked(),
        };
        sweep.run(&mut Listener {
            step: &mut |step: Step<'_>| steps.of(step.name, step.done, step.of, step.left_s),
            early: &mut |table: &Table| {
                let page = report::page(table, &output.join("pictures"))?;
                file::write(&output.join("report.html"), page.as_bytes())
            },
        })
    });
    drop(steps);
    let table = match measured {
        Ok(table) => table,
        Err(error) => {
            if let Some(nothing) = error.downcast_ref::<NotMeasured>() {
                file::write(&output.join("report.html"), report::nothing(&args.scene.scene, nothing).as_bytes())?;
            }
            return Err(error);
        }
    };
    validated(&setup.device)?;
    let done = write(args, &output, &table)?;
    if args.shard.is_none() {
        keep(&table.command, &setup, &output);
    }
    Ok(done)
}

/// Prints time and error of the points that two tables share, and the work counts that differ.
fn beside(args: &CostArgs, folders: [&PathBuf; 2]) -> Result<ExitCode> {
    let read = |folder: &PathBuf| -> Result<Table> {
        let path = folder.join("cost.json");
        serde_json::from_slice(&file::read(&path)?).with_context(|| format!("reading {}", path.display()))
    };
    let [a, b] = [read(folders[0])?, read(folders[1])?];
    for (what, a, b) in [("scenes", &a.scene, &b.scene), ("sizes", &format!("{:?}", a.size), &format!("{:?}", b.size))]
    {
        ensure!(a == b, "--beside: two runs have different {what}, {a} and {b}");
    }
    let rows = Beside::of(&a, &b);
    ensure!(!rows.is_empty(), "--beside: the two runs share no picture");
    if args.json {
        print(&serde_json::to_string_pretty(&rows)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut table = comfy_table::Table::new();
    table.load_preset(comfy_table::presets::NOTHING);
    table.set_header(["picture", "A ms", "B ms", "B/A", "A error %", "B error %", "work"]);
    for row in &rows {
        let [a, b] = row.gpu_ms;
        let work = if row.same_work { "same".to_owned() } else { row.other_work.join(", ") };
        let errors = row.error.map(|error| format!("{:.2}", 100.0 * error));
        table.add_row([
            row.picture.clone(),
            format!("{a:.2}"),
            format!("{b:.2}"),
            format!("{:.2}", b / a),
            errors[0].clone(),
            errors[1].clone(),
            work,
        ]);
    }
    for (name, table) in [("A", &a), ("B", &b)] {
        print(&format!(
            "{name}: {} ({}), {} {}",
            table.device.name, table.device.kind, table.device.driver, table.device.version
        ))?;
    }
    print(&table.to_string())?;
    // Only the picture that took longest: the JSON has the whole list.
    let longest = rows.iter().filter(|row| !row.compiled.is_empty()).max_by(|x, y| x.gpu_ms[0].total_cmp(&y.gpu_ms[0]));
    if let Some(row) = longest {
        print(&format!("\nCompiler statistics of \"{}\", as the drivers report them:", row.picture))?;
        for program in &row.compiled {
            for (name, stages) in ["A", "B"].iter().zip(&program.stages) {
                for stage in stages {
                    let figures: Vec<String> =
                        stage.figures.iter().map(|(what, value)| format!("{what} {value}")).collect();
                    print(&format!("{name} {} ({}): {}", program.program, stage.stage, figures.join(", ")))?;
                }
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints a line for each rung and a verdict.
fn say(args: &CostArgs, compared: &Compared) -> Result<ExitCode> {
    if args.json {
        print(&serde_json::to_string_pretty(compared)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    let Compared { knob, rungs, gpu_ms, price, worst_pixel, .. } = compared;
    let width = rungs.map(str::len).into_iter().max().unwrap_or_default();
    for (rung, ms) in rungs.iter().zip(gpu_ms) {
        let error = if *rung == price.to {
            let error = 100.0 * price.shown_delta.median.max(0.0).sqrt();
            format!("error {error:.3} %, FLIP {:.4}", price.flip_between)
        } else {
            "baseline".to_owned()
        };
        print(&format!("{knob}={rung:width$}  {:8.2} ms ({:.2} … {:.2})  {error}", ms.median, ms.low, ms.high))?;
    }
    let worst = if price.same {
        String::new()
    } else {
        format!("; largest difference at pixel {},{}", worst_pixel.x, worst_pixel.y)
    };
    print(&format!("{knob}={} instead of {}: {}{worst}", price.to, price.from, price.verdict))?;
    Ok(ExitCode::SUCCESS)
}

fn write(args: &CostArgs, output: &std::path::Path, table: &Table) -> Result<ExitCode> {
    file::write(&output.join("cost.csv"), &table.csv()?)?;
    file::write(&output.join("report.html"), report::page(table, &output.join("pictures"))?.as_bytes())?;
    // cost.json is written last: it marks a finished run.
    let json = serde_json::to_string_pretty(table)?;
    file::write(&output.join("cost.json"), json.as_bytes())?;
    if args.json {
        print(&json)?;
    } else {
        print(&output.join("report.html").display().to_string())?;
    }
    Ok(ExitCode::SUCCESS)
}
