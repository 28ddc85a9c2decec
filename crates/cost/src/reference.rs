//! The reference picture, which errors are measured against: every knob on its most exact rung, with as many samples as
//! the errors require or the time budget allows. See docs/cost.md.
//!
//! The reference is the mean of rounds; each round is a picture with its own random seed that a command can draw again.
//! A later run continues the rounds of an earlier one. The number of samples is planned from a pilot, whose samples are
//! not used again, and from the clock. Neither depends on the samples of the reference, so that stopping does not bias
//! the significance tests (no optional stopping).

use std::path::Path;
use std::time::Instant;

use anyhow::{Context as _, Result, bail, ensure};

use super::command::{arguments, named, set};
use super::difference::{Shown, ShownReference, Truth, in_blocks, mean_of, shown, significant};
use super::size::{fewer, pixels, resized};
use super::statistics::{MANY, resolved, standard_errors};
use super::table::{RESOLVED, Reference, Round};
use super::warm::{Bench, total};
use etalon::frame::{Progress, TileShare};
use etalon::image::halves::error_of_halves;
use etalon::image::metric::{AnyPicture, Metric, compare};
use etalon::image::png::Display;
use etalon::image::tone::ViewTransform;
use etalon::image::{Aov, AovData, Picture, exr, file, png, tone};
use etalon::plan::{Knobs, Model};

/// Numbers of bands of wavelengths of a reference, and its least samples before it gets more bands.
pub(super) const BANDS: [u32; 3] = [32, 16, 8];
const FEWEST_SAMPLES: u32 = 16;
/// Least samples of a reference: four parts are needed to estimate its error.
pub(super) const LEAST_SAMPLES: u32 = 4;
/// Samples of a pilot.
const PILOT: u32 = 4;
/// Approximate number of pixels of a pilot; time and noise of a sample are scaled by pixels.
const PILOT_PIXELS: f64 = 160.0 * 90.0;
/// A pilot with bands may take this many times as long as a pilot in RGB, because the driver's cache may hold only the
/// programs for RGB (study:metals: 9 s after 2.4 s). It is drawn only if that is at most the following fraction of the
/// budget.
const BANDS_TAKE: f64 = 4.0;
const PILOT_SHARE: f64 = 0.6;
/// Approximate number of statements of a report, for the Bonferroni correction when samples are planned.
const STATEMENTS: usize = 150;
/// Largest fraction of the seconds left that a round may take: a round cannot be stopped, and the machine may become
/// slower.
const AT_ONCE: f64 = 0.7;
/// Largest number of rounds of one run: each round starts a new picture.
const MOST_ROUNDS: usize = 16;

/// The budget is too small for a reference of four samples.
#[derive(Debug, Clone, Copy, thiserror::Error)]
#[error(
    "the budget of {budget_s:.0} s is too small: a reference of 4 samples with its preparation takes {least_s:.0} s; use --budget \
     {enough_s} or a smaller --size"
)]
pub struct NotMeasured {
    /// Seconds of the budget.
    pub budget_s: f64,
    /// Seconds until a reference of four samples is drawn.
    pub least_s: f64,
    /// Seconds of a sufficient budget.
    pub enough_s: u32,
}

/// A run whose budget has no time for this many samples in RGB measures a picture with fewer pixels: all path-traced
/// pictures together take about as many (measured: docs/cost.md).
const WHOLE: f64 = 100.0;

/// Results of the pilot, from which the reference is planned.
#[derive(Debug, Clone)]
pub struct Pilot {
    /// Planned size of the reference in pixels.
    pub size: [u32; 2],
    /// Planned knobs of the reference; `samples` is not set yet.
    pub knobs: Knobs,
    /// GPU milliseconds of a sample.
    pub each_ms: f64,
    /// GPU milliseconds of a sample in RGB.
    pub plain_ms: f64,
    /// Estimated samples for the resolution [`RESOLVED`].
    pub wanted: u32,
    /// What RGB is off, where the scene has spectra and the budget no time for bands: see [`Reference::off_by_bands`].
    pub off_in_rgb: f64,
    /// Warnings for the report.
    pub warnings: Vec<String>,
}

