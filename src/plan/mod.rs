//! The plan: what a scene calls for, with the reason, before any Vulkan object exists. Pure and printable.

mod ability;
mod effect;
mod knobs;
mod left_out;
mod surfaces;

pub use ability::Ability;
pub use effect::{Demand, Effect, Evidence};
pub use knobs::{KNOBS, Knob, Knobs, Model};
pub use surfaces::{casts_in_maps, is_see_through, mirrors};

use effect::{Cause, Decisions};
use left_out::left_out;
use surfaces::{Surfaces, by_wavelength, has_layers, refracts, scatters};

use crate::scene::caustics::{SMOOTHEST, is_smooth};
use crate::scene::lobe::LOBES;
use crate::scene::normal_form::NormalForm;
use crate::scene::solid::{Solids, deepest_nesting, solids};
use crate::scene::{AlphaMode, Light, LightKind, Material, Scene};

/// Which passes and which code a scene needs under the chosen knobs.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// A G-buffer target for emissive texels: some material has an emissive texture.
    pub emissive: bool,
    /// A G-buffer target for clear-coat and specular texels and the coat's normal.
    pub layers: bool,
    /// Code for the clear coat.
    pub clearcoat: bool,
    /// Code for metals given by n and κ.
    pub conductors: bool,
    /// Code for lobes of extensions, a bit each in the order of [`LOBES`].
    pub lobes: u32,
    /// What was asked for beside what the scene calls for.
    pub demand: Demand,
    /// There is an environment: rays that leave the scene see it, whatever surfaces do.
    pub environment: bool,
    /// The environment is seen in surfaces.
    pub reflection: bool,
    /// It is not the same everywhere: its averages over lobes are made beforehand.
    pub prefilter: bool,
    /// The environment's irradiance lights diffuse surfaces.
    pub ambient: bool,
    /// The environment is seen behind it.
    pub sky: bool,
    /// Passes for alpha-blended and transmissive surfaces.
    pub see_through: bool,
    /// Which lights of the scene there are.
    pub lights: Vec<bool>,
    /// Directional ones among them.
    pub directional_lights: u32,
    /// Point and spot lights.
    pub local_lights: u32,
    /// Lists of lights per tile.
    pub tiles: bool,
    /// The table of directional reflectance: for an environment, or to make up for single scattering.
    pub reflectance: bool,
    /// Lights are looked for in depth maps drawn from where they are.
    pub shadow_maps: bool,
    /// Rays, and the hierarchy of the scene's triangles that they go through; `None` where nothing sends any.
    pub rays: Option<Rays>,
    /// Paths of light, which take the place of all other passes that light surfaces; `None`: light comes straight from lights,
    /// and by rays from what is smooth.
    pub paths: Option<Paths>,
    /// What is looked up in the picture itself.
    pub screen: Screen,
    /// Perceptual roughness up to which surfaces are mirrored by rays or on the screen, and not by the prefiltered
    /// environment.
    pub roughest_mirror: f32,
    /// Bands of wavelengths that the picture is drawn in, one after the other; 0: red, green and blue at once.
    pub bands: u32,
    /// Rays of different wavelengths go different ways: the samples go through parts of each band.
    pub disperses: bool,
    /// How the G-buffer keeps what is lit out of it; paths light nothing out of it.
    pub stored: Stored,
    /// Samples per pixel.
    pub samples: u32,
    /// Every effect with its reason.
    pub effects: Vec<Effect>,
    /// Textures and texture coordinates of the scene that are neither decoded nor uploaded, and why, a sentence each.
    pub unread: Vec<String>,
    /// What the chosen rungs leave out of this scene, a sentence each.
    pub warnings: Vec<String>,
}

/// What sends rays and what they may meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rays {
    /// Lights are looked for by rays.
    pub shadows: bool,
    /// Surfaces up to [`Plan::roughest_mirror`] mirror the scene.
    pub mirrors: bool,
    /// Transmissive surfaces refract; they are in the G-buffer.
    pub refraction: bool,
    /// Transmissive surfaces may be hit.
    pub transmissive: bool,
    /// Surfaces with holes may be hit.
    pub masked: bool,
    /// Masked, blended or transmissive surfaces may lie before a light.
    pub filters: bool,
    /// Some surface that sends rays is rough: they are drawn from its lobe.
    pub rough: bool,
    /// Some surface that paths go through is rough.
    pub frosted: bool,
    /// Absorption: 0 off, 1 by the nominal thickness, 2 along the path.
    pub absorption: u32,
    /// How media that vary are gone through.
    pub march: March,
    /// Surfaces that a path may meet.
    pub interfaces: u32,
    /// Textures, coordinates and colours are kept for what rays meet, whether or not there are any.
    pub textures: bool,
}

