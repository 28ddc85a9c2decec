//! The run: the scene's reference, the price of every rung alone, and a search for combinations that nothing beats.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, Result, bail, ensure};
use serde::{Deserialize, Serialize};

use super::difference::{Shown, ShownReference, Truth, shown, told_apart};
use super::forecast::Forecast;
use super::orders;
use super::price::{Against, price};
use super::sitting::{Bench, Sitting, Taken, total};
use super::table::{
    CONVERGED, DeviceName, Errors, Family, Interval, KnobState, Order, Point, Price, REFERENCE, Reference, Table,
    Tried, WorstPixel, frontier,
};
use etalon::frame::Settings;
use etalon::image::metric::{AnyPicture, Comparison, Metric, compare, map_rgba};
use etalon::image::png::Display;
use etalon::image::{Aov, AovData, Picture, exr, file, png, tone};
use etalon::plan::{EffectState, KNOBS, Knob, Knobs, Model, Plan};

/// Shares of the budget: for the reference, and for what is priced from it.
const REFERENCE_SHARE: f64 = 0.3;
const EXACT_SHARE: f64 = 0.4;
/// What comes after the reference, as far as can be told before.
const AFTER_SHARE: f64 = 0.3;
/// Bands of wavelengths that a reference may have, and samples that it has at least before it has more bands.
const BANDS: [u32; 3] = [32, 16, 8];
const FEWEST_SAMPLES: u32 = 64;
/// Pictures that the search may draw.
const SEARCH: usize = 8;
/// Mean squared difference of displayed values below which the search leaves out what it pays for: a thousandth of their range.
const NOTHING: f64 = 1e-6;
/// Half of the side of what is shown of the worst pixel.
const AROUND: i64 = 20;

/// How much is measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Extent {
    /// Seconds to be spent, about.
    pub budget_s: u32,
    /// Samples of the reference; `None`: what the budget allows.
    pub reference_samples: Option<u32>,
    /// This part of so many, counted from 1.
    pub shard: [u32; 2],
}

/// How far it is.
pub struct Step<'a> {
    /// What is drawn now.
    pub name: &'a str,
    /// Pictures done.
    pub done: usize,
    /// Of so many.
    pub of: usize,
    /// Seconds left, as far as what was drawn tells.
    pub left_s: f64,
}

/// A run.
pub struct Sweep<'a> {
    /// What draws.
    pub bench: Bench<'a>,
    /// Where the results go.
    pub folder: &'a Path,
    /// How much is measured.
    pub extent: Extent,
    /// The first words of every command.
    pub command: &'a str,
    /// What the scene is called.
    pub scene: &'a str,
    /// Hash of all that is drawn: a file may change under its name.
    pub contents: &'a str,
}

/// What is written beside each picture, so that an interrupted run goes on where it was.
#[derive(Serialize, Deserialize)]
struct Record {
    point: Point,
    price: Option<Price>,
    /// GPU milliseconds of each picture …
    ms: Vec<f64>,
    /// … and of the base's, drawn in turns with them.
    others_ms: Vec<f64>,
}

/// What two runs must have in common for one to go on with the other's pictures.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Identity {
    program: String,
    command: String,
    device: DeviceName,
    extent: Extent,
    contents: String,
    seed: u32,
}

/// A rung that one knob is set to.
#[derive(Debug, Clone)]
struct Change {
    knob: &'static Knob,
    from: &'static str,
    to: &'static str,
    knobs: Knobs,
}

/// Random numbers of the reference, which nobody chooses by chance: what shares some of them is nearer to it than to the truth.
fn other_seed(sweep: &Sweep<'_>) -> u32 {
    sweep.bench.settings.seed ^ 0x2a2a_2a2a
}

fn told_by_wavelength(bench: &Bench<'_>) -> bool {
    let scene = bench.original.scene();
    let used = scene.meshes.iter().map(|mesh| &scene.materials[mesh.material]);
    let materials = used
        .into_iter()
        .any(|m| m.reflectance.is_some() || m.emission.is_some() || m.conductor.is_some() || m.disperses());
    materials || scene.lights.iter().any(|light| light.spectrum.is_some())
}

fn named(knobs: &Knobs) -> BTreeMap<String, String> {
    knobs.list().into_iter().map(|(knob, rung)| (knob.to_owned(), rung.to_owned())).collect()
}

fn set(knobs: &Knobs, knob: &str, rung: &str) -> Result<Knobs> {
    knobs.with(knob, rung).with_context(|| format!("setting {knob}={rung}"))
}

/// `--model` and `--set` of some rungs: the preset that leaves least to be said.
#[must_use]
pub fn arguments(knobs: &Knobs) -> String {
    let rest = |model: Model| -> Vec<String> {
        let preset = Knobs::of(model).list();
        // Of glass that disperses the model of paths takes bands of wavelengths, unless told otherwise.
        let said = |knob: &str| model == Model::Global && knob == "colour";
        let others = knobs.list().into_iter().zip(preset).filter(|(a, b)| a != b || said(a.0));
        others.map(|((knob, rung), _)| format!("--set {knob}={rung}")).collect()
    };
    let all = [(Model::Local, "local"), (Model::Recursive, "recursive"), (Model::Global, "global")];
    let least = all.map(|(model, name)| (rest(model), name)).into_iter().min_by_key(|(rest, _)| rest.len());
    let (rest, name) = least.unwrap_or_default();
    std::iter::once(format!("--model {name}")).chain(rest).collect::<Vec<_>>().join(" ")
}

/// Whether some effect that a knob shapes is planned: a sentence for or against it.
fn called_for(knob: &Knob, plans: &[Plan]) -> (bool, String) {
    if knob.rungs.len() < 2 {
        return (false, format!("{} is its only rung", knob.rungs[0]));
    }
    if knob.effects.is_empty() {
        return (true, "shapes every surface".to_owned());
    }
    let mut against = String::new();
    for id in knob.effects {
        for effect in plans.iter().flat_map(|plan| &plan.effects).filter(|effect| effect.id == *id) {
            let shaped = match effect.state {
                EffectState::Kept => true,
                EffectState::DroppedBy(choice) => choice.knob == knob.name,
                EffectState::NotCalledFor => false,
            };
            let sentence = format!("{id}: {}", effect.reason());
            if shaped {
                return (true, sentence);
            }
            if against.is_empty() {
                against = sentence;
            }
        }
    }
    (false, against)
}

