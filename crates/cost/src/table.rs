//! Results of a run of `etalon cost` as data: `cost.json` (schema `etalon.cost/1`) and `cost.csv`. See docs/cost.md.

use std::collections::BTreeMap;

use anyhow::{Result, bail, ensure};
use serde::{Deserialize, Serialize};

use super::statistics::{Interval, resolved};
use etalon::frame::Settings;
use etalon::gpu::Compiled;
use etalon::image::tone::ViewTransform;
use etalon::plan::rungs::Indirect;
use etalon::plan::{Knob, Knobs, Model};

/// The document `cost.json`.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Table {
    /// `etalon.cost/1`.
    pub schema: String,
    /// Version of the program.
    pub program: String,
    /// Device of the measurements.
    pub device: DeviceName,
    /// Path or `study:NAME`.
    pub scene: String,
    /// Beginning of every command: all that a picture depends on except its knobs.
    pub command: String,
    /// Measured size in pixels.
    pub size: [u32; 2],
    /// Requested size, if the budget was too small for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asked: Option<RequestedSize>,
    /// The reference of all errors.
    pub reference: Reference,
    /// All knobs, with whether the scene calls for them.
    pub knobs: Vec<KnobState>,
    /// All pictures.
    pub points: Vec<Point>,
    /// Pareto frontier: indices into `points`, the fastest first, the reference last. Each point has significantly less
    /// error than the one before.
    pub frontier: Vec<usize>,
    /// Recommended settings, from a frontier of presets and results of the search alone.
    #[serde(default)]
    pub recommended: Vec<Recommended>,
    /// Standard errors from zero that make a statement significant (Bonferroni correction).
    #[serde(default)]
    pub standard_errors: f64,
    /// Costs of changing one knob.
    pub prices: Vec<Price>,
    /// Steps of the search for combinations.
    pub search: Vec<Tried>,
    /// Pictures of other programs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<Other>,
    /// Convergence of the quadrature rules; only for scenes with heterogeneous media.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub orders: Vec<QuadratureOrder>,
    /// Warnings about the measurements.
    pub warnings: Vec<String>,
    /// Index (from 1) and number of the parts of a sharded run.
    pub shard: [u32; 2],
    /// Random seed of the pictures.
    #[serde(default)]
    pub seed: u32,
    /// Samples of the reference, if they were given instead of a budget.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_samples: Option<u32>,
    /// Time budget in seconds.
    pub budget_s: f64,
    /// Seconds taken, without those of an interrupted run that was continued.
    pub took_s: f64,
}

/// A device by name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceName {
    /// Name that the device reports.
    pub name: String,
    /// Name of the driver.
    pub driver: String,
    /// Version of the driver.
    pub version: String,
    /// `cpu`, `discrete`, …
    #[serde(rename = "type")]
    pub kind: String,
}

/// The scene's reference: every knob on its most exact rung.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Reference {
    /// Rungs by knob.
    pub knobs: BTreeMap<String, String>,
    /// Samples per pixel.
    pub samples: u32,
    /// Samples of the pictures whose base is `exact`.
    pub priced_samples: u32,
    /// GPU milliseconds of all rounds.
    pub gpu_ms: f64,
    /// Root of the relative mean squared error of the reference against its limit, estimated from its half buffers.
    pub own_error: f64,
    /// Mean FLIP error of the reference against its limit, estimated by the FLIP error of one half buffer against the
    /// whole, whose difference has the same size.
    pub own_flip: f64,
    /// Resolution: least error of display values 0 to 1 that is significant.
    pub resolution: f64,
    /// Root mean square, in display values 0 to 1, by which fewer bands of wavelengths than the most are off, as far
    /// as rays tell, or RGB, as far as the pilot tells; a part of `resolution`, and of the intervals of errors and of
    /// their differences.
    #[serde(default)]
    pub off_by_bands: f64,
    /// Tone curve, exposure and background of the display values that are compared.
    #[serde(default = "usual_view")]
    pub view: ViewTransform,
    /// Whether `resolution` is at most [`RESOLVED`].
    pub converged: bool,
    /// Pictures with different random seeds, whose mean is the reference.
    pub rounds: Vec<Round>,
    /// Command that draws the reference, or its first round.
    pub command: String,
    /// Hash of the picture file.
    pub image: String,
}

