//! Builder of study scenes: fills the types of [`crate`].

use glam::{Affine2, DAffine3, DMat3, DVec3, Vec3};

use super::shape::Shape;
use crate::substance::{Medium, Metal};
use crate::{
    Camera, Image, Instance, Light, LightKind, Material, Mesh, Projection, Sampler, Scene, Shared, TextureRef,
};

/// A scene under construction.
pub(super) struct StudyBuilder {
    scene: Scene,
}

impl StudyBuilder {
    /// An empty scene named `study:NAME`.
    pub(super) fn new(name: &str) -> Self {
        Self { scene: Scene { name: format!("study:{name}"), ..Scene::default() } }
    }

    pub(super) fn material(&mut self, material: Material) -> usize {
        self.scene.materials.push(material);
        self.scene.materials.len() - 1
    }

    /// A square image of linear colours, stored with the sRGB transfer function.
    pub(super) fn picture(&mut self, name: &str, size: u32, texel: impl Fn(u32, u32) -> [f64; 4]) -> TextureRef {
        let mut rgba = Vec::with_capacity((size * size * 4) as usize);
        for y in 0..size {
            for x in 0..size {
                let [r, g, b, a] = texel(x, y);
                rgba.extend([r, g, b].map(srgb8));
                rgba.push((a * 255.0).round() as u8);
            }
        }
        self.scene.images.push(Image { name: name.to_owned(), width: size, height: size, rgba: rgba.into() });
        TextureRef {
            image: self.scene.images.len() - 1,
            uv_set: 0,
            uv_transform: Affine2::IDENTITY,
            sampler: Sampler::default(),
        }
    }

    /// A checkerboard of two linear colours, eight squares across one repeat.
    pub(super) fn checker(&mut self, name: &str, dark: [f64; 3], light: [f64; 3]) -> TextureRef {
        self.picture(name, 256, |x, y| {
            let [r, g, b] = if (x / 32 + y / 32) % 2 == 0 { dark } else { light };
            [r, g, b, 1.0]
        })
    }

    pub(super) fn mesh(&mut self, name: &str, shape: Shape, material: usize) -> usize {
        self.scene.meshes.push(Mesh {
            name: name.to_owned(),
            positions: shape.positions.into(),
            normals: shape.normals.into(),
            uvs: [shape.uvs.into(), Shared::default()],
            indices: shape.indices.into(),
            material,
            ..Mesh::default()
        });
        self.scene.meshes.len() - 1
    }

    /// Gives a mesh tangents around its y axis, as grooves of turning have.
    pub(super) fn turned_on_a_lathe(&mut self, mesh: usize) {
        let mesh = &mut self.scene.meshes[mesh];
        let tangent = |n: &[f32; 3]| {
            let [x, y, z] = Vec3::Y.cross(Vec3::from(*n)).try_normalize().unwrap_or(Vec3::X).to_array();
            [x, y, z, 1.0]
        };
        mesh.tangents = mesh.normals.iter().map(tangent).collect();
    }

    pub(super) fn place(&mut self, name: &str, mesh: usize, world_from_object: DAffine3) {
        self.scene.instances.push(Instance { name: name.to_owned(), mesh, world_from_object });
    }

    /// A mesh with one instance of the same name.
    pub(super) fn add(&mut self, name: &str, shape: Shape, material: usize, world_from_object: DAffine3) {
        let mesh = self.mesh(name, shape, material);
        self.place(name, mesh, world_from_object);
    }

    pub(super) fn light(&mut self, name: &str, color: [f32; 3], kind: LightKind) {
        self.shine(Light { name: name.to_owned(), color, spectrum: None, extent: None, kind, proxy: false });
    }

    /// Adds a light with all its properties.
    pub(super) fn shine(&mut self, light: Light) {
        self.scene.lights.push(light);
    }

    /// Adds a proxy light for an emissive surface, for pictures with `lights=points`.
    pub(super) fn proxy(&mut self, name: &str, color: [f32; 3], kind: LightKind) {
        self.shine(Light { name: name.to_owned(), color, spectrum: None, extent: None, kind, proxy: true });
    }

    /// Adds a pinhole camera with a vertical field of view in degrees; the renderer chooses the near distance.
    pub(super) fn camera(&mut self, name: &str, eye: DVec3, target: DVec3, fov_y_degrees: f64) {
        self.scene.cameras.push(Camera {
            name: name.to_owned(),
            world_from_camera: facing(eye, eye - target),
            projection: Projection::Perspective { fov_y: fov_y_degrees.to_radians(), near: None },
        });
    }

    /// Adds the built-in studio environment to the scene's own lights, for surfaces that need an environment to
    /// reflect.
    pub(super) fn studio(&mut self, intensity: f32) {
        self.scene.studio = Some(intensity);
    }

    pub(super) fn finish(self) -> Scene {
        self.scene
    }
}

/// A frame at `position` whose +Z points along `forward`, with +Y as vertical as possible; for vertical `forward`, −Z
/// of the world is up.
pub(super) fn facing(position: DVec3, forward: DVec3) -> DAffine3 {
    let z = forward.normalize();
    let up = if z.y.abs() > 0.999_999 { DVec3::NEG_Z } else { DVec3::Y };
    let x = up.cross(z).normalize();
    DAffine3::from_mat3_translation(DMat3::from_cols(x, z.cross(x), z), position)
}

/// A frame at `(x, y, z)`, rotated about +Y by an angle in degrees.
pub(super) fn at(x: f64, y: f64, z: f64, turn_degrees: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z)) * DAffine3::from_rotation_y(turn_degrees.to_radians())
}

/// A dielectric of one colour.
pub(super) fn dielectric(name: &str, color: [f32; 3], roughness: f32) -> Material {
    let [r, g, b] = color;
    Material { name: name.to_owned(), base_color: [r, g, b, 1.0], metallic: 0.0, roughness, ..Material::default() }
}

/// A metal of reflectance `f0` at normal incidence.
pub(super) fn metal(name: &str, f0: [f32; 3], roughness: f32) -> Material {
    Material { metallic: 1.0, ..dielectric(name, f0, roughness) }
}

/// A conductor of known n and κ.
pub(super) fn conductor(name: &str, known: Metal, roughness: f32) -> Material {
    Material {
        conductor: Some(known.index()),
        conductor_spectra: known.spectra(),
        ..metal(name, known.f0(), roughness)
    }
}

/// A smooth dielectric of known index and dispersion.
pub(super) fn medium(name: &str, known: Medium) -> Material {
    Material { ior: known.n as f32, dispersion: known.dispersion, ..dielectric(name, [1.0; 3], 0.0) }
}

/// A clear solid of index `ior`. Its mesh bounds the volume, so any thickness above 0 will do.
pub(super) fn glass(name: &str, ior: f32, thickness: f32) -> Material {
    Material { transmission: 1.0, ior, thickness, ..dielectric(name, [1.0; 3], 0.0) }
}

/// A black surface that emits `radiance`, W/(m² sr).
pub(super) fn emitter(name: &str, radiance: [f32; 3]) -> Material {
    Material { emissive: radiance, specular: 0.0, ..dielectric(name, [0.0; 3], 1.0) }
}

/// sRGB encoding of a linear value as a byte (IEC 61966-2-1).
fn srgb8(linear: f64) -> u8 {
    let v = linear.clamp(0.0, 1.0);
    let encoded = if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}
