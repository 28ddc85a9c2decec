//! Denoising by non-local means: each half of the samples is filtered with weights of the other half
//! (shaders/lib/nl_means.glsl).
//!
//! Read Buades, Coll and Morel 2005, "A Non-Local Algorithm for Image Denoising"; Rousselle, Knaus and Zwicker 2012,
//! "Adaptive Rendering with Non-Local Means Filtering"; docs/decisions/denoising.md.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use super::sum::{Sum, images_of};
use crate::gpu::{Device, Frame, Image, ImageDesc};
use crate::shader::{denoise, denoise_halves, denoise_variance};

/// The images between the passes.
pub struct Denoising {
    /// Means of the two halves of the samples.
    means: [Image; 2],
    /// Their log radiance, and as alpha the variance: of the pixel, and the mean around it.
    guides: [Image; 2],
}

impl Denoising {
    /// For a picture of `size` pixels.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, size: [u32; 2]) -> Result<Self> {
        let image = |name: &str| {
            let usage = vk::ImageUsageFlags::STORAGE;
            Image::new(device, name, ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, size[0], size[1], usage))
        };
        Ok(Self {
            means: [image("mean of even samples")?, image("mean of odd samples")?],
            guides: [image("guide of even samples")?, image("guide of odd samples")?],
        })
    }
}

/// Denoises `film`, the mean of the samples of two sums; with the number of samples of each, which is not 0, and of a
/// block.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
pub fn denoise<'a>(
    frame: &mut Frame<'a>,
    with: &'a Denoising,
    (sums, samples, block): (&'a [Sum], &[u32], u32),
    film: &'a Image,
) -> Result<()> {
    let Denoising { means: [mean_a, mean_b], guides: [guide_a, guide_b] } = with;
    let size = [film.desc().width, film.desc().height];
    let (sample_sums, has) = images_of(sums, samples, block);
    let bind = denoise_halves::Bind { sample_sums, mean_a, mean_b, guide_a, guide_b };
    let push = denoise_halves::Push { scale_a: 1.0 / samples[0] as f32, scale_b: 1.0 / samples[1] as f32, has };
    frame.compute_over("halves of samples", &bind, &denoise_halves::Constants {}, &push, size)?;
    let bind = denoise_variance::Bind { guide_a, guide_b };
    frame.compute_over("variance of samples", &bind, &denoise_variance::Constants {}, &(), size)?;
    let bind = denoise::Bind { mean_a, mean_b, guide_a, guide_b, film };
    let share_a = samples[0] as f32 / (samples[0] + samples[1]) as f32;
    frame.compute_over("denoise", &bind, &denoise::Constants {}, &denoise::Push { share_a }, size)
}