fn usual_view() -> ViewTransform {
    Settings::default().view_transform()
}

impl Reference {
    /// Number of bands of wavelengths, 0 for RGB, and of samples.
    #[must_use]
    pub fn extent(&self) -> (u32, u32) {
        let bands = self.knobs.get("colour").and_then(|rung| rung.strip_prefix("spectral:")?.parse().ok());
        (bands.unwrap_or(0), self.samples)
    }

    /// Whether more samples alone would not make it converge: its resolution without noise is above [`RESOLVED`].
    #[must_use]
    pub fn lacks_bands(&self) -> bool {
        resolved(self.off_by_bands, 0.0) > RESOLVED
    }

    /// What keeps it from converging, and what would improve it. `given`: whether its samples were given, not planned.
    #[must_use]
    pub fn shortcoming(&self, given: bool) -> [&'static str; 2] {
        if self.lacks_bands() {
            ["has too few bands of wavelengths", "a larger --budget draws more of them"]
        } else if given {
            ["is still noisy", "a larger --reference-samples improves it"]
        } else {
            ["is still noisy", "run the same command again to improve it"]
        }
    }
}

/// One of the pictures whose mean is the reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// Random seed.
    pub seed: u32,
    /// Samples per pixel.
    pub samples: u32,
    /// GPU milliseconds.
    pub gpu_ms: f64,
}

/// Largest resolution of a converged reference: 1.25 steps of eight-bit display values.
pub const RESOLVED: f64 = 0.005;

/// A recommended setting.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Recommended {
    /// `quick`, `balanced` or `exact`.
    pub setting: String,
    /// Index into `points`.
    pub point: usize,
}

/// The requested size, where fewer pixels were measured.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct RequestedSize {
    /// Requested size in pixels.
    pub size: [u32; 2],
    /// The recommended settings at this size, in the order of `recommended`.
    pub settings: Vec<AtSize>,
}

/// Time of a picture at the requested size.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct AtSize {
    /// GPU milliseconds of a warmed-up renderer.
    pub gpu_ms: Interval,
    /// Whether the picture was drawn; otherwise its time is extrapolated from fewer pixels.
    pub measured: bool,
    /// Command that draws the picture.
    pub command: String,
}

/// State of a knob in this scene.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct KnobState {
    /// Name of the knob.
    pub knob: String,
    /// Whether an effect of the knob is planned for the scene.
    pub called_for: bool,
    /// The planned effect, or the reason why there is none.
    pub reason: String,
    /// Ids of the lecture's statements about the knob.
    pub lecture: Vec<String>,
    /// Quantity that the knob approximates.
    pub about: String,
}

/// Family of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// A preset, also with other numbers of samples.
    Preset,
    /// The preset `local` with one knob changed.
    Local,
    /// The reference's rungs with fewer samples, and one knob changed or none.
    Exact,
    /// A result of the search.
    Search,
}

/// Position and value of the largest FLIP error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WorstPixel {
    /// Column.
    pub x: u32,
    /// Row from the top.
    pub y: u32,
    /// FLIP error of the pixel.
    pub error: f64,
}

/// Errors of a picture against the reference.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Errors {
    /// Root mean squared error of display values 0 to 1 against the limit of the reference, with the 95 % confidence
    /// interval (two standard errors of the mean square).
    pub error: Interval,
    /// Mean FLIP error of the displayed pictures.
    pub flip_mean: f64,
    /// 95th percentile of the FLIP error over pixels.
    pub flip_p95: f64,
    /// Relative mean squared error of the radiance, without the part that the reference's noise adds, with the 95 %
    /// confidence interval due to that noise.
    pub relmse: Interval,
    /// Root mean squared error of the radiance, including the reference's noise.
    pub rmse: f64,
    /// Mean CIEDE2000 colour difference of the displayed pictures.
    pub delta_e_mean: f64,
    /// Pixel with the largest FLIP error.
    pub worst_pixel: WorstPixel,
}

