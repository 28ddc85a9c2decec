//! The plan: what a scene calls for, with the reason, before any Vulkan object exists. Pure and printable.

mod knobs;

pub use knobs::{KNOBS, Knob, Knobs, Model};

use std::collections::BTreeMap;

use serde::Serialize;

use crate::scene::{AlphaMode, LightKind, Material, Scene};

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
    /// There is an environment: rays that leave the scene see it, whatever surfaces do.
    pub environment: bool,
    /// The environment is seen in surfaces.
    pub reflection: bool,
    /// The environment's irradiance lights diffuse surfaces.
    pub ambient: bool,
    /// The environment is seen behind it.
    pub sky: bool,
    /// Passes for alpha-blended and transmissive surfaces.
    pub see_through: bool,
    /// Directional lights.
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
    /// What is looked up in the picture itself.
    pub screen: Screen,
    /// Perceptual roughness up to which surfaces are mirrored by rays or on the screen, and not by the prefiltered
    /// environment.
    pub roughest_mirror: f32,
    /// Samples per pixel.
    pub samples: u32,
    /// Every effect with its reason.
    pub effects: Vec<Effect>,
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
    /// Absorption: 0 off, 1 by the nominal thickness, 2 along the path.
    pub absorption: u32,
    /// How media that vary are gone through.
    pub march: March,
    /// Surfaces that a path may meet.
    pub interfaces: u32,
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

/// One effect, kept or not, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// What it is.
    pub name: &'static str,
    /// `kept`, `dropped` (a knob says so) or `not called for` (the scene does).
    pub state: &'static str,
    /// The rung of its knob.
    pub rung: &'static str,
    /// One sentence.
    pub reason: String,
    /// What the reason rests on.
    pub evidence: BTreeMap<&'static str, String>,
}

/// What is known beside the scene.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings {
    /// There is an environment that lights the scene.
    pub environment: bool,
    /// It is also the background.
    pub sky: bool,
}

/// Whether a surface is laid over what lies behind it, in passes of its own: blended surfaces, and transmissive ones where
/// no rays refract in them (`refracting_rays`).
#[must_use]
pub fn is_see_through(material: &Material, refracting_rays: bool) -> bool {
    material.alpha_mode == AlphaMode::Blend || (material.transmission > 0.0 && !refracting_rays)
}

/// Whether a surface is drawn into shadow maps. What lets light through does not stop it there: it passes unweakened.
#[must_use]
pub fn casts_in_maps(material: &Material) -> bool {
    !is_see_through(material, false)
}

/// Whether anything is mirrored at a surface.
#[must_use]
pub fn mirrors(material: &Material) -> bool {
    material.metallic > 0.0 || material.specular > 0.0
}

/// Whether some of the light that a surface receives leaves it in all directions.
fn scatters(material: &Material) -> bool {
    !material.unlit
        && (material.metallic < 1.0 || material.metallic_roughness_texture.is_some())
        && (material.transmission < 1.0 || material.transmission_texture.is_some())
        && material.base_color[..3] != [0.0; 3]
}

/// Perceptual roughness up to which surfaces are mirrored on the screen.
const ROUGHEST_ON_SCREEN: f32 = 0.2;

fn has_layers(material: &Material) -> bool {
    [
        material.clearcoat_texture,
        material.clearcoat_roughness_texture,
        material.specular_texture,
        material.transmission_texture,
        material.thickness_texture,
    ]
    .iter()
    .any(Option::is_some)
}

/// From this many point and spot lights on, tiles list them (docs/decisions/light-lists.md).
const TILES_FROM: u32 = 16;

