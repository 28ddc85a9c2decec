//! The environment map on the device: the map, the prefiltered environment map (GGX), its irradiance, and the table of
//! directional albedo (shaders/pass/prefilter.comp).
//!
//! Read Karis 2013, "Real Shading in Unreal Engine 4", for the split sum; Ramamoorthi and Hanrahan 2001, "An Efficient
//! Representation for Irradiance Environment Maps"; Real-Time Rendering (4th ed.), chapter 10. Prefiltering runs once
//! per map and is stored in the user's cache folder; the file name contains a hash of the map and of the shader.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use anyhow::Result;
use ash::vk;
use glam::DVec3;
use rayon::prelude::*;

use crate::gpu::{Buffer, Device, Frame, Image, ImageDesc, NOTHING, Place, Sampled, SamplerDesc};
use crate::image::file;
use crate::plan::Plan;
use crate::scene::environment::Environment;
use crate::scene::lobe::LOBES;
use crate::shader::prefilter;
use crate::share::{self, SkyDirection};
use crate::transport;
use crate::transport::emitters::Sky;

/// Largest width of the prefiltered map's level 0; a wider environment enters at the first mip level that fits.
const WIDEST: u32 = 1024;
/// Width of the level for α = 1.
const NARROWEST: u32 = 16;
/// Side of the directional albedo table (split sum), over cosθ and perceptual roughness.
const REFLECTANCE: u32 = 32;

/// The environment's images and constants; a dummy texel where the plan needs none.
pub struct EnvironmentOnDevice {
    sky: Image,
    prefiltered: Image,
    reflectance: Image,
    /// [`share::EnvironmentTerms`].
    pub terms: Buffer,
    /// Directions of ambient occlusion for all samples of a pixel: [`SkyDirection`].
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
                true => box_chain(environment),
                false => one_texel(environment),
            },
            _ => Vec::new(),
        };
        let sky = image(device, "environment", &chain)?;
        let levels = match (plan.prefilter, plan.reflection) {
            (true, _) => prefilter(device, &sky, &chain)?,
            (false, true) => chain.clone(),
            (false, false) => Vec::new(),
        };
        let prefiltered = image(device, "prefiltered environment", &levels)?;
        let table = plan.reflectance.then(|| (REFLECTANCE, REFLECTANCE, reflectance_table(plan.lobes).to_vec()));
        let reflectance = image(device, "directional reflectance", &table.into_iter().collect())?;
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

    /// Directional albedo of the specular lobe (split sum): factors of F0 and F90 over (cosθ, roughness).
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

