//! Parts shared by all forms of `etalon render`: options, arbitrary output variables (AOV layers of an EXR), and
//! warnings about a drawn picture.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use clap::{Args, ValueEnum};
use glam::DVec3;

use super::heading;
use super::options::{DeviceOptions, PictureOptions, SceneOptions, milliseconds, shard};
use super::progress::ProgressForm;
use super::usage;
use etalon::frame::{Part, Rendered, Renderer, Settings};
use etalon::image::{Aov, AovData, Picture, file, png};
use etalon::plan::rungs::Indirect;
use etalon::plan::{Knobs, Plan};
use etalon::scene::{Camera, Scene};
use etalon::share::AovPixel;
use etalon::spectra;
use etalon::upload::view::View;
use etalon_farm::frames::Frames;
use etalon_farm::part::Split;

/// Options of `render` for several pictures and for several processes.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = heading::SEQUENCE)]
pub struct SequenceOptions {
    /// Draw these frames: numbers and ranges such as 1-100:2,105. Frame F shows the animation at --time plus F / fps
    /// seconds. Each output name contains the frame number as {frame} or {frame:04}. Frames whose files are complete
    /// and hold the same picture are not drawn again
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    pub frames: Option<Frames>,
    /// Frames per second [default: 24]
    #[arg(long, value_name = "N")]
    pub fps: Option<f64>,
    /// Turn the camera around --target, or the middle of the scene, by 1/N of a circle per frame; the animation stands
    /// still unless --fps is given [default frames: 0 to N - 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub turntable: Option<u32>,
    /// Draw from these cameras of the file, by name or index, or from all of them. Each output name contains the camera
    /// name as {camera}
    #[arg(long, value_name = "NAME,...|all", value_delimiter = ',', conflicts_with_all = ["camera", "eye", "target", "up", "fov"])]
    pub cameras: Vec<String>,
    /// Draw the I-th of N shares: every N-th picture of a sequence, or a part of a single picture into the file of -o.
    /// `etalon merge` joins the parts into the picture that one run draws, bit for bit
    #[arg(long, value_name = "I/N", value_parser = shard)]
    pub shard: Option<[u32; 2]>,
    /// How to divide a single picture: by tiles of pixels, or by samples into at most 64 parts
    /// [default: tiles; samples if the plan uses screen-space reflection or refraction]
    #[arg(long, value_enum, value_name = "tiles|samples")]
    pub split: Option<SplitBy>,
}

/// [`Split`] as a value of an option.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum SplitBy {
    /// By tiles.
    Tiles,
    /// By samples.
    Samples,
}

impl From<SplitBy> for Split {
    fn from(by: SplitBy) -> Self {
        match by {
            SplitBy::Tiles => Self::Tiles,
            SplitBy::Samples => Self::Samples,
        }
    }
}

impl SequenceOptions {
    /// Whether the options can ask for more than one picture.
    #[must_use]
    pub fn is_sequence(&self) -> bool {
        self.frames.is_some() || self.turntable.is_some() || !self.cameras.is_empty()
    }

    /// Refuses options about sequences for one picture.
    ///
    /// # Errors
    /// One sentence with the option.
    pub(super) fn check_one(&self) -> Result<()> {
        ensure!(self.fps.is_none(), "--fps: the command draws no frames; add --frames or --turntable");
        ensure!(self.split.is_none() || self.shard.is_some(), "--split: the picture is not divided; add --shard I/N");
        Ok(())
    }
}

/// Draw a picture of a scene
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
    etalon render study:pool -o pool.png -o pool.exr
    etalon render study:cornell --model global --set samples=16 -o cornell.png
    etalon render study:metals --eye 0,1.5,4 --fov 30 --background transparent -o metals.png
    etalon render scene.glb --size 640x360 --validate --report report.json -o scene.exr
    etalon render study:lamps --turntable 3 -o lamps.{frame:04}.png
    etalon render - -o - < scene.glb > picture.png
    etalon render scene.glb -o - --format exr > picture.exr")]