/// How the G-buffer keeps normals and positions (knobs `normals` and `position`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Stored {
    /// As octahedra of so many bits, or in floats.
    pub normals: Normals,
    /// Positions themselves, and not their depth alone.
    pub positions: bool,
}

impl Stored {
    fn of(knobs: &Knobs) -> Self {
        let normals = match knobs.rung("normals") {
            "oct16" => Normals::Oct16,
            "oct24" => Normals::Oct24,
            "f32" => Normals::F32,
            _ => Normals::Oct32,
        };
        Self { normals, positions: knobs.rung("position") == "stored" }
    }
}

/// The rungs of the knob `normals`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Normals {
    /// 2 x 8 bits each.
    Oct16,
    /// 2 x 12 bits each.
    Oct24,
    /// 2 x 16 bits each.
    #[default]
    Oct32,
    /// Two floats each.
    F32,
}

impl Normals {
    /// Steps on each side of 0 that octahedra are rounded to before they are stored; 0: what they are stored in decides.
    #[must_use]
    pub fn steps(self) -> u32 {
        match self {
            Self::Oct16 => (1 << 7) - 1,
            Self::Oct24 => (1 << 11) - 1,
            Self::Oct32 | Self::F32 => 0,
        }
    }

    /// |n − stored n|² that storing accounts for, at least twice the largest (numerics 16: 0.95°, 0.059°, 0.0037°): what a normal
    /// texture bends less than that is lost.
    #[must_use]
    pub fn error2(self) -> f32 {
        match self {
            Self::Oct16 => 1e-3,
            Self::Oct24 => 4e-6,
            Self::Oct32 | Self::F32 => 1e-7,
        }
    }
}

/// How paths of light go on (knob `indirect`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Paths {
    /// What emits lights the scene (knob `lights`); else it is only seen.
    pub emitting: bool,
    /// Some light has a shape.
    pub shaped: bool,
    /// They aim at what light left last before it came to where they are.
    pub aimed: bool,
    /// All bounces in one dispatch: the same film, for comparison.
    pub at_once: bool,
}

/// How segments of paths go through grids of σ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct March {
    /// Steps of each segment, a multiple of 4; 0: no grid is marched.
    pub steps: u32,
    /// Place of the rung in the knob `quadrature`: `QUADRATURE_…` of shaders/lib/medium.glsl.
    pub rule: u32,
    /// Some grid has values for red, green and blue.
    pub colours: bool,
}

/// What is looked up in the picture of the opaque surfaces: the rungs `screen` of `reflection` and `refraction`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Screen {
    /// Smooth opaque surfaces mirror what is on it …
    pub mirrors: bool,
    /// … and so do the nearest see-through ones.
    pub see_through_mirrors: bool,
    /// Transmissive bodies show what lies on it where a bent ray leaves them; they are see-through surfaces.
    pub refraction: bool,
}

/// What is known of a scene beside what it says.
#[derive(Debug, Clone, Default)]
pub struct Facts {
    /// Which surfaces enclose a medium.
    pub solids: Solids,
    /// How many of those one point may be in, at most.
    pub nesting: usize,
    /// What was said more simply.
    pub form: NormalForm,
}

impl Facts {
    /// Of a scene in normal form.
    #[must_use]
    pub fn of(scene: &Scene, form: NormalForm) -> Self {
        let solids = solids(scene);
        Self { nesting: deepest_nesting(scene, &solids), solids, form }
    }
}

/// What is known beside the scene.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings {
    /// There is an environment that lights the scene.
    pub environment: bool,
    /// The same light comes from everywhere.
    pub constant: bool,
    /// All its light is grey.
    pub grey: bool,
    /// It is also the background.
    pub sky: bool,
    /// What is asked for beside what the scene calls for.
    pub demand: Demand,
}

/// Perceptual roughness up to which surfaces are mirrored on the screen.
const ROUGHEST_ON_SCREEN: f32 = 0.2;

/// From this many point and spot lights on, tiles list them (docs/decisions/light-lists.md).
const TILES_FROM: u32 = 16;

