//! Scene description: meshes, instances, materials, images, lights and cameras, in world units and before upload.
//!
//! A [`Scene`] comes from [`load`] (glTF, OBJ) or from [`crate::study`]; the passes upload it. Nothing here uses
//! Vulkan. Read glTF 2.0, sections 3.4 to 3.11. Assumes metres and a right-handed world with +Y up (glTF 2.0 section
//! 3.4).

mod accessor;
pub mod camera;
pub mod canonical;
mod container;
#[doc(hidden)]
pub mod decompress;
mod document;
pub mod environment;
pub mod extensions;
pub mod framing;
mod geometry;
mod glb;
mod gltf_extras;
mod gltf_import;
mod gltf_material;
mod lenient;
pub mod light;
pub mod lobe;
pub mod material;
mod mesh_files;
mod names;
mod nodes;
mod obj;
pub mod outline;
mod pictures;
pub mod prune;
mod shared;
pub mod sigma;
pub mod solid;
pub mod study;
pub mod substance;
mod thin;
mod uri;
pub mod wavelengths;

use std::io::Read as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use glam::{DAffine3, DVec3};

pub use camera::{Camera, Projection};
pub use light::{Extent, KeyLight, Light, LightKind};
pub use material::{AlphaMode, Material, Meaning, Sampler, TextureRef, Wrap};
pub use outline::Outline;
pub use pictures::{REPLACED, UnreadableImage};
pub use prune::{AmbientLight, Prune};
pub use shared::{Mark, Shared};
pub use sigma::SigmaGrid;

/// What happens where an image of a file is missing or broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MissingImages {
    /// The file is refused.
    #[default]
    Error,
    /// A checker stands in the image's place, with a warning that ends in [`REPLACED`].
    Checker,
}

/// Options of [`load`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LoadOptions {
    /// Animation time in seconds at which the scene is frozen, each channel clamped to its own range. `None` is the
    /// rest pose stored in the file: node transforms and default weights as written, with skins evaluated from them.
    pub time: Option<f64>,
    /// Which textures and vertex attributes are left unread.
    pub prune: Prune,
    /// Scene of the file, by name or index; `None` is the file's default scene.
    pub scene: Option<String>,
    /// Variant of the materials (KHR_materials_variants), by name or index; `None` is the file's default.
    pub variant: Option<String>,
    /// Animation that plays, by name or index, or `all`. `None` plays all that do not contradict each other: an
    /// animation that moves what an earlier one moves does not play.
    pub animation: Option<String>,
    /// Nodes that are left out with everything below them, by name or index. Their cameras stay.
    pub hide: Vec<String>,
    /// Nodes that alone are shown, with everything below them; empty: all of them.
    pub only: Vec<String>,
    /// A directional light beside those of the file.
    pub key_light: Option<KeyLight>,
    /// What happens where an image is missing or broken.
    pub missing: MissingImages,
}

/// File name extensions of the files that [`load`] reads, in lower case; upper case is read as well.
pub const EXTENSIONS: [&str; 5] = ["gltf", "glb", "obj", "stl", "ply"];

/// The path that stands for standard input.
const STANDARD_INPUT: &str = "-";

fn is_standard_input(path: &Path) -> bool {
    path.as_os_str() == STANDARD_INPUT
}

/// The name of a file in messages.
fn said(path: &Path) -> String {
    if is_standard_input(path) { "standard input".to_owned() } else { path.display().to_string() }
}

/// The extension of a path in lower case. Standard input is read as glTF: its first bytes tell GLB from JSON.
fn extension(path: &Path) -> String {
    if is_standard_input(path) {
        return "gltf".to_owned();
    }
    path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase()
}

