//! The renderer: the whole frame, one call per pass, top to bottom. Read `Renderer::sample` first.
//!
//! Read docs/frame.md; Real-Time Rendering (4th ed.), chapter 20 for deferred shading; pbrt (4th ed.), chapters 5
//! (film) and 13 (path tracing). A picture is the mean of samples; each sample is one [`Frame`] per band of
//! wavelengths. The input is a [`Prepared`] scene: planned, with its BVH. Beside it: `settings` of
//! a picture, `targets` (images and buffers of its size), `drawing` (how far a picture is), `rendered` (results and
//! counts), `readback` (what the host reads).

mod drawing;
mod readback;
mod rendered;
mod settings;
mod targets;

use std::sync::Arc;

use anyhow::{Result, bail, ensure};

pub use self::drawing::Drawing;
pub use self::readback::{denoised, shown};
pub use self::rendered::{NotFinite, Progress, Rendered, Sums, Work};
pub use self::settings::{Background, NEUTRAL_GREY, Settings};
use self::settings::{check_size, display_background};
use self::targets::Targets;
use crate::gpu::{Buffer, DescriptorSet, Device, Frame, Image, PassPlan, Place};
use crate::image::Picture;
use crate::image::tone::ToneMap;
use crate::pass::accumulate::accumulate;
use crate::pass::ambient::ambient;
use crate::pass::background::background;
use crate::pass::classify::{classify, classify_fragments};
use crate::pass::composite::{Behind, composite};
use crate::pass::denoise::denoise;
use crate::pass::fragments::{FragmentLists, fragments};
use crate::pass::gbuffer::gbuffer;
use crate::pass::interact::interact;
use crate::pass::light::light;
use crate::pass::lighting::Lighting;
use crate::pass::mirror::mirror;
pub use crate::pass::part::Part;
use crate::pass::part::PartOnDevice;
use crate::pass::path::paths;
pub use crate::pass::rows::TileShare;
use crate::pass::screen::screen_tiles;
use crate::pass::shadow_map::ShadowMaps;
use crate::pass::sum::{Sample, block_of, join};
use crate::pass::tiles::tiles;
use crate::pass::tonemap::{Counts, tonemap};
use crate::pass::trace_photons::trace_photons;
use crate::plan::{Ability, Architecture, Plan, Refused, Setting};
use crate::prepare::{Original, Prepared};
use crate::scene::Camera;
use crate::scene::environment::Environment;
use crate::scene::wavelengths::Slice;
use crate::share;
use crate::spectra::VISIBLE;
use crate::upload::environment::{EnvironmentOnDevice, EnvironmentRotation};
use crate::upload::rays::{BvhFacts, RaysOnDevice};
use crate::upload::scene::SceneOnDevice;
use crate::upload::shared::{Library, OnDevice};
use crate::upload::view::{View, jitter};

/// Largest number of lights on a driver that limits loops to 65,535 iterations: one iteration per light.
const MOST_LIGHTS: usize = 60_000;
/// The same limit with tiled light culling: two iterations per light, and one per word of 32 lights.
const MOST_LISTED_LIGHTS: usize = 30_000;

/// Samples per pixel after which rendering to a target error gives up.
const MOST_SAMPLES: u32 = 1 << 16;

/// Largest number of parts of a band of wavelengths, in pictures with dispersion; each sample takes one part.
const MOST_PARTS: u32 = 64;
/// Largest number of parts of a band when rendering to a target error.
const PARTS_BEFORE_AN_END: u32 = 8;

/// A scene on a device, ready to be rendered from any camera.
pub struct Renderer {
    device: Arc<Device>,
    plan: Plan,
    /// Warnings about the scene, one sentence each.
    pub warnings: Vec<String>,
    settings: Settings,
    scene: SceneOnDevice,
    rays: RaysOnDevice,
    shadow_maps: ShadowMaps,
    environment: EnvironmentOnDevice,
    targets: Targets,
    camera: Buffer,
    /// The scene's descriptor sets, which all programs read.
    sets: [DescriptorSet; 2],
    /// Number of samples in the last picture so far, and in the complete picture.
    drawn: [u32; 2],
}

