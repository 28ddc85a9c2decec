//! Sum of a pixel's samples (shaders/pass/accumulate.comp).

use anyhow::Result;

use crate::gpu::{Frame, Image};
use crate::shader::accumulate;

/// Adds `radiance` to `film`; after sample `index` of `count` the film is their mean.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn accumulate<'a>(
    frame: &mut Frame<'a>,
    radiance: &'a Image,
    film: &'a Image,
    index: u32,
    count: u32,
) -> Result<()> {
    let scale = if index + 1 == count { 1.0 / count as f32 } else { 1.0 };
    let push = [u32::from(index == 0), scale.to_bits()];
    let size = [film.desc().width, film.desc().height];
    let bind = accumulate::Bind { radiance, film };
    frame.compute_over("accumulate", &bind, accumulate::Constants {}.words(), bytemuck::cast_slice(&push), size)
}
