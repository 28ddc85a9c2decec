//! Textures as pages: images of one size and transfer function are the layers of one array image, with mip levels.
//!
//! Read Real-Time Rendering (4th ed.), section 6.2 (mipmapping); the Vulkan specification, chapter Image Operations.
//! lavapipe cannot index arrays of sampled images, but an array layer is only a coordinate.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::{Arc, OnceLock};

use anyhow::Result;
use ash::vk;
use rayon::prelude::*;

use super::table::upload;
use crate::gpu::{Binding, Buffer, Device, Frame, Image, ImageDesc, Place, Sampled, SamplerDesc};
use crate::scene::{AlphaMode, Mark, Material, Meaning, Sampler, Scene, Shared, TextureRef, Wrap};
use crate::shader::{PAGES, lib};

/// Texture slots of a material.
pub const SLOTS: usize = lib::material::SLOTS as usize;

/// The textures of a material, indexed by texture slot.
#[must_use]
pub fn texture_slots(m: &Material) -> [(Option<TextureRef>, Meaning); SLOTS] {
    let mut slots = [(None, Meaning::Data); SLOTS];
    for (name, meaning, texture) in m.textures() {
        let is_named = |page: &&Binding| page.name.strip_suffix("_page") == Some(name);
        if let Some(page) = PAGES.bindings.iter().find(is_named) {
            slots[page.slot as usize] = (texture, meaning);
        }
    }
    slots
}

/// All textures of a scene on the device.
pub struct Textures {
    pages: Vec<Image>,
    /// (image, meaning) → (page, layer).
    places: BTreeMap<(usize, Meaning), (usize, u32)>,
    white: Image,
    /// Texels of all textures and mip levels, for rays.
    pub texels: Buffer,
    for_rays: Texels,
    made_of: TextureRequest,
    images: Vec<Mark<u8>>,
}

/// The set of textures to upload; unchanged requests reuse the images.
#[derive(PartialEq)]
struct TextureRequest {
    textures: BTreeSet<(usize, Meaning)>,
    /// Images whose alpha can hide texels: only for them alpha weights the mip levels.
    faded: BTreeSet<usize>,
    for_rays: bool,
}

impl TextureRequest {
    fn of(scene: &Scene, for_rays: bool) -> Self {
        let slots = scene.materials.iter().flat_map(texture_slots);
        let hides = scene.materials.iter().filter(|material| material.alpha_mode != AlphaMode::Opaque);
        Self {
            textures: slots.filter_map(|(texture, meaning)| texture.map(|t| (t.image, meaning))).collect(),
            faded: hides.filter_map(|material| material.base_color_texture.map(|texture| texture.image)).collect(),
            for_rays,
        }
    }

    /// Identity marks of the used images, in the order of image indices.
    fn images(&self, scene: &Scene) -> Vec<Mark<u8>> {
        let used: BTreeSet<usize> = self.textures.iter().map(|&(image, _)| image).collect();
        used.into_iter().map(|image| scene.images[image].rgba.mark()).collect()
    }
}

impl Textures {
    /// Uploads the images of the scene's materials and, with `for_rays`, a buffer of all mip levels. Pixels are moved
    /// out of the scene image by image, so only one decoded image exists twice at a time. `before` is reused when it
    /// holds the same images.
    ///
    /// # Errors
    /// When memory is short or an image is larger than the device allows.
    pub fn new(device: &Arc<Device>, scene: &mut Scene, for_rays: bool, before: Option<Self>) -> Result<Self> {
        let wanted = TextureRequest::of(scene, for_rays);
        let images = wanted.images(scene);
        match before.filter(|before| before.made_of == wanted && before.images == images) {
            Some(before) => Ok(before),
            None => Self::upload(device, scene, wanted, images),
        }
    }

