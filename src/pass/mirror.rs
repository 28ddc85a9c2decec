//! Screen-space reflections (SSR), by indirect dispatch over ray tiles (shaders/pass/mirror.comp).
//!
//! Read Real-Time Rendering (4th ed.), section 11.6.5 (screen-space methods); McGuire and Mara 2014, "Efficient GPU
//! Screen-Space Ray Tracing"; docs/decisions/screen-space.md.

use anyhow::Result;

use super::classify::{Calls, RayTiles, classify_rays};
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::screen::OnScreen;
use crate::gpu::{Frame, Image};
use crate::shader::mirror;

/// Replaces the environment's reflection by the picture's radiance where a reflected ray hits the depth buffer.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
pub fn mirror<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    gbuffer: &'a GBuffer,
    tiles: &'a RayTiles,
    screen: &'a OnScreen,
    radiance: &'a Image,
) -> Result<()> {
    classify_rays(frame, lighting, Calls { mirrors: true, transmissive: false }, gbuffer, tiles)?;
    // Constants as in the lighting pass: its reflection is recomputed bit-identically and subtracted.
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
    frame.compute_indirect("screen-space reflection", &bind, &constants, &(), tiles.groups())
}
