//! Ray tracing data on the device: the BVH in the layout of its traversal, triangles, and shading data of their corners
//! (shaders/lib/trace.glsl, hit.glsl).
//!
//! Read pbrt (4th ed.), section 7.3 (BVH), and docs/decisions/rays.md. Coordinates are in bvh space: world axes,
//! metres, origin at the anchor.

use std::mem::offset_of;
use std::sync::Arc;

use anyhow::{Result, bail};
use ash::vk;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::Serialize;

use super::emitters::EmittersOnDevice;
use super::path_guiding::GuidingOnDevice;
use super::photon_map::PhotonsOnDevice;
use super::scene::{BENT, cofactors as cofactors_of, medium, texture_bits};
use super::table::{pack_half_2x16, upload};
use super::view::View;
use crate::gpu::{Buffer, Device, Frame, NOTHING, Place};
use crate::plan::{Architecture, Paths, Plan, Rays};
use crate::prepare::{Hierarchy, Prepared, ray_offset};
use crate::scene::solid::{Solids, media_at};
use crate::scene::{AlphaMode, Mesh, Scene, Shared};
use crate::shader::lib;
use crate::shader::lib::trace::{FILTER, LINKS_16, LINKS_32, OCTANT_LISTS, OPAQUE, STACK, TRAIL_LEVELS};
use crate::share::{
    self, BvhTriangle, CornerColors, CornerFrame, CornerTangents, CornerUvs, MATERIAL_OF_TRIANGLE, ONE_SIDED_TRIANGLE,
    SHEET_TRIANGLE, TraceTerms, WorkCounts,
};
use crate::transport::bvh::{Format, Order, Triangle};
use crate::transport::emitters::{EmitterSource, Emitters};
use crate::transport::light_hierarchy::LightHierarchy;
use crate::transport::photon_guiding::PhotonGuiding;
use crate::transport::photon_map::PhotonEmission;

/// Largest size of the eight octant-ordered node lists in bytes, some two million nodes of 16 bytes: they are eight
/// copies of the BVH.
const MOST_ORDERED_BYTES: usize = 256 << 20;

/// The BVH traversal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Traversal {
    /// Stackless traversal by skip pointers (threaded BVH), with quantised nodes of 16 bytes.
    Links16 = LINKS_16 as isize,
    /// Stackless traversal by skip pointers, with nodes of 32 bytes, for scenes whose boxes are too small for a 16-bit
    /// grid.
    Links32 = LINKS_32 as isize,
    /// Traversal with a short stack; nodes of 64 bytes hold the boxes of both children.
    Stack = STACK as isize,
}

/// Figures about the BVH, for reports.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BvhFacts {
    /// Build and validation time in milliseconds.
    pub build_ms: f64,
    /// Time in milliseconds to convert it to the device's layout.
    pub layout_ms: f64,
    /// Number of triangles.
    pub triangles: usize,
    /// Number of omitted triangles: degenerate or not finite.
    pub dropped: usize,
    /// Number of nodes.
    pub nodes: usize,
    /// Depth: edges from the root to the deepest leaf.
    pub depth: u32,
    /// Surface area heuristic (SAH): expected nodes and triangles visited by a line through the root's box.
    pub sah: f64,
    /// Traversal.
    pub traversal: Traversal,
    /// Whether some closed dielectric mesh touches another surface (coincident interfaces).
    pub touching: bool,
    /// Size on the device in bytes.
    pub bytes: u64,
}

/// Specialization constants of every pass that includes shaders/lib/trace.glsl.
#[derive(Debug, Clone, Copy)]
pub struct TraceConstants {
    /// A [`Traversal`].
    pub traversal: u32,
    /// Whether nearest-hit rays use octant-ordered node lists.
    pub octants: bool,
    /// Vertex attributes and texture slots that ray hits read.
    pub hit: lib::hit::Constants,
    /// [`BvhFacts::touching`].
    pub touching: bool,
}

impl Default for TraceConstants {
    /// Constants of shaders that send no rays.
    fn default() -> Self {
        Self { traversal: 0, octants: false, hit: lib::hit::Constants::default(), touching: false }
    }
}

