//! The renderer: the whole frame, one call per pass, top to bottom. Read `Renderer::sample` first.
//!
//! Read docs/frame.md; Real-Time Rendering (4th ed.), chapter 20 for deferred shading; pbrt (4th ed.), chapters 5 (film) and
//! 13 (path tracing). A picture is the mean of samples; each sample is one [`Frame`] per band of wavelengths. The input is a
//! [`Prepared`] scene: planned, with its BVH.

use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::{Result, bail, ensure};
use ash::vk;

use crate::gpu::{Buffer, DescriptorSet, Device, Frame, Image, ImageDesc, PassPlan, PassTime, Place};
use crate::image::halves::{SampleError, error_of_halves};
use crate::image::tone::{ToneMap, ViewTransform};
use crate::image::{Picture, png};
use crate::pass::accumulate::accumulate;
use crate::pass::aov::aov;
use crate::pass::background::background;
use crate::pass::classify::{RayTiles, WorkLists, classify, classify_fragments};
use crate::pass::composite::{Behind, composite};
use crate::pass::fragments::{FragmentLists, fragments};
use crate::pass::gbuffer::{GBuffer, gbuffer};
use crate::pass::interact::interact;
use crate::pass::light::light;
use crate::pass::lighting::Lighting;
use crate::pass::mirror::mirror;
pub use crate::pass::part::Part;
use crate::pass::part::PartOnDevice;
use crate::pass::path::{PathsOnDevice, paths};
pub use crate::pass::rows::TileShare;
use crate::pass::screen::{OnScreen, screen_tiles};
use crate::pass::shadow_map::ShadowMaps;
use crate::pass::sum::{Sample, Sum, block_of, join};
use crate::pass::tiles::{Tiles, tiles};
use crate::pass::tonemap::{Counts, Display, tonemap};
use crate::plan::rungs::Indirect;
use crate::plan::{Ability, ForcedEffects, Knobs, Plan, Refused, Setting};
use crate::prepare::{Conditions, Original, Prepared};
use crate::scene::Camera;
use crate::scene::environment::Environment;
use crate::scene::wavelengths::Slice;
use crate::share::{self, AovPixel};
use crate::spectra::VISIBLE;
use crate::transport::emitters::Sky;
use crate::upload::environment::{EnvironmentOnDevice, EnvironmentRotation};
use crate::upload::rays::{BvhFacts, RaysOnDevice, Traversal};
use crate::upload::scene::SceneOnDevice;
use crate::upload::shared::{Library, OnDevice};
use crate::upload::view::{View, jitter};

/// Refuses a size that no image or buffer of the device can hold.
fn check_size(device: &Device, knobs: &Knobs, size: [u32; 2]) -> Result<()> {
    let limit = device.max_image_size();
    if size.contains(&0) || size.iter().any(|&side| side > limit) {
        let why = format!("{}x{}: a picture has 1 to {limit} pixels a side on this device", size[0], size[1]);
        return Err(Refused::error(Setting::Size, why));
    }
    let pixels = u64::from(size[0]) * u64::from(size[1]);
    // Paths store four words per pixel in one buffer, everything else one.
    let bytes = if knobs.indirect == Indirect::Path { 16 } else { 4 };
    if pixels * bytes > device.max_storage_bytes() {
        let most = device.max_storage_bytes() / bytes;
        let why = format!("{}x{}: this device holds at most {most} pixels in one picture", size[0], size[1]);
        return Err(Refused::error(Setting::Size, why));
    }
    Ok(())
}

/// The background behind the scene.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Background {
    /// The environment if there is one, otherwise nothing, which a PNG shows as [`NEUTRAL_GREY`].
    #[default]
    Default,
    /// The environment.
    Environment,
    /// Nothing: transparent in every output.
    Transparent,
    /// A display colour (sRGB bytes).
    Color([u8; 3]),
}

impl Background {
    /// Composites a background colour behind the picture's premultiplied alpha.
    pub fn lay_behind(self, picture: &mut Picture) {
        if let Self::Color(color) = self {
            let behind = color.map(|byte| crate::image::tone::srgb_decode(f64::from(byte) / 255.0) as f32);
            for pixel in &mut picture.rgba {
                let rest = 1.0 - pixel[3];
                for (value, behind) in pixel.iter_mut().zip(behind) {
                    *value += rest * behind;
                }
                pixel[3] = 1.0;
            }
        }
    }
}

