//! Canonical form of a scene: constant folding of material factors with the texels and vertex colours that multiply
//! them.
//!
//! Black textures set their factor to 0, and alpha of 1 everywhere makes a material opaque. The picture stays the same,
//! with one exception: a material that becomes opaque casts shadows in shadow maps and refracts the light that it
//! transmits. Read glTF 2.0 section 3.9.4 (alpha modes). Assumes decoded images.

use super::material::TextureRef;
use super::{AlphaMode, Image, Material, Mesh, Scene, Shared};

/// Names of the materials and meshes that canonicalisation simplified, for messages.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CanonicalForm {
    /// Textures that are black in all channels that multiply their factor: "emission of \"lamp\"".
    pub black: Vec<String>,
    /// Alpha-blended or alpha-tested materials whose alpha is 1 everywhere: they became opaque.
    pub opaque: Vec<String>,
    /// Meshes that alpha makes invisible everywhere: their triangles are removed.
    pub unseen: Vec<String>,
}

/// Brings a scene into canonical form.
pub fn canonicalise(scene: &mut Scene) -> CanonicalForm {
    let mut form = CanonicalForm::default();
    let Scene { materials, meshes, images, .. } = scene;
    for mesh in meshes.iter_mut().filter(|mesh| mesh.colors.iter().all(|color| *color == [1.0; 4])) {
        mesh.colors = Shared::default();
    }
    for (index, material) in materials.iter_mut().enumerate() {
        if material.unlit {
            keep_base_alone(material);
        }
        form.black.extend(fold_black(material, images).into_iter().map(|of| format!("{of} of \"{}\"", material.name)));
        fold_alpha(index, material, meshes, images, &mut form);
    }
    form
}

/// Removes what an unlit surface does not show: all but its base colour.
fn keep_base_alone(material: &mut Material) {
    let Material { emissive_texture, transmission_texture, clearcoat_texture, emission, conductor, .. } = material;
    [emissive_texture, transmission_texture, clearcoat_texture].into_iter().for_each(|texture| *texture = None);
    (*emission, *conductor, material.conductor_spectra) = (None, None, None);
    (material.emissive, material.transmission, material.clearcoat) = ([0.0; 3], 0.0, 0.0);
    material.lobes = Material::default().lobes;
}

/// Sets each factor to 0 whose texture is black in the channels that multiply it, and returns the names of these
/// factors. The texture is removed unless other channels of it are read.
fn fold_black(material: &mut Material, images: &[Image]) -> Vec<&'static str> {
    // Stops at the first texel that is not black, which most textures have near their start.
    let black = |texture: Option<TextureRef>, channels: &[usize]| {
        texture.is_some_and(|texture| {
            let mut texels = images[texture.image].rgba.as_chunks::<4>().0.iter();
            texels.all(|texel| channels.iter().all(|&c| texel[c] == 0))
        })
    };
    let mut found = Vec::new();
    if black(material.emissive_texture, &[0, 1, 2]) {
        material.emissive = [0.0; 3];
        material.emissive_texture = None;
        found.push("emission");
    }
    if black(material.transmission_texture, &[0]) {
        material.transmission = 0.0;
        material.transmission_texture = None;
        found.push("transmission");
    }
    if black(material.clearcoat_texture, &[0]) {
        material.clearcoat = 0.0;
        material.clearcoat_texture = None;
        found.push("clear coat");
    }
    // G of the same texture is roughness, so the texture stays.
    if black(material.metallic_roughness_texture, &[2]) && material.metallic > 0.0 {
        material.metallic = 0.0;
        found.push("metal");
    }
    found
}