/// Place of the rung `path` in the knob `absorption`; the rungs `march` do as it does where nothing varies.
const PATH: u32 = 2;

/// What all parts of a plan are decided from.
struct Planner<'a> {
    scene: &'a Scene,
    facts: &'a Facts,
    surfaces: Surfaces<'a>,
    knobs: &'a Knobs,
    surroundings: Surroundings,
    decisions: Decisions<'a>,
    /// Paths take the place of what else lights surfaces.
    paths: bool,
}

impl Plan {
    /// Decides from values, not names. `scene` is in normal form, and `facts` are of it.
    #[must_use]
    pub fn new(scene: &Scene, facts: &Facts, surroundings: Surroundings, knobs: &Knobs) -> Self {
        let surfaces = Surfaces::of(scene, facts);
        let decisions = Decisions { knobs, demand: surroundings.demand, effects: Vec::new() };
        let paths = knobs.rung("indirect") == "path";
        let mut planner = Planner { scene, facts, surfaces, knobs, surroundings, decisions, paths };
        let layers = planner.layers();
        let transmission = planner.transmission();
        let images = planner.mirror_images(&transmission);
        let paths = planner.paths();
        let lights = planner.lights(paths);
        let rays = planner.rays(&transmission, &images, &lights);
        let (bands, disperses) = planner.wavelengths(&transmission);
        let shadow_maps = lights.shadows && knobs.rung("shadows") == "map" && paths.is_none();
        let stored = if paths.is_some() { Stored::default() } else { Stored::of(knobs) };
        let Planner { surfaces, decisions, .. } = planner;
        Self {
            emissive: layers.emissive,
            layers: layers.layers,
            clearcoat: layers.clearcoat,
            conductors: layers.conductors,
            lobes: layers.lobes,
            demand: surroundings.demand,
            environment: images.environment,
            reflection: images.mirrored,
            prefilter: images.prefilter,
            ambient: images.ambient,
            sky: surroundings.sky,
            see_through: transmission.see_through,
            directional_lights: lights.directional,
            local_lights: lights.local,
            tiles: lights.tiles,
            reflectance: images.mirrored
                || images.ambient
                || images.screen != Screen::default()
                || (surroundings.demand == Demand::Full && paths.is_none())
                || knobs.rung("brdf") == "ggx-multi"
                || layers.lobes != 0,
            shadow_maps,
            lights: lights.kept,
            rays,
            paths,
            screen: images.screen,
            roughest_mirror: images.roughest,
            bands,
            disperses,
            stored,
            samples: knobs.samples(),
            effects: decisions.effects,
            unread: scene.unread.clone(),
            warnings: left_out(&surfaces, knobs, &transmission, shadow_maps),
        }
    }

    /// How segments go through grids of σ.
    #[must_use]
    pub fn march(&self) -> March {
        self.rays.map_or_else(March::default, |rays| rays.march)
    }

    /// Whether the same is done for both, whatever their reasons.
    #[must_use]
    pub fn draws_as(&self, other: &Self) -> bool {
        let work = |plan: &Self| Self {
            demand: Demand::Scene,
            lights: Vec::new(),
            effects: Vec::new(),
            warnings: Vec::new(),
            ..plan.clone()
        };
        work(self) == work(other)
    }

    /// Enters into the account what only the hierarchy of triangles tells: whether transparent bodies lie against other
    /// surfaces. No demand includes that: what touches is another picture.
    pub fn found_touching(&mut self, touching: bool) {
        self.effects.push(Effect {
            name: "bodies that touch",
            state: if touching { "kept" } else { "not called for" },
            rung: "",
            reason: match touching {
                true => "some transparent body lies against another surface",
                false => "no transparent body lies against another surface",
            }
            .to_owned(),
            evidence: Evidence::new(),
            materials: Vec::new(),
        });
    }
}

struct Layers {
    emissive: bool,
    clearcoat: bool,
    layers: bool,
    conductors: bool,
    lobes: u32,
}

/// What lets light through, and how.
struct Transmission {
    /// A knob shows it bent …
    bends: bool,
    /// … by rays.
    by_rays: bool,
    see_through: bool,
    march: March,
}

