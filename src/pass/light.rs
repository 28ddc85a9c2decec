//! Deferred lighting of the nearest surfaces (shaders/pass/light.comp).

use anyhow::Result;

use super::classify::WorkLists;
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use crate::gpu::{Frame, Image};
use crate::shader::light;

/// Writes `radiance` where the G-buffer holds a surface.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn light<'a>(
    frame: &mut Frame<'a>,
    lighting: Lighting<'a>,
    gbuffer: &'a GBuffer,
    work: &'a WorkLists,
    radiance: &'a Image,
) -> Result<()> {
    let Lighting { plan, scene, rays, environment, camera, .. } = lighting;
    let planned = plan.rays;
    let constants = light::Constants {
        // Ranges of lights are short enough.
        light_budget: u32::MAX,
        in_medium: rays.inside(),
        has_emissive: plan.emissive,
        has_layers: plan.layers,
        has_triangles: lighting.shadow_rays() || rays.inside(),
        has_transmission: planned.is_some_and(|rays| rays.refraction),
        brdf: lighting.knobs.index("brdf"),
        fresnel: lighting.knobs.index("fresnel"),
        arithmetic: lighting.knobs.index("arithmetic"),
        clearcoat: plan.clearcoat,
        conductors: plan.conductors,
        mirror_rays: planned.is_some_and(|rays| rays.mirrors),
        roughest_mirror: plan.roughest_mirror,
        directional_lights: plan.directional_lights,
        local_lights: lighting.unlisted_lights(),
        tile_words: lighting.tiles.words(),
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
    };
    let bind = light::Bind {
        camera_block: camera,
        instances: &scene.instances,
        depth: &gbuffer.depth_texels,
        base: &gbuffer.base,
        normals: &gbuffer.normals,
        ids: &gbuffer.ids,
        emissive: &gbuffer.emissive,
        layers: &gbuffer.layers,
        triangles: &gbuffer.triangles,
        radiance,
        surface_tiles: &work.surface,
        work: &work.sizes,
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
        hit_corners: &rays.corners,
        leaf_places: &rays.leaf_places,
        texels: &scene.texels,
        texel_slots: &scene.texel_slots,
        hit_slots: &scene.slots,
        sigma_grids: &scene.grids.texels,
        work_done: &rays.counts,
    };
    for (index, range) in lighting.ranges().into_iter().enumerate() {
        let [first, end, first_word, end_word] = range;
        let push = [first, end, first_word, end_word, u32::from(index == 0)];
        frame.compute_indirect("lighting", &bind, constants.words(), bytemuck::cast_slice(&push), &work.sizes, 0)?;
    }
    Ok(())
}