/// Grey behind a scene without environment, as sRGB bytes.
pub const NEUTRAL_GREY: [u8; 3] = [119; 3];

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

/// Settings of a picture: everything that is constant over the frames of a sequence.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Rungs of all knobs.
    pub knobs: Knobs,
    /// Tone curve of the display output.
    pub tonemap: ToneMap,
    /// Exposure in stops.
    pub exposure: f32,
    /// Background behind the scene.
    pub background: Background,
    /// Factor on the environment's radiance.
    pub environment_intensity: f32,
    /// Rotation of the environment about +Y, in degrees.
    pub environment_rotation: f32,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Target error: samples are drawn until the root of [`SampleError::relmse`] is at most this, whatever the knob `samples`.
    pub max_error: Option<f64>,
    /// Traces all bounces of a path in one dispatch instead of a wavefront: the same film, for comparison.
    pub paths_at_once: bool,
    /// BVH traversal; `None` selects the one that suits the device and the scene.
    pub traversal: Option<Traversal>,
    /// Effects that are planned although the scene does not call for them.
    pub forced: ForcedEffects,
    /// Parts of the picture that are stored as layers of their own; each costs one more pass of the recursive rays.
    pub parts: Vec<Part>,
    /// The share of the picture's tiles that is drawn; the rest is black.
    pub share: TileShare,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            size: [1280, 720],
            knobs: Knobs::default(),
            tonemap: ToneMap::default(),
            exposure: 0.0,
            background: Background::default(),
            environment_intensity: 1.0,
            environment_rotation: 0.0,
            seed: 0,
            max_error: None,
            paths_at_once: false,
            traversal: None,
            forced: ForcedEffects::default(),
            parts: Vec::new(),
            share: TileShare::ALL,
        }
    }
}

impl Settings {
    /// The conditions under which a scene in this environment is prepared.
    ///
    /// # Errors
    /// When the background is an environment and there is none.
    pub fn conditions<'a>(&'a self, environment: Option<&'a Environment>) -> Result<Conditions<'a>> {
        let background = match self.background {
            Background::Default | Background::Environment => environment.is_some(),
            Background::Transparent | Background::Color(_) => false,
        };
        if self.background == Background::Environment && environment.is_none() {
            let why = "env: there is no environment (none was asked for, or the scene has lights of its own)";
            return Err(Refused::error(Setting::Background, why.to_owned()));
        }
        let Self { environment_intensity: intensity, environment_rotation: rotation, .. } = *self;
        let sky = environment.map(|map| Sky { map, intensity, rotation });
        Ok(Conditions { knobs: &self.knobs, forced: self.forced, sky, background })
    }

    /// Display-linear colour behind the scene in the display output; `None` for a transparent output.
    fn behind(&self) -> Option<[f64; 3]> {
        match self.background {
            Background::Color(bytes) => Some(bytes),
            Background::Transparent => None,
            Background::Default | Background::Environment => Some(NEUTRAL_GREY),
        }
        .map(|bytes| bytes.map(|byte| crate::image::tone::srgb_decode(f64::from(byte) / 255.0)))
    }

    /// The view transform from a film of this picture to the display output.
    #[must_use]
    pub fn view_transform(&self) -> ViewTransform {
        ViewTransform { curve: self.tonemap, exposure: self.exposure, background: self.behind() }
    }
}

/// A rendered picture.
pub struct Rendered {
    /// RGBA8, sRGB-encoded, rows from the top.
    pub display: Vec<u8>,
    /// Whether `display` has transparency.
    pub has_alpha: bool,
    /// Pixels with NaN, infinite or negative values, counted before any clamp.
    pub counts: Counts,
    /// Pixels whose list of transparent fragments was too long for one invocation, in the worst sample: the farthest
    /// fragments were dropped.
    pub dropped: u32,
    /// Work counts of the rays, summed over the samples.
    pub work: Work,
    /// GPU time per pass, summed over the samples, in the order of the frame.
    pub passes: Vec<PassTime>,
    /// Samples of each pixel.
    pub samples: u32,
    /// Error estimates from the two halves of the samples, at powers of two and at the end; for path tracing only.
    pub errors: Vec<SampleError>,
}

