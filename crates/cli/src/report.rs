//! `render --report FILE`: the JSON report of a run, schema `etalon.report/1`, and the JSON form of a plan, schema
//! `etalon.plan/1`.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Value, json};

use super::exposure::ExposureFacts;
use etalon::frame::{NotFinite, Rendered, Work};
use etalon::gpu::{Compiled, Created, Device, DeviceInfo, Message, Program, Severity};
use etalon::image::Statistics;
use etalon::image::halves::{SampleError, slope};
use etalon::open::LitBy;
use etalon::plan::{Effect, Knobs, Plan};
use etalon::spectra;
use etalon::upload::rays::BvhFacts;
use etalon_cost::explain::Price;
use etalon_cost::predict::Prediction;

/// The document of `render --report`.
#[derive(Debug, Serialize)]
pub struct Report {
    /// `etalon.report/1`.
    pub schema: &'static str,
    /// Device that drew.
    pub device: DeviceInfo,
    /// Scene that was drawn.
    pub scene: SceneReport,
    /// What lights the scene.
    pub lit_by: LitBy,
    /// Exposure of the display outputs.
    pub(super) exposure: ExposureFacts,
    /// Rung of every knob.
    pub knobs: BTreeMap<&'static str, &'static str>,
    /// Effects, passes, pipelines and buffers, with reasons.
    pub plan: PlanFacts,
    /// GPU time per pass over the repeats.
    pub passes: Vec<PassFacts>,
    /// Wall time of each phase in milliseconds. `bvh` is a part of `upload`. `pipelines` runs on its own thread during
    /// `upload` and `frame`, in parallel with other work; the driver compiles a pipeline at its first use.
    pub phases_ms: BTreeMap<&'static str, f64>,
    /// Work counts, equal on every machine.
    pub work: WorkFacts,
    /// Samples, and the error that they estimate.
    pub sampling: Sampling,
    /// Colour of a spectral rendering; absent for RGB.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub colour: Option<ColourFacts>,
    /// BVH of the triangles; absent where the plan traces no rays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bvh: Option<BvhFacts>,
    /// Pipelines created.
    pub pipelines: PipelineFacts,
    /// Peak memory.
    pub memory: MemoryFacts,
    /// Statistics of the film.
    pub image: Statistics,
    /// Messages of the validation layer.
    pub validation: Validation,
    /// Files written, with hashes of their bytes.
    pub outputs: Vec<WrittenFile>,
    /// Rungs chosen for `--within` or `--max-error`, and how the budget was kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget: Option<Value>,
}

/// Conversion of wavelengths to colours in a spectral rendering.
#[derive(Debug, Serialize)]
pub struct ColourFacts {
    /// Colour-matching functions.
    pub observer: &'static str,
    /// Number of bands of equal width; each band is drawn separately.
    pub bands: u32,
    /// First and last wavelength of the bands, nm.
    pub wavelengths: [f64; 2],
    /// Whether a material disperses: samples then cycle through sub-bands of each band.
    pub disperses: bool,
    /// Pixels whose colour lies outside the Rec. 709 gamut.
    pub outside_gamut: u32,
    /// How displays show colours outside the gamut; an EXR stores them unchanged.
    pub outside_gamut_rule: &'static str,
}

impl ColourFacts {
    /// Colour facts of a picture; `None` for RGB.
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

/// Samples of a picture, and its estimated error, which only path tracing has.
#[derive(Debug, Serialize)]
pub struct Sampling {
    /// Samples per pixel.
    pub samples: u32,
    /// Estimated errors at powers of two and at the end.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<SampleError>,
    /// Slope of the logarithm of the relative error over the logarithm of the samples; −0.5 for independent samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slope: Option<f64>,
}

impl Sampling {
    /// Sampling facts of a picture.
    #[must_use]
    pub fn of(rendered: &Rendered) -> Self {
        Self { samples: rendered.samples, errors: rendered.errors.clone(), slope: slope(&rendered.errors) }
    }
}

/// Counts of the scene.
#[derive(Debug, Clone, Serialize)]
pub struct SceneReport {
    /// Path or `study:NAME`.
    pub path: String,
    /// Triangles as drawn: those of each instance count.
    pub triangles: usize,
    /// Mesh instances.
    pub instances: usize,
    /// Materials.
    pub materials: usize,
    /// Punctual lights.
    pub lights: usize,
    /// Decoded images.
    pub textures: usize,
    /// Warnings of the loader.
    pub warnings: Vec<String>,
}

/// The plan as data, with passes, pipelines and buffers on the device. The document of `plan --json`.
#[derive(Debug, Serialize)]
pub struct PlanFacts {
    /// `etalon.plan/1`.
    pub schema: &'static str,
    /// Every effect with its reason.
    pub effects: Vec<Effect>,
    /// Samples per pixel.
    pub samples: u32,
    /// Passes of a sample, in order.
    pub passes: Vec<String>,
    /// Pipelines.
    pub pipelines: Vec<PipelineFact>,
    /// Buffers and images on the device, by label, without staging buffers.
    pub buffers: Vec<Created>,
    /// Textures and texture coordinates of the scene that are neither decoded nor uploaded, with the reason.
    pub unread: Vec<String>,
    /// Expected work of a picture that is not drawn; absent in reports of drawn pictures, which have the counts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected: Option<Expected>,
    /// Measured costs of the effects that are left out; only with `--plan explain-cost`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub costs: Vec<Price>,
    /// Predicted time and error of each rung at this size; only with `--forecast`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub forecast: Vec<Prediction>,
    /// Warnings about what the chosen rungs leave out.
    pub warnings: Vec<String>,
}

/// Expected memory and rays of a picture from a camera.
#[derive(Debug, Serialize)]
pub struct Expected {
    /// Bytes of all buffers and images.
    pub bytes: u64,
    /// Dispatches of shadow rays per sample.
    pub shadow_rounds: u32,
    /// Least number of rays that a path traces in a row: counted along straight lines of sight, at most `interfaces`.
    pub ray_rounds: u32,
    /// Largest number of transparent surfaces on a line of sight.
    pub interfaces: u32,
    /// For each rung of `interfaces`, the largest fraction of a pixel's light that it loses on lines of sight.
    pub lost: BTreeMap<&'static str, f64>,
}

/// One pipeline.
#[derive(Debug, Serialize)]
pub struct PipelineFact {
    /// Name of the program.
    pub name: &'static str,
    /// Specialization constants by name; true is 1.
    pub constants: BTreeMap<&'static str, Value>,
    /// Bytes of the SPIR-V that the driver gets for these constants.
    pub spirv_bytes: usize,
    /// Compiler statistics of the driver, where it reports any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub compiled: Vec<Compiled>,
}

impl PlanFacts {
    /// The facts of a plan without a device.
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

