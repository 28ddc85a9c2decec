//! List of the pictures of a run, in order: presets, and one-factor-at-a-time changes of every knob that the scene
//! calls for. See docs/cost.md, "A run".

use anyhow::{Context as _, Result};
use serde::{Deserialize, Serialize};

use super::command::set;
use super::table::{Family, KnobState};
use super::warm::Bench;
use etalon::plan::rungs::{Caustics, Denoise, Guiding};
use etalon::plan::{EffectState, KNOBS, Knob, Knobs, Model, Plan};

/// Change of one knob relative to a base.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Change {
    /// Name of the knob.
    pub knob: String,
    /// Rung in the base.
    pub from: String,
    /// Rung in the picture.
    pub to: String,
}

/// A picture to draw.
#[derive(Debug, Clone)]
pub struct Task {
    /// Name, unique in a run.
    pub name: String,
    /// Family of the picture.
    pub family: Family,
    /// Knobs of the picture.
    pub knobs: Knobs,
    /// The one knob that differs from the base; `None` where the picture has no base.
    pub change: Option<Change>,
}

/// Every knob, with whether the scene calls for it and the reason.
pub struct States(Vec<(&'static Knob, bool, String)>);

/// The pictures of a run, except those of the search.
pub struct Agenda {
    /// The preset `local`, base of the changes in `of_local`.
    pub local: Knobs,
    /// The reference's rungs with few samples and RGB, base of the changes in `of_exact`.
    pub plain: Knobs,
    /// Presets, also with more samples.
    pub presets: Vec<Task>,
    /// `local` with one knob changed.
    pub of_local: Vec<Task>,
    /// `exact` with one knob changed.
    pub of_exact: Vec<Task>,
    /// The reference's rungs with other numbers of samples.
    pub ladder: Vec<Task>,
    /// Whether to measure the orders of the quadrature rules.
    pub orders: bool,
}

/// Whether a plan contains an effect of the knob, with a sentence for or against it.
fn called_for(knob: &Knob, plans: &[Plan]) -> (bool, String) {
    if knob.rungs.len() < 2 {
        return (false, format!("{} is the only rung", knob.rungs[0]));
    }
    if knob.effects.is_empty() {
        return (true, "affects every surface".to_owned());
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

impl States {
    /// States from the plans of the reference's rungs, of `local` and of `recursive`.
    ///
    /// # Errors
    /// When the scene has nothing to draw.
    pub fn of(bench: &Bench<'_>) -> Result<Self> {
        let recursive = set(&Knobs::of(Model::Recursive), "lobes", "1")?;
        let bases = [Knobs::exact(), Knobs::of(Model::Local), recursive];
        let plans = bases.iter().map(|knobs| bench.plan(knobs)).collect::<Result<Vec<_>>>()?;
        let state = |knob| {
            let (called_for, reason) = called_for(knob, &plans);
            (knob, called_for, reason)
        };
        Ok(Self(KNOBS.iter().map(state).collect()))
    }

    /// Whether the scene calls for a knob.
    #[must_use]
    pub fn calls_for(&self, knob: &str) -> bool {
        self.called_for().any(|known| known.name == knob)
    }

    /// The knobs that the scene calls for.
    pub fn called_for(&self) -> impl Iterator<Item = &'static Knob> {
        self.0.iter().filter(|(_, called_for, _)| *called_for).map(|(knob, ..)| *knob)
    }

    /// The states as rows of the table.
    #[must_use]
    pub fn list(&self) -> Vec<KnobState> {
        let state = |(knob, called_for, reason): &(&'static Knob, bool, String)| KnobState {
            knob: knob.name.to_owned(),
            called_for: *called_for,
            reason: reason.clone(),
            lecture: knob.lecture.iter().map(|&id| id.to_owned()).collect(),
            about: knob.about.to_owned(),
        };
        self.0.iter().map(state).collect()
    }

    /// One task for each rung that `wanted` accepts of each knob that the scene calls for, with one knob changed. A
    /// rung whose plan equals that of the base is skipped.
    fn changes(
        &self,
        bench: &Bench<'_>,
        family: Family,
        base: &Knobs,
        wanted: &dyn Fn(&Knob, &str) -> bool,
    ) -> Result<Vec<Task>> {
        let plan = bench.plan(base)?;
        let mut all = Vec::new();
        for knob in self.called_for() {
            let from = knob.rung(base);
            for &to in knob.rungs.iter().filter(|&&to| to != from && wanted(knob, to)) {
                let Some(knobs) = base.with(knob.name, to) else { continue };
                if knob.name == "upsampling" && knobs.colour.bands() == 0 {
                    continue;
                }
                // These knobs change specialization constants only, so that plans do not differ.
                let by_constants = ["fresnel", "brdf", "arithmetic", "upsampling", "lights", "absorption"];
                let same = |other: Plan| other.draws_as(&plan) && other.kept().eq(plan.kept());
                if !by_constants.contains(&knob.name) && bench.plan(&knobs).is_ok_and(same) {
                    continue;
                }
                all.push(changed(family, knob, from, to, knobs));
            }
        }
        Ok(all)
    }
}

fn changed(family: Family, knob: &Knob, from: &str, to: &str, knobs: Knobs) -> Task {
    let word = if family == Family::Local { "local" } else { "exact" };
    let change = Change { knob: knob.name.to_owned(), from: from.to_owned(), to: to.to_owned() };
    Task { name: format!("{word} {}={to}", knob.name), family, knobs, change: Some(change) }
}

/// Rungs to which `local` is changed; only some rungs of `samples` and `colour`.
fn of_local(knob: &Knob, rung: &str) -> bool {
    match knob.name {
        "samples" => matches!(rung, "1" | "16" | "64"),
        "colour" => rung == "spectral:16",
        "indirect" => rung != "path",
        _ => true,
    }
}

/// Rungs to which the reference's rungs are changed. Samples, light samples, the light sampler and path guiding change
/// noise, which the presets show. A denoised picture has other noise than its halves, by which these are compared.
fn of_exact(knob: &Knob, rung: &str) -> bool {
    match knob.name {
        "samples" | "colour" | "denoise" => false,
        "lights" => rung != "points",
        "brdf" => rung == "ggx",
        _ => true,
    }
}

impl Agenda {
    /// Makes the list. `reference`: knobs of the reference. The two times are GPU milliseconds of one sample of the
    /// reference and of one sample in RGB. `priced`: samples of the pictures in `of_exact`, if given. `budget_ms`: time
    /// budget of the run.
    ///
    /// # Errors
    /// When the scene has nothing to draw.
    pub fn new(
        bench: &Bench<'_>,
        states: &States,
        reference: &Knobs,
        [each_ms, plain_ms]: [f64; 2],
        priced: Option<u32>,
        budget_ms: f64,
    ) -> Result<Self> {
        let local = Knobs::of(Model::Local);
        let three_colours = set(reference, "colour", "rgb")?;
        let base = set(&three_colours, "samples", "4")?;
        let exact_changes = states.changes(bench, Family::Exact, &base, &of_exact)?;
        // Two interleaved renders of picture and base, for a third of the budget.
        let most = budget_ms / 3.0 / (4.0 * exact_changes.len().max(1) as f64);
        let priced = priced.unwrap_or_else(|| super::reference::samples_within(plain_ms, most).min(16));
        let priced_rung = priced.to_string();
        let plain = set(&three_colours, "samples", &priced_rung)?;
        let mut last = wavelengths(states, reference, &plain)?;
        // The reference has bands where the pilot found that they differ: what the fewest change comes before all else.
        let first = if reference.colour.bands() > 0 { 1.min(last.len()) } else { 0 };
        let mut of_exact: Vec<Task> = last.drain(..first).collect();
        of_exact.extend(without_paths(bench, states, &plain)?);
        for task in exact_changes {
            of_exact.push(Task { knobs: set(&task.knobs, "samples", &priced_rung)?, ..task });
        }
        of_exact.extend(last);
        Ok(Self {
            presets: presets(priced)?,
            of_local: states.changes(bench, Family::Local, &local, &self::of_local)?,
            of_exact,
            ladder: ladder(reference, priced, each_ms, budget_ms)?,
            orders: states.calls_for("quadrature"),
            local,
            plain,
        })
    }

    /// Samples of the pictures whose base is `exact`.
    #[must_use]
    pub fn priced(&self) -> u32 {
        self.plain.samples.count()
    }
}

/// These knobs with another rung of `indirect`, and without what only paths use.
#[must_use]
pub fn with_indirect(knobs: &Knobs, rung: &str) -> Option<Knobs> {
    Knobs { guiding: Guiding::Off, caustics: Caustics::Off, denoise: Denoise::Off, ..knobs.clone() }
        .with("indirect", rung)
}

/// The reference's rungs with the indirect light of the presets without path tracing. A rung whose plan equals that of
/// the rung before is skipped.
fn without_paths(bench: &Bench<'_>, states: &States, plain: &Knobs) -> Result<Vec<Task>> {
    let mut all: Vec<Task> = Vec::new();
    let Some(knob) = states.called_for().find(|knob| knob.name == "indirect") else { return Ok(all) };
    let mut before: Option<Plan> = None;
    for model in [Model::Recursive, Model::Local] {
        let to = knob.rung(&Knobs::of(model));
        let Some(knobs) = with_indirect(plain, to) else { continue };
        let plan = bench.plan(&knobs)?;
        if before.as_ref().is_none_or(|before| !(before.draws_as(&plan) && before.kept().eq(plan.kept()))) {
            all.push(changed(Family::Exact, knob, knob.rung(plain), to, knobs));
        }
        before = Some(plan);
    }
    Ok(all)
}

/// Spectral rendering compared with RGB, up to the number of bands of the reference.
fn wavelengths(states: &States, reference: &Knobs, plain: &Knobs) -> Result<Vec<Task>> {
    let rungs: &[&str] = match (states.calls_for("colour"), reference.colour.bands()) {
        (false, _) => &[],
        (true, 0) => &["spectral:16"],
        (true, bands) => &["spectral:8", "spectral:16", "spectral:32"][..(bands / 8).ilog2() as usize + 1],
    };
    let knob = Knob::named("colour").context("the knob colour")?;
    rungs.iter().map(|&to| Ok(changed(Family::Exact, knob, "rgb", to, set(plain, "colour", to)?))).collect()
}

fn presets(most: u32) -> Result<Vec<Task>> {
    let recursive = Knobs::of(Model::Recursive);
    let task = |name: String, knobs| Task { name, family: Family::Preset, knobs, change: None };
    let mut all = vec![task("recursive".to_owned(), recursive.clone())];
    for model in [Model::Recursive, Model::Global] {
        for samples in ["1", "4", "16"] {
            let knobs = set(&Knobs::of(model), "samples", samples)?;
            let name = if model == Model::Global { "global" } else { "recursive" };
            if (model == Model::Recursive || knobs.samples.count() <= most) && knobs != recursive {
                all.push(task(format!("{name} samples={samples}"), knobs));
            }
        }
    }
    Ok(all)
}

/// The reference's rungs with other numbers of samples; each takes less than a twentieth of the budget.
fn ladder(reference: &Knobs, priced: u32, each_ms: f64, budget_ms: f64) -> Result<Vec<Task>> {
    let affordable = |n: &u32| *n != priced && *n < reference.samples.count().max(priced + 1) * 4;
    let quick = |n: &u32| f64::from(*n) * each_ms < 0.05 * budget_ms;
    let rungs = [1, 16, 64, 256].into_iter().filter(|n| affordable(n) && quick(n));
    rungs
        .map(|n| {
            let knobs = set(reference, "samples", &n.to_string())?;
            Ok(Task { name: format!("exact samples={n}"), family: Family::Preset, knobs, change: None })
        })
        .collect()
}
