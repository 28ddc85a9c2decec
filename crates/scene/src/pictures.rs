//! Decoding pictures: PNG, JPEG and WebP into 8-bit RGBA, guarded against files that claim absurd sizes.

use std::io::Cursor;

use anyhow::{Result, anyhow, bail};
use image::{ImageFormat, ImageReader, Limits};

use super::Image;

/// Largest width and height: what every Vulkan 1.3 device of interest can hold in one 2D image.
const MAX_SIDE: u32 = 16_384;
/// Most memory a decoder may take for one picture.
const MAX_DECODE_BYTES: u64 = 2 << 30;

fn reader(bytes: &[u8]) -> Result<ImageReader<Cursor<&[u8]>>> {
    // The first bytes decide; files often carry the wrong MIME type or ending.
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

/// Decoders answer in several lines and repeat their sources; a message here is one sentence.
fn refusal(what: &str, error: &image::ImageError) -> anyhow::Error {
    anyhow!("{what}: {}", error.to_string().split_whitespace().collect::<Vec<_>>().join(" "))
}

/// Decodes a whole picture.
pub(crate) fn decode(name: String, bytes: &[u8]) -> Result<Image> {
    let picture = reader(bytes)?.decode().map_err(|e| refusal("the picture cannot be decoded", &e))?.into_rgba8();
    let (width, height) = picture.dimensions();
    if width == 0 || height == 0 {
        bail!("the picture has no pixels");
    }
    Ok(Image { name, width, height, rgba: picture.into_raw().into() })
}

/// Reads no further than the header: enough to tell a picture from something else.
pub(crate) fn probe(bytes: &[u8]) -> Result<()> {
    reader(bytes)?.into_dimensions().map_err(|e| refusal("the picture's header cannot be read", &e))?;
    Ok(())
}