/// A picture with its knobs, times and errors.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Point {
    /// Name, unique in the table.
    pub name: String,
    /// Family of the picture.
    pub family: Family,
    /// Rungs by knob.
    pub knobs: BTreeMap<String, String>,
    /// GPU milliseconds of a warmed-up renderer: median, shortest and longest.
    pub gpu_ms: Interval,
    /// Number of timed renders.
    pub timed: usize,
    /// Wall milliseconds of the start: uploading, creating and compiling pipelines, and one or two samples.
    pub start_ms: f64,
    /// GPU milliseconds of each pass.
    pub passes: Vec<(String, f64)>,
    /// Errors against the reference.
    #[serde(flatten)]
    pub errors: Errors,
    /// Relative mean squared error due to noise alone, estimated from half buffers; only of path tracing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<f64>,
    /// Work counts, equal on every machine.
    pub work: BTreeMap<String, u64>,
    /// Compiler statistics of each program (registers, spills, code size, as the driver names them), if the driver
    /// reports any.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub compiled: BTreeMap<String, Vec<Compiled>>,
    /// Command that draws the picture again.
    pub command: String,
    /// Hash of the picture file.
    pub image: String,
    /// Stem of the file names in the folder `pictures`.
    pub picture: String,
}

impl Point {
    /// The error of the frontier: root mean squared error of display values. Unlike FLIP, it has an estimate without
    /// the reference's noise; squared radiance would be dominated by a few fireflies.
    #[must_use]
    pub fn error(&self) -> f64 {
        self.errors.error.median
    }

    /// Whether the picture is drawn by path tracing.
    #[must_use]
    pub fn is_path_traced(&self) -> bool {
        self.rungs().is_ok_and(|knobs| knobs.indirect == Indirect::Path)
    }

    /// The rungs as [`Knobs`].
    ///
    /// # Errors
    /// When this version of the program has no such knob or rung.
    pub fn rungs(&self) -> Result<Knobs> {
        let mut knobs = Knobs::of(Model::Local);
        for (knob, rung) in &self.knobs {
            knobs.set(&format!("{knob}={rung}"))?;
        }
        knobs.check()?;
        Ok(knobs)
    }
}

/// A picture of the same scene from the same camera, drawn by another program.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Other {
    /// Name of the file.
    pub file: String,
    /// Errors against the reference; radiance errors are 0 for a file with display values.
    #[serde(flatten)]
    pub errors: Errors,
    /// Mean radiance over that of the reference in red, green and blue; only of OpenEXR files.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_ratio: Option<[f64; 3]>,
}

/// Cost of changing one knob, by paired measurement with the base.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Price {
    /// Name of the knob.
    pub knob: String,
    /// Rung in the base.
    pub from: String,
    /// Rung in the picture.
    pub to: String,
    /// Base, `local` or `exact`: the rungs of all other knobs.
    pub base: Family,
    /// Name of the point.
    pub point: String,
    /// Additional GPU milliseconds: median, minimum and maximum of the paired differences.
    pub gpu_ms_delta: Interval,
    /// Number of paired times.
    pub turns: usize,
    /// `gpu_ms_delta` as a fraction of the base's time.
    pub share: f64,
    /// FLIP error between the two pictures; with base `exact` both have the same random numbers and so similar noise.
    pub flip_between: f64,
    /// Difference of the mean FLIP errors against the reference.
    pub flip_delta: f64,
    /// With base `local`: difference of the mean squared errors of display values 0 to 1 against the reference. With
    /// base `exact`: mean squared difference between the limits of both pictures, without noise. With the 95 %
    /// confidence interval (two standard errors).
    pub shown_delta: Interval,
    /// Whether `shown_delta` is significant, so that its sign is known.
    #[serde(default)]
    pub error_told: bool,
    /// Whether the time difference is significant.
    #[serde(default)]
    pub time_told: bool,
    /// Side in pixels of the blocks over which display values were averaged: 1, or more where single pixels are too
    /// noisy.
    pub squares: u32,
    /// Relative mean squared error due to noise, over that of the base; only of knobs that change noise alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_ratio: Option<f64>,
    /// Mean radiance over that of the base; only of knobs that change rounding alone, in pictures without noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brightness: Option<f64>,
    /// Whether the pictures are bit-identical.
    pub same: bool,
    /// Whether the scene calls for the knob.
    pub called_for: bool,
    /// Verdict in words.
    pub verdict: String,
}

