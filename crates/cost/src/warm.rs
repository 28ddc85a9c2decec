//! Measurements with warmed-up renderers, interleaved with a baseline (paired A/B measurement).

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;

use super::difference::{Shown, shown};
use super::statistics::Interval;
use super::tiles;
use etalon::frame::{Rendered, Renderer, Settings, TileShare, Work};
use etalon::gpu::{Compiled, Device, Program};
use etalon::image::Picture;
use etalon::image::png::{self, Display};
use etalon::plan::{Knobs, Plan, Screen};
use etalon::prepare::Original;
use etalon::scene::Camera;
use etalon::scene::environment::Environment;

/// Largest number of timed renders of a picture.
const MOST: usize = 7;
/// Total milliseconds after which a picture is not timed again; at least two renders are timed.
pub const ENOUGH_MS: f64 = 1000.0;
/// A picture that takes at least this many milliseconds is timed once.
const LONG_MS: f64 = 6000.0;

/// Number of timed renders of a picture that takes `ms` milliseconds.
pub(super) fn turns(ms: f64, enough_ms: f64) -> usize {
    match ms {
        ms if ms >= LONG_MS => 1,
        ms => ((enough_ms / ms.max(1e-3)).ceil() as usize).clamp(2, MOST),
    }
}

/// Total milliseconds of timed renders per picture in a run of `budget_s` seconds: short runs draw more pictures
/// instead.
pub(super) fn enough_ms(budget_s: f64) -> f64 {
    (ENOUGH_MS * budget_s / 480.0).clamp(0.15 * ENOUGH_MS, ENOUGH_MS)
}

/// Scene, camera, device and settings of all measurements.
pub struct Bench<'a> {
    /// The device.
    pub device: &'a Arc<Device>,
    /// The scene.
    pub original: &'a Original,
    /// Environment map.
    pub environment: Option<&'a Environment>,
    /// Settings of the renderer; the knobs are replaced for each picture. Of a share of the tiles, pictures are these
    /// tiles side by side (`tiles.rs`).
    pub settings: Settings,
    /// The camera.
    pub camera: &'a Camera,
}

/// A warmed-up renderer: the scene is uploaded and every shader is compiled.
pub struct WarmRenderer {
    /// The renderer.
    pub renderer: Renderer,
    /// Wall milliseconds of the warm-up.
    pub start_ms: f64,
    /// Wall seconds of its last sample, before which everything was compiled.
    pub sample_s: f64,
}

/// A picture with its times.
pub struct Measurement {
    /// Radiance.
    pub film: Picture,
    /// Display values of both half buffers; only of path tracing.
    pub halves: Option<[Shown; 2]>,
    /// Relative mean squared error due to noise, estimated from the half buffers.
    pub noise: Option<f64>,
    /// Display values.
    pub display: Display,
    /// PNG file.
    pub png: Vec<u8>,
    /// GPU milliseconds of each timed render.
    pub ms: Vec<f64>,
    /// GPU milliseconds of the baseline, timed interleaved with `ms`.
    pub baseline_ms: Vec<f64>,
    /// Median GPU milliseconds of each pass.
    pub passes: Vec<(String, f64)>,
    /// Work counts.
    pub work: BTreeMap<String, u64>,
    /// Compiler statistics of each program, if the driver reports any.
    pub compiled: BTreeMap<String, Vec<Compiled>>,
    /// Samples per pixel.
    pub samples: u32,
}

impl Measurement {
    /// Whether the radiance is bit-identical to `film`.
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
    /// The plan for these knobs, without uploading anything.
    ///
    /// # Errors
    /// When the scene has nothing to draw.
    pub fn plan(&self, knobs: &Knobs) -> Result<Plan> {
        let settings = Settings { knobs: knobs.clone(), ..self.settings.clone() };
        self.original.plan(&settings.conditions(self.environment)?)
    }