    fn upload(device: &Arc<Device>, scene: &mut Scene, made_of: TextureRequest, marks: Vec<Mark<u8>>) -> Result<Self> {
        let TextureRequest { textures: wanted, faded, for_rays: keep_for_rays } = &made_of;
        let mut for_rays = Texels::default();
        let mut groups: BTreeMap<(u32, u32, Meaning), Vec<usize>> = BTreeMap::new();
        for &(image, meaning) in wanted {
            let source = &scene.images[image];
            let layers = groups.entry((source.width, source.height, meaning)).or_default();
            if !layers.contains(&image) {
                layers.push(image);
            }
        }
        let mut pages = Vec::new();
        let mut places = BTreeMap::new();
        for (&(width, height, meaning), images) in &groups {
            let levels = 32 - width.max(height).leading_zeros();
            let format = match meaning {
                Meaning::Color => vk::Format::R8G8B8A8_SRGB,
                Meaning::Data => vk::Format::R8G8B8A8_UNORM,
            };
            let page = Image::new(
                device,
                &format!("texture page {width}x{height}"),
                ImageDesc {
                    format,
                    width,
                    height,
                    layers: images.len() as u32,
                    levels,
                    array: true,
                    usage: vk::ImageUsageFlags::SAMPLED,
                },
            )?;
            // Two images at a time: their mip levels are computed in parallel, and their staging buffers exist
            // together.
            for (chunk_index, chunk) in images.chunks(2).enumerate() {
                let chains: Vec<Vec<u8>> = chunk
                    .par_iter()
                    .map(|&image| {
                        let weighted = meaning == Meaning::Color && faded.contains(&image);
                        mip_chain(&scene.images[image].rgba, width, height, levels, meaning, weighted)
                    })
                    .collect();
                for (i, (&image, chain)) in chunk.iter().zip(chains).enumerate() {
                    let layer = (chunk_index * 2 + i) as u32;
                    places.insert((image, meaning), (pages.len(), layer));
                    let mut staging = Buffer::new(device, "staging", chain.len() as u64, Place::Upload)?;
                    staging.write(&chain);
                    if *keep_for_rays {
                        for_rays.add((image, meaning), [width, height], levels, &chain);
                    }
                    drop(chain);
                    let mut frame = Frame::new(device);
                    frame.upload("upload texture", &staging, &page, layer, &level_offsets(width, height, levels));
                    frame.finish()?;
                    let last_use =
                        groups.iter().filter(|((.., m), list)| *m > meaning && list.contains(&image)).count() == 0;
                    if last_use {
                        scene.images[image].rgba = Shared::default();
                    }
                }
            }
            pages.push(page);
        }
        let white = Image::new(
            device,
            "white texture",
            ImageDesc {
                format: vk::Format::R8G8B8A8_UNORM,
                width: 1,
                height: 1,
                layers: 1,
                levels: 1,
                array: true,
                usage: vk::ImageUsageFlags::SAMPLED,
            },
        )?;
        let staging = Buffer::with_data(device, "staging", &[0xffff_ffff_u32])?;
        let mut frame = Frame::new(device);
        frame.upload("upload white", &staging, &white, 0, &[0]);
        frame.finish()?;
        let words = std::mem::take(&mut for_rays.words);
        let texels = upload(device, "texels for rays", &words, Some(vk::Format::R32_UINT))?;
        Ok(Self { pages, places, white, texels, for_rays, made_of, images: marks })
    }

    /// The ray shaders' texel of a material's texture slot.
    #[must_use]
    pub fn slot(&self, texture: Option<TextureRef>, meaning: Meaning) -> [u32; 4] {
        self.for_rays.slot(texture, meaning)
    }

    /// The page of a texture with its sampler; a white texel when the material has no texture.
    #[must_use]
    pub fn sampled(&self, texture: Option<TextureRef>, meaning: Meaning) -> Sampled<'_> {
        match texture.and_then(|t| self.places.get(&(t.image, meaning)).map(|place| (t, place))) {
            Some((texture, &(page, _))) => Sampled { image: &self.pages[page], sampler: sampler(texture.sampler) },
            None => Sampled { image: &self.white, sampler: SamplerDesc::NEAREST },
        }
    }

    /// Layer of a texture in its page.
    #[must_use]
    pub fn layer(&self, texture: TextureRef, meaning: Meaning) -> u32 {
        self.places.get(&(texture.image, meaning)).map_or(0, |&(_, layer)| layer)
    }
}

/// All mip levels of all textures in one array, for shaders that select a texture by index (shaders/lib/hit.glsl).
#[derive(Default)]
struct Texels {
    /// RGBA, one byte each.
    words: Vec<u32>,
    places: BTreeMap<(usize, Meaning), [u32; 3]>,
}