pub struct RenderArgs {
    #[command(flatten)]
    pub(super) scene: SceneOptions,
    /// Output file: .png (display) or .exr (scene-linear radiance), or - for standard output; repeatable [default: the
    /// scene's name with .png, which replaces only a picture of the same scene]. A sequence can also write an animated
    /// preview, .apng; a part of a picture has exactly one output
    #[arg(short, long, value_name = "FILE", help_heading = heading::OUTPUT)]
    pub(super) output: Vec<PathBuf>,
    /// File format of outputs whose names end neither in .png nor in .exr, and of standard output [default: png on
    /// standard output]
    #[arg(long, value_enum, value_name = "png|exr", requires = "output", conflicts_with_all = ["frames", "turntable", "cameras", "shard"], help_heading = heading::OUTPUT)]
    pub(super) format: Option<Format>,
    #[command(flatten)]
    pub(super) picture: PictureOptions,
    /// Pick the most accurate rungs that render within this GPU time, in milliseconds (measures first if `cost` has not
    /// been run)
    #[arg(long, value_name = "MS", value_parser = milliseconds, help_heading = heading::QUALITY)]
    pub(super) within: Option<f64>,
    #[command(flatten)]
    pub(super) device: DeviceOptions,
    /// Additional EXR layers: the nearest opaque surface at each pixel centre; the radiance of rays that were first
    /// reflected (reflection) or first refracted (refraction); variance and half buffers of path tracing
    #[arg(long, value_enum, value_delimiter = ',', value_name = "NAME,...", help_heading = heading::OUTPUT)]
    pub(super) aov: Vec<AovName>,
    /// Draw the picture N times and fail unless all results are bit-identical
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..), help_heading = heading::QUALITY)]
    pub(super) repeat: u32,
    /// On Ctrl-C write the picture with the samples drawn so far, and end with exit code 130
    #[arg(long, conflicts_with_all = ["repeat", "frames", "turntable", "cameras", "shard"], help_heading = heading::OUTPUT)]
    pub(super) keep: bool,
    /// Write a JSON report of the run
    #[arg(long, value_name = "FILE.json", help_heading = heading::OUTPUT)]
    pub(super) report: Option<PathBuf>,
    #[command(flatten)]
    pub(super) sequence: SequenceOptions,
    /// Form of the progress messages
    #[arg(long, value_enum, default_value_t = ProgressForm::Auto, help_heading = heading::MESSAGES)]
    pub progress: ProgressForm,
}

impl RenderArgs {
    /// Settings of the renderer, with the picture parts of `--aov`.
    pub(super) fn render_settings(&self) -> Result<Settings> {
        let mut settings = self.picture.settings(&self.scene)?;
        for part in self.aov.iter().filter_map(|name| name.part()) {
            if !settings.parts.contains(&part) {
                settings.parts.push(part);
            }
        }
        Ok(settings)
    }

    /// Files that the command line names to be read.
    fn inputs(&self) -> impl Iterator<Item = &Path> {
        let SceneOptions { scene, env, .. } = &self.scene;
        let scene = Some(scene).filter(|scene| *scene != "-" && !scene.starts_with("study:"));
        let env = env.as_ref().filter(|env| !["studio", "none"].contains(&env.as_str()));
        scene.into_iter().chain(env).map(Path::new)
    }

    /// Refuses a file that an option writes and that the command reads.
    ///
    /// # Errors
    /// When the file is the scene or the environment.
    pub(super) fn spares_inputs(&self, option: &str, path: &Path) -> Result<()> {
        self.inputs().try_for_each(|input| differs(option, path, input))
    }

    /// Refuses outputs that the scene's file names, such as its textures, once they are known.
    ///
    /// # Errors
    /// Wrong usage: an output is one of these files.
    pub(super) fn spares_files<'a>(&self, scene: &Scene, mut outputs: impl Iterator<Item = &'a Path>) -> Result<()> {
        let files: BTreeSet<PathBuf> = scene.files.iter().filter_map(|file| whole(file)).collect();
        let is_spared = |path: &Path| whole(path).is_none_or(|path| !files.contains(&path));
        let check = |option: &str, path: &Path| {
            ensure!(is_spared(path), "{option} {}: the scene names this file; choose another name", path.display());
            Ok(())
        };
        usage(outputs.try_for_each(|path| check("--output", path)))?;
        usage(self.report.iter().try_for_each(|report| check("--report", report)))
    }
}

/// Layers of `--aov`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum AovName {
    /// Base colour.
    Albedo,
    /// Shading normal in world space.
    Normal,
    /// Normal of the triangle, facing the viewer.
    GeometricNormal,
    /// Position in world space, metres.
    Position,
    /// Distance along the viewing direction, metres.
    Depth,
    /// Distance from the eye, metres.
    Distance,
    /// Perceptual roughness.
    Roughness,
    /// Metallic.
    Metallic,
    /// Emitted radiance.
    Emissive,
    /// Index of the material, from 1; 0 is no surface.
    Material,
    /// Index of the instance, from 1; 0 is no surface.
    Instance,
    /// Radiance of rays that the nearest surface reflected.
    Reflection,
    /// Radiance of rays that the nearest surface transmitted.
    Refraction,
    /// Variance of each pixel of a path-traced picture, estimated from the half buffers.
    Variance,
    /// Half buffer: mean of the even samples.
    HalfA,
    /// Half buffer: mean of the odd samples, whose random numbers are independent of the even samples.
    HalfB,
}

