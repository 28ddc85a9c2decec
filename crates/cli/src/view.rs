//! `etalon view`: opens the desktop viewer of the crate `etalon_viewer`. See docs/view.md.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, Result, bail, ensure};
use clap::parser::ValueSource;
use clap::{ArgMatches, Args};

use super::budget;
use super::exposure::{self, Exposure};
use super::options::{AnimationTime, DeviceOptions, Missing, PictureOptions, PlanExtent, SceneOptions};
use super::{desktop, heading, icon, usage};
use etalon::frame::{Background, Settings};
use etalon::gpu::{Device, Severity};
use etalon::open::{Opened, is_file};
use etalon::scene::{Camera, Prune, REPLACED, Scene, Source};
use etalon_cost::command::arguments;
use etalon_farm::identity::contents;
use etalon_viewer::shared::{FileChoice, Loaded, OpenRequest, SceneSource};
use etalon_viewer::{Start, View, run as run_window};

/// Open a window that shows the scene, with its plan, pass times, and the rays and equations of a pixel
#[derive(Debug, Clone, Args)]
// It is refused here, with a sentence.
#[command(mut_arg("max_error", |arg| arg.hide(true)))]
#[command(mut_arg("size", |arg| arg.help("Width and height of the window in pixels [default: those of the last run]").hide_default_value(true)))]
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
    /// Whether --size is on the command line; without it, the window has the size of the last run.
    #[arg(skip)]
    size_is_given: bool,
    /// Whether a checker stands in the place of an image of the shown scene: its `render` command then allows that.
    #[arg(skip)]
    has_checkers: Arc<AtomicBool>,
}

/// Loader of scenes: an animated file is read once.
struct FileSource {
    args: ViewArgs,
    /// The file that was read last, and how.
    open: Option<(SceneOptions, Source)>,
}

impl FileSource {
    /// The scene of these options at their time.
    fn read(&mut self, options: &SceneOptions, again: bool) -> Result<Scene> {
        let still = |options: &SceneOptions| SceneOptions { time: AnimationTime(None), ..options.clone() };
        let is_same = |known: &SceneOptions| known.words() == still(options).words();
        if again || self.open.as_ref().is_none_or(|(known, _)| !is_same(known)) {
            // Unless the options say otherwise, with checkers in place of images that cannot be read.
            let missing = options.missing.or(Some(Missing::Checker));
            let read = SceneOptions { missing, ..options.clone() }.load_options(Prune::Nothing);
            let source = etalon::open::source(&options.scene, read)?;
            self.open = Some((still(options), source));
        }
        let (_, source) = self.open.as_mut().context("reading a scene")?;
        source.at(options.time.0)
    }
}

/// Side of the window's icon in pixels.
const ICON: u32 = 64;

impl SceneSource for FileSource {
    fn open(&mut self, asked: OpenRequest<'_>, device: &Arc<Device>) -> Result<Loaded> {
        let options = &asked_for(&self.args.scene, asked.file, asked.choice, asked.time);
        let scene = self.read(options, true)?;
        let this = &self.args;
        let (environment, more) = options.load_environment()?;
        let camera = options.choose_camera(&scene, asked.size)?;
        let framed = options.frames(&scene);
        let chosen = this.picture.knobs()?;
        let mut knobs = chosen.clone();
        this.picture.colour_of(&scene, &mut knobs)?;
        // Whether the environment is the background changes in the window.
        let mut opened = Opened::named(&options.scene, scene, environment, options.env.is_some());
        opened.warnings.extend(more);
        let settings = Settings { size: asked.size, knobs: knobs.clone(), ..this.picture.settings(options)? };
        let exposure = exposure::choose(this.picture.exposure, &opened, device, &settings, &camera)?;
        // `cost` measures at the size of the command line, not at the size of the picture in the window.
        let priced = budget::command(
            &options.with_light_of(&opened, &chosen),
            &this.picture.with_exposure(&exposure),
            &this.device,
        );
        let prices = budget::known(&priced, &contents(opened.scene(), opened.environment()), device.info());
        // A metered exposure is a choice of how it is shown; without one, nothing can be seen.
        let is_metered = exposure.from == "metered";
        opened.warnings.extend(exposure.sentence.clone().filter(|_| !is_metered));
        this.has_checkers.store(opened.warnings.iter().any(|warning| warning.ends_with(REPLACED)), Ordering::Relaxed);
        if options.background_blur > 0.0 && opened.lit(settings).0.is_none() {
            opened.warnings.push("--background-blur: the background is not an environment".to_owned());
        }
        Ok(Loaded {
            name: opened.scene().name.clone(),
            camera,
            framed,
            colour: this.picture.leaves_colour().then_some(knobs.colour),
            warnings: opened.warnings.clone(),
            prices: prices.map(Arc::new),
            original: opened.original.clone(),
            light: Arc::new(opened),
            exposure: exposure.stops,
            exposure_from: exposure.sentence.filter(|_| is_metered),
        })
    }

