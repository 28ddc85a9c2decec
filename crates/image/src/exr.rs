//! OpenEXR files of scene-linear pictures and AOVs.
//!
//! Read the OpenEXR file layout specification (openexr.com). Written files have one part, scan lines, ZIP with 16 rows
//! per block, channels `R G B A` and `name.channel` for every AOV, so that all viewers show the picture and find the
//! AOVs. Read files may have scan lines or tiles, and any compression and sample type that the `exr` crate decodes.

use std::io::Cursor;
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail, ensure};
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer,
    LayerAttributes, MetaData, ReadChannels, ReadLayers, ReadSpecificChannel, SmallVec, Text, Vec2, WritableImage,
};

use super::{Aov, AovData, MAX_PIXELS, Picture};

/// Largest plausible ratio of sample bytes to file bytes for any compression; files beyond it are refused.
const MOST_EXPANSION: u64 = 1 << 14;
/// Largest number of samples of all channels of a part to read.
const MOST_SAMPLES: u64 = 32 * MAX_PIXELS;

/// Writes `picture` and its AOVs to `path`, completely or not at all; see [`encode_exr`].
pub fn write_exr(path: &Path, picture: &Picture, aovs: &[Aov], metadata: &[(String, String)]) -> Result<()> {
    let bytes = encode_exr(picture, aovs, metadata).with_context(|| format!("writing {}", path.display()))?;
    super::file::write(path, &bytes)
}

/// OpenEXR file with the picture as f32 channels `R G B A` and each AOV as f32 or u32 channels `name.channel`.
///
/// `metadata` become text attributes. Every bit pattern is preserved, NaN included. The same input gives the same
/// bytes: no time is recorded, and attributes are in the order of their names.
pub fn encode_exr(picture: &Picture, aovs: &[Aov], metadata: &[(String, String)]) -> Result<Vec<u8>> {
    encode(picture, aovs, metadata, Encoding::SMALL_LOSSLESS)
}

/// [`encode_exr`] without compression and metadata, for temporary files: 1280x720 pixels take a tenth of the time.
///
/// # Errors
/// The errors of [`encode_exr`].
pub fn encode_exr_quickly(picture: &Picture, aovs: &[Aov]) -> Result<Vec<u8>> {
    encode(picture, aovs, &[], Encoding::UNCOMPRESSED)
}

fn encode(picture: &Picture, aovs: &[Aov], metadata: &[(String, String)], encoding: Encoding) -> Result<Vec<u8>> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let pixels = width * height;
    ensure!(pixels > 0, "a picture of {width}x{height} pixels has no pixels");
    ensure!(picture.rgba.len() == pixels, "{} pixels were given for {width}x{height}", picture.rgba.len());

    let mut list = SmallVec::new();
    for (index, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
        let samples = picture.rgba.iter().map(|pixel| pixel[index]).collect();
        list.push(channel(name, FlatSamples::F32(samples))?);
    }
    for aov in aovs {
        let stride = aov.channels.len();
        ensure!(
            aov.samples.len() == pixels * stride,
            "layer {} has {} samples, {width}x{height} pixels with {stride} channels need {}",
            aov.name,
            aov.samples.len(),
            pixels * stride
        );
        for (index, name) in aov.channels.iter().enumerate() {
            let samples = match &aov.samples {
                AovData::F32(all) => FlatSamples::F32(all.iter().skip(index).step_by(stride).copied().collect()),
                AovData::U32(all) => FlatSamples::U32(all.iter().skip(index).step_by(stride).copied().collect()),
            };
            list.push(channel(&format!("{}.{name}", aov.name), samples)?);
        }
    }
    let channels = AnyChannels::sort(list);
    if let Some(pair) = channels.list.windows(2).find(|pair| pair[0].name == pair[1].name) {
        bail!("two channels are called {}", pair[0].name);
    }

    let layer = Layer::new((width, height), LayerAttributes::default(), encoding, channels);
    let bounds = IntegerBounds::new((0, 0), (width, height));
    let image = Image::empty(ImageAttributes::new(bounds)).with_layer(layer);
    let mut bytes = Vec::with_capacity(pixels * 8);
    image.write().to_buffered(Cursor::new(&mut bytes)).map_err(|error| anyhow!("{error}"))?;
    insert_attributes(&mut bytes, metadata, height.div_ceil(16))?;
    Ok(bytes)
}