    /// Size in pixels of the pictures that are measured.
    #[must_use]
    pub fn film_size(&self) -> [u32; 2] {
        tiles::packed_size(self.settings.size, self.settings.share)
    }

    /// The tiles of the share that `settings` names, out of a picture.
    #[must_use]
    pub fn film(&self, picture: Picture) -> Picture {
        tiles::packed_picture(picture, self.settings.share)
    }

    /// Display values of a picture, and its PNG file.
    ///
    /// # Errors
    /// When the file cannot be encoded.
    pub fn display(&self, rendered: &Rendered) -> Result<(Display, Vec<u8>)> {
        let [width, height] = self.film_size();
        let all = rendered.display.as_chunks::<4>().0.to_vec();
        let rgba = tiles::packed(all, self.settings.size, self.settings.share);
        let png = png::encode_png(width, height, rgba.as_flattened(), rendered.has_alpha)?;
        Ok((Display { width, height, rgba }, png))
    }

    /// Whether rungs draw the whole picture, whatever the share: they look up pixels of other tiles.
    ///
    /// # Errors
    /// When the scene has nothing to draw.
    pub fn draws_all(&self, knobs: &Knobs) -> Result<bool> {
        let plan = self.plan(knobs)?;
        Ok(self.settings.share == TileShare::ALL || plan.screen != Screen::default() || plan.denoise)
    }

    /// Warms up a renderer: uploads the scene and draws two samples, which compiles everything.
    ///
    /// # Errors
    /// When these knobs cannot be drawn.
    pub fn warm_up(&self, knobs: &Knobs) -> Result<WarmRenderer> {
        let start = Instant::now();
        let mut renderer = self.renderer(knobs, self.settings.seed)?;
        let mut drawing = renderer.begin(self.camera, 2);
        let mut sample = start;
        while !drawing.is_done() {
            if drawing.is_whole() {
                sample = Instant::now();
            }
            renderer.step(&mut drawing)?;
        }
        let sample_s = sample.elapsed().as_secs_f64();
        renderer.picture(&drawing)?;
        Ok(WarmRenderer { renderer, start_ms: start.elapsed().as_secs_f64() * 1e3, sample_s })
    }

    /// A renderer for these knobs and this random seed, without drawing.
    ///
    /// # Errors
    /// When these knobs cannot be drawn.
    pub fn renderer(&self, knobs: &Knobs, seed: u32) -> Result<Renderer> {
        let share = if self.draws_all(knobs)? { TileShare::ALL } else { self.settings.share };
        let settings = Settings { knobs: knobs.clone(), seed, max_error: None, share, ..self.settings.clone() };
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

    /// Draws and times a picture, interleaved with the baseline `other` if given, until the renders took `enough_ms`
    /// milliseconds.
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
        let film = self.film(warm.renderer.film_alone()?);
        let halves = warm.renderer.half_means_alone()?.map(|halves| halves.map(|half| self.film(half)));
        let (display, png) = self.display(&rendered)?;
        let view = self.settings.view_transform();
        let same = other.as_ref().is_some_and(|(_, known)| known.is(&film));
        let mut ms = vec![total(&rendered)];
        let mut baseline_ms = Vec::new();
        let mut passes: Vec<(String, Vec<f64>)> =
            rendered.passes.iter().map(|p| (p.name.clone(), vec![p.ms])).collect();
        if let Some((other, _)) = &mut other {
            baseline_ms.push(self.time(other)?);
        }
        // A picture that is bit-identical to its base needs no more timing.
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
            // A mean over the whole picture, which is black beside the share.
            noise: rendered.errors.last().map(|error| error.relmse * f64::from(self.settings.share.of)),
            png,
            display,
            ms,
            baseline_ms,
            passes: passes.into_iter().map(|(name, ms)| (name, Interval::of(&ms).median)).collect(),
            work: counts(&rendered.work),
            compiled: self.compiled(warm)?,
            samples: rendered.samples,
        })
    }
}
