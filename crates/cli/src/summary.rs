//! The last line of `etalon render`: what was drawn, how long it took, how large its error is, and what lit it.

use std::time::Duration;

use etalon::frame::Rendered;
use etalon::plan::{EffectId, EffectState, Plan};
use etalon::scene::Scene;

use super::options::SceneOptions;

/// Lights that are named before the others are counted.
const NAMED: usize = 3;

/// What may light a picture of a scene: names alone, so that the scene's texels can be freed while they are uploaded.
pub(super) struct Sources {
    lights: Vec<String>,
    /// Whether some material emits.
    emits: bool,
    environment: String,
}

impl Sources {
    pub(super) fn of(scene: &Scene, options: &SceneOptions) -> Self {
        Self {
            lights: scene.lights.iter().map(|light| format!("\"{}\"", light.name)).collect(),
            emits: scene.materials.iter().any(|material| material.emissive != [0.0; 3]),
            environment: match options.env.as_deref() {
                Some(path) => format!("the environment {path}"),
                None => "the built-in studio".to_owned(),
            },
        }
    }

    /// What lights the picture of a plan: lights by name, surfaces that emit, the environment.
    pub(super) fn lit_by(self, plan: &Plan) -> String {
        let has = |id: EffectId| plan.effects.iter().any(|effect| effect.id == id && effect.state == EffectState::Kept);
        let mut sources = Vec::new();
        if has(EffectId::PunctualLights) || has(EffectId::AreaLights) {
            let kept = self.lights.into_iter().zip(&plan.lights).filter(|(_, is_kept)| **is_kept);
            let names: Vec<String> = kept.map(|(name, _)| name).collect();
            sources.extend(match &names[..] {
                [] => None,
                [one] => Some(format!("the light {one}")),
                all if all.len() <= NAMED => Some(format!("the lights {}", all.join(", "))),
                all => Some(format!("the lights {} and {} more", all[..NAMED].join(", "), all.len() - NAMED)),
            });
        }
        // Paths find emission wherever they end; other models only show it.
        if self.emits && has(EffectId::PathTracing) {
            sources.push("emissive surfaces".to_owned());
        }
        if has(EffectId::Environment) {
            sources.push(self.environment);
        }
        if sources.is_empty() { "lit by nothing".to_owned() } else { format!("lit by {}", sources.join(" and ")) }
    }
}

/// The sentence about a finished picture of `size` pixels.
pub(super) fn sentence([width, height]: [u32; 2], rendered: &Rendered, took: Duration, lit: &str) -> String {
    let samples = if rendered.samples == 1 { "1 sample".to_owned() } else { format!("{} samples", rendered.samples) };
    let error = rendered
        .errors
        .last()
        .map_or(String::new(), |error| format!(", estimated error {:.1} %", 100.0 * error.relmse.sqrt()));
    format!("{width}x{height}, {samples} per pixel, {:.1} s{error}, {lit}", took.as_secs_f64())
}
