//! Recursive ray tracing of reflection and refraction, over the tiles whose surfaces send rays: one kernel that
//! follows a pixel's whole ray tree (shaders/pass/interact.comp), or trees that grow in steps (ray_trees.rs).
//!
//! Read Whitted 1980, "An Improved Illumination Model for Shaded Display"; Schmidt and Budge 2002, "Simple Nested
//! Dielectrics in Ray Traced Images"; docs/decisions/rays.md. The G-buffer replaces camera rays.

use anyhow::Result;

use super::classify::{Calls, RayTiles, classify_rays};
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::part::Part;
use super::ray_trees::RayTrees;
use crate::gpu::{Frame, Image};
use crate::plan::{FEWER_AT_HITS, Rays};
use crate::shader::interact;

/// Adds reflected and refracted light at the surfaces of the G-buffer to `radiance`. With a part, only light of the
/// part is added: all rays are traced once more, over the same tiles. With `trees`, in steps.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
pub fn interact<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    with: Rays,
    gbuffer: &'a GBuffer,
    (tiles, trees): (&'a RayTiles, Option<&'a RayTrees>),
    radiance: &'a Image,
    part: Option<Part>,
) -> Result<()> {
    let name = part.map_or("reflection and refraction".to_owned(), |part| format!("{} alone", part.name()));
    if part.is_none() {
        let calls = Calls { mirrors: with.mirrors, transmissive: with.refraction };
        classify_rays(frame, lighting, calls, gbuffer, tiles)?;
    }
    let mut library = lighting.library;
    // Ray hits are outside of the light tiles, so they loop over all lights.
    library.lighting.local_lights = lighting.plan.local_lights;
    library.lighting.tile_words = 0;
    library.lighting.lit_at_hits = true;
    library.lighting.light_budget = library.loops.loop_budget;
    library.gbuffer.stored_triangles = true;
    library.emitters.light_samples = library.emitters.light_samples.div_ceil(FEWER_AT_HITS);
    library.ambient_occlusion.first_direction = lighting.plan.occlusion_directions()[0];
    library.ambient_occlusion.occlusion_rays = lighting.plan.occlusion_rays_at_hits();
    library.lighting.environment_apart = lighting.plan.occlusion_rays() > 0;
    library.ray_tree.first_event = part.map_or(0, |part| part as u32);
    if let Some(trees) = trees {
        return trees.grow(frame, &name, (lighting, library), gbuffer, tiles, radiance);
    }
    library.lighting.sky_rays = library.ambient_occlusion.occlusion_rays;
    let bind = interact::Bind {
        gbuffer: gbuffer.bind(),
        lighting: lighting.tiles.bind(),
        radiance,
        ray_tiles: &tiles.tiles,
        work: &tiles.sizes,
    };
    frame.compute_indirect(&name, &bind, &interact::Constants { library }, &(), tiles.groups())
}
