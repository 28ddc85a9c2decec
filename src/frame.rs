//! The score: the whole frame, one call per pass, top to bottom. Read `Renderer::sample` first.

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
use crate::plan::{Ability, Demand, Knobs, Plan, Refused, Setting};
use crate::prepare::{Conditions, Original, Prepared};
use crate::scene::Camera;
use crate::scene::environment::Environment;
use crate::scene::wavelengths::Slice;
use crate::share::{self, AovPixel};
use crate::spectra::VISIBLE;
use crate::transport::emitters::Sky;
use crate::upload::environment::{EnvironmentOnDevice, Turn};
use crate::upload::rays::{BvhFacts, RaysOnDevice, Traversal};
use crate::upload::scene::SceneOnDevice;
use crate::upload::shared::{Library, OnDevice};
use crate::upload::view::{View, jitter};

/// Refuses what no image or buffer of the device can hold.
fn check_size(device: &Device, knobs: &Knobs, size: [u32; 2]) -> Result<()> {
    let limit = device.max_image_size();
    if size.contains(&0) || size.iter().any(|&side| side > limit) {
        let why = format!("{}x{}: a picture has 1 to {limit} pixels a side on this device", size[0], size[1]);
        return Err(Refused::error(Setting::Size, why));
    }
    let pixels = u64::from(size[0]) * u64::from(size[1]);
    // Paths keep four words of a pixel in one buffer, all else one.
    let bytes = if knobs.indirect == Indirect::Path { 16 } else { 4 };
    if pixels * bytes > device.max_storage_bytes() {
        let most = device.max_storage_bytes() / bytes;
        let why = format!("{}x{}: this device holds at most {most} pixels in one picture", size[0], size[1]);
        return Err(Refused::error(Setting::Size, why));
    }
    Ok(())
}

/// What lies behind the scene.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Background {
    /// The environment where there is one; else nothing, which a PNG shows as [`NEUTRAL_GREY`].
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
    /// Puts a background colour behind what lets it through.
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

/// Grey behind a scene without an environment, as sRGB bytes.
pub const NEUTRAL_GREY: [u8; 3] = [119; 3];

/// Lights that one invocation can loop over where the driver limits loops to 65,535 heads: one head each …
const MOST_LIGHTS: usize = 60_000;
/// … and two each, besides one a word of 32, where tiles list them.
const MOST_LISTED_LIGHTS: usize = 30_000;

/// Samples of each pixel after which a picture whose error is the end is given up.
const MOST_SAMPLES: u32 = 1 << 16;

/// Parts of a band that the samples of a picture go through, where wavelengths go different ways.
const MOST_PARTS: u32 = 64;
/// And where the picture's error is to end them.
const PARTS_BEFORE_AN_END: u32 = 8;

/// How a picture is made; everything that does not change between the frames of a sequence.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Pixels.
    pub size: [u32; 2],
    /// Rungs.
    pub knobs: Knobs,
    /// Tone curve of the display output.
    pub tonemap: ToneMap,
    /// Exposure in stops.
    pub exposure: f32,
    /// What lies behind.
    pub background: Background,
    /// Multiplies the environment.
    pub environment_intensity: f32,
    /// Turns the environment about +Y, in degrees.
    pub environment_rotation: f32,
    /// Chooses the random numbers.
    pub seed: u32,
    /// Samples are drawn until the root of [`SampleError::relmse`] is no more than this, whatever the knob says.
    pub max_error: Option<f64>,
    /// Paths take all their bounces in one dispatch: the same film, for comparison.
    pub paths_at_once: bool,
    /// The way rays go through the scene; `None`: what suits the device and the scene.
    pub traversal: Option<Traversal>,
    /// What is planned although the scene does not call for it.
    pub demand: Demand,
    /// Which parts of the picture are kept beside it, each for the price of following all rays once more.
    pub parts: Vec<Part>,
    /// Which share of the picture is drawn; the rest is black.
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
            demand: Demand::default(),
            parts: Vec::new(),
            share: TileShare::ALL,
        }
    }
}

