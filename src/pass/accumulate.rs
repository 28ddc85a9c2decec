//! Accumulation of samples into the film (shaders/pass/accumulate.comp).
//!
//! Read pbrt (4th ed.), section 5.4 (film).

use anyhow::Result;

use crate::gpu::{Frame, Image};
use crate::shader::{Library, accumulate, lib};
use crate::upload::spectrum::rgb_from_xyz;

/// Adds `radiance` to `film` and multiplies the sum by `scale`; `first` overwrites the film. With `bands` above 0,
/// `radiance` is one band of wavelengths in CIE XYZ.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
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
