//! The planner: decides effect by effect, each with its cause.
//!
//! Read docs/plan.md. The input is a scene in canonical form with its facts; the output is a [`Plan`].

use std::cell::OnceCell;

use super::architecture::Architecture;
use super::effect::{Cause, Decisions, ForcedEffects, Verdict};
use super::facts::{Facts, Surroundings};
use super::knobs::Knobs;
use super::knobs::rungs::{
    self, Absorption, Brdf, Denoise, EffectId, Guiding, Indirect, LightSampler, Reflection, Refraction, Shadows,
};
use super::left_out::left_out;
use super::surfaces::{
    self, Surfaces, Transmission, by_wavelength, has_layers, has_lobe_texels, is_transparent, mirrors, refracts,
    scatters,
};
use super::work::{Attenuation, LightSamples, March, Paths, Plan, Rays, Screen, Stored};
use crate::scene::lobe::{LOBES, SHEEN};
use crate::scene::{AlphaMode, Bounds, Light, LightKind, Material, Scene};
use crate::transport::emitters::{bounded, is_emitter};
use crate::transport::layers::{SMOOTHEST, deflects, immerses, is_smooth};

/// Perceptual roughness up to which surfaces have screen-space reflections.
const ROUGHEST_ON_SCREEN: f32 = 0.2;

/// Number of point and spot lights from which on tiled light culling is used (docs/decisions/light-lists.md).
const TILES_FROM: u32 = 16;

/// Number of lights and emissive triangles that have a place, from which on a light hierarchy is used: two are mostly
/// the halves of one panel, for which it has the same noise in 1.07 of the time (docs/decisions/paths.md).
const HIERARCHY_FROM: usize = 3;

/// The inputs of all decisions, and the decisions so far.
struct Planner<'a> {
    scene: &'a Scene,
    facts: &'a Facts,
    surfaces: Surfaces<'a>,
    knobs: &'a Knobs,
    surroundings: Surroundings,
    decisions: Decisions,
    /// Path tracing is chosen; it replaces all other passes that light surfaces.
    paths: bool,
    /// Box about what is drawn; `None` where nothing is.
    bounds: Option<Bounds>,
}

/// Whether a light shines on some part of a box.
fn shines_on(light: &Light, bounds: Option<Bounds>) -> bool {
    light.shines() && bounds.is_none_or(|bounds| light.reaches(&bounds))
}

impl Plan {
    /// Decides from values, not names. `scene` is in canonical form, and `facts` describe it.
    #[must_use]
    pub fn new(scene: &Scene, facts: &Facts, surroundings: Surroundings, knobs: &Knobs) -> Self {
        let surfaces = Surfaces::of(scene, facts);
        let decisions = Decisions { forced: surroundings.forced, effects: Vec::new() };
        let paths = knobs.indirect == Indirect::Path;
        let bounds = scene.bounds();
        let mut planner = Planner { scene, facts, surfaces, knobs, surroundings, decisions, paths, bounds };
        let layers = planner.layers();
        let transmission = planner.transmission();
        let images = planner.mirror_images(&transmission);
        let followed = planner.path_tracing();
        let samples = planner.light_samples(followed);
        let guided = planner.path_guiding(followed, samples);
        let lights = planner.lights(samples);
        let photons = planner.caustics(followed, &lights);
        let paths = planner.paths.then_some(Paths { guided, photons });
        let rays = planner.rays(&transmission, &images, &lights, samples);
        let rough_transmission = planner.rough_transmission(&transmission, &lights, samples);
        let (bands, disperses) = planner.wavelengths(&transmission);
        let denoise = planner.denoising(followed);
        let from_points = lights.directional + lights.local > 0 && paths.is_none();
        let shadow_maps = lights.shadows && knobs.shadows == Shadows::Map && from_points;
        let stored = if paths.is_some() { Stored::default() } else { Stored::of(knobs) };
        let Planner { surfaces, decisions, .. } = planner;
        Self {
            emissive: layers.emissive,
            layers: layers.layers,
            lobe_texels: layers.lobe_texels,
            clearcoat: layers.clearcoat,
            conductors: layers.conductors,
            // n and κ of each band of wavelengths are only known when the band is rendered.
            faint_conductors: bands > 0 || scene.materials.iter().any(|m| !m.is_metallic()),
            lobes: layers.lobes,
            forced: surroundings.forced,
            environment: images.environment,
            reflection: images.mirrored,
            prefilter: images.prefilter,
            ambient: images.ambient,
            sky: surroundings.sky,
            blurred: images.blurred,
            transparency: transmission.transparency,
            directional_lights: lights.directional,
            local_lights: lights.local,
            tiles: lights.tiles,
            reflectance: images.mirrored
                || images.ambient
                || images.screen != Screen::default()
                || (surroundings.forced == ForcedEffects::All && paths.is_none())
                || knobs.brdf == Brdf::GgxMulti
                || layers.lobes & 1 << SHEEN != 0,
            shadow_maps,
            lights: lights.kept,
            rays,
            rough_transmission,
            light_samples: samples,
            paths,
            screen: images.screen,
            roughest_mirror: images.roughest,
            bands,
            disperses,
            stored,
            architecture: Architecture::default(),
            samples: knobs.samples.count(),
            denoise,
            effects: decisions.effects,
            unread: scene.unread.clone(),
            warnings: left_out(&surfaces, knobs, &transmission, shadow_maps),
        }
    }
}

