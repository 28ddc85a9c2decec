//! What lies behind the scene (shaders/pass/background.comp).

use anyhow::Result;

use super::classify::{WORK_BYTES, WorkLists};
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use crate::gpu::{Frame, Image};
use crate::shader::background;

/// Writes `radiance` where no surface was drawn.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn background<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    gbuffer: &'a GBuffer,
    work: &'a WorkLists,
    radiance: &'a Image,
) -> Result<()> {
    let bind =
        background::Bind { gbuffer: gbuffer.bind(), radiance, background_tiles: &work.background, work: &work.sizes };
    let constants = background::Constants { library: lighting.library };
    frame.compute_indirect("background", &bind, &constants, &(), &work.sizes, WORK_BYTES)
}
