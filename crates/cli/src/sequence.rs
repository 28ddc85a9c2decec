//! `etalon render` of many pictures: the frames of an animation, a turntable, several cameras. What is the same for all of them is read,
//! uploaded and compiled once.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use glam::{DAffine3, DVec3};
use serde::Serialize;

use super::options::{Extent, SceneOptions};
use super::picture::{Format, RenderArgs, check_halves, format_of, layers, metadata, settings_size, warn_about};
use super::print;
use super::progress::Steps;
use super::report::{Output, Validation};
use super::setup;
use etalon::frame::{Renderer, Settings};
use etalon::gpu::{Device, Severity};
use etalon::image::png::{self, Display};
use etalon::image::{exr, file};
use etalon::scene::{Camera, Scene};
use etalon_farm::frames::Frames;
use etalon_farm::identity::{Identity, device_name};
use etalon_farm::names::Pattern;
use etalon_farm::worker::Worker;

/// Frames of a second where nobody says.
const FPS: f64 = 24.0;

/// The account of a sequence: schema `etalon.sequence/1`.
#[derive(Debug, Serialize)]
struct Account {
    schema: &'static str,
    worker: Worker,
    shard: [u32; 2],
    pictures: Vec<Told>,
    #[serde(skip_serializing_if = "Option::is_none")]
    preview: Option<Output>,
}

/// One picture of it.
#[derive(Debug, Serialize)]
struct Told {
    frame: i32,
    camera: String,
    /// Its files were there, whole and of the same picture.
    found: bool,
    /// Seconds since 1970 when it was begun.
    began: f64,
    /// Milliseconds until it could be drawn: pose, hierarchy, upload.
    prepare_ms: f64,
    /// Milliseconds of drawing, with what is compiled meanwhile.
    draw_ms: f64,
    /// Milliseconds of encoding and writing.
    write_ms: f64,
    outputs: Vec<Output>,
}

/// What a sequence is made of, before anything is read.
struct Wanted {
    frames: Vec<i32>,
    moves: bool,
    turns: Option<u32>,
    fps: f64,
    outputs: Vec<(Pattern, Format)>,
    preview: Option<PathBuf>,
}

/// Checks all that can be checked before any work is done.
fn wanted(args: &RenderArgs) -> Result<Wanted> {
    let options = &args.sequence;
    ensure!(args.repeat == 1, "--repeat draws one picture again; it has no meaning for a sequence");
    ensure!(args.within.is_none(), "--within chooses rungs for one picture; choose them with --set for a sequence");
    ensure!(args.picture.plan != Extent::ExplainCost, "--plan explain-cost is about one picture");
    let fps = options.fps.unwrap_or(FPS);
    ensure!(fps.is_finite() && fps > 0.0, "--fps {fps}: expected a number above 0");
    let moves = options.frames.is_some() && (options.turntable.is_none() || options.fps.is_some())
        || options.turntable.is_some() && options.fps.is_some();
    ensure!(options.fps.is_none() || moves, "--fps: there are no frames; add --frames or --turntable");
    let all = match (&options.frames, options.turntable) {
        (Some(frames), _) => frames.clone(),
        (None, Some(count)) => Frames::first(count),
        (None, None) => Frames::first(1),
    };
    let many = all.numbers().len() > 1;
    let mut outputs = Vec::new();
    let mut preview = None;
    let mut given = args.output.clone();
    if given.is_empty() {
        let name = args.scene.scene.strip_prefix("study:").map_or_else(|| Path::new(&args.scene.scene), Path::new);
        let stem = name.file_stem().unwrap_or_default().to_string_lossy().replace(['{', '}'], "-");
        let camera = if options.cameras.is_empty() { "" } else { ".{camera}" };
        given.push(PathBuf::from(format!("{stem}{camera}{}.png", if many { ".{frame:04}" } else { "" })));
    }
    for path in given {
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("apng")) {
            ensure!(preview.replace(path).is_none(), "--output: a sequence has one animated preview");
            continue;
        }
        let format = format_of(&path)?;
        let pattern = Pattern::of(&path).context("--output")?;
        ensure!(
            !many || pattern.has_frame(),
            "--output {}: {} frames need a place for their number, such as {{frame:04}}",
            pattern.text(),
            all.numbers().len()
        );
        ensure!(
            options.cameras.is_empty() || pattern.has_camera(),
            "--output {}: --cameras needs a place for their names, {{camera}}",
            pattern.text()
        );
        outputs.push((pattern, format));
    }
    ensure!(
        !outputs.is_empty(),
        "--output: an animated preview is made of pictures; add one for them, such as frame.{{frame:04}}.png"
    );
    ensure!(
        preview.is_none() || outputs.iter().any(|(_, format)| *format == Format::Png),
        "--output: an animated preview is made of PNG files; add one, such as frame.{{frame:04}}.png"
    );
    ensure!(
        preview.is_none() || options.shard.is_none(),
        "--shard: an animated preview is made of all frames; when they are there, the same command without --shard draws none again"
    );
    ensure!(
        args.aov.is_empty() || outputs.iter().any(|(_, format)| *format == Format::Exr),
        "--aov: layers go into an EXR; add -o FILE.{{frame:04}}.exr"
    );
    let share = options.shard.unwrap_or([1, 1]);
    let frames = all.share(share).numbers().to_vec();
    let unnamed = [String::new()];
    for (pattern, _) in &outputs {
        for camera in if options.cameras.is_empty() { &unnamed[..] } else { &options.cameras } {
            for &frame in frames.iter().take(1).chain(frames.last()) {
                file::check_writable(&pattern.path(frame, camera))?;
            }
        }
    }
    preview.iter().chain(&args.report).try_for_each(|path| file::check_writable(path))?;
    Ok(Wanted { frames, moves, turns: options.turntable, fps, outputs, preview })
}