impl AovName {
    /// The part of the picture that the layer holds; `None` for layers of surfaces and of half buffers.
    pub(super) fn part(self) -> Option<Part> {
        match self {
            Self::Reflection => Some(Part::Reflection),
            Self::Refraction => Some(Part::Refraction),
            _ => None,
        }
    }

    /// Whether the layer is computed from the half buffers.
    pub(super) fn of_halves(self) -> bool {
        matches!(self, Self::Variance | Self::HalfA | Self::HalfB)
    }
}

/// Whether a path stands for standard input or standard output.
pub(super) fn is_standard(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// File name without extension of a picture that has no `-o`.
///
/// # Errors
/// Wrong usage: the scene has no name.
pub(super) fn default_stem(scene: &str) -> Result<String> {
    let checked = || -> Result<String> {
        ensure!(scene != "-", "--output: name the output with -o, because a scene on standard input has no name");
        let name = scene.strip_prefix("study:").map_or_else(|| Path::new(scene), Path::new);
        let stem = name.file_stem().with_context(|| format!("{scene}: this path names no file"))?;
        Ok(stem.to_string_lossy().into_owned())
    };
    usage(checked())
}

/// Text in a PNG that has no `-o`: it marks the scene, so that no scene of the same name replaces the picture.
pub(super) fn scene_text(scene: &str) -> (String, String) {
    // Only a hash: pictures are shown to people who need not know the folders of this machine.
    let path = std::fs::canonicalize(scene).unwrap_or_else(|_| PathBuf::from(scene));
    ("etalon.scene".to_owned(), file::hash(path.as_os_str().as_encoded_bytes()))
}

/// Refuses to replace a picture by one of another scene where the user has named no output.
///
/// # Errors
/// When the file exists, unless it is a picture of this scene whose output was not named either.
pub(super) fn check_same_scene(path: &Path, scene: &str) -> Result<()> {
    let Ok(bytes) = std::fs::read(path) else { return Ok(()) };
    let is_same = png::decode_png_with(&bytes).is_ok_and(|(_, texts)| texts.contains(&scene_text(scene)));
    let path = path.display();
    ensure!(is_same, "{path} exists and may be a picture of another scene: name the output; -o {path} replaces it");
    Ok(())
}

/// The absolute path of a file, which need not exist; `None` where its folder does not.
fn whole(path: &Path) -> Option<PathBuf> {
    if let Ok(whole) = std::fs::canonicalize(path) {
        return Some(whole);
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Some(std::fs::canonicalize(folder).ok()?.join(path.file_name()?))
}

/// Whether two paths name one file.
pub(super) fn are_same(a: &Path, b: &Path) -> bool {
    a == b || whole(a).zip(whole(b)).is_some_and(|(a, b)| a == b)
}

/// Refuses a file that an option writes and that has another use in the same command.
///
/// # Errors
/// When both paths name one file.
pub(super) fn differs(option: &str, path: &Path, other: &Path) -> Result<()> {
    ensure!(!are_same(path, other), "{option} {}: the command reads or writes this file already", path.display());
    Ok(())
}

/// File format of an output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Display values.
    Png,
    /// Scene-linear radiance.
    Exr,
}

pub(super) fn format_of(path: &Path) -> Result<Format> {
    match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("png") => Ok(Format::Png),
        Some("exr") => Ok(Format::Exr),
        _ => bail!("--output {}: only .png and .exr can be written", path.display()),
    }
}

/// File format of an output of one picture; `asked` counts where the name of the output does not say it.
pub(super) fn output_format(path: &Path, asked: Option<Format>) -> Result<Format> {
    match asked {
        _ if is_standard(path) => Ok(asked.unwrap_or(Format::Png)),
        None => format_of(path),
        Some(asked) => Ok(format_of(path).unwrap_or(asked)),
    }
}

pub(super) fn settings_size(picture: &PictureOptions) -> u64 {
    u64::from(picture.size[0]) * u64::from(picture.size[1])
}

