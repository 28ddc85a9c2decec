//! The plan: what a scene calls for, with the reason, before any Vulkan object exists. Pure and printable.

mod knobs;

pub use knobs::{KNOBS, Knob, Knobs};

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
    /// Samples per pixel.
    pub samples: u32,
    /// Every effect with its reason.
    pub effects: Vec<Effect>,
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
}

/// What is known beside the scene.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings {
    /// There is an environment that lights the scene.
    pub environment: bool,
    /// It is also the background.
    pub sky: bool,
}

/// Whether a surface lets what lies behind it through.
#[must_use]
pub fn is_see_through(material: &Material) -> bool {
    material.alpha_mode == AlphaMode::Blend || material.transmission > 0.0
}

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

/// Below this many local lights a tile list costs more than it saves (measured on lavapipe: docs/decisions/light-lists.md).
const TILES_FROM: u32 = 16;

impl Plan {
    /// Decides from values, not names.
    #[must_use]
    pub fn new(scene: &Scene, surroundings: Surroundings, knobs: &Knobs) -> Self {
        let used = used_materials(scene);
        let find = |test: &dyn Fn(&Material) -> bool| used.iter().copied().find(|m| test(m));
        let quoted = |m: &Material| format!("material \"{}\"", m.name);
        let mut effects = Vec::new();
        let mut decide = |name, knob: &'static str, called: Option<String>, allowed: bool| {
            let rung = if knob.is_empty() { "" } else { knobs.rung(knob) };
            let (state, reason) = match called {
                None => (
                    "not called for",
                    if knob == "reflection" || knob == "indirect" {
                        "there is no environment"
                    } else {
                        "nothing in the scene has it"
                    }
                    .to_owned(),
                ),
                Some(_) if !allowed => ("dropped", format!("{knob}={rung}")),
                Some(reason) => ("kept", reason),
            };
            effects.push(Effect { name, state, rung, reason });
            state == "kept"
        };

        let emissive = find(&|m| m.emissive_texture.is_some() && m.emissive != [0.0; 3]);
        let emissive =
            decide("emissive textures", "", emissive.map(|m| format!("{} has an emissive texture", quoted(m))), true);
        let clearcoat = find(&|m| m.clearcoat > 0.0);
        let clearcoat =
            decide("clear coat", "", clearcoat.map(|m| format!("{}: clearcoat {}", quoted(m), m.clearcoat)), true);
        let layers = find(&|m| has_layers(m) || m.clearcoat > 0.0);
        let layers = decide("layers", "", layers.map(|m| format!("{} has a coat or layer textures", quoted(m))), true);
        let see_through = find(&is_see_through).map(|m| match m.alpha_mode {
            AlphaMode::Blend => format!("{} is alpha-blended", quoted(m)),
            _ => format!("{}: transmission {}", quoted(m), m.transmission),
        });
        let see_through = decide("see-through surfaces", "", see_through, true);
        let reflects = surroundings.environment.then(|| "there is an environment".to_owned());
        let reflection =
            decide("mirrored environment", "reflection", reflects.clone(), knobs.rung("reflection") != "off");
        let ambient = decide("ambient light", "indirect", reflects, knobs.rung("indirect") != "off");

        let local = |light: &LightKind| !matches!(light, LightKind::Directional { .. });
        let local_lights = scene.lights.iter().filter(|l| local(&l.kind)).count() as u32;
        let directional_lights = scene.lights.len() as u32 - local_lights;
        let ranged = scene.lights.iter().filter(|l| {
            matches!(l.kind, LightKind::Point { range: Some(_), .. } | LightKind::Spot { range: Some(_), .. })
        });
        let ranged = ranged.count();
        let lights = (!scene.lights.is_empty())
            .then(|| format!("{directional_lights} directional, {local_lights} point and spot lights"));
        decide("punctual lights", "lights", lights, true);
        let tiles = (local_lights >= TILES_FROM && ranged > 0)
            .then(|| format!("{ranged} of {local_lights} point and spot lights have a range"));
        let tiles = decide("light lists per tile", "", tiles, true);
        Self {
            emissive,
            layers,
            clearcoat,
            reflection,
            ambient,
            sky: surroundings.sky,
            see_through,
            directional_lights,
            local_lights,
            tiles,
            samples: knobs.samples(),
            effects,
        }
    }
}

fn used_materials(scene: &Scene) -> Vec<&Material> {
    let mut used = vec![false; scene.materials.len()];
    for instance in &scene.instances {
        used[scene.meshes[instance.mesh].material] = true;
    }
    scene.materials.iter().zip(used).filter_map(|(material, used)| used.then_some(material)).collect()
}
