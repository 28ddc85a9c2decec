//! Display pictures in 8-bit sRGB: written as PNG, read from PNG, JPEG and WebP.
//!
//! Read the PNG specification (W3C) for the chunks `sRGB` and `tEXt`.

use std::io::Cursor;
use std::path::Path;

use anyhow::{Context, Result, anyhow, ensure};

use super::decode::{Largest, UnknownKind, rgba8, size};

/// A picture of display values, after tone mapping.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Display {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// `width * height` pixels, rows from the top: sRGB-encoded colour, then straight (not premultiplied) alpha.
    pub rgba: Vec<[u8; 4]>,
}

/// The colour of a pixel with straight alpha over another one; in display values, as picture viewers do.
#[must_use]
pub fn over([r, g, b, a]: [u8; 4], behind: u8) -> [u8; 3] {
    let alpha = u32::from(a);
    [r, g, b].map(|c| ((u32::from(c) * alpha + u32::from(behind) * (255 - alpha)) / 255) as u8)
}

/// PNG file of the pixels `rgba`: four bytes per pixel, rows from the top, sRGB-encoded, straight alpha.
///
/// Without `has_alpha` the fourth byte is dropped and the file holds RGB. The `sRGB` chunk (perceptual intent) states
/// the encoding. The same input gives the same file.
pub fn encode_png(width: u32, height: u32, rgba: &[u8], has_alpha: bool) -> Result<Vec<u8>> {
    encode_png_with([width, height], rgba, has_alpha, &[])
}

/// [`encode_png`] with texts (`tEXt`): keyword and text in Latin-1.
///
/// # Errors
/// The errors of [`encode_png`], and an invalid keyword.
pub fn encode_png_with(
    [width, height]: [u32; 2],
    rgba: &[u8],
    has_alpha: bool,
    texts: &[(String, String)],
) -> Result<Vec<u8>> {
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
        // One fixed filter: on rendered pictures a choice per row costs more time than it saves in bytes.
        encoder.set_filter(::png::Filter::Paeth);
        for (keyword, text) in texts {
            encoder.add_text_chunk(keyword.clone(), text.clone())?;
        }
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

/// Decodes the pixels and texts of a PNG, reading all bytes and verifying all checksums.
///
/// # Errors
/// The bytes are not a PNG, or are truncated.
pub fn decode_png_with(bytes: &[u8]) -> Result<(Display, Vec<(String, String)>)> {
    let mut decoder = ::png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(::png::Transformations::EXPAND | ::png::Transformations::ALPHA);
    let mut reader = decoder.read_info()?;
    let size = reader.output_buffer_size().context("the picture is too large")?;
    ensure!(size as u64 <= super::MAX_PIXELS * 4, "the picture is too large");
    let mut pixels = vec![0; size];
    let frame = reader.next_frame(&mut pixels)?;
    reader.finish()?;
    ensure!(
        frame.color_type == ::png::ColorType::Rgba && frame.bit_depth == ::png::BitDepth::Eight,
        "the picture is not of eight bits a colour"
    );
    let texts = &reader.info().uncompressed_latin1_text;
    let texts = texts.iter().map(|text| (text.keyword.clone(), text.text.clone())).collect();
    let rgba = pixels.as_chunks::<4>().0.to_vec();
    Ok((Display { width: frame.width, height: frame.height, rgba }, texts))
}

/// An animated PNG of pictures of one size, in an endless loop, each shown for `seconds[0] / seconds[1]` of a second.
///
/// # Errors
/// There is no picture, or the sizes differ.
pub fn encode_animation(pictures: &[Display], [seconds, of]: [u16; 2]) -> Result<Vec<u8>> {
    let first = pictures.first().context("encoding an animation: there are no pictures")?;
    let (width, height) = (first.width, first.height);
    let same = pictures.iter().all(|picture| (picture.width, picture.height) == (width, height));
    ensure!(same, "encoding an animation: the pictures are not of one size");
    let encode = || -> Result<Vec<u8>, ::png::EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = ::png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(::png::ColorType::Rgba);
        encoder.set_depth(::png::BitDepth::Eight);
        encoder.set_source_srgb(::png::SrgbRenderingIntent::Perceptual);
        encoder.set_compression(::png::Compression::Fast);
        encoder.set_animated(pictures.len() as u32, 0)?;
        encoder.set_frame_delay(seconds, of)?;
        let mut writer = encoder.write_header()?;
        for picture in pictures {
            writer.write_image_data(picture.rgba.as_flattened())?;
        }
        writer.finish()?;
        Ok(bytes)
    };
    encode().with_context(|| format!("encoding an animation of {width}x{height} pixels"))
}

/// Reads a PNG, JPEG or WebP as 8-bit sRGB; the content decides, not the extension.
/// See [`rgba8`].
///
/// # Errors
/// When the file cannot be read or decoded.
pub fn read_display(path: &Path) -> Result<Display> {
    let bytes = super::file::read(path)?;
    decode_display(&bytes).with_context(|| format!("reading {}", path.display()))
}

/// [`read_display`] for bytes in memory.
///
/// # Errors
/// When the bytes cannot be decoded.
pub fn decode_display(bytes: &[u8]) -> Result<Display> {
    let largest = Largest { side: u32::MAX, bytes: super::MAX_PIXELS * 8 };
    let [width, height] = size(bytes, largest).map_err(|error| match error.is::<UnknownKind>() {
        true => anyhow!("the contents are not a picture of a known kind (OpenEXR for radiance; PNG, JPEG or WebP for display values)"),
        false => error,
    })?;
    ensure!(
        u64::from(width) * u64::from(height) <= super::MAX_PIXELS,
        "{width}x{height} pixels are too many; {} are the most that are read",
        super::MAX_PIXELS
    );
    let (_, rgba) = rgba8(bytes, largest)?;
    Ok(Display { width, height, rgba: rgba.as_chunks::<4>().0.to_vec() })
}
