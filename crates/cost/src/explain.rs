//! Measures the cost of effects that a plan leaves out (`--plan explain-cost`). Each effect is enabled alone, and the
//! pictures with and without it are timed interleaved (paired measurement). See docs/plan.md.

use std::time::Instant;

use anyhow::Result;
use serde::Serialize;

use etalon::frame::{Renderer, Settings};
use etalon::gpu::{Device, DeviceChoice};
use etalon::plan::rungs::{
    Absorption, Caustics, Colour, Denoise, Guiding, Indirect, LightSampler, Lights, Reflection, Refraction, Shadows,
};
use etalon::plan::{Choice, Effect, EffectId, EffectState, ForcedEffects, Knob, Knobs, Model};
use etalon::prepare::Original;
use etalon::scene::Camera;
use etalon::scene::environment::Environment;

/// Number of timed pictures of each plan.
const ROUNDS: usize = 7;

/// Cost of an effect relative to the plan without it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Price {
    /// Name of the effect.
    pub effect: &'static str,
    /// `not needed`: the picture with the effect is the same. `switched off`: it is that of another rung.
    pub state: &'static str,
    /// How the effect was enabled: `forced on`, or the rungs that allow it.
    pub by: String,
    /// Error if the plan with the effect cannot be drawn; all figures are then 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fails: Option<String>,
    /// Additional milliseconds for the first picture, with all objects created anew; the driver's cache may be warm.
    pub start_ms: f64,
    /// Additional milliseconds for one sample of every pixel: median of the paired differences.
    pub frame_ms: f64,
    /// Smallest and largest paired difference in milliseconds.
    pub frame_range_ms: [f64; 2],
    /// `frame_ms` as a fraction of the time without the effect.
    pub frame_share: f64,
    /// Additional pipelines.
    pub pipelines: i64,
    /// Additional bytes of SPIR-V for the driver.
    pub spirv_bytes: i64,
    /// Additional bytes of buffers and images.
    pub bytes: i64,
}

/// Scene, camera and settings of the measurement.
pub struct Subject<'a> {
    /// Choice of the device; each plan opens its own Vulkan device.
    pub device: &'a DeviceChoice,
    /// The scene.
    pub original: &'a Original,
    /// Environment map.
    pub environment: Option<&'a Environment>,
    /// Settings of the renderer; one sample per pixel is measured.
    pub settings: Settings,
    /// The camera.
    pub camera: &'a Camera,
}

impl Price {
    fn nothing(effect: &Effect) -> Self {
        Self {
            effect: effect.id.name(),
            state: effect.state.name(),
            by: String::new(),
            fails: None,
            start_ms: 0.0,
            frame_ms: 0.0,
            frame_range_ms: [0.0; 2],
            frame_share: 0.0,
            pipelines: 0,
            spirv_bytes: 0,
            bytes: 0,
        }
    }
}

/// Renderer of a plan that has been drawn once, with its start-up costs.
struct DrawnPlan {
    renderer: Renderer,
    start_ms: f64,
    pipelines: i64,
    spirv_bytes: i64,
    bytes: i64,
}

