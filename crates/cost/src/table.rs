//! What a run of `etalon cost` found, as data: `cost.json` (schema `etalon.cost/1`) and `cost.csv`.

use std::collections::BTreeMap;

use anyhow::{Result, bail, ensure};
use serde::{Deserialize, Serialize};

use super::statistics::Interval;
use etalon::gpu::Compiled;
use etalon::plan::{Knob, Knobs, Model};

/// The document.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Table {
    /// `etalon.cost/1`.
    pub schema: String,
    /// Version of the program.
    pub program: String,
    /// Where it was measured.
    pub device: DeviceName,
    /// Path or `study:NAME`.
    pub scene: String,
    /// The first words of every command: all that a picture depends on beside its knobs.
    pub command: String,
    /// Pixels.
    pub size: [u32; 2],
    /// The pixels that were asked for, where the budget had no time for them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asked: Option<RequestedSize>,
    /// What every error is an error against.
    pub reference: Reference,
    /// Which knobs the scene calls for.
    pub knobs: Vec<KnobState>,
    /// Everything that was drawn.
    pub points: Vec<Point>,
    /// Places in `points` of those that nothing beats in time and error at once, the quickest first, the reference last: each is
    /// nearer to the truth than the one before by more than noise.
    pub frontier: Vec<usize>,
    /// The settings that the frontier recommends.
    #[serde(default)]
    pub recommended: Vec<Recommended>,
    /// Standard errors that a statement had to be away from nothing, there being so many statements.
    #[serde(default)]
    pub standard_errors: f64,
    /// What changing one knob bought and cost.
    pub prices: Vec<Price>,
    /// How the search for better combinations went, a step each.
    pub search: Vec<Tried>,
    /// Pictures of other programs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<Other>,
    /// How the rules of quadrature come near to the integral, where media vary.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub orders: Vec<QuadratureOrder>,
    /// What is worth knowing before a figure is believed.
    pub warnings: Vec<String>,
    /// Which part of how many, counted from 1.
    pub shard: [u32; 2],
    /// Seconds that were given, and taken.
    pub budget_s: f64,
    /// See `budget_s`; those of an interrupted run are not known to the one that went on with it.
    pub took_s: f64,
}

/// A device by name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceName {
    /// Marketing name.
    pub name: String,
    /// Driver in words.
    pub driver: String,
    /// Its version.
    pub version: String,
    /// `cpu`, `discrete`, …
    #[serde(rename = "type")]
    pub kind: String,
}

/// The scene's own reference: every knob on the rung that approximates least.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Reference {
    /// Its rungs.
    pub knobs: BTreeMap<String, String>,
    /// Samples of each pixel.
    pub samples: u32,
    /// Those of pictures whose prices are told from its rungs.
    pub priced_samples: u32,
    /// GPU time of the picture.
    pub gpu_ms: f64,
    /// Root of its relative mean squared error against what it converges to, which its halves tell.
    pub own_error: f64,
    /// Mean of FLIP's error against what it converges to: that of one half of its samples against all, whose difference is as
    /// large as that error.
    pub own_flip: f64,
    /// The least error, of displayed values 0 to 1, that can be told from none.
    pub resolution: f64,
    /// Whether that is at most [`RESOLVED`].
    pub converged: bool,
    /// The pictures with random numbers of their own that it is the mean of.
    pub rounds: Vec<Round>,
    /// Makes it again, or the first of its rounds.
    pub command: String,
    /// Hash of the picture's file.
    pub image: String,
}

/// A picture that a reference is made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// Chooses its random numbers.
    pub seed: u32,
    /// Samples of each pixel.
    pub samples: u32,
    /// GPU time that it took.
    pub gpu_ms: f64,
}

/// Error that a reference has to resolve to be called converged: a step and a quarter of eight bits.
pub const RESOLVED: f64 = 0.005;

/// A setting that the page recommends.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Recommended {
    /// `quick`, `balanced` or `exact`.
    pub setting: String,
    /// Its place in `points`.
    pub point: usize,
}

/// The size that was asked for, of which fewer pixels were measured.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct RequestedSize {
    /// Pixels.
    pub size: [u32; 2],
    /// The recommended settings there, in the order of `recommended`.
    pub settings: Vec<AtSize>,
}

/// A picture of the size that was asked for.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct AtSize {
    /// GPU time with everything compiled.
    pub gpu_ms: Interval,
    /// Whether it was drawn; otherwise its time is foretold from that of fewer pixels.
    pub measured: bool,
    /// Draws it.
    pub command: String,
}