impl Settings {
    /// What a scene in this environment is prepared for.
    ///
    /// # Errors
    /// When the background is an environment that is not there.
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
        Ok(Conditions { knobs: &self.knobs, demand: self.demand, sky, background })
    }

    /// Display-linear colour that the display output has behind the scene; `None`: it is transparent there.
    fn behind(&self) -> Option<[f64; 3]> {
        match self.background {
            Background::Color(bytes) => Some(bytes),
            Background::Transparent => None,
            Background::Default | Background::Environment => Some(NEUTRAL_GREY),
        }
        .map(|bytes| bytes.map(|byte| crate::image::tone::srgb_decode(f64::from(byte) / 255.0)))
    }

    /// What a display shows of a film of this picture.
    #[must_use]
    pub fn view_transform(&self) -> ViewTransform {
        ViewTransform { curve: self.tonemap, exposure: self.exposure, background: self.behind() }
    }
}

/// A picture that has been drawn.
pub struct Rendered {
    /// RGBA8, sRGB-encoded, rows from the top.
    pub display: Vec<u8>,
    /// Whether `display` has transparency.
    pub has_alpha: bool,
    /// Values that are no radiances, counted before anything clamped.
    pub counts: Counts,
    /// Pixels whose list of see-through fragments was too long for one invocation, in the worst sample: their farthest
    /// were left out.
    pub dropped: u32,
    /// What the rays did, summed over the samples.
    pub work: Work,
    /// GPU time per pass, summed over the samples, in the order of the frame.
    pub passes: Vec<PassTime>,
    /// Samples of each pixel.
    pub samples: u32,
    /// What halves of the samples said of the picture's error, at powers of two and at the end; of pictures by paths.
    pub errors: Vec<SampleError>,
}

/// How far a picture is.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// Samples drawn.
    pub done: u32,
    /// Of so many, or fewer where an error is the end.
    pub of: u32,
    /// The picture's error, where it has just been estimated.
    pub error: Option<SampleError>,
}

/// Work counts of a picture: the same on every machine that goes through the tree in the same way.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Work {
    /// Rays sent for a mirror image.
    pub reflection: u64,
    /// Rays sent through a surface.
    pub refraction: u64,
    /// Rays sent to lights.
    pub shadow: u64,
    /// Rays of paths.
    pub indirect: u64,
    /// Nodes met.
    pub node_visits: u64,
    /// Triangles tested.
    pub triangle_tests: u64,
    /// Boundaries of transparent bodies left without having been entered.
    pub stray_interfaces: u64,
    /// Estimates of paths that were no numbers, and left out …
    pub not_finite: u64,
    /// … and where the first of them was met.
    pub first_not_finite: Option<NotFinite>,
    /// Surfaces at which not all lights were gone through, because the driver would have ended the loop over them.
    pub lights_cut_off: u64,
    /// Light that was not followed, summed over all pixels of all frames: of each the share of its light, in parts of 65536.
    pub lost: u64,
    /// Share of a pixel's light that was not followed: the mean over all pixels of the picture …
    pub mean_lost: f64,
    /// … and the largest.
    pub most_lost: f32,
}

/// Where light came out as no number.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NotFinite {
    /// Across and down.
    pub pixel: [u32; 2],
    /// Index of the scene's.
    pub material: u32,
    /// Which surface of its path it was, counted from 1.
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
        self.stray_interfaces += sum(counts.stray_interfaces);
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

    /// The same, with the mean of a picture of so many pixels and frames.
    #[must_use]
    pub fn of(mut self, [width, height]: [u32; 2], frames: u32) -> Self {
        self.mean_lost = self.lost as f64 / 65536.0 / (f64::from(width) * f64::from(height) * f64::from(frames));
        self
    }

    /// What was done by two.
    #[must_use]
    pub fn with(self, other: &Self) -> Self {
        Self {
            reflection: self.reflection + other.reflection,
            refraction: self.refraction + other.refraction,
            shadow: self.shadow + other.shadow,
            indirect: self.indirect + other.indirect,
            node_visits: self.node_visits + other.node_visits,
            triangle_tests: self.triangle_tests + other.triangle_tests,
            stray_interfaces: self.stray_interfaces + other.stray_interfaces,
            not_finite: self.not_finite + other.not_finite,
            first_not_finite: self.first_not_finite.or(other.first_not_finite),
            lights_cut_off: self.lights_cut_off + other.lights_cut_off,
            lost: self.lost + other.lost,
            mean_lost: 0.0,
            most_lost: self.most_lost.max(other.most_lost),
        }
    }
}