/// A camera turned about the vertical through `center` by a part of a circle.
fn turned(camera: &Camera, center: DVec3, up: DVec3, part: f64) -> Camera {
    let turn = DAffine3::from_axis_angle(up.normalize_or(DVec3::Y), std::f64::consts::TAU * part);
    let about = DAffine3::from_translation(center) * turn * DAffine3::from_translation(-center);
    Camera { world_from_camera: about * camera.world_from_camera, ..camera.clone() }
}

/// Cameras of a moment of the scene: name and camera, in the order asked for.
fn cameras(options: &SceneOptions, names: &[String], scene: &Scene, size: [u32; 2]) -> Result<Vec<(String, Camera)>> {
    if names.is_empty() {
        return Ok(vec![(String::new(), options.choose_camera(scene, size)?)]);
    }
    let all: Vec<String> = match names {
        [all] if all == "all" => (0..scene.cameras.len()).map(|index| index.to_string()).collect(),
        names => names.to_vec(),
    };
    ensure!(!all.is_empty(), "--cameras all: {} has no cameras", scene.name);
    let of = |name: &String| -> Result<(String, Camera)> {
        let chosen = SceneOptions { camera: Some(name.clone()), ..options.clone() };
        let camera = chosen.choose_camera(scene, size)?;
        Ok((if camera.name.is_empty() { name.clone() } else { camera.name.clone() }, camera))
    };
    let found: Vec<(String, Camera)> = all.iter().map(of).collect::<Result<_>>()?;
    for (place, (name, _)) in found.iter().enumerate() {
        ensure!(
            found[..place].iter().all(|(other, _)| other != name),
            "--cameras: two cameras are called \"{name}\", so that their files would be one; name them by index"
        );
    }
    Ok(found)
}

/// The keyword under which a picture says what it is of.
const KEY: &str = "etalon.picture";

/// Whether a file holds the picture, whole.
fn holds(path: &Path, format: Format, picture: &str) -> Option<(Vec<u8>, Option<Display>)> {
    let bytes = std::fs::read(path).ok()?;
    let is_of = |texts: &[(String, String)]| texts.iter().any(|(key, text)| key == KEY && text == picture);
    match format {
        Format::Png => {
            let (display, texts) = png::decode_png_with(&bytes).ok()?;
            is_of(&texts).then_some((bytes, Some(display)))
        }
        Format::Exr => {
            let whole = is_of(&exr::texts(&bytes).ok()?) && exr::decode_channels(&bytes).is_ok();
            whole.then_some((bytes, None))
        }
    }
}

