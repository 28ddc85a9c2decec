//! Pictures taken for a measurement: warm, in turns with another, with everything that is to be known of them.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;

use super::difference::{Shown, shown};
use super::statistics::Interval;
use etalon::frame::{Rendered, Renderer, Settings, Work};
use etalon::gpu::{Compiled, Device, Program};
use etalon::image::Picture;
use etalon::image::png::Display;
use etalon::plan::{Knobs, Plan};
use etalon::prepare::Original;
use etalon::scene::Camera;
use etalon::scene::environment::Environment;

/// Pictures of one plan are timed until there are so many …
const MOST: usize = 7;
/// … or they took so many milliseconds; two at least …
pub const ENOUGH_MS: f64 = 1000.0;
/// … unless one takes so long.
const LONG_MS: f64 = 6000.0;

/// How many pictures that take so long are timed.
pub(super) fn turns(ms: f64, enough_ms: f64) -> usize {
    match ms {
        ms if ms >= LONG_MS => 1,
        ms => ((enough_ms / ms.max(1e-3)).ceil() as usize).clamp(2, MOST),
    }
}

/// The same for a run of so many seconds: a short one draws more pictures instead.
pub(super) fn enough_ms(budget_s: f64) -> f64 {
    (ENOUGH_MS * budget_s / 480.0).clamp(0.15 * ENOUGH_MS, ENOUGH_MS)
}

/// What is drawn, from where, on what.
pub struct Bench<'a> {
    /// The device.
    pub device: &'a Arc<Device>,
    /// The scene.
    pub original: &'a Original,
    /// Light from all around.
    pub environment: Option<&'a Environment>,
    /// All but the knobs.
    pub settings: Settings,
    /// From where.
    pub camera: &'a Camera,
}

/// Rungs that are ready to be drawn: uploaded, and with every shader compiled.
pub struct WarmRenderer {
    /// What draws them.
    pub renderer: Renderer,
    /// Wall time until the first samples were there.
    pub start_ms: f64,
}

/// A picture.
pub struct Measurement {
    /// Radiance.
    pub film: Picture,
    /// Both halves of its samples as they would be shown, of pictures by paths.
    pub halves: Option<[Shown; 2]>,
    /// Relative mean squared error by chance, which those tell.
    pub noise: Option<f64>,
    /// As it is shown.
    pub display: Display,
    /// And as a file.
    pub png: Vec<u8>,
    /// GPU milliseconds of each that was timed.
    pub ms: Vec<f64>,
    /// Of the others that were drawn in turns with them.
    pub baseline_ms: Vec<f64>,
    /// GPU milliseconds of each pass.
    pub passes: Vec<(String, f64)>,
    /// Counts.
    pub work: BTreeMap<String, u64>,
    /// What the driver's compiler made of each program, where it tells.
    pub compiled: BTreeMap<String, Vec<Compiled>>,
    /// Samples of each pixel.
    pub samples: u32,
}

impl Measurement {
    /// Whether its radiance is this to the last bit.
    #[must_use]
    pub fn is(&self, film: &Picture) -> bool {
        bytemuck::cast_slice::<_, u8>(&self.film.rgba) == bytemuck::cast_slice::<_, u8>(&film.rgba)
    }
}

pub(super) fn total(rendered: &Rendered) -> f64 {
    rendered.passes.iter().map(|pass| pass.ms).sum()
}

fn counts(work: &Work) -> BTreeMap<String, u64> {
    let all = [
        ("reflection_rays", work.reflection),
        ("refraction_rays", work.refraction),
        ("shadow_rays", work.shadow),
        ("indirect_rays", work.indirect),
        ("node_visits", work.node_visits),
        ("triangle_tests", work.triangle_tests),
    ];
    all.into_iter().map(|(name, count)| (name.to_owned(), count)).collect()
}