/// Ray tracing data of a scene; dummies where the plan sends no rays.
pub struct RaysOnDevice {
    /// Nodes of all node lists.
    pub nodes: Buffer,
    /// One [`BvhTriangle`] per triangle, then the emitters.
    pub triangles: Buffer,
    /// Shading data of the triangles' corners: [`share::Corners`] as far as the scene needs them.
    pub corners: Buffer,
    /// Coplanar group of each triangle, in leaf order.
    pub faces: Vec<u32>,
    /// For each triangle of the scene, in the order of instances, its index among the BVH's leaves.
    pub leaf_places: Buffer,
    /// Light sampling tables.
    pub emitters: EmittersOnDevice,
    /// Guiding distribution of path guiding.
    pub guiding: GuidingOnDevice,
    /// Photons of punctual lights.
    pub photons: PhotonsOnDevice,
    /// [`TraceTerms`].
    pub terms: Buffer,
    /// [`WorkCounts`].
    pub counts: Buffer,
    /// Specialization constants.
    pub constants: TraceConstants,
    /// Figures for reports; `None` without rays.
    pub facts: Option<BvhFacts>,
    fixed: TraceTerms,
    snap_pixels: f64,
    anchor: DVec3,
    /// The closed dielectric meshes, to find the media around the eye.
    bodies: Scene,
    solids: Solids,
}