/// FLIP error below which a difference is invisible: half a step of eight-bit display values.
pub const INVISIBLE: f64 = 0.002;

impl Price {
    /// Whether the change costs time and buys nothing: neither less error, nor less noise, nor a visible difference.
    /// What noise hides is not known to be nothing.
    #[must_use]
    pub fn is_wasted(&self) -> bool {
        let nearer = self.base != Family::Exact && self.error_told && self.shown_delta.median < 0.0;
        let unseen = self.noise_ratio.map_or(self.flip_between < INVISIBLE, |ratio| ratio >= 1.0);
        self.takes_longer() && !nearer && unseen
    }

    /// With the place added to the verdict where the change is wasted.
    pub(super) fn says_where_wasted(mut self, place: &str) -> Self {
        if self.is_wasted() {
            self.verdict += &format!(": wasted {place}");
        }
        self
    }

    /// Whether the change takes significantly longer than the base.
    #[must_use]
    pub fn takes_longer(&self) -> bool {
        self.time_told && self.share > 0.0
    }

    /// Whether the change takes significantly less time than the base.
    #[must_use]
    pub fn saves(&self) -> bool {
        self.time_told && self.share < 0.0
    }

    /// Whether the change goes to a more exact rung: rungs are listed from cheap to exact.
    #[must_use]
    pub fn to_more_exact(&self) -> bool {
        let rungs = Knob::named(&self.knob).map_or(&[][..], |knob| knob.rungs);
        let place = |rung: &str| rungs.iter().position(|known| *known == rung);
        place(&self.to) > place(&self.from)
    }

    /// The less exact one of both rungs.
    pub(super) fn cheaper_rung(&self) -> &str {
        if self.to_more_exact() { &self.from } else { &self.to }
    }

    /// Whether the change reduces the error although it approximates more: its error cancels another error of the base.
    #[must_use]
    pub fn undoes_another(&self) -> bool {
        self.base == Family::Local && self.error_told && self.shown_delta.median < 0.0 && !self.to_more_exact()
    }

    /// Whether the change is visible and, for path tracing, significant: different paths alone also cause visible
    /// noise.
    #[must_use]
    pub fn is_seen(&self) -> bool {
        self.noise_ratio.is_none() && self.shows()
    }

    /// Whether the change is visible, be it in noise alone. With base `exact` a difference of limits that is not
    /// significant may be noise of other paths, and is not counted.
    pub(super) fn shows(&self) -> bool {
        let beyond_noise = self.base != Family::Exact || self.error_told || self.noise_ratio.is_some();
        !self.same && self.flip_between >= INVISIBLE && beyond_noise
    }
}

/// Convergence of a quadrature rule (lecture A2).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct QuadratureOrder {
    /// Rung of the knob `quadrature`.
    pub rule: String,
    /// Numbers of steps per segment.
    pub steps: Vec<u32>,
    /// Root mean squared difference of radiance from the picture with most steps, over the root mean squared radiance
    /// of that picture.
    pub errors: Vec<f64>,
    /// GPU milliseconds of the pictures.
    pub gpu_ms: Vec<f64>,
    /// Order p in error ~ steps^−p; `None` where rounding leaves fewer than two errors.
    pub order: Option<f64>,
}

/// A step of the search.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Tried {
    /// The change in words.
    pub change: String,
    /// Error predicted from the costs of single changes.
    pub promised: f64,
    /// Measured error.
    pub found: f64,
    /// Whether the step was kept.
    pub kept: bool,
}