impl Texels {
    fn add(&mut self, key: (usize, Meaning), [width, height]: [u32; 2], levels: u32, chain: &[u8]) {
        self.places.insert(key, [self.words.len() as u32, width | height << 16, levels]);
        let words = chain.as_chunks::<4>().0;
        self.words.extend(words.iter().map(|bytes| u32::from_le_bytes(*bytes)));
    }

    /// A texture slot: first texel | width, height | levels, flags << 8 | unused; zeros without a texture.
    fn slot(&self, texture: Option<TextureRef>, meaning: Meaning) -> [u32; 4] {
        let place = texture.and_then(|t| self.places.get(&(t.image, meaning)).map(|place| (t.sampler, place)));
        let Some((sampler, &[first, size, levels])) = place else { return [0; 4] };
        let wrap = |wrap| match wrap {
            Wrap::Repeat => 0,
            Wrap::Mirror => 1,
            Wrap::Clamp => 2,
        };
        let flags = u32::from(meaning == Meaning::Color)
            | u32::from(sampler.mag_nearest) << 1
            | wrap(sampler.wrap_u) << 2
            | wrap(sampler.wrap_v) << 4;
        let levels = if sampler.mips { levels } else { 1 };
        [first, size, levels | flags << 8, 0]
    }
}

fn sampler(sampler: Sampler) -> SamplerDesc {
    let wrap = |wrap| match wrap {
        Wrap::Repeat => vk::SamplerAddressMode::REPEAT,
        Wrap::Mirror => vk::SamplerAddressMode::MIRRORED_REPEAT,
        Wrap::Clamp => vk::SamplerAddressMode::CLAMP_TO_EDGE,
    };
    let filter = |nearest| if nearest { vk::Filter::NEAREST } else { vk::Filter::LINEAR };
    SamplerDesc {
        wrap: [wrap(sampler.wrap_u), wrap(sampler.wrap_v)],
        mag: filter(sampler.mag_nearest),
        min: filter(sampler.min_nearest),
        mip: sampler.mips.then_some(vk::SamplerMipmapMode::LINEAR),
    }
}

/// Byte offset of each level in a tightly packed RGBA8 chain.
fn level_offsets(width: u32, height: u32, levels: u32) -> Vec<u64> {
    let mut offset = 0;
    (0..levels)
        .map(|level| {
            let here = offset;
            offset += 4 * u64::from((width >> level).max(1)) * u64::from((height >> level).max(1));
            here
        })
        .collect()
}

/// Linear value of each sRGB byte (IEC 61966-2-1).
fn linear_from_srgb() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| {
        std::array::from_fn(|byte| {
            let x = byte as f64 / 255.0;
            (if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }) as f32
        })
    })
}

/// sRGB byte for each of 2^14 + 1 linear values: half a step of the darkest bytes is 2.5 entries.
fn srgb_from_linear() -> &'static [u8] {
    static TABLE: OnceLock<Vec<u8>> = OnceLock::new();
    TABLE.get_or_init(|| {
        (0..=1_u32 << 14)
            .map(|i| {
                let x = f64::from(i) / f64::from(1 << 14);
                let y = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
                (y * 255.0 + 0.5) as u8
            })
            .collect()
    })
}

/// The base level and all mip levels: box filter of 2x2 texels (3 along an odd side), colour in linear light. With
/// `weighted` alpha weights the colours, so that invisible texels do not bleed into visible ones.
fn mip_chain(rgba: &[u8], width: u32, height: u32, levels: u32, meaning: Meaning, weighted: bool) -> Vec<u8> {
    let offsets = level_offsets(width, height, levels);
    let bytes = offsets.last().copied().unwrap_or(0) as usize + 4;
    let mut chain = vec![0; bytes.max(rgba.len())];
    chain[..rgba.len()].copy_from_slice(rgba);
    let (mut w, mut h) = (width as usize, height as usize);
    for level in 1..levels as usize {
        let (nw, nh) = ((w / 2).max(1), (h / 2).max(1));
        let (above, below) = chain.split_at_mut(offsets[level] as usize);
        let above = &above[offsets[level - 1] as usize..];
        below[..4 * nw * nh].par_chunks_mut(4 * nw).enumerate().for_each(|(y, row)| {
            // An odd side of 2k + 1 becomes k: the last texel averages three.
            let ys = if y + 1 == nh { (2 * y).min(h - 1)..h } else { 2 * y..2 * y + 2 };
            for (x, texel) in row.as_chunks_mut::<4>().0.iter_mut().enumerate() {
                let xs = if x + 1 == nw { (2 * x).min(w - 1)..w } else { 2 * x..2 * x + 2 };
                *texel = average(above, w, xs, ys.clone(), meaning, weighted);
            }
        });
        (w, h) = (nw, nh);
    }
    chain
}

