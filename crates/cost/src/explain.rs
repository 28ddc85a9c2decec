//! The price of effects that a plan leaves out: each is planned nevertheless, alone, and drawn in turns with the plan as it is.

use std::time::Instant;

use anyhow::Result;
use serde::Serialize;

use etalon::frame::{Renderer, Settings};
use etalon::gpu::{Device, DeviceChoice};
use etalon::plan::rungs::{Absorption, Colour, Guiding, Indirect, Lights, Reflection, Refraction, Shadows};
use etalon::plan::{Choice, Effect, EffectId, EffectState, ForcedEffects, Knob, Knobs, Model};
use etalon::prepare::Original;
use etalon::scene::Camera;
use etalon::scene::environment::Environment;

/// Pictures drawn of each plan, in turns.
const ROUNDS: usize = 7;

/// What an effect would have cost.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Price {
    /// Its name.
    pub effect: &'static str,
    /// `not needed`: the picture would be the same. `switched off`: it would be that of another rung.
    pub state: &'static str,
    /// How it was planned: `asked for`, or the rungs that allow it.
    pub by: String,
    /// Why it could not be drawn, if so: no figure says anything then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fails: Option<String>,
    /// Milliseconds more for the first picture, with everything made anew: caches of the driver may be warm.
    pub start_ms: f64,
    /// Milliseconds more for a sample of each pixel: the middle of the differences between pictures drawn in turns …
    pub frame_ms: f64,
    /// … and the smallest and the largest of them.
    pub frame_range_ms: [f64; 2],
    /// Share of the plan's own time for it.
    pub frame_share: f64,
    /// Pipelines more.
    pub pipelines: i64,
    /// SPIR-V more that the driver is given.
    pub spirv_bytes: i64,
    /// Buffers and images more, in bytes.
    pub bytes: i64,
}

/// What is drawn, and from where.
pub struct Subject<'a> {
    /// Where it is drawn: on a device of its own for each plan.
    pub device: &'a DeviceChoice,
    /// The scene.
    pub original: &'a Original,
    /// Light from all around.
    pub environment: Option<&'a Environment>,
    /// How; one sample of each pixel is measured.
    pub settings: Settings,
    /// From where.
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

/// A plan that has been drawn once.
struct DrawnPlan {
    renderer: Renderer,
    start_ms: f64,
    pipelines: i64,
    spirv_bytes: i64,
    bytes: i64,
}

impl Subject<'_> {
    /// Prices of all effects that this plan leaves out, in its order. `progress` hears of each.
    ///
    /// # Errors
    /// When something cannot be drawn.
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
                true => (ForcedEffects::One(effect.id), "asked for".to_owned()),
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

    /// Draws both in turns. `None`: nothing is planned otherwise, since the effect needs others that are left out too.
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

    /// Makes everything for a plan, on a device that has made nothing yet, and draws once.
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

/// The rungs that allow an effect which a knob has dropped: those of the recursive model, and those that paths need.
fn allowing(effect: EffectId, dropped_by: Choice) -> Vec<Choice> {
    let paths = [Shadows::Ray.choice(), Reflection::Ray.choice(), Refraction::Ray.choice(), Indirect::Path.choice()];
    let by_lights = [Lights::Area1.choice(), Guiding::Photons.choice()];
    match effect {
        EffectId::HeterogeneousMedia => vec![Refraction::Ray.choice(), Absorption::March32.choice()],
        EffectId::PathTracing => paths.into(),
        EffectId::SpectralRendering | EffectId::Dispersion => vec![Colour::Spectral16.choice()],
        EffectId::EmissiveLights | EffectId::AreaLights | EffectId::PathGuiding => [&paths[..], &by_lights].concat(),
        _ if dropped_by == Indirect::Path.choice() => {
            vec![Indirect::Ambient.choice(), Lights::Points.choice(), Guiding::Off.choice()]
        }
        _ => {
            let recursive = Knobs::of(Model::Recursive);
            let knob = Knob::named(dropped_by.knob);
            knob.map(|knob| Choice { rung: knob.rung(&recursive), ..dropped_by }).into_iter().collect()
        }
    }
}
