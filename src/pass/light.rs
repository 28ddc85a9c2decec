//! Deferred lighting of the nearest surfaces (shaders/pass/light.comp).

use anyhow::Result;

use super::classify::WorkLists;
use super::environment::EnvironmentOnDevice;
use super::gbuffer::GBuffer;
use super::rays::{LOOP_BUDGET, RaysOnDevice};
use super::scene::SceneOnDevice;
use super::shadow_map::ShadowMaps;
use super::tiles::Tiles;
use crate::gpu::{Buffer, Frame, Image};
use crate::plan::{Knobs, Plan};
use crate::shader::light;

/// Lights of one dispatch where each sends a ray: a traversal evaluates some 20 to 200 loop heads, of 65,535 that lavapipe
/// grants an invocation.
const LIGHTS_AT_ONCE: u32 = 64;

/// `SHADOWS` of shaders/lib/shadow.glsl: places of the rungs in the knob `shadows`.
const SHADOW_MAP: u32 = 1;
const SHADOW_RAY: u32 = 2;

/// What all passes that light surfaces need beside them.
#[derive(Clone, Copy)]
pub struct Lighting<'a> {
    /// Which code.
    pub plan: &'a Plan,
    /// Which formulas.
    pub knobs: &'a Knobs,
    /// Materials, lights, instances.
    pub scene: &'a SceneOnDevice,
    /// What rays go through.
    pub rays: &'a RaysOnDevice,
    /// What lights see.
    pub shadow_maps: &'a ShadowMaps,
    /// Light lists.
    pub tiles: &'a Tiles,
    /// Light from all around.
    pub environment: &'a EnvironmentOnDevice,
    /// The camera's buffer.
    pub camera: &'a Buffer,
    /// Pixels.
    pub size: [u32; 2],
}

/// Lights of the table from, up to; words of the tiles' masks from, up to.
type Range = [u32; 4];

impl Lighting<'_> {
    /// Lights beside directional ones that every pixel goes through: all or, where tiles list them, none.
    #[must_use]
    pub fn unlisted_lights(&self) -> u32 {
        if self.plan.tiles { 0 } else { self.plan.local_lights }
    }

    /// How lights are looked for: `SHADOWS` of shaders/lib/shadow.glsl.
    #[must_use]
    pub fn shadows(&self) -> u32 {
        if self.plan.shadow_maps { SHADOW_MAP } else { u32::from(self.shadow_rays()) * SHADOW_RAY }
    }

    /// Loop heads that one invocation may evaluate.
    #[must_use]
    pub fn loop_budget(&self) -> u32 {
        if self.scene.device().limits_loops() { LOOP_BUDGET } else { u32::MAX }
    }

    /// Whether rays look for lights.
    pub(super) fn shadow_rays(&self) -> bool {
        self.plan.rays.is_some_and(|rays| rays.shadows)
    }

    /// What each dispatch goes through: everything at once, or a few lights at a time where each sends a ray.
    fn ranges(&self) -> Vec<Range> {
        let (lights, words) = (self.plan.directional_lights + self.unlisted_lights(), self.tiles.words());
        if !self.shadow_rays() {
            return vec![[0, lights, 0, words]];
        }
        let parts = |count: u32, of: u32| (0..count).step_by(of as usize).map(move |i| [i, (i + of).min(count)]);
        let plain = parts(lights, LIGHTS_AT_ONCE).map(|[from, to]| [from, to, 0, 0]);
        let listed = parts(words, LIGHTS_AT_ONCE / 32).map(|[from, to]| [0, 0, from, to]);
        plain.chain(listed).collect()
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
    let Lighting { plan, scene, rays, environment, camera, .. } = lighting;
    let planned = plan.rays;
    let constants = light::Constants {
        light_budget: u32::MAX,
        in_medium: rays.inside(),
        has_emissive: plan.emissive,
        has_layers: plan.layers,
        has_triangles: planned.is_some(),
        has_transmission: planned.is_some_and(|rays| rays.refraction),
        brdf: lighting.knobs.index("brdf"),
        fresnel: lighting.knobs.index("fresnel"),
        arithmetic: lighting.knobs.index("arithmetic"),
        clearcoat: plan.clearcoat,
        conductors: plan.conductors,
        mirror_rays: planned.is_some_and(|rays| rays.mirrors),
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
