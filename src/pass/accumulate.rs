//! Sum of a pixel's samples (shaders/pass/accumulate.comp).

use anyhow::Result;

use crate::gpu::{Frame, Image};
use crate::shader::{Library, accumulate, lib};
use crate::upload::spectrum::rgb_from_xyz;

/// Adds `radiance` to `film`, of which it is the first part or not, and multiplies by `scale`. Of a picture in `bands` of
/// wavelengths it is one of them, in X, Y and Z.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn accumulate<'a>(
    frame: &mut Frame<'a>,
    radiance: &'a Image,
    film: &'a Image,
    first: bool,
    scale: f32,
    bands: u32,
) -> Result<()> {
    let push = accumulate::Push { first: u32::from(first), scale, bands: bands as f32, rgb_from_xyz: rgb_from_xyz() };
    let size = [film.desc().width, film.desc().height];
    let bind = accumulate::Bind { radiance, film };
    let spectrum = lib::spectrum::Constants { spectral: bands > 0, ..Default::default() };
    let constants = accumulate::Constants { library: Library { spectrum, ..Library::default() } };
    frame.compute_over("accumulate", &bind, &constants, &push, size)
}
