//! The price of effects that a plan leaves out: each is planned nevertheless, alone, and drawn in turns with the plan as it is.

use std::time::Instant;

use anyhow::{Context as _, Result};
use serde::Serialize;

use crate::frame::{Renderer, Settings};
use crate::gpu::{Device, DeviceChoice};
use crate::plan::{Demand, Effect, Knobs, Model};
use crate::scene::environment::Environment;
use crate::scene::{Camera, Scene};

/// Pictures drawn of each plan, in turns.
const ROUNDS: usize = 7;

/// What an effect would have cost.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Price {
    /// Its name.
    pub effect: &'static str,
    /// `not called for`: the picture would be the same. `dropped`: it would be that of another rung.
    pub state: &'static str,
    /// How it was planned: `asked for`, or the rung that allows it.
    pub by: String,
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
    pub scene: &'a Scene,
    /// Light from all around.
    pub environment: Option<&'a Environment>,
    /// How; one sample of each pixel is measured.
    pub settings: Settings,
    /// From where.
    pub camera: &'a Camera,
}

/// A plan that draws.
struct Plan {
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
        let mut plain = self.plan(Demand::Scene, None)?;
        let mut prices = Vec::new();
        for effect in effects.iter().filter(|effect| effect.state != "kept") {
            progress(effect.name);
            let other_rung = (effect.state == "dropped").then(|| allowing(effect)).flatten();
            if effect.state == "dropped" && other_rung.is_none() {
                continue;
            }
            let by = other_rung.clone().unwrap_or_else(|| "asked for".to_owned());
            let demand = if other_rung.is_some() { Demand::Scene } else { Demand::With(effect.name) };
            let measuring = || format!("measuring what \"{}\" would cost", effect.name);
            let mut with = self.plan(demand, other_rung.as_deref()).with_context(measuring)?;
            let mut pairs = Vec::new();
            for _ in 0..ROUNDS {
                pairs.push((self.draw(&mut plain.renderer)?, self.draw(&mut with.renderer).with_context(measuring)?));
            }
            let mut differences: Vec<f64> = pairs.iter().map(|(plain, with)| with - plain).collect();
            let mut plain_ms: Vec<f64> = pairs.iter().map(|(plain, _)| *plain).collect();
            differences.sort_by(f64::total_cmp);
            plain_ms.sort_by(f64::total_cmp);
            let frame_ms = differences[ROUNDS / 2];
            prices.push(Price {
                effect: effect.name,
                state: effect.state,
                by,
                start_ms: with.start_ms - plain.start_ms,
                frame_ms,
                frame_range_ms: [differences[0], differences[ROUNDS - 1]],
                frame_share: frame_ms / plain_ms[ROUNDS / 2],
                pipelines: with.pipelines - plain.pipelines,
                spirv_bytes: with.spirv_bytes - plain.spirv_bytes,
                bytes: with.bytes - plain.bytes,
            });
        }
        Ok(prices)
    }

    /// Makes everything for a plan, on a device that has made nothing yet, and draws once.
    fn plan(&self, demand: Demand, rung: Option<&str>) -> Result<Plan> {
        let device = Device::open(self.device, false)?;
        let mut settings = Settings { demand, ..self.settings.clone() };
        settings.knobs.set("samples=1")?;
        rung.map_or(Ok(()), |rung| settings.knobs.set(rung))?;
        let start = Instant::now();
        let mut renderer = Renderer::new(&device, self.scene.clone(), self.environment, settings)?;
        self.draw(&mut renderer)?;
        let start_ms = start.elapsed().as_secs_f64() * 1e3;
        let pipelines = device.pipelines();
        let spirv: usize = pipelines.iter().map(|(program, constants)| program.spirv_bytes(constants)).sum();
        let bytes: u64 = device.created().iter().filter(|made| made.name != "staging").map(|made| made.bytes).sum();
        Ok(Plan {
            renderer,
            start_ms,
            pipelines: pipelines.len() as i64,
            spirv_bytes: spirv as i64,
            bytes: bytes as i64,
        })
    }

    fn draw(&self, renderer: &mut Renderer) -> Result<f64> {
        let start = Instant::now();
        renderer.render(self.camera, &mut |_, _| ())?;
        Ok(start.elapsed().as_secs_f64() * 1e3)
    }
}

/// The rung of the recursive model that allows an effect which a knob has dropped.
fn allowing(effect: &Effect) -> Option<String> {
    let (knob, _) = effect.reason.split_once('=')?;
    let known = Knobs::of(Model::Recursive).list().into_iter().find(|(name, _)| *name == knob)?;
    (known.1 != effect.rung).then(|| format!("{knob}={}", known.1))
}
