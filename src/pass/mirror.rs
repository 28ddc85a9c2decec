//! Mirror images of what is on the screen, over the tiles that call for them (shaders/pass/mirror.comp).

use anyhow::Result;

use super::classify::{Calls, RayTiles, classify_rays};
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::screen::OnScreen;
use crate::gpu::{Frame, Image};
use crate::shader::mirror;

/// Puts the radiance on the screen in the place of the environment's where a mirrored ray meets it.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn mirror<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    gbuffer: &'a GBuffer,
    tiles: &'a RayTiles,
    screen: &'a OnScreen,
    radiance: &'a Image,
) -> Result<()> {
    classify_rays(frame, lighting, Calls { mirrors: true, transmissive: false }, gbuffer, tiles)?;
    // The surfaces are those of the lighting, to the last bit: what it has added is taken away.
    let mut library = lighting.library;
    library.surface.mirror_rays = false;
    library.gbuffer.stored_triangles = false;
    let bind = mirror::Bind {
        gbuffer: gbuffer.bind(),
        screen: screen.bind(&screen.seen),
        radiance,
        mirror_tiles: &tiles.tiles,
        work: &tiles.sizes,
    };
    let constants = mirror::Constants { library };
    frame.compute_indirect("screen-space reflection", &bind, &constants, &(), &tiles.sizes, 0)
}
