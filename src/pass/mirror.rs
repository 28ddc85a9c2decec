//! Mirror images of what is on the screen, over the tiles that call for them (shaders/pass/mirror.comp).

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use super::classify::{Calls, RayTiles, TILE, classify_rays};
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::rows::rows_of;
use crate::gpu::{Buffer, Device, Frame, Image, Place};
use crate::plan::{Plan, Screen};
use crate::shader::{mirror, screen_tiles as tiles_program};

/// The picture as something to be looked up; next to nothing where the plan does not.
pub struct OnScreen {
    /// A copy of the radiance as a texel buffer, row by row, to be read while that is written.
    pub seen: Buffer,
    /// How near the surfaces of each 8x8 tile come, as reversed depth.
    pub nearest_pieces: Buffer,
}

impl OnScreen {
    /// Buffers for a picture of `size` pixels.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, plan: &Plan, size: [u32; 2]) -> Result<Self> {
        let called_for = u64::from(plan.screen != Screen::default());
        let pixels = u64::from(size[0]) * u64::from(size[1]) * called_for;
        let tiles = u64::from(size[0].div_ceil(TILE)) * u64::from(size[1].div_ceil(TILE)) * called_for;
        let texels = |name, bytes, format| Buffer::texels(device, name, bytes, Place::Device, format);
        Ok(Self {
            seen: texels("radiance on the screen", 16 * pixels, vk::Format::R32G32B32A32_SFLOAT)?,
            nearest_pieces: texels("nearest pieces of tiles", 4 * tiles, vk::Format::R32_SFLOAT)?,
        })
    }
}

/// Finds how near the surfaces of each tile come (shaders/pass/screen_tiles.comp).
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn screen_tiles<'a>(
    frame: &mut Frame<'a>,
    lighting: Lighting<'a>,
    gbuffer: &'a GBuffer,
    screen: &'a OnScreen,
) -> Result<()> {
    let bind = tiles_program::Bind {
        camera_block: lighting.camera,
        depth: gbuffer.places(),
        normals: &gbuffer.normals,
        nearest_pieces: &screen.nearest_pieces,
    };
    let [width, height] = lighting.size;
    let tiles = width.div_ceil(TILE) * height.div_ceil(TILE);
    let groups = rows_of(tiles.div_ceil(tiles_program::PROGRAM.local_size[0]));
    let constants = tiles_program::Constants {
        arithmetic: lighting.knobs.index("arithmetic"),
        positions: lighting.plan.stored.positions,
        normals: lighting.plan.stored.normals as u32,
    };
    frame.compute("nearest pieces of tiles", &bind, constants.words(), &[], groups)
}

/// Puts the radiance on the screen in the place of the environment's where a mirrored ray meets it.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn mirror<'a>(
    frame: &mut Frame<'a>,
    lighting: Lighting<'a>,
    gbuffer: &'a GBuffer,
    tiles: &'a RayTiles,
    screen: &'a OnScreen,
    radiance: &'a Image,
) -> Result<()> {
    classify_rays(frame, lighting, Calls { mirrors: true, transmissive: false }, gbuffer, tiles)?;
    let Lighting { plan, scene, rays, environment, camera, .. } = lighting;
    // The surfaces are those of the lighting, to the last bit: what it has added is taken away.
    let constants = mirror::Constants {
        spectral: lighting.scene.colours().spectral,
        grid_side: lighting.scene.colours().grid_side,
        has_emissive: plan.emissive,
        has_layers: plan.layers,
        positions: plan.stored.positions,
        normals: plan.stored.normals as u32,
        normal_error2: plan.stored.normals.error2(),
        has_triangles: false,
        has_transmission: plan.rays.is_some_and(|rays| rays.refraction),
        brdf: lighting.knobs.index("brdf"),
        fresnel: lighting.knobs.index("fresnel"),
        arithmetic: lighting.knobs.index("arithmetic"),
        clearcoat: plan.clearcoat,
        conductors: plan.conductors,
        roughest_mirror: plan.roughest_mirror,
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
        depth: gbuffer.places(),
        base: &gbuffer.base,
        normals: &gbuffer.normals,
        ids: &gbuffer.ids,
        emissive: &gbuffer.emissive,
        layers: &gbuffer.layers,
        triangles: &gbuffer.triangles,
        radiance,
        mirror_tiles: &tiles.tiles,
        work: &tiles.sizes,
        seen: &screen.seen,
        nearest_pieces: &screen.nearest_pieces,
        lights: &scene.lights,
        tile_lights: &lighting.tiles.masks,
        environment: &environment.terms,
        prefiltered: environment.prefiltered(),
        reflectance: environment.reflectance(),
        bvh_nodes: &rays.nodes,
        bvh_triangles: &rays.triangles,
        trace_block: &rays.terms,
        material_texels: &scene.materials,
        spectrum: &scene.spectrum.texels,
        hit_corners: &rays.corners,
        leaf_places: &rays.leaf_places,
        shadow_depth: lighting.shadow_maps.depth(),
        shadow_faces: &lighting.shadow_maps.faces,
        texels: &scene.texels,
        texel_slots: &scene.texel_slots,
        hit_slots: &scene.slots,
        sigma_grids: &scene.grids.texels,
    };
    frame.compute_indirect("mirror images on the screen", &bind, constants.words(), &[], &tiles.sizes, 0)
}