fn channel(name: &str, samples: FlatSamples) -> Result<AnyChannel<FlatSamples>> {
    // Text of the exr crate is Latin-1, and a channel name ends at a zero byte.
    let plain = !name.is_empty() && name.len() < 256 && name.bytes().all(|byte| byte.is_ascii_graphic());
    ensure!(plain, "{name:?} cannot be the name of a channel: only printable ASCII without spaces can");
    Ok(AnyChannel::new(Text::from(name), samples))
}

/// Adds text attributes at the end of the header of a one-part file.
///
/// The exr crate keeps such attributes in a hash map and writes them in its order, which differs from run to run. Here
/// they are inserted in the order of their names. The table of block offsets that follows the header is shifted
/// accordingly.
fn insert_attributes(bytes: &mut Vec<u8>, metadata: &[(String, String)], blocks: usize) -> Result<()> {
    let mut sorted: Vec<&(String, String)> = metadata.iter().collect();
    sorted.sort();
    let mut added = Vec::new();
    let mut long_names = false;
    let reserved =
        ["channels", "compression", "dataWindow", "displayWindow", "lineOrder", "chunkCount", "type", "name"];
    for (index, (name, value)) in sorted.iter().enumerate() {
        let plain = !name.is_empty() && name.len() < 256 && name.bytes().all(|byte| byte.is_ascii_graphic());
        ensure!(plain && !reserved.contains(&name.as_str()), "{name:?} cannot be the name of an attribute");
        ensure!(index == 0 || sorted[index - 1].0 != *name, "the attribute {name} is given twice");
        long_names |= name.len() > 31;
        added.extend_from_slice(name.as_bytes());
        added.extend_from_slice(b"\0string\0");
        added.extend_from_slice(&i32::try_from(value.len())?.to_le_bytes());
        added.extend_from_slice(value.as_bytes());
    }
    if added.is_empty() {
        return Ok(());
    }
    let end = header_end(bytes).context("the header that was just written has no end")?;
    let table =
        bytes.get_mut(end + 1..end + 1 + blocks * 8).context("the block table that was just written is short")?;
    for offset in table.chunks_exact_mut(8) {
        let mut old = [0; 8];
        old.copy_from_slice(offset);
        offset.copy_from_slice(&(u64::from_le_bytes(old) + added.len() as u64).to_le_bytes());
    }
    if long_names {
        // Bit 10 of the version field allows names of up to 255 bytes instead of 31.
        bytes[5] |= 0x04;
    }
    bytes.splice(end..end, added);
    Ok(())
}

/// Position of the zero byte that ends the header: attributes are `name 0 type 0 size:i32 size bytes`.
fn header_end(bytes: &[u8]) -> Option<usize> {
    let mut at = 8;
    while *bytes.get(at)? != 0 {
        for _ in 0..2 {
            at += bytes.get(at..)?.iter().position(|&byte| byte == 0)? + 1;
        }
        let size: [u8; 4] = bytes.get(at..at + 4)?.try_into().ok()?;
        at += 4 + usize::try_from(i32::from_le_bytes(size)).ok()?;
    }
    Some(at)
}

/// Channels of a file that form the picture.
enum ChannelSource {
    /// Colour channels by name, and the name of an alpha channel.
    Colour { red: Text, green: Text, blue: Text, alpha: Text },
    /// One luminance channel for all three colours.
    Grey,
}

/// Reads a scene-linear picture; see [`decode_exr`].
pub fn read_exr(path: &Path) -> Result<Picture> {
    let bytes = super::file::read(path)?;
    decode_exr(&bytes).with_context(|| format!("reading {}", path.display()))
}

