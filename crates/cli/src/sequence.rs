//! `etalon render` of a sequence: frames of an animation, a turntable, or several cameras. Data that all pictures share
//! is read, uploaded and compiled once. See docs/farm.md.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use glam::{DAffine3, DVec3};
use serde::Serialize;

use super::exposure::{self, ExposureFacts};
use super::options::{PlanExtent, SceneOptions};
use super::picture::{
    Format, RenderArgs, check_layers, check_same_scene, default_stem, differs, format_of, layers, metadata, scene_text,
    settings_size, warn_about,
};
use super::progress::Steps;
use super::report::{Validation, WrittenFile};
use super::setup;
use super::{print, usage};
use etalon::frame::{Renderer, Settings};
use etalon::gpu::{Device, Severity};
use etalon::image::png::{self, Display};
use etalon::image::{exr, file};
use etalon::open::LitBy;
use etalon::scene::{Camera, Scene};
use etalon_farm::frames::Frames;
use etalon_farm::identity::{Identity, device_name};
use etalon_farm::names::Pattern;
use etalon_farm::worker::FarmWorker;

/// Default frames per second.
const FPS: f64 = 24.0;

/// The document of `--report` for a sequence, schema `etalon.sequence/1`.
#[derive(Debug, Serialize)]
struct SequenceReport {
    schema: &'static str,
    worker: FarmWorker,
    shard: [u32; 2],
    lit_by: LitBy,
    exposure: ExposureFacts,
    pictures: Vec<PictureRecord>,
    #[serde(skip_serializing_if = "Option::is_none")]
    preview: Option<WrittenFile>,
}

/// One picture of a sequence.
#[derive(Debug, Serialize)]
struct PictureRecord {
    frame: i32,
    camera: String,
    /// Whether its files existed, complete and of the same picture, so that it was not drawn.
    found: bool,
    /// Start, in seconds since 1970.
    began: f64,
    /// Milliseconds of preparation: pose, BVH, upload.
    prepare_ms: f64,
    /// Milliseconds of drawing, including compilation.
    draw_ms: f64,
    /// Milliseconds of encoding and writing.
    write_ms: f64,
    outputs: Vec<WrittenFile>,
}

/// The parsed options of a sequence, before the scene is read.
pub(super) struct SequenceRequest {
    frames: Vec<i32>,
    moves: bool,
    turns: Option<u32>,
    fps: f64,
    outputs: Vec<(Pattern, Format)>,
    preview: Option<PathBuf>,
}

/// Checks all options that can be checked before any work is done.
pub(super) fn wanted(args: &RenderArgs) -> Result<SequenceRequest> {
    let options = &args.sequence;
    ensure!(args.repeat == 1, "--repeat draws one picture again; it does not work with a sequence");
    ensure!(args.within.is_none(), "--within chooses rungs for one picture; for a sequence choose rungs with --set");
    ensure!(args.picture.plan != PlanExtent::ExplainCost, "--plan explain-cost works with one picture only");
    args.picture.check_error_is_told()?;
    let fps = options.fps.unwrap_or(FPS);
    ensure!(fps.is_finite() && fps > 0.0, "--fps {fps}: expected a number above 0");
    let moves = options.frames.is_some() && (options.turntable.is_none() || options.fps.is_some())
        || options.turntable.is_some() && options.fps.is_some();
    ensure!(options.split.is_none(), "--split: a sequence is divided by pictures; leave this option out");
    ensure!(options.fps.is_none() || moves, "--fps: the command draws no frames; add --frames or --turntable");
    let all = match (&options.frames, options.turntable) {
        (Some(frames), _) => frames.clone(),
        (None, Some(count)) => Frames::first(count),
        (None, None) => Frames::first(1),
    };
    let many = all.numbers().len() > 1;
    let (mut outputs, mut named) = (Vec::new(), Vec::new());
    let mut preview = None;
    let mut given = args.output.clone();
    if given.is_empty() {
        let stem = default_stem(&args.scene.scene)?.replace(['{', '}'], "-");
        let camera = if options.cameras.is_empty() { "" } else { ".{camera}" };
        given.push(PathBuf::from(format!("{stem}{camera}{}.png", if many { ".{frame:04}" } else { "" })));
    }
    for path in given {
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("apng")) {
            ensure!(preview.replace(path).is_none(), "--output: a sequence can have only one animated preview");
            continue;
        }
        let format = format_of(&path)?;
        ensure!(!named.contains(&path), "--output {}: this file is named twice", path.display());
        named.push(path.clone());
        let pattern = Pattern::of(&path).context("--output")?;
        ensure!(
            !many || pattern.has_frame(),
            "--output {}: the names of {} frames need a frame number, for example {{frame:04}}",
            pattern.text(),
            all.numbers().len()
        );
        ensure!(
            options.cameras.is_empty() || pattern.has_camera(),
            "--output {}: with --cameras the file name needs {{camera}}",
            pattern.text()
        );
        outputs.push((pattern, format));
    }
    ensure!(
        !outputs.is_empty(),
        "--output: an animated preview is made from the pictures; add their name, for example -o frame.{{frame:04}}.png"
    );
    ensure!(
        preview.is_none() || outputs.iter().any(|(_, format)| *format == Format::Png),
        "--output: an animated preview is made from PNG files; add their name, for example -o frame.{{frame:04}}.png"
    );
    ensure!(
        preview.is_none() || options.shard.is_none(),
        "--shard: an animated preview needs all frames; when they are drawn, run the command without --shard: it draws none again"
    );
    ensure!(
        args.aov.is_empty() || outputs.iter().any(|(_, format)| *format == Format::Exr),
        "--aov: layers are written to an EXR; add -o FILE.{{frame:04}}.exr"
    );
    let share = options.shard.unwrap_or([1, 1]);
    let frames = all.share(share).numbers().to_vec();
    Ok(SequenceRequest { frames, moves, turns: options.turntable, fps, outputs, preview })
}

