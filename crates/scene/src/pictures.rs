//! Image decoding: PNG, JPEG, WebP and KTX2 with Basis Universal data into 8-bit RGBA, with limits against files that
//! claim absurd sizes.
//!
//! Read KHR_texture_basisu and the KTX 2.0 specification.

use anyhow::{Context, Result, anyhow, bail, ensure};
use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};
use etalon_image::decode::{Largest, UnknownKind, rgba8, size};

use super::document::view_of;
use super::{Image, Material, Meaning, MissingImages};

/// Largest width and height in texels, which every Vulkan 1.3 device of interest supports for a 2D image.
const MAX_SIDE: u32 = 16_384;
/// Largest image to decode.
const LARGEST: Largest = Largest { side: MAX_SIDE, bytes: 2 << 30 };

/// The end of the warning about an image that a checker replaces.
pub const REPLACED: &str = "a checker stands in its place";

/// What the texels of an image are, in the order in which it decides for an image of several uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum ImageUse {
    Color,
    /// Factors.
    Data,
    Normals,
}

impl ImageUse {
    /// The use of an image by these materials.
    pub(crate) fn of(materials: &[Material], image: usize) -> Self {
        let slots = materials.iter().flat_map(Material::textures);
        let uses = slots.filter(|(.., texture)| texture.is_some_and(|texture| texture.image == image)).map(
            |(slot, meaning, _)| match (slot, meaning) {
                ("normal" | "clearcoat_normal", _) => Self::Normals,
                (_, Meaning::Color) => Self::Color,
                (_, Meaning::Data) => Self::Data,
            },
        );
        uses.min().unwrap_or(Self::Data)
    }

    /// 8 by 8 squares that are seen wherever the image was to be: magenta and black colours; factors kept and halved;
    /// normals that are straight and tilted.
    fn checker(self, name: &str) -> Image {
        const SQUARES: u32 = 8;
        // Not one: filtering would leave no square.
        const SIDE: u32 = 8;
        let texels = match self {
            Self::Color => [[255, 0, 255, 255], [0, 0, 0, 255]],
            Self::Data => [[255; 4], [128, 128, 128, 255]],
            Self::Normals => [[128, 128, 255, 255], [166, 128, 249, 255]],
        };
        let side = SQUARES * SIDE;
        let texel = |i: u32| texels[((i % side / SIDE + i / side / SIDE) % 2) as usize];
        Image { name: name.to_owned(), width: side, height: side, rgba: (0..side * side).flat_map(texel).collect() }
    }
}

/// The context of an error: the name of an image that cannot be read, for which [`MissingImages::Checker`] is a way
/// out.
#[derive(Debug)]
pub struct UnreadableImage(String);

impl std::fmt::Display for UnreadableImage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl MissingImages {
    /// An image as it was read; or, where it cannot be read and this is allowed, a checker and a warning. `name` begins
    /// the sentence.
    pub(crate) fn replace(
        self,
        read: Result<Image>,
        name: &str,
        of: ImageUse,
        warnings: &mut Vec<String>,
    ) -> Result<Image> {
        match (read, self) {
            (Err(error), Self::Checker) => {
                warnings.push(format!("{name} cannot be read ({error:#}): {REPLACED}"));
                Ok(of.checker(name))
            }
            (read, _) => read.context(UnreadableImage(name.to_owned())),
        }
    }
}

/// An error of the decoders, which do not know of KTX2.
fn refusal(error: anyhow::Error) -> anyhow::Error {
    if error.is::<UnknownKind>() { anyhow!("the data is not PNG, JPEG, WebP or KTX2") } else { error }
}

/// Place of offset and length of the key/value data in the header of a KTX2 file.
const KEY_VALUE_WORDS: std::ops::Range<usize> = 56..64;
/// Bytes of a UASTC block of 4 by 4 texels.
const BLOCK_BYTES: u64 = 16;