/// Decodes the picture of an OpenEXR file.
///
/// Takes `R G B` and `A` of the first part that has them, else the complete `prefix.R .G .B` whose prefix ends in
/// `Combined` (Blender's picture among its passes), else the first complete one, else the luminance `Y` as grey. Half
/// and 32-bit integer samples become f32; missing alpha is 1. The picture is the display window: data outside it is
/// dropped, and missing data inside it is transparent black. Chromaticities are not applied.
pub fn decode_exr(bytes: &[u8]) -> Result<Picture> {
    let plain = |error: exr::error::Error| match error {
        exr::error::Error::Invalid(text) => anyhow!("the file is damaged: {text}"),
        exr::error::Error::NotSupported(text) => anyhow!("this kind of OpenEXR file is not supported: {text}"),
        other => anyhow!("{other}"),
    };
    // The header alone decides whether the pixels may be read: a damaged one could ask for any amount of memory.
    ensure!(bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]), "the contents are not OpenEXR");
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(plain)?;
    guard(&meta, bytes.len() as u64)?;

    // Pixels of the data window, by the channels that the header offers.
    let source = find_source(&meta)?;
    let reader = exr::image::read::read().no_deep_data().largest_resolution_level().specific_channels();
    let (position, display, (size, stored)) = match source {
        ChannelSource::Colour { red, green, blue, alpha } => {
            let image = reader
                .required(red)
                .required(green)
                .required(blue)
                .optional(alpha, 1.0f32)
                .collect_pixels(blank, |(size, pixels): &mut Stored, at, (r, g, b, a): (f32, f32, f32, f32)| {
                    pixels[at.y() * size.x() + at.x()] = [r, g, b, a];
                })
                .first_valid_layer()
                .all_attributes()
                .from_buffered(Cursor::new(bytes))
                .map_err(plain)?;
            let position = image.layer_data.attributes.layer_position;
            (position, image.attributes.display_window, image.layer_data.channel_data.pixels)
        }
        ChannelSource::Grey => {
            let image = reader
                .required("Y")
                .optional("A", 1.0f32)
                .collect_pixels(blank, |(size, pixels): &mut Stored, at, (y, a): (f32, f32)| {
                    pixels[at.y() * size.x() + at.x()] = [y, y, y, a];
                })
                .first_valid_layer()
                .all_attributes()
                .from_buffered(Cursor::new(bytes))
                .map_err(plain)?;
            let position = image.layer_data.attributes.layer_position;
            (position, image.attributes.display_window, image.layer_data.channel_data.pixels)
        }
    };
    // The picture is the display window: what the data window has of it is copied, and the rest stays transparent.
    if position == display.position && size == display.size {
        return Ok(Picture { width: size.x() as u32, height: size.y() as u32, rgba: stored });
    }
    let mut picture = Picture::filled(display.size.x() as u32, display.size.y() as u32, [0.0; 4]);
    let shift = (
        i64::from(position.x()) - i64::from(display.position.x()),
        i64::from(position.y()) - i64::from(display.position.y()),
    );
    for row in 0..size.y() as i64 {
        for column in 0..size.x() as i64 {
            let (x, y) = (column + shift.0, row + shift.1);
            if (0..display.size.x() as i64).contains(&x) && (0..display.size.y() as i64).contains(&y) {
                let from = row as usize * size.x() + column as usize;
                picture.rgba[y as usize * display.size.x() + x as usize] = stored[from];
            }
        }
    }
    Ok(picture)
}

/// Size and pixels of the data window.
type Stored = (Vec2<usize>, Vec<[f32; 4]>);

fn blank<Channels>(size: Vec2<usize>, _: &Channels) -> Stored {
    (size, vec![[0.0; 4]; size.area()])
}

/// Refuses pictures too large for memory, or implausibly large for the file size.
fn guard(meta: &MetaData, length: u64) -> Result<()> {
    for header in &meta.headers {
        for size in [header.layer_size, header.shared_attributes.display_window.size] {
            let pixels = (size.x() as u64).saturating_mul(size.y() as u64);
            ensure!(
                pixels <= MAX_PIXELS,
                "{}x{} pixels are too many; {} are the most that are read",
                size.x(),
                size.y(),
                MAX_PIXELS
            );
            ensure!(pixels > 0, "the picture has no pixels");
            ensure!(
                pixels <= length.saturating_mul(MOST_EXPANSION),
                "the file is damaged: {length} bytes cannot hold {}x{} pixels",
                size.x(),
                size.y()
            );
        }
    }
    Ok(())
}

/// [`guard`] for a reader of all channels.
fn guard_channels(meta: &MetaData, length: u64) -> Result<()> {
    guard(meta, length)?;
    for header in &meta.headers {
        let (pixels, channels) = (header.layer_size.area() as u64, header.channels.list.len() as u64);
        let samples = pixels.saturating_mul(channels);
        ensure!(samples <= MOST_SAMPLES, "{samples} samples are too many; {MOST_SAMPLES} are the most that are read");
        let bytes = pixels.saturating_mul(header.channels.bytes_per_pixel as u64);
        ensure!(
            bytes <= length.saturating_mul(MOST_EXPANSION),
            "the file is damaged: {length} bytes cannot hold {channels} channels of {pixels} pixels"
        );
    }
    Ok(())
}

