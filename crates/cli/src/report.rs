//! `render --report FILE`: the machine-readable account of a run, schema `etalon.report/1`.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Value, json};

use etalon::frame::{NotFinite, Rendered, Work};
use etalon::gpu::{Compiled, Created, Device, DeviceInfo, Message, Program, Severity};
use etalon::image::Statistics;
use etalon::image::halves::{SampleError, slope};
use etalon::plan::{Effect, Knobs, Plan};
use etalon::spectra;
use etalon::upload::rays::BvhFacts;
use etalon_cost::explain::Price;
use etalon_cost::predict::Prediction;

/// The document.
#[derive(Debug, Serialize)]
pub struct Report {
    /// `etalon.report/1`.
    pub schema: &'static str,
    /// Where it ran.
    pub device: DeviceInfo,
    /// What was drawn.
    pub scene: SceneFacts,
    /// Rung of every knob.
    pub knobs: BTreeMap<&'static str, &'static str>,
    /// What was done and why.
    pub plan: PlanFacts,
    /// GPU time per pass over the repeats.
    pub passes: Vec<PassFacts>,
    /// Wall time of each phase in milliseconds. `bvh` is a part of `upload`; `pipelines` of `upload` and `frame`, beside
    /// what else goes on there: they are made on a thread of their own, and the driver compiles them at their first use.
    pub phases_ms: BTreeMap<&'static str, f64>,
    /// Work counts: the same on every machine.
    pub work: WorkFacts,
    /// Samples, and what they say of the picture's error.
    pub sampling: Sampling,
    /// Of a picture by wavelengths.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub colour: Option<ColourFacts>,
    /// What rays went through; absent where none were sent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bvh: Option<BvhFacts>,
    /// Pipelines made.
    pub pipelines: PipelineFacts,
    /// Peak memory.
    pub memory: MemoryFacts,
    /// Statistics of the film.
    pub image: Statistics,
    /// What the validation layer said.
    pub validation: Validation,
    /// Files written, with hashes of their bytes.
    pub outputs: Vec<Output>,
    /// Rungs chosen for `--within` or `--max-error`, and how the budget was kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget: Option<Value>,
}

/// How wavelengths became colours.
#[derive(Debug, Serialize)]
pub struct ColourFacts {
    /// Whose matching functions.
    pub observer: &'static str,
    /// Of equal width, each drawn for itself.
    pub bands: u32,
    /// What they divide, nm.
    pub wavelengths: [f64; 2],
    /// Samples go through parts of each band, because wavelengths go different ways.
    pub disperses: bool,
    /// Pixels whose colour lies outside of Rec. 709.
    pub outside_gamut: u32,
    /// What becomes of them on a display; an EXR has them as they are.
    pub outside_gamut_rule: &'static str,
}

impl ColourFacts {
    /// Of a picture; `None` where it is made of three colours.
    #[must_use]
    pub fn of(plan: &Plan, rendered: &Rendered) -> Option<Self> {
        (plan.bands > 0).then_some(Self {
            observer: spectra::OBSERVER,
            bands: plan.bands,
            wavelengths: [spectra::VISIBLE.from, spectra::VISIBLE.to],
            disperses: plan.disperses,
            outside_gamut: rendered.counts.negative,
            outside_gamut_rule: "desaturated at constant luminance",
        })
    }
}

/// Samples, and what they say of the picture's error where it is estimated: of pictures by paths.
#[derive(Debug, Serialize)]
pub struct Sampling {
    /// Of each pixel.
    pub samples: u32,
    /// At powers of two and at the end.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<SampleError>,
    /// Slope of the logarithm of the relative error over that of samples; −0.5 where samples do not depend on each other.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slope: Option<f64>,
}

impl Sampling {
    /// Of a picture.
    #[must_use]
    pub fn of(rendered: &Rendered) -> Self {
        Self { samples: rendered.samples, errors: rendered.errors.clone(), slope: slope(&rendered.errors) }
    }
}

/// What was drawn.
#[derive(Debug, Clone, Serialize)]
pub struct SceneFacts {
    /// Path or `study:NAME`.
    pub path: String,
    /// As drawn: instances counted.
    pub triangles: usize,
    /// Placed meshes.
    pub instances: usize,
    /// Materials.
    pub materials: usize,
    /// Punctual lights.
    pub lights: usize,
    /// Decoded images.
    pub textures: usize,
    /// What was read around.
    pub warnings: Vec<String>,
}

