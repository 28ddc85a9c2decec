//! Deferred lighting of the opaque surfaces (shaders/pass/light.comp).

use anyhow::Result;

use super::classify::WorkLists;
use super::environment::EnvironmentOnDevice;
use super::gbuffer::GBuffer;
use super::scene::SceneOnDevice;
use super::tiles::Tiles;
use crate::gpu::{Buffer, Frame, Image};
use crate::plan::{Knobs, Plan};
use crate::shader::{composite, light};

/// Loop heads that one invocation of the see-through pass may evaluate where the driver limits them.
const LOOP_BUDGET: u32 = 40_000;

/// What both lighting passes need beside their surfaces.
#[derive(Clone, Copy)]
pub struct Lighting<'a> {
    /// Which code.
    pub plan: &'a Plan,
    /// Which formulas.
    pub knobs: &'a Knobs,
    /// Materials, lights, instances.
    pub scene: &'a SceneOnDevice,
    /// Light lists.
    pub tiles: &'a Tiles,
    /// Light from all around.
    pub environment: &'a EnvironmentOnDevice,
    /// The camera's buffer.
    pub camera: &'a Buffer,
    /// Pixels.
    pub size: [u32; 2],
}

impl Lighting<'_> {
    fn local_lights(&self) -> u32 {
        if self.plan.tiles { 0 } else { self.plan.local_lights }
    }

    /// Specialization constants of the fragment-list pass.
    #[must_use]
    pub fn composite_constants(&self) -> composite::Constants {
        composite::Constants {
            brdf: self.knobs.index("brdf"),
            fresnel: self.knobs.index("fresnel"),
            arithmetic: self.knobs.index("arithmetic"),
            clearcoat: self.plan.clearcoat,
            directional_lights: self.plan.directional_lights,
            local_lights: self.local_lights(),
            tile_words: self.tiles.words(),
            ambient: self.plan.ambient,
            reflection: self.plan.reflection,
            loop_budget: if self.scene.device().limits_loops() { LOOP_BUDGET } else { u32::MAX },
        }
    }
}

/// Writes `radiance` where the G-buffer holds a surface.
///
/// # Errors
/// When the driver refuses the pipeline.
pub fn light<'a>(
    frame: &mut Frame<'a>,
    lighting: Lighting<'a>,
    gbuffer: &'a GBuffer,
    work: &'a WorkLists,
    radiance: &'a Image,
) -> Result<()> {
    let Lighting { plan, scene, environment, camera, .. } = lighting;
    let constants = light::Constants {
        has_emissive: plan.emissive,
        has_layers: plan.layers,
        brdf: lighting.knobs.index("brdf"),
        fresnel: lighting.knobs.index("fresnel"),
        arithmetic: lighting.knobs.index("arithmetic"),
        clearcoat: plan.clearcoat,
        directional_lights: plan.directional_lights,
        local_lights: lighting.local_lights(),
        tile_words: lighting.tiles.words(),
        ambient: plan.ambient,
        reflection: plan.reflection,
    };
    let bind = light::Bind {
        camera_block: camera,
        materials: &scene.materials,
        depth: &gbuffer.depth_texels,
        base: &gbuffer.base,
        normals: &gbuffer.normals,
        ids: &gbuffer.ids,
        emissive: &gbuffer.emissive,
        layers: &gbuffer.layers,
        radiance,
        surface_tiles: &work.surface,
        work: &work.sizes,
        lights: &scene.lights,
        tile_lights: &lighting.tiles.masks,
        environment: &environment.terms,
        prefiltered: environment.prefiltered(),
        reflectance: environment.reflectance(),
    };
    frame.compute_indirect("lighting", &bind, constants.words(), &[], &work.sizes, 0)
}