/// Means of four consecutive parts of a picture's samples, alternately of even and odd samples.
type Parts = Vec<Picture>;

/// A reference as the mean of its rounds.
pub struct Refined {
    parts: Parts,
    rounds: Vec<Round>,
    knobs: Knobs,
    /// PNG file of the only round; `None` for several rounds.
    png: Option<Vec<u8>>,
    /// See [`Reference::off_by_bands`].
    off_by_bands: f64,
}

/// The largest of 4096, 1024, 256, 64 and 16 samples that take at most `limit_ms`, else 4, the least number of samples
/// for an error estimate.
#[must_use]
pub fn samples_within(ms_each: f64, limit_ms: f64) -> u32 {
    [4096, 1024, 256, 64, 16].into_iter().find(|&n| f64::from(n) * ms_each <= limit_ms).unwrap_or(LEAST_SAMPLES)
}

/// Random seed of a round. A user is unlikely to choose the same seed: a picture that shares random numbers with the
/// reference would seem closer to the truth than it is.
fn seed_of(seed: u32, round: usize) -> u32 {
    seed ^ 0x2a2a_2a2a ^ (round as u32).wrapping_mul(0x9e37_79b9)
}

fn told_by_wavelength(bench: &Bench<'_>) -> bool {
    let scene = bench.original.scene();
    let materials = scene
        .meshes
        .iter()
        .map(|mesh| &scene.materials[mesh.material])
        .any(|m| m.reflectance.is_some() || m.emission.is_some() || m.conductor.is_some() || m.disperses());
    materials || scene.lights.iter().any(|light| light.spectrum.is_some())
}

/// Mean of two pictures, weighted by their samples.
fn joined(a: &Picture, b: &Picture, samples: [u32; 2]) -> Picture {
    let share = f64::from(samples[1]) / (f64::from(samples[0]) + f64::from(samples[1]));
    let mean = |(a, b): (&[f32; 4], &[f32; 4])| {
        std::array::from_fn(|c| (f64::from(a[c]) + share * (f64::from(b[c]) - f64::from(a[c]))) as f32)
    };
    Picture { width: a.width, height: a.height, rgba: a.rgba.iter().zip(&b.rgba).map(mean).collect() }
}

/// The last of `parts` equal parts, from the mean of all parts and the mean of all parts before it.
fn last_part(all: &Picture, before: &Picture, parts: f32) -> Picture {
    let part = |(a, b): (&[f32; 4], &[f32; 4])| std::array::from_fn(|c| parts * a[c] - (parts - 1.0) * b[c]);
    Picture { width: all.width, height: all.height, rgba: all.rgba.iter().zip(&before.rgba).map(part).collect() }
}

/// Half buffer: mean of all even (`odd` = 0) or all odd (`odd` = 1) samples.
fn half(parts: &Parts, odd: usize) -> Picture {
    mean_of(&parts.iter().skip(odd).step_by(2).collect::<Vec<_>>())
}

fn all(parts: &Parts) -> Picture {
    mean_of(&parts.iter().collect::<Vec<_>>())
}

/// Draws a path-traced picture; returns the parts of its samples, its PNG file and its GPU milliseconds.
fn draw(
    bench: &Bench<'_>,
    knobs: &Knobs,
    seed: u32,
    progress: &mut dyn FnMut(Progress),
) -> Result<(Parts, Vec<u8>, f64)> {
    let samples = knobs.samples.count();
    ensure!(samples >= LEAST_SAMPLES, "{samples} samples cannot be split into parts: a bug of Etalon");
    let each = samples / 2;
    let mut renderer = bench.renderer(knobs, seed)?;
    let mut drawing = renderer.begin(bench.camera, samples);
    let (mut parts, mut before, mut last) = (Parts::new(), None::<[Picture; 2]>, Instant::now());
    while !drawing.is_done() {
        renderer.step(&mut drawing)?;
        let done = drawing.samples();
        if !drawing.is_whole() {
            continue;
        }
        if done.is_multiple_of(each) {
            let Some(now) = renderer.half_means_alone()?.map(|halves| halves.map(|half| bench.film(half))) else {
                bail!("a path-traced reference has no half buffers: a bug of Etalon")
            };
            let count = (done / each) as f32;
            parts.extend(match &before {
                None => now.clone(),
                Some([even, odd]) => [last_part(&now[0], even, count), last_part(&now[1], odd, count)],
            });
            before = Some(now);
        }
        if !drawing.is_done() && last.elapsed().as_secs() >= 1 {
            last = Instant::now();
            progress(Progress { done, of: samples, error: None });
        }
    }
    let rendered = renderer.picture(&drawing)?;
    Ok((parts, bench.display(&rendered)?.1, total(&rendered)))
}