impl RaysOnDevice {
    /// Uploads the BVH and its tables, where the plan sends rays.
    ///
    /// # Errors
    /// When the scene does not fit the device.
    pub fn new(device: &Arc<Device>, prepared: &Prepared, traversal: Option<Traversal>) -> Result<Self> {
        let Prepared { scene, plan, solids, emitters, .. } = prepared;
        let Some((rays, hierarchy)) = plan.rays.zip(prepared.hierarchy.as_ref()) else {
            return Self::none(device, scene);
        };
        let &Hierarchy { ref bvh, build_ms, offset, touching, occluder_radiosity, .. } = hierarchy;
        let start = std::time::Instant::now();
        // The traversal: with a short stack on GPUs, where its trail is long enough; 16-bit boxes where these are
        // precise enough.
        let by_links = if bvh.fits_grid() { Traversal::Links16 } else { Traversal::Links32 };
        let stacks = plan.architecture == Architecture::Gpu && bvh.depth <= TRAIL_LEVELS;
        let default = if stacks { Traversal::Stack } else { by_links };
        let traversal = traversal.unwrap_or(default);
        if traversal == Traversal::Stack && bvh.depth > TRAIL_LEVELS {
            let (name, depth) = (&scene.name, bvh.depth);
            bail!("{name}: traversal with a stack follows at most {TRAIL_LEVELS} levels of the BVH, it has {depth}");
        }
        let format = if traversal == Traversal::Links32 { Format::Float } else { Format::Quantised };
        // One node list per octant of directions is front to back for every ray, as long as eight copies of the BVH are
        // small.
        let ordered = Order::OCTANTS.len() * bvh.nodes.len() * format.texels() * 16;
        let octants = traversal != Traversal::Stack && ordered <= MOST_ORDERED_BYTES;
        // Surfaces that shadow rays may pass, by instance and then by triangle.
        let filter: Vec<bool> = (0..scene.instances.len()).map(|i| is_filter(scene, solids, plan, i)).collect();
        let filters: Vec<bool> = bvh.triangles.iter().map(|t| filter[t.instance as usize]).collect();
        // The nodes in the layout of the traversal. A walk along links ends at the sentinel.
        let (nodes, sentinel) = match traversal {
            Traversal::Stack => (bvh.stack_nodes(), 0),
            Traversal::Links16 | Traversal::Links32 => {
                let ordered: &[Order] = if octants { &Order::OCTANTS } else { &[] };
                let lists = bvh.lists(&[ordered, &[Order::AnyHit]].concat(), format);
                (lists.concat(), lists[0].len() / format.texels() - 1)
            }
        };
        // A ray ignores the coplanar group that it starts from: groups of the meshes, numbered through the scene.
        let first_triangle = scene.first_triangles();
        let faces_of_meshes: Vec<Vec<u32>> = scene.meshes.par_iter().map(flat_faces).collect();
        let faces: Vec<u32> = bvh
            .triangles
            .iter()
            .map(|t| {
                let local = &faces_of_meshes[scene.instances[t.instance as usize].mesh];
                first_triangle[t.instance as usize] + local[t.primitive as usize]
            })
            .collect();
        let corners = CornerTable::of(scene, solids, rays, plan.paths.is_some() || plan.light_samples.emitting);
        // The way back from a triangle of the scene to its leaf; dropped triangles have none.
        let mut leaf_places = vec![u32::MAX; scene.triangles()];
        for (place, t) in bvh.triangles.iter().enumerate() {
            leaf_places[(first_triangle[t.instance as usize] + t.primitive) as usize] = place as u32;
        }
        let by_place = plan.light_samples.hierarchy.then(|| {
            let corners_of = |index: u32| {
                let t = bvh.triangles.get(leaf_places[index as usize] as usize)?;
                Some(corners.order(t).map(|i| glam::Vec3::from(t.corners[i]).as_dvec3()))
            };
            LightHierarchy::of(emitters, &scene.lights, bvh.anchor, corners_of)
        });
        let by_place = by_place.filter(|hierarchy| !hierarchy.nodes.is_empty());
        // Paths that hit an emissive triangle need its density as a light sample: its probability over its area. With a
        // light hierarchy the probability depends on the point, and they need the way to it.
        let mut picked = vec![0; scene.triangles()];
        for (i, emitter) in emitters.list.iter().enumerate() {
            if let EmitterSource::Triangle { index, area, .. } = emitter.source {
                let density = (emitter.probability / area) as f32;
                picked[index as usize] = by_place.as_ref().map_or(density.to_bits(), |by_place| by_place.trails[i]);
            }
        }
        // Triangles in leaf order, with the front counter-clockwise also where the instance is mirrored.
        let leaves: Vec<BvhTriangle> = bvh
            .triangles
            .par_iter()
            .zip(filters.par_iter().zip(&faces))
            .map(|(t, (&is_filter, &face))| {
                let [a, b, c] = corners.order(t).map(|i| t.corners[i]);
                let stops = if is_filter { FILTER } else { OPAQUE };
                let picked = picked[(first_triangle[t.instance as usize] + t.primitive) as usize];
                BvhTriangle { a, stops, b, face, c, picked }
            })
            .collect();
        let hit_corners: Vec<[u32; 4]> = bvh.triangles.par_iter().flat_map_iter(|t| corners.texels(t)).collect();
        let layout_ms = start.elapsed().as_secs_f64() * 1e3;
        let grid = bvh.grid();
        let format = Some(vk::Format::R32G32B32A32_UINT);
        let nodes_buffer = upload(device, "BVH nodes", &nodes, format)?;
        let mut triangles: Vec<[u32; 4]> = bytemuck::cast_slice(&leaves).to_vec();
        let emitters_on_device =
            EmittersOnDevice::new(device, emitters, &leaf_places, by_place.as_ref(), &mut triangles)?;
        let triangle_buffer = upload(device, "BVH triangles", &triangles, format)?;
        let corner_buffer = upload(device, "corners for rays", &hit_corners, format)?;
        let fixed = TraceTerms {
            offset: offset as f32,
            grid_middle: grid.middle,
            grid_unit: grid.unit,
            nodes: sentinel as u32,
            interfaces: rays.interfaces,
            occluder_radiosity: share::OccluderRadiosity {
                along: occluder_radiosity.along.as_mat3().to_cols_array_2d(),
                against: occluder_radiosity.against.as_mat3().to_cols_array_2d(),
                by_place: occluder_radiosity.by_place.as_mat3().to_cols_array_2d(),
                by_share: occluder_radiosity.by_share.as_vec3().to_array(),
            },
            first_emitter: emitters_on_device.first,
            ..bytemuck::Zeroable::zeroed()
        };
        Ok(Self {
            terms: Buffer::new(device, "trace terms", size_of::<TraceTerms>() as u64, Place::Upload)?,
            snap_pixels: device.snap_pixels(),
            counts: Buffer::new(device, "work counts", size_of::<WorkCounts>() as u64, Place::Counters)?,
            constants: TraceConstants { traversal: traversal as u32, octants, hit: corners.contents, touching },
            facts: Some(BvhFacts {
                build_ms,
                layout_ms,
                triangles: bvh.triangles.len(),
                dropped: bvh.dropped,
                nodes: bvh.nodes.len(),
                depth: bvh.depth,
                sah: bvh.sah,
                traversal,
                touching,
                bytes: nodes_buffer.bytes() + triangle_buffer.bytes() + corner_buffer.bytes(),
            }),
            nodes: nodes_buffer,
            triangles: triangle_buffer,
            corners: corner_buffer,
            faces,
            emitters: emitters_on_device,
            guiding: match plan.paths.is_some_and(|paths| paths.guided) {
                true => GuidingOnDevice::new(device, &PhotonGuiding::of(scene, solids, bvh, emitters))?,
                false => GuidingOnDevice::none(device)?,
            },
            photons: match plan.paths {
                Some(Paths { photons, .. }) if photons > 0 => {
                    let shaped = plan.light_samples.shaped;
                    let around = |p_world| media_around(scene, solids, p_world);
                    PhotonsOnDevice::new(device, PhotonEmission::new((scene, solids, bvh), shaped, photons, around))?
                }
                _ => PhotonsOnDevice::none(device)?,
            },
            leaf_places: upload(device, "leaf places", &leaf_places, None)?,
            fixed,
            anchor: bvh.anchor,
            solids: solids.clone(),
            bodies: bodies(scene, solids, rays),
        })
    }