/// Checks that the outputs can be written.
fn check_writable(args: &RenderArgs, request: &SequenceRequest) -> Result<()> {
    if args.sequence.cameras.is_empty() {
        check_pictures(args, request, &[""])?;
    }
    let check = || -> Result<()> {
        request.preview.iter().try_for_each(|preview| args.spares_inputs("--output", preview))?;
        args.report.iter().try_for_each(|report| {
            args.spares_inputs("--report", report)?;
            request.preview.iter().try_for_each(|preview| differs("--report", report, preview))
        })
    };
    usage(check())?;
    request.preview.iter().chain(&args.report).try_for_each(|path| file::check_writable(path))
}

/// Checks the files of all pictures from cameras of these names: each is another file, that can be written.
fn check_pictures(args: &RenderArgs, request: &SequenceRequest, cameras: &[&str]) -> Result<()> {
    let mut all = BTreeSet::new();
    for (frame, path) in pictures_of(request, cameras) {
        usage(args.spares_inputs("--output", &path))?;
        usage(args.report.iter().try_for_each(|report| differs("--report", report, &path)))?;
        if args.output.is_empty() {
            check_same_scene(&path, &args.scene.scene)?;
        }
        // Of many frames in one folder the first and the last tell whether they can be written.
        if Some(&frame) == request.frames.first() || Some(&frame) == request.frames.last() {
            file::check_writable(&path)?;
        }
        let is_new = all.insert(path.clone());
        let twice =
            || anyhow!("--cameras: two pictures would be written to {}; name the cameras by index", path.display());
        usage(if is_new { Ok(()) } else { Err(twice()) })?;
    }
    Ok(())
}

/// Frame and file of each picture from cameras of these names.
fn pictures_of<'a>(request: &'a SequenceRequest, cameras: &'a [&str]) -> impl Iterator<Item = (i32, PathBuf)> + 'a {
    let frames = move |camera: &'a str| request.frames.iter().map(move |&frame| (camera, frame));
    let shown = move || cameras.iter().flat_map(move |camera| frames(camera));
    let of =
        move |(pattern, _): &'a (Pattern, Format)| shown().map(|(camera, frame)| (frame, pattern.path(frame, camera)));
    request.outputs.iter().flat_map(of)
}

/// The camera rotated about the axis `up` through `center` by the fraction `part` of a full turn.
fn turned(camera: &Camera, center: DVec3, up: DVec3, part: f64) -> Camera {
    let turn = DAffine3::from_axis_angle(up.normalize_or(DVec3::Y), std::f64::consts::TAU * part);
    let about = DAffine3::from_translation(center) * turn * DAffine3::from_translation(-center);
    Camera { world_from_camera: about * camera.world_from_camera, ..camera.clone() }
}