/// Progress of a picture.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// Samples drawn.
    pub done: u32,
    /// Total number of samples, unless the target error stops earlier.
    pub of: u32,
    /// Error estimate of the picture after this sample, when one was made.
    pub error: Option<SampleError>,
}

/// Work counts of a picture: the same on every device with the same BVH traversal.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Work {
    /// Reflection rays.
    pub reflection: u64,
    /// Refraction rays.
    pub refraction: u64,
    /// Shadow rays.
    pub shadow: u64,
    /// Rays of path tracing.
    pub indirect: u64,
    /// Visited BVH nodes.
    pub node_visits: u64,
    /// Ray/triangle tests.
    pub triangle_tests: u64,
    /// Exits from closed dielectric meshes that the path had not entered.
    pub unmatched_exits: u64,
    /// Estimates of paths with NaN or infinite radiance, which were discarded.
    pub not_finite: u64,
    /// The first discarded estimate.
    pub first_not_finite: Option<NotFinite>,
    /// Surfaces at which the loop over lights stopped early, because the driver would have ended it.
    pub lights_cut_off: u64,
    /// Light of truncated paths, summed over all pixels of all frames: the truncated share of a pixel's light, in parts of 65536.
    pub lost: u64,
    /// Share of a pixel's light in truncated paths: the mean over all pixels of the picture.
    pub mean_lost: f64,
    /// Share of a pixel's light in truncated paths: the largest of all pixels.
    pub most_lost: f32,
}

/// Place of a NaN or infinite radiance.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NotFinite {
    /// Column and row of the pixel.
    pub pixel: [u32; 2],
    /// Index into the scene's materials.
    pub material: u32,
    /// Index of the surface along the path, counted from 1.
    pub event: u32,
}

impl Work {
    fn add(&mut self, counts: &share::WorkCounts) {
        let sum = |[low, high]: [u32; 2]| u64::from(high) << 32 | u64::from(low);
        self.reflection += sum(counts.reflection);
        self.refraction += sum(counts.refraction);
        self.shadow += sum(counts.shadow);
        self.indirect += sum(counts.indirect);
        self.node_visits += sum(counts.node_visits);
        self.triangle_tests += sum(counts.triangle_tests);
        self.unmatched_exits += sum(counts.unmatched_exits);
        self.lights_cut_off += sum(counts.lights_cut_off);
        self.lost += sum(counts.lost);
        self.not_finite += u64::from(counts.not_finite);
        if self.first_not_finite.is_none() && counts.not_finite > 0 {
            self.first_not_finite = Some(NotFinite {
                pixel: [counts.not_finite_pixel & 0xffff, counts.not_finite_pixel >> 16],
                material: counts.not_finite_material,
                event: counts.not_finite_event,
            });
        }
        self.most_lost = self.most_lost.max(f32::from_bits(counts.most_lost));
    }

    /// The counts with `mean_lost` for a picture of this size and number of frames.
    #[must_use]
    pub fn of(mut self, [width, height]: [u32; 2], frames: u32) -> Self {
        self.mean_lost = self.lost as f64 / 65536.0 / (f64::from(width) * f64::from(height) * f64::from(frames));
        self
    }

    /// The sum of two counts.
    #[must_use]
    pub fn with(self, other: &Self) -> Self {
        Self {
            reflection: self.reflection + other.reflection,
            refraction: self.refraction + other.refraction,
            shadow: self.shadow + other.shadow,
            indirect: self.indirect + other.indirect,
            node_visits: self.node_visits + other.node_visits,
            triangle_tests: self.triangle_tests + other.triangle_tests,
            unmatched_exits: self.unmatched_exits + other.unmatched_exits,
            not_finite: self.not_finite + other.not_finite,
            first_not_finite: self.first_not_finite.or(other.first_not_finite),
            lights_cut_off: self.lights_cut_off + other.lights_cut_off,
            lost: self.lost + other.lost,
            mean_lost: 0.0,
            most_lost: self.most_lost.max(other.most_lost),
        }
    }
}

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

/// All resources whose size depends on the picture's.
struct Targets {
    ray_tiles: RayTiles,
    gbuffer: GBuffer,
    tiles: Tiles,
    work: WorkLists,
    lists: Option<FragmentLists>,
    radiance: Image,
    screen: OnScreen,
    /// Sums of samples, when there is more than one. Path tracing sums even and odd samples separately: their random numbers
    /// are independent, so the difference of the two means estimates the picture's error.
    sums: Vec<Sum>,
    /// Mean of the samples, when it is not one of the sums.
    film: Option<Image>,
    parts: Vec<PartOnDevice>,
    paths: Option<PathsOnDevice>,
    display: Display,
}

