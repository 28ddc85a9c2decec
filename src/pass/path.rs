//! Paths of light: a wavefront of one bounce after the other over queues of pixels (shaders/pass/path.comp), or all bounces in
//! one dispatch (path_at_once.comp), which tests compare it with.

use std::sync::Arc;

use anyhow::Result;

use super::lighting::Lighting;
use super::rows::{rows_of, stride};
use crate::gpu::{Buffer, Device, Frame, Image, NOTHING, Place};
use crate::plan::{Paths, Plan, Rays};
use crate::shader::{path, path_at_once, path_begin, queue_count, queue_next, queue_scan};

/// Pixels a side of the tiles that the first queue is made of.
const TILE: u32 = 8;
/// Two `WorkSize` of shaders/lib/work_tile.glsl.
const SIZE_BYTES: u64 = 32;
/// Offset of the second.
const CHUNKS_AT: u64 = 16;
/// Entries of a queue that one invocation counts: `CHUNK` of shaders/lib/queue.glsl.
const CHUNK: u32 = 16;
/// Paths of a workgroup, two in each invocation: `PATHS_IN_GROUP`.
const PATHS_IN_GROUP: u32 = 128;

/// Halvings that single out one of `count`.
fn halvings(count: u32) -> u32 {
    count.next_power_of_two().trailing_zeros()
}

/// Paths between two dispatches.
pub struct PathsOnDevice {
    /// What is done at their surfaces.
    pub with: Paths,
    states: [Buffer; 6],
    queues: [Buffer; 2],
    sizes: [Buffer; 2],
    first_size: Buffer,
    chunks: Buffer,
    size: [u32; 2],
}

impl PathsOnDevice {
    /// For a picture of `size` pixels.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, with: Paths, plan: &Plan, touching: bool, size: [u32; 2]) -> Result<Self> {
        let rays = plan.rays.unwrap_or_default();
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let places = places(size);
        let words = |name, wanted: bool, words: u64| {
            let (name, bytes) = if wanted { (name, 4 * words) } else { (NOTHING, 0) };
            Buffer::new(device, name, bytes, Place::Device)
        };
        let queue = || words("queue of paths", true, u64::from(places));
        let queue_size = || Buffer::new(device, "queue size", SIZE_BYTES, Place::Device);
        let [groups, rows, _] = rows_of(places.div_ceil(PATHS_IN_GROUP));
        let [chunk_groups, chunk_rows, _] =
            rows_of(places.div_ceil(CHUNK).div_ceil(queue_count::PROGRAM.local_size[0]));
        let first_size = [groups, rows, 1, places, chunk_groups, chunk_rows, 1, 0];
        Ok(Self {
            with,
            states: [
                words("origins of paths", true, 4 * pixels)?,
                words("directions of paths", true, 4 * pixels)?,
                words("throughputs of paths", true, 4 * pixels)?,
                words("light of paths", true, 4 * pixels)?,
                words("media of paths", rays.transmissive, 4 * pixels)?,
                words("what paths are after", touching, pixels)?,
            ],
            queues: [queue()?, queue()?],
            sizes: [queue_size()?, queue_size()?],
            first_size: Buffer::with_data(device, "first queue size", &first_size)?,
            chunks: words("chunks of a queue", true, u64::from(places.div_ceil(CHUNK)))?,
            size,
        })
    }
}

/// Entries of the first queue: all pixels of the tiles that the picture touches.
fn places(size: [u32; 2]) -> u32 {
    size[0].div_ceil(TILE) * size[1].div_ceil(TILE) * TILE * TILE
}