fn find_source(meta: &MetaData) -> Result<ChannelSource> {
    let flat = meta.headers.iter().filter(|header| !header.deep);
    let parts: Vec<Vec<String>> =
        flat.map(|header| header.channels.list.iter().map(|channel| channel.name.to_string()).collect()).collect();
    let names = parts.concat();
    let colour = |prefix: &str| {
        let named = |channel: &str| Text::from(format!("{prefix}{channel}").as_str());
        ChannelSource::Colour { red: named("R"), green: named("G"), blue: named("B"), alpha: named("A") }
    };
    let complete = |prefix: &str| {
        let has =
            |part: &Vec<String>| ["R", "G", "B"].iter().all(|channel| part.contains(&format!("{prefix}{channel}")));
        parts.iter().any(has)
    };
    if complete("") {
        return Ok(colour(""));
    }
    let prefixes = names.iter().filter_map(|name| name.strip_suffix('R'));
    let prefixes: Vec<&str> = prefixes.filter(|prefix| prefix.ends_with('.') && complete(prefix)).collect();
    // Blender stores passes such as ambient occlusion before the picture.
    let combined = prefixes.iter().find(|prefix| prefix.ends_with("Combined."));
    if let Some(prefix) = combined.or(prefixes.first()) {
        return Ok(colour(prefix));
    }
    let has = |wanted: &str| names.iter().any(|name| name == wanted);
    ensure!(!has("RY"), "luminance with chroma channels is not supported; store R, G and B");
    if has("Y") {
        return Ok(ChannelSource::Grey);
    }
    bail!(
        "there are no channels R, G and B, only {}",
        if names.is_empty() { "deep data".into() } else { names.join(", ") }
    )
}

/// All channels of one part of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Channels {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Full names (`R`, `normal.X`) with `width * height` samples each, in the order of the names.
    pub list: Vec<(String, AovData)>,
}

/// Text attributes of the first part, such as the metadata of [`encode_exr`].
///
/// # Errors
/// The bytes are not an OpenEXR file.
pub fn texts(bytes: &[u8]) -> Result<Vec<(String, String)>> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|error| anyhow!("{error}"))?;
    guard(&meta, bytes.len() as u64)?;
    let header = meta.headers.first().context("the file has no part")?;
    let others = header.own_attributes.other.iter().chain(&header.shared_attributes.other);
    let text = |(name, value): (&Text, &AttributeValue)| match value {
        AttributeValue::Text(text) => {
            String::from_utf8(text.bytes().to_vec()).ok().map(|text| (name.to_string(), text))
        }
        _ => None,
    };
    Ok(others.filter_map(text).collect())
}

/// Reads all channels of the first flat part, with the size of its data window; half samples become f32.
pub fn read_channels(path: &Path) -> Result<Channels> {
    let bytes = super::file::read(path)?;
    decode_channels(&bytes).with_context(|| format!("reading {}", path.display()))
}

/// [`read_channels`] for bytes in memory.
///
/// # Errors
/// The bytes are not an OpenEXR file, or are truncated.
pub fn decode_channels(bytes: &[u8]) -> Result<Channels> {
    let read = || -> Result<_> {
        let meta = MetaData::read_from_buffered(Cursor::new(&bytes), false).map_err(|error| anyhow!("{error}"))?;
        guard_channels(&meta, bytes.len() as u64)?;
        let reader = exr::image::read::read().no_deep_data().largest_resolution_level().all_channels();
        let image = reader
            .first_valid_layer()
            .all_attributes()
            .from_buffered(Cursor::new(&bytes))
            .map_err(|error| anyhow!("{error}"))?;
        let layer = image.layer_data;
        let channels = layer.channel_data.list.into_iter().map(|channel| {
            let samples = match channel.sample_data {
                FlatSamples::F16(samples) => AovData::F32(samples.into_iter().map(|sample| sample.to_f32()).collect()),
                FlatSamples::F32(samples) => AovData::F32(samples),
                FlatSamples::U32(samples) => AovData::U32(samples),
            };
            (channel.name.to_string(), samples)
        });
        Ok(Channels { width: layer.size.x() as u32, height: layer.size.y() as u32, list: channels.collect() })
    };
    read()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_of_all_channels_bound_a_file() {
        let bytes = encode_exr(&Picture::filled(64, 64, [0.0; 4]), &[], &[]).unwrap();
        let meta = MetaData::read_from_buffered(Cursor::new(&bytes), false).unwrap();
        assert!(guard_channels(&meta, bytes.len() as u64).is_ok());
        // One byte may stand for so many pixels, but not for the 16 bytes of each.
        assert!(guard(&meta, 1).is_ok() && guard_channels(&meta, 1).is_err());
    }
}