/// A scene on a device, ready to be drawn from any camera.
pub struct Renderer {
    device: Arc<Device>,
    plan: Plan,
    /// What rays find odd about the scene, a sentence each.
    pub warnings: Vec<String>,
    settings: Settings,
    scene: SceneOnDevice,
    rays: RaysOnDevice,
    shadow_maps: ShadowMaps,
    environment: EnvironmentOnDevice,
    targets: Targets,
    camera: Buffer,
    /// What all programs read of the scene.
    sets: [DescriptorSet; 2],
    /// Samples of the last picture, and those of the whole one.
    drawn: [u32; 2],
}

/// All that is as large as the picture.
struct Targets {
    ray_tiles: RayTiles,
    gbuffer: GBuffer,
    tiles: Tiles,
    work: WorkLists,
    lists: Option<FragmentLists>,
    radiance: Image,
    screen: OnScreen,
    /// Of the samples, where there is more than one; of pictures by paths of the even and of the odd ones, whose random numbers have
    /// nothing in common: what they differ by is the picture's error.
    sums: Vec<Sum>,
    /// The mean of the samples, where it is no sum of them.
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
            lists: if plan.see_through { Some(FragmentLists::new(device, size)?) } else { None },
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

/// What processes that draw a picture together hand to each other.
#[derive(Debug, Clone)]
pub struct Sums {
    /// From which sample, up to which.
    pub samples: [u32; 2],
    /// Sums of the samples: one, or those of the even and of the odd ones; then those of [`Settings::parts`].
    pub sums: Vec<Picture>,
    /// What rays did.
    pub work: Work,
    /// As [`Rendered::dropped`].
    pub dropped: u32,
}

/// A picture under way.
pub struct Drawing {
    /// A sample may be given up before it is added to the others ([`Device::interrupt`]): the next step draws it again.
    pub interruptible: bool,
    view: View,
    /// The sample and the band of it that come next, and of how many samples.
    next: [u32; 2],
    count: u32,
    /// The first sample, and that before which it ends.
    from: u32,
    end: u32,
    /// For sums that others go on with.
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

    /// Samples drawn.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.next[0]
    }

    /// Samples of each pixel that the whole picture has.
    #[must_use]
    pub fn of(&self) -> u32 {
        self.count
    }

    /// Whether no sample is under way, of which some bands were drawn.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.next[1] == 0 && self.next[0] > 0
    }

    /// Whether nothing is left to be drawn.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.enough || self.next[0] == self.end
    }
}

impl Renderer {
    /// Plans, uploads and prefilters.
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

    /// Uploads and prefilters what has been prepared, with the environment and the settings that it was prepared for.
    ///
    /// # Errors
    /// When the size is out of range, the device cannot do what the plan asks for, or the scene does not fit it.
    pub fn of(
        device: &Arc<Device>,
        prepared: Prepared,
        environment: Option<&Environment>,
        settings: Settings,
    ) -> Result<Self> {
        Self::after(None, device, prepared, environment, settings)
    }

    /// Another moment of the scene, in the same environment and with the same settings: what has not changed stays on the device.
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
        // What stands for an environment that is asked for and is not there.
        let dark = (plan.environment && environment.is_none()).then(Environment::dark);
        let turn = Turn { intensity: settings.environment_intensity, rotation: settings.environment_rotation };
        let touching = rays.constants.touching;
        // Where the same is done, what it is done with is as large and as it was.
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

