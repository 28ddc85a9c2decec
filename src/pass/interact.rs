//! Reflection and refraction by rays, over the tiles that call for them (shaders/pass/interact.comp).

use anyhow::Result;

use super::classify::{Calls, RayTiles, classify_rays};
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::part::Part;
use crate::gpu::{Frame, Image};
use crate::plan::Rays;
use crate::shader::interact;

/// Branches that can wait beside one for each surface of a path: a surface may send four. What finds no place is counted as
/// not followed.
const SPARE_BRANCHES: u32 = 4;

/// Adds to `radiance` what the surfaces of the G-buffer mirror and what is seen through them; with a part, what of that belongs to it: all
/// rays are followed once more, over the same tiles.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn interact<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    with: Rays,
    gbuffer: &'a GBuffer,
    tiles: &'a RayTiles,
    radiance: &'a Image,
    part: Option<Part>,
) -> Result<()> {
    let name = part.map_or("reflection and refraction".to_owned(), |part| format!("{} alone", part.name()));
    if part.is_none() {
        let calls = Calls { mirrors: with.mirrors, transmissive: with.refraction };
        classify_rays(frame, lighting, calls, gbuffer, tiles)?;
    }
    let mut library = lighting.library;
    // What a ray hits is on no tile: it goes through all lights.
    library.lighting.local_lights = lighting.plan.local_lights;
    library.lighting.tile_words = 0;
    library.lighting.light_budget = library.loops.loop_budget;
    library.gbuffer.stored_triangles = true;
    let constants = interact::Constants {
        library,
        masked_hits: with.masked,
        pending: with.interfaces + SPARE_BRANCHES,
        first_event: part.map_or(0, |part| part as u32),
    };
    let bind = interact::Bind {
        gbuffer: gbuffer.bind(),
        lighting: lighting.tiles.bind(),
        radiance,
        ray_tiles: &tiles.tiles,
        work: &tiles.sizes,
    };
    frame.compute_indirect(&name, &bind, &constants, &(), &tiles.sizes, 0)
}
