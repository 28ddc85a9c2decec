//! Uploads of tables: direct writes on a CPU device, a staging buffer and a copy elsewhere.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use half::f16;

use crate::gpu::{Buffer, Device, Frame, Place};

/// Two half floats in one word, the inverse of GLSL's `unpackHalf2x16`.
pub(super) fn pack_half_2x16([x, y]: [f16; 2]) -> u32 {
    u32::from(x.to_bits()) | u32::from(y.to_bits()) << 16
}

/// A buffer with `data` in the device's fastest memory: written directly on a CPU device, through a staging buffer on
/// others.
///
/// # Errors
/// When the data does not fit the device.
pub fn upload<T: bytemuck::NoUninit>(
    device: &Arc<Device>,
    name: &str,
    data: &[T],
    texels: Option<vk::Format>,
) -> Result<Buffer> {
    let bytes: &[u8] = bytemuck::cast_slice(data);
    let place = if device.info().kind == "cpu" { Place::Upload } else { Place::Device };
    let size = bytes.len() as u64;
    if texels.is_none() {
        device.check_bound(name, size)?;
    }
    let mut buffer = match texels {
        Some(format) => Buffer::texels(device, name, size, place, format)?,
        None => Buffer::new(device, name, size, place)?,
    };
    if place == Place::Upload {
        buffer.write(bytes);
    } else if size > 0 {
        let staging = Buffer::with_data(device, "staging", bytes)?;
        let mut frame = Frame::new(device);
        frame.copy_buffer("upload", &staging, &buffer, size);
        frame.finish()?;
    }
    Ok(buffer)
}
