//! The environment map on the device: the map, the prefiltered environment map (GGX; shaders/pass/prefilter.comp), its
//! irradiance, and the tables of lobes (`split_sum`).
//!
//! Read Karis 2013, "Real Shading in Unreal Engine 4", for the split sum; Ramamoorthi and Hanrahan 2001, "An Efficient
//! Representation for Irradiance Environment Maps"; Real-Time Rendering (4th ed.), chapter 10. Prefiltering runs once
//! per map and is stored in the user's cache folder; the file name contains a hash of the map and of the shader.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use rayon::prelude::*;

use crate::gpu::{Buffer, Device, Frame, Image, ImageDesc, NOTHING, Place, Sampled, SamplerDesc};
use crate::image::file;
use crate::plan::Plan;
use crate::scene::environment::Environment;
use crate::shader::prefilter;
use crate::share::{self, SkyDirection};
use crate::transport::emitters::Sky;
use crate::transport::sky_directions::Sphere;
use crate::upload::split_sum;

/// Largest width of the prefiltered map's level 0; a wider environment enters at the first mip level that fits.
const WIDEST: u32 = 1024;
/// Width of the level for α = 1.
const NARROWEST: u32 = 16;

/// Lookups of the map for one level of the prefiltered map, and how many a texel has at least and at most. 128 for all
/// texels, as in Karis 2013, were off by 10 % in the mean at every α; 4096 are by 2 % (docs/decisions/split-sum.md).
const MOST_LOOKUPS: u32 = 1 << 23;
const FEWEST_SAMPLES: u32 = 128;
const MOST_SAMPLES: u32 = 4096;

/// The environment's images and constants; a dummy texel where the plan needs none.
pub struct EnvironmentOnDevice {
    sky: Image,
    prefiltered: Image,
    reflectance: Image,
    /// [`share::EnvironmentTerms`].
    pub terms: Buffer,
    /// Directions of ambient occlusion for all samples of the pixels of a pattern: [`SkyDirection`].
    pub sky_directions: Buffer,
}

/// The user's scale, rotation and blur of the environment.
#[derive(Debug, Clone, Copy)]
pub struct EnvironmentRotation {
    /// Factor on the radiance.
    pub intensity: f32,
    /// Rotation about +Y in degrees.
    pub rotation: f32,
    /// Perceptual roughness of the lobe that blurs the background.
    pub blur: f32,
}

type Texel = [f32; 4];

/// A mip chain: width, height and texels of each level.
type Levels = Vec<(u32, u32, Vec<Texel>)>;

impl EnvironmentOnDevice {
    /// Uploads and prefilters `environment` as far as the plan needs it; `seed` is that of the directions of ambient
    /// occlusion.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(
        device: &Arc<Device>,
        plan: &Plan,
        environment: Option<&Environment>,
        turn: EnvironmentRotation,
        seed: u32,
    ) -> Result<Self> {
        let lights = plan.ambient || plan.reflection || plan.rays.is_some();
        let chain = match environment {
            Some(environment) if lights || plan.sky => match plan.prefilter || !environment.is_constant() {
                true => mean_chain(environment),
                false => one_texel(environment),
            },
            _ => Vec::new(),
        };
        let sky = image(device, "environment", &chain)?;
        let levels = match (plan.prefilter, plan.reflection) {
            (true, _) => prefilter(device, &sky, &chain)?,
            // Lobes look it up also where only surfaces send light.
            (false, true) if chain.is_empty() => one_texel(&Environment::constant([0.0; 3])),
            (false, true) => chain.clone(),
            (false, false) => Vec::new(),
        };
        let prefiltered = image(device, "prefiltered environment", &levels)?;
        let tables =
            plan.reflectance.then(|| (split_sum::SIDE, 2 * split_sum::SIDE, split_sum::tables(plan.lobes).to_vec()));
        let reflectance = image(device, "tables of lobes", &tables.into_iter().collect())?;
        let mut irradiance = [[0.0; 3]; 9];
        if let (true, Some(environment)) = (plan.ambient, environment) {
            // Cosine lobe coefficients of Ramamoorthi and Hanrahan 2001, by band.
            use std::f64::consts::PI;
            let lobe = |i: usize| [PI, 2.0 * PI / 3.0, PI / 4.0][usize::from(i > 0) + usize::from(i > 3)];
            let coefficients = environment.irradiance_sh9();
            irradiance = std::array::from_fn(|i| coefficients[i].map(|c| (c * lobe(i)) as f32));
        }
        let (sin, cos) = f64::from(turn.rotation).to_radians().sin_cos();
        let terms = share::EnvironmentTerms {
            irradiance,
            cos_rotation: cos as f32,
            sin_rotation: sin as f32,
            intensity: turn.intensity,
            width: levels.first().map_or(1.0, |level| level.0 as f32),
            levels: levels.len() as f32,
            blur: turn.blur * turn.blur,
        };
        let around = environment.map(|map| Sky { map, intensity: turn.intensity, rotation: turn.rotation });
        Ok(Self {
            sky,
            prefiltered,
            reflectance,
            terms: Buffer::with_data(device, "environment terms", &[terms])?,
            sky_directions: sky_directions(device, plan, around, seed)?,
        })
    }

    /// The environment map, for the background and for rays.
    #[must_use]
    pub fn sky(&self) -> Sampled<'_> {
        Sampled { image: &self.sky, sampler: SamplerDesc::EQUIRECTANGULAR }
    }

    /// The prefiltered environment map.
    #[must_use]
    pub fn prefiltered(&self) -> Sampled<'_> {
        Sampled { image: &self.prefiltered, sampler: SamplerDesc::EQUIRECTANGULAR }
    }

    /// The tables of lobes (split sum), [`split_sum::tables`].
    #[must_use]
    pub fn reflectance(&self) -> Sampled<'_> {
        Sampled { image: &self.reflectance, sampler: SamplerDesc::LINEAR }
    }
}