    /// Adds passes and pipelines, and the buffers and images on the device.
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
                    // Missing compiler statistics must not fail the report.
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

/// Specialization constants by name, as floats or integers like in the shader.
fn named(program: &Program, constants: &[(u32, u32)]) -> BTreeMap<&'static str, Value> {
    let known = constants.iter().filter_map(|&(id, word)| Some((program.constants.iter().find(|c| c.id == id)?, word)));
    known.map(|(c, word)| (c.name, if c.float { json!(f32::from_bits(word)) } else { json!(word) })).collect()
}

/// Time of one pass.
#[derive(Debug, Serialize)]
pub struct PassFacts {
    /// Name of the pass.
    pub name: String,
    /// GPU milliseconds.
    pub gpu_ms: Spread,
}

/// Minimum, median and maximum of measured times.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Spread {
    /// Smallest.
    pub min: f64,
    /// Median.
    pub median: f64,
    /// Largest.
    pub max: f64,
    /// Number of measurements.
    pub n: usize,
}

impl Spread {
    /// The spread of at least one number.
    #[must_use]
    pub fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let n = values.len();
        let at = |i: usize| values.get(i).copied().unwrap_or_default();
        let median = (at((n.max(1) - 1) / 2) + at(n / 2)) * 0.5;
        Self { min: at(0), median, max: at(n.saturating_sub(1)), n }
    }
}

/// Work counts, equal on every machine.
#[derive(Debug, Serialize)]
pub struct WorkFacts {
    /// Rays by kind; primary visibility is rasterised.
    pub rays: BTreeMap<&'static str, u64>,
    /// BVH nodes visited.
    pub node_visits: u64,
    /// Triangles tested by rays.
    pub triangle_tests: u64,
    /// Rays that left a transparent mesh without having entered it: the mesh is open, or meshes overlap without
    /// priorities.
    pub unmatched_exits: u64,
    /// Path estimates that were NaN or infinite and were left out of the picture.
    pub not_finite: u64,
    /// Pixel, path vertex and material of the first such estimate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_not_finite: Option<NotFinite>,
    /// Fraction of a pixel's light that was cut off because a path met too many surfaces or its throughput became too
    /// small.
    pub cut_off: CutOff,
}

/// Path throughput that was cut off. The missing radiance of a pixel is at most this fraction of the largest radiance
/// in the scene.
#[derive(Debug, Serialize)]
pub struct CutOff {
    /// Mean over all pixels.
    pub mean: f64,
    /// Maximum over all pixels.
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
            unmatched_exits: work.unmatched_exits,
            not_finite: work.not_finite,
            first_not_finite: work.first_not_finite,
            cut_off: CutOff { mean: work.mean_lost, max: work.most_lost },
        }
    }
}

/// Pipelines created.
#[derive(Debug, Serialize)]
pub struct PipelineFacts {
    /// Number of pipelines.
    pub count: usize,
    /// Bytes of their SPIR-V.
    pub spirv_bytes: usize,
}

/// Memory of host and device.
#[derive(Debug, Serialize)]
pub struct MemoryFacts {
    /// Largest resident size of the process, in bytes; on a CPU device this includes device memory.
    pub host_peak_bytes: u64,
    /// Bytes of the memory blocks allocated on the device at the end.
    pub device_bytes: u64,
}

impl MemoryFacts {
    /// Memory at this moment.
    #[must_use]
    pub fn now(device: &Device) -> Self {
        // Linux keeps the high-water mark; on other systems it is unknown and 0.
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

/// Messages of the validation layer.
#[derive(Debug, Serialize)]
pub struct Validation {
    /// Whether validation was enabled.
    pub enabled: bool,
    /// Number of errors.
    pub errors: usize,
    /// Number of warnings.
    pub warnings: usize,
    /// All messages.
    pub messages: Vec<Message>,
}

impl Validation {
    /// The messages so far.
    #[must_use]
    pub fn of(device: &Device, enabled: bool) -> Self {
        let messages = device.messages();
        let count = |severity| messages.iter().filter(|m| m.severity == severity).count();
        Self { enabled, errors: count(Severity::Error), warnings: count(Severity::Warning), messages }
    }
}

/// A file that was written.
#[derive(Debug, Serialize)]
pub struct WrittenFile {
    /// Path of the file.
    pub path: String,
    /// XXH3-128 of the file's bytes.
    pub hash: String,
}

/// Rungs by knob.
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
