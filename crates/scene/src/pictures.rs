//! Image decoding: PNG, JPEG and WebP into 8-bit RGBA, with limits against files that claim absurd sizes.

use std::io::Cursor;

use anyhow::{Result, anyhow, bail};
use image::{ImageFormat, ImageReader, Limits};

use super::Image;

/// Largest width and height in texels, which every Vulkan 1.3 device of interest supports for a 2D image.
const MAX_SIDE: u32 = 16_384;
/// Largest memory in bytes for decoding one image.
const MAX_DECODE_BYTES: u64 = 2 << 30;

fn reader(bytes: &[u8]) -> Result<ImageReader<Cursor<&[u8]>>> {
    // The magic bytes decide: files often have the wrong MIME type or extension.
    let format = image::guess_format(bytes).ok();
    let Some(format @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP)) = format else {
        bail!("the data is not PNG, JPEG or WebP");
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(MAX_DECODE_BYTES);
    reader.limits(limits);
    Ok(reader)
}

/// An error in one sentence: decoders write several lines and repeat their sources.
fn refusal(what: &str, error: &image::ImageError) -> anyhow::Error {
    anyhow!("{what}: {}", error.to_string().split_whitespace().collect::<Vec<_>>().join(" "))
}

/// Decodes an image.
pub(crate) fn decode(name: String, bytes: &[u8]) -> Result<Image> {
    let picture = reader(bytes)?.decode().map_err(|e| refusal("the picture cannot be decoded", &e))?.into_rgba8();
    let (width, height) = picture.dimensions();
    if width == 0 || height == 0 {
        bail!("the picture has no pixels");
    }
    Ok(Image { name, width, height, rgba: picture.into_raw().into() })
}

/// Reads the header only, enough to recognise a supported image.
pub(crate) fn probe(bytes: &[u8]) -> Result<()> {
    reader(bytes)?.into_dimensions().map_err(|e| refusal("the picture's header cannot be read", &e))?;
    Ok(())
}