/// The plan as data, with what came of it on the device.
#[derive(Debug, Serialize)]
pub struct PlanFacts {
    /// `etalon.plan/1`.
    pub schema: &'static str,
    /// Every effect with its reason.
    pub effects: Vec<Effect>,
    /// Samples per pixel.
    pub samples: u32,
    /// Passes of a frame in order.
    pub passes: Vec<String>,
    /// Pipelines.
    pub pipelines: Vec<PipelineFact>,
    /// Buffers and images that outlive a frame or feed one, by label.
    pub buffers: Vec<Created>,
    /// Textures and texture coordinates of the scene that are neither decoded nor uploaded, with the reason.
    pub unread: Vec<String>,
    /// What can be told of a picture that is not drawn; of one that is, there are the counts themselves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected: Option<Expected>,
    /// What the effects that are left out would have cost, where that was asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub costs: Vec<Price>,
    /// What every rung will take at this size, and how wrong it will be, where that was asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub forecast: Vec<Prediction>,
    /// What the chosen rungs leave out.
    pub warnings: Vec<String>,
}

/// What a picture from a camera will take.
#[derive(Debug, Serialize)]
pub struct Expected {
    /// Bytes of all buffers and images.
    pub bytes: u64,
    /// Dispatches that send rays to lights, in each sample.
    pub shadow_rounds: u32,
    /// Rays that a path sends one after another, at least: along straight lines, and no more than `interfaces` allows.
    pub ray_rounds: u32,
    /// The most transparent surfaces on a line of sight.
    pub interfaces: u32,
    /// By rungs of `interfaces`, the largest share of a pixel's light that they lose on those lines.
    pub lost: BTreeMap<&'static str, f64>,
}

/// One pipeline.
#[derive(Debug, Serialize)]
pub struct PipelineFact {
    /// Its program.
    pub name: &'static str,
    /// Specialization constants; what is true is 1.
    pub constants: BTreeMap<&'static str, Value>,
    /// SPIR-V that the driver is given for these constants.
    pub spirv_bytes: usize,
    /// What the driver's compiler made of it, where it tells.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub compiled: Vec<Compiled>,
}

impl PlanFacts {
    /// What was planned.
    #[must_use]
    pub fn of(plan: &Plan) -> Self {
        Self {
            schema: "etalon.plan/1",
            effects: plan.effects.clone(),
            samples: plan.samples,
            passes: Vec::new(),
            pipelines: Vec::new(),
            buffers: Vec::new(),
            unread: plan.unread.clone(),
            expected: None,
            costs: Vec::new(),
            forecast: Vec::new(),
            warnings: plan.warnings.clone(),
        }
    }

    /// With the passes and the pipelines that it takes, and what exists on the device for it.
    #[must_use]
    pub fn on(
        self,
        device: &Device,
        passes: Vec<String>,
        mut pipelines: Vec<(&'static Program, Vec<(u32, u32)>)>,
    ) -> Self {
        pipelines.sort_by(|a, b| (a.0.name, &a.1).cmp(&(b.0.name, &b.1)));
        pipelines.dedup();
        Self {
            passes,
            pipelines: pipelines
                .into_iter()
                .map(|(program, constants)| PipelineFact {
                    name: program.name,
                    spirv_bytes: program.spirv_bytes(&constants),
                    // What it does not tell is no reason to lose a report.
                    compiled: device.compiled(program, &constants).unwrap_or_default(),
                    constants: named(program, &constants),
                })
                .collect(),
            buffers: device
                .created()
                .into_iter()
                .filter(|made| matches!(made.kind, "buffer" | "image") && made.name != "staging")
                .collect(),
            ..self
        }
    }
}

/// Constants by name: numbers as the shader has them.
fn named(program: &Program, constants: &[(u32, u32)]) -> BTreeMap<&'static str, Value> {
    let known = constants.iter().filter_map(|&(id, word)| Some((program.constants.iter().find(|c| c.id == id)?, word)));
    known.map(|(c, word)| (c.name, if c.float { json!(f32::from_bits(word)) } else { json!(word) })).collect()
}

/// One pass.
#[derive(Debug, Serialize)]
pub struct PassFacts {
    /// Its name.
    pub name: String,
    /// Milliseconds on the device.
    pub gpu_ms: Spread,
}

/// A sample of times.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Spread {
    /// Smallest.
    pub min: f64,
    /// Middle.
    pub median: f64,
    /// Largest.
    pub max: f64,
    /// How many.
    pub n: usize,
}

