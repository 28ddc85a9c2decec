//! What the host reads of a renderer: the film, halves of its samples, parts, G-buffer layers, PNG bytes.

use std::sync::Arc;

use anyhow::{Result, bail};
use ash::vk;
use rayon::prelude::*;

use super::settings::{Settings, display_background};
use super::targets::Targets;
use super::{Counts, Part, Picture, Rendered, Renderer};
use crate::gpu::{Buffer, Device, Frame, Image, ImageDesc, Place};
use crate::image::halves::{SampleError, error_of_halves};
use crate::image::png;
use crate::pass::aov::aov;
use crate::pass::denoise::{Denoising, denoise};
use crate::pass::gbuffer::gbuffer;
use crate::pass::sum::Sum;
use crate::pass::tonemap::{Display, tonemap};
use crate::scene::Camera;
use crate::share::AovPixel;
use crate::upload::view::{View, jitter};

impl Renderer {
    /// The scene-linear film of the last picture, over the background colour.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn film(&self) -> Result<Picture> {
        let mut picture = self.film_alone()?;
        self.settings.background.lay_behind(&mut picture);
        Ok(picture)
    }

    /// The film without a background colour, its coverage as alpha: the input of [`Settings::view_transform`].
    ///
    /// # Errors
    /// When the driver fails.
    pub fn film_alone(&self) -> Result<Picture> {
        let mut picture = self.read(self.film_on_device())?;
        if self.targets.film.is_none() && !self.targets.sums.is_empty() {
            self.divide_unfinished(&mut picture);
        }
        Ok(picture)
    }

    /// Makes the mean of a sum that ended before its last sample, which would have divided it.
    fn divide_unfinished(&self, sum: &mut Picture) {
        let [samples, count] = self.drawn;
        if samples < count {
            let scale = 1.0 / samples as f32;
            sum.rgba.iter_mut().flatten().for_each(|value| *value *= scale);
        }
    }

    /// The film on the device, for passes of other programs: linear RGBA in f32, without a background colour.
    #[must_use]
    pub fn film_on_device(&self) -> &Image {
        let Targets { film, sums, radiance, .. } = &self.targets;
        film.as_ref().or(sums.first().map(|sum| &sum.total)).unwrap_or(radiance)
    }

    /// A part of the film of the last picture; `None` unless [`Settings::parts`] names it. Its alpha is undefined.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn part(&self, part: Part) -> Result<Option<Picture>> {
        let Some(kept) = self.targets.parts.iter().find(|kept| kept.part == part) else { return Ok(None) };
        let mut picture = self.read(kept.film())?;
        self.divide_unfinished(&mut picture);
        Ok(Some(picture))
    }

    /// The sum of `samples` samples in blocks of `block`, read back.
    fn sum(&self, sum: &Sum, samples: u32, block: u32) -> Result<Picture> {
        let mut images = sum.images(samples, block).into_iter().flatten();
        let Some(first) = images.next() else { bail!("a sum of no samples was asked for: our mistake") };
        let mut all = self.read(first)?;
        for other in images {
            let other = self.read(other)?;
            for (sum, value) in all.rgba.iter_mut().flatten().zip(other.rgba.iter().flatten()) {
                *sum += value;
            }
        }
        Ok(all)
    }

    /// The sums of even and of odd samples, after `samples` of `count`.
    fn half_sums(&self, samples: u32, count: u32) -> Result<[Picture; 2]> {
        let (of_sums, block) = self.samples_of_sums(samples, count);
        let sum = |half: usize| self.sum(&self.targets.sums[half], of_sums[half], block);
        Ok([sum(0)?, sum(1)?])
    }

    /// Error estimate from the two halves after `samples` samples.
    pub(super) fn error(&self, samples: u32, count: u32) -> Result<SampleError> {
        let [a, b] = self.half_sums(samples, count)?;
        let (of_sums, _) = self.samples_of_sums(samples, count);
        Ok(error_of_halves([&a.rgba, &b.rgba], [of_sums[0], of_sums[1]]))
    }

    /// The means of the two halves of the last picture's samples, over the background colour; `None` when there is one
    /// sum, or one sample.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn half_means(&self) -> Result<Option<[Picture; 2]>> {
        let mut halves = self.half_means_alone()?;
        halves.iter_mut().flatten().for_each(|half| self.settings.background.lay_behind(half));
        Ok(halves)
    }

    /// The means of the two halves without a background colour, their coverage as alpha.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn half_means_alone(&self) -> Result<Option<[Picture; 2]>> {
        let [samples, count] = self.drawn;
        if self.halves() < 2 || samples < 2 {
            return Ok(None);
        }
        let mut halves = self.half_sums(samples, count)?;
        for (half, of) in halves.iter_mut().zip(self.samples_of_sums(samples, count).0) {
            let scale = 1.0 / of as f32;
            half.rgba.iter_mut().flatten().for_each(|value| *value *= scale);
        }
        Ok(Some(halves))
    }

    pub(super) fn write(&self, film: &Image, picture: &Picture) -> Result<()> {
        let source = Buffer::with_data(&self.device, "staging", &picture.rgba)?;
        let mut frame = Frame::new(&self.device);
        frame.upload("upload sum", &source, film, 0, &[0]);
        frame.finish().map(drop)
    }

    pub(super) fn read(&self, film: &Image) -> Result<Picture> {
        let [width, height] = self.settings.size;
        let bytes = 16 * u64::from(width) * u64::from(height);
        let target = Buffer::new(&self.device, "film read back", bytes, Place::Readback)?;
        let mut frame = Frame::new(&self.device);
        frame.download("read film", film, &target);
        frame.read_back(&target);
        frame.finish()?;
        let texels = |all: &[u8]| bytemuck::cast_slice(&all[..bytes as usize]).par_iter().copied().collect();
        let rgba = target.read(texels);
        Ok(Picture { width, height, rgba })
    }

    /// The G-buffer at the pixel centres as AOVs, with the view whose eye `p_rel` is relative to.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn aovs(&mut self, camera: &Camera) -> Result<(Vec<AovPixel>, View)> {
        self.surfaces(camera, false)
    }

    /// Called-for pixels: for each material of the scene, the number of pixels whose nearest surface at the centre has
    /// it, transparent ones included.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn pixels_by_material(&mut self, camera: &Camera) -> Result<Vec<u64>> {
        let (surfaces, _) = self.surfaces(camera, true)?;
        let mut counts = Vec::new();
        for material in surfaces.iter().filter_map(|pixel| (pixel.material as usize).checked_sub(1)) {
            if counts.len() <= material {
                counts.resize(material + 1, 0);
            }
            counts[material] += 1;
        }
        Ok(counts)
    }

    /// The surfaces at the pixel centres; with `all`, transparent surfaces, too.
    fn surfaces(&mut self, camera: &Camera, all: bool) -> Result<(Vec<AovPixel>, View)> {
        let [width, height] = self.settings.size;
        let view = View::new(camera, self.settings.size, self.scene.bounds);
        self.scene.set_view(&view);
        self.rays.set_eye(&view);
        self.scene.upload_band(None);
        self.camera.write(bytemuck::bytes_of(&view.shared(jitter(0, 1))));
        let mut frame = self.frame();
        let mut draws = self.scene.draws(false, self.rays.inside());
        if all {
            draws.extend(self.scene.draws(true, self.rays.inside()));
        }
        gbuffer(&mut frame, &self.scene, &self.targets.gbuffer, 0.0, draws)?;
        frame.finish()?;
        // One readback holds as many rows as a storage buffer binding allows.
        let row_bytes = u64::from(width) * size_of::<AovPixel>() as u64;
        let rows = ((self.device.max_storage_bytes() / row_bytes) as u32).clamp(1, height);
        let pixels = Buffer::new(&self.device, "AOVs", row_bytes * u64::from(rows), Place::Readback)?;
        let mut all: Vec<AovPixel> = Vec::with_capacity(width as usize * height as usize);
        for first in (0..height).step_by(rows as usize) {
            let end = (first + rows).min(height);
            let mut frame = self.frame();
            aov(&mut frame, self.library(), &self.targets.gbuffer, &pixels, [first, end])?;
            frame.finish()?;
            let bytes = (row_bytes * u64::from(end - first)) as usize;
            all.extend(pixels.read(|words| bytemuck::pod_collect_to_vec::<u8, AovPixel>(&words[..bytes])));
        }
        Ok((all, view))
    }

    /// PNG bytes of a picture.
    ///
    /// # Errors
    /// When encoding fails.
    pub fn png(&self, rendered: &Rendered) -> Result<Vec<u8>> {
        let [width, height] = self.settings.size;
        png::encode_png(width, height, &rendered.display, rendered.has_alpha)
    }
}