/// An image with these mip levels; a dummy without any.
fn image(device: &Arc<Device>, name: &str, levels: &Levels) -> Result<Image> {
    let (format, usage) = (vk::Format::R32G32B32A32_SFLOAT, vk::ImageUsageFlags::SAMPLED);
    let Some(&(width, height, _)) = levels.first() else { return Image::nothing(device, format, usage) };
    let desc = ImageDesc { levels: levels.len() as u32, ..ImageDesc::flat(format, width, height, usage) };
    let image = Image::new(device, name, desc)?;
    let mut offsets = Vec::with_capacity(levels.len());
    let mut texels: Vec<Texel> = Vec::new();
    for (.., level) in levels {
        offsets.push(size_of_val(texels.as_slice()) as u64);
        texels.extend_from_slice(level);
    }
    let staging = Buffer::with_data(device, "staging", &texels)?;
    let mut frame = Frame::new(device);
    frame.upload("upload environment", &staging, &image, 0, &offsets);
    frame.finish()?;
    Ok(image)
}

/// One texel for a constant environment.
fn one_texel(environment: &Environment) -> Levels {
    environment.radiance.first().map(|&[r, g, b]| (1, 1, vec![[r, g, b, 1.0]])).into_iter().collect()
}

/// The mip chain of the map, down to a single texel: each texel is the mean of its directions, so rows count by their
/// solid angle. Of an odd number of rows the last one is left out.
fn mean_chain(environment: &Environment) -> Levels {
    let texels = environment.radiance.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
    let mut levels: Levels = vec![(environment.width, environment.height, texels)];
    loop {
        let (w, h, last) = &levels[levels.len() - 1];
        let (w, h) = (*w as usize, *h as usize);
        if w == 1 && h == 1 {
            return levels;
        }
        let (nw, nh) = ((w / 2).max(1), (h / 2).max(1));
        let cosine = |row: usize| (std::f64::consts::PI * row as f64 / h as f64).cos();
        let solid_angle = |row: usize| cosine(row) - cosine(row + 1);
        let mut next = vec![[0.0; 4]; nw * nh];
        next.par_chunks_mut(nw).enumerate().for_each(|(y, row)| {
            let [above, below] = [(2 * y).min(h - 1), (2 * y + 1).min(h - 1)];
            let share = (solid_angle(below) / (solid_angle(above) + solid_angle(below))) as f32;
            for (x, texel) in row.iter_mut().enumerate() {
                let [left, right] = [(2 * x).min(w - 1), (2 * x + 1).min(w - 1)];
                for (i, value) in texel.iter_mut().enumerate() {
                    let mean = |y: usize| 0.5 * (last[y * w + left][i] + last[y * w + right][i]);
                    *value = mean(above) + (mean(below) - mean(above)) * share;
                }
            }
        });
        levels.push((nw as u32, nh as u32, next));
    }
}

