//! Mirror images of what is on the screen, over the tiles that call for them (shaders/pass/mirror.comp).

use anyhow::Result;

use super::classify::{Calls, RayTiles, classify_rays};
use super::gbuffer::GBuffer;
use super::light::Lighting;
use crate::gpu::{Buffer, Frame, Image};
use crate::shader::mirror;

/// Puts the radiance in `seen` in the place of the environment's where a mirrored ray meets it.
///
/// # Errors
/// When the driver refuses a pipeline.
pub fn mirror<'a>(
    frame: &mut Frame<'a>,
    lighting: Lighting<'a>,
    gbuffer: &'a GBuffer,
    tiles: &'a RayTiles,
    seen: &'a Buffer,
    radiance: &'a Image,
) -> Result<()> {
    classify_rays(frame, lighting, Calls { mirrors: true, transmissive: false }, gbuffer, tiles)?;
    let Lighting { plan, scene, rays, environment, camera, .. } = lighting;
    // The surfaces are those of the lighting, to the last bit: what it has added is taken away.
    let constants = mirror::Constants {
        has_emissive: plan.emissive,
        has_layers: plan.layers,
        has_triangles: plan.rays.is_some(),
        has_transmission: plan.rays.is_some_and(|rays| rays.refraction),
        brdf: lighting.knobs.index("brdf"),
        fresnel: lighting.knobs.index("fresnel"),
        arithmetic: lighting.knobs.index("arithmetic"),
        clearcoat: plan.clearcoat,
        conductors: plan.conductors,
        ambient: plan.ambient,
        reflection: plan.reflection,
        traversal: rays.constants.traversal,
        octants: rays.constants.octants,
        stack_size: rays.constants.stack_size,
        hit_textures: rays.constants.hit_textures,
        ..Default::default()
    };
    let bind = mirror::Bind {
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
        mirror_tiles: &tiles.tiles,
        work: &tiles.sizes,
        seen,
        lights: &scene.lights,
        tile_lights: &lighting.tiles.masks,
        environment: &environment.terms,
        prefiltered: environment.prefiltered(),
        reflectance: environment.reflectance(),
        bvh_nodes: &rays.nodes,
        bvh_triangles: &rays.triangles,
        trace_block: &rays.terms,
        material_texels: &scene.materials,
        hit_corners: &rays.corners,
        leaf_places: &rays.leaf_places,
        texels: &scene.texels,
        texel_slots: &scene.texel_slots,
        hit_slots: &scene.slots,
    };
    frame.compute_indirect("mirror images on the screen", &bind, constants.words(), &[], &tiles.sizes, 0)
}
