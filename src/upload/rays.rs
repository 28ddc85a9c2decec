//! What rays go through on the device: the bounding volume hierarchy, its triangles, and what their surfaces look like
//! (shaders/lib/trace.glsl, hit.glsl).

use std::mem::offset_of;
use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::Serialize;

use super::aims::AimsOnDevice;
use super::emitters::EmittersOnDevice;
use super::scene::{BENT, cofactors as cofactors_of, medium, texture_bits};
use super::table::{pack_half_2x16, upload};
use super::view::View;
use crate::gpu::{Buffer, Device, Frame, NOTHING, Place};
use crate::plan::{Plan, Rays};
use crate::prepare::{Hierarchy, Prepared, ray_offset};
use crate::scene::solid::{Solids, media_at};
use crate::scene::{AlphaMode, Mesh, Scene, Shared};
use crate::shader::lib;
use crate::shader::lib::trace::{FILTER, LINKS_16, LINKS_32, OCTANT_LISTS, OPAQUE, STACK};
use crate::share::{
    self, BvhTriangle, CornerColors, CornerFrame, CornerTangents, CornerUvs, MATERIAL_OF_TRIANGLE, ONE_SIDED_TRIANGLE,
    SHEET_TRIANGLE, TraceTerms, WorkCounts,
};
use crate::transport::bvh::{Format, Order, Triangle};
use crate::transport::caustics::Aims;
use crate::transport::emitters::{Emitters, Source};

/// Lists in eight orders beside the one for any hit, as long as they take no more bytes than this, some two million nodes of
/// 16 bytes: they are as many copies of the tree.
const MOST_ORDERED_BYTES: usize = 256 << 20;

/// How the hierarchy is gone through.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Traversal {
    /// Skip links between nodes of 16 bytes.
    Links16 = LINKS_16 as isize,
    /// Skip links between nodes of 32 bytes, for scenes whose boxes are too small for a grid of 16 bits.
    Links32 = LINKS_32 as isize,
    /// Nodes of 64 bytes with both children's boxes, and a stack.
    Stack = STACK as isize,
}

/// What the report says of the hierarchy.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BvhFacts {
    /// Milliseconds to build and check it.
    pub build_ms: f64,
    /// And to lay it out for the device.
    pub layout_ms: f64,
    /// Triangles in it.
    pub triangles: usize,
    /// Triangles left out: without area or not finite.
    pub dropped: usize,
    /// Nodes.
    pub nodes: usize,
    /// Edges from the root to the deepest leaf.
    pub depth: u32,
    /// Expected nodes and triangles met by a line through the root's box.
    pub sah: f64,
    /// How it is gone through.
    pub traversal: Traversal,
    /// Some transparent body lies against another surface: what touches is crossed together.
    pub touching: bool,
    /// Bytes on the device.
    pub bytes: u64,
}

/// Specialization constants of every pass that includes shaders/lib/trace.glsl.
#[derive(Debug, Clone, Copy)]
pub struct TraceConstants {
    /// [`Traversal`].
    pub traversal: u32,
    /// Ordered lists for nearest hits.
    pub octants: bool,
    /// Entries.
    pub stack_size: u32,
    /// Which texture slots hits read.
    pub hit: lib::hit::Constants,
    /// [`BvhFacts::touching`].
    pub touching: bool,
}

impl Default for TraceConstants {
    /// Of shaders that send none.
    fn default() -> Self {
        Self { traversal: 0, octants: false, stack_size: 1, hit: lib::hit::Constants::default(), touching: false }
    }
}

