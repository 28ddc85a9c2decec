//! Scenes as data: what a file says, in world units, before any device sees it.
//!
//! Nothing here knows Vulkan. A [`Scene`] comes from [`load`] (glTF, OBJ) or from [`crate::study`];
//! the passes upload it. Lengths are metres, the world is right-handed with +Y up as in glTF 2.0 section 3.4.

mod accessor;
pub mod camera;
pub mod canonical;
mod container;
pub mod environment;
mod geometry;
mod gltf_extras;
mod gltf_import;
mod gltf_material;
pub mod light;
pub mod lobe;
pub mod material;
mod nodes;
mod obj;
mod pictures;
pub mod prune;
mod shared;
pub mod sigma;
pub mod solid;
pub mod study;
pub mod substance;
mod thin;
pub mod wavelengths;

use std::path::Path;

use anyhow::{Context, Result, bail};
use glam::{DAffine3, DVec3};

pub use camera::{Camera, Projection};
pub use light::{Extent, Light, LightKind};
pub use material::{AlphaMode, Material, Meaning, Sampler, TextureRef, Wrap};
pub use prune::{AmbientLight, Prune};
pub use shared::{Mark, Shared};
pub use sigma::SigmaGrid;

/// What [`load`] may be told.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LoadOptions {
    /// Animation time in seconds at which the scene is frozen; all animations of the file play together, each
    /// channel clamped to its own range. `None` is the rest pose stored in the file: node transforms and default
    /// weights as written, skins evaluated with them.
    pub time: Option<f64>,
    /// What is read of it.
    pub prune: Prune,
}

/// Reads a scene from a glTF 2.0 file (`.gltf`, `.glb`) or a Wavefront file (`.obj`).
///
/// # Errors
/// One sentence when printed with `{:#}`: the file, the place in it and what is wrong there.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let scene = match extension.as_str() {
        "gltf" | "glb" => gltf_import::load(path, options),
        "obj" => obj::load(path, options.prune),
        _ => {
            bail!("loading {}: only .gltf, .glb and .obj files are supported", path.display())
        }
    };
    let mut scene = scene.with_context(|| format!("loading {}", path.display()))?;
    sigma::one_medium_each(&mut scene);
    Ok(scene)
}

/// A scene that is looked at one moment after another: its file is read once, and all moments share what does not move.
pub struct Source {
    kind: Kind,
    prune: Prune,
}

enum Kind {
    Gltf {
        file: Box<gltf_import::GltfFile>,
        name: String,
    },
    /// Nothing moves.
    Still(Box<Scene>),
}

impl Source {
    /// Opens a file that [`load`] reads.
    ///
    /// # Errors
    /// As [`load`].
    pub fn open(path: &Path, prune: Prune) -> Result<Self> {
        let is_gltf = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf") || e.eq_ignore_ascii_case("glb"));
        if !is_gltf {
            return Ok(Self::still(load(path, &LoadOptions { time: None, prune })?));
        }
        let name = path.display().to_string();
        let file = Box::new(gltf_import::GltfFile::open(path).with_context(|| format!("loading {name}"))?);
        Ok(Self { kind: Kind::Gltf { file, name }, prune })
    }

    /// A scene that does not move.
    #[must_use]
    pub fn still(scene: Scene) -> Self {
        Self { kind: Kind::Still(Box::new(scene)), prune: Prune::Nothing }
    }

    /// The scene at a moment of its animation; `None` is its rest pose. What [`load`] gives, to the last bit; its warnings of what does
    /// not move are those of the first moment.
    ///
    /// # Errors
    /// As [`load`].
    pub fn at(&mut self, time: Option<f64>) -> Result<Scene> {
        match &mut self.kind {
            Kind::Still(scene) => Ok(Scene::clone(scene)),
            Kind::Gltf { file, name } => {
                let options = LoadOptions { time, prune: self.prune };
                let mut scene = file.at(&options).with_context(|| format!("loading {name}"))?;
                sigma::one_medium_each(&mut scene);
                Ok(scene)
            }
        }
    }
}