struct MirrorImages {
    environment: bool,
    mirrored: bool,
    prefilter: bool,
    ambient: bool,
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
    fn layers(&mut self) -> Layers {
        let Self { surfaces, decisions, .. } = self;
        let emits = |m: &Material| m.emissive_texture.is_some() && m.emissive != [0.0; 3];
        let cause = surfaces.cause(emits, |_| "has an emissive texture".to_owned());
        let emissive = decisions.decide("emissive textures", cause);
        let cause = surfaces.cause(|m| m.clearcoat > 0.0, |m| format!("has clearcoat {}", m.clearcoat));
        let clearcoat = decisions.decide("clear coat", cause);
        let cause =
            surfaces.cause(|m| has_layers(m) || m.clearcoat > 0.0, |_| "has a coat or layer textures".to_owned());
        let layers = decisions.decide("layers", cause);
        let cause =
            surfaces.cause(|m| m.conductor.is_some() && m.metallic > 0.0, |_| "is a metal with n and kappa".to_owned());
        let conductors = decisions.decide("metals by n and kappa", cause);
        let mut lobes = 0;
        for (place, lobe) in LOBES.iter().enumerate() {
            let is_on = |m: &Material| !m.unlit && lobe.is_on(&m.lobes[place]);
            let cause = surfaces.cause(is_on, |m| lobe.says(&m.lobes[place]));
            lobes |= u32::from(decisions.decide(lobe.name, cause)) << place;
        }
        // A coat's numbers lie in the layers.
        Layers { emissive, clearcoat, layers: layers || clearcoat, conductors, lobes }
    }

    fn transmission(&mut self) -> Transmission {
        let Self { facts, surfaces, decisions, knobs, surroundings, paths, .. } = self;
        let rung = knobs.rung("refraction");
        let cause = surfaces.cause(refracts, |m| surfaces.body(m));
        let cause = if cause.called_for { cause.with("bodies in each other at most", facts.nesting) } else { cause };
        let bends = decisions.decide_with("refraction", "refraction", rung != "off", cause);
        let by_rays = bends && rung == "ray";
        let cause = surfaces.cause(
            |m| is_see_through(m, by_rays),
            |m| match m.alpha_mode {
                AlphaMode::Blend => format!("is alpha-blended, {} opaque at most", m.base_color[3]),
                _ => format!("has transmission {}", m.transmission),
            },
        );
        let see_through = decisions.decide_without(*paths, "see-through surfaces", ("", true), cause);
        let size =
            |m: &Material| m.sigma.as_ref().map_or([0; 3], |grid| grid.size()).map(|n| n.to_string()).join(" x ");
        let cause =
            surfaces.cause(|m| m.marched_sigma().is_some(), |m| format!("has a grid of {} values of sigma", size(m)));
        let grid = surfaces.find(|m| m.marched_sigma().is_some()).map(size);
        let cause = cause.with_some("grid", grid.as_slice());
        // Without rays that refract all that is transparent is a sheet.
        let (knob, allowed) = match rung == "ray" {
            true => ("absorption", knobs.march_steps() > 0),
            false => ("refraction", false),
        };
        let marched = decisions.decide_with("media that vary", knob, allowed, cause) && by_rays;
        let steps = if marched { knobs.march_steps() } else { 0 };
        let cause = Cause::when(marched, format!("{steps} steps of each segment"), "no medium is marched");
        decisions.decide_with("quadrature", "quadrature", true, cause);
        let colours = surroundings.demand == Demand::Full
            || surfaces.any(|m| m.marched_sigma().is_some_and(|grid| grid.channels() > 1));
        let march = March { steps, rule: knobs.index("quadrature"), colours: marched && colours };
        Transmission { bends, by_rays, see_through, march: if marched { march } else { March::default() } }
    }