    fn moment(&mut self, asked: OpenRequest<'_>) -> Result<(Scene, Camera)> {
        let options = asked_for(&self.args.scene, asked.file, asked.choice, asked.time);
        let scene = self.read(&options, false)?;
        let camera = options.choose_camera(&scene, asked.size)?;
        Ok((scene, camera))
    }
}

impl ViewArgs {
    /// Takes over what only the matches know.
    pub(super) fn complete(&mut self, matches: &ArgMatches) {
        self.size_is_given = matches.value_source("size") == Some(ValueSource::CommandLine);
    }

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

/// The options for another file, another choice of what is shown, or another time. For another file, camera and time of
/// the first file are dropped.
fn asked_for(options: &SceneOptions, file: Option<&Path>, choice: &FileChoice, time: Option<f64>) -> SceneOptions {
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
    let FileChoice { scene, variant, animation, hide, only, environment, key_light } = choice.clone();
    SceneOptions {
        scene_of_file: scene,
        variant,
        animation,
        hide,
        only,
        env: environment,
        key_light,
        time: time.map_or(options.time, |time| AnimationTime(Some(time))),
        ..options
    }
}

/// What the command line chooses.
fn choice_of(options: &SceneOptions) -> FileChoice {
    FileChoice {
        scene: options.scene_of_file.clone(),
        variant: options.variant.clone(),
        animation: options.animation.clone(),
        hide: options.hide.clone(),
        only: options.only.clone(),
        environment: options.env.clone(),
        key_light: options.key_light,
    }
}

/// The `etalon render` command that draws a view.
fn command(args: &ViewArgs, view: &View<'_>) -> String {
    let mut scene = asked_for(&args.scene, view.file, view.choice, view.time);
    scene.missing = args.has_checkers.load(Ordering::Relaxed).then_some(Missing::Checker);
    let dark = scene.env.as_deref() == Some("none");
    scene.env_rotation = if dark { 0.0 } else { view.settings.environment_rotation };
    scene.env_intensity = if dark { 1.0 } else { view.settings.environment_intensity };
    scene.background_blur = view.settings.background_blur;
    let background = view.settings.background;
    scene.background = Some(background).filter(|background| *background != Background::Default);
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
        time: args.scene.time.0,
        size: args.size_is_given.then_some(args.picture.size),
        id: desktop::ID,
        icon: (ICON, icon::pixels(ICON)),
        settings,
        device: args.device.choice(),
        validate: args.device.validate,
        panels: !args.bare,
        choice: choice_of(&args.scene),
        source: Box::new(FileSource { args: args.clone(), open: None }),
        command: Box::new(move |view| command(&told, view)),
        // A closed terminal does not close the window.
        said: Box::new(|command| drop(super::print(command))),
    })?;
    let errors: Vec<_> = messages.iter().filter(|message| message.severity == Severity::Error).collect();
    if let Some(first) = errors.first() {
        bail!("validation: {} errors, the first: {}", errors.len(), first.text);
    }
    Ok(ExitCode::SUCCESS)
}