/// Tables of a scene for rays; next to nothing where the plan sends none.
pub struct RaysOnDevice {
    /// Nodes in all lists.
    pub nodes: Buffer,
    /// A [`BvhTriangle`] each.
    pub triangles: Buffer,
    /// What lies at their corners: [`share::Corners`] as far as the scene calls for them.
    pub corners: Buffer,
    /// The flat face of each triangle in the order of the leaves.
    pub faces: Vec<u32>,
    /// The place among the leaves of each triangle of the scene, in the order of instances.
    pub leaf_places: Buffer,
    /// What paths draw light from, and how.
    pub emitters: EmittersOnDevice,
    /// What they aim at.
    pub aims: AimsOnDevice,
    /// [`TraceTerms`].
    pub terms: Buffer,
    /// [`WorkCounts`].
    pub counts: Buffer,
    /// Specialization.
    pub constants: TraceConstants,
    /// For the report; `None` without rays.
    pub facts: Option<BvhFacts>,
    fixed: TraceTerms,
    snap_pixels: f64,
    anchor: DVec3,
    /// The transparent bodies alone, to find those that the eye is in.
    bodies: Scene,
    solids: Solids,
}

impl RaysOnDevice {
    /// Lays out the hierarchy, where the plan sends rays.
    ///
    /// # Errors
    /// When the scene does not fit the device.
    pub fn new(device: &Arc<Device>, prepared: &Prepared, traversal: Option<Traversal>) -> Result<Self> {
        let Prepared { scene, plan, solids, emitters, .. } = prepared;
        let Some((rays, hierarchy)) = plan.rays.zip(prepared.hierarchy.as_ref()) else {
            return Self::none(device, scene);
        };
        let &Hierarchy { ref bvh, build_ms, offset, touching, .. } = hierarchy;
        let start = std::time::Instant::now();
        let by_links = if bvh.fits_grid() { Traversal::Links16 } else { Traversal::Links32 };
        let default = if device.limits_loops() { by_links } else { Traversal::Stack };
        let traversal = traversal.unwrap_or(default);
        let format = if traversal == Traversal::Links32 { Format::Float } else { Format::Quantised };
        let ordered = Order::OCTANTS.len() * bvh.nodes.len() * format.texels() * 16;
        let octants = traversal != Traversal::Stack && ordered <= MOST_ORDERED_BYTES;
        let filter: Vec<bool> = (0..scene.instances.len()).map(|i| is_filter(scene, solids, plan, i)).collect();
        let filters: Vec<bool> = bvh.triangles.iter().map(|t| filter[t.instance as usize]).collect();
        let (nodes, sentinel) = match traversal {
            Traversal::Stack => (bvh.stack_nodes(), 0),
            Traversal::Links16 | Traversal::Links32 => {
                let ordered: &[Order] = if octants { &Order::OCTANTS } else { &[] };
                let lists = bvh.lists(&[ordered, &[Order::AnyHit]].concat(), format);
                (lists.concat(), lists[0].len() / format.texels() - 1)
            }
        };
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
        let corners = Corners::of(scene, solids, rays, plan.paths.is_some());
        let mut picked = vec![0.0; scene.triangles()];
        for emitter in &emitters.list {
            if let Source::Triangle { index, area, .. } = emitter.source {
                picked[index as usize] = (emitter.probability / area) as f32;
            }
        }
        let triangles: Vec<BvhTriangle> = bvh
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
        let mut leaf_places = vec![u32::MAX; scene.triangles()];
        for (place, t) in bvh.triangles.iter().enumerate() {
            leaf_places[(first_triangle[t.instance as usize] + t.primitive) as usize] = place as u32;
        }
        let hit_corners: Vec<[u32; 4]> = bvh.triangles.par_iter().flat_map_iter(|t| corners.texels(t)).collect();
        let layout_ms = start.elapsed().as_secs_f64() * 1e3;
        let grid = bvh.grid();
        let format = Some(vk::Format::R32G32B32A32_UINT);
        let nodes_buffer = upload(device, "BVH nodes", &nodes, format)?;
        let triangle_buffer = upload(device, "BVH triangles", &triangles, format)?;
        let corner_buffer = upload(device, "corners for rays", &hit_corners, format)?;
        let fixed = TraceTerms {
            offset: offset as f32,
            grid_middle: grid.middle,
            grid_unit: grid.unit,
            nodes: sentinel as u32,
            interfaces: rays.interfaces,
            ..bytemuck::Zeroable::zeroed()
        };
        Ok(Self {
            terms: Buffer::new(device, "trace terms", size_of::<TraceTerms>() as u64, Place::Upload)?,
            snap_pixels: device.snap_pixels(),
            counts: Buffer::new(device, "work counts", size_of::<WorkCounts>() as u64, Place::Readback)?,
            constants: TraceConstants {
                traversal: traversal as u32,
                octants,
                stack_size: if traversal == Traversal::Stack { bvh.depth + 1 } else { 1 },
                hit: corners.contents,
                touching,
            },
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
            emitters: EmittersOnDevice::new(device, emitters, &leaf_places)?,
            aims: match plan.paths.is_some_and(|paths| paths.aimed) {
                true => AimsOnDevice::new(device, &Aims::of(scene, solids, bvh, emitters))?,
                false => AimsOnDevice::none(device)?,
            },
            leaf_places: upload(device, "leaf places", &leaf_places, None)?,
            fixed,
            anchor: bvh.anchor,
            solids: solids.clone(),
            bodies: bodies(scene, solids, rays),
        })
    }