/// Mip levels of the prefiltered map, of halving width from at most [`WIDEST`] to [`NARROWEST`] texels: level 0 is the
/// map, every other level is filtered with the GGX lobe of α = 16 / width.
fn prefilter(device: &Arc<Device>, sky: &Image, chain: &Levels) -> Result<Levels> {
    let first = chain.iter().position(|(width, ..)| *width <= WIDEST).unwrap_or(chain.len() - 1);
    let (width, height, base) = &chain[first];
    let mut levels: Levels = vec![(*width, *height, base.clone())];
    let mut sizes = Vec::new();
    let (mut w, mut h) = (*width, *height);
    while w / 2 >= NARROWEST {
        (w, h) = (w / 2, (h / 2).max(1));
        sizes.push((w, h));
    }
    let cache = cache_file(device, chain);
    if let Some(known) = cache.as_ref().and_then(|path| std::fs::read(path).ok()) {
        let total: usize = sizes.iter().map(|&(w, h)| (w * h) as usize * size_of::<Texel>()).sum();
        // The file begins with the hash of the rest; a damaged file is computed again.
        let (hash, rest) = known.split_at(known.len().min(HASH_BYTES));
        if rest.len() == total && file::hash(rest).as_bytes() == hash {
            let texels: Vec<Texel> = bytemuck::pod_collect_to_vec(rest);
            let mut rest = texels.as_slice();
            for &(w, h) in &sizes {
                let (level, after) = rest.split_at((w * h) as usize);
                levels.push((w, h, level.to_vec()));
                rest = after;
            }
            return Ok(levels);
        }
    }
    let mut all: Vec<Texel> = Vec::new();
    for &(w, h) in &sizes {
        let level = Buffer::new(device, "prefiltered level", 16 * u64::from(w * h), Place::Readback)?;
        let mut frame = Frame::new(device);
        let map = Sampled { image: sky, sampler: SamplerDesc::EQUIRECTANGULAR };
        let bind = prefilter::Bind { environment_map: map, level: &level };
        let alpha = NARROWEST as f32 / w as f32;
        let samples = (MOST_LOOKUPS / (w * h)).clamp(FEWEST_SAMPLES, MOST_SAMPLES);
        let push = prefilter::Push { size: [w, h], alpha, base_width: chain[0].0 as f32, samples };
        frame.compute_over("prefilter environment", &bind, &prefilter::Constants::default(), &push, [w, h])?;
        frame.read_back(&level);
        frame.finish()?;
        let texels: Vec<Texel> = level.read(|bytes| bytemuck::pod_collect_to_vec(&bytes[..16 * (w * h) as usize]));
        all.extend_from_slice(&texels);
        levels.push((w, h, texels));
    }
    if let Some(path) = cache {
        // A cache that cannot be written costs time at the next start, nothing else.
        let _ = path.parent().map(std::fs::create_dir_all);
        let texels = bytemuck::cast_slice(&all);
        let _ = file::write(&path, &[file::hash(texels).as_bytes(), texels].concat());
    }
    Ok(levels)
}

/// Hexadecimal digits of [`file::hash`].
const HASH_BYTES: usize = 32;

/// The cache file of the prefiltered levels, named by hashes of the map's texels at all mip levels, of the shader with
/// its numbers of samples, and of the device.
fn cache_file(device: &Device, chain: &Levels) -> Option<PathBuf> {
    let folder = file::cache_folder()?;
    let levels: Vec<String> = chain.iter().map(|(.., texels)| file::hash(bytemuck::cast_slice(texels))).collect();
    let map = file::hash(levels.concat().as_bytes());
    let words: &[u8] = bytemuck::cast_slice(prefilter::PROGRAM.stages[0].words);
    let samples: [u32; 3] = [MOST_LOOKUPS, FEWEST_SAMPLES, MOST_SAMPLES];
    let info = device.info();
    let samples: &[u8] = bytemuck::cast_slice(&samples);
    let maker =
        file::hash(&[words, samples, info.name.as_bytes(), info.driver.as_bytes(), info.version.as_bytes()].concat());
    let (width, height, _) = chain[0];
    Some(folder.join(format!("environment-{map}-{maker}-{width}x{height}")))
}

/// The directions of ambient occlusion. For each sample: those of primary surfaces, a list for each pixel of the
/// pattern; then those of surfaces that rays meet, of coarser cuts.
fn sky_directions(device: &Arc<Device>, plan: &Plan, sky: Option<Sky<'_>>, seed: u32) -> Result<Buffer> {
    if plan.occlusion_rays() == 0 {
        return Buffer::new(device, NOTHING, 0, Place::Device);
    }
    // Without an environment rays look for surfaces, in equal solid angles.
    let black = Environment::constant([0.0; 3]);
    let sky = sky.unwrap_or(Sky { map: &black, intensity: 1.0, rotation: 0.0 });
    let [primary, hit] = [plan.occlusion_rays(), plan.occlusion_rays_at_hits()];
    let pixels = plan.occlusion_pattern().pow(2);
    // Each pixel of the pattern has a cut of its own, about axes of its own.
    let sphere = Sphere::new(sky);
    let cuts = |pixel: u32| {
        let axes = u64::from(seed) * u64::from(pixels) + u64::from(pixel);
        sphere.directions_of_two_cuts(primary * plan.samples, hit * plan.samples, axes)
    };
    let cuts: Vec<_> = (0..pixels).into_par_iter().map(cuts).collect();
    let mut directions = Vec::new();
    for sample in 0..plan.samples as usize {
        for (of, rays) in [primary, hit].into_iter().enumerate() {
            for list in cuts.iter().filter_map(|cuts| cuts[of].chunks(rays as usize).nth(sample)) {
                directions.extend(list.iter().map(|at| SkyDirection {
                    direction: at.direction.as_vec3().to_array(),
                    weight: at.weight.map(|w| w as f32),
                    solid_angle: at.solid_angle as f32,
                }));
            }
        }
    }
    Buffer::with_data(device, "sky directions", &directions)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn averaging_keeps_a_constant_map() {
        let environment = Environment::constant([0.25, 0.5, 1.0]);
        for (.., level) in mean_chain(&environment) {
            assert!(level.iter().all(|t| *t == [0.25, 0.5, 1.0, 1.0]));
        }
    }
}
