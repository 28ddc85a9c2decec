//! `etalon view`: opens the desktop viewer of the crate `etalon_viewer`. See docs/view.md.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use anyhow::{Result, bail, ensure};
use clap::Args;

use super::budget;
use super::exposure::{self, Exposure};
use super::options::{AnimationTime, DeviceOptions, PictureOptions, PlanExtent, SceneOptions};
use super::{heading, usage};
use etalon::frame::Settings;
use etalon::gpu::{Device, Severity};
use etalon::image::file;
use etalon::open::{Opened, is_file};
use etalon::scene::{Camera, Prune, Scene};
use etalon_cost::command::arguments;
use etalon_farm::identity::contents;
use etalon_viewer::shared::{Loaded, OpenRequest, SceneSource};
use etalon_viewer::{Start, View, run as run_window};

/// Open a window that shows the scene, with its plan, pass times, and the rays and equations of a pixel
#[derive(Debug, Clone, Args)]
// It is refused here, with a sentence.
#[command(mut_arg("max_error", |arg| arg.hide(true)))]
#[command(after_help = "\
Examples:
    etalon view study:pool
    etalon view scene.glb --size 1600x900 --set samples=16")]
pub struct ViewArgs {
    #[command(flatten)]
    scene: SceneOptions,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    device: DeviceOptions,
    /// Start without panels; the key P shows them
    #[arg(long, help_heading = heading::WINDOW)]
    bare: bool,
}

impl SceneSource for ViewArgs {
    fn open(&self, asked: OpenRequest<'_>, device: &Arc<Device>) -> Result<Loaded> {
        let options = &asked_for(&self.scene, asked.file, asked.time);
        let scene = options.load(Prune::Nothing)?;
        let (environment, more) = options.load_environment()?;
        let camera = options.choose_camera(&scene, asked.size)?;
        let framed = options.frames(&scene);
        let chosen = self.picture.knobs()?;
        let mut knobs = chosen.clone();
        self.picture.colour_of(&scene, &mut knobs)?;
        let mut opened = Opened::named(&options.scene, scene, environment, options.asks_for_environment());
        opened.warnings.extend(more);
        let settings = Settings { size: asked.size, knobs: knobs.clone(), ..self.picture.settings(options)? };
        let exposure = exposure::choose(self.picture.exposure, &opened, device, &settings, &camera)?;
        // `cost` measures at the size of the command line, not at the size of the picture in the window.
        let priced = budget::command(
            &options.with_light_of(&opened, &chosen),
            &exposure.written_out(&self.picture),
            &self.device,
        );
        let prices = budget::known(&priced, &contents(opened.scene(), opened.environment()), device.info());
        opened.warnings.extend(exposure.sentence);
        let (lit, as_lit) = opened.lit(Settings { knobs: knobs.clone(), ..Settings::default() });
        Ok(Loaded {
            name: opened.scene().name.clone(),
            environment: lit.cloned().map(|map| (Arc::new(map), as_lit.environment_intensity)),
            camera,
            framed,
            knobs: (knobs != chosen).then_some(knobs),
            warnings: opened.warnings.clone(),
            prices: prices.map(Arc::new),
            original: opened.original.clone(),
            exposure: exposure.stops,
        })
    }

    fn moment(&self, asked: OpenRequest<'_>) -> Result<(Scene, Camera)> {
        let options = asked_for(&self.scene, asked.file, asked.time);
        let scene = options.load(Prune::Nothing)?;
        let camera = options.choose_camera(&scene, asked.size)?;
        Ok((scene, camera))
    }
}

impl ViewArgs {
    /// Refuses options that the viewer has no use for.
    fn check(&self) -> Result<()> {
        ensure!(
            self.picture.max_error.is_none(),
            "--max-error: the viewer always draws all samples; use this option with `render`"
        );
        ensure!(
            self.picture.plan != PlanExtent::ExplainCost,
            "--plan explain-cost: the viewer does not measure the cost of effects; use this option with `plan` or `render`"
        );
        ensure!(self.scene.scene != "-", "-: the viewer reads its file again; name a file");
        Ok(())
    }
}