/// Reads a scene from a glTF 2.0 file (`.gltf`, `.glb`), a Wavefront file (`.obj`), or a mesh (`.stl`, `.ply`). The
/// path `-` is a glTF 2.0 file on standard input, which can be read once; its relative URIs start at the working
/// folder.
///
/// # Errors
/// One sentence when printed with `{:#}`: the file, the place in the file and the fault there.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene> {
    let scene = match extension(path).as_str() {
        "gltf" | "glb" => gltf_import::load(path, options),
        "obj" | "stl" | "ply" if options.scene.is_some() || options.variant.is_some() => {
            bail!("loading {}: only glTF files have scenes and variants to choose", path.display())
        }
        "obj" => obj::load(path, options),
        "stl" => mesh_files::load_stl(path),
        "ply" => mesh_files::load_ply(path),
        _ => {
            let [others @ .., last] = EXTENSIONS.map(|known| format!(".{known}"));
            bail!("loading {}: only {} and {last} files are supported", path.display(), others.join(", "))
        }
    };
    let mut scene = scene.and_then(|scene| completed(scene, options));
    scene.iter_mut().for_each(sigma::one_medium_each);
    scene.with_context(|| format!("loading {}", said(path)))
}

/// Completes a scene that was read or generated: its outline, and the options that need no file.
///
/// # Errors
/// When the options name a node or an animation that is not there.
pub fn completed(mut scene: Scene, options: &LoadOptions) -> Result<Scene> {
    if scene.outline == Outline::default() {
        outline::flat(&mut scene, options)?;
    }
    scene.lights.extend(options.key_light.map(KeyLight::light));
    Ok(scene)
}

/// The content of a file; the error is its cause alone, for the caller names the file.
fn contents(path: &Path) -> Result<Vec<u8>> {
    let read = || match is_standard_input(path) {
        true => {
            let mut bytes = Vec::new();
            std::io::stdin().lock().read_to_end(&mut bytes)?;
            Ok(bytes)
        }
        false => std::fs::read(path),
    };
    read().map_err(|error| anyhow::anyhow!(etalon_image::file::cause(&error)))
}

/// An animated scene: its file is read once, and all moments of the animation share the static parts.
pub struct Source {
    kind: Kind,
    options: LoadOptions,
}

enum Kind {
    Gltf {
        file: Box<gltf_import::GltfFile>,
        name: String,
    },
    /// A scene without animation.
    Still(Box<Scene>),
}

impl Source {
    /// Opens a file that [`load`] reads.
    ///
    /// # Errors
    /// The errors of [`load`].
    pub fn open(path: &Path, options: LoadOptions) -> Result<Self> {
        if !["gltf", "glb"].contains(&extension(path).as_str()) {
            return Ok(Self::still(load(path, &LoadOptions { time: None, ..options })?));
        }
        let name = said(path);
        let file = Box::new(gltf_import::GltfFile::open(path, &options).with_context(|| format!("loading {name}"))?);
        Ok(Self { kind: Kind::Gltf { file, name }, options })
    }

    /// A source for a scene without animation.
    #[must_use]
    pub fn still(scene: Scene) -> Self {
        Self { kind: Kind::Still(Box::new(scene)), options: LoadOptions::default() }
    }

    /// The scene at `time` seconds of its animation; `None` is its rest pose. The result equals that of [`load`], to
    /// the last bit. Warnings about static parts are those of the first moment.
    ///
    /// # Errors
    /// The errors of [`load`].
    pub fn at(&mut self, time: Option<f64>) -> Result<Scene> {
        match &mut self.kind {
            Kind::Still(scene) => Ok(Scene::clone(scene)),
            Kind::Gltf { file, name } => {
                self.options.time = time;
                let mut scene = file.at(&self.options).and_then(|scene| completed(scene, &self.options));
                scene.iter_mut().for_each(sigma::one_medium_each);
                scene.with_context(|| format!("loading {name}"))
            }
        }
    }
}

