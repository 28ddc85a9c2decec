//! Speed of a device: loads of each kind, copies, atomic additions, submissions, rays, and the longest dispatch.
//!
//! Times are the device's, or the host's where the device has no timestamps or is slow by them.

use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;
use ash::vk;
use etalon::frame::Settings;
use etalon::gpu::{Buffer, Device, Frame, Image, ImageDesc, Place, Sampled, SamplerDesc};
use etalon::open::Opened;
use etalon::plan::{Knobs, Model};
use etalon::upload::rays::Traversal;
use serde::{Deserialize, Serialize};

use crate::json::short;
use crate::shader::{load, spin};

/// Loads of one invocation.
const LOADS: u32 = 16;
/// Columns of the image that is loaded from.
const COLUMNS: u32 = 4096;
/// Bytes of a row of it, four floats a pixel.
pub(crate) const BYTES_OF_A_ROW: u64 = 16 * COLUMNS as u64;
/// Submissions that are timed.
const SUBMISSIONS: usize = 100;
/// Milliseconds beside which a submission's own time is short.
const LONG_MS: f64 = 10.0;

/// Rays per second of a traversal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RaySpeed {
    /// The traversal.
    pub traversal: String,
    /// Scene.
    pub scene: String,
    /// Millions of rays per second of the passes' time: rays of paths and shadow rays, with shading.
    pub millions_per_second: f64,
}

/// Speeds of a device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Speed {
    /// Bytes that are copied or loaded.
    pub bytes: u64,
    /// 10^9 bytes per second of copies from buffer to buffer, read and written counted once.
    pub copy: f64,
    /// The same of loads of vectors from a storage buffer.
    pub storage_buffer: f64,
    /// From a storage texel buffer; `None` where tables lie in storage buffers.
    pub texel_buffer: Option<f64>,
    /// From a sampled image.
    pub sampled_image: f64,
    /// Millions of atomic additions per second to 256 counters.
    pub atomics: f64,
    /// Median microseconds of a submission that fills 16 bytes, until the host knows of its end.
    pub submission_us: f64,
    /// Rays of paths, by traversal.
    pub rays: Vec<RaySpeed>,
    /// Milliseconds of the longest dispatch that was tried; each was twice as long as the one before.
    pub longest_dispatch_ms: f64,
    /// Whether the device was lost by a longer one.
    pub lost: bool,
}

/// Milliseconds of the quickest of three runs of a pass.
fn quickest(run: impl Fn() -> Result<f64>) -> Result<f64> {
    let times = [run()?, run()?, run()?];
    Ok(times.into_iter().fold(f64::INFINITY, f64::min).max(1e-6))
}

/// 10^9 bytes per second.
fn rate(bytes: u64, ms: f64) -> f64 {
    short(bytes as f64 * 1e-6 / ms)
}

/// Milliseconds by the device's clock, or by the host's where the device has no clock or one that is too slow.
fn believed(device_ms: f64, host_ms: f64) -> f64 {
    let is_slow = host_ms > LONG_MS && device_ms < 0.5 * host_ms;
    if device_ms == 0.0 || is_slow { host_ms } else { device_ms }
}

/// Milliseconds since an instant.
fn ms_since(begun: Instant) -> f64 {
    begun.elapsed().as_secs_f64() * 1e3
}

/// Milliseconds of a frame's passes.
fn finished(frame: Frame<'_>) -> Result<f64> {
    let begun = Instant::now();
    let ms: f64 = frame.finish()?.iter().map(|pass| pass.ms).sum();
    Ok(believed(ms, ms_since(begun)))
}

/// Milliseconds of a frame with one pass.
fn timed<'a>(device: &Arc<Device>, record: impl Fn(&mut Frame<'a>) -> Result<()>) -> Result<f64> {
    quickest(|| {
        let mut frame = Frame::new(device);
        record(&mut frame)?;
        finished(frame)
    })
}

/// Loads of all kinds.
struct Loads {
    vectors: Buffer,
    picture: Image,
    nothing: Buffer,
    no_texels: Buffer,
    no_picture: Image,
    sums: Buffer,
    counters: Buffer,
    invocations: u32,
    texels: bool,
}

impl Loads {
    fn new(device: &Arc<Device>, bytes: u64) -> Result<Self> {
        let (format, texels) = (vk::Format::R32G32B32A32_SFLOAT, device.offers().texel_buffers);
        let vectors = match texels {
            true => Buffer::texels(device, "vectors", bytes, Place::Device, format)?,
            false => Buffer::new(device, "vectors", bytes, Place::Device)?,
        };
        let invocations = (bytes / 16) as u32 / LOADS;
        let rows = (bytes / 16) as u32 / COLUMNS;
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
        let picture = Image::new(device, "vectors of an image", ImageDesc::flat(format, COLUMNS, rows, usage))?;
        let new = Self {
            vectors,
            picture,
            nothing: Buffer::new(device, "nothing", 0, Place::Device)?,
            no_texels: Buffer::texels(device, "no texels", 0, Place::Device, format)?,
            no_picture: Image::nothing(device, format, vk::ImageUsageFlags::SAMPLED)?,
            sums: Buffer::new(device, "sums", 4 * u64::from(invocations), Place::Device)?,
            counters: Buffer::new(device, "counters", 4 * 256, Place::Device)?,
            invocations,
            texels,
        };
        let mut frame = Frame::new(device);
        frame.fill("zeros", &new.vectors, 0);
        frame.fill("zero", &new.counters, 0);
        frame.clear("black", &new.picture);
        frame.finish()?;
        Ok(new)
    }

