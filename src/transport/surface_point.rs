//! The material at one point of a surface, in f64 on the host: texels and vertex colours multiplied into its factors.
//! The twin of `put_texel` (shaders/lib/texels.glsl) and `hit_texture` (shaders/lib/hit.glsl) for a picked pixel.
//!
//! Read glTF 2.0, section 3.9, and KHR_texture_transform. A texture is read at its finest level, bilinearly or by its
//! nearest texel: pictures filter it over a pixel, and agree where a texel is larger than a pixel.

use std::array::from_fn;

use glam::{DMat3, DVec2, DVec3, DVec4, Vec2};

use crate::image::tone::srgb_decode;
use crate::scene::lobe::{ANISOTROPY, DIFFUSE_TRANSMISSION, IRIDESCENCE, SHEEN};
use crate::scene::{Material, Meaning, Mesh, Scene, TextureRef, Wrap};

/// A point of a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Index into the scene's instances.
    pub instance: usize,
    /// Index of the triangle in its mesh.
    pub primitive: usize,
    /// Barycentric coordinates of the second and the third corner.
    pub uv: [f64; 2],
}

impl SurfacePoint {
    fn mesh<'a>(&self, scene: &'a Scene) -> &'a Mesh {
        &scene.meshes[scene.instances[self.instance].mesh]
    }

    /// An attribute of the mesh, interpolated; `None` where the mesh has none.
    fn attribute<const N: usize>(&self, mesh: &Mesh, values: &[[f32; N]]) -> Option<[f64; N]> {
        if values.is_empty() {
            return None;
        }
        let corners = [0, 1, 2].map(|k| values[mesh.indices[3 * self.primitive + k] as usize]);
        let [u, v] = self.uv;
        // In this form an attribute that is equal at the corners stays so to the last bit.
        let [a, b, c] = corners.map(|corner| corner.map(f64::from));
        Some(from_fn(|i| a[i] + (b[i] - a[i]) * u + (c[i] - a[i]) * v))
    }

    /// The value of a texture, linear; 1 in each channel without a texture.
    #[must_use]
    pub fn texel(&self, scene: &Scene, texture: Option<TextureRef>, meaning: Meaning) -> DVec4 {
        let Some(texture) = texture else { return DVec4::ONE };
        let mesh = self.mesh(scene);
        let uv = self.attribute(mesh, &mesh.uvs[texture.uv_set as usize]).unwrap_or_default();
        sample(scene, texture, meaning, texture.uv_transform.as_daffine2().transform_point2(uv.into()))
    }

    /// The material at this point: without textures, and with factors that contain them. Normal maps are
    /// [`SurfacePoint::bent_normal`]; ambient occlusion is no property of the material and is left out.
    #[must_use]
    pub fn material(&self, scene: &Scene) -> Material {
        let mesh = self.mesh(scene);
        let mut m = scene.materials[mesh.material].clone();
        let texel = |texture, meaning| self.texel(scene, texture, meaning);
        let scale = |factor: &mut f32, by: f64| *factor = (f64::from(*factor) * by) as f32;
        let scale_rgb = |factors: &mut [f32], by: DVec4| {
            factors.iter_mut().zip([by.x, by.y, by.z]).for_each(|(factor, by)| scale(factor, by));
        };
        let color = self.attribute(mesh, &mesh.colors).map_or(DVec4::ONE, DVec4::from);
        let base = color * texel(m.base_color_texture, Meaning::Color);
        scale_rgb(&mut m.base_color[..3], base);
        scale(&mut m.base_color[3], base.w);
        let surface = texel(m.metallic_roughness_texture, Meaning::Data);
        scale(&mut m.roughness, surface.y);
        scale(&mut m.metallic, surface.z);
        scale_rgb(&mut m.emissive, texel(m.emissive_texture, Meaning::Color));
        scale(&mut m.specular, texel(m.specular_texture, Meaning::Data).w);
        scale_rgb(&mut m.specular_color, texel(m.specular_color_texture, Meaning::Color));
        scale(&mut m.transmission, texel(m.transmission_texture, Meaning::Data).x);
        scale(&mut m.thickness, texel(m.thickness_texture, Meaning::Data).y);
        scale(&mut m.clearcoat, texel(m.clearcoat_texture, Meaning::Data).x);
        scale(&mut m.clearcoat_roughness, texel(m.clearcoat_roughness_texture, Meaning::Data).y);

        let sheen = &mut m.lobes[SHEEN];
        scale_rgb(&mut sheen.factors[..3], texel(sheen.textures[0], Meaning::Color));
        scale(&mut sheen.factors[3], texel(sheen.textures[1], Meaning::Data).w);
        let anisotropy = &mut m.lobes[ANISOTROPY];
        if anisotropy.textures[0].is_some() {
            let value = texel(anisotropy.textures[0], Meaning::Data);
            scale(&mut anisotropy.factors[0], value.z);
            anisotropy.factors[1] += (2.0 * value.y - 1.0).atan2(2.0 * value.x - 1.0) as f32;
        }
        let film = &mut m.lobes[IRIDESCENCE];
        scale(&mut film.factors[0], texel(film.textures[0], Meaning::Data).x);
        let [_, _, thinnest, thickest] = film.factors.map(f64::from);
        let thickness = thinnest + (thickest - thinnest) * texel(film.textures[1], Meaning::Data).y;
        film.factors[2..].fill(thickness as f32);
        let through = &mut m.lobes[DIFFUSE_TRANSMISSION];
        scale(&mut through.factors[0], texel(through.textures[0], Meaning::Data).w);
        scale_rgb(&mut through.factors[1..], texel(through.textures[1], Meaning::Color));

        m.textures_mut().for_each(|texture| *texture = None);
        m
    }

    /// The unit shading normal with the material's normal map (shaders/lib/bent_normal.glsl), from the interpolated
    /// normal `n`, a unit vector in world space that is not yet turned to a viewer.
    #[must_use]
    pub fn bent_normal(&self, scene: &Scene, n: DVec3) -> DVec3 {
        let mesh = self.mesh(scene);
        let m = &scene.materials[mesh.material];
        let (Some(_), Some([x, y, z, _])) = (m.normal_texture, self.attribute(mesh, &mesh.tangents)) else { return n };
        let world: DMat3 = scene.instances[self.instance].world_from_object.matrix3;
        let along = world * DVec3::new(x, y, z);
        // The handedness is equal at the corners; a mirrored instance turns it over.
        let corner = mesh.indices[3 * self.primitive] as usize;
        let handedness = f64::from(mesh.tangents[corner][3]) * world.determinant().signum();
        let across = along - n * n.dot(along);
        let t = across.normalize_or_zero();
        let texel = 2.0 * self.texel(scene, m.normal_texture, Meaning::Data) - 1.0;
        let [x, y] = [texel.x, texel.y].map(|x| x * f64::from(m.normal_scale));
        (t * x + n.cross(t) * (handedness * y) + n * texel.z).try_normalize().unwrap_or(n)
    }
}