/// One sample of every pixel into `radiance`.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn paths<'a>(
    frame: &mut Frame<'a>,
    lighting: Lighting<'a>,
    paths: &'a PathsOnDevice,
    radiance: &'a Image,
) -> Result<()> {
    let Lighting { plan, scene, rays, environment, camera, .. } = lighting;
    let Some(with) = plan.rays else { return Ok(()) };
    let [origins, directions, throughputs, sums, media, afters] = &paths.states;
    let places = places(paths.size);
    let tiles = places / (TILE * TILE);
    let constants = constants(lighting, with, paths.with);
    let first = [places, stride(tiles)];
    if paths.with.at_once {
        let bind = path_at_once::Bind {
            camera_block: camera,
            radiance,
            lights: &scene.lights,
            environment: &environment.terms,
            reflectance: environment.reflectance(),
            sky: environment.sky(),
            bvh_nodes: &rays.nodes,
            bvh_triangles: &rays.triangles,
            trace_block: &rays.terms,
            material_texels: &scene.materials,
            spectrum: &scene.spectrum.texels,
            hit_corners: &rays.corners,
            shadow_depth: lighting.shadow_maps.depth(),
            shadow_faces: &lighting.shadow_maps.faces,
            sigma_grids: &scene.grids.texels,
            texels: &scene.texels,
            texel_slots: &scene.texel_slots,
            hit_slots: &scene.slots,
            work_done: &rays.counts,
            emitters: &rays.emitters.table,
            sky_shares: &rays.emitters.sky,
            aim_cells: &rays.aims.cells,
            aims: &rays.aims.balls,
        };
        let groups = rows_of(places.div_ceil(PATHS_IN_GROUP));
        return frame.compute("paths at once", &bind, constants, bytemuck::cast_slice(&first), groups);
    }
    frame.copy_buffer("reset queue size", &paths.first_size, &paths.sizes[0], SIZE_BYTES);
    let bind = path_begin::Bind {
        camera_block: camera,
        queue: &paths.queues[0],
        origins,
        directions,
        throughputs,
        sums,
        media,
        afters,
        bvh_nodes: &rays.nodes,
        bvh_triangles: &rays.triangles,
        trace_block: &rays.terms,
    };
    frame.compute("paths begin", &bind, of_begin(&constants), bytemuck::cast_slice(&first), rows_of(tiles))?;
    for bounce in 0..with.interfaces + 1 {
        let [from, to] = if bounce % 2 == 0 { [0, 1] } else { [1, 0] };
        let bind = path::Bind {
            radiance,
            lights: &scene.lights,
            environment: &environment.terms,
            reflectance: environment.reflectance(),
            sky: environment.sky(),
            bvh_nodes: &rays.nodes,
            bvh_triangles: &rays.triangles,
            trace_block: &rays.terms,
            material_texels: &scene.materials,
            spectrum: &scene.spectrum.texels,
            hit_corners: &rays.corners,
            shadow_depth: lighting.shadow_maps.depth(),
            shadow_faces: &lighting.shadow_maps.faces,
            sigma_grids: &scene.grids.texels,
            texels: &scene.texels,
            texel_slots: &scene.texel_slots,
            hit_slots: &scene.slots,
            work_done: &rays.counts,
            emitters: &rays.emitters.table,
            sky_shares: &rays.emitters.sky,
            aim_cells: &rays.aims.cells,
            aims: &rays.aims.balls,
            origins,
            directions,
            throughputs,
            sums,
            media,
            afters,
            queue: &paths.queues[from],
            sizes: &paths.sizes[from],
        };
        let push = [paths.size[0]];
        frame.compute_indirect(
            "paths",
            &bind,
            constants.clone(),
            bytemuck::cast_slice(&push),
            &paths.sizes[from],
            0,
        )?;
        if bounce < with.interfaces {
            compact(frame, paths, from, to)?;
        }
    }
    Ok(())
}

/// The next queue: entries that go on, in their order.
fn compact<'a>(frame: &mut Frame<'a>, paths: &'a PathsOnDevice, from: usize, to: usize) -> Result<()> {
    let (queue, sizes, chunks) = (&paths.queues[from], &paths.sizes[from], &paths.chunks);
    let bind = queue_count::Bind { queue, sizes, chunks };
    frame.compute_indirect("count paths", &bind, queue_count::Constants {}.words(), &[], sizes, CHUNKS_AT)?;
    let bind = queue_scan::Bind { sizes, chunks, next_sizes: &paths.sizes[to] };
    frame.compute("sum up paths", &bind, queue_scan::Constants {}.words(), &[], [1, 1, 1])?;
    let bind = queue_next::Bind { queue, sizes, chunks, next_queue: &paths.queues[to] };
    frame.compute_indirect("next queue", &bind, queue_next::Constants {}.words(), &[], sizes, CHUNKS_AT)
}

/// Constants of all programs of paths: the same numbers name the same ones in each.
fn constants(lighting: Lighting, with: Rays, paths: Paths) -> Vec<(u32, u32)> {
    let Lighting { plan, knobs, scene, rays, .. } = lighting;
    let emitters = &rays.emitters;
    let all = path::Constants {
        spectral: scene.colours().spectral,
        grid_side: scene.colours().grid_side,
        brdf: knobs.index("brdf"),
        fresnel: knobs.index("fresnel"),
        arithmetic: knobs.index("arithmetic"),
        clearcoat: plan.clearcoat,
        conductors: plan.conductors,
        traversal: rays.constants.traversal,
        octants: rays.constants.octants,
        stack_size: rays.constants.stack_size,
        hit_textures: rays.constants.hit_textures,
        filters: with.filters,
        absorption: with.absorption,
        march_steps: with.march.steps,
        quadrature: with.march.rule,
        march_colours: with.march.colours,
        march_budget: lighting.loop_budget(),
        transmissive: with.transmissive,
        rough: with.rough,
        frosted: with.frosted,
        touching: rays.constants.touching,
        environment: plan.environment,
        sky: plan.sky,
        loop_budget: lighting.loop_budget(),
        directional_lights: plan.directional_lights,
        lighting_surfaces: paths.emitting,
        light_places: knobs.light_places(),
        emitters: emitters.count,
        emitter_steps: halvings(emitters.count),
        punctual_emitters: emitters.punctual,
        emitting_triangles: emitters.triangles,
        shaped_emitters: paths.shaped && emitters.punctual,
        emitting_sky: emitters.rows > 0,
        sky_columns: emitters.columns,
        sky_rows: emitters.rows,
        aimed: paths.aimed,
        keeps_media: with.transmissive,
        keeps_after: rays.constants.touching,
        sky_steps: halvings(emitters.columns.max(emitters.rows)),
        ..Default::default()
    };
    all.words()
}

/// Those of them that the first queue is made with.
fn of_begin(constants: &[(u32, u32)]) -> Vec<(u32, u32)> {
    let known = path_begin::PROGRAM.constants;
    constants.iter().copied().filter(|(id, _)| known.iter().any(|constant| constant.id == *id)).collect()
}
