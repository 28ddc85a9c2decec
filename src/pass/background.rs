//! What lies behind the scene (shaders/pass/background.comp).

use anyhow::Result;

use super::classify::{WORK_BYTES, WorkLists};
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::spectrum::SpectrumConstants;
use crate::gpu::{Frame, Image};
use crate::shader::background;

/// Writes `radiance` where no surface was drawn.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn background<'a>(
    frame: &mut Frame<'a>,
    lighting: Lighting<'a>,
    gbuffer: &'a GBuffer,
    work: &'a WorkLists,
    radiance: &'a Image,
) -> Result<()> {
    let bind = background::Bind {
        camera_block: lighting.camera,
        depth: &gbuffer.depth_texels,
        radiance,
        background_tiles: &work.background,
        environment: &lighting.environment.terms,
        spectrum: &lighting.scene.spectrum.texels,
        sky: lighting.environment.sky(),
        work: &work.sizes,
    };
    let SpectrumConstants { spectral, grid_side } = lighting.scene.colours();
    let arithmetic = lighting.knobs.index("arithmetic");
    let constants = background::Constants { sky: lighting.plan.sky, arithmetic, spectral, grid_side }.words();
    frame.compute_indirect("background", &bind, constants, &[], &work.sizes, WORK_BYTES)
}
