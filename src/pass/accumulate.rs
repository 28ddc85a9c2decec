//! Sum of a pixel's samples (shaders/pass/accumulate.comp).

use anyhow::Result;

use super::spectrum::rgb_from_xyz;
use crate::gpu::{Frame, Image};
use crate::shader::accumulate;

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
    let numbers = [[scale, bands as f32].as_slice(), &rgb_from_xyz()].concat();
    let push: Vec<u32> = [u32::from(first)].into_iter().chain(numbers.into_iter().map(f32::to_bits)).collect();
    let size = [film.desc().width, film.desc().height];
    let bind = accumulate::Bind { radiance, film };
    let constants = accumulate::Constants { spectral: bands > 0 }.words();
    frame.compute_over("accumulate", &bind, constants, bytemuck::cast_slice(&push), size)
}