/// Name of the reference among the points.
pub const REFERENCE: &str = "reference";

impl Table {
    /// The points as comma-separated values, one line per point.
    ///
    /// # Errors
    /// Never: it is written to memory.
    pub fn csv(&self) -> Result<Vec<u8>> {
        let mut all = csv::Writer::from_writer(Vec::new());
        let knobs: Vec<&str> = self.knobs.iter().map(|k| k.knob.as_str()).collect();
        let figures = [
            "point",
            "family",
            "frontier",
            "gpu_ms",
            "gpu_ms_low",
            "gpu_ms_high",
            "start_ms",
            "error",
            "error_low",
            "error_high",
            "flip_mean",
            "flip_p95",
            "relmse",
            "relmse_low",
            "relmse_high",
            "rmse",
            "delta_e_mean",
            "worst_x",
            "worst_y",
            "worst_error",
            "image",
        ];
        all.write_record(figures.iter().chain(&knobs))?;
        for (index, p) in self.points.iter().enumerate() {
            let e = &p.errors;
            let mut row = vec![
                p.name.clone(),
                format!("{:?}", p.family).to_lowercase(),
                self.frontier.contains(&index).to_string(),
            ];
            let numbers = [
                p.gpu_ms.median,
                p.gpu_ms.low,
                p.gpu_ms.high,
                p.start_ms,
                e.error.median,
                e.error.low,
                e.error.high,
                e.flip_mean,
                e.flip_p95,
                e.relmse.median,
                e.relmse.low,
                e.relmse.high,
                e.rmse,
                e.delta_e_mean,
            ];
            row.extend(numbers.map(|number| number.to_string()));
            row.extend([e.worst_pixel.x.to_string(), e.worst_pixel.y.to_string(), e.worst_pixel.error.to_string()]);
            row.push(p.image.clone());
            row.extend(knobs.iter().map(|knob| p.knobs.get(*knob).cloned().unwrap_or_default()));
            all.write_record(&row)?;
        }
        Ok(all.into_inner()?)
    }

    /// Joins the tables of the shards of one run. The points are not yet evaluated together.
    ///
    /// # Errors
    /// When the tables are not of one scene, one reference and one driver, or when a shard is missing or duplicate.
    pub fn merge(parts: Vec<Self>) -> Result<Self> {
        let mut parts = parts.into_iter();
        let Some(mut all) = parts.next() else { bail!("merging: no tables are given") };
        let of = all.shard[1];
        let mut drawn = vec![all.shard[0]];
        for part in parts {
            for (what, a, b) in [
                ("programs", &all.program, &part.program),
                ("commands", &all.command, &part.command),
                ("references", &all.reference.image, &part.reference.image),
                ("drivers", &all.device.driver, &part.device.driver),
            ] {
                ensure!(a == b, "merging: two parts have different {what}, {a} and {b}");
            }
            if all.device != part.device {
                all.warnings.push(format!("times were measured on {} and on {}", all.device.name, part.device.name));
            }
            ensure!(part.shard[1] == of, "merging: one run has {of} parts, another has {}", part.shard[1]);
            ensure!(!drawn.contains(&part.shard[0]), "merging: part {}/{of} is given twice", part.shard[0]);
            drawn.push(part.shard[0]);
            for point in part.points {
                if all.points.iter().all(|known| known.name != point.name) {
                    all.points.push(point);
                }
            }
            all.search.extend(part.search);
            if all.orders.is_empty() {
                all.orders = part.orders;
            }
            for warning in part.warnings {
                if !all.warnings.contains(&warning) {
                    all.warnings.push(warning);
                }
            }
            all.took_s = all.took_s.max(part.took_s);
        }
        if let Some(missing) = (1..=of).find(|i| !drawn.contains(i)) {
            bail!("merging: part {missing}/{of} is missing");
        }
        all.shard = [1, 1];
        // The reference comes last.
        all.points.sort_by_key(|point| point.name == REFERENCE);
        Ok(all)
    }
}
