//! Film to display bytes (shaders/pass/tonemap.comp).

use std::sync::Arc;

use anyhow::{Result, ensure};

use crate::gpu::{Buffer, Device, Frame, Image, Place};
use crate::shader::tonemap;

/// What the last pass writes back: no count, and nothing that memory is filled with.
const CANARY: u32 = 0x65_74_61_6c;

/// What the last pass leaves for the host.
pub struct Display {
    /// RGBA8, sRGB-encoded, rows from the top.
    pub pixels: Buffer,
    counts: Buffer,
    device: Arc<Device>,
}

/// Values that are not radiances, counted before anything clamps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Pixels with a NaN.
    pub nan: u32,
    /// Pixels with an infinity.
    pub inf: u32,
    /// Pixels with a negative component.
    pub negative: u32,
}

impl Display {
    /// Buffers for a picture of `size` pixels.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, size: [u32; 2]) -> Result<Self> {
        Ok(Self {
            pixels: Buffer::new(device, "display", 4 * u64::from(size[0]) * u64::from(size[1]), Place::Readback)?,
            counts: Buffer::new(device, "counts of non-radiances", 16, Place::Readback)?,
            device: device.clone(),
        })
    }

    /// The counts of the frame that has just finished.
    ///
    /// # Errors
    /// When the device has not run it, and shows nothing: a driver without its hardware.
    pub fn counts(&self) -> Result<Counts> {
        self.counts.read(|bytes| {
            let words: &[u32] = bytemuck::cast_slice(bytes);
            ensure!(
                words[3] == CANARY,
                "device \"{}\" runs nothing: what it was given is not done",
                self.device.info().name
            );
            Ok(Counts { nan: words[0], inf: words[1], negative: words[2] })
        })
    }
}

/// Multiplies a film by `scale`, exposes by `exposure` stops, bends by tone curve number `curve`, and encodes; `background` is display-linear with
/// alpha 1, or all 0 to keep transparency. With `desaturates` colours outside of Rec. 709 keep their luminance.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn tonemap<'a>(
    frame: &mut Frame<'a>,
    (film, scale): (&'a Image, f32),
    display: &'a Display,
    curve: u32,
    exposure: f32,
    background: [f32; 4],
    desaturates: bool,
) -> Result<()> {
    frame.fill("reset counts", &display.counts, 0);
    let push = tonemap::Push { background, exposure: exposure.exp2(), scale, canary: CANARY };
    let bind = tonemap::Bind { film, display: &display.pixels, counts: &display.counts };
    let size = [film.desc().width, film.desc().height];
    let constants = tonemap::Constants { curve, desaturates, ..Default::default() };
    frame.compute_over("tone map", &bind, &constants, &push, size)?;
    frame.read_back(&display.pixels);
    frame.read_back(&display.counts);
    Ok(())
}