    /// Without rays there still is the space they would live in: shadow maps share it.
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
            emitters: EmittersOnDevice::new(device, &Emitters::default(), &[])?,
            aims: AimsOnDevice::none(device)?,
            terms: Buffer::new(device, "trace terms", size_of::<TraceTerms>() as u64, Place::Upload)?,
            snap_pixels: device.snap_pixels(),
            counts: Buffer::new(device, NOTHING, 0, Place::Readback)?,
            constants: TraceConstants::default(),
            facts: None,
            fixed: TraceTerms { offset: ray_offset(half) as f32, ..bytemuck::Zeroable::zeroed() },
            anchor,
            bodies: Scene::default(),
            solids: Solids::default(),
        })
    }

    /// What the traversal reads.
    #[must_use]
    pub fn trace(&self) -> lib::trace::Scene<'_> {
        lib::trace::Scene { bvh_nodes: &self.nodes, bvh_triangles: &self.triangles, trace_block: &self.terms }
    }

    /// Where work is counted.
    #[must_use]
    pub fn work(&self) -> lib::add_work::Scene<'_> {
        lib::add_work::Scene { work_done: &self.counts }
    }

    /// What rays need to know of one sample of a view.
    pub fn look_from(&mut self, view: &View, sample_index: u32, samples: u32, seed: u32) {
        let eye = view.eye - self.anchor;
        let mut camera_media = [0; 4];
        if sample_index == 0 {
            for &instance in &media_at(&self.bodies, &self.solids, view.eye) {
                let material = self.bodies.meshes[self.bodies.instances[instance].mesh].material;
                camera_media.copy_within(0..3, 1);
                camera_media[0] = medium(&self.bodies.materials[material], material);
            }
            self.fixed.camera_media = camera_media;
        }
        let terms = TraceTerms {
            bvh_from_rel: eye.as_vec3().to_array(),
            seed,
            sample_index,
            pixel_angle: view.pixel_angle() as f32,
            lod_bias: -0.5 * (samples as f32).log2(),
            snap: view.snap(self.snap_pixels).map(|off| off as f32),
            ..self.fixed
        };
        self.terms.write(bytemuck::bytes_of(&terms));
    }

    /// What rays need to know where there is no view.
    pub fn write_fixed(&mut self) {
        self.terms.write(bytemuck::bytes_of(&self.fixed));
    }

    /// The world's position of the origin that rays are told from.
    #[must_use]
    pub fn anchor(&self) -> DVec3 {
        self.anchor
    }

    /// How far rays start off a surface that the scene itself is seen from, in metres.
    #[must_use]
    pub fn offset(&self) -> f32 {
        self.fixed.offset
    }

    /// Whether the eye of the last view is inside a transparent body.
    #[must_use]
    pub fn inside(&self) -> bool {
        self.fixed.camera_media[0] != 0
    }

    /// What the sample that has just finished counted.
    #[must_use]
    pub fn counted(&self) -> WorkCounts {
        self.counts.read(|bytes| bytemuck::pod_read_unaligned(&bytes[..size_of::<WorkCounts>()]))
    }

    /// Sets the counts to 0.
    pub fn reset<'a>(&'a self, frame: &mut Frame<'a>) {
        frame.fill("reset work counts", &self.counts, 0);
    }
}