/// Name and camera of each requested camera at the scene's current time, in the order of the option.
fn cameras(options: &SceneOptions, names: &[String], scene: &Scene, size: [u32; 2]) -> Result<Vec<(String, Camera)>> {
    if names.is_empty() {
        return Ok(vec![(String::new(), options.choose_camera(scene, size)?)]);
    }
    let all: Vec<String> = match names {
        [all] if all == "all" => scene.camera_keys(),
        names => names.to_vec(),
    };
    ensure!(!all.is_empty(), "--cameras all: {} has no cameras", scene.name);
    let keys = scene.camera_keys();
    let of = |word: &String| -> Result<(String, Camera)> {
        let chosen = SceneOptions { camera: Some(word.clone()), ..options.clone() };
        let camera = chosen.choose_camera(scene, size)?;
        // Files are named by the key, which is the name unless two cameras share it.
        let known = scene.camera(word);
        let key =
            scene.cameras.iter().zip(&keys).find(|(camera, _)| known.is_some_and(|known| std::ptr::eq(known, *camera)));
        Ok((key.map_or(word, |(_, key)| key).clone(), camera))
    };
    let found: Vec<(String, Camera)> = all.iter().map(of).collect::<Result<_>>()?;
    for (place, (name, _)) in found.iter().enumerate() {
        ensure!(found[..place].iter().all(|(other, _)| other != name), "--cameras: camera \"{name}\" is named twice");
    }
    Ok(found)
}

/// Keyword of the text in a file that identifies its picture.
const KEY: &str = "etalon.picture";

/// The bytes of a file, if it is complete and holds this picture; with the display values of a PNG.
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
/// One sentence with the action, its object and the cause; an error of a picture also names its frame.
pub fn run(args: &RenderArgs, quiet: bool, printed: &mut BTreeSet<PathBuf>) -> Result<ExitCode> {
    let begun = Instant::now();
    let mut settings = args.render_settings()?;
    usage(check_layers(&args.aov, &settings))?;
    let wanted = usage(wanted(args))?;
    check_writable(args, &wanted)?;
    let steps = Steps::new(args.progress, quiet);
    steps.step(&format!("loading {}", args.scene.label()), 1);
    let prune = args.picture.prune(&args.scene, &settings.knobs);
    let (mut source, rest, environment, device) = setup::open_source(&args.scene, prune, &args.device)?;
    if wanted.moves && wanted.turns.is_none() && rest.duration.is_none() {
        bail!(
            "--frames: nothing in {} moves, so all frames would be the same; to turn the camera, use --turntable N",
            rest.name
        );
    }
    let mut opened =
        etalon::open::Opened::named(&args.scene.scene, rest, environment, args.scene.asks_for_environment());
    args.picture.colour_of(opened.scene(), &mut settings.knobs)?;
    let lit_by = opened.sources(&settings).lit_by(&opened.plan(settings.clone())?);
    for warning in &opened.warnings {
        tracing::warn!("{warning}");
    }
    // The camera that frames the scene, and the axis of a turntable, are the same for all frames.
    let still = opened.scene().clone();
    let frames_scene = args.scene.frames(&still) && args.sequence.cameras.is_empty();
    let names = &args.sequence.cameras;
    let middle = still.bounds().ok_or_else(|| anyhow!("{}: the scene has nothing to draw", still.name))?.center();
    let (center, up) = (args.scene.target.unwrap_or(middle), args.scene.up.unwrap_or(DVec3::Y));
    let fixed = match wanted.turns {
        Some(_) if frames_scene => {
            let aspect = f64::from(settings.size[0]) / f64::from(settings.size[1]);
            let camera = still.framing_of_turns(center, up, aspect, args.scene.fov_y());
            vec![(String::new(), camera.ok_or_else(|| anyhow!("{}: the scene has nothing to draw", still.name))?)]
        }
        _ => cameras(&args.scene, names, &still, settings.size)?,
    };
    let known: Vec<&str> = fixed.iter().map(|(name, _)| name.as_str()).collect();
    if !names.is_empty() {
        check_pictures(args, &wanted, &known)?;
    }
    let outputs: Vec<PathBuf> = pictures_of(&wanted, &known).map(|(_, path)| path).collect();
    args.spares_files(&still, outputs.iter().chain(&wanted.preview).map(PathBuf::as_path))?;
    let base_time = args.scene.time.0;
    // All pictures have the exposure of the scene at --time from the first camera, whichever of them are drawn here.
    let first = fixed.first().map(|(_, camera)| camera).ok_or_else(|| anyhow!("{}: no camera", still.name))?;
    let exposure = exposure::choose(args.picture.exposure, &opened, &device, &settings, first)?;
    settings.exposure = exposure.stops;
    [Some(&lit_by.sentence), exposure.sentence.as_ref()].into_iter().flatten().for_each(|line| steps.tell(line));
    let (_, settings) = opened.lit(settings);
    let mut drawer = Drawer { args, device: &device, renderer: None, moved: true, settings, printed };
    let mut pictures: Vec<PictureRecord> = Vec::new();
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
        let bytes = png::encode_animation(&shown, delay(wanted.fps))?;
        file::write(path, &bytes)?;
        preview = Some(WrittenFile { path: path.display().to_string(), hash: file::hash(&bytes) });
    }
    if let Some(path) = &args.report {
        let worker = FarmWorker::here(device_name(device.info()), begun.elapsed(), prepared.unwrap_or_default());
        let shard = args.sequence.shard.unwrap_or([1, 1]);
        let account =
            SequenceReport { schema: "etalon.sequence/1", worker, shard, lit_by, exposure, pictures, preview };
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

/// Numerator and denominator of the seconds for which an animated PNG shows a picture.
fn delay(fps: f64) -> [u16; 2] {
    // Rates such as 29.97 have three decimals. The format stores two numbers of 16 bits.
    let most = f64::from(u16::MAX);
    let of = (1000.0 * fps).round();
    if of < 1.0 {
        [u16::MAX, 1]
    } else if of <= most {
        [1000, of as u16]
    } else {
        [1, fps.round().min(most) as u16]
    }
}

/// Prints the path of a written file unless `printed` has it. Returns whether it was printed.
fn print_once(path: &Path, printed: &mut BTreeSet<PathBuf>) -> Result<bool> {
    let is_new = printed.insert(path.to_owned());
    if is_new {
        print(&path.display().to_string())?;
    }
    Ok(is_new)
}

/// Draws the pictures of a sequence one after another with one renderer.
struct Drawer<'a> {
    args: &'a RenderArgs,
    device: &'a std::sync::Arc<Device>,
    renderer: Option<Renderer>,
    /// Whether the scene has changed since the renderer was made.
    moved: bool,
    settings: Settings,
    /// Files whose paths this command has printed. A command that lost its device finds them again.
    printed: &'a mut BTreeSet<PathBuf>,
}