impl Targets {
    fn new(device: &Arc<Device>, plan: &Plan, settings: &Settings, touching: bool) -> Result<Self> {
        let size = settings.size;
        let target = |name| {
            let usage = vk::ImageUsageFlags::STORAGE;
            Image::new(device, name, ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, size[0], size[1], usage))
        };
        let part = |&part: &Part| PartOnDevice::new(device, plan, &settings.knobs, part, size);
        let sums = match (plan.samples, plan.paths) {
            (1, _) if plan.bands == 0 => Vec::new(),
            (1, _) | (_, None) => vec![Sum::new(device, "sum of samples", size, plan.samples, plan.bands)?],
            (samples, Some(_)) => {
                let half = |name: &str| Sum::new(device, name, size, samples.div_ceil(2), plan.bands);
                vec![half("sum of even samples")?, half("sum of odd samples")?]
            }
        };
        let is_sum = sums.is_empty() || (sums.len() == 1 && sums[0].is_plain());
        Ok(Self {
            ray_tiles: RayTiles::new(device, plan, size)?,
            gbuffer: GBuffer::new(device, plan, size)?,
            tiles: Tiles::new(device, plan, size)?,
            work: WorkLists::new(device, size, settings.share)?,
            lists: if plan.transparency { Some(FragmentLists::new(device, size)?) } else { None },
            radiance: target("radiance")?,
            screen: OnScreen::new(device, plan, size)?,
            sums,
            film: if is_sum { None } else { Some(target("film")?) },
            parts: settings.parts.iter().map(part).collect::<Result<_>>()?,
            paths: plan
                .paths
                .map(|paths| PathsOnDevice::new(device, paths, plan, touching, (size, settings.share)))
                .transpose()?,
            display: Display::new(device, size)?,
        })
    }
}

/// Sums of samples, as processes that render one picture together exchange them.
#[derive(Debug, Clone)]
pub struct Sums {
    /// First sample, and one past the last.
    pub samples: [u32; 2],
    /// Sums of the samples: one, or one each of even and odd samples; then the sums of [`Settings::parts`].
    pub sums: Vec<Picture>,
    /// Work counts of the rays.
    pub work: Work,
    /// As [`Rendered::dropped`].
    pub dropped: u32,
}

/// A picture in progress.
pub struct Drawing {
    /// Whether [`Device::interrupt`] may abandon a sample before it is added to the sum; the next step draws it again.
    pub interruptible: bool,
    view: View,
    /// Index of the next sample, and of its next band.
    next: [u32; 2],
    count: u32,
    /// First sample of the drawing; `end` is one past the last.
    from: u32,
    end: u32,
    /// Whether the drawing is a part whose sums another process continues.
    is_part: bool,
    times: Times,
    dropped: u32,
    work: Work,
    errors: Vec<SampleError>,
    enough: bool,
}

impl Drawing {
    fn new(view: View, count: u32) -> Self {
        Self {
            interruptible: false,
            view,
            next: [0, 0],
            count,
            from: 0,
            end: count,
            is_part: false,
            times: Times::default(),
            dropped: 0,
            work: Work::default(),
            errors: Vec::new(),
            enough: false,
        }
    }