    fn mirror_images(&mut self, transmission: &Transmission) -> MirrorImages {
        let Self { surfaces, decisions, knobs, surroundings, .. } = self;
        let paths = self.paths;
        let there_is = surroundings.environment;
        let cause = Cause::when(there_is, "there is an environment", "there is no environment");
        let environment = decisions.decide("environment", cause);
        let shown = |called_for: bool, against: &str| match there_is {
            true => Cause::when(called_for, "there is an environment", against),
            false => Cause::against("there is no environment"),
        };
        let rung = knobs.rung("reflection");
        let shiny = surfaces.any(|m| !m.unlit && (mirrors(m) || m.clearcoat > 0.0));
        let cause = shown(shiny, "no material in use mirrors anything");
        let reflection = decisions.decide_without(paths, "mirrored environment", ("reflection", rung != "off"), cause);
        let cause = match (reflection, there_is) {
            (false, _) => Cause::against("no environment is mirrored"),
            (_, false) => Cause::against("there is no environment"),
            _ => {
                Cause::when(!surroundings.constant, "the environment varies", "the environment is the same everywhere")
            }
        };
        let prefilter = decisions.decide("prefiltered environment", cause) && reflection;
        // A texture only lowers the factor.
        let roughest = if rung == "ray" { knobs.roughest_lobe() } else { ROUGHEST_ON_SCREEN };
        let smooth = |m: &Material| surfaces::is_smooth(m, roughest);
        let cause = surfaces.cause(smooth, |m| match (mirrors(m) && m.roughness <= roughest, m.clearcoat > 0.0) {
            (true, _) => format!("has roughness {}", m.roughness),
            (false, true) => format!("has a coat of roughness {}", m.clearcoat_roughness),
            (false, false) => "has a roughness texture".to_owned(),
        });
        let by_rung = ("reflection", matches!(rung, "screen" | "ray"));
        let mirrored = decisions.decide_without(paths, "mirrors", by_rung, cause);
        let by_rays = mirrored && rung == "ray";
        let demanded = surroundings.demand.includes("mirrors");
        let on_screen = |see_through: bool| {
            let found = surfaces.any(|m| smooth(m) && is_see_through(m, transmission.by_rays) == see_through);
            mirrored && !by_rays && (found || demanded)
        };
        let screen = Screen {
            mirrors: on_screen(false),
            see_through_mirrors: on_screen(true) && transmission.see_through,
            refraction: transmission.bends && !transmission.by_rays,
        };
        let cause = shown(surfaces.any(scatters), "no material in use scatters light");
        let by_rung = ("indirect", knobs.rung("indirect") != "off");
        let ambient = decisions.decide_without(paths, "ambient light", by_rung, cause);
        let environment = environment || reflection || ambient;
        MirrorImages { environment, mirrored: reflection, prefilter, ambient, roughest, by_rays, screen }
    }

    fn lights(&mut self, followed: Option<Paths>) -> Lights {
        let Self { scene, surfaces, decisions, knobs, surroundings, paths, .. } = self;
        let lit = surfaces.any(|m| !m.unlit);
        let bounds = scene.bounds();
        let reaches = |light: &Light| bounds.is_none_or(|bounds| light.reaches(&bounds));
        // The surfaces that it stands for light the scene themselves.
        let replaced = |light: &Light| light.stand_in && followed.is_some_and(|paths| paths.emitting);
        let useful = |light: &Light| light.shines() && reaches(light) && !replaced(light);
        let useful_lights = scene.lights.iter().filter(|light| useful(light)).count();
        // Dark ones stand for those that are asked for and not there. Beside others they would take room in shadow maps.
        let demanded = needs_lights(surroundings.demand);
        let stand_in = demanded && useful_lights == 0;
        // Of those, the first two.
        let free: Vec<&Light> = scene.lights.iter().filter(|light| stand_in && !replaced(light)).take(2).collect();
        let keeps =
            |light: &Light| free.iter().any(|kept| std::ptr::eq(*kept, light)) || (useful(light) && (lit || demanded));
        let kept: Vec<bool> = scene.lights.iter().map(keeps).collect();
        let count = |test: &dyn Fn(&LightKind) -> bool| {
            scene.lights.iter().zip(&kept).filter(|(light, kept)| **kept && test(&light.kind)).count() as u32
        };
        let directional = count(&|kind| matches!(kind, LightKind::Directional { .. }));
        let local = count(&|kind| !matches!(kind, LightKind::Directional { .. }));
        let ranged = count(&|kind| {
            matches!(kind, LightKind::Point { range: Some(_), .. } | LightKind::Spot { range: Some(_), .. })
        });
        let dark = scene.lights.iter().filter(|light| !light.shines()).count();
        let stand_ins = scene.lights.iter().filter(|light| light.shines() && replaced(light)).count();
        let cause = match (scene.lights.is_empty(), useful_lights > 0, lit) {
            (true, ..) => Cause::against("the scene has no lights"),
            (_, false, _) if stand_ins > 0 => {
                Cause::against("surfaces light in place of the lights that stand for them")
            }
            (_, false, _) if dark == scene.lights.len() => Cause::against("all lights of the scene are dark"),
            (_, false, _) => Cause::against("no light of the scene reaches anything"),
            (.., false) => Cause::against("all materials in use are unlit"),
            _ => Cause::of(format!("{directional} directional, {local} point and spot lights")),
        };
        let counts = |cause: Cause| match scene.lights.is_empty() {
            true => cause,
            false => cause
                .with("directional", directional)
                .with("local", local)
                .with("with a range", ranged)
                .with("dark", dark)
                .with("out of range", scene.lights.len() - dark - stand_ins - useful_lights),
        };
        decisions.decide("punctual lights", counts(cause.clone()));
        let shadows = decisions.decide_with("shadows", "shadows", knobs.rung("shadows") != "off", counts(cause));
        let cause = match (local >= TILES_FROM, ranged > 0) {
            (false, _) => Cause::against("few point and spot lights"),
            (_, false) => Cause::against("no light has a range"),
            _ => counts(Cause::of(format!("{ranged} of {local} point and spot lights have a range"))),
        };
        let tiles = decisions.decide_without(*paths, LIGHT_LISTS, ("", true), cause);
        Lights { kept, directional, local, shadows, tiles }
    }

