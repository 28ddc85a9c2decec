//! States of all paths between two dispatches (shaders/lib/path_state.glsl).
//!
//! Read pbrt (4th ed.), chapter 15 (structure of arrays).

use std::sync::Arc;

use anyhow::Result;

use crate::gpu::{Buffer, Device, NOTHING, Place};
use crate::plan::Rays;
use crate::shader::lib;

/// States of paths by pixel, and the extent of the picture that they belong to.
pub struct PathStates {
    states: [Buffer; 6],
    /// Entries of the first queue: all pixels of its tiles, including those outside of the picture.
    pub places: u32,
    /// Width of the picture in pixels.
    pub width: u32,
}

/// A buffer of words, or a dummy.
///
/// # Errors
/// When memory is short.
pub fn words(device: &Arc<Device>, name: &'static str, wanted: bool, words: u64) -> Result<Buffer> {
    match wanted {
        true => Buffer::new(device, name, 4 * words, Place::Device),
        false => Buffer::new(device, NOTHING, 0, Place::Device),
    }
}

impl PathStates {
    /// States of the paths of a picture of `size` pixels.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, rays: Rays, touching: bool, size: [u32; 2], places: u32) -> Result<Self> {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        Ok(Self {
            states: [
                words(device, "origins of paths", true, 4 * pixels)?,
                words(device, "directions of paths", true, 4 * pixels)?,
                words(device, "throughputs of paths", true, 4 * pixels)?,
                words(device, "light of paths", true, 4 * pixels)?,
                words(device, "media of paths", rays.transmissive, 4 * pixels)?,
                words(device, "what paths are after", touching, pixels)?,
            ],
            places,
            width: size[0],
        })
    }

    /// Bindings of the states.
    #[must_use]
    pub fn bind(&self) -> lib::path_state::Bind<'_> {
        let [origins, directions, throughputs, sums, media, t_mins] = &self.states;
        lib::path_state::Bind { origins, directions, throughputs, sums, media, t_mins }
    }
}
