//! Light from all around with ray-traced ambient occlusion (shaders/pass/ambient.comp).
//!
//! Read Real-Time Rendering (4th ed.), section 11.3, and docs/decisions/ambient-occlusion.md.

use anyhow::Result;

use super::classify::WorkLists;
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use crate::gpu::{Frame, Image};
use crate::shader::ambient;

/// Adds the light of the environment and of what occludes it to `radiance` at pixels with a surface, by indirect
/// dispatch over the list of surface tiles.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
pub fn ambient<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    gbuffer: &'a GBuffer,
    work: &'a WorkLists,
    radiance: &'a Image,
) -> Result<()> {
    let bind = ambient::Bind { gbuffer: gbuffer.bind(), radiance, surface_tiles: &work.surface, work: &work.sizes };
    let mut library = lighting.library;
    // Rays start on the triangles. Lights with shadow maps are looked up from depth, whether or not there is this pass.
    library.gbuffer.stored_triangles = true;
    let constants = ambient::Constants { library };
    frame.compute_indirect("ambient occlusion", &bind, &constants, &(), work.surface_groups())
}
