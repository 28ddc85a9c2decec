//! Etalon's equations on a device against their f64 twins, as `etalon verify` compares them.

use std::sync::Arc;

use anyhow::Result;
use etalon::gpu::Device;
use etalon::optics::Tier;
use etalon_verify::{Cases, catalogue, evaluate, flushes_denormals, judge};
use serde::{Deserialize, Serialize};

use crate::json::short;

/// Errors of one function in one tier, over all its outputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EquationErrors {
    /// Name of the function.
    pub function: String,
    /// `stable` or `compensated`; the tier `fast` has no bounds.
    pub tier: String,
    /// Whether every case keeps its bound.
    pub held: bool,
    /// Largest ratio of error to bound.
    pub of_bound: f64,
    /// Largest error in units in the last place.
    pub max_ulp: f64,
    /// Nanoseconds of an evaluation.
    pub ns: f64,
}

/// Evaluates every equation for so many cases, on a device that flushes denormal numbers without those below
/// [`etalon_verify::TINY`]; `progress` is called with the name of each function.
///
/// # Errors
/// When the device fails.
pub fn measure(device: &Arc<Device>, cases: usize, progress: &mut dyn FnMut(&str)) -> Result<Vec<EquationErrors>> {
    let mut all = Vec::new();
    let flushes = flushes_denormals(device)?;
    for entry in catalogue() {
        progress(entry.probe.name);
        let mut drawn = Cases::draw(&entry, cases, 1);
        if flushes {
            drawn.expect_nothing_of_tiny();
        }
        for tier in [Tier::Stable, Tier::Compensated] {
            let evaluated = evaluate(device, entry.probe, tier, &drawn.inputs, drawn.count)?;
            let figures = judge(&entry, tier, &drawn, &evaluated.outputs);
            let ratios = figures.iter().filter_map(|figures| Some(figures.worst.as_ref()?.excess));
            all.push(EquationErrors {
                function: entry.probe.name.to_owned(),
                tier: tier.name().to_owned(),
                held: figures.iter().all(|figures| figures.pass),
                of_bound: short(ratios.fold(0.0, f64::max).min(1e300)),
                max_ulp: short(figures.iter().map(|figures| figures.max_ulp).fold(0.0, f64::max).min(1e300)),
                ns: short(evaluated.ms * 1e6 / drawn.count as f64),
            });
        }
    }
    Ok(all)
}