/// Measurements of a pilot picture.
struct Look {
    parts: Parts,
    /// GPU milliseconds of a sample.
    each_ms: f64,
    /// Estimated samples for the resolution [`RESOLVED`].
    wanted: f64,
}

impl Look {
    /// Resolution of a reference drawn in `limit_ms`, with a bias of at most `off`; 1 where there is no time for one.
    fn resolves(&self, off: f64, limit_ms: f64) -> f64 {
        let samples = limit_ms / self.each_ms;
        if samples < f64::from(LEAST_SAMPLES) { 1.0 } else { resolved(off, RESOLVED * (self.wanted / samples).sqrt()) }
    }
}

fn look(bench: &Bench<'_>, colour: &str) -> Result<Look> {
    let knobs = set(&set(&Knobs::exact(), "samples", &PILOT.to_string())?, "colour", colour)?;
    // Compile first, so that the time of a sample does not contain it.
    bench.warm_up(&knobs)?;
    let (parts, _, ms) = draw(bench, &knobs, bench.settings.seed, &mut |_| ())?;
    let samples = f64::from(PILOT);
    let shown = ShownReference::of(&parts, &bench.settings.view_transform());
    let resolution = shown.resolution(standard_errors(STATEMENTS, MANY));
    Ok(Look { parts, each_ms: ms / samples, wanted: samples * (resolution / RESOLVED).powi(2) })
}

/// Width and height of a pilot in pixels. A share of the tiles has few pixels already.
fn pilot_size(bench: &Bench<'_>) -> [u32; 2] {
    let asked = bench.settings.size;
    let is_share = bench.settings.share != TileShare::ALL;
    if is_share { asked } else { fewer(asked, (pixels(asked) / PILOT_PIXELS).max(1.0)) }
}