    /// Dummies without rays. The anchor is still that of bvh space, because shadow maps use it.
    fn none(device: &Arc<Device>, scene: &Scene) -> Result<Self> {
        let (anchor, half) =
            scene.bounds().map_or_else(Default::default, |b| (b.center(), (b.max - b.min).max_element() * 0.5));
        let nothing = |format| Buffer::texels(device, NOTHING, 0, Place::Device, format);
        Ok(Self {
            nodes: nothing(vk::Format::R32G32B32A32_UINT)?,
            triangles: nothing(vk::Format::R32G32B32A32_UINT)?,
            corners: nothing(vk::Format::R32G32B32A32_UINT)?,
            faces: Vec::new(),
            leaf_places: Buffer::new(device, NOTHING, 0, Place::Device)?,
            emitters: EmittersOnDevice::new(device, &Emitters::default(), &[], None, &mut Vec::new())?,
            guiding: GuidingOnDevice::none(device)?,
            photons: PhotonsOnDevice::none(device)?,
            terms: Buffer::new(device, "trace terms", size_of::<TraceTerms>() as u64, Place::Upload)?,
            snap_pixels: device.snap_pixels(),
            counts: Buffer::new(device, NOTHING, 0, Place::Counters)?,
            constants: TraceConstants::default(),
            facts: None,
            fixed: TraceTerms { offset: ray_offset(half) as f32, ..bytemuck::Zeroable::zeroed() },
            anchor,
            bodies: Scene::default(),
            solids: Solids::default(),
        })
    }

