//! Deferred lighting of the nearest surfaces (shaders/pass/light.comp).

use anyhow::Result;

use super::classify::WorkLists;
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use crate::gpu::{Frame, Image};
use crate::shader::{lib, light};

/// Writes `radiance` where the G-buffer holds a surface.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn light<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    gbuffer: &'a GBuffer,
    work: &'a WorkLists,
    radiance: &'a Image,
) -> Result<()> {
    let mut library = lighting.library;
    // Without shadow rays, and from outside of bodies, no ray leaves what is lit: one pipeline, whatever rays other passes send.
    if !library.gbuffer.stored_triangles {
        library.trace = lib::trace::Constants::default();
        library.hit = lib::hit::Constants::default();
        library.sigma_grid = lib::sigma_grid::Constants::default();
        library.shadow = lib::shadow::Constants { shadows: library.shadow.shadows, ..Default::default() };
    }
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
        frame.compute_indirect("lighting", &bind, &constants, &push, &work.sizes, 0)?;
    }
    Ok(())
}