impl Renderer {
    /// Plans, prepares and uploads a scene, and prefilters the environment.
    ///
    /// # Errors
    /// When the scene has nothing to draw, the size is out of range, or it does not fit the device.
    pub fn new(
        device: &Arc<Device>,
        scene: impl Into<Original>,
        environment: Option<&Environment>,
        settings: Settings,
    ) -> Result<Self> {
        check_size(device, &settings.knobs, settings.size)?;
        let prepared = Prepared::new(scene, &settings.conditions(environment)?)?;
        Self::of(device, prepared, environment, settings)
    }

    /// Uploads a prepared scene and prefilters its environment; environment and settings must be those of the
    /// preparation.
    ///
    /// # Errors
    /// When the size is out of range, the device lacks what the plan needs, or the scene does not fit the device.
    pub fn of(
        device: &Arc<Device>,
        prepared: Prepared,
        environment: Option<&Environment>,
        settings: Settings,
    ) -> Result<Self> {
        Self::after(None, device, prepared, environment, settings)
    }

    /// Another frame of the scene's animation, same environment and settings: unchanged data stays on the device.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn next(self, scene: impl Into<Original>, environment: Option<&Environment>) -> Result<Self> {
        let (device, settings) = (self.device.clone(), self.settings.clone());
        let prepared = Prepared::new(scene, &settings.conditions(environment)?)?;
        Self::after(Some(self), &device, prepared, environment, settings)
    }

    fn after(
        before: Option<Self>,
        device: &Arc<Device>,
        mut prepared: Prepared,
        environment: Option<&Environment>,
        settings: Settings,
    ) -> Result<Self> {
        check_size(device, &settings.knobs, settings.size)?;
        let plan = &mut prepared.plan;
        if let Some(wanted) = settings.max_error {
            if plan.paths.is_none() {
                let why = format!("{wanted}: only paths tell their error, the model global follows them");
                return Err(Refused::error(Setting::MaxError, why));
            }
            plan.samples = MOST_SAMPLES;
        }
        plan.architecture = settings.architecture.unwrap_or(Architecture::of(device.is_software()));
        plan.check(&Ability {
            device: device.info().name.clone(),
            adds_in_subgroups: device.offers().adds_in_subgroups,
        })?;
        let most = if plan.tiles { MOST_LISTED_LIGHTS } else { MOST_LIGHTS };
        let name = prepared.scene.name.clone();
        let lights = (plan.directional_lights + plan.local_lights) as usize;
        if device.limits_loops() && lights > most {
            bail!("{name}: {lights} lights, a software device lights with at most {most} such");
        }
        let rays = RaysOnDevice::new(device, &prepared, settings.traversal)?;
        let Prepared { scene, plan, solids, mut warnings, .. } = prepared;
        for part in settings.parts.iter().filter(|part| !part.called_for(&plan)) {
            warnings.push(format!("layer {}: no surface of this scene sends such rays, the layer is 0", part.name()));
        }
        // A forced environment effect without an environment uses a black one.
        let dark = (plan.environment && environment.is_none()).then(Environment::dark);
        let turn = EnvironmentRotation {
            intensity: settings.environment_intensity,
            rotation: settings.environment_rotation,
            blur: settings.background_blur,
        };
        let touching = rays.constants.touching;
        // If both plans draw the same work, targets and environment are reused.
        let (textures, around, targets) = match before {
            Some(Self { scene, environment, targets, plan: known, rays, .. }) => {
                let same = known.draws_as(&plan) && rays.constants.touching == touching;
                (Some(scene.textures), same.then_some(environment), same.then_some(targets))
            }
            None => (None, None, None),
        };
        let mut scene = SceneOnDevice::new(device, scene, &plan, &settings.knobs, &solids, rays.anchor(), textures)?;
        let environment = match around {
            Some(around) => around,
            None => EnvironmentOnDevice::new(device, &plan, environment.or(dark.as_ref()), turn, settings.seed)?,
        };
        let shadow_maps = ShadowMaps::new(device, &plan, &name, &mut scene, rays.anchor())?;
        let camera = Buffer::new(device, "camera", size_of::<share::Camera>() as u64, Place::Upload)?;
        let on_device = OnDevice {
            camera: &camera,
            scene: &scene,
            rays: &rays,
            shadow_depth: shadow_maps.depth(),
            environment: &environment,
        };
        Ok(Self {
            sets: on_device.write(device)?,
            environment,
            shadow_maps,
            scene,
            rays,
            targets: match targets {
                Some(targets) => targets,
                None => Targets::new(device, &plan, &settings, touching)?,
            },
            camera,
            device: device.clone(),
            plan,
            warnings,
            settings,
            drawn: [0; 2],
        })
    }

    /// Renders the scene from a camera.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn render(&mut self, camera: &Camera, progress: &mut dyn FnMut(Progress)) -> Result<Rendered> {
        self.render_samples(camera, self.plan.samples, progress)
    }

    /// Renders with fewer samples per pixel than the plan has.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn render_samples(
        &mut self,
        camera: &Camera,
        samples: u32,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Rendered> {
        let drawing = self.begin(camera, samples);
        self.finish(drawing, progress, &|| false)
    }

    /// Renders the scene from a camera until `is_stopped`: the picture then has the samples drawn so far, at least one.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn render_until(
        &mut self,
        camera: &Camera,
        progress: &mut dyn FnMut(Progress),
        is_stopped: &dyn Fn() -> bool,
    ) -> Result<Rendered> {
        let drawing = self.begin(camera, self.plan.samples);
        self.finish(drawing, progress, is_stopped)
    }

    fn finish(
        &mut self,
        mut drawing: Drawing,
        progress: &mut dyn FnMut(Progress),
        is_stopped: &dyn Fn() -> bool,
    ) -> Result<Rendered> {
        while !drawing.is_done() {
            if drawing.is_whole() && is_stopped() {
                let samples = drawing.samples();
                let is_known = drawing.errors.last().is_some_and(|error| error.samples == samples);
                if self.halves() == 2 && samples > 1 && !is_known {
                    drawing.errors.push(self.error(samples, drawing.count)?);
                }
                return self.picture(&drawing);
            }
            let known = drawing.errors.len();
            self.step(&mut drawing)?;
            if drawing.next[1] == 0 {
                progress(Progress {
                    done: drawing.samples(),
                    of: drawing.count,
                    error: drawing.errors[known..].first().copied(),
                });
            }
        }
        let wanted = self.settings.max_error.unwrap_or(f64::INFINITY);
        if let Some(error) = drawing.errors.last().filter(|error| error.relmse.sqrt() > wanted) {
            let (samples, error) = (drawing.samples(), error.relmse.sqrt());
            let why = format!("{wanted}: after {samples} samples the error is still {error:.4}");
            return Err(Refused::error(Setting::MaxError, why));
        }
        self.picture(&drawing)
    }

    /// The plan: effects with reasons.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Begins a picture from a camera with `samples` samples per pixel, at most as many as the plan has.
    pub fn begin(&mut self, camera: &Camera, samples: u32) -> Drawing {
        let view = View::new(camera, self.settings.size, self.scene.bounds);
        self.scene.set_view(&view);
        self.rays.set_eye(&view);
        let mut drawing = Drawing::new(view, samples.min(self.plan.samples));
        // Shadow maps were drawn once, before the first picture.
        drawing.times.add(std::mem::take(&mut self.shadow_maps.times));
        drawing
    }

    /// Sample indices at which processes may split a picture so that their sums add up to those of one process: the
    /// first sample of each block, and the number of all samples.
    #[must_use]
    pub fn block_starts(&self) -> Vec<u32> {
        let (count, halves) = (self.plan.samples, self.halves());
        let block = block_of(count.div_ceil(halves)) * halves;
        (0..count).step_by(block as usize).chain([count]).collect()
    }

    /// Begins a part of a picture: samples `from` to before `end`, both from [`Renderer::block_starts`]. A part has
    /// sums that other processes continue, but no picture. It continues from `known`, the sums of the samples before
    /// `from`.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn begin_part(&mut self, camera: &Camera, [from, end]: [u32; 2], known: Option<&Sums>) -> Result<Drawing> {
        let mut drawing = Drawing { is_part: true, end, ..self.begin(camera, self.plan.samples) };
        drawing.next = [from, 0];
        drawing.from = from;
        if let Some(known) = known {
            drawing.from = known.samples[0];
            drawing.work = known.work;
            drawing.dropped = known.dropped;
            for (image, sum) in self.sums_on_device().into_iter().zip(&known.sums) {
                self.write(image, sum)?;
            }
        }
        Ok(drawing)
    }

    /// Sums on the device, then those of the parts.
    fn sums_on_device(&self) -> Vec<&Image> {
        let Targets { sums, parts, radiance, .. } = &self.targets;
        let own: Vec<&Image> = sums.iter().map(|sum| &sum.total).collect();
        let own = if own.is_empty() { vec![radiance] } else { own };
        own.into_iter().chain(parts.iter().map(PartOnDevice::film)).collect()
    }

    /// The sums of a part at the end of a block.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn sums(&self, drawing: &Drawing) -> Result<Sums> {
        let sums = self.sums_on_device().into_iter().map(|image| self.read(image)).collect::<Result<_>>()?;
        let &Drawing { from, next: [end, _], work, dropped, .. } = drawing;
        Ok(Sums { samples: [from, end], sums, work, dropped })
    }

    /// Draws one more sample of every pixel, or one band of it.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn step(&mut self, drawing: &mut Drawing) -> Result<()> {
        let ([index, band], count) = (drawing.next, drawing.count);
        self.set_band(band, index, count);
        self.trace_photons(drawing)?;
        // A frame whose transparent fragments did not fit is drawn again with a larger buffer.
        loop {
            self.look(&drawing.view, index, count, band);
            let sample = self.sample(count, band)?;
            let passes = match drawing.interruptible {
                true => self.device.interruptible(|| sample.finish())?,
                false => sample.finish()?,
            };
            let fitted = match &mut self.targets.lists {
                Some(lists) => lists.fitted()?,
                None => true,
            };
            if fitted {
                drawing.times.add(passes);
                break;
            }
        }
        if self.plan.rays.is_some() {
            drawing.work.add(&self.rays.counted());
            ensure!(
                drawing.work.lights_cut_off == 0,
                "lighting what rays meet ({} lights and {} light samples, at {} surfaces) takes longer loops than the \
                 driver allows: draw with shadows=map and lights=points, fewer lights, fewer interfaces, or on a device \
                 without that limit",
                self.plan.directional_lights + self.plan.local_lights,
                self.plan.light_samples.count,
                drawing.work.lights_cut_off
            );
        }
        if !self.targets.sums.is_empty() {
            drawing.times.add(self.add(drawing, band)?.finish()?);
        }
        drawing.next = if band + 1 < self.plan.bands { [index, band + 1] } else { [index + 1, 0] };
        if drawing.next[1] > 0 {
            return Ok(());
        }
        self.drawn = [index + 1, count];
        drawing.dropped = drawing.dropped.max(self.targets.lists.as_ref().map_or(0, FragmentLists::dropped));
        let done = index + 1;
        let error = match self.halves() {
            2 if !drawing.is_part && done > 1 && (done.is_power_of_two() || done == count) => {
                Some(self.error(done, count)?)
            }
            _ => None,
        };
        drawing.errors.extend(error);
        let limit = self.settings.max_error.unwrap_or(0.0);
        // Before all parts of the bands were drawn, the halves do not contain the missing parts' error.
        let whole = done >= 2 * self.parts(count);
        drawing.enough = error.is_some_and(|error| whole && limit > 0.0 && error.relmse.sqrt() <= limit);
        Ok(())
    }

    /// The picture so far: the mean of at least one sample.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn picture(&mut self, drawing: &Drawing) -> Result<Rendered> {
        let samples = drawing.samples();
        let mut times = drawing.times.clone();
        if let Some(film) = &self.targets.film {
            let mut frame = Frame::new(&self.device);
            let (of_sums, block) = self.samples_of_sums(samples, drawing.count);
            join(&mut frame, &self.targets.sums, &of_sums, block, film)?;
            if let Some(with) = self.targets.denoising.as_ref().filter(|_| samples > 1) {
                denoise(&mut frame, with, (&self.targets.sums, &of_sums, block), film)?;
            }
            times.add(frame.finish()?);
        }
        times.add(self.show(samples, drawing.count)?.finish()?);
        let frames = samples * self.plan.bands.max(1);
        let work = drawing.work.of(self.settings.size, frames);
        Ok(Rendered {
            display: self.targets.display.pixels.read(<[u8]>::to_vec),
            has_alpha: display_background(&self.settings).1,
            counts: self.targets.display.counts()?,
            dropped: drawing.dropped,
            work,
            passes: times.list(),
            samples,
            errors: drawing.errors.clone(),
        })
    }

    /// Changes the size of all further pictures.
    ///
    /// # Errors
    /// When the size is out of range, or memory is short; the old size stays.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<()> {
        check_size(&self.device, &self.settings.knobs, size)?;
        let settings = Settings { size, ..self.settings.clone() };
        self.targets = Targets::new(&self.device, &self.plan, &settings, self.rays.constants.touching)?;
        self.settings = settings;
        Ok(())
    }

    /// Sets tone curve and exposure of the display output.
    pub fn set_display(&mut self, tonemap: ToneMap, exposure: f32) {
        self.settings.tonemap = tonemap;
        self.settings.exposure = exposure;
    }

    /// Sets camera and random numbers of the next frame.
    fn look(&mut self, view: &View, index: u32, count: u32, band: u32) {
        let TileShare { index: first, of } = self.settings.share;
        let camera = share::Camera { tiles: [first, of], ..view.shared(jitter(index, count)) };
        self.camera.write(bytemuck::bytes_of(&camera));
        // The two halves of path tracing have independent random numbers, and so have the bands: their noise is
        // uncorrelated and partly cancels in the sum.
        let [at, half] = [index / self.halves(), index % self.halves()];
        let seed = self.settings.seed.wrapping_mul(2).wrapping_add(half).wrapping_add(band.wrapping_mul(0x9e37_79b9));
        self.rays.set_view(view, [at, count.div_ceil(self.halves())], count, seed);
    }

    /// Number of parts of each band in pictures with dispersion, a power of two: one for each sample of a half up to a
    /// limit, which is low when rendering to a target error, so that the error can be estimated early.
    fn parts(&self, count: u32) -> u32 {
        let halves = self.halves();
        let limit = if self.settings.max_error.is_some() { PARTS_BEFORE_AN_END } else { MOST_PARTS };
        let most = if self.plan.disperses { (count / halves).clamp(1, limit) } else { 1 };
        1 << most.ilog2()
    }

    /// Uploads the spectra of the next frame's band of wavelengths, in spectral rendering.
    fn set_band(&mut self, band: u32, index: u32, count: u32) {
        let bands = self.plan.bands;
        if bands == 0 {
            return;
        }
        let band = VISIBLE.part(band, bands);
        let parts = self.parts(count);
        let at = (index / self.halves()) % parts;
        let part = if parts > 1 { at.reverse_bits() >> (32 - parts.ilog2()) } else { 0 };
        self.scene.upload_band(Some(&Slice::new(band, band.part(part, parts))));
    }

    /// Traces photons of punctual lights and builds their map, another one for each sample and band: what one misses or
    /// has too much of, others have.
    fn trace_photons(&mut self, drawing: &mut Drawing) -> Result<()> {
        let [index, band] = drawing.next;
        let number = u64::from(self.settings.seed) << 32 | u64::from(index) << 8 | u64::from(band);
        let Some(flight) = self.rays.photons.emit(&self.device, number)? else { return Ok(()) };
        self.look(&drawing.view, index, drawing.count, band);
        let mut frame = self.frame();
        trace_photons(&mut frame, self.library(), &flight)?;
        drawing.times.add(frame.finish()?);
        self.rays.photons.land(&self.device, &flight)?;
        self.sets = self.on_device().write(&self.device)?;
        Ok(())
    }

    fn on_device(&self) -> OnDevice<'_> {
        let Self { camera, scene, rays, shadow_maps, environment, .. } = self;
        OnDevice { camera, scene, rays, shadow_depth: shadow_maps.depth(), environment }
    }

    /// An empty frame whose programs read the scene.
    fn frame(&self) -> Frame<'_> {
        Frame::of(&self.device, self.on_device().bind(&self.sets))
    }

    /// Specialization constants of the shaders' library.
    fn library(&self) -> Library {
        let mut library = self.on_device().library(&self.plan, &self.settings.knobs, self.targets.tiles.words());
        library.own_tiles.shared_picture = self.settings.share != TileShare::ALL;
        library
    }

    /// Records one sample of every pixel, or one band of it: the frame, pass by pass.
    fn sample(&self, count: u32, band: u32) -> Result<Frame<'_>> {
        let Self { plan, scene, rays, targets, .. } = self;
        let Targets { gbuffer: g, tiles: lists_of_lights, work, lists, radiance, parts, screen, .. } = targets;
        // Each of n samples per pixel stands for 1/n of the pixel's area, so the texture level of detail is biased by
        // -log2(n)/2.
        let lod_bias = -0.5 * (count as f32).log2();
        let library = self.library();
        let Settings { size, share, .. } = self.settings;
        let lighting = &Lighting { plan, library, tiles: lists_of_lights, size, share };

        let mut frame = self.frame();
        if plan.rays.is_some() {
            rays.reset(&mut frame);
        }
        if share != TileShare::ALL {
            frame.clear("clear radiance", radiance);
        }
        if let Some(with) = &self.targets.paths {
            paths(&mut frame, lighting, with, radiance)?;
            frame.read_back(&rays.counts);
            return Ok(frame);
        }
        // Visibility is the same in all bands.
        if band == 0 {
            gbuffer(&mut frame, scene, g, lod_bias, scene.draws(false, rays.inside()))?;
            if plan.tiles {
                tiles(&mut frame, plan, library, g, lists_of_lights)?;
            }
            classify(&mut frame, library, plan.architecture, g, work)?;
        }
        light(&mut frame, lighting, g, work, radiance)?;
        if plan.occlusion_rays() > 0 {
            ambient(&mut frame, lighting, g, work, radiance)?;
        }
        background(&mut frame, lighting, g, work, radiance)?;
        let trees = (&self.targets.ray_tiles, self.targets.ray_trees.as_ref());
        if let Some(with) = plan.rays.filter(|rays| rays.mirrors || rays.refraction) {
            interact(&mut frame, lighting, with, g, trees, radiance, None)?;
        }
        for part in parts {
            frame.clear("reset part", &part.radiance);
            if let Some(with) = plan.rays.filter(|_| part.part.called_for(plan)) {
                interact(&mut frame, lighting, with, g, trees, &part.radiance, Some(part.part))?;
            }
            if plan.screen.refraction {
                frame.download("copy part", &part.radiance, &part.seen);
            }
        }
        if plan.screen.mirrors || plan.screen.transparent_mirrors {
            screen_tiles(&mut frame, lighting, g, screen)?;
        }
        if plan.screen.mirrors {
            frame.download("copy radiance", radiance, &screen.seen);
            mirror(&mut frame, lighting, g, &self.targets.ray_tiles, screen, radiance)?;
        }
        if plan.screen.refraction || plan.screen.transparent_mirrors {
            frame.download("copy radiance", radiance, &screen.seen);
        }
        if let Some(lists) = lists {
            frame.fill("reset fragment counters", &lists.counters, 0);
            frame.fill("reset dropped fragments", &lists.dropped, 0);
            for strip in lists.strips() {
                fragments(&mut frame, scene, g, lists, strip, lod_bias)?;
                classify_fragments(&mut frame, lighting, &lists.heads, &lists.work, strip.rows)?;
                let behind = Behind { radiance, seen: &screen.seen, part: None };
                composite(&mut frame, lighting, g, lists, screen, behind, strip.rows)?;
                for PartOnDevice { part, radiance, seen, .. } in parts {
                    let behind = Behind { radiance, seen, part: Some(*part) };
                    composite(&mut frame, lighting, g, lists, screen, behind, strip.rows)?;
                }
            }
            frame.read_back(&lists.counters);
            frame.read_back(&lists.dropped);
        }
        if plan.rays.is_some() {
            frame.read_back(&rays.counts);
        }
        Ok(frame)
    }

    /// Number of sums among which samples alternate: 1, or 2 for even and odd samples.
    fn halves(&self) -> u32 {
        self.targets.sums.len().max(1) as u32
    }

    /// Number of samples in each sum after `samples` of `count`, and samples per block.
    fn samples_of_sums(&self, samples: u32, count: u32) -> (Vec<u32>, u32) {
        let halves = self.halves();
        ((0..halves).map(|half| (samples + halves - 1 - half) / halves).collect(), block_of(count.div_ceil(halves)))
    }

    /// Records the addition of the sample, or one band of it, to its sum and to the sums of parts.
    fn add(&self, drawing: &Drawing, band: u32) -> Result<Frame<'_>> {
        let mut frame = Frame::new(&self.device);
        let &Drawing { next: [index, _], count, from, .. } = drawing;
        let Targets { sums, film, radiance, parts, .. } = &self.targets;
        let (bands, halves) = (self.plan.bands, self.halves());
        let block = block_of(count.div_ceil(halves));
        let sample = Sample { index: index / halves, block, begins: band == 0, ends: band + 1 == bands.max(1) };
        // A sum that is also the film becomes the mean with its last sample.
        let last = film.is_none() && !drawing.is_part && index + 1 == count && sample.ends;
        let scale = if last { 1.0 / count as f32 } else { 1.0 };
        let Some(sum) = sums.get((index % halves) as usize) else { return Ok(frame) };
        sum.add(&mut frame, radiance, sample, from / halves, (scale, bands))?;
        for part in parts {
            let last = !drawing.is_part && index + 1 == count && sample.ends;
            let scale = if last { 1.0 / count as f32 } else { 1.0 };
            accumulate(&mut frame, &part.radiance, part.film(), index == from && band == 0, scale, bands)?;
        }
        Ok(frame)
    }

    /// Records the tone mapping of the film after `samples` of `count`.
    fn show(&self, samples: u32, count: u32) -> Result<Frame<'_>> {
        let mut frame = Frame::new(&self.device);
        let Targets { sums, film, display, .. } = &self.targets;
        // Before the last sample, a film that is the sum is not yet divided.
        let is_sum = film.is_none() && !sums.is_empty() && samples < count;
        let scale = if is_sum { 1.0 / samples as f32 } else { 1.0 };
        let film = self.film_on_device();
        let (background, _) = display_background(&self.settings);
        let Settings { tonemap: curve, exposure, .. } = self.settings;
        tonemap(&mut frame, (film, scale), display, curve as u32, exposure, background, self.plan.bands > 0)?;
        Ok(frame)
    }

    /// The passes of a first picture from a camera, without drawing it: those before all samples, those of one sample,
    /// and those after all samples. Pipelines are created where the driver reports statistics of them.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn passes(&mut self, camera: &Camera) -> Result<Vec<PassPlan>> {
        let count = self.plan.samples;
        let view = View::new(camera, self.settings.size, self.scene.bounds);
        self.scene.set_view(&view);
        self.look(&view, 0, count, 0);
        let done =
            self.shadow_maps.times.iter().map(|pass| PassPlan { name: pass.name.clone(), pipelines: Vec::new() });
        let mut passes: Vec<PassPlan> = done.collect();
        let drawing = Drawing::new(view, count);
        if let Some(flight) = self.rays.photons.emit(&self.device, 0)? {
            let mut frame = self.frame();
            trace_photons(&mut frame, self.library(), &flight)?;
            frame.compile_where_told()?;
            passes.extend(frame.plan());
        }
        let mut last = None;
        if let (Some(film), Some(with)) = (&self.targets.film, &self.targets.denoising) {
            let frame = last.insert(Frame::new(&self.device));
            let (of_sums, block) = self.samples_of_sums(count, count);
            denoise(frame, with, (&self.targets.sums, &of_sums, block), film)?;
        }
        let frames = [Some(self.sample(count, 0)?), Some(self.add(&drawing, 0)?), last, Some(self.show(count, count)?)];
        for frame in frames.into_iter().flatten() {
            frame.compile_where_told()?;
            passes.extend(frame.plan());
        }
        Ok(passes)
    }

    /// Figures of the BVH; `None` when the plan sends no rays.
    #[must_use]
    pub fn bvh(&self) -> Option<BvhFacts> {
        self.rays.facts
    }

    /// The device that the renderer draws on.
    #[must_use]
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }
}