/// Folds alpha: 1 everywhere makes the material opaque; below the cutoff, or 0 when blended, everywhere empties the
/// mesh.
fn fold_alpha(index: usize, material: &mut Material, meshes: &mut [Mesh], images: &[Image], form: &mut CanonicalForm) {
    if material.alpha_mode == AlphaMode::Opaque {
        return;
    }
    let [texels_least, texels_most] = material.base_color_texture.map_or([1.0; 2], |texture| {
        let alphas = images[texture.image].rgba.as_chunks::<4>().0.iter().map(|texel| texel[3]);
        alphas
            .fold([1.0_f32, 0.0], |[least, most], a| [least.min(f32::from(a) / 255.0), most.max(f32::from(a) / 255.0)])
    });
    let (mut covers, mut used) = (true, false);
    for mesh in meshes.iter_mut().filter(|mesh| mesh.material == index && !mesh.indices.is_empty()) {
        used = true;
        let of_vertices = |first: f32, pick: fn(f32, f32) -> f32| {
            mesh.colors.iter().map(|color| color[3]).reduce(pick).unwrap_or(first)
        };
        let least = material.base_color[3] * of_vertices(1.0, f32::min);
        let most = material.base_color[3] * texels_most * of_vertices(1.0, f32::max);
        let (whole, nothing) = match material.alpha_mode {
            // Texture filtering rounds, and may lower an alpha below 1.
            AlphaMode::Mask(cutoff) => (texels_least == 1.0 && least > cutoff, most < cutoff),
            _ => (texels_least == 1.0 && least >= 1.0, most <= 0.0),
        };
        covers &= whole;
        if nothing {
            form.unseen.push(mesh.name.clone());
            *mesh = Mesh { name: std::mem::take(&mut mesh.name), material: index, ..Mesh::default() };
        }
    }
    // A material without meshes is not reported. As opaque it keeps alpha weights out of the mip levels of textures it
    // shares.
    if covers {
        material.alpha_mode = AlphaMode::Opaque;
        form.opaque.extend(used.then(|| material.name.clone()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sampler;

    #[test]
    fn an_unlit_material_transmits_and_emits_nothing() {
        let mut scene = scene(AlphaMode::Opaque, 1.0, Some(255), &[]);
        let lit = Material { transmission: 1.0, clearcoat: 1.0, emissive: [1.0; 3], ..scene.materials[0].clone() };
        scene.materials = vec![Material { unlit: true, ..lit.clone() }, lit];
        canonicalise(&mut scene);
        let left = |m: &Material| (m.transmission, m.clearcoat, m.emissive, m.base_color_texture.is_some());
        assert_eq!(
            scene.materials.iter().map(left).collect::<Vec<_>>(),
            [(0.0, 0.0, [0.0; 3], true), (1.0, 1.0, [1.0; 3], true)]
        );
    }

    fn scene(alpha_mode: AlphaMode, alpha: f32, texels: Option<u8>, vertices: &[f32]) -> Scene {
        let texture =
            TextureRef { image: 0, uv_set: 0, uv_transform: glam::Affine2::IDENTITY, sampler: Sampler::default() };
        let image =
            |alpha| Image { name: String::new(), width: 2, height: 1, rgba: vec![9, 9, 9, alpha, 9, 9, 9, 255].into() };
        Scene {
            materials: vec![Material {
                alpha_mode,
                base_color: [1.0, 1.0, 1.0, alpha],
                base_color_texture: texels.map(|_| texture),
                ..Material::default()
            }],
            meshes: vec![Mesh {
                positions: vec![[0.0; 3]; 3].into(),
                indices: vec![0, 1, 2].into(),
                colors: vertices.iter().map(|&a| [1.0, 1.0, 1.0, a]).collect(),
                ..Mesh::default()
            }],
            images: texels.map(image).into_iter().collect(),
            ..Scene::default()
        }
    }

    #[test]
    fn alpha_is_read_by_its_values() {
        use AlphaMode::{Blend, Mask, Opaque};
        // Alpha mode, alpha factor, alpha of one of two texels, alpha of vertices; expected alpha mode, whether
        // triangles are left.
        type Case = (AlphaMode, f32, Option<u8>, &'static [f32], AlphaMode, bool);
        let cases: [Case; 15] = [
            (Blend, 1.0, None, &[], Opaque, true),
            (Blend, 1.0, Some(255), &[], Opaque, true),
            (Blend, 1.0, Some(255), &[1.0, 1.0, 1.0], Opaque, true),
            (Blend, 1.0, Some(254), &[], Blend, true),
            (Blend, 0.99, Some(255), &[], Blend, true),
            (Blend, 1.0, None, &[1.0, 0.5, 1.0], Blend, true),
            (Blend, 0.0, Some(255), &[], Blend, false),
            (Blend, 1.0, None, &[0.0, 0.0, 0.0], Blend, false),
            (Blend, 1.0, None, &[0.0, 0.0, 0.1], Blend, true),
            (Mask(0.5), 1.0, None, &[], Opaque, true),
            (Mask(0.5), 0.6, Some(255), &[], Opaque, true),
            (Mask(0.5), 0.4, Some(255), &[], Mask(0.5), false),
            (Mask(0.5), 1.0, Some(0), &[], Mask(0.5), true),
            (Mask(0.5), 0.5, None, &[], Mask(0.5), true),
            (Mask(1.5), 1.0, None, &[1.0, 1.0, 1.0], Mask(1.5), false),
        ];
        for (i, (mode, factor, texels, vertices, becomes, left)) in cases.into_iter().enumerate() {
            let mut scene = scene(mode, factor, texels, vertices);
            let form = canonicalise(&mut scene);
            assert_eq!(scene.materials[0].alpha_mode, becomes, "case {i}");
            assert_eq!(!scene.meshes[0].indices.is_empty(), left, "case {i}");
            assert_eq!(
                (form.opaque.len(), form.unseen.len()),
                (usize::from(becomes == Opaque), usize::from(!left)),
                "case {i}"
            );
        }
    }
}
