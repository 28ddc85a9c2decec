//! Two halves of the samples, each with random numbers of its own: what they differ by is the picture's error
//! (shaders/pass/join_halves.comp).

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use crate::gpu::{Device, Frame, Image, ImageDesc};
use crate::shader::join_halves;

/// Sums of the even and of the odd samples.
pub struct Halves {
    /// The two.
    pub sums: [Image; 2],
}

impl Halves {
    /// For a picture of `size` pixels.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, size: [u32; 2]) -> Result<Self> {
        let usage = vk::ImageUsageFlags::STORAGE;
        let sum =
            |name| Image::new(device, name, ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, size[0], size[1], usage));
        Ok(Self { sums: [sum("sum of even samples")?, sum("sum of odd samples")?] })
    }
}

/// Writes the mean of `count` samples into `film`; of one alone, which is in the first half.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn join_halves<'a>(frame: &mut Frame<'a>, halves: &'a Halves, film: &'a Image, count: u32) -> Result<()> {
    let [half_a, half_b] = &halves.sums;
    let (half_b, scale) = if count == 1 { (half_a, 0.5) } else { (half_b, 1.0 / count as f32) };
    let size = [film.desc().width, film.desc().height];
    let bind = join_halves::Bind { half_a, half_b, film };
    frame.compute_over("join halves", &bind, &join_halves::Constants {}, &join_halves::Push { scale }, size)
}