/// The largest of the rungs 1, 4, 16, … that takes no longer than so many milliseconds; 4 at least, without which no halves tell
/// the error.
fn samples_within(ms_each: f64, limit_ms: f64) -> u32 {
    [4096, 1024, 256, 64, 16].into_iter().find(|&n| f64::from(n) * ms_each <= limit_ms).unwrap_or(4)
}

/// A file name for a point.
fn stem(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
    name.chars().map(plain).collect()
}

impl Sweep<'_> {
    /// Measures, and writes each picture as it is drawn. `progress` hears of each before.
    ///
    /// # Errors
    /// When something cannot be drawn or written.
    pub fn run(&self, progress: &mut dyn FnMut(Step<'_>)) -> Result<Table> {
        let mut run = Run::begin(self)?;
        run.state = self.states()?;
        run.reference(progress)?;
        run.all(progress)?;
        run.finish()
    }

    /// Which knobs this scene calls for.
    fn states(&self) -> Result<Vec<(&'static Knob, bool, String)>> {
        let recursive = set(&Knobs::of(Model::Recursive), "lobes", "1")?;
        let bases = [Knobs::exact(), Knobs::of(Model::Local), recursive];
        let plans = bases.iter().map(|knobs| self.bench.plan(knobs)).collect::<Result<Vec<_>>>()?;
        let state = |knob| {
            let (called_for, reason) = called_for(knob, &plans);
            (knob, called_for, reason)
        };
        Ok(KNOBS.iter().map(state).collect())
    }

    fn path(&self, folder: &str, name: &str) -> PathBuf {
        self.folder.join(folder).join(name)
    }
}

/// A run under way.
struct Run<'a> {
    sweep: &'a Sweep<'a>,
    start: Instant,
    state: Vec<(&'static Knob, bool, String)>,
    truth: Option<Truth>,
    reference: Option<Reference>,
    /// The reference's rungs with fewer samples …
    exact: Knobs,
    /// … and with three colours, where wavelengths are too dear to price everything by them.
    plain: Knobs,
    records: Vec<Record>,
    search: Vec<Tried>,
    orders: Vec<Order>,
    warnings: Vec<String>,
    done: usize,
    of: usize,
    /// Pictures that the budget had no time for, and the seconds that they would have taken.
    left_out: (usize, f64),
    forecast: Forecast,
}

impl<'a> Run<'a> {
    fn begin(sweep: &'a Sweep<'a>) -> Result<Self> {
        let info = sweep.bench.device.info();
        let identity = Identity {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            command: sweep.command.to_owned(),
            device: device_name(sweep),
            extent: sweep.extent.clone(),
            contents: sweep.contents.to_owned(),
            seed: sweep.bench.settings.seed,
        };
        let path = sweep.folder.join("run.json");
        let making = |folder: &Path| {
            std::fs::create_dir_all(folder)
                .map_err(|e| anyhow::anyhow!("making the folder {}: {}", folder.display(), file::cause(&e)))
        };
        if path.exists() {
            let known: Identity = serde_json::from_slice(&file::read(&path)?)
                .with_context(|| format!("reading {}: it is not that of a run of cost", path.display()))?;
            ensure!(
                known == identity,
                "{} holds another run (`{}` with seed {}, a budget of {} s, part {}/{}, on {}), or one of a scene that has changed \
                 since: name another folder, or remove it",
                sweep.folder.display(),
                known.command,
                known.seed,
                known.extent.budget_s,
                known.extent.shard[0],
                known.extent.shard[1],
                known.device.name
            );
        } else {
            if sweep.folder.exists() && sweep.folder.read_dir().is_ok_and(|mut all| all.next().is_some()) {
                bail!("{} is not empty and holds no run of cost: name another folder", sweep.folder.display());
            }
            making(sweep.folder)?;
            file::write(&path, serde_json::to_string_pretty(&identity)?.as_bytes())?;
        }
        making(&sweep.folder.join("points"))?;
        making(&sweep.folder.join("pictures"))?;
        let mut warnings = Vec::new();
        if info.kind == "cpu" {
            warnings.push("a software device: times are those of this processor and of what else it does".to_owned());
        }
        Ok(Self {
            sweep,
            start: Instant::now(),
            state: Vec::new(),
            truth: None,
            reference: None,
            exact: Knobs::exact(),
            plain: Knobs::exact(),
            records: Vec::new(),
            search: Vec::new(),
            orders: Vec::new(),
            warnings,
            done: 0,
            of: 0,
            left_out: (0, 0.0),
            forecast: Forecast::default(),
        })
    }

    fn calls_for(&self, knob: &str) -> bool {
        self.state.iter().any(|(known, called_for, _)| known.name == knob && *called_for)
    }