impl Pilot {
    /// Draws a few samples and plans the reference. `called_for`: whether the scene calls for the knob `colour`.
    /// `budget_ms`: time budget of the run, infinite if its samples are given: then nothing depends on the clock;
    /// `share`: fraction of it for the reference. `may_shrink`: whether to measure fewer pixels if the budget is small.
    ///
    /// # Errors
    /// When the pilot cannot be drawn.
    pub fn draw(bench: &Bench<'_>, called_for: bool, [budget_ms, share]: [f64; 2], may_shrink: bool) -> Result<Self> {
        let begun = Instant::now();
        let (asked, few) = (bench.settings.size, pilot_size(bench));
        let bench = &resized(bench, few);
        let plain = look(bench, "rgb")?;
        let by_wavelength = called_for && told_by_wavelength(bench);
        // Spectral rendering has its own programs, which must be compiled too.
        let has_time = BANDS_TAKE * begun.elapsed().as_secs_f64() * 1e3 < PILOT_SHARE * budget_ms;
        let bands = if by_wavelength && has_time { Some(look(bench, "spectral:8")?) } else { None };
        let off_in_rgb = bands.as_ref().and_then(|bands| difference(bench, &plain.parts, &bands.parts));
        let most = if may_shrink { 1.0 } else { pixels(asked) / pixels(few) };
        let share_ms = share * budget_ms / most;
        let pays =
            |bands: &Look| off_in_rgb.is_some_and(|off| bands.resolves(0.0, share_ms) < plain.resolves(off, share_ms));
        let seen = bands.filter(pays);
        let off_in_rgb = if seen.is_some() { 0.0 } else { off_in_rgb.unwrap_or(0.0) };

        let reference_ms = f64::from(FEWEST_SAMPLES) * seen.as_ref().unwrap_or(&plain).each_ms;
        let fits = |size: &[u32; 2]| {
            let more = pixels(*size) / pixels(few);
            WHOLE * plain.each_ms * more <= budget_ms && reference_ms * more <= share * budget_ms
        };
        let sizes = (0..).map(|n| fewer(asked, 4.0_f64.powi(n))).take_while(|size| pixels(*size) > pixels(few));
        let size = if may_shrink { sizes.chain([few]).find(fits).unwrap_or(few) } else { asked };
        let more = pixels(size) / pixels(few);
        // The resolution scales with the square root of the samples and with the fourth root of the pixels.
        let wanted = |look: &Look| (look.wanted / more.sqrt()).ceil().clamp(4.0, 4096.0) as u32;
        let plain_ms = more * plain.each_ms;
        let rungs = |colour: &str| set(&Knobs::exact(), "colour", colour);
        let Some(seen) = seen else {
            let why = if !by_wavelength {
                "the scene has colours and no spectra".to_owned()
            } else if !has_time {
                "the budget has no time for spectral rendering, although the scene has spectra".to_owned()
            } else if off_in_rgb > 0.0 {
                format!(
                    "spectral rendering changes this picture by up to {:.1} % of the range, as far as {PILOT} samples tell, and would \
                     leave more noise in this budget",
                    100.0 * off_in_rgb
                )
            } else {
                "spectral rendering changes nothing significant in this picture".to_owned()
            };
            let warnings = if called_for { vec![format!("{why}: the reference is drawn in RGB")] } else { Vec::new() };
            let (knobs, wanted) = (rungs("rgb")?, wanted(&plain));
            return Ok(Self { size, knobs, each_ms: plain_ms, plain_ms, wanted, off_in_rgb, warnings });
        };
        let each_ms = |bands: u32| more * seen.each_ms * f64::from(bands) / 8.0;
        let affordable = |bands: &u32| samples_within(each_ms(*bands), share * budget_ms) >= FEWEST_SAMPLES;
        let bands = BANDS.into_iter().find(affordable).unwrap_or(8);
        // Each band has its own random numbers.
        let wanted = (wanted(&seen) * 8).div_ceil(bands).max(FEWEST_SAMPLES);
        let knobs = rungs(&format!("spectral:{bands}"))?;
        Ok(Self { size, knobs, each_ms: each_ms(bands), plain_ms, wanted, off_in_rgb, warnings: Vec::new() })
    }
}

/// Root mean square difference in display values 0 to 1 between `bands` bands of wavelengths and the most, of pictures
/// by rays with one sample, which have no noise.
///
/// # Errors
/// When a picture cannot be drawn.
pub fn off_by_bands(bench: &Bench<'_>, bands: u32) -> Result<f64> {
    let mut rays = Knobs::of(Model::Local);
    for choice in ["reflection=ray", "refraction=ray", "fresnel=exact", "samples=1"] {
        rays.set(choice)?;
    }
    let shown_in = |bands: u32| -> Result<Shown> {
        let knobs = set(&rays, "colour", &format!("spectral:{bands}"))?;
        let mut renderer = bench.renderer(&knobs, bench.settings.seed)?;
        renderer.render(bench.camera, &mut |_| ())?;
        Ok(shown(&bench.film(renderer.film_alone()?), &bench.settings.view_transform()))
    };
    let [few, most] = [shown_in(bands)?, shown_in(BANDS[0])?];
    let squares = few.as_flattened().iter().zip(most.as_flattened()).map(|(a, b)| f64::from(a - b).powi(2));
    Ok((squares.sum::<f64>() / (3 * few.len().max(1)) as f64).sqrt())
}