    /// Draws the scene from a camera.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn render(&mut self, camera: &Camera, progress: &mut dyn FnMut(Progress)) -> Result<Rendered> {
        self.render_samples(camera, self.plan.samples, progress)
    }

    /// The same with fewer samples of each pixel than the plan has.
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

    /// What will be done and why.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// A picture from a camera, of which nothing is drawn yet, of so many samples of each pixel, or as many as the plan has.
    pub fn begin(&mut self, camera: &Camera, samples: u32) -> Drawing {
        let view = View::new(camera, self.settings.size, self.scene.bounds);
        self.scene.look_from(&view);
        let mut drawing = Drawing::new(view, samples.min(self.plan.samples));
        // Drawn once, before the first picture.
        drawing.times.add(std::mem::take(&mut self.shadow_maps.times));
        drawing
    }

    /// Which samples a process can draw by itself so that the sums of all of them are those of one: the first sample of each block, and
    /// the number of all.
    #[must_use]
    pub fn block_starts(&self) -> Vec<u32> {
        let (count, halves) = (self.plan.samples, self.halves());
        let block = block_of(count.div_ceil(halves)) * halves;
        (0..count).step_by(block as usize).chain([count]).collect()
    }

    /// The same picture of which only samples `from` up to `end` are drawn, both out of [`Renderer::block_starts`], for sums that others
    /// go on with: there is no picture of them. What is known of them goes on from `known`, which holds the samples up to `from`.
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

    /// Sums on the device, those of parts last.
    fn sums_on_device(&self) -> Vec<&Image> {
        let Targets { sums, parts, radiance, .. } = &self.targets;
        let own: Vec<&Image> = sums.iter().map(|sum| &sum.total).collect();
        let own = if own.is_empty() { vec![radiance] } else { own };
        own.into_iter().chain(parts.iter().map(PartOnDevice::film)).collect()
    }

    /// What a drawing of a part has made so far, where a block has just ended.
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
        self.show_band(band, index, count);
        // A frame whose see-through fragments did not fit is drawn again with more room.
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
        // Before all parts of the bands were drawn, halves do not know what is missing.
        let whole = done >= 2 * self.parts(count);
        drawing.enough = error.is_some_and(|error| whole && limit > 0.0 && error.relmse.sqrt() <= limit);
        Ok(())
    }

    /// What is there of a picture: the mean of the samples drawn, at least one.
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

    /// Another size for the pictures to come.
    ///
    /// # Errors
    /// When the size is out of range, or memory is short: the old size stays.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<()> {
        check_size(&self.device, &self.settings.knobs, size)?;
        let settings = Settings { size, ..self.settings.clone() };
        self.targets = Targets::new(&self.device, &self.plan, &settings, self.rays.constants.touching)?;
        self.settings = settings;
        Ok(())
    }

    /// Tone curve and exposure of what is shown from now on.
    pub fn develop(&mut self, tonemap: ToneMap, exposure: f32) {
        self.settings.tonemap = tonemap;
        self.settings.exposure = exposure;
    }

    /// Where the next frame is seen from.
    fn look(&mut self, view: &View, index: u32, count: u32, band: u32) {
        let TileShare { index: first, of } = self.settings.share;
        let camera = share::Camera { tiles: [first, of], ..view.shared(jitter(index, count)) };
        self.camera.write(bytemuck::bytes_of(&camera));
        // Halves of a picture by paths have random numbers of their own, and so has each band: what is noise in one is none in
        // another, and their sum has less of it.
        let [at, half] = [index / self.halves(), index % self.halves()];
        let seed = self.settings.seed.wrapping_mul(2).wrapping_add(half).wrapping_add(band.wrapping_mul(0x9e37_79b9));
        self.rays.look_from(view, at, count, seed);
    }

    /// What goes another way for each wavelength is drawn for parts of each band, one for each sample of a half: as many as there
    /// are, up to a limit; where an error is the end, so few that it may be told early.
    fn parts(&self, count: u32) -> u32 {
        let halves = self.halves();
        let limit = if self.settings.max_error.is_some() { PARTS_BEFORE_AN_END } else { MOST_PARTS };
        let most = if self.plan.disperses { (count / halves).clamp(1, limit) } else { 1 };
        1 << most.ilog2()
    }

    /// The wavelengths of the next frame, where the picture is drawn by them.
    fn show_band(&mut self, band: u32, index: u32, count: u32) {
        let bands = self.plan.bands;
        if bands == 0 {
            return;
        }
        let band = VISIBLE.part(band, bands);
        let parts = self.parts(count);
        let at = (index / self.halves()) % parts;
        let part = if parts > 1 { at.reverse_bits() >> (32 - parts.ilog2()) } else { 0 };
        self.scene.show(Some(&Slice::new(band, band.part(part, parts))));
    }

    fn on_device(&self) -> OnDevice<'_> {
        let Self { camera, scene, rays, shadow_maps, environment, .. } = self;
        OnDevice { camera, scene, rays, shadow_depth: shadow_maps.depth(), environment }
    }

    /// An empty frame whose programs read the scene.
    fn frame(&self) -> Frame<'_> {
        Frame::of(&self.device, self.on_device().bind(&self.sets))
    }

    /// What programs are specialised by.
    fn library(&self) -> Library {
        let mut library = self.on_device().library(&self.plan, &self.settings.knobs, self.targets.tiles.words());
        library.own_tiles.shared_picture = self.settings.share != TileShare::ALL;
        library
    }

    /// One sample of every pixel, or one band of it: the frame, pass by pass.
    fn sample(&self, count: u32, band: u32) -> Result<Frame<'_>> {
        let Self { plan, scene, rays, targets, .. } = self;
        let Targets { gbuffer: g, tiles: lists_of_lights, work, lists, radiance, parts, screen, .. } = targets;
        // With n samples a pixel each one stands for 1/n of its area: textures are read that much sharper.
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
        // What is where is the same in all bands.
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
        if plan.screen.mirrors || plan.screen.see_through_mirrors {
            screen_tiles(&mut frame, lighting, g, screen)?;
        }
        if plan.screen.mirrors {
            frame.download("copy radiance", radiance, &screen.seen);
            mirror(&mut frame, lighting, g, &self.targets.ray_tiles, screen, radiance)?;
        }
        if plan.screen.refraction || plan.screen.see_through_mirrors {
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

    /// How many sums the samples go to by turns.
    fn halves(&self) -> u32 {
        self.targets.sums.len().max(1) as u32
    }

    /// Samples that each sum has after so many of `count`, and those of a block.
    fn samples_of_sums(&self, samples: u32, count: u32) -> (Vec<u32>, u32) {
        let halves = self.halves();
        ((0..halves).map(|half| (samples + halves - 1 - half) / halves).collect(), block_of(count.div_ceil(halves)))
    }

    /// Adds the sample, or one band of it, to its sum, and to those of parts.
    fn add(&self, drawing: &Drawing, band: u32) -> Result<Frame<'_>> {
        let mut frame = Frame::new(&self.device);
        let &Drawing { next: [index, _], count, from, .. } = drawing;
        let Targets { sums, film, radiance, parts, .. } = &self.targets;
        let (bands, halves) = (self.plan.bands, self.halves());
        let block = block_of(count.div_ceil(halves));
        let sample = Sample { index: index / halves, block, begins: band == 0, ends: band + 1 == bands.max(1) };
        // A sum that is the film as well becomes the mean with its last sample.
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

    /// The film as a display shows it, after so many of the samples.
    fn show(&self, samples: u32, count: u32) -> Result<Frame<'_>> {
        let mut frame = Frame::new(&self.device);
        let Targets { sums, film, display, .. } = &self.targets;
        // Before the last sample a film that is the sum is no mean yet.
        let is_sum = film.is_none() && !sums.is_empty() && samples < count;
        let scale = if is_sum { 1.0 / samples as f32 } else { 1.0 };
        let film = self.film_on_device();
        let (background, _) = display_background(&self.settings);
        let Settings { tonemap: curve, exposure, .. } = self.settings;
        tonemap(&mut frame, (film, scale), display, curve as u32, exposure, background, self.plan.bands > 0)?;
        Ok(frame)
    }

    /// The passes of a first picture from a camera, without drawing it: those before all samples, with the pipelines that exist
    /// already, those of one sample, and those after.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn passes(&mut self, camera: &Camera) -> Result<Vec<PassPlan>> {
        let count = self.plan.samples;
        let view = View::new(camera, self.settings.size, self.scene.bounds);
        self.scene.look_from(&view);
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

    /// The scene-linear film of the last render.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn film(&self) -> Result<Picture> {
        let mut picture = self.film_alone()?;
        self.settings.background.lay_behind(&mut picture);
        Ok(picture)
    }

    /// The same with its coverage as alpha, without a background colour: what [`Settings::view_transform`] takes.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn film_alone(&self) -> Result<Picture> {
        self.read(self.film_on_device())
    }

    /// The same where it lies, for passes of one's own: linear RGBA in f32, without a background colour.
    #[must_use]
    pub fn film_on_device(&self) -> &Image {
        let Targets { film, sums, radiance, .. } = &self.targets;
        film.as_ref().or(sums.first().map(|sum| &sum.total)).unwrap_or(radiance)
    }

    /// A part of the film of the last render; `None` where [`Settings::parts`] does not name it. Its alpha means nothing.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn part(&self, part: Part) -> Result<Option<Picture>> {
        self.targets.parts.iter().find(|kept| kept.part == part).map(|kept| self.read(kept.film())).transpose()
    }

    /// A sum of so many samples in blocks of so many.
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

    /// The sums of the even and of the odd samples, after so many of `count`.
    fn half_sums(&self, samples: u32, count: u32) -> Result<[Picture; 2]> {
        let (of_sums, block) = self.samples_of_sums(samples, count);
        let sum = |half: usize| self.sum(&self.targets.sums[half], of_sums[half], block);
        Ok([sum(0)?, sum(1)?])
    }

    /// What the halves say of the picture's error after so many samples.
    fn error(&self, samples: u32, count: u32) -> Result<SampleError> {
        let [a, b] = self.half_sums(samples, count)?;
        Ok(error_of_halves([&a.rgba, &b.rgba], samples))
    }

    /// The means of the two halves of the last render's samples; `None` where it has none.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn half_means(&self) -> Result<Option<[Picture; 2]>> {
        let mut halves = self.half_means_alone()?;
        halves.iter_mut().flatten().for_each(|half| self.settings.background.lay_behind(half));
        Ok(halves)
    }

    /// The same with their coverage as alpha, without a background colour.
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

    /// The G-buffer at the pixel centres, with the eye that `p_rel` is relative to.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn aovs(&mut self, camera: &Camera) -> Result<(Vec<AovPixel>, View)> {
        self.surfaces(camera, false)
    }

    /// For each material of the scene, the pixels whose centre shows it nearest, whatever it lets through.
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

    /// What lies at the pixel centres; with `all`, what is laid over the picture as well.
    fn surfaces(&mut self, camera: &Camera, all: bool) -> Result<(Vec<AovPixel>, View)> {
        let [width, height] = self.settings.size;
        let view = View::new(camera, self.settings.size, self.scene.bounds);
        self.scene.look_from(&view);
        self.scene.show(None);
        self.camera.write(bytemuck::bytes_of(&view.shared(jitter(0, 1))));
        let mut frame = self.frame();
        let mut draws = self.scene.draws(false, self.rays.inside());
        if all {
            draws.extend(self.scene.draws(true, self.rays.inside()));
        }
        gbuffer(&mut frame, &self.scene, &self.targets.gbuffer, 0.0, draws)?;
        frame.finish()?;
        // As many rows at a time as one storage buffer holds.
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

    /// The hierarchy that rays go through, if there is one.
    #[must_use]
    pub fn bvh(&self) -> Option<BvhFacts> {
        self.rays.facts
    }

    /// The device it draws on.
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

/// What a display shows of a film that was made elsewhere, as a renderer with these settings would show it: RGBA8 (sRGB-encoded, rows
/// from the top), whether it has transparency, and the counts of NaN, infinite and negative pixels. A film by wavelengths is `spectral`.
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

/// Display-linear colour behind the scene with alpha 1, or all 0, and whether the display output is transparent.
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