    /// Number of completed samples.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.next[0]
    }

    /// Samples per pixel of the complete picture.
    #[must_use]
    pub fn of(&self) -> u32 {
        self.count
    }

    /// Whether all bands of the last sample are complete, and there is a sample.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.next[1] == 0 && self.next[0] > 0
    }

    /// Whether the drawing is complete.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.enough || self.next[0] == self.end
    }
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

    /// Uploads a prepared scene and prefilters its environment; environment and settings must be those of the preparation.
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
        match (&mut plan.paths, settings.max_error) {
            (Some(paths), wanted) => {
                paths.at_once = settings.paths_at_once;
                plan.samples = if wanted.is_some() { MOST_SAMPLES } else { plan.samples };
            }
            (None, Some(wanted)) => {
                let why = format!("{wanted}: only paths tell their error, the model global follows them");
                return Err(Refused::error(Setting::MaxError, why));
            }
            (None, None) => {}
        }
        plan.check(&Ability {
            device: device.info().name.clone(),
            adds_in_subgroups: device.offers().adds_in_subgroups,
        })?;
        let most = if plan.tiles { MOST_LISTED_LIGHTS } else { MOST_LIGHTS };
        let (name, lights) = (prepared.scene.name.clone(), prepared.scene.lights.len());
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
        let turn =
            EnvironmentRotation { intensity: settings.environment_intensity, rotation: settings.environment_rotation };
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
            None => EnvironmentOnDevice::new(device, &plan, environment.or(dark.as_ref()), turn)?,
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
        let mut drawing = self.begin(camera, samples);
        while !drawing.is_done() {
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
        let mut drawing = Drawing::new(view, samples.min(self.plan.samples));
        // Shadow maps were drawn once, before the first picture.
        drawing.times.add(std::mem::take(&mut self.shadow_maps.times));
        drawing
    }

    /// Sample indices at which processes may split a picture so that their sums add up to those of one process: the first sample
    /// of each block, and the number of all samples.
    #[must_use]
    pub fn block_starts(&self) -> Vec<u32> {
        let (count, halves) = (self.plan.samples, self.halves());
        let block = block_of(count.div_ceil(halves)) * halves;
        (0..count).step_by(block as usize).chain([count]).collect()
    }

    /// Begins a part of a picture: samples `from` to before `end`, both from [`Renderer::block_starts`]. A part has sums that
    /// other processes continue, but no picture. It continues from `known`, the sums of the samples before `from`.
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
                "lighting what rays meet ({} lights, at {} surfaces) takes longer loops than the driver allows: \
                 draw with shadows=map, fewer lights, fewer interfaces, or on a device without that limit",
                self.plan.directional_lights + self.plan.local_lights,
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
        // The two halves of path tracing have independent random numbers, and so have the bands: their noise is uncorrelated
        // and partly cancels in the sum.
        let [at, half] = [index / self.halves(), index % self.halves()];
        let seed = self.settings.seed.wrapping_mul(2).wrapping_add(half).wrapping_add(band.wrapping_mul(0x9e37_79b9));
        self.rays.set_view(view, at, count, seed);
    }

    /// Number of parts of each band in pictures with dispersion, a power of two: one for each sample of a half up to a limit,
    /// which is low when rendering to a target error, so that the error can be estimated early.
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
        // Each of n samples per pixel stands for 1/n of the pixel's area, so the texture level of detail is biased by -log2(n)/2.
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
            classify(&mut frame, library, g, work)?;
        }
        light(&mut frame, lighting, g, work, radiance)?;
        background(&mut frame, lighting, g, work, radiance)?;
        if let Some(with) = plan.rays.filter(|rays| rays.mirrors || rays.refraction) {
            interact(&mut frame, lighting, with, g, &self.targets.ray_tiles, radiance, None)?;
        }
        for part in parts {
            frame.clear("reset part", &part.radiance);
            if let Some(with) = plan.rays.filter(|_| part.part.called_for(plan)) {
                interact(&mut frame, lighting, with, g, &self.targets.ray_tiles, &part.radiance, Some(part.part))?;
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
                classify_fragments(&mut frame, library, &lists.heads, &lists.work, strip.rows)?;
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

    /// The passes of a first picture from a camera, without drawing it: those before all samples, those of one sample, and those
    /// after all samples. Pipelines are created where the driver reports statistics of them.
    ///
    /// # Errors
    /// When the driver fails.
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
        for frame in [self.sample(count, 0)?, self.add(&drawing, 0)?, self.show(count, count)?] {
            frame.compile_where_told()?;
            passes.extend(frame.plan());
        }
        Ok(passes)
    }

    /// The scene-linear film of the last picture, over the background colour.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn film(&self) -> Result<Picture> {
        let mut picture = self.film_alone()?;
        self.settings.background.lay_behind(&mut picture);
        Ok(picture)
    }

    /// The film without a background colour, its coverage as alpha: the input of [`Settings::view_transform`].
    ///
    /// # Errors
    /// When the driver fails.
    pub fn film_alone(&self) -> Result<Picture> {
        self.read(self.film_on_device())
    }

    /// The film on the device, for passes of other programs: linear RGBA in f32, without a background colour.
    #[must_use]
    pub fn film_on_device(&self) -> &Image {
        let Targets { film, sums, radiance, .. } = &self.targets;
        film.as_ref().or(sums.first().map(|sum| &sum.total)).unwrap_or(radiance)
    }

    /// A part of the film of the last picture; `None` unless [`Settings::parts`] names it. Its alpha is undefined.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn part(&self, part: Part) -> Result<Option<Picture>> {
        self.targets.parts.iter().find(|kept| kept.part == part).map(|kept| self.read(kept.film())).transpose()
    }

    /// The sum of `samples` samples in blocks of `block`, read back.
    fn sum(&self, sum: &Sum, samples: u32, block: u32) -> Result<Picture> {
        let mut images = sum.images(samples, block).into_iter().flatten();
        let Some(first) = images.next() else { bail!("a sum of no samples was asked for: our mistake") };
        let mut all = self.read(first)?;
        for other in images {
            let other = self.read(other)?;
            for (sum, value) in all.rgba.iter_mut().flatten().zip(other.rgba.iter().flatten()) {
                *sum += value;
            }
        }
        Ok(all)
    }

    /// The sums of even and of odd samples, after `samples` of `count`.
    fn half_sums(&self, samples: u32, count: u32) -> Result<[Picture; 2]> {
        let (of_sums, block) = self.samples_of_sums(samples, count);
        let sum = |half: usize| self.sum(&self.targets.sums[half], of_sums[half], block);
        Ok([sum(0)?, sum(1)?])
    }

    /// Error estimate from the two halves after `samples` samples.
    fn error(&self, samples: u32, count: u32) -> Result<SampleError> {
        let [a, b] = self.half_sums(samples, count)?;
        Ok(error_of_halves([&a.rgba, &b.rgba], samples))
    }

    /// The means of the two halves of the last picture's samples, over the background colour; `None` when there is one sum.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn half_means(&self) -> Result<Option<[Picture; 2]>> {
        let mut halves = self.half_means_alone()?;
        halves.iter_mut().flatten().for_each(|half| self.settings.background.lay_behind(half));
        Ok(halves)
    }

    /// The means of the two halves without a background colour, their coverage as alpha.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn half_means_alone(&self) -> Result<Option<[Picture; 2]>> {
        if self.halves() < 2 {
            return Ok(None);
        }
        let [samples, count] = self.drawn;
        let scale = 2.0 / samples as f32;
        let mut halves = self.half_sums(samples, count)?;
        halves.iter_mut().flat_map(|half| half.rgba.iter_mut().flatten()).for_each(|value| *value *= scale);
        Ok(Some(halves))
    }

    fn write(&self, film: &Image, picture: &Picture) -> Result<()> {
        let source = Buffer::with_data(&self.device, "staging", &picture.rgba)?;
        let mut frame = Frame::new(&self.device);
        frame.upload("upload sum", &source, film, 0, &[0]);
        frame.finish().map(drop)
    }

    fn read(&self, film: &Image) -> Result<Picture> {
        let [width, height] = self.settings.size;
        let bytes = 16 * u64::from(width) * u64::from(height);
        let target = Buffer::new(&self.device, "film read back", bytes, Place::Readback)?;
        let mut frame = Frame::new(&self.device);
        frame.download("read film", film, &target);
        frame.read_back(&target);
        frame.finish()?;
        let rgba = target.read(|all| bytemuck::pod_collect_to_vec(&all[..bytes as usize]));
        Ok(Picture { width, height, rgba })
    }

    /// The G-buffer at the pixel centres as AOVs, with the view whose eye `p_rel` is relative to.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn aovs(&mut self, camera: &Camera) -> Result<(Vec<AovPixel>, View)> {
        self.surfaces(camera, false)
    }

    /// Called-for pixels: for each material of the scene, the number of pixels whose nearest surface at the centre has it, transparent ones
    /// included.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn pixels_by_material(&mut self, camera: &Camera) -> Result<Vec<u64>> {
        let (surfaces, _) = self.surfaces(camera, true)?;
        let mut counts = Vec::new();
        for material in surfaces.iter().filter_map(|pixel| (pixel.material as usize).checked_sub(1)) {
            if counts.len() <= material {
                counts.resize(material + 1, 0);
            }
            counts[material] += 1;
        }
        Ok(counts)
    }

    /// The surfaces at the pixel centres; with `all`, transparent surfaces, too.
    fn surfaces(&mut self, camera: &Camera, all: bool) -> Result<(Vec<AovPixel>, View)> {
        let [width, height] = self.settings.size;
        let view = View::new(camera, self.settings.size, self.scene.bounds);
        self.scene.set_view(&view);
        self.scene.upload_band(None);
        self.camera.write(bytemuck::bytes_of(&view.shared(jitter(0, 1))));
        let mut frame = self.frame();
        let mut draws = self.scene.draws(false, self.rays.inside());
        if all {
            draws.extend(self.scene.draws(true, self.rays.inside()));
        }
        gbuffer(&mut frame, &self.scene, &self.targets.gbuffer, 0.0, draws)?;
        frame.finish()?;
        // One readback holds as many rows as a storage buffer binding allows.
        let row_bytes = u64::from(width) * size_of::<AovPixel>() as u64;
        let rows = ((self.device.max_storage_bytes() / row_bytes) as u32).clamp(1, height);
        let pixels = Buffer::new(&self.device, "AOVs", row_bytes * u64::from(rows), Place::Readback)?;
        let mut all: Vec<AovPixel> = Vec::with_capacity(width as usize * height as usize);
        for first in (0..height).step_by(rows as usize) {
            let end = (first + rows).min(height);
            let mut frame = self.frame();
            aov(&mut frame, self.library(), &self.targets.gbuffer, &pixels, [first, end])?;
            frame.finish()?;
            let bytes = (row_bytes * u64::from(end - first)) as usize;
            all.extend(pixels.read(|words| bytemuck::pod_collect_to_vec::<u8, AovPixel>(&words[..bytes])));
        }
        Ok((all, view))
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

    /// PNG bytes of a picture.
    ///
    /// # Errors
    /// When encoding fails.
    pub fn png(&self, rendered: &Rendered) -> Result<Vec<u8>> {
        let [width, height] = self.settings.size;
        png::encode_png(width, height, &rendered.display, rendered.has_alpha)
    }
}