/// Text attributes of the EXR.
pub(super) fn metadata(args: &RenderArgs, plan: &Plan) -> Vec<(String, String)> {
    made(&args.scene.scene, plan.bands)
}

/// Text attributes for a scene name; with bands of wavelengths they name the colour-matching functions.
pub(super) fn made(scene: &str, bands: u32) -> Vec<(String, String)> {
    let mut all = vec![
        ("software".to_owned(), format!("etalon {}", env!("CARGO_PKG_VERSION"))),
        ("scene".to_owned(), scene.to_owned()),
    ];
    if bands > 0 {
        all.push(("observer".to_owned(), spectra::OBSERVER.to_owned()));
    }
    all
}

pub(super) fn warn_about(rendered: &Rendered, pixels: u64, knobs: &Knobs, bands: u32) {
    let counts = rendered.counts;
    let negative = if bands > 0 { 0 } else { counts.negative };
    if bands > 0 && counts.negative > 0 {
        tracing::warn!(
            "{} of {pixels} pixels have colours outside the Rec. 709 gamut: displays show them desaturated at the same luminance, \
             an EXR has negative values",
            counts.negative
        );
    }
    for (count, what) in [(counts.nan, "NaN"), (counts.inf, "infinite"), (negative, "negative")] {
        if count > 0 {
            tracing::warn!("{count} of {pixels} pixels have {what} radiance and are shown black or white");
        }
    }
    let work = &rendered.work;
    if let Some(first) = work.first_not_finite {
        tracing::warn!(
            "{} path estimates were NaN or infinite and were left out; the first at pixel {},{}, vertex {} of its path, material {}",
            work.not_finite,
            first.pixel[0],
            first.pixel[1],
            first.event,
            first.material
        );
    }
    if work.unmatched_exits > 0 {
        tracing::warn!(
            "{} rays left a transparent mesh that they had not entered: some mesh is open, inside out, or overlaps another one without \
             priorities (extras.etalon.priority)",
            work.unmatched_exits
        );
    }
    if work.mean_lost > 0.01 {
        tracing::warn!(
            "{:.1} % of the light was cut off by the bounce limit (up to {:.0} % in one pixel){}",
            work.mean_lost * 100.0,
            work.most_lost * 100.0,
            if knobs.interfaces.count() < 32 { "; try --set interfaces=32" } else { "" }
        );
    }
    if let Some(what) = blank(&rendered.display) {
        tracing::warn!("the picture is {what}: --exposure auto takes the exposure from its own luminance");
    }
    if rendered.dropped > 0 {
        tracing::warn!(
            "{} pixels have more transparent surfaces than a shader invocation can sort; the farthest ones were left out",
            rendered.dropped
        );
    }
}

/// What a picture shows where all covered pixels are black, or all are white; `None` for every other picture.
fn blank(display: &[u8]) -> Option<&'static str> {
    let covered = || display.as_chunks::<4>().0.iter().filter(|[.., alpha]| *alpha > 0);
    // Bytes that no eye tells from black or white.
    let all = |is: fn(&u8) -> bool| covered().all(|[r, g, b, _]| [r, g, b].into_iter().all(is));
    covered().next()?;
    if all(|byte| *byte <= 3) {
        Some("black")
    } else if all(|byte| *byte >= 252) {
        Some("white")
    } else {
        None
    }
}

/// Refuses layers that are named twice, and those of half buffers for pictures without half buffers.
pub(super) fn check_layers(names: &[AovName], settings: &Settings) -> Result<()> {
    if let Some((_, name)) = names.iter().enumerate().find(|(place, name)| names[..*place].contains(name)) {
        let name = name.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
        bail!("--aov {name}: this layer is named twice");
    }
    if let Some(name) = names.iter().find(|name| name.of_halves()) {
        let name = name.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
        if settings.knobs.indirect != Indirect::Path {
            bail!("--aov {name}: only path tracing estimates its error; add --model global");
        }
        if settings.knobs.samples.count() == 1 && settings.max_error.is_none() {
            bail!("--aov {name}: one sample cannot be split into halves; add --set samples=4");
        }
    }
    Ok(())
}

/// The layers of `names`, in their order.
pub(super) fn layers(renderer: &mut Renderer, camera: &Camera, names: &[AovName]) -> Result<Vec<Aov>> {
    let (pixels, view) = renderer.aovs(camera).context("reading the G-buffer")?;
    let of = |&name: &AovName| match name.part() {
        Some(part) => layer_of_part(renderer, part),
        None if name.of_halves() => layer_of_halves(renderer, name),
        None => Ok(layer(&pixels, &view, name)),
    };
    names.iter().map(of).collect()
}