    /// Bindings of the traversal.
    #[must_use]
    pub fn trace(&self) -> lib::trace::Scene<'_> {
        lib::trace::Scene { bvh_nodes: &self.nodes, bvh_triangles: &self.triangles, trace_block: &self.terms }
    }

    /// Bindings of the work counts.
    #[must_use]
    pub fn work(&self) -> lib::add_work::Scene<'_> {
        lib::add_work::Scene { work_done: &self.counts }
    }

    /// Finds the media around the eye of a view, before its first sample.
    pub fn set_eye(&mut self, view: &View) {
        self.fixed.camera_media = media_around(&self.bodies, &self.solids, view.eye);
    }

    /// Updates the constants of rays for one sample of a view, whose eye is set: number `sample_index` of the
    /// `of_sum` that are summed together, of all `samples` of a pixel.
    pub fn set_view(&mut self, view: &View, [sample_index, of_sum]: [u32; 2], samples: u32, seed: u32) {
        let eye = view.eye - self.anchor;
        let terms = TraceTerms {
            bvh_from_rel: eye.as_vec3().to_array(),
            seed,
            sample_index,
            samples: of_sum.next_power_of_two(),
            pixel_angle: view.pixel_angle() as f32,
            lod_bias: -0.5 * (samples as f32).log2(),
            snap: view.snap(self.snap_pixels).map(|off| off as f32),
            ..self.fixed
        };
        self.terms.write(bytemuck::bytes_of(&terms));
    }

    /// Writes the constants of rays that are sent without a view.
    pub fn write_fixed(&mut self) {
        self.terms.write(bytemuck::bytes_of(&self.fixed));
    }

    /// Origin of bvh space in world space.
    #[must_use]
    pub fn anchor(&self) -> DVec3 {
        self.anchor
    }

    /// Ray offset from a surface, in metres.
    #[must_use]
    pub fn offset(&self) -> f32 {
        self.fixed.offset
    }

    /// Whether the eye of the last view is inside a closed dielectric mesh.
    #[must_use]
    pub fn inside(&self) -> bool {
        self.fixed.camera_media[0] != 0
    }

    /// The work counts of the sample that has just finished.
    #[must_use]
    pub fn counted(&self) -> WorkCounts {
        self.counts.read(|bytes| bytemuck::pod_read_unaligned(&bytes[..size_of::<WorkCounts>()]))
    }

    /// Resets the work counts.
    pub fn reset<'a>(&'a self, frame: &mut Frame<'a>) {
        frame.fill("reset work counts", &self.counts, 0);
    }
}

/// The media around a point of the world, as entries of shaders/lib/media.glsl.
fn media_around(scene: &Scene, solids: &Solids, p_world: DVec3) -> [u32; 4] {
    let mut media = [0; 4];
    for &instance in &media_at(scene, solids, p_world) {
        let material = solids.medium[scene.meshes[scene.instances[instance].mesh].material];
        media.copy_within(0..3, 1);
        media[0] = medium(&scene.materials[material], material);
    }
    media
}

/// Whether shadow rays may pass through an instance's surface; in path tracing only without refraction.
fn is_filter(scene: &Scene, solids: &Solids, plan: &Plan, instance: usize) -> bool {
    let material = &scene.materials[scene.meshes[scene.instances[instance].mesh].material];
    let straight = plan.paths.is_none() || solids.sheet[instance] || material.ior == 1.0;
    match material.alpha_mode {
        AlphaMode::Opaque => material.transmission > 0.0 && straight,
        AlphaMode::Mask(_) | AlphaMode::Blend => true,
    }
}

/// The coplanar group of each triangle of a mesh, identified by its first triangle: consecutive triangles with a common
/// edge in one plane, within the precision of the coordinates. A ray that leaves such a group cannot hit it again. The
/// group prevents self-intersection with the other half of a quad seen edge-on, where an intersection test is not
/// reliable.
fn flat_faces(mesh: &Mesh) -> Vec<u32> {
    let at = |i: u32| glam::Vec3::from(mesh.positions[i as usize]).as_dvec3();
    let mut faces: Vec<u32> = Vec::with_capacity(mesh.indices.len() / 3);
    let mut before: [DVec3; 3] = [DVec3::INFINITY; 3];
    let mut plane = (DVec3::ZERO, DVec3::ZERO);
    for (i, &triangle) in mesh.indices.as_chunks::<3>().0.iter().enumerate() {
        let corners = triangle.map(at);
        let shared = corners.iter().filter(|corner| before.contains(corner)).count();
        let size = corners.iter().fold(0.0_f64, |m, c| m.max(c.abs().max_element()));
        let (point, normal) = plane;
        let flat = corners.iter().all(|&c| (c - point).dot(normal).abs() <= 2.0_f64.powi(-22) * size);
        if shared >= 2 && flat && normal != DVec3::ZERO {
            faces.push(faces[i - 1]);
        } else {
            let [a, b, c] = corners;
            plane = (a, (b - a).cross(c - a).normalize_or_zero());
            faces.push(i as u32);
        }
        before = corners;
    }
    faces
}

const _: () = assert!(Order::OCTANTS.len() == OCTANT_LISTS as usize);

