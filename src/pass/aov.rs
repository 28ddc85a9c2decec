//! Arbitrary output variables (AOVs): the G-buffer as data for the host (shaders/pass/aov.comp).

use anyhow::Result;

use super::gbuffer::GBuffer;
use crate::gpu::{Buffer, Frame};
use crate::shader::{Library, aov};

/// Writes one [`crate::share::AovPixel`] per pixel of the rows from `rows[0]` to before `rows[1]`.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
pub fn aov<'a>(
    frame: &mut Frame<'a>,
    library: Library,
    gbuffer: &'a GBuffer,
    pixels: &'a Buffer,
    rows: [u32; 2],
) -> Result<()> {
    let bind = aov::Bind { gbuffer: gbuffer.bind(), pixels };
    let size = gbuffer.depth.desc();
    // Only the constants of the encoding matter here.
    let constants = aov::Constants {
        library: Library { gbuffer: library.gbuffer, normals: library.normals, ..Library::default() },
    };
    let push = aov::Push { first_row: rows[0], end_row: rows[1] };
    frame.compute_over("AOVs", &bind, &constants, &push, [size.width, rows[1] - rows[0]])?;
    frame.read_back(pixels);
    Ok(())
}
