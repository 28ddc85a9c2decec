//! Display pictures: 8-bit sRGB out as PNG, in from PNG, JPEG and WebP.

use std::io::Cursor;
use std::path::Path;

use anyhow::{Context, Result, anyhow, ensure};

/// A picture of display values: what a screen shows, not what light does.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Display {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// `width * height` pixels, rows from the top: sRGB-encoded colour, then straight (not premultiplied) alpha.
    pub rgba: Vec<[u8; 4]>,
}

/// PNG file with the pixels of `rgba`: four bytes a pixel, rows from the top, sRGB-encoded, straight alpha.
///
/// Without `has_alpha` the fourth byte is dropped and the file holds RGB. The `sRGB` chunk (perceptual intent) says
/// how to read the bytes, together with the `gAMA` and `cHRM` that the PNG specification asks for beside it, so that
/// no viewer guesses. The same input gives the same file.
pub fn encode_png(width: u32, height: u32, rgba: &[u8], has_alpha: bool) -> Result<Vec<u8>> {
    let pixels = width as usize * height as usize;
    ensure!(
        rgba.len() == pixels * 4,
        "encoding a PNG of {width}x{height} pixels: {} bytes were given, {} are needed",
        rgba.len(),
        pixels * 4
    );
    let encode = || -> Result<Vec<u8>, ::png::EncodingError> {
        let mut bytes = Vec::with_capacity(pixels * 2);
        let mut encoder = ::png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(if has_alpha { ::png::ColorType::Rgba } else { ::png::ColorType::Rgb });
        encoder.set_depth(::png::BitDepth::Eight);
        encoder.set_source_srgb(::png::SrgbRenderingIntent::Perceptual);
        encoder.set_compression(::png::Compression::Fast);
        // One fixed filter: choosing one for each row costs more time than it saves in bytes on rendered pictures.
        encoder.set_filter(::png::Filter::Paeth);
        let mut writer = encoder.write_header()?;
        if has_alpha {
            writer.write_image_data(rgba)?;
        } else {
            let mut rgb = Vec::with_capacity(pixels * 3);
            rgba.chunks_exact(4).for_each(|pixel| rgb.extend_from_slice(&pixel[..3]));
            writer.write_image_data(&rgb)?;
        }
        writer.finish()?;
        Ok(bytes)
    };
    encode().with_context(|| format!("encoding a PNG of {width}x{height} pixels"))
}

/// Reads a PNG, JPEG or WebP as 8-bit sRGB; the contents decide, not the extension.
///
/// Sixteen-bit samples are rounded to eight, grey becomes three equal colours, a palette is looked up, missing alpha
/// is 255. Colour profiles are not applied.
pub fn read_display(path: &Path) -> Result<Display> {
    let bytes = super::file::read(path)?;
    decode_display(&bytes).with_context(|| format!("reading {}", path.display()))
}

/// The same for bytes in memory.
pub fn decode_display(bytes: &[u8]) -> Result<Display> {
    let mut reader = ::image::ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
    let known = [::image::ImageFormat::Png, ::image::ImageFormat::Jpeg, ::image::ImageFormat::WebP];
    ensure!(
        reader.format().is_some_and(|format| known.contains(&format)),
        "the contents are not a picture of a known kind (OpenEXR for radiance; PNG, JPEG or WebP for display values)"
    );
    let mut limits = ::image::Limits::default();
    limits.max_alloc = Some(super::MAX_PIXELS * 8);
    reader.limits(limits);
    let decoded = reader.decode().map_err(|error| anyhow!("{error}"))?.into_rgba8();
    let (width, height) = decoded.dimensions();
    let rgba = decoded.as_raw().chunks_exact(4).map(|pixel| [pixel[0], pixel[1], pixel[2], pixel[3]]).collect();
    Ok(Display { width, height, rgba })
}