    /// Chooses its samples and draws it, or reads it where an interrupted run has drawn it already.
    fn reference(&mut self, progress: &mut dyn FnMut(Step<'_>)) -> Result<()> {
        let sweep = self.sweep;
        let mut exact = Knobs::exact();
        let known = self.read_reference()?;
        let spectral = match &known {
            Some(known) => known.knobs.get("colour").is_some_and(|rung| rung != "rgb"),
            None => self.calls_for("colour") && told_by_wavelength(&sweep.bench) && self.seen_by_wavelength(&exact)?,
        };
        if !spectral {
            exact = set(&exact, "colour", "rgb")?;
            if self.calls_for("colour") {
                self.warnings.push(
                    "bands of wavelengths change nothing visible in this picture: the reference has three colours, and bands of \
                     wavelengths are priced as another reading of them"
                        .to_owned(),
                );
            }
        }
        // Times choose samples, but not twice in one run, and not differently in its parts.
        let [samples, priced] = match (known, sweep.extent.reference_samples) {
            (Some(known), _) => {
                if let Some(colour) = known.knobs.get("colour") {
                    exact = set(&exact, "colour", colour)?;
                }
                [known.samples, known.priced_samples]
            }
            (None, Some(samples)) => [samples, if samples >= 256 { 16 } else { 4 }],
            (None, None) => {
                let budget_ms = f64::from(sweep.extent.budget_s) * 1e3;
                let mut each_ms = self.a_sample_ms(&exact)?;
                if spectral {
                    let all = exact.colour.bands();
                    let affordable = |bands: &u32| {
                        let ms = each_ms * f64::from(*bands) / f64::from(all);
                        samples_within(ms, REFERENCE_SHARE * budget_ms) >= FEWEST_SAMPLES
                    };
                    let bands = BANDS.into_iter().find(affordable).unwrap_or(BANDS[BANDS.len() - 1]);
                    if bands < all {
                        each_ms *= f64::from(bands) / f64::from(all);
                        exact = set(&exact, "colour", &format!("spectral:{bands}"))?;
                        self.warnings.push(format!(
                            "the reference has {bands} bands of wavelengths: {all} would have left fewer than {FEWEST_SAMPLES} samples \
                             of each pixel; give it a larger --budget"
                        ));
                    }
                }
                let least_s = self.start.elapsed().as_secs_f64() + 4.0 * each_ms / 1e3;
                ensure!(
                    least_s < f64::from(sweep.extent.budget_s),
                    "the budget of {} s is spent before there is a reference of 4 samples, which takes {least_s:.0} s with what comes \
                     before it: --budget {:.0}, or a smaller --size, measures something",
                    sweep.extent.budget_s,
                    (4.0 * least_s).max(20.0)
                );
                // All but colours is priced in three of them.
                let plain_ms = if spectral { self.a_sample_ms(&set(&exact, "colour", "rgb")?)? } else { each_ms };
                let priced = samples_within(plain_ms, EXACT_SHARE * budget_ms / 80.0).min(16);
                [samples_within(each_ms, REFERENCE_SHARE * budget_ms), priced]
            }
        };
        self.exact = set(&exact, "samples", &priced.to_string())?;
        self.plain = set(&self.exact, "colour", "rgb")?;
        let knobs = set(&exact, "samples", &samples.to_string())?;
        let path = sweep.folder.join("reference.json");
        let film_path = sweep.folder.join("reference.exr");
        self.reference = self.read_reference()?;
        if self.reference.is_none() {
            let mut sitting = sweep.bench.sit_with(&knobs, other_seed(sweep))?;
            let (begun, mut last) = (Instant::now(), Instant::now());
            let rendered = sitting.renderer.render(sweep.bench.camera, &mut |at| {
                if last.elapsed().as_secs() >= 1 {
                    last = Instant::now();
                    let each_s = begun.elapsed().as_secs_f64() / f64::from(at.done);
                    let left_s = each_s * f64::from(at.of - at.done) + AFTER_SHARE * f64::from(sweep.extent.budget_s);
                    progress(Step { name: "reference", done: at.done as usize, of: at.of as usize, left_s });
                }
            })?;
            let film = sitting.renderer.film()?;
            let Some([half, _]) = sitting.renderer.halves(rendered.samples)? else {
                bail!("the reference has no halves: our mistake")
            };
            let png = sitting.renderer.png(&rendered)?;
            let own = rendered.errors.last().map_or(f64::INFINITY, |error| error.relmse.sqrt());
            let Settings { tonemap, exposure, .. } = sweep.bench.settings;
            let display = |picture: &Picture| {
                let bytes = |v: [f32; 3]| v.map(|v| tone::quantise(f64::from(v)));
                let pixel = |v| {
                    let [r, g, b] = bytes(v);
                    [r, g, b, 255]
                };
                let rgba = shown(picture, tonemap, exposure).into_iter().map(pixel).collect();
                AnyPicture::Display(Display { width: picture.width, height: picture.height, rgba })
            };
            let own_flip = compare(Metric::Flip, &display(&film), &display(&half))?.value;
            let reference = Reference {
                knobs: named(&knobs),
                samples: rendered.samples,
                priced_samples: priced,
                gpu_ms: rendered.passes.iter().map(|pass| pass.ms).sum(),
                own_error: own,
                own_flip,
                converged: own_flip <= CONVERGED,
                command: format!(
                    "{} --seed {} {} -o reference.png",
                    sweep.command,
                    other_seed(sweep),
                    arguments(&knobs)
                ),
                image: file::hash(&png),
            };
            file::write(&sweep.path("pictures", "reference.png"), &png)?;
            let samples = AovData::F32(half.rgba.iter().flat_map(|p| [p[0], p[1], p[2]]).collect());
            let half = Aov { name: "half_a".to_owned(), channels: ["R", "G", "B"].map(str::to_owned).into(), samples };
            file::write(&film_path, &exr::encode_exr(&film, &[half], &[])?)?;
            file::write(&path, serde_json::to_string_pretty(&reference)?.as_bytes())?;
            self.reference = Some(reference);
        }
        let film = exr::read_exr(&film_path)?;
        let half = half_of(&film_path, &film)?;
        let display = png::read_display(&sweep.path("pictures", "reference.png"))?;
        // What the other half must be for the film to be the mean of both.
        let other = Picture {
            width: film.width,
            height: film.height,
            rgba: film.rgba.iter().zip(&half.rgba).map(|(f, h)| std::array::from_fn(|c| 2.0 * f[c] - h[c])).collect(),
        };
        let Settings { tonemap, exposure, .. } = sweep.bench.settings;
        let [shown_film, a, b] = [&film, &half, &other].map(|picture| shown(picture, tonemap, exposure));
        let shown = ShownReference { film: shown_film, halves: [a, b] };
        self.truth = Some(Truth { film, half, shown, display });
        Ok(())
    }

    /// What an interrupted run has drawn already.
    fn read_reference(&self) -> Result<Option<Reference>> {
        let path = self.sweep.folder.join("reference.json");
        if !path.exists() {
            return Ok(None);
        }
        let reference = serde_json::from_slice(&file::read(&path)?);
        Ok(Some(reference.with_context(|| format!("reading {}", path.display()))?))
    }

    /// Whether bands of wavelengths show more than noise does: a picture with three colours and one with bands, along the same paths.
    fn seen_by_wavelength(&self, exact: &Knobs) -> Result<bool> {
        let bench = &self.sweep.bench;
        let Settings { tonemap, exposure, size, .. } = bench.settings;
        let few = set(exact, "samples", "4")?;
        let halves = |colour: &str| -> Result<[Shown; 2]> {
            let mut sitting = bench.sit(&set(&few, "colour", colour)?)?;
            let rendered = sitting.renderer.render(bench.camera, &mut |_| ())?;
            let halves =
                sitting.renderer.halves(rendered.samples)?.context("a picture by paths has no halves: our mistake")?;
            Ok(halves.map(|half| shown(&half, tonemap, exposure)))
        };
        let (difference, _) = told_apart(&halves("rgb")?, &halves("spectral:8")?, size[0] as usize);
        Ok(difference.surely() > 0.0)
    }

    /// GPU time of a sample.
    fn a_sample_ms(&self, knobs: &Knobs) -> Result<f64> {
        let mut sitting = self.sweep.bench.sit(&set(knobs, "samples", "4")?)?;
        let rendered = sitting.renderer.render_samples(self.sweep.bench.camera, 2, &mut |_| ())?;
        Ok(total(&rendered) / 2.0)
    }

    /// Every rung of every knob that is called for, one changed at a time; none twice.
    fn changes(&self, base: &Knobs, plan: &Plan, wanted: &dyn Fn(&Knob, &str) -> bool) -> Result<Vec<Change>> {
        let mut all = Vec::new();
        for (knob, _, _) in self.state.iter().filter(|(_, called_for, _)| *called_for) {
            let from = knob.rung(base);
            for &to in knob.rungs.iter().filter(|&&to| to != from && wanted(knob, to)) {
                let Some(knobs) = base.with(knob.name, to) else { continue };
                if knob.name == "upsampling" && knobs.colour.bands() == 0 {
                    continue;
                }
                // What the plan does not tell apart is told apart by constants.
                let by_constants = ["fresnel", "brdf", "arithmetic", "upsampling", "lights", "absorption"];
                if !by_constants.contains(&knob.name)
                    && self.sweep.bench.plan(&knobs).is_ok_and(|other| other.draws_as(plan))
                {
                    continue;
                }
                all.push(Change { knob, from, to, knobs });
            }
        }
        Ok(all)
    }

    fn all(&mut self, progress: &mut dyn FnMut(Step<'_>)) -> Result<()> {
        let bench = &self.sweep.bench;
        let local = Knobs::of(Model::Local);
        let paths = |knob: &Knob, rung: &str| match knob.name {
            // Noise is what samples, places and aims buy, and the presets show it.
            "samples" => false,
            "colour" => false,
            "lights" => rung != "points",
            "brdf" => rung == "ggx",
            _ => true,
        };
        let raster = |knob: &Knob, rung: &str| match knob.name {
            "samples" => matches!(rung, "1" | "16" | "64"),
            "colour" => rung == "spectral:16",
            "indirect" => rung != "path",
            _ => true,
        };
        let local_changes = self.changes(&local, &bench.plan(&local)?, &raster)?;
        let exact_changes = self.changes(&self.plain, &bench.plan(&self.plain)?, &paths)?;
        let mut presets = vec![("recursive".to_owned(), Knobs::of(Model::Recursive))];
        let most: u32 = self.exact.samples.count();
        for model in [Model::Recursive, Model::Global] {
            for samples in ["1", "4", "16"] {
                let knobs = set(&Knobs::of(model), "samples", samples)?;
                let name = format!("{} samples={samples}", if model == Model::Global { "global" } else { "recursive" });
                if (model == Model::Recursive || knobs.samples.count() <= most) && knobs != presets[0].1 {
                    presets.push((name, knobs));
                }
            }
        }
        let wavelengths: Vec<&str> = match (self.calls_for("colour"), self.exact == self.plain) {
            (false, _) => Vec::new(),
            (true, true) => vec!["spectral:16"],
            (true, false) => vec!["spectral:8", "spectral:16", "spectral:32"],
        };
        // What has more bands than the reference has nothing to be compared with.
        let compared = |rung: &&str| {
            self.exact == self.plain
                || self.plain.with("colour", rung).is_some_and(|k| k.colour.bands() <= self.exact.colour.bands())
        };
        let wavelengths: Vec<&str> = wavelengths.into_iter().filter(compared).collect();
        // Between what is priced and the reference.
        let reference = self.reference.as_ref().context("there is no reference yet")?;
        let samples =
            [1, 16, 64, 256].into_iter().filter(|&n| n != self.plain.samples.count() && n < reference.samples);
        let affordable = |n: &u32| {
            let ms = reference.gpu_ms / f64::from(reference.samples) * f64::from(*n);
            ms < 0.05e3 * f64::from(self.sweep.extent.budget_s)
        };
        let ladder: Vec<(String, Knobs)> = samples
            .filter(affordable)
            .map(|n| Ok((format!("exact samples={n}"), set(&self.exact, "samples", &n.to_string())?)))
            .collect::<Result<_>>()?;
        let dear = wavelengths.len() + ladder.len();
        let with_orders = self.calls_for("quadrature") && self.sweep.extent.shard[0] == 1;
        let for_orders = if with_orders { orders::PICTURES } else { 0 };
        self.of = 2 + local_changes.len() + presets.len() + exact_changes.len() + dear + for_orders + SEARCH;

        let plain = self.plain.clone();
        let [width, height] = bench.settings.size;
        let bands = f64::from(self.exact.colour.bands().max(1));
        self.forecast.path_ms = reference.gpu_ms / f64::from(reference.samples) / bands;
        // 8 ms for 640x360 on two cores, until it is known.
        self.forecast.raster_ms = 3.5e-5 * f64::from(width) * f64::from(height);
        let mut base = bench.sit(&local)?;
        self.forecast.raster_ms =
            self.forecast.raster_ms.min(bench.time(&mut base)? / f64::from(local.samples.count()));
        self.forecast.expect(&local, &local);
        presets.iter().for_each(|(_, knobs)| self.forecast.expect(knobs, &local));
        local_changes.iter().for_each(|change| self.forecast.expect(&change.knobs, &local));
        (0..SEARCH - 1).for_each(|_| self.forecast.expect(&local, &local));
        self.forecast.expect(&plain, &plain);
        exact_changes.iter().for_each(|change| self.forecast.expect(&change.knobs, &plain));
        let mut by_wavelength = Vec::new();
        for &to in &wavelengths {
            by_wavelength.push((to, set(&plain, "colour", to)?));
        }
        by_wavelength.iter().for_each(|(_, knobs)| self.forecast.expect(knobs, &plain));
        ladder.iter().for_each(|(_, knobs)| self.forecast.expect(knobs, &local));
        (0..for_orders).for_each(|_| self.forecast.expect(&local, &local));
        self.forecast.expect(&plain, &local);

        let taken = self.base("local", Family::Preset, &local, &mut base, progress)?;
        // First what answers most, should the budget end.
        for (name, knobs) in &presets {
            self.point(name, knobs, &mut base, progress)?;
        }
        for change in &local_changes {
            self.single(Family::Local, change, &mut base, &taken, progress)?;
        }
        self.search(&local, &local_changes, &mut base, progress)?;

        if self.too_late(self.forecast.next()) {
            let rest = self.of - self.done;
            self.left_out = (self.left_out.0 + rest - 1, self.left_out.1 + self.forecast.left());
            return Ok(());
        }
        let mut exact = bench.sit(&plain)?;
        let taken = self.base("exact", Family::Exact, &plain, &mut exact, progress)?;
        for change in &exact_changes {
            self.single(Family::Exact, change, &mut exact, &taken, progress)?;
        }
        for (to, knobs) in by_wavelength {
            let knob = KNOBS.iter().find(|knob| knob.name == "colour").context("the knob colour")?;
            let change = Change { knob, from: "rgb", to, knobs };
            self.single(Family::Exact, &change, &mut exact, &taken, progress)?;
        }
        for (name, knobs) in &ladder {
            self.point(name, knobs, &mut base, progress)?;
        }
        self.orders(progress)?;
        self.trimmed(&exact_changes, &mut base, progress)
    }

    /// Orders of the rules of quadrature: one part of a run in shards draws them.
    fn orders(&mut self, progress: &mut dyn FnMut(Step<'_>)) -> Result<()> {
        if !self.calls_for("quadrature") || self.sweep.extent.shard[0] != 1 {
            return Ok(());
        }
        let path = self.sweep.folder.join("orders.json");
        if path.exists() {
            self.orders =
                serde_json::from_slice(&file::read(&path)?).with_context(|| format!("reading {}", path.display()))?;
            self.of -= orders::PICTURES;
            self.forecast.skip(orders::PICTURES);
            return Ok(());
        }
        if self.too_late(orders::PICTURES as f64 * self.forecast.next()) {
            self.of -= orders::PICTURES;
            self.forecast.skip(orders::PICTURES);
            return Ok(());
        }
        let bench = &self.sweep.bench;
        let mut under_way: Option<(f64, Instant)> = None;
        let (forecast, done, of) = (&mut self.forecast, &mut self.done, self.of);
        let found = orders::orders(bench, &mut |name| {
            if let Some((expected, begun)) = under_way {
                forecast.took(expected, begun.elapsed().as_secs_f64());
            }
            progress(Step { name, done: *done, of, left_s: forecast.left() });
            *done += 1;
            under_way = Some((forecast.begin(), Instant::now()));
        });
        match found {
            Ok(orders) => {
                file::write(&path, serde_json::to_string_pretty(&orders)?.as_bytes())?;
                self.orders = orders;
            }
            Err(error) => self.fails("orders", &error),
        }
        Ok(())
    }

    /// Whether another shard draws this.
    fn elsewhere(&self) -> bool {
        let [shard, of] = self.sweep.extent.shard;
        self.done as u32 % of != shard - 1
    }

    /// The next picture begins: the seconds that are expected of it.
    fn tell(&mut self, name: &str, progress: &mut dyn FnMut(Step<'_>)) -> f64 {
        progress(Step { name, done: self.done, of: self.of, left_s: self.forecast.left() });
        self.done += 1;
        self.forecast.begin()
    }

    /// Whether the budget has no time for a picture. One whose reference was given its samples draws everything.
    fn too_late(&mut self, expected: f64) -> bool {
        let seconds = self.forecast.as_it_went(expected);
        let late = self.sweep.extent.reference_samples.is_none()
            && self.start.elapsed().as_secs_f64() + seconds > f64::from(self.sweep.extent.budget_s);
        if late {
            self.left_out = (self.left_out.0 + 1, self.left_out.1 + seconds);
        }
        late
    }

    /// What an interrupted run has found of the same rungs under this name.
    fn known(&self, name: &str, knobs: &Knobs) -> Result<Option<Record>> {
        let path = self.sweep.path("points", &format!("{}.json", stem(name)));
        if !path.exists() {
            return Ok(None);
        }
        let record: Record =
            serde_json::from_slice(&file::read(&path)?).with_context(|| format!("reading {}", path.display()))?;
        Ok(Some(record).filter(|record| record.point.knobs == named(knobs)))
    }

    /// A rung that cannot be drawn is told, and the others are drawn.
    fn fails(&mut self, name: &str, error: &anyhow::Error) {
        self.warnings.push(format!("\"{name}\" cannot be drawn here: {error:#}"));
    }

    /// A base that others are compared with: drawn anew in every run, because they are drawn in turns with it.
    fn base(
        &mut self,
        name: &str,
        family: Family,
        knobs: &Knobs,
        sitting: &mut Sitting,
        progress: &mut dyn FnMut(Step<'_>),
    ) -> Result<Taken> {
        let expected = self.tell(name, progress);
        let begun = Instant::now();
        let taken = self.sweep.bench.take(sitting, None)?;
        self.keep(name, family, knobs, sitting.start_ms, &taken, None)?;
        self.forecast.took(expected, begun.elapsed().as_secs_f64());
        Ok(taken)
    }

    /// A picture by itself.
    fn point(
        &mut self,
        name: &str,
        knobs: &Knobs,
        base: &mut Sitting,
        progress: &mut dyn FnMut(Step<'_>),
    ) -> Result<Option<Point>> {
        let elsewhere = self.elsewhere();
        let expected = self.tell(name, progress);
        if elsewhere {
            return Ok(None);
        }
        if let Some(record) = self.known(name, knobs)? {
            let point = record.point.clone();
            self.records.push(record);
            return Ok(Some(point));
        }
        if self.too_late(expected) {
            return Ok(None);
        }
        let begun = Instant::now();
        let drawn = self.sweep.bench.sit(knobs).and_then(|mut sitting| {
            let taken = self.sweep.bench.take(&mut sitting, Some(base))?;
            Ok((sitting, taken))
        });
        let (sitting, taken) = match drawn {
            Ok(drawn) => drawn,
            Err(error) => {
                self.fails(name, &error);
                return Ok(None);
            }
        };
        let family = if name.starts_with("search") { Family::Search } else { Family::Preset };
        let point = self.keep(name, family, knobs, sitting.start_ms, &taken, None)?;
        self.forecast.took(expected, begun.elapsed().as_secs_f64());
        Ok(Some(point))
    }

    /// One knob changed, drawn in turns with the base.
    fn single(
        &mut self,
        family: Family,
        change: &Change,
        base: &mut Sitting,
        base_taken: &Taken,
        progress: &mut dyn FnMut(Step<'_>),
    ) -> Result<()> {
        let word = if family == Family::Local { "local" } else { "exact" };
        let name = format!("{word} {}={}", change.knob.name, change.to);
        let elsewhere = self.elsewhere();
        let expected = self.tell(&name, progress);
        if elsewhere {
            return Ok(());
        }
        if let Some(record) = self.known(&name, &change.knobs)? {
            self.records.push(record);
            return Ok(());
        }
        if self.too_late(expected) {
            return Ok(());
        }
        let begun = Instant::now();
        let drawn = self.sweep.bench.sit(&change.knobs).and_then(|mut sitting| {
            let taken = self.sweep.bench.take(&mut sitting, Some(base))?;
            Ok((sitting, taken))
        });
        let (sitting, taken) = match drawn {
            Ok(drawn) => drawn,
            Err(error) => {
                self.fails(&name, &error);
                return Ok(());
            }
        };
        self.keep(&name, family, &change.knobs, sitting.start_ms, &taken, Some((change, base_taken)))?;
        self.forecast.took(expected, begun.elapsed().as_secs_f64());
        Ok(())
    }

    /// Compares a picture with the reference, and writes it and what was found.
    fn keep(
        &mut self,
        name: &str,
        family: Family,
        knobs: &Knobs,
        start_ms: f64,
        taken: &Taken,
        change: Option<(&Change, &Taken)>,
    ) -> Result<Point> {
        let truth = self.truth.as_ref().context("there is no reference yet")?;
        let (errors, flip) = truth.errors(&taken.film, &taken.display)?;
        let picture = stem(name);
        let write =
            |end: &str, bytes: &[u8]| file::write(&self.sweep.path("pictures", &format!("{picture}{end}")), bytes);
        write(".png", &taken.png)?;
        write(".error.png", &png::encode_png(flip.width, flip.height, &map_rgba(&flip), false)?)?;
        write(".worst.png", &around(&flip, [&truth.display.rgba, &taken.display.rgba])?)?;
        let seed = match self.sweep.bench.settings.seed {
            0 => String::new(),
            seed => format!(" --seed {seed}"),
        };
        let point = Point {
            name: name.to_owned(),
            family,
            knobs: named(knobs),
            gpu_ms: Interval::of(&taken.ms),
            timed: taken.ms.len(),
            start_ms,
            passes: taken.passes.clone(),
            errors,
            noise: taken.noise,
            work: taken.work.clone(),
            command: format!("{}{seed} {} --repeat 3 -o {picture}.png", self.sweep.command, arguments(knobs)),
            image: file::hash(&taken.png),
            picture: picture.clone(),
        };
        let price = change.map(|(change, base)| self.price(&point, change, taken, base)).transpose()?;
        let record = Record { point: point.clone(), price, ms: taken.ms.clone(), others_ms: taken.others_ms.clone() };
        let path = self.sweep.path("points", &format!("{picture}.json"));
        file::write(&path, serde_json::to_string_pretty(&record)?.as_bytes())?;
        self.records.push(record);
        Ok(point)
    }

    /// What a change cost and bought beside its base, which is among the records.
    fn price(&self, point: &Point, change: &Change, taken: &Taken, base: &Taken) -> Result<Price> {
        let truth = self.truth.as_ref().context("there is no reference yet")?;
        let name = if point.family == Family::Local { "local" } else { "exact" };
        let known = self.records.iter().find(|record| record.point.name == name).context("a base is drawn first")?;
        Ok(Price {
            point: point.name.clone(),
            flip_delta: point.error() - known.point.error(),
            ..price(change.knob, [change.from, change.to], taken, base, Against::Reference(truth))?
        })
    }

    /// From the quickest rungs towards less error, a change at a time: that which single prices promise most of for its time, and
    /// kept only if what was promised is there.
    fn search(
        &mut self,
        local: &Knobs,
        changes: &[Change],
        base: &mut Sitting,
        progress: &mut dyn FnMut(Step<'_>),
    ) -> Result<()> {
        if self.sweep.extent.shard != [1, 1] {
            self.warnings.push("a part of a run does not search for combinations".to_owned());
            self.of -= SEARCH - 1;
            self.forecast.skip(SEARCH - 1);
            return Ok(());
        }
        // Nothing is known below it.
        let floor = self.reference.as_ref().context("there is no reference yet")?.own_flip;
        // What each rung adds to the error and the time of `local`.
        let base_ms = self.records.iter().find(|r| r.point.name == "local").map_or(0.0, |r| r.point.gpu_ms.median);
        let mut rungs: Vec<(&Change, f64, f64)> = Vec::new();
        for change in changes {
            let price = self
                .records
                .iter()
                .filter_map(|r| r.price.as_ref())
                .find(|p| p.base == Family::Local && p.knob == change.knob.name && p.to == change.to);
            if let Some(price) = price.filter(|price| !price.same) {
                // A change of error that the reference cannot tell promises nothing; its time counts all the same.
                let more_error = if price.error_told { price.flip_delta } else { 0.0 };
                rungs.push((change, more_error, price.share * base_ms));
            }
        }
        let mut knobs = local.clone();
        for (change, _, ms) in &rungs {
            let now = rungs
                .iter()
                .find(|(known, ..)| known.knob.name == change.knob.name && known.to == change.knob.rung(&knobs));
            let quickest = *ms < now.map_or(0.0, |(_, _, ms)| *ms);
            if let (true, Some(changed)) = (quickest, knobs.with(change.knob.name, change.to)) {
                knobs = changed;
            }
        }
        let end = self.done + SEARCH - 1;
        let Some(mut current) = self.point("search: quickest", &knobs, base, progress)? else {
            return Ok(());
        };
        let mut refused: Vec<(&str, &str)> = Vec::new();
        for step in 1..SEARCH - 1 {
            let at = |knob: &str, rung: &str| {
                rungs
                    .iter()
                    .find(|(c, ..)| c.knob.name == knob && c.to == rung)
                    .map_or([0.0; 2], |(_, e, ms)| [*e, *ms])
            };
            let mut best: Option<(f64, &'static Knob, &'static str, f64)> = None;
            for (knob, _, _) in self.state.iter().filter(|(_, called_for, _)| *called_for) {
                let now = at(knob.name, knob.rung(&knobs));
                for &rung in knob.rungs.iter().filter(|&&rung| {
                    rung != knob.rung(&knobs)
                        && !refused.contains(&(knob.name, rung))
                        && knobs.with(knob.name, rung).is_some()
                }) {
                    let measured = rung == knob.rung(local)
                        || rungs.iter().any(|(c, ..)| c.knob.name == knob.name && c.to == rung);
                    let then = at(knob.name, rung);
                    let (gain, ms) = (now[0] - then[0], (then[1] - now[1]).max(0.01 * base_ms));
                    if measured && gain > floor && best.as_ref().is_none_or(|(ratio, ..)| gain / ms > *ratio) {
                        best = Some((gain / ms, knob, rung, gain));
                    }
                }
            }
            let Some((_, knob, rung, gain)) = best else { break };
            let changed = set(&knobs, knob.name, rung)?;
            let change = format!("{}: {} → {rung}", knob.name, knob.rung(&knobs));
            let Some(found) = self.point(&format!("search: step {step}"), &changed, base, progress)? else {
                break;
            };
            let kept = found.error().max(floor) < current.error().max(floor);
            self.search.push(Tried { change, promised: (current.error() - gain).max(0.0), found: found.error(), kept });
            if kept {
                knobs = changed;
                current = found;
            } else {
                refused.push((knob.name, rung));
            }
        }
        let unused = end.saturating_sub(self.done);
        self.of -= unused;
        self.forecast.skip(unused);
        Ok(())
    }

    /// The exact rungs less all that cost time and changed nothing that is seen: whether it is still so together.
    fn trimmed(&mut self, changes: &[Change], base: &mut Sitting, progress: &mut dyn FnMut(Step<'_>)) -> Result<()> {
        let mut knobs = self.plain.clone();
        // Of each knob the rung that saves most of those that change nothing.
        let mut best: BTreeMap<&str, (&Change, f64)> = BTreeMap::new();
        for change in changes.iter().filter(|_| self.sweep.extent.shard == [1, 1]) {
            let prices = self.records.iter().filter_map(|r| r.price.as_ref());
            let this = |p: &&Price| p.base == Family::Exact && p.knob == change.knob.name && p.to == change.to;
            let Some(price) = prices.into_iter().find(this) else { continue };
            let nothing =
                price.same || (!price.is_seen() && price.shown_delta.high < NOTHING && price.noise_ratio.is_none());
            let saved = -price.gpu_ms_delta.median;
            let known = best.get(change.knob.name).map_or(0.0, |(_, saved)| *saved);
            if nothing && price.saves() && saved > known {
                best.insert(change.knob.name, (change, saved));
            }
        }
        let mut saved = Vec::new();
        for (change, _) in best.into_values() {
            if let Some(changed) = knobs.with(change.knob.name, change.to) {
                saved.push(format!("{}={}", change.knob.name, change.to));
                knobs = changed;
            }
        }
        if saved.is_empty() {
            self.of -= 1;
            return Ok(());
        }
        let before = self.records.iter().find(|r| r.point.name == "exact").map(|r| r.point.error());
        if let (Some(found), Some(before)) =
            (self.point("search: exact without waste", &knobs, base, progress)?, before)
        {
            let kept = found.error() <= before * 1.02;
            self.search.push(Tried {
                change: format!("exact with {}", saved.join(", ")),
                promised: before,
                found: found.error(),
                kept,
            });
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Table> {
        let reference = self.reference.take().context("there is no reference")?;
        if !reference.converged {
            self.warnings.push(format!(
                "the reference has not converged: its own FLIP is {:.3} after {} samples, more than {CONVERGED}, and no error below \
                 that is known",
                reference.own_flip, reference.samples
            ));
        }
        if let (1.., seconds) = self.left_out {
            let budget_s = self.sweep.extent.budget_s;
            self.warnings.push(format!(
                "the budget of {budget_s} s was spent before {} of {} pictures were drawn: --budget {:.0} would draw them all, about",
                self.left_out.0,
                self.of,
                f64::from(budget_s) + 1.2 * seconds
            ));
        }
        if self.exact != self.plain {
            self.warnings.push("knobs other than colour are priced in three colours".to_owned());
        }
        let state = |(knob, called_for, reason): (&'static Knob, bool, String)| KnobState {
            knob: knob.name.to_owned(),
            called_for,
            reason,
            lecture: knob.lecture.iter().map(|&id| id.to_owned()).collect(),
            about: knob.about.to_owned(),
        };
        even_out(&mut self.records);
        let mut points: Vec<Point> = self.records.iter().map(|record| record.point.clone()).collect();
        let wandered = points.iter().find(|point| point.name == "exact").map(|point| point.gpu_ms);
        points.push(the_reference(&reference, wandered));
        Ok(Table {
            schema: "etalon.cost/1".to_owned(),
            program: env!("CARGO_PKG_VERSION").to_owned(),
            device: device_name(self.sweep),
            scene: self.sweep.scene.to_owned(),
            command: self.sweep.command.to_owned(),
            size: self.sweep.bench.settings.size,
            reference,
            knobs: self.state.into_iter().map(state).collect(),
            frontier: frontier(&points),
            points,
            prices: self.records.into_iter().filter_map(|record| record.price).collect(),
            search: self.search,
            orders: self.orders,
            warnings: self.warnings,
            shard: self.sweep.extent.shard,
            budget_s: f64::from(self.sweep.extent.budget_s),
            took_s: self.start.elapsed().as_secs_f64(),
        })
    }
}

/// Times as if the machine had been as quick all along: each is told as so many times the base's that was drawn in turns with it,
/// and the base's is the middle of all of its own. Whoever draws the picture again finds the machine somewhere else: the ends are
/// as far apart as those of the turns and those of the base over the whole run together.
fn even_out(records: &mut [Record]) {
    let exact = |record: &Record| record.point.family == Family::Exact && record.point.name != "exact";
    for (of_exact, name) in [(true, "exact"), (false, "local")] {
        let in_turns = |record: &Record| exact(record) == of_exact && !record.others_ms.is_empty();
        let all: Vec<f64> = records.iter().filter(|r| in_turns(r)).flat_map(|r| r.others_ms.iter().copied()).collect();
        if all.is_empty() {
            continue;
        }
        let medians: Vec<f64> =
            records.iter().filter(|r| in_turns(r)).map(|r| Interval::of(&r.others_ms).median).collect();
        let base = Interval { median: Interval::of(&medians).median, ..Interval::of(&all) };
        for record in records.iter_mut() {
            if in_turns(record) {
                let ratios: Vec<f64> = record.ms.iter().zip(&record.others_ms).map(|(ms, other)| ms / other).collect();
                let ratios = Interval::of(&ratios);
                record.point.gpu_ms = Interval {
                    median: ratios.median * base.median,
                    low: ratios.low * base.low,
                    high: ratios.high * base.high,
                };
            } else if record.point.name == name {
                record.point.gpu_ms = base;
                record.point.timed = all.len();
            }
        }
    }
}

/// The reference as a point: its own error is its distance from what it converges to. It is timed once: the ends of its time are as
/// far apart as those of the picture with its rungs and fewer samples.
fn the_reference(reference: &Reference, wandered: Option<Interval>) -> Point {
    let relmse = reference.own_error * reference.own_error;
    let share = |end: f64, median: f64| if median > 0.0 { reference.gpu_ms * end / median } else { reference.gpu_ms };
    let ends = wandered.map(|ms| [share(ms.low, ms.median), share(ms.high, ms.median)]);
    let [low, high] = ends.unwrap_or([reference.gpu_ms; 2]);
    Point {
        name: REFERENCE.to_owned(),
        family: Family::Exact,
        knobs: reference.knobs.clone(),
        gpu_ms: Interval { median: reference.gpu_ms, low, high },
        timed: 1,
        start_ms: 0.0,
        passes: Vec::new(),
        errors: Errors {
            flip_mean: reference.own_flip,
            flip_p95: 0.0,
            relmse: Interval { median: relmse, low: relmse, high: relmse },
            rmse: 0.0,
            delta_e_mean: 0.0,
            worst_pixel: WorstPixel { x: 0, y: 0, error: 0.0 },
        },
        noise: Some(relmse),
        work: BTreeMap::new(),
        command: reference.command.clone(),
        image: reference.image.clone(),
        picture: "reference".to_owned(),
    }
}

fn device_name(sweep: &Sweep<'_>) -> DeviceName {
    let info = sweep.bench.device.info();
    DeviceName {
        name: info.name.clone(),
        driver: info.driver.clone(),
        version: info.version.clone(),
        kind: info.kind.to_owned(),
    }
}

/// The mean of one half, as it lies beside the film.
fn half_of(path: &Path, film: &Picture) -> Result<Picture> {
    let channels = exr::read_channels(path)?;
    let get = |name: &str| {
        let found = channels.list.iter().find_map(|(known, samples)| match samples {
            AovData::F32(samples) if known == name => Some(samples),
            _ => None,
        });
        found.with_context(|| format!("reading {}: it has no channel {name}", path.display()))
    };
    let (r, g, b) = (get("half_a.R")?, get("half_a.G")?, get("half_a.B")?);
    let rgba = (0..film.rgba.len()).map(|i| [r[i], g[i], b[i], 1.0]).collect();
    Ok(Picture { width: film.width, height: film.height, rgba })
}

/// The reference and the picture around the worst pixel, side by side and four times as large.
fn around(flip: &Comparison, pictures: [&Vec<[u8; 4]>; 2]) -> Result<Vec<u8>> {
    let [wx, wy] = flip.worst.map(i64::from);
    let side = 2 * AROUND;
    let (width, height) = (2 * side * 4 + 8, side * 4);
    let mut rgba = Vec::with_capacity((width * height * 4) as usize);
    for y in 0..height {
        for x in 0..width {
            let right = x >= side * 4 + 8;
            let gap = x >= side * 4 && !right;
            let at = if right { x - side * 4 - 8 } else { x };
            let (px, py) = (wx - AROUND + at / 4, wy - AROUND + y / 4);
            let inside = px >= 0 && py >= 0 && px < i64::from(flip.width) && py < i64::from(flip.height);
            let pixel = if gap || !inside {
                [128, 128, 128, 255]
            } else {
                let [r, g, b, _] = pictures[usize::from(right)][(py * i64::from(flip.width) + px) as usize];
                [r, g, b, 255]
            };
            rgba.extend_from_slice(&pixel);
        }
    }
    png::encode_png(width as u32, height as u32, &rgba, false)
}