/// The first bytes of a KTX2 file.
const KTX2_MAGIC: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Reads the header of a KTX2 file of the kind that KHR_texture_basisu allows: one two-dimensional picture. Returns its
/// size.
fn ktx2_size(bytes: &[u8]) -> Result<[u32; 2]> {
    // The header alone: the crate's reader of data format descriptors adds sizes of hostile files without a check.
    let header =
        bytes.first_chunk::<{ ktx2::Header::LENGTH }>().ok_or_else(|| anyhow!("the KTX2 header ends early"))?;
    let header =
        ktx2::Header::from_bytes(header).map_err(|error| anyhow!("the KTX2 header cannot be read: {error}"))?;
    let [width, height] = [header.pixel_width, header.pixel_height];
    ensure!(
        (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height),
        "the picture of {width}x{height} texels has no side of 1 to {MAX_SIDE}"
    );
    ensure!(
        header.pixel_depth == 0 && header.layer_count <= 1 && header.face_count == 1,
        "the KTX2 file is no single two-dimensional picture"
    );
    let scheme = header.supercompression_scheme.map_or(0, |scheme| scheme.value());
    ensure!(header.format.is_none() && scheme <= 2, "the KTX2 file does not hold Basis Universal data");
    let levels = header.level_count.max(1);
    ensure!(levels <= 1 + width.max(height).ilog2(), "{levels} mip levels are too many");
    // The transcoder adds and allocates by these words without a check.
    let index = header.index;
    let sections = [
        (u64::from(index.dfd_byte_offset), u64::from(index.dfd_byte_length)),
        (u64::from(index.kvd_byte_offset), u64::from(index.kvd_byte_length)),
        (index.sgd_byte_offset, index.sgd_byte_length),
    ];
    for (offset, length) in sections {
        view_of("a section that the KTX2 header names", "the file", bytes, offset, length)?;
    }
    let blocks = u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4));
    for level in 0..levels as usize {
        let at = ktx2::Header::LENGTH + level * ktx2::LevelIndex::LENGTH;
        let words = bytes.get(at..).and_then(|rest| rest.first_chunk()).context("the KTX2 level index ends early")?;
        let level = ktx2::LevelIndex::from_bytes(words);
        view_of("a mip level", "the KTX2 file", bytes, level.byte_offset, level.byte_length)?;
        ensure!(
            level.uncompressed_byte_length <= blocks * BLOCK_BYTES,
            "a level of the KTX2 file claims {} bytes for {blocks} blocks",
            level.uncompressed_byte_length
        );
    }
    Ok([width, height])
}

pub(crate) fn decode_ktx2(name: String, bytes: &[u8]) -> Result<Image> {
    let [width, height] = ktx2_size(bytes)?;
    let fault = |error: basisu::Error| anyhow!("the Basis Universal data cannot be decoded: {error:?}");
    // The transcoder walks key/value data without checking its lengths, and a still picture needs none: the copy has
    // none.
    let mut file = bytes.to_vec();
    file[KEY_VALUE_WORDS].fill(0);
    let transcode = || {
        let transcoder = Transcoder::new(&file).map_err(fault)?;
        let source = transcoder.source_format();
        ensure!(
            matches!(source, SourceFormat::Etc1s | SourceFormat::UastcLdr),
            "the KTX2 file holds {source:?}; KHR_texture_basisu has ETC1S and UASTC"
        );
        // Mip levels of the file are not read: its picture gets mip levels as all others do.
        transcoder.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(fault)
    };
    // Broken Huffman tables lead the transcoder past the end of its own lists, which it takes for a mistake of its own.
    let rgba = std::panic::catch_unwind(transcode)
        .map_err(|_| anyhow!("the Basis Universal data cannot be decoded: its tables are broken"))??;
    let expected = 4 * width as usize * height as usize;
    ensure!(rgba.len() == expected, "the Basis Universal data has {} bytes for {width}x{height} texels", rgba.len());
    Ok(Image { name, width, height, rgba: rgba.into() })
}

/// Decodes an image.
pub(crate) fn decode(name: String, bytes: &[u8]) -> Result<Image> {
    if bytes.starts_with(KTX2_MAGIC) {
        return decode_ktx2(name, bytes);
    }
    let ([width, height], rgba) = rgba8(bytes, LARGEST).map_err(refusal)?;
    if width == 0 || height == 0 {
        bail!("the picture has no pixels");
    }
    Ok(Image { name, width, height, rgba: rgba.into() })
}

/// Reads the header only, enough to recognise a supported image.
pub(crate) fn probe(bytes: &[u8]) -> Result<()> {
    if bytes.starts_with(KTX2_MAGIC) {
        return ktx2_size(bytes).map(drop);
    }
    size(bytes, LARGEST).map(drop).map_err(refusal)
}