/// Runs the command.
///
/// # Errors
/// One sentence with what was being done, to what, and the cause; of a picture, with its frame.
pub fn run(args: &RenderArgs, quiet: bool) -> Result<ExitCode> {
    let begun = Instant::now();
    let wanted = wanted(args)?;
    let mut settings = args.render_settings()?;
    check_halves(&args.aov, &settings)?;
    let steps = Steps::new(args.progress, quiet);
    steps.step(&format!("loading {}", args.scene.scene), 1);
    let reads = args.picture.reads(&args.scene, &settings.knobs);
    let (mut source, rest, environment, device) = setup::open_source(&args.scene, reads, &args.device)?;
    if wanted.moves && wanted.turns.is_none() && rest.duration.is_none() {
        bail!(
            "--frames: nothing in {} moves, so that all frames would be the same; --turntable N turns the camera",
            rest.name
        );
    }
    let mut opened = etalon::open::Opened::new(rest, environment, args.scene.asks_for_environment());
    args.picture.colour_of(opened.scene(), &mut settings.knobs)?;
    let (_, settings) = opened.lit(settings);
    for warning in &opened.warnings {
        tracing::warn!("{warning}");
    }
    // What frames the scene, and what a turntable turns about, is the same for all frames.
    let still = opened.scene().clone();
    let frames_scene = args.scene.frames(&still) && args.sequence.cameras.is_empty();
    let names = &args.sequence.cameras;
    let fixed = cameras(&args.scene, names, &still, settings.size)?;
    let middle = still.bounds().ok_or_else(|| anyhow!("{}: there is nothing to draw", still.name))?.center();
    let (center, up) = (args.scene.target.unwrap_or(middle), args.scene.up.unwrap_or(DVec3::Y));
    let base_time = args.scene.time()?;
    let mut drawer = Drawer { args, device: &device, renderer: None, moved: true, settings };
    let mut pictures: Vec<Told> = Vec::new();
    let mut shown: Vec<Display> = Vec::new();
    let of = (wanted.frames.len() * fixed.len()).max(1) as f64;
    let mut prepared = None;
    for &frame in &wanted.frames {
        let pose = Instant::now();
        if wanted.moves {
            let time = base_time.unwrap_or(0.0) + f64::from(frame) / wanted.fps;
            let scene = source.at(Some(time)).with_context(|| format!("frame {frame}"))?;
            opened.pose(scene);
            drawer.moved = true;
        }
        let seen = match frames_scene {
            true => fixed.clone(),
            false => cameras(&args.scene, names, opened.scene(), drawer.settings.size)?,
        };
        let contents = etalon_farm::identity::contents(opened.scene(), opened.environment());
        let mut pose_ms = pose.elapsed().as_secs_f64() * 1e3;
        for (name, camera) in seen {
            let camera = match wanted.turns {
                Some(turns) => turned(&camera, center, up, f64::from(frame) / f64::from(turns)),
                None => camera,
            };
            let done = pictures.len() as f64;
            steps.is_share(done / of, 1.0 / of);
            let left = match pictures.len() {
                0 => String::new(),
                n => format!(", {:.0} s left", begun.elapsed().as_secs_f64() / n as f64 * (of - done)),
            };
            let what = if name.is_empty() { format!("frame {frame}") } else { format!("frame {frame}, camera {name}") };
            steps.step(&format!("{what} ({} of {of}{left})", pictures.len() + 1), 1);
            let files: Vec<(PathBuf, Format)> =
                wanted.outputs.iter().map(|(pattern, format)| (pattern.path(frame, &name), *format)).collect();
            let (mut told, display) = drawer
                .picture(&opened, &contents, (frame, &name), &camera, &files, &steps)
                .with_context(|| what.clone())?;
            told.prepare_ms += std::mem::take(&mut pose_ms);
            prepared.get_or_insert_with(|| begun.elapsed());
            shown.extend(display.filter(|_| wanted.preview.is_some()));
            pictures.push(told);
            steps.done(1.0);
        }
    }
    let mut preview = None;
    if let Some(path) = wanted.preview.as_ref().filter(|_| !shown.is_empty()) {
        // A fraction of 16-bit numbers: milliseconds.
        let of_second = (1000.0 / wanted.fps).round().clamp(1.0, f64::from(u16::MAX)) as u16;
        let bytes = png::encode_animation(&shown, [of_second, 1000])?;
        file::write(path, &bytes)?;
        preview = Some(Output { path: path.display().to_string(), hash: file::hash(&bytes) });
    }
    if let Some(path) = &args.report {
        let worker = Worker::here(device_name(device.info()), begun.elapsed(), prepared.unwrap_or_default());
        let shard = args.sequence.shard.unwrap_or([1, 1]);
        let account = Account { schema: "etalon.sequence/1", worker, shard, pictures, preview };
        file::write(path, serde_json::to_string_pretty(&account)?.as_bytes())?;
    }
    drop(steps);
    if let Some(path) = &wanted.preview {
        print(&path.display().to_string())?;
    }
    let messages = Validation::of(&device, args.device.validate).messages;
    if let Some(message) = messages.iter().find(|message| message.severity == Severity::Error) {
        bail!("validation: {}", message.text);
    }
    Ok(ExitCode::SUCCESS)
}