/// Constants that keep all attributes of the corners.
const EVERYTHING: lib::hit::Constants = lib::hit::Constants {
    hit_textures: (1 << lib::material::SLOTS) - 1,
    hit_tangents: true,
    hit_colors: true,
    hit_second_uvs: true,
};

/// Shading data of the corners of triangles.
struct CornerTable<'a> {
    scene: &'a Scene,
    solids: &'a Solids,
    /// Whether closed dielectric meshes refract; otherwise all transmissive surfaces are thin-walled.
    refraction: bool,
    /// Whether camera rays ignore the back faces of one-sided surfaces.
    one_sided: bool,
    /// Cofactor matrix of each instance, with the sign that keeps normals outside.
    cofactors: Vec<DMat3>,
    mirrored: Vec<bool>,
    /// Whether the normals were inverted; tangents then change their handedness.
    normals_mirrored: Vec<bool>,
    scales: Vec<f32>,
    /// Specialization constants for the attributes that exist.
    contents: lib::hit::Constants,
    /// Indices of the texels of [`share::Corners`] that `contents` keeps.
    kept: Vec<usize>,
}

impl<'a> CornerTable<'a> {
    fn of(scene: &'a Scene, solids: &'a Solids, rays: Rays, one_sided: bool) -> Self {
        let mut contents = if rays.textures { EVERYTHING } else { lib::hit::Constants::default() };
        for instance in &scene.instances {
            let mesh = &scene.meshes[instance.mesh];
            let material = &scene.materials[mesh.material];
            contents.hit_textures |= texture_bits(material);
            contents.hit_tangents |= texture_bits(material) & BENT != 0 || material.has_direction();
            contents.hit_second_uvs |= material.textures().any(|(.., t)| t.is_some_and(|t| t.uv_set == 1));
            contents.hit_colors |= !mesh.colors.is_empty();
        }
        let parts = [
            (offset_of!(share::Corners, uvs), size_of::<CornerUvs>(), contents.hit_textures != 0),
            (offset_of!(share::Corners, second_uvs), size_of::<CornerUvs>(), contents.hit_second_uvs),
            (offset_of!(share::Corners, tangents), size_of::<CornerTangents>(), contents.hit_tangents),
            (offset_of!(share::Corners, colors), size_of::<CornerColors>(), contents.hit_colors),
        ];
        let left_out = |texel: &usize| {
            let holds = |at: usize, size: usize| (at..at + size).contains(&(texel * 16));
            parts.iter().any(|&(at, size, is_kept)| !is_kept && holds(at, size))
        };
        let kept = (0..size_of::<share::Corners>() / 16).filter(|texel| !left_out(texel)).collect();
        let (mut cofactors, mut mirrored, mut normals_mirrored, mut scales) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (i, instance) in scene.instances.iter().enumerate() {
            let m = instance.world_from_object.matrix3;
            let determinant = m.determinant();
            let turned = |flipped: bool| (determinant < 0.0) != flipped;
            let c = cofactors_of(m);
            let inwards = turned(solids.normals_flipped[i]);
            cofactors.push(if inwards { -c } else { c });
            normals_mirrored.push(inwards);
            mirrored.push(turned(solids.flipped[i]));
            scales.push(determinant.abs().cbrt() as f32);
        }
        Self {
            scene,
            solids,
            refraction: rays.refraction,
            one_sided,
            cofactors,
            mirrored,
            normals_mirrored,
            scales,
            contents,
            kept,
        }
    }

    /// The counter-clockwise order of a triangle's corners, seen from its front.
    fn order(&self, t: &Triangle) -> [usize; 3] {
        if self.mirrored[t.instance as usize] { [0, 2, 1] } else { [0, 1, 2] }
    }

    fn texels(&self, t: &Triangle) -> impl Iterator<Item = [u32; 4]> {
        let texels: [[u32; 4]; size_of::<share::Corners>() / 16] = bytemuck::cast(self.all_of(t));
        self.kept.iter().map(move |&kept| texels[kept])
    }

