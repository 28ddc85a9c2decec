//! Ray tracing of a list of rays, for tests and benchmarks of the BVH traversal (shaders/pass/trace_rays.comp).

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use bytemuck::{Pod, Zeroable};

use crate::gpu::{Buffer, DescriptorSet, Device, Frame, Place};
use crate::plan::Architecture;
use crate::prepare::Prepared;
use crate::scene::Scene;
use crate::shader::{Library, SCENE, lib, trace_rays};
use crate::share::WorkCounts;
use crate::upload::rays::{RaysOnDevice, TraceConstants, Traversal};

/// A ray in bvh space: world axes, metres, origin at the anchor.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Ray {
    /// Origin of the ray.
    pub origin: [f32; 3],
    /// Largest parameter of a hit; a negative one disables the ray.
    pub t_max: f32,
    /// Direction of any length.
    pub direction: [f32; 3],
    /// Coplanar group that the ray leaves ([`Tracer::face`]) and cannot hit again, or [`Hit::NONE`].
    pub from: u32,
}

/// The hit of a ray.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Hit {
    /// Parameter along the ray.
    pub t: f32,
    /// Index among the BVH's triangles; [`Hit::NONE`] for a miss.
    pub triangle: u32,
    /// Barycentric coordinate of the second corner.
    pub u: f32,
    /// Barycentric coordinate of the third corner.
    pub v: f32,
}

impl Hit {
    /// Marks a miss: no triangle.
    pub const NONE: u32 = u32::MAX;
}

/// The kind of query.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Mode {
    /// Any hit instead of the nearest.
    pub any_hit: bool,
    /// Two rays per invocation.
    pub pairs: bool,
    /// Count visited nodes and tested triangles.
    pub count: bool,
}

/// A scene with its BVH on a device.
pub struct Tracer {
    device: Arc<Device>,
    rays: RaysOnDevice,
}

impl Tracer {
    /// Builds and uploads the BVH of a scene.
    ///
    /// # Errors
    /// When the BVH does not fit the device.
    pub fn new(device: &Arc<Device>, scene: &Scene, traversal: Option<Traversal>) -> Result<Self> {
        let mut prepared = Prepared::for_rays(scene.clone())?;
        prepared.plan.architecture = Architecture::of(device.is_software());
        Ok(Self { device: device.clone(), rays: RaysOnDevice::new(device, &prepared, traversal)? })
    }

    /// The BVH and its tables.
    #[must_use]
    pub fn rays(&self) -> &RaysOnDevice {
        &self.rays
    }

    /// Coplanar group of a triangle, by the triangle's index in the BVH.
    #[must_use]
    pub fn face(&self, triangle: u32) -> u32 {
        self.rays.faces[triangle as usize]
    }

    /// Traces rays `repeats` times: hits, work counts of one repeat, and milliseconds of each repeat.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn trace(&mut self, rays: &[Ray], mode: Mode, repeats: u32) -> Result<(Vec<Hit>, WorkCounts, Vec<f64>)> {
        self.rays.write_fixed();
        let bytes = std::mem::size_of_val(rays) as u64;
        let format = vk::Format::R32G32B32A32_UINT;
        // Copies: a GPU would read the host's memory for each ray, and its bus would set the pace.
        let mut sent = Buffer::new(&self.device, "rays of the host", bytes, Place::Upload)?;
        sent.write(bytemuck::cast_slice(rays));
        let input = Buffer::texels(&self.device, "rays", bytes, Place::Device, format)?;
        let hits_bytes = std::mem::size_of::<Hit>() as u64 * rays.len() as u64;
        let output = Buffer::new(&self.device, "hits", hits_bytes, Place::Device)?;
        let received = Buffer::new(&self.device, "hits of the host", hits_bytes, Place::Readback)?;
        let per_group = if mode.pairs { 128 } else { 64 };
        let blocks = (rays.len() as u32).div_ceil(per_group).div_ceil(32);
        let TraceConstants { traversal, octants, .. } = self.rays.constants;
        let trace = lib::trace::Constants { traversal, octants };
        let constants = trace_rays::Constants {
            any_hit: mode.any_hit,
            pairs: mode.pairs,
            count: mode.count,
            library: Library { trace, ..Library::default() },
        };
        let entries = || [self.rays.trace().entries(), self.rays.work().entries()].concat();
        let scene = DescriptorSet::new(&self.device, &SCENE, &entries())?;
        let mut times = Vec::new();
        for round in 0..repeats {
            let mut frame = Frame::of(&self.device, vec![scene.bind(entries())]);
            self.rays.reset(&mut frame);
            if round == 0 {
                frame.copy_buffer("send rays", &sent, &input, bytes);
            }
            let bind = trace_rays::Bind { rays: &input, hits: &output };
            let push = trace_rays::Push { count: rays.len() as u32, blocks };
            frame.compute("rays", &bind, &constants, &push, [blocks * 32, 1, 1])?;
            if round + 1 == repeats {
                frame.copy_buffer("receive hits", &output, &received, hits_bytes);
                frame.read_back(&received);
                frame.read_back(&self.rays.counts);
            }
            let passes = frame.finish()?;
            times.extend(passes.iter().filter(|p| p.name == "rays").map(|p| p.ms));
        }
        let hits = received.read(|all| bytemuck::pod_collect_to_vec(&all[..hits_bytes as usize]));
        Ok((hits, self.rays.counted(), times))
    }
}