/// Everything a picture is made from.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// What the user asked for: a path or `study:NAME`.
    pub name: String,
    /// Geometry in object space; drawn only through [`Scene::instances`].
    pub meshes: Vec<Mesh>,
    /// Placements of meshes in the world.
    pub instances: Vec<Instance>,
    /// Surface descriptions; never empty once meshes exist (glTF's default material is appended when needed).
    pub materials: Vec<Material>,
    /// Decoded pictures that materials refer to.
    pub images: Vec<Image>,
    /// Punctual lights in world space.
    pub lights: Vec<Light>,
    /// Intensity of the built-in studio where the user names no environment; `None`: 1 for a scene without lights of its
    /// own, and no studio beside lights.
    pub studio: Option<f32>,
    /// Cameras in world space, in the order of the file's nodes.
    pub cameras: Vec<Camera>,
    /// Seconds after which nothing moves any more; `None` where there is no animation.
    pub duration: Option<f64>,
    /// Textures and texture coordinates that are not read, with the reason, a sentence each.
    pub unread: Vec<String>,
    /// Things that were read around: each one sentence that names the file, the place and the consequence.
    pub warnings: Vec<String>,
}

/// Triangles that share one material, in object space.
///
/// Points and lines of a file have become thin triangles by the time a mesh exists.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Name from the file, for messages and object labels.
    pub name: String,
    /// Object-space positions in metres.
    pub positions: Shared<[f32; 3]>,
    /// Unit normals, one per position.
    pub normals: Shared<[f32; 3]>,
    /// Unit tangents with handedness in w; one per position, or empty when the material has no normal map.
    pub tangents: Shared<[f32; 4]>,
    /// Two texture-coordinate sets; each has one entry per position or is empty.
    pub uvs: [Shared<[f32; 2]>; 2],
    /// Linear vertex colours with alpha; one per position or empty (white).
    pub colors: Shared<[f32; 4]>,
    /// Three indices a triangle, each below `positions.len()`; counter-clockwise seen from the front.
    pub indices: Shared<u32>,
    /// Index into [`Scene::materials`].
    pub material: usize,
}

/// One mesh placed in the world.
#[derive(Debug, Clone)]
pub struct Instance {
    /// Name of the node.
    pub name: String,
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    /// Affine placement in f64, so that a chain of nodes far from the origin keeps its millimetres.
    /// May mirror (negative determinant) and scale non-uniformly.
    pub world_from_object: DAffine3,
}

/// A decoded picture: 8-bit RGBA rows from the top.
#[derive(Debug, Clone, Default)]
pub struct Image {
    /// Name or URI, for messages.
    pub name: String,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// `width * height * 4` bytes, as stored: not premultiplied, not linearised.
    pub rgba: Shared<u8>,
}

/// An axis-aligned box in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Smallest corner.
    pub min: DVec3,
    /// Largest corner.
    pub max: DVec3,
}

impl Bounds {
    /// Half the diagonal: the radius of the sphere around the box, in metres.
    #[must_use]
    pub fn radius(&self) -> f64 {
        (self.max - self.min).length() * 0.5
    }

    /// Middle of the box.
    #[must_use]
    pub fn center(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }
}

impl Scene {
    /// World-space box around every vertex that has a finite place; `None` for a scene without any.
    #[must_use]
    pub fn bounds(&self) -> Option<Bounds> {
        let mut bounds: Option<Bounds> = None;
        for instance in &self.instances {
            let mesh = &self.meshes[instance.mesh];
            for &position in &mesh.positions {
                let p_world = instance.world_from_object.transform_point3(glam::Vec3::from(position).as_dvec3());
                if !p_world.is_finite() {
                    continue;
                }
                bounds = Some(bounds.map_or(Bounds { min: p_world, max: p_world }, |b| Bounds {
                    min: b.min.min(p_world),
                    max: b.max.max(p_world),
                }));
            }
        }
        bounds
    }

    /// The place of each instance's first triangle among those of the scene, instance by instance.
    #[must_use]
    pub fn first_triangles(&self) -> Vec<u32> {
        let counts = self.instances.iter().map(|i| (self.meshes[i.mesh].indices.len() / 3) as u32);
        counts.scan(0, |next, count| Some(std::mem::replace(next, *next + count))).collect()
    }

    /// Triangles as drawn: instances counted.
    #[must_use]
    pub fn triangles(&self) -> usize {
        self.instances.iter().map(|i| self.meshes[i.mesh].indices.len() / 3).sum()
    }
}
