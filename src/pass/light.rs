//! Deferred shading: direct light of the G-buffer's surfaces (shaders/pass/light.comp).
//!
//! Read Real-Time Rendering (4th ed.), section 20.1 (deferred shading), and docs/decisions/work-tiles.md.

use anyhow::Result;

use super::classify::WorkLists;
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use crate::gpu::{Frame, Image};
use crate::shader::{lib, light};

/// Writes `radiance` at pixels with a surface, by indirect dispatch over the list of surface tiles.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
pub fn light<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    gbuffer: &'a GBuffer,
    work: &'a WorkLists,
    radiance: &'a Image,
) -> Result<()> {
    let mut library = lighting.library;
    // Without shadow rays, and with the eye outside of closed meshes, the pass sends no ray: one pipeline for all
    // plans. Light samples read triangles and their textures, also without shadow rays.
    if !(lighting.shadow_rays() || library.primary.in_medium || lighting.plan.light_samples.count > 0) {
        library.trace = lib::trace::Constants::default();
        library.hit = lib::hit::Constants::default();
        library.sigma_grid = lib::sigma_grid::Constants::default();
        library.shadow = lib::shadow::Constants { shadows: library.shadow.shadows, ..Default::default() };
    }
    // The pass traces no rays of ambient occlusion: the pass of that name adds the environment's light.
    library.ambient_occlusion = lib::ambient_occlusion::Constants::default();
    if lighting.plan.occlusion_rays() > 0 {
        library.environment_light = lib::environment_light::Constants::default();
    }
    library.lighting.screen_mirrors = lighting.plan.screen.mirrors && lighting.plan.light_samples.emitting;
    let constants = light::Constants { library };
    let bind = light::Bind {
        gbuffer: gbuffer.bind(),
        lighting: lighting.tiles.bind(),
        radiance,
        surface_tiles: &work.surface,
        work: &work.sizes,
    };
    for (index, range) in lighting.ranges().into_iter().enumerate() {
        let push = light::Push { range, first_dispatch: u32::from(index == 0) };
        frame.compute_indirect("lighting", &bind, &constants, &push, work.surface_groups())?;
    }
    Ok(())
}
