//! Factors that a black texture makes 0 everywhere: the material then is what it would be without them.

use super::{Image, Material, Scene};

/// Sets to 0 each factor whose texture is black in the channels that multiply it, and forgets the texture where nothing else
/// is read from it. What is drawn stays the same: 0 times the factor.
pub fn without_black_textures(scene: &mut Scene) {
    let Scene { materials, images, .. } = scene;
    for material in materials {
        settle(material, images);
    }
}

fn settle(material: &mut Material, images: &[Image]) {
    // Found out at the first texel that is not black, which most textures have near their start.
    let black = |texture: Option<super::material::TextureRef>, channels: &[usize]| {
        texture.is_some_and(|texture| {
            images[texture.image].rgba.as_chunks::<4>().0.iter().all(|texel| channels.iter().all(|&c| texel[c] == 0))
        })
    };
    if black(material.emissive_texture, &[0, 1, 2]) {
        material.emissive = [0.0; 3];
        material.emissive_texture = None;
    }
    if black(material.transmission_texture, &[0]) {
        material.transmission = 0.0;
        material.transmission_texture = None;
    }
    if black(material.clearcoat_texture, &[0]) {
        material.clearcoat = 0.0;
        material.clearcoat_texture = None;
    }
    // Roughness is in the same texture.
    if black(material.metallic_roughness_texture, &[2]) {
        material.metallic = 0.0;
    }
}
