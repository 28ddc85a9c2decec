//! Pruning: textures and texture coordinates that cannot affect the picture are neither decoded nor uploaded.
//!
//! Read glTF 2.0 section 3.9 for the factors that decide it. Each pruned texture or attribute is reported with its
//! reason.

use super::lobe::LOBES;
use super::material::TextureRef;
use super::{Material, Scene, Shared};

/// Which unused data is pruned from a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Prune {
    /// Nothing: every texture that a material names is read.
    #[default]
    Nothing,
    /// Textures and attributes that cannot affect the picture.
    Unused(AmbientLight),
}

/// Whether the picture has ambient light, the only light that occlusion textures darken. Environment light and
/// reflections in screen space count as ambient.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AmbientLight {
    /// No.
    Absent,
    /// Yes.
    Present,
}

impl Prune {
    /// Whether the picture has ambient light; `None` when nothing is pruned.
    pub(crate) fn ambient(self) -> Option<bool> {
        match self {
            Self::Nothing => None,
            Self::Unused(AmbientLight::Absent) => Some(false),
            Self::Unused(AmbientLight::Present) => Some(true),
        }
    }
}

/// Removes the textures of a material that cannot affect the picture; returns one sentence per texture with the reason.
/// `used`: some mesh with triangles has the material. `ambient`: the picture has ambient light.
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
    forget(&mut m.specular_color_texture, "specular colour", lit.or(mirrors));
    forget(&mut m.transmission_texture, "transmission", transmits);
    forget(&mut m.thickness_texture, "thickness", transmits.or(unless(m.thickness > 0.0, "the thickness is 0")));
    unread
}

/// Texture-coordinate sets of a material: `sets` are read by its textures, `tangents` is the set of its normal
/// textures or of its anisotropy.
pub(crate) struct Coordinates {
    pub(crate) sets: [bool; 2],
    /// Sets that are kept. A textured material keeps set 0: ray tracing computes the texel density from it.
    pub(crate) kept: [bool; 2],
    pub(crate) tangents: Option<usize>,
}

impl Coordinates {
    pub(crate) fn of(m: &Material) -> Self {
        let textures: Vec<TextureRef> = m.textures().filter_map(|(.., texture)| texture).collect();
        let reads = |set| textures.iter().any(|t| t.uv_set as usize & 1 == set);
        let set = |texture: TextureRef| texture.uv_set as usize & 1;
        let directed = m.lobes().find(|(lobe, of)| lobe.has_direction && lobe.is_on(of));
        let tangents = m
            .normal_texture
            .or(m.clearcoat_normal_texture)
            .map(set)
            .or(directed.map(|(_, of)| of.textures.iter().flatten().next().copied().map_or(0, set)));
        Self { sets: [reads(0), reads(1)], kept: [reads(0) || reads(1), reads(1)], tangents }
    }
}

/// Prunes textures, texture coordinates and tangents that cannot affect the picture from a whole scene.
pub fn prune_unused(scene: &mut Scene, prune: Prune) {
    let Some(ambient) = prune.ambient() else { return };
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
