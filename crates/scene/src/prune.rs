//! What of a scene's textures and texture coordinates a picture may depend on: the rest is neither decoded nor uploaded.

use super::lobe::LOBES;
use super::material::TextureRef;
use super::{Material, Scene, Shared};

/// What is read of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Prune {
    /// All that materials name, whatever comes of it.
    #[default]
    Nothing,
    /// What can be seen.
    Unused(AmbientLight),
}

/// When occlusion may be seen: it takes from light that comes from all around, and from mirror images of the screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AmbientLight {
    /// Never.
    Absent,
    /// If the scene has no lights of its own.
    WithoutLights,
    /// Always.
    Present,
}

impl Prune {
    /// Whether occlusion may be seen, and whether anything may be left out, for a scene with so many lights.
    pub(crate) fn ambient(self, lights: usize) -> Option<bool> {
        match self {
            Self::Nothing => None,
            Self::Unused(AmbientLight::Absent) => Some(false),
            Self::Unused(AmbientLight::WithoutLights) => Some(lights == 0),
            Self::Unused(AmbientLight::Present) => Some(true),
        }
    }
}

/// Takes the textures from a material that nothing of the picture depends on, and says of each which and why. `used`: some
/// mesh that is drawn has it. `ambience`: occlusion may be seen.
pub(crate) fn prune_textures(m: &mut Material, used: bool, ambient: bool) -> Vec<String> {
    let mut unread = Vec::new();
    let name = m.name.clone();
    let mut forget = |texture: &mut Option<TextureRef>, what: &str, why: Option<&str>| {
        if let (Some(_), Some(why)) =
            (*texture, if used { why } else { Some("nothing that is drawn has the material") })
        {
            *texture = None;
            unread.push(format!("{what} texture of \"{name}\": {why}"));
        }
    };
    let unless = |seen: bool, why: &'static str| if seen { None } else { Some(why) };
    let lit = unless(!m.unlit, "the material is unlit");
    let coat = lit.or(unless(m.clearcoat > 0.0, "there is no coat"));
    let transmits = unless(m.transmission > 0.0, "nothing is transmitted");
    for (lobe, of) in LOBES.iter().zip(&mut m.lobes) {
        let why = lit.or(unless(lobe.is_on(of), "there is no such lobe"));
        for ((_, what, _), texture) in lobe.textures.iter().zip(&mut of.textures) {
            forget(texture, &what.replace('_', " "), why);
        }
    }
    forget(&mut m.base_color_texture, "base colour", None);
    forget(&mut m.metallic_roughness_texture, "metallic and roughness", None);
    forget(&mut m.normal_texture, "normal", None);
    forget(&mut m.emissive_texture, "emissive", unless(m.emissive != [0.0; 3], "nothing is emitted"));
    let occludes =
        unless(m.occlusion_strength > 0.0, "its strength is 0").or(unless(ambient, "no light comes from all around"));
    forget(&mut m.occlusion_texture, "occlusion", lit.or(occludes));
    forget(&mut m.clearcoat_texture, "clear coat", coat);
    forget(&mut m.clearcoat_roughness_texture, "clear coat roughness", coat);
    forget(&mut m.clearcoat_normal_texture, "clear coat normal", coat);
    let mirrors = unless(m.specular > 0.0, "no dielectric part of it mirrors anything");
    forget(&mut m.specular_texture, "specular", lit.or(mirrors));
    forget(&mut m.specular_color_texture, "specular colour", Some("this texture is not supported"));
    forget(&mut m.transmission_texture, "transmission", transmits);
    forget(&mut m.thickness_texture, "thickness", transmits.or(unless(m.thickness > 0.0, "the thickness is 0")));
    unread
}

/// Sets of texture coordinates that the textures of a material read, those that are kept, and that which tangents follow.
pub(crate) struct Coordinates {
    pub(crate) sets: [bool; 2],
    /// With the first set where there is any texture: it tells rays how dense texels are.
    pub(crate) kept: [bool; 2],
    pub(crate) tangents: Option<usize>,
}

impl Coordinates {
    pub(crate) fn of(m: &Material) -> Self {
        let textures: Vec<TextureRef> = m.textures().filter_map(|(.., texture)| texture).collect();
        let reads = |set| textures.iter().any(|t| t.uv_set as usize & 1 == set);
        let tangents = m.normal_texture.or(m.clearcoat_normal_texture).map(|t| t.uv_set as usize & 1);
        Self { sets: [reads(0), reads(1)], kept: [reads(0) || reads(1), reads(1)], tangents }
    }
}

/// Takes from a whole scene what nothing of the picture depends on.
pub fn prune_unused(scene: &mut Scene, prune: Prune) {
    let Some(ambient) = prune.ambient(scene.lights.len()) else { return };
    let mut used = vec![false; scene.materials.len()];
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh];
        used[mesh.material] |= !mesh.indices.is_empty();
    }
    for (material, used) in scene.materials.iter_mut().zip(used) {
        scene.unread.extend(prune_textures(material, used, ambient));
    }
    for mesh in &mut scene.meshes {
        let read = Coordinates::of(&scene.materials[mesh.material]);
        for (set, uvs) in mesh.uvs.iter_mut().enumerate() {
            if !read.kept[set] && !uvs.is_empty() {
                scene.unread.push(unused_coordinates(&mesh.name, set));
                *uvs = Shared::default();
            }
        }
        if read.tangents.is_none() {
            mesh.tangents = Shared::default();
        }
    }
}

pub(crate) fn unused_coordinates(mesh: &str, set: usize) -> String {
    format!("texture coordinates {set} of mesh \"{mesh}\": no texture of its material reads them")
}