/// A knob in this scene.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct KnobState {
    /// Its name.
    pub knob: String,
    /// Whether some effect that it shapes is planned for the scene.
    pub called_for: bool,
    /// Which, or why none.
    pub reason: String,
    /// The lecture's statements behind it.
    pub lecture: Vec<String>,
    /// What it approximates.
    pub about: String,
}

/// Where a point comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// A preset, with other numbers of samples.
    Preset,
    /// The preset `local` with one rung changed.
    Local,
    /// The reference's rungs, with one changed or none, and fewer samples.
    Exact,
    /// Found by the search.
    Search,
}

/// Place and size of the largest error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WorstPixel {
    /// Column.
    pub x: u32,
    /// Row from the top.
    pub y: u32,
    /// FLIP's error there.
    pub error: f64,
}

/// How far a picture is from the reference.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Errors {
    /// Root of the mean squared error of displayed values 0 to 1 against what the reference converges to: two standard errors of
    /// the square either way.
    pub error: Interval,
    /// Mean of FLIP's error of the displayed pictures.
    pub flip_mean: f64,
    /// What 95 of 100 pixels stay below.
    pub flip_p95: f64,
    /// Relative mean squared error of the radiance, less what the reference's own noise adds; with two standard errors, as far as
    /// that noise makes it uncertain.
    pub relmse: Interval,
    /// Root mean squared error of the radiance, as it is.
    pub rmse: f64,
    /// Mean CIEDE2000 of the displayed colours.
    pub delta_e_mean: f64,
    /// Where FLIP's error is largest.
    pub worst_pixel: WorstPixel,
}

/// One picture: how it was made, what it took and how far off it is.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Point {
    /// Unique in the table.
    pub name: String,
    /// Where it comes from.
    pub family: Family,
    /// Rungs.
    pub knobs: BTreeMap<String, String>,
    /// GPU time of a picture with everything compiled: the middle, the shortest and the longest.
    pub gpu_ms: Interval,
    /// How many were timed.
    pub timed: usize,
    /// Milliseconds of wall time before that: uploading, making pipelines, compiling, and one or two samples.
    pub start_ms: f64,
    /// GPU milliseconds of each pass.
    pub passes: Vec<(String, f64)>,
    /// Against the reference.
    #[serde(flatten)]
    pub errors: Errors,
    /// Relative mean squared error by chance alone, which halves tell; of pictures by paths.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<f64>,
    /// Counts that are the same on every machine.
    pub work: BTreeMap<String, u64>,
    /// What the driver's compiler made of each program (registers, spills, size of code, in its own words), where it tells.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub compiled: BTreeMap<String, Vec<Compiled>>,
    /// Draws it again.
    pub command: String,
    /// Hash of the picture's file.
    pub image: String,
    /// Stem of its files in the folder `pictures`.
    pub picture: String,
}

impl Point {
    /// What the frontier is drawn by: the root mean squared error of displayed values. Unlike FLIP it can be told without the
    /// reference's noise; squares of radiance would be those of a few pixels that paths make far too bright.
    #[must_use]
    pub fn error(&self) -> f64 {
        self.errors.error.median
    }

    /// Its rungs as knobs.
    ///
    /// # Errors
    /// When this program has no such knob or rung.
    pub fn rungs(&self) -> Result<Knobs> {
        let mut knobs = Knobs::of(Model::Local);
        for (knob, rung) in &self.knobs {
            knobs.set(&format!("{knob}={rung}"))?;
        }
        knobs.check()?;
        Ok(knobs)
    }
}

/// A picture that another program drew of the same scene, from the same place.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Other {
    /// Its file.
    pub file: String,
    /// Against the reference; of a file of display values without those of radiance.
    #[serde(flatten)]
    pub errors: Errors,
    /// Mean radiance over that of the reference in red, green and blue; of OpenEXR.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_ratio: Option<[f64; 3]>,
}

/// What changing one knob bought and cost.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Price {
    /// The knob.
    pub knob: String,
    /// Rung it was on.
    pub from: String,
    /// Rung it was set to.
    pub to: String,
    /// `local` or `exact`: the rungs of all others.
    pub base: Family,
    /// The point.
    pub point: String,
    /// Milliseconds of GPU time more: the middle and both ends of pictures drawn in turns.
    pub gpu_ms_delta: Interval,
    /// How many turns.
    pub turns: usize,
    /// The same as a share of the base's.
    pub share: f64,
    /// FLIP between the two pictures; from `exact` with the same random numbers, so that noise is in both alike.
    pub flip_between: f64,
    /// More of FLIP's mean error against the reference.
    pub flip_delta: f64,
    /// More of the mean squared error of displayed values 0 to 1 against the reference; from `exact` the mean squared difference of
    /// what both pictures converge to, of which halves give a mean without noise, with two standard errors either way.
    pub shown_delta: Interval,
    /// Whether that is more than the noise of both pictures, or that of the reference: its sign is known.
    #[serde(default)]
    pub error_told: bool,
    /// Whether the difference of time is more than that of two runs of one program.
    #[serde(default)]
    pub time_told: bool,
    /// Side in pixels of the squares over which displayed values were averaged for that: 1, or more where single pixels are too noisy
    /// to tell anything.
    pub squares: u32,
    /// Of a knob that changes chance alone: its relative mean squared error by chance over that of the base.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_ratio: Option<f64>,
    /// Of a knob that changes rounding alone: mean radiance over the base's, where no chance is in both.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brightness: Option<f64>,
    /// Whether the pictures are the same to the last bit.
    pub same: bool,
    /// Whether the scene calls for the knob.
    pub called_for: bool,
    /// In a sentence.
    pub verdict: String,
}

