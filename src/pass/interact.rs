//! Reflection and refraction by rays, over the tiles that call for them (shaders/pass/interact.comp).

use anyhow::Result;

use super::classify::{Calls, RayTiles, classify_rays};
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::part::{Part, PartOnDevice};
use crate::gpu::{Frame, Image};
use crate::plan::Rays;
use crate::shader::interact;

/// Branches that can wait beside one for each surface of a path: a surface may send four. What finds no place is counted as
/// not followed.
const SPARE_BRANCHES: u32 = 4;

/// Adds to `radiance` what the surfaces of the G-buffer mirror and what is seen through them.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn interact<'a>(
    frame: &mut Frame<'a>,
    lighting: Lighting<'a>,
    with: Rays,
    gbuffer: &'a GBuffer,
    tiles: &'a RayTiles,
    radiance: &'a Image,
) -> Result<()> {
    let calls = Calls { mirrors: with.mirrors, transmissive: with.refraction };
    classify_rays(frame, lighting, calls, gbuffer, tiles)?;
    follow(frame, "reflection and refraction", lighting, with, gbuffer, tiles, radiance, None)
}

/// Adds to a part of the picture what of that belongs to it: all rays are followed once more, over the same tiles.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn interact_part<'a>(
    frame: &mut Frame<'a>,
    lighting: Lighting<'a>,
    with: Rays,
    gbuffer: &'a GBuffer,
    tiles: &'a RayTiles,
    part: &'a PartOnDevice,
) -> Result<()> {
    let name = format!("{} alone", part.part.name());
    follow(frame, &name, lighting, with, gbuffer, tiles, &part.radiance, Some(part.part))
}

#[expect(clippy::too_many_arguments, reason = "the two ways to call it have names")]
fn follow<'a>(
    frame: &mut Frame<'a>,
    name: &str,
    lighting: Lighting<'a>,
    with: Rays,
    gbuffer: &'a GBuffer,
    tiles: &'a RayTiles,
    radiance: &'a Image,
    part: Option<Part>,
) -> Result<()> {
    let Lighting { plan, scene, rays, environment, camera, .. } = lighting;
    let constants = interact::Constants {
        spectral: scene.colours().spectral,
        grid_side: scene.colours().grid_side,
        has_emissive: plan.emissive,
        has_layers: plan.layers,
        positions: plan.stored.positions,
        normals: plan.stored.normals as u32,
        normal_error2: plan.stored.normals.error2(),
        has_triangles: true,
        has_transmission: with.refraction,
        brdf: lighting.knobs.index("brdf"),
        fresnel: lighting.knobs.index("fresnel"),
        arithmetic: lighting.knobs.index("arithmetic"),
        clearcoat: plan.clearcoat,
        conductors: plan.conductors,
        mirror_rays: with.mirrors,
        roughest_mirror: plan.roughest_mirror,
        directional_lights: plan.directional_lights,
        local_lights: plan.local_lights,
        ambient: plan.ambient,
        reflection: plan.reflection,
        traversal: rays.constants.traversal,
        octants: rays.constants.octants,
        stack_size: rays.constants.stack_size,
        hit_textures: rays.constants.hit_textures,
        shadows: lighting.shadows(),
        filters: with.filters,
        absorption: with.absorption,
        march_steps: with.march.steps,
        quadrature: with.march.rule,
        march_colours: with.march.colours,
        march_budget: lighting.loop_budget(),
        tile_words: 0,
        transmissive: with.transmissive,
        rough: with.rough,
        environment: plan.environment,
        sky: plan.sky,
        masked_hits: with.masked,
        loop_budget: lighting.loop_budget(),
        in_medium: rays.inside(),
        light_budget: lighting.loop_budget(),
        pending: with.interfaces + SPARE_BRANCHES,
        touching: rays.constants.touching,
        first_event: part.map_or(0, |part| part as u32),
    };
    let bind = interact::Bind {
        camera_block: camera,
        instances: &scene.instances,
        depth: gbuffer.places(),
        base: &gbuffer.base,
        normals: &gbuffer.normals,
        ids: &gbuffer.ids,
        emissive: &gbuffer.emissive,
        layers: &gbuffer.layers,
        triangles: &gbuffer.triangles,
        radiance,
        ray_tiles: &tiles.tiles,
        work: &tiles.sizes,
        lights: &scene.lights,
        tile_lights: &lighting.tiles.masks,
        environment: &environment.terms,
        prefiltered: environment.prefiltered(),
        reflectance: environment.reflectance(),
        sky: environment.sky(),
        shadow_depth: lighting.shadow_maps.depth(),
        shadow_faces: &lighting.shadow_maps.faces,
        bvh_nodes: &rays.nodes,
        bvh_triangles: &rays.triangles,
        trace_block: &rays.terms,
        material_texels: &scene.materials,
        spectrum: &scene.spectrum.texels,
        hit_corners: &rays.corners,
        leaf_places: &rays.leaf_places,
        texels: &scene.texels,
        texel_slots: &scene.texel_slots,
        hit_slots: &scene.slots,
        sigma_grids: &scene.grids.texels,
        work_done: &rays.counts,
    };
    frame.compute_indirect(name, &bind, constants.words(), &[], &tiles.sizes, 0)
}
