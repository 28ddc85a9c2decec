//! False-colour views of the surfaces at the pixel centres (albedo, normals, distance, …), which the window can show in
//! place of the picture.

use glam::Vec3;

use super::lookup::TriangleFacts;
use super::shared::PixelSurfaces;
use etalon::share::AovPixel;

/// What the window shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SurfaceLayer {
    /// The shaded picture.
    Radiance,
    /// Base colour.
    Albedo,
    /// Shading normal.
    Normal,
    /// Normal of the triangle.
    GeometricNormal,
    /// Distance from the eye.
    Distance,
    /// Perceptual roughness.
    Roughness,
    /// Metallic.
    Metallic,
    /// Index of the material.
    Material,
    /// Index of the instance.
    Instance,
    /// Emitted radiance.
    Emissive,
    /// Edges of the triangles, over the picture.
    Wireframe,
    /// Texture coordinates of the first set, with squares of an eighth.
    TextureCoordinates,
    /// Pixels with NaN or infinite radiance.
    NotFinite,
}

/// Every layer with its name.
pub const LAYERS: [(SurfaceLayer, &str); 13] = [
    (SurfaceLayer::Radiance, "shaded"),
    (SurfaceLayer::Albedo, "albedo"),
    (SurfaceLayer::Normal, "normal"),
    (SurfaceLayer::GeometricNormal, "geometric normal"),
    (SurfaceLayer::Distance, "distance"),
    (SurfaceLayer::Roughness, "roughness"),
    (SurfaceLayer::Metallic, "metallic"),
    (SurfaceLayer::Material, "material"),
    (SurfaceLayer::Instance, "instance"),
    (SurfaceLayer::Emissive, "emissive"),
    (SurfaceLayer::Wireframe, "wireframe"),
    (SurfaceLayer::TextureCoordinates, "texture coordinates"),
    (SurfaceLayer::NotFinite, "NaN and infinity"),
];

fn encoded(color: Vec3) -> [u8; 4] {
    let byte = |x: f32| etalon::image::tone::quantise(etalon::image::tone::srgb_encode(f64::from(x.clamp(0.0, 1.0))));
    [byte(color.x), byte(color.y), byte(color.z), 255]
}

/// Colour of an index. Consecutive indices differ clearly: their hues are a golden-ratio step apart.
fn of_number(number: u32) -> [u8; 4] {
    let hue = (number as f32 * 0.618_034).fract() * 6.0;
    let wave = |shift: f32| ((hue + shift).rem_euclid(6.0) - 3.0).abs().clamp(1.0, 2.0) - 1.0;
    [wave(0.0), wave(2.0), wave(4.0), 1.0].map(|x| (55.0 + 200.0 * x) as u8)
}

/// Colour of a normal: −1 … 1 is mapped to 0 … 255 without gamma encoding.
fn of_normal(n: [f32; 3]) -> [u8; 4] {
    let [x, y, z] = n.map(|c| (c * 127.5 + 128.0).clamp(0.0, 255.0) as u8);
    [x, y, z, 255]
}

/// Colour of texture coordinates: u is red, v is green, each from 0 to 1 within a repetition, in squares of an eighth.
fn of_uv(uv: [f32; 2]) -> [u8; 4] {
    let [u, v] = uv.map(|x| if x.is_finite() { x.rem_euclid(1.0) } else { 0.0 });
    let square = ((u * 8.0) as u32 + (v * 8.0) as u32) % 2;
    let light = if square == 0 { 1.0 } else { 0.75 };
    let [r, g, b] = [55.0 + 200.0 * u, 55.0 + 200.0 * v, 90.0].map(|c| (c * light) as u8);
    [r, g, b, 255]
}

const NOTHING: [u8; 4] = [24, 24, 26, 255];

impl SurfaceLayer {
    /// Whether the layer is drawn from the surfaces at the pixels.
    #[must_use]
    pub fn reads_surfaces(self) -> bool {
        self != Self::Radiance && !self.reads_triangles()
    }

    /// Whether the layer is drawn from the triangles at the pixels.
    #[must_use]
    pub fn reads_triangles(self) -> bool {
        matches!(self, Self::Wireframe | Self::TextureCoordinates)
    }