/// Denoises a film that was rendered elsewhere, the mean of the two `halves`: means of as many even and odd samples.
/// Bit for bit what a renderer makes of them.
///
/// # Errors
/// When the driver fails.
pub fn denoised(device: &Arc<Device>, film: &Picture, halves: &[Picture; 2]) -> Result<Picture> {
    let size = [film.width, film.height];
    let usage = vk::ImageUsageFlags::STORAGE;
    let desc = ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, size[0], size[1], usage);
    let image = Image::new(device, "film", desc)?;
    let target = Buffer::new(device, "film read back", size_of_val(&film.rgba[..]) as u64, Place::Readback)?;
    let staged = |picture: &Picture| Buffer::with_data(device, "staging", &picture.rgba);
    let sources = [staged(&halves[0])?, staged(&halves[1])?, staged(film)?];
    let sums = [Sum::new(device, "even samples", size, 1, 0)?, Sum::new(device, "odd samples", size, 1, 0)?];
    let with = Denoising::new(device, size)?;
    let mut frame = Frame::new(device);
    for (source, image) in sources.iter().zip([&sums[0].total, &sums[1].total, &image]) {
        frame.upload("upload samples", source, image, 0, &[0]);
    }
    denoise(&mut frame, &with, (&sums, &[1, 1], 1), &image)?;
    frame.download("read film", &image, &target);
    frame.read_back(&target);
    frame.finish()?;
    let rgba = target.read(|all| bytemuck::pod_collect_to_vec::<u8, [f32; 4]>(&all[..size_of_val(&film.rgba[..])]));
    Ok(Picture { rgba, ..film.clone() })
}

/// Tone maps a film that was rendered elsewhere, with these settings: RGBA8 (sRGB-encoded, rows from the top), whether
/// it has transparency, and the counts of NaN, infinite and negative pixels. `spectral` marks a film of spectral
/// rendering.
///
/// # Errors
/// When the driver fails.
pub fn shown(
    device: &Arc<Device>,
    film: &Picture,
    settings: &Settings,
    spectral: bool,
) -> Result<(Vec<u8>, bool, Counts)> {
    let size = [film.width, film.height];
    let desc = ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, size[0], size[1], vk::ImageUsageFlags::STORAGE);
    let image = Image::new(device, "film", desc)?;
    let source = Buffer::with_data(device, "staging", &film.rgba)?;
    let display = Display::new(device, size)?;
    let mut frame = Frame::new(device);
    frame.upload("upload film", &source, &image, 0, &[0]);
    let (background, has_alpha) = display_background(settings);
    let Settings { tonemap: curve, exposure, .. } = *settings;
    tonemap(&mut frame, (&image, 1.0), &display, curve as u32, exposure, background, spectral)?;
    frame.finish()?;
    Ok((display.pixels.read(<[u8]>::to_vec), has_alpha, display.counts()?))
}
