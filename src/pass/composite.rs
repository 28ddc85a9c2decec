//! See-through surfaces lit and laid over what is behind them (shaders/pass/composite.comp).

use anyhow::Result;

use super::fragments::FragmentLists;
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::mirror::OnScreen;
use super::part::PartOnDevice;
use crate::gpu::{Buffer, Frame, Image};
use crate::shader::composite;

/// Adds the fragments of one strip to `radiance`, nearest first. What they show of the screen is the opaque
/// surfaces.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn composite<'a>(
    frame: &mut Frame<'a>,
    lighting: Lighting<'a>,
    gbuffer: &'a GBuffer,
    lists: &'a FragmentLists,
    radiance: &'a Image,
    screen: &'a OnScreen,
    rows: [u32; 2],
) -> Result<()> {
    lay_over(frame, "see-through lighting", lighting, gbuffer, lists, radiance, screen, &screen.seen, rows, false)
}

/// Weakens a part of the picture as the fragments of one strip do that lie before it.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn composite_part<'a>(
    frame: &mut Frame<'a>,
    lighting: Lighting<'a>,
    gbuffer: &'a GBuffer,
    lists: &'a FragmentLists,
    part: &'a PartOnDevice,
    screen: &'a OnScreen,
    rows: [u32; 2],
) -> Result<()> {
    let name = format!("see-through over {}", part.part.name());
    lay_over(frame, &name, lighting, gbuffer, lists, &part.radiance, screen, &part.seen, rows, true)
}

#[expect(clippy::too_many_arguments, reason = "the two ways to call it have names")]
fn lay_over<'a>(
    frame: &mut Frame<'a>,
    name: &str,
    lighting: Lighting<'a>,
    gbuffer: &'a GBuffer,
    lists: &'a FragmentLists,
    radiance: &'a Image,
    screen: &'a OnScreen,
    seen: &'a Buffer,
    rows: [u32; 2],
    behind_alone: bool,
) -> Result<()> {
    let Lighting { plan, scene, rays, environment, camera, .. } = lighting;
    let planned = plan.rays;
    let constants = composite::Constants {
        spectral: scene.colours().spectral,
        grid_side: scene.colours().grid_side,
        // Without rays a light is a single turn of a loop, and what may be too many is refused before.
        light_budget: if lighting.shadow_rays() { lighting.loop_budget() } else { u32::MAX },
        brdf: lighting.knobs.index("brdf"),
        fresnel: lighting.knobs.index("fresnel"),
        arithmetic: lighting.knobs.index("arithmetic"),
        clearcoat: plan.clearcoat,
        conductors: plan.conductors,
        // What is mirrored here is the environment: rays are sent from the G-buffer alone.
        mirror_rays: false,
        roughest_mirror: plan.roughest_mirror,
        directional_lights: plan.directional_lights,
        local_lights: lighting.unlisted_lights(),
        ambient: plan.ambient,
        reflection: plan.reflection,
        traversal: rays.constants.traversal,
        octants: rays.constants.octants,
        stack_size: rays.constants.stack_size,
        hit_textures: rays.constants.hit_textures,
        shadows: lighting.shadows(),
        filters: planned.is_some_and(|rays| rays.filters),
        absorption: planned.map_or(0, |rays| rays.absorption),
        march_steps: plan.march().steps,
        quadrature: plan.march().rule,
        march_colours: plan.march().colours,
        march_budget: lighting.loop_budget(),
        tile_words: lighting.tiles.words(),
        loop_budget: lighting.loop_budget(),
        positions: plan.stored.positions,
        normals: plan.stored.normals as u32,
        bends: plan.screen.refraction,
        mirrors: plan.screen.see_through_mirrors,
        behind_alone,
    };
    let bind = composite::Bind {
        camera_block: camera,
        instances: &scene.instances,
        heads: &lists.heads,
        nodes: &lists.nodes,
        radiance,
        depth: gbuffer.places(),
        normals: &gbuffer.normals,
        seen,
        nearest_pieces: &screen.nearest_pieces,
        dropped: &lists.dropped,
        tiles: &lists.work.tiles,
        work: &lists.work.sizes,
        lights: &scene.lights,
        tile_lights: &lighting.tiles.masks,
        environment: &environment.terms,
        prefiltered: environment.prefiltered(),
        reflectance: environment.reflectance(),
        shadow_depth: lighting.shadow_maps.depth(),
        shadow_faces: &lighting.shadow_maps.faces,
        bvh_nodes: &rays.nodes,
        bvh_triangles: &rays.triangles,
        trace_block: &rays.terms,
        material_texels: &scene.materials,
        spectrum: &scene.spectrum.texels,
        hit_corners: &rays.corners,
        texels: &scene.texels,
        texel_slots: &scene.texel_slots,
        hit_slots: &scene.slots,
        sigma_grids: &scene.grids.texels,
        work_done: &rays.counts,
    };
    let push = [rows[1]];
    let push = bytemuck::cast_slice(&push);
    frame.compute_indirect(name, &bind, constants.words(), push, &lists.work.sizes, 0)
}