impl Plan {
    /// Decides from values, not names.
    #[must_use]
    pub fn new(scene: &Scene, surroundings: Surroundings, knobs: &Knobs) -> Self {
        let used = used_materials(scene);
        let find = |test: &dyn Fn(&Material) -> bool| used.iter().copied().find(|m| test(m));
        let mut effects = Vec::new();
        let mut decide = |name, knob: &'static str, cause: Cause, allowed: bool| {
            let rung = if knob.is_empty() { "" } else { knobs.rung(knob) };
            let (state, reason, evidence) = match cause {
                Err(reason) => ("not called for", reason.to_owned(), BTreeMap::new()),
                Ok((_, evidence)) if !allowed => ("dropped", format!("{knob}={rung}"), evidence),
                Ok((reason, evidence)) => ("kept", reason, evidence),
            };
            effects.push(Effect { name, state, rung, reason, evidence });
            state == "kept"
        };
        let material = |found: Option<&Material>, says: &dyn Fn(&Material) -> String| {
            let found = found.ok_or("no material in use has it")?;
            let evidence = BTreeMap::from([("material", found.name.clone())]);
            Ok((format!("material \"{}\" {}", found.name, says(found)), evidence))
        };

        let found = find(&|m| m.emissive_texture.is_some() && m.emissive != [0.0; 3]);
        let cause = material(found, &|_| "has an emissive texture".to_owned());
        let emissive = decide("emissive textures", "", cause, true);
        let cause = material(find(&|m| m.clearcoat > 0.0), &|m| format!("has clearcoat {}", m.clearcoat));
        let clearcoat = decide("clear coat", "", cause, true);
        let found = find(&|m| has_layers(m) || m.clearcoat > 0.0);
        let layers = decide("layers", "", material(found, &|_| "has a coat or layer textures".to_owned()), true);
        let cause = material(find(&|m| m.conductor.is_some()), &|_| "is a metal with n and kappa".to_owned());
        let conductors = decide("metals by n and kappa", "", cause, true);
        let refracts = |m: &Material| m.transmission > 0.0 && m.alpha_mode != AlphaMode::Blend;
        let cause = material(find(&refracts), &|m| format!("has transmission {}, n = {}", m.transmission, m.ior));
        let refracts = decide("refraction", "refraction", cause, knobs.rung("refraction") != "off");
        let refraction = refracts && knobs.rung("refraction") == "ray";
        let cause = material(find(&|m| is_see_through(m, refraction)), &|m| match m.alpha_mode {
            AlphaMode::Blend => "is alpha-blended".to_owned(),
            _ => format!("has transmission {}", m.transmission),
        });
        let see_through = decide("see-through surfaces", "", cause, true);
        let found = find(&|m| m.marched_sigma().is_some());
        let size =
            |m: &Material| m.sigma.as_ref().map_or([0; 3], |grid| grid.size()).map(|n| n.to_string()).join(" x ");
        let cause = material(found, &|m| format!("has a grid of {} values of sigma", size(m)));
        let cause = cause.map(|(reason, mut evidence)| {
            evidence.extend(found.map(|m| ("grid", size(m))));
            (reason, evidence)
        });
        // Without rays that refract all that is transparent is a sheet.
        let (knob, allowed) = match knobs.rung("refraction") == "ray" {
            true => ("absorption", knobs.march_steps() > 0),
            false => ("refraction", false),
        };
        let marched = decide("media that vary", knob, cause, allowed);
        let cause = match marched {
            true => Ok((format!("{} steps of each segment", knobs.march_steps()), BTreeMap::new())),
            false => Err("no medium is marched"),
        };
        decide("quadrature", "quadrature", cause, true);
        let march = March {
            steps: if marched { knobs.march_steps() } else { 0 },
            rule: knobs.index("quadrature"),
            colours: used.iter().any(|m| m.marched_sigma().is_some_and(|grid| grid.channels() > 1)),
        };

