//! The G-buffer as arbitrary output variables (shaders/pass/aov.comp).

use anyhow::Result;

use super::gbuffer::GBuffer;
use super::scene::SceneOnDevice;
use crate::gpu::{Buffer, Frame};
use crate::plan::Plan;
use crate::shader::aov;

/// Writes one [`crate::share::AovPixel`] per pixel of the rows from `rows[0]` up to `rows[1]`.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn aov<'a>(
    frame: &mut Frame<'a>,
    plan: &Plan,
    scene: &'a SceneOnDevice,
    camera: &'a Buffer,
    gbuffer: &'a GBuffer,
    pixels: &'a Buffer,
    rows: [u32; 2],
) -> Result<()> {
    let bind = aov::Bind {
        camera_block: camera,
        material_texels: &scene.materials,
        depth: gbuffer.places(),
        base: &gbuffer.base,
        normals: &gbuffer.normals,
        ids: &gbuffer.ids,
        emissive: &gbuffer.emissive,
        pixels,
    };
    let size = gbuffer.depth.desc();
    let constants = aov::Constants {
        has_emissive: plan.emissive,
        positions: plan.stored.positions,
        normals: plan.stored.normals as u32,
        ..Default::default()
    }
    .words();
    frame.compute_over("AOVs", &bind, constants, bytemuck::cast_slice(&rows), [size.width, rows[1] - rows[0]])?;
    frame.read_back(pixels);
    Ok(())
}