/// The options for another file or another time. For another file, camera and time of the first file are dropped.
fn asked_for(options: &SceneOptions, file: Option<&Path>, time: Option<f64>) -> SceneOptions {
    let options = match file {
        None => options.clone(),
        Some(path) => SceneOptions {
            scene: path.display().to_string(),
            camera: None,
            eye: None,
            target: None,
            up: None,
            time: AnimationTime(None),
            ..options.clone()
        },
    };
    SceneOptions { time: time.map_or(options.time, |time| AnimationTime(Some(time))), ..options }
}

/// The `etalon render` command that draws a view.
fn command(args: &ViewArgs, view: &View<'_>) -> String {
    let mut scene = asked_for(&args.scene, view.file, view.time);
    scene.env_rotation = view.settings.environment_rotation;
    if view.camera.is_some() || view.named.is_some() {
        (scene.camera, scene.eye, scene.target, scene.up, scene.fov) = (None, None, None, None, None);
    }
    scene.camera = view.named.map(str::to_owned).or(scene.camera);
    let picture = PictureOptions {
        size: view.settings.size,
        exposure: Some(Exposure::Stops(view.settings.exposure))
            .filter(|_| is_file(&scene.scene) || view.settings.exposure != 0.0),
        tonemap: view.settings.tonemap,
        ..args.picture.clone()
    };
    let seed = (args.picture.seed != 0).then(|| format!("--seed {}", args.picture.seed));
    let words = [
        vec!["etalon render".to_owned()],
        scene.words(),
        view.camera.clone().into_iter().collect(),
        picture.words(),
        seed.into_iter().collect(),
        vec![arguments(&view.settings.knobs)],
        args.device.words(),
        vec!["-o picture.png".to_owned()],
    ];
    words.concat().join(" ")
}

/// File that lists recently opened files, one per line.
fn notes() -> Option<PathBuf> {
    Some(file::cache_folder()?.join("recent"))
}

fn recent() -> Vec<PathBuf> {
    let text = notes().and_then(|path| std::fs::read_to_string(path).ok()).unwrap_or_default();
    text.lines().map(PathBuf::from).filter(|path| path.is_file()).collect()
}

/// Stores the recent files. If the list cannot be written, they are known until the window is closed.
fn keep(recent: &[PathBuf]) {
    let text: String = recent.iter().map(|path| format!("{}\n", path.display())).collect();
    let write = |path: PathBuf| {
        path.parent().map_or(Ok(()), std::fs::create_dir_all)?;
        file::write(&path, text.as_bytes())
    };
    let written = notes().map(write);
    if let Some(Err(error)) = written {
        tracing::info!("the list of recent files cannot be written: {error:#}");
    }
}

/// Runs the command.
///
/// # Errors
/// One sentence when there is no display or no device, or when a file cannot be read.
pub fn run(args: &ViewArgs) -> Result<ExitCode> {
    usage(args.check())?;
    let settings = args.picture.settings(&args.scene)?;
    let told = args.clone();
    let first = is_file(&args.scene.scene).then(|| PathBuf::from(&args.scene.scene));
    let messages = run_window(Start {
        file: first,
        size: args.picture.size,
        settings,
        device: args.device.choice(),
        validate: args.device.validate,
        panels: !args.bare,
        source: Box::new(args.clone()),
        command: Box::new(move |view| command(&told, view)),
        recent: recent(),
        keep: Box::new(keep),
        // A closed terminal does not close the window.
        said: Box::new(|command| drop(super::print(command))),
    })?;
    let errors: Vec<_> = messages.iter().filter(|message| message.severity == Severity::Error).collect();
    if let Some(first) = errors.first() {
        bail!("validation: {} errors, the first: {}", errors.len(), first.text);
    }
    Ok(ExitCode::SUCCESS)
}