    fn all_of(&self, t: &Triangle) -> share::Corners {
        let i = t.instance as usize;
        let instance = &self.scene.instances[i];
        let mesh = &self.scene.meshes[instance.mesh];
        let vertices = self.order(t).map(|k| mesh.indices[t.primitive as usize * 3 + k] as usize);
        let material = &self.scene.materials[mesh.material];
        let sheet = material.transmission > 0.0 && (self.solids.sheet[i] || !self.refraction);
        let normals = vertices.map(|v| {
            let n = self.cofactors[i] * glam::Vec3::from(mesh.normals[v]).as_dvec3();
            n.try_normalize().unwrap_or(DVec3::ZERO).as_vec3().to_array()
        });
        let uvs = |set: usize| vertices.map(|v| mesh.uvs[set].get(v).copied().unwrap_or_default());
        let [a, b, c] = uvs(0).map(|uv| glam::Vec2::from(uv).as_dvec2());
        let [p, q, r] = t.corners.map(|corner| glam::Vec3::from(corner).as_dvec3());
        let area = (q - p).cross(r - p).length();
        let density = if area > 0.0 { ((b - a).perp_dot(c - a).abs() / area).sqrt() as f32 } else { 0.0 };
        let one_sided = self.one_sided && !material.double_sided;
        let flags = if sheet { SHEET_TRIANGLE } else { 0 } | if one_sided { ONE_SIDED_TRIANGLE } else { 0 };
        let [normal_a, normal_b, normal_c] = normals;
        let pairs = |[a, b, c]: [[f32; 2]; 3]| CornerUvs { a, b, c, pad: [0.0; 2] };
        let linear = instance.world_from_object.matrix3;
        let side = if self.normals_mirrored[i] { -1.0 } else { 1.0 };
        let [tangent_a, tangent_b, tangent_c] = vertices.map(|v| {
            let [x, y, z, w] = mesh.tangents.get(v).copied().unwrap_or_default();
            (linear * DVec3::new(x.into(), y.into(), z.into())).as_vec3().extend(w * side).to_array()
        });
        let [color_a, color_b, color_c] = vertices.map(|v| {
            let [r, g, b, a] = mesh.colors.get(v).copied().unwrap_or([1.0; 4]).map(half::f16::from_f32);
            [pack_half_2x16([r, g]), pack_half_2x16([b, a])]
        });
        share::Corners {
            frame: CornerFrame {
                normal_a,
                material: mesh.material as u32 & MATERIAL_OF_TRIANGLE | flags,
                normal_b,
                scale: self.scales[i],
                normal_c,
                uv_per_metre: density,
            },
            uvs: pairs(uvs(0)),
            second_uvs: pairs(uvs(1)),
            tangents: CornerTangents { a: tangent_a, b: tangent_b, c: tangent_c },
            colors: CornerColors { a: color_a, b: color_b, c: color_c, pad: [0; 2] },
        }
    }
}

/// The geometry of the instances that bound media, under the same indices; other meshes are empty.
fn bodies(scene: &Scene, solids: &Solids, rays: Rays) -> Scene {
    let mut wanted = vec![false; scene.meshes.len()];
    for (instance, body) in scene.instances.iter().zip(&solids.body) {
        wanted[instance.mesh] |= rays.refraction && body.is_some();
    }
    let mesh = |(mesh, &wanted): (&Mesh, &bool)| Mesh {
        positions: if wanted { mesh.positions.clone() } else { Shared::default() },
        indices: if wanted { mesh.indices.clone() } else { Shared::default() },
        material: mesh.material,
        ..Mesh::default()
    };
    Scene {
        meshes: scene.meshes.iter().zip(&wanted).map(mesh).collect(),
        instances: scene.instances.clone(),
        materials: scene.materials.clone(),
        ..Scene::default()
    }
}

#[cfg(test)]
mod tests {
    use crate::shader::PROGRAMS;
    use crate::shader::lib::trace::TRACING_LANES;

    #[test]
    fn programs_that_trace_have_as_many_invocations_as_traversal_stacks() {
        let traces = |program: &&&crate::gpu::Program| program.constants.iter().any(|c| c.name == "traversal");
        let tracing: Vec<_> = PROGRAMS.iter().filter(traces).collect();
        assert!(tracing.len() > 6, "{}", tracing.len());
        for program in tracing {
            assert_eq!(program.local_size.iter().product::<u32>(), TRACING_LANES, "{}", program.name);
        }
    }
}