/// The mip chain of the map by a box filter, down to a single texel.
fn box_chain(environment: &Environment) -> Levels {
    let texels = environment.radiance.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
    let mut levels: Levels = vec![(environment.width, environment.height, texels)];
    loop {
        let (w, h, last) = &levels[levels.len() - 1];
        let (w, h) = (*w as usize, *h as usize);
        if w == 1 && h == 1 {
            return levels;
        }
        let (nw, nh) = ((w / 2).max(1), (h / 2).max(1));
        let mut next = vec![[0.0; 4]; nw * nh];
        next.par_chunks_mut(nw).enumerate().for_each(|(y, row)| {
            for (x, texel) in row.iter_mut().enumerate() {
                let xs = [(2 * x).min(w - 1), (2 * x + 1).min(w - 1)];
                let ys = [(2 * y).min(h - 1), (2 * y + 1).min(h - 1)];
                for sy in ys {
                    for sx in xs {
                        for (sum, value) in texel.iter_mut().zip(last[sy * w + sx]) {
                            *sum += 0.25 * value;
                        }
                    }
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
        let push = prefilter::Push { size: [w, h], alpha, base_width: chain[0].0 as f32 };
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

/// The cache file of the prefiltered levels, named by hashes of the map's texels, of the shader and of the device.
fn cache_file(device: &Device, chain: &Levels) -> Option<PathBuf> {
    let folder = file::cache_folder()?;
    let map = file::hash(bytemuck::cast_slice(&chain[0].2));
    let words: &[u8] = bytemuck::cast_slice(prefilter::PROGRAM.stages[0].words);
    let info = device.info();
    let maker = file::hash(&[words, info.name.as_bytes(), info.driver.as_bytes(), info.version.as_bytes()].concat());
    let (width, height, _) = chain[0];
    Some(folder.join(format!("environment-{map}-{maker}-{width}x{height}")))
}

/// Directional albedo of the GGX lobe, split into the factors of F0 and F90 (split sum, Karis 2013):
/// A = ∫ (1 − (1 − V·H)⁵) G₂ V·H / (N·H N·V), B the same integral with (1 − V·H)⁵, over the distribution of half
/// vectors.
///
/// The table is computed once per process, in two forms: with the albedo of an extension's lobe in the other channels,
/// or without.
fn reflectance_table(lobes: u32) -> &'static [Texel] {
    static TABLES: [OnceLock<Vec<Texel>>; 2] = [const { OnceLock::new() }; 2];
    let side = REFLECTANCE as usize;
    // Both axes run from 0 to 1 inclusive; the horizon, where the lobe is invisible, takes its limit.
    let at = |i: usize| i as f64 / (side - 1) as f64;
    let seen = LOBES.iter().enumerate().filter(|(place, _)| lobes >> place & 1 != 0);
    let over = seen.filter_map(|(_, lobe)| lobe.albedo).next();
    let row = |row: usize| {
        let over = over.map_or(vec![[0.0; 2]; side], |albedo| albedo(at(row), side));
        over.into_iter().enumerate().map(move |(i, [c, d])| {
            let [a, b] = directional_reflectance(at(i).max(1e-4), at(row));
            [a, b, c, d].map(|x| x as f32)
        })
    };
    // At most one lobe has an albedo (`LOBES`).
    TABLES[usize::from(over.is_some())].get_or_init(|| (0..side).into_par_iter().flat_map_iter(row).collect())
}

/// Importance sampling of the visible normals (VNDF, Heitz 2018): each sample's weight is G₂ / G₁(V), at most 1, so the
/// sum never exceeds the received energy. 512 samples are accurate to 3e-3, and to 6e-4 in the mean over the table's
/// texels; with 128, white metals of roughness 0.5 reflected 1.002 of the received light. Sampling D alone needs 4096
/// for 4e-3.
fn directional_reflectance(cos_v: f64, roughness: f64) -> [f64; 2] {
    const SAMPLES: u32 = 512;
    let alpha = roughness * roughness;
    let a2 = alpha * alpha;
    let root = |c: f64| (a2 + (1.0 - a2) * c * c).sqrt();
    let v = DVec3::new((1.0 - cos_v * cos_v).sqrt(), 0.0, cos_v);
    // V in the stretched space where the microsurface is a hemisphere, and a basis around it; V has no y.
    let stretched = DVec3::new(alpha * v.x, 0.0, v.z).normalize();
    let (t1, t2) = (DVec3::Y, stretched.cross(DVec3::Y));
    let mut sum = [0.0; 2];
    for i in 0..SAMPLES {
        let radius = ((f64::from(i) + 0.5) / f64::from(SAMPLES)).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i.reverse_bits()) / 2_f64.powi(32)).sin_cos();
        // A point on the projected disk of the hemisphere seen from V: its lower half is foreshortened.
        let x = radius * cos;
        let lower = 0.5 * (1.0 + stretched.z);
        let y = (1.0 - lower) * (1.0 - x * x).sqrt() + lower * radius * sin;
        let n = t1 * x + t2 * y + stretched * (1.0 - x * x - y * y).max(0.0).sqrt();
        let h = DVec3::new(alpha * n.x, alpha * n.y, n.z.max(0.0)).normalize();
        let v_h = v.dot(h);
        let cos_l = (h * (2.0 * v_h) - v).z;
        if cos_l > 0.0 {
            let masking = 2.0 * cos_v / (cos_v + root(cos_v));
            let masking_shadowing = 2.0 * cos_l * cos_v / (cos_v * root(cos_l) + cos_l * root(cos_v));
            let weight = masking_shadowing / masking;
            let grazing = (1.0 - v_h).powi(5);
            sum[0] += weight * (1.0 - grazing);
            sum[1] += weight * grazing;
        }
    }
    sum.map(|s| s / f64::from(SAMPLES))
}

/// The directions of ambient occlusion for all samples of a pixel.
fn sky_directions(device: &Arc<Device>, plan: &Plan, sky: Option<Sky<'_>>, seed: u32) -> Result<Buffer> {
    let Some(sky) = sky.filter(|_| plan.occlusion_rays() > 0) else {
        return Buffer::new(device, NOTHING, 0, Place::Device);
    };
    // Of each sample those of primary surfaces, then those of surfaces that rays meet: a coarser cut, whose directions
    // are the middles of larger regions.
    let [primary, hit] = [plan.occlusion_rays(), plan.occlusion_rays_at_hits()];
    let of_primary = transport::sky_directions::sky_directions(sky, primary * plan.samples, seed);
    let of_hits = transport::sky_directions::sky_directions(sky, hit * plan.samples, seed);
    let samples = of_primary.chunks(primary as usize).zip(of_hits.chunks(hit as usize));
    let directions: Vec<SkyDirection> = samples
        .flat_map(|(of_primary, of_hit)| of_primary.iter().chain(of_hit))
        .map(|at| SkyDirection {
            direction: at.direction.as_vec3().to_array(),
            weight: at.weight.map(|w| w as f32),
            solid_angle: at.solid_angle as f32,
        })
        .collect();
    Buffer::with_data(device, "sky directions", &directions)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_lobe_reflects_as_fresnel_says() {
        let [a, b] = directional_reflectance(0.5, 0.02);
        let grazing = 0.5_f64.powi(5);
        assert!((a - (1.0 - grazing)).abs() < 5e-3, "{a}");
        assert!((b - grazing).abs() < 5e-3, "{b}");
    }

    #[test]
    fn no_lobe_reflects_more_than_it_receives() {
        for roughness in [0.05, 0.2, 0.5, 0.8, 1.0] {
            for cos_v in [0.02, 0.1, 0.5, 1.0] {
                let [a, b] = directional_reflectance(cos_v, roughness);
                assert!(a + b <= 1.0 && a >= 0.0 && b >= 0.0, "{cos_v} {roughness}: {a} {b}");
            }
        }
    }

    /// The reference integral by the midpoint rule over the hemisphere of L, without importance sampling.
    #[test]
    fn the_table_is_the_integral() {
        for (cos_v, roughness) in [(0.9, 0.6), (0.3, 0.5), (0.1, 0.8), (0.6, 1.0)] {
            let alpha: f64 = roughness * roughness;
            let v = DVec3::new((1.0_f64 - cos_v * cos_v).sqrt(), 0.0, cos_v);
            let root = |c: f64| (alpha * alpha + (1.0 - alpha * alpha) * c * c).sqrt();
            let (rings, turns) = (1000, 1000);
            let mut truth = [0.0; 2];
            for i in 0..rings {
                let cos_l = (f64::from(i) + 0.5) / f64::from(rings);
                for j in 0..turns {
                    let (sin, cos) = (std::f64::consts::TAU * (f64::from(j) + 0.5) / f64::from(turns)).sin_cos();
                    let sin_l = (1.0 - cos_l * cos_l).sqrt();
                    let l = DVec3::new(sin_l * cos, sin_l * sin, cos_l);
                    let h = (l + v).normalize();
                    let d = alpha * alpha / (std::f64::consts::PI * (h.z * h.z * (alpha * alpha - 1.0) + 1.0).powi(2));
                    let visibility = 0.5 / (cos_v * root(cos_l) + cos_l * root(cos_v));
                    let value = d * visibility * cos_l * std::f64::consts::TAU / f64::from(rings * turns);
                    let grazing = (1.0 - v.dot(h)).powi(5);
                    truth[0] += value * (1.0 - grazing);
                    truth[1] += value * grazing;
                }
            }
            let table = directional_reflectance(cos_v, roughness);
            for (table, truth) in table.iter().zip(truth) {
                assert!((table - truth).abs() < 3e-3, "{cos_v} {roughness}: {table} {truth}");
            }
        }
    }

    #[test]
    fn averaging_keeps_a_constant_map() {
        let environment = Environment::constant([0.25, 0.5, 1.0]);
        for (.., level) in box_chain(&environment) {
            assert!(level.iter().all(|t| *t == [0.25, 0.5, 1.0, 1.0]));
        }
    }
}