fn layer_of_part(renderer: &Renderer, part: Part) -> Result<Aov> {
    let picture =
        renderer.part(part)?.ok_or_else(|| anyhow!("--aov {}: the renderer did not draw this layer", part.name()))?;
    Ok(Aov {
        name: part.name().to_owned(),
        channels: ["R", "G", "B"].map(str::to_owned).into(),
        samples: AovData::F32(picture.rgba.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect()),
    })
}

fn layer_of_halves(renderer: &Renderer, name: AovName) -> Result<Aov> {
    let halves = renderer.half_means()?;
    let halves =
        halves.ok_or_else(|| anyhow!("--aov: variance, half_a and half_b need several samples of path tracing"))?;
    Ok(layer_between(&halves, name))
}

/// A layer computed from the means of the even and of the odd samples. The variance of a pixel is ((a − b) / 2)².
pub(super) fn layer_between([a, b]: &[Picture; 2], name: AovName) -> Aov {
    let colors = |picture: &Picture| -> Vec<f32> { picture.rgba.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect() };
    let variance = |(a, b): (&f32, &f32)| (0.5 * (a - b)).powi(2);
    let (title, samples) = match name {
        AovName::HalfA => ("half_a", colors(a)),
        AovName::HalfB => ("half_b", colors(b)),
        _ => ("variance", colors(a).iter().zip(&colors(b)).map(variance).collect()),
    };
    Aov { name: title.to_owned(), channels: ["R", "G", "B"].map(str::to_owned).into(), samples: AovData::F32(samples) }
}

fn layer(pixels: &[AovPixel], view: &View, name: AovName) -> Aov {
    let drawn = |p: &AovPixel| p.material != 0;
    let vectors = |get: &dyn Fn(&AovPixel) -> [f32; 3]| AovData::F32(pixels.iter().flat_map(get).collect());
    let numbers = |get: &dyn Fn(&AovPixel) -> f32| AovData::F32(pixels.iter().map(get).collect());
    let (rgb, xyz): (&[&str], &[&str]) = (&["R", "G", "B"], &["X", "Y", "Z"]);
    // World positions are added in f64: far from the origin f32 is precise enough only for positions relative to the
    // eye.
    let world = |p: &AovPixel| {
        if drawn(p) { (glam::Vec3::from(p.p_rel).as_dvec3() + view.eye).as_vec3().to_array() } else { [0.0; 3] }
    };
    let along = |p: &AovPixel| {
        let p_rel: DVec3 = glam::Vec3::from(p.p_rel).as_dvec3();
        p_rel.dot(view.axes[2]) as f32
    };
    let (title, channels, samples) = match name {
        AovName::Albedo => ("albedo", rgb, vectors(&|p| p.albedo)),
        AovName::Normal => ("normal", xyz, vectors(&|p| p.normal)),
        AovName::GeometricNormal => ("geometric_normal", xyz, vectors(&|p| p.geometric_normal)),
        AovName::Position => ("position", xyz, vectors(&world)),
        AovName::Depth => ("depth", &["Z"][..], numbers(&along)),
        AovName::Distance => ("distance", &["Z"][..], numbers(&|p| p.distance)),
        AovName::Roughness => ("roughness", &["Y"][..], numbers(&|p| p.roughness)),
        AovName::Metallic => ("metallic", &["Y"][..], numbers(&|p| p.metallic)),
        AovName::Emissive => ("emissive", rgb, vectors(&|p| p.emissive)),
        AovName::Material => ("material", &["id"][..], AovData::U32(pixels.iter().map(|p| p.material).collect())),
        AovName::Instance => ("instance", &["id"][..], AovData::U32(pixels.iter().map(|p| p.instance).collect())),
        AovName::Reflection | AovName::Refraction | AovName::Variance | AovName::HalfA | AovName::HalfB => {
            unreachable!("of the picture")
        }
    };
    Aov { name: title.to_owned(), channels: channels.iter().map(|c| (*c).to_owned()).collect(), samples }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_link_is_the_file_it_names() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link, other] = ["file.glb", "link.png", "other.png"].map(|name| folder.path().join(name));
        std::fs::write(&file, b"").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        assert!(are_same(&file, &link) && !are_same(&file, &other));
        let name = folder.path().file_name().unwrap();
        assert!(are_same(&other, &folder.path().join("..").join(name).join("other.png")));
    }
}