/// FLIP below which nobody sees a difference: half of a step of eight bits.
pub const INVISIBLE: f64 = 0.002;

impl Price {
    /// Whether it takes longer than the base.
    #[must_use]
    pub fn takes_longer(&self) -> bool {
        self.time_told && self.share > 0.0
    }

    /// Whether it takes less time than the base.
    #[must_use]
    pub fn saves(&self) -> bool {
        self.time_told && self.share < 0.0
    }

    /// Whether it went to a rung further on in its knob's list.
    #[must_use]
    pub fn to_more_exact(&self) -> bool {
        let rungs = Knob::named(&self.knob).map_or(&[][..], |knob| knob.rungs);
        let place = |rung: &str| rungs.iter().position(|known| *known == rung);
        place(&self.to) > place(&self.from)
    }

    /// Whether it has less error though it approximates more: the error that it adds is against one that the base has.
    #[must_use]
    pub fn undoes_another(&self) -> bool {
        self.base == Family::Local && self.error_told && self.shown_delta.median < 0.0 && !self.to_more_exact()
    }

    /// Whether an eye sees it, and it is more than the noise of paths that went apart.
    #[must_use]
    pub fn is_seen(&self) -> bool {
        let beyond_noise = self.base != Family::Exact || self.error_told;
        !self.same && self.noise_ratio.is_none() && self.flip_between >= INVISIBLE && beyond_noise
    }
}

/// How a rule of quadrature comes near to the integral (lecture A2).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct QuadratureOrder {
    /// Rung of the knob `quadrature`.
    pub rule: String,
    /// Steps of each segment.
    pub steps: Vec<u32>,
    /// Root mean squared difference of radiance to that with most steps, over the root mean square of what is all around.
    pub errors: Vec<f64>,
    /// GPU milliseconds of the picture.
    pub gpu_ms: Vec<f64>,
    /// p of error ~ steps^−p where rounding does not hide it; `None` where fewer than two errors are left.
    pub order: Option<f64>,
}

/// A step of the search.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Tried {
    /// What was changed.
    pub change: String,
    /// Error that single prices promised.
    pub promised: f64,
    /// And what was found.
    pub found: f64,
    /// Whether it was kept.
    pub kept: bool,
}

/// Name of the reference among the points.
pub const REFERENCE: &str = "reference";

impl Table {
    /// The knobs that the scene calls for and that a point has on other rungs than the reference.
    #[must_use]
    pub fn given_up(&self, point: &Point) -> String {
        let other = |knob: &KnobState| {
            let [now, exact] = [&point.knobs, &self.reference.knobs].map(|knobs| knobs.get(&knob.knob));
            (now != exact).then(|| format!("{}={}", knob.knob, now.map_or("", String::as_str)))
        };
        let all: Vec<String> = self.knobs.iter().filter(|knob| knob.called_for).filter_map(other).collect();
        if all.is_empty() { "nothing".to_owned() } else { all.join(", ") }
    }

    /// The points as comma-separated values, a line each.
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

    /// One table of the parts that shards of one run measured, whose points are not judged together yet.
    ///
    /// # Errors
    /// When they are not of one scene, one reference and one kind of device.
    pub fn merge(parts: Vec<Self>) -> Result<Self> {
        let mut parts = parts.into_iter();
        let Some(mut all) = parts.next() else { bail!("merging: there is nothing to merge") };
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
                all.warnings.push(format!("times are those of {} and {}", all.device.name, part.device.name));
            }
            ensure!(part.shard[1] == of, "merging: two parts are of {of} and of {}", part.shard[1]);
            ensure!(!drawn.contains(&part.shard[0]), "merging: part {}/{of} is there twice", part.shard[0]);
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
        // The reference is the last.
        all.points.sort_by_key(|point| point.name == REFERENCE);
        Ok(all)
    }
}