impl Drawer<'_> {
    /// Draws and writes a picture, unless its files already hold it. Also returns its display values if it has a PNG.
    fn picture(
        &mut self,
        opened: &etalon::open::Opened,
        contents: &str,
        (frame, name): (i32, &str),
        camera: &Camera,
        files: &[(PathBuf, Format)],
        steps: &Steps,
    ) -> Result<(PictureRecord, Option<Display>)> {
        let args = self.args;
        let start = Instant::now();
        let began =
            std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default().as_secs_f64();
        let identity = Identity::of(&args.scene.scene, contents.to_owned(), camera, &self.settings, self.device.info());
        let picture =
            file::hash(format!("{} {:?} {:?}", identity.fingerprint(), args.aov, args.picture.plan).as_bytes());
        let mut told = PictureRecord {
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
                told.outputs.push(WrittenFile { path: path.display().to_string(), hash: file::hash(&bytes) });
                told.found &= print_once(path, self.printed)?;
            }
            return Ok((told, display));
        }
        told.found = false;
        let (environment, _) = opened.lit(self.settings.clone());
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
        let mut marks = vec![(KEY.to_owned(), picture)];
        if args.output.is_empty() {
            marks.push(scene_text(&args.scene.scene));
        }
        let texts = [metadata(args, renderer.plan()), marks.clone()].concat();
        let aovs = if args.aov.is_empty() { Vec::new() } else { layers(renderer, camera, &args.aov)? };
        for (path, format) in files {
            let bytes = match format {
                Format::Exr => exr::encode_exr(&renderer.film()?, &aovs, &texts)?,
                Format::Png => png::encode_png_with(self.settings.size, &rendered.display, rendered.has_alpha, &marks)?,
            };
            file::write(path, &bytes)?;
            told.outputs.push(WrittenFile { path: path.display().to_string(), hash: file::hash(&bytes) });
            print_once(path, self.printed)?;
        }
        told.write_ms = writing.elapsed().as_secs_f64() * 1e3;
        let [width, height] = self.settings.size;
        let display = Display { width, height, rgba: rendered.display.as_chunks::<4>().0.to_vec() };
        Ok((told, files.iter().any(|(_, format)| *format == Format::Png).then_some(display)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preview_has_the_rate_of_its_frames() {
        for (fps, fraction) in [
            (24.0, [1000, 24_000]),
            (29.97, [1000, 29_970]),
            (120.0, [1, 120]),
            (1e9, [1, u16::MAX]),
            (1e-4, [u16::MAX, 1]),
        ] {
            assert_eq!(delay(fps), fraction, "{fps}");
        }
    }
}