    /// Light from surface to surface.
    fn paths(&mut self) -> Option<Paths> {
        let Self { scene, surfaces, decisions, knobs, surroundings, paths, .. } = self;
        let cause = match surfaces.any(|m| !m.unlit) {
            true => Cause::of("light goes from surface to surface"),
            false => Cause::when(*paths, "the knob says so", "no surface in use sends light"),
        };
        let kept = decisions.decide_with("paths", "indirect", *paths, cause);
        let sends_light = |m: &Material| match m.unlit {
            true => m.base_color[..3] != [0.0; 3],
            false => m.emissive != [0.0; 3],
        };
        let cause = match kept {
            true => surfaces.cause(sends_light, |m| if m.unlit { "is shown as it is" } else { "emits" }.to_owned()),
            false => Cause::against("no paths are followed"),
        };
        let emitting = decisions.decide_with("surfaces that light", "lights", knobs.rung("lights") != "points", cause);
        let shaped = scene.lights.iter().find(|light| light.shines() && light.extent.is_some());
        let cause = match (kept, shaped) {
            (false, _) => Cause::against("no paths are followed"),
            (_, None) => Cause::against("no light has a shape"),
            (_, Some(light)) => Cause::of(format!("light \"{}\" has a shape", light.name)),
        };
        let shaped = decisions.decide_with("lights with a shape", "lights", knobs.rung("lights") != "points", cause);
        let smooth = surfaces.cause(is_smooth, |m| {
            let does = if m.transmission > 0.0 { "bends" } else { "mirrors" };
            format!("{does} light without spreading it")
        });
        let around = surroundings.environment && !surroundings.constant;
        let cause = match (kept, emitting || around) {
            (false, _) => Cause::against("no paths are followed"),
            (_, false) => Cause::against("paths meet no light by chance"),
            _ => smooth,
        };
        let aimed = decisions.decide_with("aims", "guiding", knobs.rung("guiding") != "off", cause);
        paths.then_some(Paths { emitting, shaped, aimed, at_once: false })
    }

    /// Bands of wavelengths, and whether rays split by them.
    fn wavelengths(&mut self, transmission: &Transmission) -> (u32, bool) {
        let Self { scene, surfaces, decisions, knobs, surroundings, .. } = self;
        let bands = knobs.bands();
        let differ = |rgb: &[f32]| rgb[0] != rgb[1] || rgb[1] != rgb[2];
        let light =
            scene.lights.iter().find(|light| light.shines() && (light.spectrum.is_some() || differ(&light.color)));
        let cause = surfaces.cause(by_wavelength, |m| {
            match (&m.reflectance, &m.emission, &m.conductor) {
                (Some(_), ..) => "has a reflectance by wavelength",
                (_, Some(_), _) => "has a spectrum of its own",
                (.., Some(_)) => "is a metal with n and kappa",
                _ if m.dispersion.disperses(f64::from(m.ior)) => "has dispersion",
                _ => "is coloured",
            }
            .to_owned()
        });
        let cause = match (cause.called_for, light, surroundings.environment && !surroundings.grey) {
            (true, ..) => cause,
            _ if surfaces.with_colours().is_some() => Cause::of("vertices are coloured"),
            (_, Some(light), _) => Cause::of(format!("light \"{}\" is coloured", light.name)),
            (.., true) => Cause::of("the environment is coloured"),
            _ => Cause::against("everything is grey: all wavelengths make the same picture"),
        };
        let spectral = decisions.decide_apart("bands of wavelengths", ("colour", bands > 0), cause);
        let cause = match transmission.bends {
            true => surfaces.cause(Material::disperses, |m| {
                let n = |nm| m.dispersion.index(f64::from(m.ior), nm);
                format!("has n {:.4} at 450 nm and {:.4} at 650 nm", n(450.0), n(650.0))
            }),
            false => Cause::against("nothing is bent"),
        };
        let disperses = decisions.decide_apart("dispersion", ("colour", bands > 0), cause);
        (if spectral { bands } else { 0 }, disperses && spectral)
    }

