//! Tone mapping: film to display bytes (shaders/pass/tonemap.comp).
//!
//! Read Real-Time Rendering (4th ed.), section 8.2 (scene to screen), and docs/colour.md.

use std::sync::Arc;

use anyhow::{Result, ensure};

use crate::gpu::{Buffer, Device, Frame, Image, Place};
use crate::shader::tonemap;

/// A known word that the pass writes back: neither a count nor a fill pattern, it proves that the device executes
/// commands.
const CANARY: u32 = 0x65_74_61_6c;

/// The host-visible output of the last pass.
pub struct Display {
    /// RGBA8, sRGB-encoded, rows from the top.
    pub pixels: Buffer,
    counts: Buffer,
    device: Arc<Device>,
}

/// Pixels that are not valid radiance, counted before any clamp.
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
            counts: Buffer::new(device, "counts of non-radiances", 16, Place::Counters)?,
            device: device.clone(),
        })
    }

    /// The counts of the frame that has just finished.
    ///
    /// # Errors
    /// When the device has not executed the frame, as with a driver without its hardware.
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

/// Multiplies a film by `scale`, exposes it by `exposure` stops, applies tone curve number `curve`, and encodes sRGB.
/// `background` is display-linear with alpha 1, or all 0 to keep transparency. With `desaturates`, colours outside of
/// Rec. 709 keep their luminance.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
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