/// Upper end of the root mean square difference of two pictures in display values, in the smallest blocks where it is
/// significant; `None` where it is not.
fn difference(bench: &Bench<'_>, a: &Parts, b: &Parts) -> Option<f64> {
    let (view, size) = (bench.settings.view_transform(), bench.film_size());
    let halves = |parts: &Parts| -> [Shown; 2] { [0, 1].map(|odd| shown(&half(parts, odd), &view)) };
    let enough = standard_errors(3, MANY);
    let (_, found) = significant(&in_blocks(&halves(a), &halves(b), size[0] as usize), enough)?;
    found.is_above(enough).then(|| found.interval().high.sqrt())
}

impl Refined {
    /// The same with [`Reference::off_by_bands`], if it has fewer bands of wavelengths than the most. It is measured in
    /// a picture of the pilot's size; that of RGB is known from the pilot.
    ///
    /// # Errors
    /// When a picture cannot be drawn.
    pub fn aware_of_bands(self, bench: &Bench<'_>, off_in_rgb: f64) -> Result<Self> {
        let off_by_bands = match self.knobs.colour.bands() {
            _ if self.off_by_bands > 0.0 => return Ok(self),
            0 => off_in_rgb,
            bands if bands == BANDS[0] => 0.0,
            bands => off_by_bands(&resized(bench, pilot_size(bench)), bands)?,
        };
        Ok(Self { off_by_bands, ..self })
    }

    /// Draws one more round of `samples` samples, after the rounds of `known`. Without one the reference is not
    /// [aware of its bands](Refined::aware_of_bands).
    ///
    /// # Errors
    /// When the round cannot be drawn.
    pub fn round(
        known: Option<Self>,
        bench: &Bench<'_>,
        knobs: &Knobs,
        samples: u32,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Self> {
        let knobs = set(knobs, "samples", &samples.to_string())?;
        let seed = seed_of(bench.settings.seed, known.as_ref().map_or(0, |known| known.rounds.len()));
        let (parts, png, gpu_ms) = draw(bench, &knobs, seed, progress)?;
        let round = Round { seed, samples, gpu_ms };
        Ok(match known {
            None => Self { parts, rounds: vec![round], knobs, png: Some(png), off_by_bands: 0.0 },
            Some(known) => {
                let samples = [known.samples(), samples];
                let parts = known.parts.iter().zip(&parts).map(|(a, b)| joined(a, b, samples)).collect();
                let rounds = [known.rounds, vec![round]].concat();
                Self { parts, rounds, png: None, ..known }
            }
        })
    }

    /// Samples per pixel.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.rounds.iter().map(|round| round.samples).sum()
    }

    /// GPU milliseconds of a sample.
    #[must_use]
    pub fn each_ms(&self) -> f64 {
        self.gpu_ms() / f64::from(self.samples().max(1))
    }

    /// GPU milliseconds of all rounds.
    #[must_use]
    pub fn gpu_ms(&self) -> f64 {
        self.rounds.iter().map(|round| round.gpu_ms).sum()
    }

