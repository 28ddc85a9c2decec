//! Evaluation of equations on the device, one row of inputs per case.

use etalon::optics::Tier;
use etalon_verify::{Cases, Entry};

use crate::gpu::Gpu;

/// Tiers with error bounds.
pub const PROMISING: [Tier; 2] = [Tier::Stable, Tier::Compensated];

/// An equation by name.
pub fn entry(name: &str) -> Entry {
    etalon_verify::find(name).expect("an equation")
}

/// The outputs of one equation for each row of inputs.
pub fn evaluate(gpu: &Gpu, name: &str, tier: Tier, rows: &[Vec<f32>]) -> Vec<Vec<f32>> {
    let entry = entry(name);
    let cases = Cases::from_rows(&entry, rows);
    let outputs = etalon_verify::evaluate(&gpu.device, entry.probe, tier, &cases.inputs, rows.len())
        .expect("an evaluation")
        .outputs;
    let width = entry.probe.outputs.len();
    (0..rows.len()).map(|row| (0..width).map(|column| outputs[column * rows.len() + row]).collect()).collect()
}

/// Output `output` of the equation for one row of inputs.
pub fn value(gpu: &Gpu, name: &str, tier: Tier, inputs: &[f32], output: &str) -> f64 {
    let column = column(name, output);
    f64::from(evaluate(gpu, name, tier, &[inputs.to_vec()])[0][column])
}

/// Index of an output column.
pub fn column(name: &str, output: &str) -> usize {
    entry(name).probe.outputs.iter().position(|known| *known == output).expect("an output")
}
