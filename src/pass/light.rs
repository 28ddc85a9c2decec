//! Deferred lighting of the nearest surfaces (shaders/pass/light.comp).

use anyhow::Result;

use super::classify::WorkLists;
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::rays::TraceConstants;
use crate::gpu::{Frame, Image};
use crate::plan::March;
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
    // Only rays to lights are sent from here; an eye in a medium needs to know where on its triangle a point lies.
    let trace = if lighting.shadow_rays() || rays.inside() { rays.constants } else { TraceConstants::default() };
    let through_media = planned.filter(|_| lighting.shadow_rays() || rays.inside());
    let march = through_media.map_or_else(March::default, |rays| rays.march);
    let constants = light::Constants {
        spectral: scene.colours().spectral,
        grid_side: scene.colours().grid_side,
        // Ranges of lights are short enough.
        light_budget: u32::MAX,
        in_medium: rays.inside(),
        has_emissive: plan.emissive,
        has_layers: plan.layers,
        positions: plan.stored.positions,
        normals: plan.stored.normals as u32,
        normal_error2: plan.stored.normals.error2(),
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
        traversal: trace.traversal,
        octants: trace.octants,
        stack_size: trace.stack_size,
        hit_textures: trace.hit_textures,
        shadows: lighting.shadows(),
        filters: planned.is_some_and(|rays| rays.shadows && rays.filters),
        absorption: through_media.map_or(0, |rays| rays.absorption),
        march_steps: march.steps,
        quadrature: march.rule,
        march_colours: march.colours,
        march_budget: lighting.loop_budget(),
    };
    let bind = light::Bind {
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
        spectrum: &scene.spectrum.texels,
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