    /// Width and height in pixels.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        self.parts.first().map_or([0, 0], |part| [part.width, part.height])
    }

    /// Knobs of the reference, with the samples of the first round.
    #[must_use]
    pub fn knobs(&self) -> &Knobs {
        &self.knobs
    }

    /// Whether this run has drawn its largest number of rounds; `before` is the number of rounds at its start.
    #[must_use]
    pub fn has_many_rounds(&self, before: usize) -> bool {
        self.rounds.len() - before >= MOST_ROUNDS
    }

    /// Number of rounds.
    #[must_use]
    pub fn rounds(&self) -> usize {
        self.rounds.len()
    }

    /// The reference picture, ready for error measurements of display values.
    #[must_use]
    pub fn truth(&self, view: &ViewTransform) -> Truth {
        let (film, half) = (all(&self.parts), half(&self.parts, 0));
        let display = self.png.as_ref().and_then(|png| png::decode_display(png).ok());
        let display = display.unwrap_or_else(|| display_of(&film, view));
        let shown = ShownReference::of(&self.parts, view).also_off(self.off_by_bands);
        Truth { film, half, shown, display }
    }

    /// Facts of the reference for the table, and its PNG file. `command`: beginning of every printed command. `priced`:
    /// samples of the pictures with base `exact`.
    ///
    /// # Errors
    /// When pictures cannot be compared or encoded.
    pub fn describe(
        &self,
        truth: &Truth,
        command: &str,
        priced: u32,
        bench: &Bench<'_>,
    ) -> Result<(Reference, Vec<u8>)> {
        let halves = [0, 1].map(|odd| half(&self.parts, odd));
        let own = error_of_halves([&halves[0].rgba, &halves[1].rgba], [1, 1]);
        let any = |display: Display| AnyPicture::Display(display);
        let view = bench.settings.view_transform();
        let half = display_of(&truth.half, &view);
        let own_flip = compare(Metric::Flip, &any(display_of(&truth.film, &view)), &any(half))?.value;
        let resolution = truth.shown.resolution(standard_errors(STATEMENTS, MANY));
        let png = match &self.png {
            Some(png) => png.clone(),
            None => {
                let Display { width, height, rgba } = &truth.display;
                png::encode_png(*width, *height, rgba.as_flattened(), view.background.is_none())?
            }
        };
        let samples = set(&self.knobs, "samples", &self.rounds[0].samples.to_string())?;
        let mut knobs = named(&self.knobs);
        knobs.insert("samples".to_owned(), self.samples().to_string());
        let reference = Reference {
            knobs,
            samples: self.samples(),
            priced_samples: priced,
            gpu_ms: self.gpu_ms(),
            own_error: own.relmse.sqrt(),
            own_flip,
            resolution,
            off_by_bands: self.off_by_bands,
            view,
            converged: resolution <= RESOLVED,
            rounds: self.rounds.clone(),
            command: format!("{command} --seed {} {} -o reference.png", self.rounds[0].seed, arguments(&samples)),
            image: file::hash(&png),
        };
        Ok((reference, png))
    }

    /// Writes the files from which a later run continues: the film with its parts, the PNG, and then `reference`.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, folder: &Path, reference: &Reference, png: &[u8]) -> Result<()> {
        let part = |(i, part): (usize, &Picture)| Aov {
            name: format!("part_{i}"),
            channels: ["R", "G", "B", "A"].map(str::to_owned).into(),
            samples: AovData::F32(part.rgba.iter().flatten().copied().collect()),
        };
        let parts: Vec<Aov> = self.parts.iter().enumerate().map(part).collect();
        file::write(&folder.join("reference.exr"), &exr::encode_exr_quickly(&all(&self.parts), &parts)?)?;
        file::write(&folder.join("reference.png"), png)?;
        file::write(&folder.join("reference.json"), serde_json::to_string_pretty(reference)?.as_bytes())
    }

    /// Reads the files of [`Refined::write`]; `None` where there are none.
    ///
    /// # Errors
    /// When a file is damaged.
    pub fn read(folder: &Path) -> Result<Option<(Self, Reference)>> {
        let path = folder.join("reference.json");
        if !path.exists() {
            return Ok(None);
        }
        let reference: Reference =
            serde_json::from_slice(&file::read(&path)?).with_context(|| format!("reading {}", path.display()))?;
        let path = folder.join("reference.exr");
        let (film, channels) = (exr::read_exr(&path)?, exr::read_channels(&path)?);
        let get = |name: &str| {
            let found = channels.list.iter().find_map(|(known, samples)| match samples {
                AovData::F32(samples) if known == name => Some(samples),
                _ => None,
            });
            found.with_context(|| format!("reading {}: it has no channel {name}", path.display()))
        };
        let part = |i: usize| -> Result<Picture> {
            let [r, g, b, a] = ["R", "G", "B", "A"].map(|c| get(&format!("part_{i}.{c}")));
            let (r, g, b, a) = (r?, g?, b?, a?);
            let rgba = (0..film.rgba.len()).map(|i| [r[i], g[i], b[i], a[i]]).collect();
            Ok(Picture { width: film.width, height: film.height, rgba })
        };
        let count = channels.list.iter().filter(|(name, _)| name.starts_with("part_")).count() / 4;
        let parts = (0..count).map(part).collect::<Result<Parts>>()?;
        let first = reference.rounds.first().with_context(|| format!("{} has no rounds", path.display()))?;
        let mut knobs = Knobs::exact();
        for (knob, rung) in reference.knobs.iter().filter(|(knob, _)| *knob != "samples") {
            knobs = set(&knobs, knob, rung)?;
        }
        let knobs = set(&knobs, "samples", &first.samples.to_string())?;
        let png = if reference.rounds.len() == 1 { Some(file::read(&folder.join("reference.png"))?) } else { None };
        let (rounds, off_by_bands) = (reference.rounds.clone(), reference.off_by_bands);
        Ok(Some((Self { parts, rounds, knobs, png, off_by_bands }, reference)))
    }
}