    /// RGBA8 pixels of a layer of triangles over a picture of the same size.
    #[must_use]
    pub fn draw_triangles(self, triangles: &[Option<TriangleFacts>], rgba: &[u8]) -> Vec<u8> {
        let pixel = |(facts, shown): (&Option<TriangleFacts>, &[u8])| -> [u8; 4] {
            let grey = [shown[0], shown[1], shown[2]].iter().map(|c| u16::from(*c)).sum::<u16>() / 6;
            match (self, facts) {
                (Self::TextureCoordinates, Some(TriangleFacts { uv: Some(uv), .. })) => of_uv(*uv),
                (Self::Wireframe, Some(facts)) => {
                    let line = (1.0 - facts.edge).clamp(0.0, 1.0);
                    let base = 40.0 + f32::from(grey);
                    let [r, g, b] = [255.0, 220.0, 120.0].map(|c| (base + (c - base) * line) as u8);
                    [r, g, b, 255]
                }
                (_, Some(_)) => [grey as u8, grey as u8, grey as u8, 255],
                (_, None) => NOTHING,
            }
        };
        triangles.iter().zip(rgba.chunks_exact(4)).flat_map(pixel).collect()
    }

    /// RGBA8 pixels of the layer. [`SurfaceLayer::Radiance`] is the picture itself and gives plain grey here.
    #[must_use]
    pub fn draw(self, surfaces: &PixelSurfaces) -> Vec<u8> {
        let farthest = surfaces.pixels.iter().map(|p| p.distance).fold(0.0, f32::max).max(1e-9);
        let pixel = |(p, radiance): (&AovPixel, &[f32; 4])| {
            if self == Self::NotFinite {
                // Finite pixels are shown dim, for orientation.
                let grey = (radiance[..3].iter().sum::<f32>() / 12.0).clamp(0.0, 0.25);
                return match radiance {
                    r if r.iter().any(|x| x.is_nan()) => [255, 0, 255, 255],
                    r if r.iter().any(|x| x.is_infinite()) => [0, 255, 255, 255],
                    _ => encoded(Vec3::splat(grey)),
                };
            }
            if p.material == 0 {
                return NOTHING;
            }
            match self {
                Self::Radiance | Self::NotFinite | Self::Wireframe | Self::TextureCoordinates => NOTHING,
                Self::Albedo => encoded(p.albedo.into()),
                Self::Normal => of_normal(p.normal),
                Self::GeometricNormal => of_normal(p.geometric_normal),
                Self::Distance => encoded(Vec3::splat(1.0 - p.distance / farthest)),
                Self::Roughness => encoded(Vec3::splat(p.roughness)),
                Self::Metallic => encoded(Vec3::splat(p.metallic)),
                Self::Material => of_number(p.material),
                Self::Instance => of_number(p.instance),
                Self::Emissive => encoded(p.emissive.into()),
            }
        };
        surfaces.pixels.iter().zip(surfaces.radiance[0].iter()).flat_map(pixel).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn what_is_no_number_stands_out() {
        let pixel = AovPixel {
            p_rel: [0.0; 3],
            normal: [0.0, 0.0, 1.0],
            geometric_normal: [0.0, 0.0, -1.0],
            albedo: [1.0, 0.0, 0.5],
            distance: 2.0,
            roughness: 0.5,
            metallic: 1.0,
            emissive: [0.0; 3],
            material: 1,
            instance: 2,
        };
        let nothing = AovPixel { material: 0, ..pixel };
        let surfaces = PixelSurfaces {
            pixels: Arc::new(vec![pixel, nothing, pixel]),
            radiance: vec![Arc::new(vec![[f32::NAN, 0.0, 0.0, 1.0], [0.0, f32::INFINITY, 0.0, 1.0], [1.0; 4]])],
            size: [3, 1],
            eye: glam::DVec3::ZERO,
            seen_from: etalon::scene::Camera::framing(
                etalon::scene::Bounds { min: glam::DVec3::ZERO, max: glam::DVec3::ONE },
                1.0,
                1.0,
            ),
            versions: [Some(1), None],
        };
        let of = |layer: SurfaceLayer, i: usize| layer.draw(&surfaces)[4 * i..4 * i + 4].to_vec();
        assert_eq!(of(SurfaceLayer::NotFinite, 0), [255, 0, 255, 255]);
        assert_eq!(of(SurfaceLayer::NotFinite, 1), [0, 255, 255, 255]);
        assert!(of(SurfaceLayer::NotFinite, 2)[0] < 140);
        assert_eq!(of(SurfaceLayer::Normal, 0), [128, 128, 255, 255]);
        assert_eq!(of(SurfaceLayer::Albedo, 0)[..2], [255, 0]);
        assert_eq!(of(SurfaceLayer::Albedo, 1), NOTHING);
        assert_ne!(of_number(1), of_number(2));
    }
}