    /// What sends rays, and the code for what they may meet.
    fn rays(&mut self, transmission: &Transmission, images: &MirrorImages, lights: &Lights) -> Option<Rays> {
        let Self { surfaces, decisions, knobs, surroundings, paths, .. } = self;
        let shadows = lights.shadows && knobs.rung("shadows") == "ray";
        let (refraction, mirrors) = (transmission.by_rays, images.by_rays);
        if !(shadows || mirrors || refraction || *paths) {
            return None;
        }
        let holes = |m: &Material| matches!(m.alpha_mode, AlphaMode::Mask(_));
        let masked = decisions.decide("holes before rays", surfaces.cause(holes, |_| "has holes".to_owned()));
        // Paths that bend are no straight way to a light.
        let lets_through = |m: &Material| {
            holes(m)
                || m.alpha_mode == AlphaMode::Blend
                || (m.transmission > 0.0 && (!*paths || m.ior == 1.0 || surfaces.is_sheet(m)))
        };
        let cause = match shadows || *paths {
            true => surfaces.cause(lets_through, |_| "lets light through".to_owned()),
            false => Cause::against("no rays look for lights"),
        };
        let filters = decisions.decide("light through surfaces", cause);
        let cause = surfaces.cause(|m| m.transmission > 0.0, |m| format!("has transmission {}", m.transmission));
        let transmissive = decisions.decide("transmission before rays", cause);
        let rough = |m: &Material| {
            let coat = m.clearcoat > 0.0 && m.clearcoat_roughness > 0.0;
            if *paths {
                let coat = m.clearcoat > 0.0 && m.clearcoat_roughness > SMOOTHEST;
                return !m.unlit
                    && (coat || (m.roughness > SMOOTHEST && (surfaces::mirrors(m) || m.transmission > 0.0)));
            }
            (mirrors && surfaces::is_smooth(m, images.roughest) && (m.roughness > 0.0 || coat))
                || (m.transmission > 0.0 && m.roughness > 0.0)
        };
        let rough = decisions
            .decide("rays by lobes", surfaces.cause(rough, |m| format!("sends rays at roughness {}", m.roughness)));
        let frosted = |m: &Material| m.transmission > 0.0 && m.roughness > SMOOTHEST;
        let cause = match *paths {
            true => surfaces.cause(frosted, |m| format!("lets light through with roughness {}", m.roughness)),
            false => Cause::against("no paths are followed"),
        };
        let frosted = decisions.decide("frosted surfaces", cause);
        let absorbs = |m: &Material| m.absorbs() && m.transmission > 0.0 && m.thickness > 0.0;
        let absorption = decisions.decide_with(
            "absorption",
            "absorption",
            knobs.rung("absorption") != "off",
            surfaces.cause(absorbs, |m| match m.marched_sigma() {
                Some(_) => "has a grid of sigma".to_owned(),
                None => format!("has attenuation distance {} m", m.attenuation_distance),
            }),
        );
        Some(Rays {
            shadows,
            mirrors,
            refraction,
            transmissive,
            masked,
            filters,
            rough,
            frosted,
            absorption: if absorption { knobs.index("absorption").min(PATH) } else { 0 },
            march: transmission.march,
            interfaces: knobs.interfaces(),
            textures: surroundings.demand == Demand::Full,
        })
    }
}

const LIGHT_LISTS: &str = "light lists per tile";

/// Whether effects are asked for that need lights: dark ones, where the scene has none.
#[must_use]
pub fn needs_lights(demand: Demand) -> bool {
    ["punctual lights", "shadows", LIGHT_LISTS].iter().any(|name| demand.includes(name))
}