/// Display values of a film; without a background their alpha is the coverage.
pub(super) fn display_of(film: &Picture, view: &ViewTransform) -> Display {
    let pixel = |(v, [.., coverage]): ([f32; 3], &[f32; 4])| {
        let [r, g, b] = v.map(|v| tone::quantise(f64::from(v)));
        let alpha = if view.background.is_some() { 255 } else { tone::quantise(f64::from(*coverage)) };
        [r, g, b, alpha]
    };
    let rgba = shown(film, view).into_iter().zip(&film.rgba).map(pixel).collect();
    Display { width: film.width, height: film.height, rgba }
}

/// Draws rounds until the reference has `wanted` samples or `seconds_left` leaves no time for another round.
///
/// # Errors
/// When a round cannot be drawn.
pub fn refine(
    mut known: Refined,
    bench: &Bench<'_>,
    wanted: u32,
    seconds_left: &dyn Fn() -> f64,
    progress: &mut dyn FnMut(Progress),
) -> Result<Refined> {
    let before = known.rounds();
    let mut each_s = known.each_ms() / 1e3;
    while known.samples() < wanted && !known.has_many_rounds(before) {
        let left_s = seconds_left();
        let missing = f64::from(wanted - known.samples());
        let fits = |n: &u32| f64::from(*n) * each_s <= AT_ONCE * left_s && f64::from(*n) < 4.0 * missing;
        let Some(samples) = [1024, 256, 64, 16, 4].into_iter().find(fits) else { break };
        let begun = Instant::now();
        let knobs = known.knobs().clone();
        known = Refined::round(Some(known), bench, &knobs, samples, progress)?;
        each_s = begun.elapsed().as_secs_f64() / f64::from(samples);
    }
    Ok(known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_transparent_stays_transparent() {
        let film = Picture { width: 2, height: 1, rgba: vec![[0.0; 4], [1.0; 4]] };
        let clear = ViewTransform { curve: tone::ToneMap::Linear, exposure: 0.0, background: None };
        assert_eq!(display_of(&film, &clear).rgba, [[0, 0, 0, 0], [255, 255, 255, 255]]);
        let white = ViewTransform { background: Some([1.0; 3]), ..clear };
        assert_eq!(display_of(&film, &white).rgba, [[255; 4]; 2]);
    }

    /// A picture whose colours differ by 1 % of the range between RGB and bands, and bands are twelve times as dear:
    /// they pay where there is time for so many samples that noise is less than that.
    #[test]
    fn bands_pay_where_noise_is_less_than_their_difference() {
        let look = |each_ms: f64, wanted: f64| Look { parts: Parts::new(), each_ms, wanted };
        let (plain, bands) = (look(10.0, 400.0), look(120.0, 400.0));
        let pays = |limit_ms: f64| bands.resolves(0.0, limit_ms) < plain.resolves(0.01, limit_ms);
        assert!(!pays(300.0) && !pays(1_000.0) && pays(10_000.0) && pays(f64::INFINITY));
        // No time for four samples, and no noise at all.
        assert_eq!(bands.resolves(0.0, 400.0), 1.0);
        assert_eq!(bands.resolves(0.0, f64::INFINITY), 0.0);
    }
}