/// A whole scene, as the renderer receives it.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// The name the user gave: a path or `study:NAME`.
    pub name: String,
    /// Geometry in object space; only [`Scene::instances`] are drawn.
    pub meshes: Vec<Mesh>,
    /// Placements of meshes in the world.
    pub instances: Vec<Instance>,
    /// Surface descriptions; never empty once meshes exist (glTF's default material is appended when needed).
    pub materials: Vec<Material>,
    /// Decoded images of the materials' textures.
    pub images: Vec<Image>,
    /// Punctual lights in world space.
    pub lights: Vec<Light>,
    /// Scale of the built-in studio environment when the user names no environment. `None`: 1 for a scene without
    /// lights of its own, and no studio in a scene with lights.
    pub studio: Option<f32>,
    /// Cameras in world space, in the order of the file's nodes.
    pub cameras: Vec<Camera>,
    /// Length of the animations that play, in seconds; `None` without animation.
    pub duration: Option<f64>,
    /// What the file contains, for lists to choose from.
    pub outline: Outline,
    /// Files that the scene's own file names: buffers, images, material libraries.
    pub files: Vec<PathBuf>,
    /// Textures and texture coordinates that were pruned as unused, one sentence each with the reason.
    pub unread: Vec<String>,
    /// Faults that reading worked around: one sentence each with the file, the place and the consequence.
    pub warnings: Vec<String>,
}

/// Triangles that share one material, in object space.
///
/// Points and lines of a file become thin triangles before a mesh exists.
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
    /// Three indices per triangle, each below `positions.len()`; counter-clockwise seen from the front.
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
    /// Affine placement in f64, so that a chain of nodes far from the origin keeps millimetres.
    /// May mirror (negative determinant) and scale non-uniformly.
    pub world_from_object: DAffine3,
}

/// A decoded image: 8-bit RGBA rows from the top.
#[derive(Debug, Clone, Default)]
pub struct Image {
    /// Name or URI, for messages.
    pub name: String,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// `width * height * 4` bytes, as stored: alpha not premultiplied, colour not linearised.
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
    /// Half the diagonal in metres: the radius of the bounding sphere of the box.
    #[must_use]
    pub fn radius(&self) -> f64 {
        (self.max - self.min).length() * 0.5
    }

    /// The eight corners of the box.
    #[must_use]
    pub fn corners(&self) -> [DVec3; 8] {
        let ends = [self.min, self.max];
        std::array::from_fn(|i| DVec3::new(ends[i & 1].x, ends[i >> 1 & 1].y, ends[i >> 2].z))
    }

    /// Centre of the box.
    #[must_use]
    pub fn center(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }
}

impl Scene {
    /// The camera that a user means by a word: its key, its name or its index; `None` where there is no such camera.
    #[must_use]
    pub fn camera(&self, wanted: &str) -> Option<&Camera> {
        let names: Vec<Option<&str>> = self.cameras.iter().map(|camera| Some(camera.name.as_str())).collect();
        names::position(wanted, &names).map(|index| &self.cameras[index])
    }

    /// The word by which [`Scene::camera`] finds each camera: its name if no other camera has it, else its index.
    #[must_use]
    pub fn camera_keys(&self) -> Vec<String> {
        names::keys(&self.cameras.iter().map(|camera| Some(camera.name.as_str())).collect::<Vec<_>>())
    }

    /// World-space box of every vertex with a finite position; `None` for a scene without such a vertex.
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

    /// Index of each instance's first triangle in the scene's triangle list, which runs instance by instance.
    #[must_use]
    pub fn first_triangles(&self) -> Vec<u32> {
        let counts = self.instances.iter().map(|i| (self.meshes[i.mesh].indices.len() / 3) as u32);
        counts.scan(0, |next, count| Some(std::mem::replace(next, *next + count))).collect()
    }

    /// Number of triangles over all instances.
    #[must_use]
    pub fn triangles(&self) -> usize {
        self.instances.iter().map(|i| self.meshes[i.mesh].indices.len() / 3).sum()
    }
}