impl Subject<'_> {
    /// Measures all effects of `effects` that the plan leaves out, in order. `progress` is called with the name of
    /// each.
    ///
    /// # Errors
    /// When the plan without them cannot be drawn.
    pub fn prices(&self, effects: &[Effect], progress: &mut dyn FnMut(&str)) -> Result<Vec<Price>> {
        let mut plain = self.plan(ForcedEffects::None, &[])?;
        let mut prices = Vec::new();
        for effect in effects.iter().filter(|effect| effect.state != EffectState::Kept) {
            progress(effect.id.name());
            let rungs: Vec<String> = match effect.state {
                EffectState::DroppedBy(choice) => allowing(effect.id, choice).iter().map(Choice::to_string).collect(),
                _ => Vec::new(),
            };
            let (forced, by) = match rungs.is_empty() {
                true => (ForcedEffects::One(effect.id), "forced on".to_owned()),
                false => (ForcedEffects::None, rungs.join(", ")),
            };
            let price = match self.plan(forced, &rungs).and_then(|mut with| self.price(effect, &mut plain, &mut with)) {
                Ok(price) => price.map(|price| Price { by, ..price }),
                Err(error) => Some(Price { by, fails: Some(format!("{error:#}")), ..Price::nothing(effect) }),
            };
            prices.extend(price);
        }
        Ok(prices)
    }

    /// Times both plans interleaved. `None` where both plans draw the same, because the effect needs other effects that
    /// are left out.
    fn price(&self, effect: &Effect, plain: &mut DrawnPlan, with: &mut DrawnPlan) -> Result<Option<Price>> {
        if plain.renderer.plan().draws_as(with.renderer.plan()) {
            return Ok(None);
        }
        let (mut plain_ms, mut differences) = (Vec::new(), Vec::new());
        for round in 0..ROUNDS {
            let first = if round % 2 == 1 { Some(self.draw(&mut with.renderer)?) } else { None };
            let ms = self.draw(&mut plain.renderer)?;
            let with_ms = first.map_or_else(|| self.draw(&mut with.renderer), Ok)?;
            plain_ms.push(ms);
            differences.push(with_ms - ms);
        }
        differences.sort_by(f64::total_cmp);
        plain_ms.sort_by(f64::total_cmp);
        let frame_ms = differences[ROUNDS / 2];
        Ok(Some(Price {
            start_ms: with.start_ms - plain.start_ms,
            frame_ms,
            frame_range_ms: [differences[0], differences[ROUNDS - 1]],
            frame_share: frame_ms / plain_ms[ROUNDS / 2],
            pipelines: with.pipelines - plain.pipelines,
            spirv_bytes: with.spirv_bytes - plain.spirv_bytes,
            bytes: with.bytes - plain.bytes,
            ..Price::nothing(effect)
        }))
    }

    /// Creates all objects for a plan on a new device, and draws once.
    fn plan(&self, forced: ForcedEffects, rungs: &[String]) -> Result<DrawnPlan> {
        let device = Device::open(self.device, false)?;
        let mut settings = Settings { forced, ..self.settings.clone() };
        settings.max_error = None;
        settings.knobs.set("samples=1")?;
        settings.knobs.set_all(rungs)?;
        let start = Instant::now();
        let mut renderer = Renderer::new(&device, self.original, self.environment, settings)?;
        self.draw(&mut renderer)?;
        let start_ms = start.elapsed().as_secs_f64() * 1e3;
        let pipelines = device.pipelines();
        let spirv: usize = pipelines.iter().map(|(program, constants)| program.spirv_bytes(constants)).sum();
        let bytes: u64 = device.created().iter().filter(|made| made.name != "staging").map(|made| made.bytes).sum();
        Ok(DrawnPlan {
            renderer,
            start_ms,
            pipelines: pipelines.len() as i64,
            spirv_bytes: spirv as i64,
            bytes: bytes as i64,
        })
    }

    fn draw(&self, renderer: &mut Renderer) -> Result<f64> {
        let start = Instant::now();
        renderer.render(self.camera, &mut |_| ())?;
        Ok(start.elapsed().as_secs_f64() * 1e3)
    }
}

/// The rungs that enable an effect that a knob has switched off: those of the recursive model, or those that path
/// tracing needs.
fn allowing(effect: EffectId, dropped_by: Choice) -> Vec<Choice> {
    let paths = [Shadows::Ray.choice(), Reflection::Ray.choice(), Refraction::Ray.choice(), Indirect::Path.choice()];
    match effect {
        EffectId::HeterogeneousMedia => vec![Refraction::Ray.choice(), Absorption::March8.choice()],
        EffectId::PathTracing => paths.into(),
        EffectId::SpectralRendering | EffectId::Dispersion => vec![Colour::Spectral16.choice()],
        EffectId::EmissiveLights | EffectId::AreaLights | EffectId::LightHierarchy => {
            vec![Lights::Area4.choice(), LightSampler::Resampled4.choice()]
        }
        EffectId::PathGuiding => [&paths[..], &[Lights::Area1.choice(), Guiding::Photons.choice()]].concat(),
        EffectId::Caustics => [&paths[..], &[Caustics::Photons16384.choice()]].concat(),
        _ if dropped_by == Indirect::Path.choice() => {
            vec![Indirect::Ambient.choice(), Guiding::Off.choice(), Caustics::Off.choice(), Denoise::Off.choice()]
        }
        _ => {
            let recursive = Knobs::of(Model::Recursive);
            let knob = Knob::named(dropped_by.knob);
            knob.map(|knob| Choice { rung: knob.rung(&recursive), ..dropped_by }).into_iter().collect()
        }
    }
}