        let environment = |shows: bool, else_reason: &'static str| match (surroundings.environment, shows) {
            (true, true) => Ok(("there is an environment".to_owned(), BTreeMap::new())),
            (true, false) => Err(else_reason),
            (false, _) => Err("there is no environment"),
        };
        let any = |test: &dyn Fn(&Material) -> bool| used.iter().any(|m| test(m));
        let shiny = any(&|m| !m.unlit && (mirrors(m) || m.clearcoat > 0.0));
        let cause = environment(shiny, "no material in use mirrors anything");
        let reflection = decide("mirrored environment", "reflection", cause, knobs.rung("reflection") != "off");
        // A texture only lowers the factor.
        let roughest_mirror =
            if knobs.rung("reflection") == "ray" { knobs.roughest_lobe() } else { ROUGHEST_ON_SCREEN };
        let smooth = |m: &Material| {
            let base = mirrors(m) && (m.roughness <= roughest_mirror || m.metallic_roughness_texture.is_some());
            let coat = m.clearcoat > 0.0
                && (m.clearcoat_roughness <= roughest_mirror || m.clearcoat_roughness_texture.is_some());
            !m.unlit && (base || coat)
        };
        let cause =
            material(find(&smooth), &|m| match (mirrors(m) && m.roughness <= roughest_mirror, m.clearcoat > 0.0) {
                (true, _) => format!("has roughness {}", m.roughness),
                (false, true) => format!("has a coat of roughness {}", m.clearcoat_roughness),
                (false, false) => "has a roughness texture".to_owned(),
            });
        let mirrored = decide("mirrors", "reflection", cause, matches!(knobs.rung("reflection"), "screen" | "ray"));
        let mirror_rays = mirrored && knobs.rung("reflection") == "ray";
        let on_screen = |see_through| {
            let found = find(&|m| smooth(m) && is_see_through(m, refraction) == see_through);
            mirrored && !mirror_rays && found.is_some()
        };
        let screen = Screen {
            mirrors: on_screen(false),
            see_through_mirrors: on_screen(true),
            refraction: refracts && !refraction,
        };
        let cause = environment(any(&scatters), "no material in use scatters light");
        let ambient = decide("ambient light", "indirect", cause, knobs.rung("indirect") != "off");

        let shining = || scene.lights.iter().filter(|light| light.shines());
        let lit = any(&|m| !m.unlit);
        let count = |test: &dyn Fn(&LightKind) -> bool| match lit {
            true => shining().filter(|light| test(&light.kind)).count() as u32,
            false => 0,
        };
        let directional_lights = count(&|kind| matches!(kind, LightKind::Directional { .. }));
        let local_lights = count(&|kind| !matches!(kind, LightKind::Directional { .. }));
        let ranged = count(&|kind| {
            matches!(kind, LightKind::Point { range: Some(_), .. } | LightKind::Spot { range: Some(_), .. })
        });
        let evidence = BTreeMap::from([
            ("directional", directional_lights.to_string()),
            ("local", local_lights.to_string()),
            ("with a range", ranged.to_string()),
            ("dark", (scene.lights.len() - shining().count()).to_string()),
        ]);
        let cause = match (shining().next(), lit) {
            (None, _) if scene.lights.is_empty() => Err("the scene has no lights"),
            (None, _) => Err("all lights of the scene are dark"),
            (_, false) => Err("all materials in use are unlit"),
            _ => {
                let reason = format!("{directional_lights} directional, {local_lights} point and spot lights");
                Ok((reason, evidence.clone()))
            }
        };
        decide("punctual lights", "lights", cause.clone(), true);
        let shadowed = decide("shadows", "shadows", cause, knobs.rung("shadows") != "off");
        let shadow_maps = shadowed && knobs.rung("shadows") == "map";
        let shadows = shadowed && !shadow_maps;
        let rays = (shadows || mirror_rays || refraction).then(|| {
            let masked = any(&|m| matches!(m.alpha_mode, AlphaMode::Mask(_)));
            Rays {
                shadows,
                mirrors: mirror_rays,
                refraction,
                transmissive: any(&|m| m.transmission > 0.0),
                masked,
                filters: masked || any(&|m| is_see_through(m, false)),
                rough: any(&|m| {
                    let coat = m.clearcoat > 0.0 && m.clearcoat_roughness > 0.0;
                    (mirror_rays && smooth(m) && (m.roughness > 0.0 || coat))
                        || (refraction && m.transmission > 0.0 && m.roughness > 0.0)
                }),
                absorption: knobs.index("absorption").min(PATH),
                march: if marched { march } else { March::default() },
                interfaces: knobs.interfaces(),
            }
        });
        let cause = match (local_lights >= TILES_FROM, ranged > 0) {
            (false, _) => Err("few point and spot lights"),
            (_, false) => Err("no light has a range"),
            _ => Ok((format!("{ranged} of {local_lights} point and spot lights have a range"), evidence)),
        };
        let tiles = decide("light lists per tile", "", cause, true);
        Self {
            emissive,
            layers,
            clearcoat,
            conductors,
            environment: surroundings.environment,
            reflection,
            ambient,
            sky: surroundings.sky,
            see_through,
            directional_lights,
            local_lights,
            tiles,
            reflectance: reflection || ambient || screen != Screen::default() || knobs.rung("brdf") == "ggx-multi",
            shadow_maps,
            rays,
            screen,
            roughest_mirror,
            samples: knobs.samples(),
            effects,
            warnings: left_out(&used, knobs, refracts, refraction, shadow_maps),
        }
    }

    /// How segments go through grids of σ.
    #[must_use]
    pub fn march(&self) -> March {
        self.rays.map_or_else(March::default, |rays| rays.march)
    }
}

