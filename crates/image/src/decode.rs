//! Decoding of PNG, JPEG and WebP into 8-bit RGBA, with limits against files that claim absurd sizes.

use std::io::Cursor;

use anyhow::{Result, anyhow, bail};
use image::{DynamicImage, ImageFormat, ImageReader, Limits};

/// Largest picture to decode.
#[derive(Debug, Clone, Copy)]
pub struct Largest {
    /// Width and height in pixels.
    pub side: u32,
    /// Memory of a decoder in bytes.
    pub bytes: u64,
}

/// The contents are of another kind than PNG, JPEG or WebP.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the data is not PNG, JPEG or WebP")]
pub struct UnknownKind;

fn reader(bytes: &[u8], largest: Largest) -> Result<ImageReader<Cursor<&[u8]>>> {
    // The magic bytes decide: files often have the wrong MIME type or extension.
    let format = image::guess_format(bytes).ok();
    let Some(format @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP)) = format else {
        bail!(UnknownKind);
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_image_width = Some(largest.side);
    limits.max_image_height = Some(largest.side);
    limits.max_alloc = Some(largest.bytes);
    reader.limits(limits);
    Ok(reader)
}

/// An error in one sentence: decoders write several lines and repeat their sources.
fn refusal(what: &str, error: &image::ImageError) -> anyhow::Error {
    anyhow!("{what}: {}", error.to_string().split_whitespace().collect::<Vec<_>>().join(" "))
}

/// Width and height in pixels, from the header alone.
///
/// # Errors
/// [`UnknownKind`], or the decoder's cause in one sentence.
pub fn size(bytes: &[u8], largest: Largest) -> Result<[u32; 2]> {
    let size = reader(bytes, largest)?.into_dimensions();
    size.map(Into::into).map_err(|error| refusal("the picture's header cannot be read", &error))
}

/// Width and height in pixels, and four bytes for each pixel, rows from the top: colour as it is encoded, straight
/// alpha.
///
/// Sixteen-bit samples are rounded to eight, grey becomes three equal colours, palettes are resolved, missing alpha is
/// 255. Colour profiles are not applied.
///
/// # Errors
/// [`UnknownKind`], or the decoder's cause in one sentence.
pub fn rgba8(bytes: &[u8], largest: Largest) -> Result<([u32; 2], Vec<u8>)> {
    let decoded = reader(bytes, largest)?.decode().map(DynamicImage::into_rgba8);
    let decoded = decoded.map_err(|error| refusal("the picture cannot be decoded", &error))?;
    Ok((decoded.dimensions().into(), decoded.into_raw()))
}