impl Spread {
    /// Of some numbers, at least one.
    #[must_use]
    pub fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let n = values.len();
        let at = |i: usize| values.get(i).copied().unwrap_or_default();
        let median = (at((n.max(1) - 1) / 2) + at(n / 2)) * 0.5;
        Self { min: at(0), median, max: at(n.saturating_sub(1)), n }
    }
}

/// Exact counts.
#[derive(Debug, Serialize)]
pub struct WorkFacts {
    /// Rays by kind; primary visibility is rasterised.
    pub rays: BTreeMap<&'static str, u64>,
    /// BVH nodes visited.
    pub node_visits: u64,
    /// Triangles tested by rays.
    pub triangle_tests: u64,
    /// Boundaries of transparent bodies that were left without having been entered: open or crossing shells.
    pub stray_interfaces: u64,
    /// Estimates of paths that were no finite numbers and left out of the picture, and where the first was met.
    pub not_finite: u64,
    /// See `not_finite`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_not_finite: Option<NotFinite>,
    /// Share of a pixel's light that was not followed because a path met too many surfaces or had become too faint.
    pub cut_off: CutOff,
}

/// Throughput that was not followed. What it would have found is at most as bright as the brightest thing in the scene,
/// so that no pixel misses more than this share of that.
#[derive(Debug, Serialize)]
pub struct CutOff {
    /// Over all pixels.
    pub mean: f64,
    /// Of the worst pixel.
    pub max: f32,
}

impl From<&Work> for WorkFacts {
    fn from(work: &Work) -> Self {
        let rays = [
            ("primary", 0),
            ("reflection", work.reflection),
            ("refraction", work.refraction),
            ("shadow", work.shadow),
            ("indirect", work.indirect),
        ];
        Self {
            rays: rays.into_iter().collect(),
            node_visits: work.node_visits,
            triangle_tests: work.triangle_tests,
            stray_interfaces: work.stray_interfaces,
            not_finite: work.not_finite,
            first_not_finite: work.first_not_finite,
            cut_off: CutOff { mean: work.mean_lost, max: work.most_lost },
        }
    }
}

/// Pipelines made.
#[derive(Debug, Serialize)]
pub struct PipelineFacts {
    /// How many.
    pub count: usize,
    /// SPIR-V that the driver was given for them.
    pub spirv_bytes: usize,
}

/// Memory.
#[derive(Debug, Serialize)]
pub struct MemoryFacts {
    /// Largest resident size of the process; on a CPU device this includes the device's memory.
    pub host_peak_bytes: u64,
    /// Blocks allocated on the device at the end.
    pub device_bytes: u64,
}

impl MemoryFacts {
    /// As things stand.
    #[must_use]
    pub fn now(device: &Device) -> Self {
        // Linux keeps the high-water mark; elsewhere it is not known.
        let peak = std::fs::read_to_string("/proc/self/status")
            .ok()
            .and_then(|status| {
                let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
                line.split_whitespace().nth(1)?.parse::<u64>().ok()
            })
            .unwrap_or_default();
        Self { host_peak_bytes: peak * 1024, device_bytes: device.memory_bytes() }
    }
}

/// Validation.
#[derive(Debug, Serialize)]
pub struct Validation {
    /// Whether the layer was on.
    pub enabled: bool,
    /// Errors.
    pub errors: usize,
    /// Warnings.
    pub warnings: usize,
    /// All of them.
    pub messages: Vec<Message>,
}

impl Validation {
    /// What the layer has said so far.
    #[must_use]
    pub fn of(device: &Device, enabled: bool) -> Self {
        let messages = device.messages();
        let count = |severity| messages.iter().filter(|m| m.severity == severity).count();
        Self { enabled, errors: count(Severity::Error), warnings: count(Severity::Warning), messages }
    }
}

/// A file that was written.
#[derive(Debug, Serialize)]
pub struct Output {
    /// Where.
    pub path: String,
    /// XXH3-128 of its bytes.
    pub hash: String,
}

/// Knobs as the report lists them.
#[must_use]
pub fn knob_map(knobs: &Knobs) -> BTreeMap<&'static str, &'static str> {
    knobs.list().into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_has_the_middle_in_the_middle() {
        let spread = Spread::of(vec![3.0, 1.0, 2.0, 10.0]);
        assert_eq!((spread.min, spread.median, spread.max, spread.n), (1.0, 2.5, 10.0, 4));
        assert_eq!(Spread::of(vec![7.0]).median, 7.0);
    }
}