/// Mean of a block of texels of a level with `width` texels per row.
fn average(
    level: &[u8],
    width: usize,
    xs: Range<usize>,
    ys: Range<usize>,
    meaning: Meaning,
    weighted: bool,
) -> [u8; 4] {
    let (to_linear, to_srgb) = (linear_from_srgb(), srgb_from_linear());
    let mut sum = [0.0_f32; 4];
    let mut weight = 0.0_f32;
    let count = (xs.len() * ys.len()) as f32;
    for y in ys.clone() {
        for texel in level[4 * (y * width + xs.start)..4 * (y * width + xs.end)].as_chunks::<4>().0 {
            let alpha = f32::from(texel[3]);
            let share = if weighted { alpha } else { 1.0 };
            for (sum, &byte) in sum.iter_mut().zip(&texel[..3]) {
                *sum += share * if meaning == Meaning::Color { to_linear[usize::from(byte)] } else { f32::from(byte) };
            }
            sum[3] += alpha;
            weight += share;
        }
    }
    if weight == 0.0 {
        // All texels are invisible; their colour still bleeds into visible neighbours when filtered.
        return average(level, width, xs, ys, meaning, false);
    }
    let mean = |sum: f32| sum / weight;
    let byte = |sum: f32| match meaning {
        Meaning::Color => to_srgb[(mean(sum) * 16384.0 + 0.5) as usize],
        Meaning::Data => (mean(sum) + 0.5) as u8,
    };
    [byte(sum[0]), byte(sum[1]), byte(sum[2]), (sum[3] / count + 0.5) as u8]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_image_stays_constant_on_every_level() {
        for (width, height) in [(8, 8), (7, 5), (1, 9), (6, 1)] {
            let levels = 32 - width.max(height as u32).leading_zeros();
            let rgba: Vec<u8> = [200, 13, 77, 255].repeat((width * height as u32) as usize);
            for meaning in [Meaning::Color, Meaning::Data] {
                let chain = mip_chain(&rgba, width, height as u32, levels, meaning, true);
                assert!(chain.chunks_exact(4).all(|t| t == [200, 13, 77, 255]), "{width}x{height}");
            }
        }
    }

    #[test]
    fn colour_is_averaged_in_linear_light() {
        let rgba = [[255, 255, 255, 255], [0, 0, 0, 255]].concat();
        let chain = mip_chain(&rgba, 2, 1, 2, Meaning::Color, false);
        assert_eq!(chain[8], 188); // sRGB of 0.5
        assert_eq!(mip_chain(&rgba, 2, 1, 2, Meaning::Data, false)[8], 128);
    }

    #[test]
    fn invisible_texels_do_not_fringe() {
        let rgba = [[10, 200, 10, 255], [255, 0, 255, 0]].concat();
        let chain = mip_chain(&rgba, 2, 1, 2, Meaning::Color, true);
        assert_eq!(&chain[8..], [10, 200, 10, 128]);
        // Without weights alpha has no influence, and an all-invisible block keeps its colour.
        assert_eq!(mip_chain(&rgba, 2, 1, 2, Meaning::Color, false)[8], 188);
        let hidden = [[255, 255, 255, 0], [0, 0, 0, 0]].concat();
        assert_eq!(mip_chain(&hidden, 2, 1, 2, Meaning::Color, true)[8..], [188, 188, 188, 0]);
    }

    #[test]
    fn every_byte_survives_the_tables() {
        for byte in 0..=255_u8 {
            let linear = linear_from_srgb()[usize::from(byte)];
            assert_eq!(srgb_from_linear()[(linear * 16384.0 + 0.5) as usize], byte);
        }
    }
}