/// Texel number `i` along a side, as the wrap mode continues the image.
fn wrapped(i: i64, side: u32, wrap: Wrap) -> usize {
    let side = i64::from(side);
    let at = match wrap {
        Wrap::Clamp => i.clamp(0, side - 1),
        Wrap::Repeat => i.rem_euclid(side),
        Wrap::Mirror => {
            let twice = i.rem_euclid(2 * side);
            twice.min(2 * side - 1 - twice)
        }
    };
    at as usize
}

/// A texture at a coordinate, on its finest level.
fn sample(scene: &Scene, texture: TextureRef, meaning: Meaning, uv: DVec2) -> DVec4 {
    let image = &scene.images[texture.image];
    let sampler = texture.sampler;
    let at = |[x, y]: [i64; 2]| {
        let column = wrapped(x, image.width, sampler.wrap_u);
        let first = 4 * (wrapped(y, image.height, sampler.wrap_v) * image.width as usize + column);
        let value: [f64; 4] = from_fn(|channel| f64::from(image.rgba[first + channel]) / 255.0);
        DVec4::from(match meaning {
            Meaning::Color => from_fn(|channel| if channel < 3 { srgb_decode(value[channel]) } else { value[channel] }),
            Meaning::Data => value,
        })
    };
    let place = uv * Vec2::new(image.width as f32, image.height as f32).as_dvec2();
    if sampler.mag_nearest {
        return at(place.floor().to_array().map(|x| x as i64));
    }
    let corner = (place - 0.5).floor();
    let share = place - 0.5 - corner;
    let [x, y] = corner.to_array().map(|x| x as i64);
    let row = |y| at([x, y]).lerp(at([x.saturating_add(1), y]), share.x);
    row(y).lerp(row(y.saturating_add(1)), share.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_continue_as_their_wrap_modes_say() {
        let row = |wrap| [-4, -3, -2, -1, 0, 1, 2, 3, 4, 5, 6].map(|i| wrapped(i, 3, wrap));
        assert_eq!(row(Wrap::Repeat), [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0]);
        assert_eq!(row(Wrap::Mirror), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0]);
        assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2]);
    }
}
