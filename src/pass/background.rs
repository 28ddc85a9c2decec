//! The background behind the scene: environment or nothing (shaders/pass/background.comp).

use anyhow::Result;

use super::classify::WorkLists;
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use crate::gpu::{Frame, Image};
use crate::shader::background;

/// Writes `radiance` at pixels without a surface, by indirect dispatch over the list of background tiles.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
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
    frame.compute_indirect("background", &bind, &constants, &(), work.background_groups())
}
