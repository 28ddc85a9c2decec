//! Small scenes built in code.

use etalon::scene::{AlphaMode, Camera, Instance, Light, LightKind, Material, Mesh, Projection, Scene};
use etalon::study::shape::Shape;
use glam::{DAffine3, DMat3, DVec3};

/// A scene under construction.
pub struct Made(pub Scene);

impl Made {
    /// An empty scene.
    pub fn new(name: &str) -> Self {
        Self(Scene { name: name.to_owned(), ..Scene::default() })
    }

    /// Adds a mesh with its material, without an instance; returns the index of the mesh.
    pub fn mesh(&mut self, shape: Shape, material: Material) -> usize {
        self.0.materials.push(material);
        self.0.meshes.push(Mesh {
            name: "made".to_owned(),
            positions: shape.positions.into(),
            normals: shape.normals.into(),
            uvs: [shape.uvs.into(), Vec::new().into()],
            indices: shape.indices.into(),
            material: self.0.materials.len() - 1,
            ..Mesh::default()
        });
        self.0.meshes.len() - 1
    }

    /// Adds an instance of a mesh.
    pub fn place(&mut self, mesh: usize, world_from_object: DAffine3) {
        self.0.instances.push(Instance { name: "made".to_owned(), mesh, world_from_object });
    }

    /// Adds a mesh with one instance.
    pub fn add(&mut self, shape: Shape, material: Material, world_from_object: DAffine3) {
        let mesh = self.mesh(shape, material);
        self.place(mesh, world_from_object);
    }

    /// Adds a light; `color` has the unit of `Light::color`: cd, or lx for directional lights.
    pub fn light(&mut self, color: [f32; 3], kind: LightKind) {
        self.0.lights.push(Light { name: "made".to_owned(), color, spectrum: None, extent: None, kind, proxy: false });
    }

    /// Adds a camera at `eye` that looks at `target`.
    pub fn camera(&mut self, eye: DVec3, target: DVec3, projection: Projection) {
        self.0.cameras.push(Camera { projection, ..looking(eye, target) });
    }

    /// Adds an orthographic camera along −Z at z = 10 that sees the square |y| ≤ `half_height`.
    pub fn front(&mut self, half_height: f64) {
        self.camera(DVec3::Z * 10.0, DVec3::ZERO, orthographic(half_height));
    }
}

/// An upright perspective camera with a vertical field of view of 0.7 rad.
pub fn looking(eye: DVec3, target: DVec3) -> Camera {
    let up = if (target - eye).normalize().y.abs() > 0.999 { DVec3::NEG_Z } else { DVec3::Y };
    Camera::looking_at(eye, target, up, 0.7).expect("a camera")
}

/// A perspective projection; vertical field of view in degrees.
pub fn perspective(degrees: f64) -> Projection {
    Projection::Perspective { fov_y: degrees.to_radians(), near: None }
}

/// An orthographic projection; half the height of the picture in metres.
pub fn orthographic(half_height: f64) -> Projection {
    Projection::Orthographic { half_height, near: 0.5, far: 40.0 }
}

/// A translation.
pub fn at(x: f64, y: f64, z: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z))
}

/// An exact quarter turn about +Y: no rounding in the matrix.
pub fn quarter_turn() -> DAffine3 {
    DAffine3::from_mat3(DMat3::from_cols(DVec3::NEG_Z, DVec3::Y, DVec3::X))
}

/// A Lambertian reflector without a specular lobe.
pub fn lambert(albedo: [f32; 3]) -> Material {
    let [r, g, b] = albedo;
    Material {
        base_color: [r, g, b, 1.0],
        metallic: 0.0,
        roughness: 1.0,
        specular: 0.0,
        double_sided: true,
        ..Material::default()
    }
}

/// An unlit material: its colour is the radiance.
pub fn unlit(color: [f32; 3]) -> Material {
    Material { unlit: true, ..lambert(color) }
}

/// An unlit, alpha-blended material.
pub fn pane(color: [f32; 3], alpha: f32) -> Material {
    let [r, g, b] = color;
    Material { base_color: [r, g, b, alpha], alpha_mode: AlphaMode::Blend, ..unlit(color) }
}