/// What draws the pictures of a sequence one after the other.
struct Drawer<'a> {
    args: &'a RenderArgs,
    device: &'a std::sync::Arc<Device>,
    renderer: Option<Renderer>,
    /// The scene is another one than that of the renderer.
    moved: bool,
    settings: Settings,
}

impl Drawer<'_> {
    /// Draws and writes a picture, unless its files hold it already; what a display shows of it, where it has a PNG.
    fn picture(
        &mut self,
        opened: &etalon::open::Opened,
        contents: &str,
        (frame, name): (i32, &str),
        camera: &Camera,
        files: &[(PathBuf, Format)],
        steps: &Steps,
    ) -> Result<(Told, Option<Display>)> {
        let args = self.args;
        let start = Instant::now();
        let began =
            std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default().as_secs_f64();
        let identity = Identity::of(&args.scene.scene, contents.to_owned(), camera, &self.settings, self.device.info());
        let picture =
            file::hash(format!("{} {:?} {:?}", identity.fingerprint(), args.aov, args.picture.plan).as_bytes());
        let mut told = Told {
            frame,
            camera: name.to_owned(),
            found: true,
            began,
            prepare_ms: 0.0,
            draw_ms: 0.0,
            write_ms: 0.0,
            outputs: Vec::new(),
        };
        let found: Option<Vec<_>> = files.iter().map(|(path, format)| holds(path, *format, &picture)).collect();
        if let Some(found) = found {
            let mut display = None;
            for ((path, _), (bytes, shown)) in files.iter().zip(found) {
                display = display.or(shown);
                told.outputs.push(Output { path: path.display().to_string(), hash: file::hash(&bytes) });
                print(&path.display().to_string())?;
            }
            return Ok((told, display));
        }
        told.found = false;
        let (environment, _) = opened.lit(Settings::default());
        let renderer = match self.renderer.take() {
            Some(renderer) if !self.moved => renderer,
            Some(renderer) => renderer.next(&opened.original, environment)?,
            None => {
                let renderer = Renderer::new(self.device, &opened.original, environment, self.settings.clone())?;
                renderer.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
                renderer
            }
        };
        self.moved = false;
        let renderer = self.renderer.insert(renderer);
        told.prepare_ms = start.elapsed().as_secs_f64() * 1e3;
        let drawing = Instant::now();
        let mut clock = drawing;
        let rendered = renderer.render(camera, &mut |progress| steps.sampled(progress, drawing, &mut clock))?;
        told.draw_ms = drawing.elapsed().as_secs_f64() * 1e3;
        warn_about(&rendered, settings_size(&args.picture), &self.settings.knobs, renderer.plan().bands);
        let writing = Instant::now();
        let mut texts = metadata(args, renderer.plan());
        texts.push((KEY.to_owned(), picture));
        let aovs = if args.aov.is_empty() { Vec::new() } else { layers(renderer, camera, &args.aov)? };
        for (path, format) in files {
            let bytes = match format {
                Format::Exr => exr::encode_exr(&renderer.film()?, &aovs, &texts)?,
                Format::Png => png::encode_png_with(
                    self.settings.size,
                    &rendered.display,
                    rendered.has_alpha,
                    &texts[texts.len() - 1..],
                )?,
            };
            file::write(path, &bytes)?;
            told.outputs.push(Output { path: path.display().to_string(), hash: file::hash(&bytes) });
            print(&path.display().to_string())?;
        }
        told.write_ms = writing.elapsed().as_secs_f64() * 1e3;
        let [width, height] = self.settings.size;
        let display = Display { width, height, rgba: rendered.display.as_chunks::<4>().0.to_vec() };
        Ok((told, files.iter().any(|(_, format)| *format == Format::Png).then_some(display)))
    }
}