/// Place of the rung `path` in the knob `absorption`; the rungs `march` do as it does where nothing varies.
const PATH: u32 = 2;

/// What no rung that is built can show of these materials.
fn left_out(used: &[&Material], knobs: &Knobs, refracts: bool, by_rays: bool, shadow_maps: bool) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut say = |test: &dyn Fn(&Material) -> bool, what: &str| {
        if let Some(material) = used.iter().find(|material| test(material)) {
            warnings.push(format!("material \"{}\" {what}", material.name));
        }
    };
    let straight = |m: &Material| m.transmission > 0.0 && !(refracts && m.alpha_mode != AlphaMode::Blend);
    let clear = |m: &Material| straight(m) || (m.transmission > 0.0 && !by_rays);
    say(&straight, "transmits light that goes straight on: refraction is off, or the material is blended");
    say(&|m| clear(m) && m.roughness > 0.1, "transmits through a rough surface: shown clear");
    let casts = |m: &Material| !shadow_maps || casts_in_maps(m);
    say(&|m| !casts(m), "casts no shadow: the maps of shadows=map hold opaque and masked surfaces alone");
    let (absorption, marches) = (knobs.rung("absorption"), by_rays && knobs.march_steps() > 0);
    let varies = |m: &Material| m.marched_sigma().is_some();
    let instead = format!(
        "has a grid of sigma, of which absorption={absorption} with refraction={} takes the mean; refraction=ray with \
         absorption=march:4 to march:64 goes through it",
        knobs.rung("refraction")
    );
    say(&|m| varies(m) && !marches && absorption != "off", &instead);
    say(&|m| m.dispersion > 0.0, "has dispersion, which is not built");
    let (lobes, reflection) = (knobs.rung("lobes"), knobs.rung("reflection"));
    if lobes != "0.2" && reflection != "ray" {
        warnings.push(format!("lobes={lobes} changes nothing: reflection={reflection} sends no rays"));
    }
    let rule = knobs.rung("quadrature");
    if rule != "midpoint" && !(marches && used.iter().any(|m| varies(m))) {
        warnings.push(format!("quadrature={rule} changes nothing: no medium is marched"));
    }
    warnings
}

/// Why a scene calls for an effect, with what that rests on; or why it does not.
type Cause = Result<(String, BTreeMap<&'static str, String>), &'static str>;

fn used_materials(scene: &Scene) -> Vec<&Material> {
    let mut used = vec![false; scene.materials.len()];
    for instance in &scene.instances {
        used[scene.meshes[instance.mesh].material] = true;
    }
    scene.materials.iter().zip(used).filter_map(|(material, used)| used.then_some(material)).collect()
}
