//! Sums of samples in blocks, so that a split render is bit-identical (shaders/pass/accumulate.comp, join.comp).
//!
//! Read docs/decisions/shards.md. The samples of a picture are added in blocks of equal size, first to last, and then
//! the blocks. The blocks depend only on the number of samples. Processes that draw different blocks therefore produce
//! the same sum as one process, to the last bit: a sum in single precision depends on its order.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use super::accumulate::accumulate;
use crate::gpu::{Device, Frame, Image, ImageDesc};
use crate::shader::join;
use crate::shader::lib::sample_sums::{self, HAS_OPEN_A, HAS_OPEN_B, HAS_TOTAL_A, HAS_TOTAL_B};

/// Number of blocks of a picture's samples, when there are enough samples.
pub const BLOCKS: u32 = 64;

/// Samples per block of a sum of `samples` samples.
#[must_use]
pub fn block_of(samples: u32) -> u32 {
    samples.div_ceil(BLOCKS).max(1)
}

/// A sum of samples on the device.
pub struct Sum {
    /// Sum of the completed blocks.
    pub total: Image,
    /// Sum of the current block, when a block can take more than one frame.
    open: Option<Image>,
}

/// A sample of a sum, or one band of it.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Index of the sample in the sum.
    pub index: u32,
    /// Samples per block.
    pub block: u32,
    /// Whether the frame is the sample's first band.
    pub begins: bool,
    /// Whether the frame is the sample's last band.
    pub ends: bool,
}

impl Sample {
    /// Whether the frame completes a block.
    #[must_use]
    pub fn ends_block(self) -> bool {
        self.ends && (self.index + 1).is_multiple_of(self.block)
    }
}

impl Sum {
    /// A sum of up to `samples` samples in `bands` bands of wavelengths, of a picture of `size` pixels.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, name: &str, size: [u32; 2], samples: u32, bands: u32) -> Result<Self> {
        let image = |name: &str| {
            let usage = vk::ImageUsageFlags::STORAGE;
            Image::new(device, name, ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, size[0], size[1], usage))
        };
        let open = if samples > 1 && (block_of(samples) > 1 || bands > 0) {
            Some(image(&format!("block of the {name}"))?)
        } else {
            None
        };
        Ok(Self { total: image(name)?, open })
    }

    /// Whether there is no separate image for the current block.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.open.is_none()
    }

    /// Adds a sample, or one band of it. The total restarts with the block that contains the sample `from`, and is
    /// multiplied by `scale` whenever a block has been added.
    ///
    /// # Errors
    /// When the driver refuses a descriptor or a layout.
    pub fn add<'a>(
        &'a self,
        frame: &mut Frame<'a>,
        radiance: &'a Image,
        sample: Sample,
        from: u32,
        (scale, bands): (f32, u32),
    ) -> Result<()> {
        let Sample { index, block, begins, .. } = sample;
        let first_block = index / block == from / block;
        let Some(open) = self.open.as_ref().filter(|_| block > 1 || bands > 0) else {
            return accumulate(frame, radiance, &self.total, first_block && begins, scale, bands);
        };
        accumulate(frame, radiance, open, index.is_multiple_of(block) && begins, 1.0, bands)?;
        if sample.ends_block() {
            accumulate(frame, open, &self.total, first_block, scale, 0)?;
        }
        Ok(())
    }

    /// The images with contents after `samples` samples in blocks of `block`: the total, and the current block.
    #[must_use]
    pub fn images(&self, samples: u32, block: u32) -> [Option<&Image>; 2] {
        let total = (samples >= block).then_some(&self.total);
        [total, self.open.as_ref().filter(|_| !samples.is_multiple_of(block))]
    }
}

/// The images of one or two sums after `samples` of each, and bits of those that hold something: shaders read no other.
pub(super) fn images_of<'a>(sums: &'a [Sum], samples: &[u32], block: u32) -> (sample_sums::Bind<'a>, u32) {
    let images: Vec<Option<&Image>> = sums.iter().zip(samples).flat_map(|(sum, &of)| sum.images(of, block)).collect();
    let image = |i: usize| images.get(i).copied().flatten();
    let at = |i: usize| image(i).unwrap_or(&sums[0].total);
    let bits = [HAS_TOTAL_A, HAS_OPEN_A, HAS_TOTAL_B, HAS_OPEN_B];
    let has = (0..).zip(bits).filter(|(i, _)| image(*i).is_some()).map(|(_, bit)| bit).sum();
    (sample_sums::Bind { total_a: at(0), open_a: at(1), total_b: at(2), open_b: at(3) }, has)
}

/// Writes the mean of all samples of several sums into `film`; `samples` holds the number of samples of each sum.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
pub fn join<'a>(frame: &mut Frame<'a>, sums: &'a [Sum], samples: &[u32], block: u32, film: &'a Image) -> Result<()> {
    let (sample_sums, has) = images_of(sums, samples, block);
    let bind = join::Bind { sample_sums, film };
    let push = join::Push { scale: 1.0 / samples.iter().sum::<u32>() as f32, has };
    frame.compute_over("join sums", &bind, &join::Constants {}, &push, [film.desc().width, film.desc().height])
}