struct LayerDecisions {
    emissive: bool,
    clearcoat: bool,
    layers: bool,
    lobe_texels: bool,
    conductors: bool,
    lobes: u32,
}

struct MirrorImages {
    environment: bool,
    mirrored: bool,
    prefilter: bool,
    blurred: bool,
    ambient: bool,
    /// Rays of ambient occlusion.
    occlusion: u32,
    roughest: f32,
    by_rays: bool,
    screen: Screen,
}

struct Lights {
    kept: Vec<bool>,
    directional: u32,
    local: u32,
    shadows: bool,
    tiles: bool,
}

impl Planner<'_> {
    fn layers(&mut self) -> LayerDecisions {
        let Self { surfaces, decisions, .. } = self;
        let emits = |m: &Material| m.emissive_texture.is_some() && m.emissive != [0.0; 3];
        let cause = surfaces.cause(emits, |_| "has an emissive texture".to_owned());
        let emissive = decisions.decide(EffectId::EmissiveTextures, cause);
        let cause = surfaces.cause(|m| m.clearcoat > 0.0, |m| format!("has clearcoat {}", m.clearcoat));
        let clearcoat = decisions.decide(EffectId::ClearCoat, cause);
        let cause = surfaces.cause(
            |m| has_layers(m) || m.clearcoat > 0.0,
            |_| "has a clear coat or textures of material layers".to_owned(),
        );
        let layers = decisions.decide(EffectId::Layers, cause);
        let cause = surfaces.cause(has_lobe_texels, |_| "has textures of lobes or a lobe with a direction".to_owned());
        let lobe_texels = decisions.decide(EffectId::LobeTexels, cause);
        let cause = surfaces
            .cause(|m| m.conductor.is_some() && m.metallic > 0.0, |_| "is a conductor with n and kappa".to_owned());
        let conductors = decisions.decide(EffectId::Conductors, cause);
        let mut lobes = 0;
        for (place, lobe) in LOBES.iter().enumerate() {
            let is_on = |m: &Material| !m.unlit && lobe.is_on(&m.lobes[place]);
            let cause = surfaces.cause(is_on, |m| lobe.says(&m.lobes[place]));
            lobes |= u32::from(decisions.decide(EffectId::Lobe(place), cause)) << place;
        }
        // A coat's parameters are stored in the G-buffer target of the layers.
        LayerDecisions { emissive, clearcoat, layers: layers || clearcoat, lobe_texels, conductors, lobes }
    }

    fn transmission(&mut self) -> Transmission {
        let Self { facts, surfaces, decisions, knobs, surroundings, paths, .. } = self;
        let rung = knobs.refraction;
        let cause = surfaces.cause(refracts, |m| surfaces.body(m));
        let cause = if cause.called_for { cause.with("bodies in each other at most", facts.nesting) } else { cause };
        let bends = decisions.decide_with(EffectId::Refraction, rung.choice().allows(rung != Refraction::Off), cause);
        let by_rays = bends && rung == Refraction::Ray;
        let cause = surfaces.cause(
            |m| is_transparent(m, by_rays),
            |m| match m.alpha_mode {
                AlphaMode::Blend => format!("is alpha-blended with opacity {} or less", m.base_color[3]),
                _ => format!("has transmission {}", m.transmission),
            },
        );
        let transparency = decisions.decide_unless(EffectId::Transparency, by_paths(*paths), cause);
        let size =
            |m: &Material| m.sigma.as_ref().map_or([0; 3], |grid| grid.size()).map(|n| n.to_string()).join(" x ");
        let cause =
            surfaces.cause(|m| m.marched_sigma().is_some(), |m| format!("has a grid of {} sigma values", size(m)));
        let grid = surfaces.find(|m| m.marched_sigma().is_some()).map(size);
        let cause = cause.with_some("grid", grid.as_slice());
        // Without refracting rays every transmissive surface is rendered as thin-walled.
        let by_knob = match rung == Refraction::Ray {
            true => knobs.absorption.choice().allows(knobs.absorption.steps() > 0),
            false => rung.choice().allows(false),
        };
        let marched = decisions.decide_with(EffectId::HeterogeneousMedia, by_knob, cause) && by_rays;
        let steps = if marched { knobs.absorption.steps() } else { 0 };
        let cause = Cause::when(marched, format!("{steps} steps per segment"), "no medium is ray-marched");
        decisions.decide_with(EffectId::Quadrature, knobs.quadrature.choice().allows(true), cause);
        let colours = surroundings.forced == ForcedEffects::All
            || surfaces.any(|m| m.marched_sigma().is_some_and(|grid| grid.channels() > 1));
        let march = March { steps, rule: knobs.quadrature, colours: marched && colours };
        Transmission { bends, by_rays, transparency, march: if marched { march } else { March::default() } }
    }

    fn mirror_images(&mut self, transmission: &Transmission) -> MirrorImages {
        let Self { scene, surfaces, decisions, knobs, surroundings, bounds, .. } = self;
        let paths = self.paths;
        let there_is = surroundings.environment;
        let cause = Cause::when(there_is, "there is an environment", "there is no environment");
        let environment = decisions.decide(EffectId::Environment, cause);
        // Without an environment rays of ambient occlusion find surfaces that send light: that of lamps, or their own.
        let rays = knobs.indirect.occlusion_rays();
        let lit = scene.lights.iter().any(|light| shines_on(light, *bounds))
            || (knobs.lights != rungs::Lights::Points && surfaces.any(is_emitter))
            || surfaces.any(|m| m.unlit && m.base_color[..3] != [0.0; 3]);
        let lit = rays > 0 && lit;
        let by_surfaces = !there_is && lit && surroundings.interreflection;
        let shown = |called_for: bool, against: &str| match (there_is, by_surfaces, lit) {
            (true, ..) => Cause::when(called_for, "there is an environment", against),
            (_, true, _) => Cause::when(called_for, "surfaces send light that others face", against),
            (.., true) => Cause::against("there is no environment, and no surface sends light to another one"),
            _ => Cause::against("there is no environment"),
        };
        let rung = knobs.reflection;
        let shiny = surfaces.any(|m| !m.unlit && (mirrors(m) || m.clearcoat > 0.0));
        let cause = shown(shiny, "no visible material has specular reflection");
        let reflection = decisions.decide_with(
            EffectId::EnvironmentReflection,
            unless_paths(paths, rung.choice().allows(rung != Reflection::Off)),
            cause,
        );
        // An environment that is the same everywhere is its own blur.
        let blurred = surroundings.blurred && surroundings.sky && !surroundings.constant;
        let cause = match (reflection || blurred, there_is) {
            (false, _) => Cause::against("no surface reflects the environment"),
            (_, false) => Cause::against("there is no environment"),
            _ => Cause::when(
                !surroundings.constant,
                if blurred {
                    "the environment varies, and the background is blurred"
                } else {
                    "the environment varies"
                },
                "the environment is the same in all directions",
            ),
        };
        let prefilter = decisions.decide(EffectId::PrefilteredEnvironment, cause) && (reflection || blurred);
        // A texture only lowers the factor.
        let roughest = if rung == Reflection::Ray { knobs.lobes.roughest() } else { ROUGHEST_ON_SCREEN };
        let smooth = |m: &Material| surfaces::is_smooth(m, roughest);
        let cause = surfaces.cause(smooth, |m| match (mirrors(m) && m.roughness <= roughest, m.clearcoat > 0.0) {
            (true, _) => format!("has roughness {}", m.roughness),
            (false, true) => format!("has a clear coat with roughness {}", m.clearcoat_roughness),
            (false, false) => "has a roughness texture".to_owned(),
        });
        let by_rung = rung.choice().allows(matches!(rung, Reflection::Screen | Reflection::Ray));
        let mirrored = decisions.decide_with(EffectId::Reflection, unless_paths(paths, by_rung), cause);
        let by_rays = mirrored && rung == Reflection::Ray;
        let is_forced = surroundings.forced.includes(EffectId::Reflection);
        let on_screen = |transparency: bool| {
            let found = surfaces.any(|m| smooth(m) && is_transparent(m, transmission.by_rays) == transparency);
            mirrored && !by_rays && (found || is_forced)
        };
        let screen = Screen {
            mirrors: on_screen(false),
            transparent_mirrors: on_screen(true) && transmission.transparency,
            refraction: transmission.bends && !transmission.by_rays,
        };
        let cause = shown(surfaces.any(scatters), "no visible material scatters light");
        let by_rung = knobs.indirect.choice().allows(knobs.indirect != Indirect::Off);
        let ambient = decisions.decide_with(EffectId::AmbientLight, unless_paths(paths, by_rung), cause);
        let cause = shown(ambient || reflection, "no surface is lit from all around");
        let by_rung = knobs.indirect.choice().allows(rays > 0);
        let occluded = decisions.decide_with(EffectId::AmbientOcclusion, unless_paths(paths, by_rung), cause);
        let environment = environment || (!by_surfaces && (reflection || ambient));
        let occlusion = if occluded { rays } else { 0 };
        MirrorImages {
            environment,
            mirrored: reflection,
            prefilter,
            blurred,
            ambient,
            occlusion,
            roughest,
            by_rays,
            screen,
        }
    }

    fn lights(&mut self, samples: LightSamples) -> Lights {
        let Self { scene, surfaces, decisions, knobs, surroundings, paths, bounds, .. } = self;
        let lit = surfaces.any(|m| !m.unlit);
        // The emissive surfaces behind a proxy light are lights themselves.
        let replaced = |light: &Light| light.proxy && samples.emitting;
        let useful = |light: &Light| shines_on(light, *bounds) && !replaced(light);
        let useful_lights = scene.lights.iter().filter(|light| useful(light)).count();
        // Black placeholder lights keep loops non-empty when lights are forced but absent. Beside real lights they
        // would waste shadow maps.
        let is_forced = needs_lights(surroundings.forced);
        let proxy = is_forced && useful_lights == 0;
        // At most two placeholders.
        let free: Vec<&Light> = scene.lights.iter().filter(|light| proxy && !replaced(light)).take(2).collect();
        let keeps =
            |light: &Light| free.iter().any(|kept| std::ptr::eq(*kept, light)) || (useful(light) && (lit || is_forced));
        let kept: Vec<bool> = scene.lights.iter().map(keeps).collect();
        // Paths sample every light; other models sample those with an extent and take the others one by one.
        let sampled = |light: &Light| !*paths && samples.take(light);
        let count = |test: &dyn Fn(&LightKind) -> bool| {
            let counts = |light: &Light| !sampled(light) && test(&light.kind);
            scene.lights.iter().zip(&kept).filter(|(light, kept)| **kept && counts(light)).count() as u32
        };
        let directional = count(&|kind| matches!(kind, LightKind::Directional { .. }));
        let local = count(&|kind| !matches!(kind, LightKind::Directional { .. }));
        let ranged = count(&|kind| {
            matches!(kind, LightKind::Point { range: Some(_), .. } | LightKind::Spot { range: Some(_), .. })
        });
        let dark = scene.lights.iter().filter(|light| !light.shines()).count();
        let proxies = scene.lights.iter().filter(|light| light.shines() && replaced(light)).count();
        let cause = match (scene.lights.is_empty(), useful_lights > 0, lit) {
            (true, ..) => Cause::against("the scene has no lights"),
            (_, false, _) if proxies > 0 => Cause::against("emissive surfaces replace the proxy lights"),
            (_, false, _) if dark == scene.lights.len() => Cause::against("all lights have zero intensity"),
            (_, false, _) => Cause::against("no light reaches the scene"),
            (.., false) => Cause::against("all visible materials are unlit"),
            _ if directional + local == 0 => Cause::against("all lights have an area, and are sampled"),
            _ => Cause::of(format!("{directional} directional lights, {local} point and spot lights")),
        };
        let counts = |cause: Cause| match scene.lights.is_empty() {
            true => cause,
            false => cause
                .with("directional", directional)
                .with("local", local)
                .with("with a range", ranged)
                .with("dark", dark)
                .with("out of range", scene.lights.len() - dark - proxies - useful_lights),
        };
        decisions.decide(EffectId::PunctualLights, counts(cause.clone()));
        let cause = match samples.have_extent() && !*paths && !cause.called_for {
            true => Cause::of("lights with an extent are sampled"),
            false => cause,
        };
        let shadows = decisions.decide_with(
            EffectId::Shadows,
            knobs.shadows.choice().allows(knobs.shadows != Shadows::Off),
            counts(cause),
        );
        let cause = match (local >= TILES_FROM, ranged > 0) {
            (false, _) => Cause::against("there are too few point and spot lights"),
            (_, false) => Cause::against("no light has a range"),
            _ => counts(Cause::of(format!("{ranged} of {local} point and spot lights have a range"))),
        };
        let tiles = decisions.decide_unless(EffectId::TiledLightCulling, by_paths(*paths), cause);
        Lights { kept, directional, local, shadows, tiles }
    }

    /// Path tracing: indirect light between surfaces.
    fn path_tracing(&mut self) -> bool {
        let Self { surfaces, decisions, knobs, paths, .. } = self;
        let cause = match surfaces.any(|m| !m.unlit) {
            true => Cause::of("surfaces scatter light onto each other"),
            false => Cause::when(*paths, "indirect=path is set", "no visible surface scatters light"),
        };
        decisions.decide_with(EffectId::PathTracing, knobs.indirect.choice().allows(*paths), cause)
    }

    /// Light sampling. Paths sample all lights, and find emission of any kind; other models sample lights with an
    /// extent.
    fn light_samples(&mut self, followed: bool) -> LightSamples {
        let Self { scene, surfaces, decisions, knobs, paths, bounds, .. } = self;
        let sends = |m: &Material| *paths || scatters(m) || mirrors(m) || m.clearcoat > 0.0 || transmits_roughly(m);
        let lit = surfaces.any(|m| !m.unlit && sends(m));
        let sends_light = |m: &Material| match *paths {
            true if m.unlit => m.base_color[..3] != [0.0; 3],
            true => m.emissive != [0.0; 3],
            false => is_emitter(m),
        };
        let unsampled = !*paths && surfaces.any(|m| m.emissive != [0.0; 3]) && !surfaces.any(is_emitter);
        let cause = match lit {
            _ if unsampled => Cause::against("what emits light is transparent or coated, and is not sampled"),
            true => surfaces.cause(sends_light, |m| {
                if m.unlit { "is unlit and emits its base colour" } else { "emits light" }.to_owned()
            }),
            false => Cause::against("no visible surface scatters or reflects light"),
        };
        let by_lights = knobs.lights.choice().allows(knobs.lights != rungs::Lights::Points);
        // Outside of path tracing forced samples of no light would change roundings of the loop over lights.
        let decide = if *paths { Decisions::decide_with } else { Decisions::decide_apart };
        let emitting = decide(decisions, EffectId::EmissiveLights, by_lights, cause);
        let shaped = scene.lights.iter().find(|light| shines_on(light, *bounds) && light.extent.is_some());
        let cause = match (lit, shaped) {
            (false, _) => Cause::against("no visible surface scatters or reflects light"),
            (_, None) => Cause::against("no light has an area"),
            (_, Some(light)) => Cause::of(format!("light \"{}\" has an area", light.name)),
        };
        let shaped = decide(decisions, EffectId::AreaLights, by_lights, cause);
        let is_sampled = |light: &Light| followed || (shaped && light.extent.is_some());
        let count = bounded(scene, emitting, |light| shines_on(light, *bounds) && is_sampled(light));
        let cause = match followed || emitting || shaped {
            false => Cause::against("no lights are sampled"),
            true => Cause::when(
                count >= HIERARCHY_FROM,
                format!("{count} lights and emissive triangles have a place"),
                "too few lights and emissive triangles have a place",
            ),
        };
        // Forced on few lights it would change the noise of the picture.
        let hierarchy = decisions.decide_apart(
            EffectId::LightHierarchy,
            knobs.light_sampler.choice().allows(knobs.light_sampler != LightSampler::Power),
            cause,
        );
        let count = if *paths || emitting || shaped { knobs.lights.samples() } else { 0 };
        let candidates = if hierarchy && !*paths { knobs.light_sampler.candidates() } else { 0 };
        LightSamples { emitting, shaped, hierarchy, candidates, count }
    }

    fn path_guiding(&mut self, followed: bool, samples: LightSamples) -> bool {
        let Self { surfaces, decisions, knobs, surroundings, .. } = self;
        let around = surroundings.environment && !surroundings.constant;
        let cause = match (followed, samples.emitting || around) {
            (false, _) => Cause::against("path tracing is off"),
            (_, false) => Cause::against("no light can be hit by a path"),
            _ if !surfaces.any(scatters) => Cause::against("no visible material scatters light"),
            _ => surfaces.cause(is_smooth, |m| {
                let does = if m.transmission > 0.0 { "refracts" } else { "reflects" };
                format!("{does} light specularly")
            }),
        };
        decisions.decide_with(
            EffectId::PathGuiding,
            knobs.guiding.choice().allows(knobs.guiding != Guiding::Off),
            cause,
        )
    }

    /// Photons of punctual lights in path tracing: no path reaches such a light by way of a smooth surface.
    fn caustics(&mut self, followed: bool, lights: &Lights) -> u32 {
        let Self { scene, surfaces, decisions, knobs, .. } = self;
        let immersed = surfaces.any(immerses);
        let cause = match (followed, lights.directional + lights.local) {
            (false, _) => Cause::against("path tracing is off"),
            (_, 0) => Cause::against("no punctual light shines"),
            _ => surfaces.cause(
                |m| deflects(scene, m, immersed),
                |m| {
                    let does = if m.transmission > 0.0 { "refracts or reflects" } else { "reflects" };
                    format!("{does} the light of punctual lights specularly")
                },
            ),
        };
        let photons = knobs.caustics.photons();
        let kept = decisions.decide_with(EffectId::Caustics, knobs.caustics.choice().allows(photons > 0), cause);
        if kept { photons } else { 0 }
    }

    /// Whether the picture is denoised. Halves of the samples estimate its variance, independent in path tracing.
    fn denoising(&mut self, followed: bool) -> bool {
        let Self { decisions, knobs, .. } = self;
        let cause = match (followed, knobs.samples.count()) {
            (false, _) => Cause::against("path tracing is off"),
            (_, 1) => Cause::against("one sample per pixel has no estimate of its variance"),
            _ => Cause::of("paths are drawn at random"),
        };
        let by_knob = knobs.denoise.choice().allows(knobs.denoise != Denoise::Off);
        decisions.decide_apart(EffectId::Denoising, by_knob, cause)
    }

    /// Number of bands of wavelengths, and whether dispersion splits rays by wavelength.
    fn wavelengths(&mut self, transmission: &Transmission) -> (u32, bool) {
        let Self { scene, surfaces, decisions, knobs, surroundings, bounds, .. } = self;
        let bands = knobs.colour.bands();
        let differ = |rgb: &[f32]| rgb[0] != rgb[1] || rgb[1] != rgb[2];
        let light = scene
            .lights
            .iter()
            .find(|light| shines_on(light, *bounds) && (light.spectrum.is_some() || differ(&light.color)));
        let coloured: Vec<OnceCell<bool>> = vec![OnceCell::new(); scene.images.len()];
        // Stops at the first texel with a colour, which most textures have near their start.
        let looks = |image: usize| {
            let mut texels = scene.images[image].rgba.as_chunks::<4>().0.iter();
            texels.any(|[r, g, b, _]| r != g || g != b)
        };
        let is_coloured = |image: usize| *coloured[image].get_or_init(|| looks(image));
        let cause = surfaces.cause(
            |m| by_wavelength(m, is_coloured),
            |m| {
                match (&m.reflectance, &m.emission, &m.conductor) {
                    (Some(_), ..) => "has a spectral reflectance",
                    (_, Some(_), _) => "has an emission spectrum",
                    (.., Some(_)) => "is a conductor with n and kappa",
                    _ if m.dispersion.disperses(f64::from(m.ior)) => "has dispersion",
                    _ => "is coloured",
                }
                .to_owned()
            },
        );
        let cause = match (cause.called_for, light, surroundings.environment && !surroundings.grey) {
            (true, ..) => cause,
            _ if surfaces.with_colours().is_some() => Cause::of("some vertices are coloured"),
            (_, Some(light), _) => Cause::of(format!("light \"{}\" is coloured", light.name)),
            (.., true) => Cause::of("the environment is coloured"),
            _ => Cause::against("everything is grey: all wavelengths give the same picture"),
        };
        let by_colour = knobs.colour.choice().allows(bands > 0);
        let spectral = decisions.decide_apart(EffectId::SpectralRendering, by_colour, cause);
        let cause = match transmission.bends {
            true => surfaces.cause(Material::disperses, |m| {
                let n = |nm| m.dispersion.index(f64::from(m.ior), nm);
                format!("has n = {:.4} at 450 nm and {:.4} at 650 nm", n(450.0), n(650.0))
            }),
            false => Cause::against("no surface refracts light"),
        };
        let disperses = decisions.decide_apart(EffectId::Dispersion, by_colour, cause);
        (if spectral { bands } else { 0 }, disperses && spectral)
    }

    /// Lobes of rough transmission that are evaluated: for all light of paths, and in other models for lights behind
    /// thin-walled surfaces, as which bodies are drawn where no rays refract.
    fn rough_transmission(&mut self, transmission: &Transmission, lights: &Lights, samples: LightSamples) -> bool {
        let Self { surfaces, decisions, paths, .. } = self;
        let is_thin = |m: &Material| !transmission.by_rays || surfaces.is_sheet(m);
        let transmits = |m: &Material| transmits_roughly(m) && (*paths || is_thin(m));
        let cause = match *paths || lights.directional + lights.local > 0 || samples.shaped {
            true => surfaces.cause(transmits, |m| format!("transmits light with roughness {}", m.roughness)),
            false => Cause::against("no light shines through surfaces"),
        };
        decisions.decide(EffectId::RoughTransmission, cause)
    }

    /// The kinds of rays, and the shader code for the surfaces that they can hit.
    fn rays(
        &mut self,
        transmission: &Transmission,
        images: &MirrorImages,
        lights: &Lights,
        samples: LightSamples,
    ) -> Option<Rays> {
        let Self { surfaces, decisions, knobs, surroundings, paths, .. } = self;
        // Shadow maps are drawn from points: lights with an extent cast their shadows by rays on both rungs.
        let shadows = lights.shadows && (knobs.shadows == Shadows::Ray || (samples.have_extent() && !*paths));
        let (refraction, mirrors) = (transmission.by_rays, images.by_rays);
        let occlusion = images.occlusion;
        if !(shadows || mirrors || refraction || *paths || occlusion > 0 || samples.have_extent()) {
            return None;
        }
        let holes = |m: &Material| matches!(m.alpha_mode, AlphaMode::Mask(_));
        let masked =
            decisions.decide(EffectId::AlphaTest, surfaces.cause(holes, |_| "is alpha-tested (masked)".to_owned()));
        // A path that refracts is not a straight shadow ray.
        let lets_through = |m: &Material| {
            holes(m)
                || m.alpha_mode == AlphaMode::Blend
                || (m.transmission > 0.0 && (!*paths || m.ior == 1.0 || surfaces.is_sheet(m)))
        };
        let cause = match shadows || *paths || occlusion > 0 {
            true => surfaces.cause(lets_through, |_| "is masked, blended or transmissive".to_owned()),
            false => Cause::against("no shadow rays are traced"),
        };
        let filters = decisions.decide(EffectId::TransparentShadows, cause);
        let cause = surfaces.cause(|m| m.transmission > 0.0, |m| format!("has transmission {}", m.transmission));
        let transmissive = decisions.decide(EffectId::TransmissiveHits, cause);
        let immersed = surfaces.any(immerses);
        let rough = |m: &Material| {
            let coat = m.clearcoat > 0.0 && m.clearcoat_roughness > 0.0;
            if *paths {
                let coat = m.clearcoat > 0.0 && m.clearcoat_roughness > SMOOTHEST;
                let base = surfaces::mirrors(m) || m.transmission > 0.0 || (immersed && m.ior == 1.0);
                return !m.unlit && (coat || (wider(m, SMOOTHEST) && base));
            }
            (mirrors && surfaces::is_smooth(m, images.roughest) && (wider(m, 0.0) || coat))
                || (m.transmission > 0.0 && wider(m, 0.0))
        };
        let rough = decisions.decide(
            EffectId::GlossyReflection,
            surfaces.cause(rough, |m| format!("scatters rays at roughness {}", m.roughness)),
        );
        let absorbs = |m: &Material| m.absorbs() && m.transmission > 0.0 && m.thickness > 0.0;
        let absorption = decisions.decide_with(
            EffectId::Absorption,
            knobs.absorption.choice().allows(knobs.absorption != Absorption::Off),
            surfaces.cause(absorbs, |m| match m.marched_sigma() {
                Some(_) => "has a grid of sigma".to_owned(),
                None => format!("has attenuation distance {} m", m.attenuation_distance),
            }),
        );
        Some(Rays {
            shadows,
            mirrors,
            occlusion,
            refraction,
            transmissive,
            masked,
            filters,
            rough,
            attenuation: match knobs.absorption {
                Absorption::Thickness if absorption => Attenuation::Nominal,
                _ if absorption => Attenuation::Path,
                _ => Attenuation::Off,
            },
            march: transmission.march,
            interfaces: knobs.interfaces.count(),
            textures: surroundings.forced == ForcedEffects::All,
        })
    }
}

/// Whether a surface's lobe is wider than that of a roughness. An anisotropic lobe is wide along its direction, however
/// smooth the material is across it.
fn wider(m: &Material, bound: f32) -> bool {
    m.roughness > bound || m.has_direction()
}

/// Whether a lamp behind a surface of this material may be seen in it.
fn transmits_roughly(m: &Material) -> bool {
    m.transmission > 0.0 && wider(m, SMOOTHEST)
}

/// The verdict on effects that path tracing replaces.
fn by_paths(paths: bool) -> Option<Verdict> {
    paths.then(|| Indirect::Path.choice().allows(false))
}

/// The verdict of path tracing on an effect that it replaces, or without path tracing that of another knob.
fn unless_paths(paths: bool, else_by: Verdict) -> Verdict {
    by_paths(paths).unwrap_or(else_by)
}

/// Whether a forced effect needs lights: a scene without lights then gets black placeholders.
#[must_use]
pub fn needs_lights(forced: ForcedEffects) -> bool {
    [EffectId::PunctualLights, EffectId::Shadows, EffectId::TiledLightCulling]
        .into_iter()
        .any(|effect| forced.includes(effect))
}