/// Whether what lies behind an instance's surface may be seen through it: for paths, on a straight line.
fn is_filter(scene: &Scene, solids: &Solids, plan: &Plan, instance: usize) -> bool {
    let material = &scene.materials[scene.meshes[scene.instances[instance].mesh].material];
    let straight = plan.paths.is_none() || solids.sheet[instance] || material.ior == 1.0;
    match material.alpha_mode {
        AlphaMode::Opaque => material.transmission > 0.0 && straight,
        AlphaMode::Mask(_) | AlphaMode::Blend => true,
    }
}

/// Which flat face each triangle of a mesh is part of, named after its first triangle: triangles that follow each other,
/// share an edge and lie in one plane as far as its coordinates can tell. A ray that leaves such a face cannot meet it again,
/// which no test of the other half of a quad could tell as surely where it is seen edge-on.
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

/// All that may lie at the corners.
const EVERYTHING: lib::hit::Constants =
    lib::hit::Constants { hit_textures: (1 << lib::material::SLOTS) - 1, hit_colors: true, hit_second_uvs: true };

/// What lies at the corners of triangles.
struct Corners<'a> {
    scene: &'a Scene,
    solids: &'a Solids,
    /// Transmissive bodies refract; else all of them are sheets.
    refraction: bool,
    /// The eye passes by the backs of surfaces that have one side only.
    one_sided: bool,
    /// Cofactors of each instance with the sign that keeps normals outside.
    cofactors: Vec<DMat3>,
    mirrored: Vec<bool>,
    /// Whether the normals had to be turned over: tangents change hands with them.
    normals_mirrored: Vec<bool>,
    scales: Vec<f32>,
    /// The specialization constants that say which of these there are.
    contents: lib::hit::Constants,
    /// Those texels of [`share::Corners`] that `contents` call for.
    kept: Vec<usize>,
}

impl<'a> Corners<'a> {
    fn of(scene: &'a Scene, solids: &'a Solids, rays: Rays, one_sided: bool) -> Self {
        let mut contents = if rays.textures { EVERYTHING } else { lib::hit::Constants::default() };
        for instance in &scene.instances {
            let mesh = &scene.meshes[instance.mesh];
            let material = &scene.materials[mesh.material];
            contents.hit_textures |= texture_bits(material);
            contents.hit_second_uvs |= material.textures().any(|(.., t)| t.is_some_and(|t| t.uv_set == 1));
            contents.hit_colors |= !mesh.colors.is_empty();
        }
        let parts = [
            (offset_of!(share::Corners, uvs), size_of::<CornerUvs>(), contents.hit_textures != 0),
            (offset_of!(share::Corners, second_uvs), size_of::<CornerUvs>(), contents.hit_second_uvs),
            (offset_of!(share::Corners, tangents), size_of::<CornerTangents>(), contents.hit_textures & BENT != 0),
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

    /// The order of a triangle's corners that runs counter-clockwise around its front.
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

/// The geometry of the instances that are transparent bodies, under the same indices; the others have no triangles.
fn bodies(scene: &Scene, solids: &Solids, rays: Rays) -> Scene {
    let mut wanted = vec![false; scene.meshes.len()];
    for (instance, &solid) in scene.instances.iter().zip(&solids.solid) {
        wanted[instance.mesh] |= rays.refraction && solid;
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