    fn ms(&self, device: &Arc<Device>, kind: u32) -> Result<f64> {
        let is = |wanted: u32| kind == wanted;
        let bind = load::Bind {
            vectors: if is(0) { &self.vectors } else { &self.nothing },
            texels: if is(1) { &self.vectors } else { &self.no_texels },
            picture: Sampled {
                image: if is(2) { &self.picture } else { &self.no_picture },
                sampler: SamplerDesc::LINEAR,
            },
            sums: &self.sums,
            counters: if is(3) { &self.counters } else { &self.nothing },
        };
        let push = load::Push { stride: self.invocations, loads: LOADS };
        let groups = [self.invocations / 64, 1, 1];
        timed(device, |frame| frame.compute("loads", &bind, &load::Constants { kind }, &push, groups))
    }
}

fn rays(device: &Arc<Device>, scene: &str, size: [u32; 2]) -> Result<Vec<RaySpeed>> {
    let opened = Opened::load(scene)?;
    let camera = opened.camera(size)?;
    let mut knobs = Knobs::of(Model::Global);
    knobs.set("samples=4")?;
    let each = |traversal: Traversal| {
        let settings = Settings { size, knobs: knobs.clone(), traversal: Some(traversal), ..Settings::default() };
        let mut renderer = opened.clone().renderer(device, settings)?;
        renderer.render(&camera, &mut |_| ())?;
        let begun = Instant::now();
        let rendered = renderer.render(&camera, &mut |_| ())?;
        let host_ms = ms_since(begun);
        // The host reads films to estimate errors: its clock counts only where there is no other.
        let ms = Some(rendered.passes.iter().map(|pass| pass.ms).sum()).filter(|ms| *ms > 0.0).unwrap_or(host_ms);
        let count = rendered.work.indirect + rendered.work.shadow;
        let millions_per_second = short(count as f64 * 1e-3 / ms.max(1e-6));
        Ok(RaySpeed {
            traversal: format!("{traversal:?}").to_lowercase(),
            scene: scene.to_owned(),
            millions_per_second,
        })
    };
    [Traversal::Links16, Traversal::Links32, Traversal::Stack].into_iter().map(each).collect()
}

/// Dispatches of doubling length, until one takes as long as `most` milliseconds. Returns the longest, and whether a
/// longer one lost the device.
fn longest(device: &Arc<Device>, most: f64) -> Result<(f64, bool)> {
    let values = Buffer::new(device, "values", 4 << 16, Place::Device)?;
    // A row of workgroups, and then more rows: every device has 65,535 of each.
    let (mut groups, mut longest) = ([64, 1, 1], 0.0);
    let run = |groups: [u32; 3]| {
        let mut frame = Frame::new(device);
        frame.compute("long", &spin::Bind { values: &values }, &spin::Constants {}, &(), groups)?;
        finished(frame)
    };
    // The first run compiles, which the host's clock counts.
    run(groups)?;
    while longest < most && groups[1] <= 1 << 15 {
        match run(groups) {
            Ok(ms) => longest = ms,
            Err(error) if etalon::gpu::is_lost(&error) => return Ok((short(longest), true)),
            Err(error) => return Err(error),
        }
        groups[usize::from(groups[0] == 1 << 15)] *= 2;
    }
    Ok((short(longest), false))
}

/// Measures a device with so many bytes, rays of a scene at a size, and dispatches until one takes `most_ms`.
///
/// # Errors
/// When the device fails, but not when a long dispatch loses it.
pub fn measure(device: &Arc<Device>, bytes: u64, scene: &str, size: [u32; 2], most_ms: f64) -> Result<Speed> {
    let loads = Loads::new(device, bytes)?;
    let to = Buffer::new(device, "copy", bytes, Place::Device)?;
    let copy = timed(device, |frame| {
        frame.copy_buffer("copy", &loads.vectors, &to, bytes);
        Ok(())
    })?;
    let few_bytes = Buffer::new(device, "few bytes", 16, Place::Device)?;
    let mut submissions = (0..SUBMISSIONS)
        .map(|_| {
            let begun = Instant::now();
            let mut frame = Frame::new(device);
            frame.fill("few bytes", &few_bytes, 0);
            frame.finish()?;
            Ok(begun.elapsed().as_secs_f64() * 1e6)
        })
        .collect::<Result<Vec<f64>>>()?;
    submissions.sort_by(f64::total_cmp);
    let additions = f64::from(loads.invocations) * f64::from(LOADS);
    let mut speed = Speed {
        bytes,
        copy: rate(bytes, copy),
        storage_buffer: rate(bytes, loads.ms(device, 0)?),
        texel_buffer: if loads.texels { Some(rate(bytes, loads.ms(device, 1)?)) } else { None },
        sampled_image: rate(bytes, loads.ms(device, 2)?),
        atomics: short(additions * 1e-3 / loads.ms(device, 3)?),
        submission_us: short(submissions[SUBMISSIONS / 2]),
        rays: rays(device, scene, size)?,
        longest_dispatch_ms: 0.0,
        lost: false,
    };
    // Last: nothing can be measured on a lost device.
    (speed.longest_dispatch_ms, speed.lost) = longest(device, most_ms)?;
    Ok(speed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_stands_still_or_is_slow_is_not_believed() {
        // No timestamps; a clock at a tenth of the speed.
        assert_eq!([believed(0.0, 0.2), believed(50.0, 500.0)], [0.2, 500.0]);
        // A submission takes time of its own.
        assert_eq!([believed(0.02, 0.2), believed(480.0, 500.0)], [0.02, 480.0]);
    }
}