impl Bench<'_> {
    /// What these rungs call for; nothing is uploaded for that.
    ///
    /// # Errors
    /// When the scene has nothing to draw.
    pub fn plan(&self, knobs: &Knobs) -> Result<Plan> {
        let settings = Settings { knobs: knobs.clone(), ..self.settings.clone() };
        self.original.plan(&settings.conditions(self.environment)?)
    }

    /// Draws two samples, which compiles everything.
    ///
    /// # Errors
    /// When these rungs cannot be drawn.
    pub fn warm_up(&self, knobs: &Knobs) -> Result<WarmRenderer> {
        let start = Instant::now();
        let mut renderer = self.renderer(knobs, self.settings.seed)?;
        renderer.render_samples(self.camera, 2, &mut |_| ())?;
        Ok(WarmRenderer { renderer, start_ms: start.elapsed().as_secs_f64() * 1e3 })
    }

    /// What draws these rungs with these random numbers; nothing is drawn yet.
    ///
    /// # Errors
    /// When these rungs cannot be drawn.
    pub fn renderer(&self, knobs: &Knobs, seed: u32) -> Result<Renderer> {
        let settings = Settings { knobs: knobs.clone(), seed, max_error: None, ..self.settings.clone() };
        Renderer::new(self.device, self.original, self.environment, settings)
    }

    fn compiled(&self, warm: &mut WarmRenderer) -> Result<BTreeMap<String, Vec<Compiled>>> {
        if !self.device.tells_compiled() {
            return Ok(BTreeMap::new());
        }
        let passes = warm.renderer.passes(self.camera)?;
        let one = |(program, constants): &(&'static Program, Vec<(u32, u32)>)| {
            Ok((program.name.to_owned(), self.device.compiled(program, constants)?))
        };
        passes.iter().flat_map(|pass| &pass.pipelines).map(one).collect()
    }

    /// GPU time of one picture.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn time(&self, warm: &mut WarmRenderer) -> Result<f64> {
        Ok(total(&warm.renderer.render(self.camera, &mut |_| ())?))
    }

    /// Draws and times, in turns with `other` where there is one, until pictures took so many milliseconds.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn measure(
        &self,
        warm: &mut WarmRenderer,
        mut other: Option<(&mut WarmRenderer, &Measurement)>,
        enough_ms: f64,
    ) -> Result<Measurement> {
        let rendered = warm.renderer.render(self.camera, &mut |_| ())?;
        let film = warm.renderer.film_alone()?;
        let halves = warm.renderer.half_means_alone()?;
        let [width, height] = self.settings.size;
        let view = self.settings.view_transform();
        let same = other.as_ref().is_some_and(|(_, known)| known.is(&film));
        let mut ms = vec![total(&rendered)];
        let mut baseline_ms = Vec::new();
        let mut passes: Vec<(String, Vec<f64>)> =
            rendered.passes.iter().map(|p| (p.name.clone(), vec![p.ms])).collect();
        if let Some((other, _)) = &mut other {
            baseline_ms.push(self.time(other)?);
        }
        // What cannot be told from its base has no more to say.
        let enough_ms = if same { 0.0 } else { enough_ms };
        while ms.len() < turns(ms[0], enough_ms) {
            let again = warm.renderer.render(self.camera, &mut |_| ())?;
            ms.push(total(&again));
            for (pass, known) in again.passes.iter().zip(&mut passes) {
                known.1.push(pass.ms);
            }
            if let Some((other, _)) = &mut other {
                baseline_ms.push(self.time(other)?);
            }
        }
        Ok(Measurement {
            film,
            halves: halves.map(|halves| halves.map(|half| shown(&half, &view))),
            noise: rendered.errors.last().map(|error| error.relmse),
            png: warm.renderer.png(&rendered)?,
            display: Display {
                width,
                height,
                rgba: rendered.display.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect(),
            },
            ms,
            baseline_ms,
            passes: passes.into_iter().map(|(name, ms)| (name, Interval::of(&ms).median)).collect(),
            work: counts(&rendered.work),
            compiled: self.compiled(warm)?,
            samples: rendered.samples,
        })
    }
}