/// Tone maps a film that was rendered elsewhere, with these settings: RGBA8 (sRGB-encoded, rows from the top), whether it has
/// transparency, and the counts of NaN, infinite and negative pixels. `spectral` marks a film of spectral rendering.
///
/// # Errors
/// When the driver fails.
pub fn shown(
    device: &Arc<Device>,
    film: &Picture,
    settings: &Settings,
    spectral: bool,
) -> Result<(Vec<u8>, bool, Counts)> {
    let size = [film.width, film.height];
    let desc = ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, size[0], size[1], vk::ImageUsageFlags::STORAGE);
    let image = Image::new(device, "film", desc)?;
    let source = Buffer::with_data(device, "staging", &film.rgba)?;
    let display = Display::new(device, size)?;
    let mut frame = Frame::new(device);
    frame.upload("upload film", &source, &image, 0, &[0]);
    let (background, has_alpha) = display_background(settings);
    let Settings { tonemap: curve, exposure, .. } = *settings;
    tonemap(&mut frame, (&image, 1.0), &display, curve as u32, exposure, background, spectral)?;
    frame.finish()?;
    Ok((display.pixels.read(<[u8]>::to_vec), has_alpha, display.counts()?))
}

/// Display-linear colour behind the scene with alpha 1, or all 0; and whether the display output is transparent.
fn display_background(settings: &Settings) -> ([f32; 4], bool) {
    match settings.behind() {
        Some(colour) => {
            let [r, g, b] = colour.map(|light| light as f32);
            ([r, g, b, 1.0], false)
        }
        None => ([0.0; 4], true),
    }
}

/// Pass times summed by name, in order of first appearance.
#[derive(Clone, Default)]
struct Times {
    order: Vec<String>,
    sums: BTreeMap<String, f64>,
}

impl Times {
    fn add(&mut self, passes: Vec<PassTime>) {
        for PassTime { name, ms } in passes {
            if !self.sums.contains_key(&name) {
                self.order.push(name.clone());
            }
            *self.sums.entry(name).or_default() += ms;
        }
    }

    fn list(self) -> Vec<PassTime> {
        self.order.into_iter().map(|name| PassTime { ms: self.sums[&name], name }).collect()
    }
}
