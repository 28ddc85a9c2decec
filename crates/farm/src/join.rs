//! Joins the parts of a picture into the film that one process would draw, bit for bit.

use std::path::PathBuf;

use anyhow::{Result, bail, ensure};
use etalon::frame::{TileShare, Work};
use etalon::image::halves::{SampleError, error_of_halves};
use etalon::image::{Aov, AovData, Picture};
use etalon::plan::rungs::Denoise;

use crate::identity::Identity;
use crate::part::{Part, PartHeader, Split};
use crate::worker::FarmWorker;

/// A joined picture.
#[derive(Debug)]
pub struct Joined {
    /// Identity of the picture.
    pub identity: Identity,
    /// Mean of the samples, with coverage as alpha.
    pub film: Picture,
    /// Half buffers: means of the even and of the odd samples; only of path tracing.
    pub halves: Option<[Picture; 2]>,
    /// Whether the picture of one process would be denoised: the film is not yet ([`etalon::frame::denoised`]).
    pub denoise: bool,
    /// Error estimated from the half buffers.
    pub error: Option<SampleError>,
    /// Additional layers.
    pub aovs: Vec<Aov>,
    /// Samples per pixel.
    pub samples: u32,
    /// Bands of wavelengths per sample; 0 for RGB.
    pub bands: u32,
    /// Work counts of the rays.
    pub work: Work,
    /// Pixels whose list of transparent surfaces was truncated.
    pub dropped: u32,
    /// Processes that drew the parts, by part.
    pub workers: Vec<FarmWorker>,
}

/// Reads parts and joins them.
///
/// # Errors
/// When a file is not a part or is truncated, when parts belong to different pictures, or when a part is missing,
/// duplicate or incomplete.
pub fn join(paths: &[PathBuf]) -> Result<Joined> {
    let mut parts = Vec::with_capacity(paths.len());
    for path in paths {
        parts.push((path, Part::read(path)?));
    }
    let Some((first_path, first)) = parts.first() else { bail!("there are no parts to join") };
    let first_path = first_path.display();
    for (path, part) in &parts[1..] {
        let path = path.display();
        if let Err(why) = first.head.identity.same_as(&part.head.identity) {
            bail!("{first_path} and {path} are not parts of one picture: {why:#}");
        }
        let of =
            |head: &PartHeader| (head.shard[1], head.split, head.samples, head.bands, head.halves, head.parts.clone());
        let same = of(&first.head) == of(&part.head);
        ensure!(
            same,
            "{first_path} and {path} are parts of two different divisions of the picture: {} and {}",
            told(first),
            told(part)
        );
    }
    let count = first.head.shard[1];
    parts.sort_by_key(|(_, part)| part.head.shard[0]);
    for pair in parts.windows(2) {
        let [(a, part), (b, other)] = pair else { continue };
        let twice = part.head.shard[0] == other.head.shard[0];
        ensure!(!twice, "{} and {} are the same part, {}", a.display(), b.display(), told(part));
    }
    let missing: Vec<String> = (1..=count)
        .filter(|i| !parts.iter().any(|(_, part)| part.head.shard[0] == *i))
        .map(|i| i.to_string())
        .collect();
    ensure!(missing.is_empty(), "of {count} parts, these are missing: {}", missing.join(", "));
    for (path, part) in &parts {
        let (done, [from, end]) = (part.drawn_to(), part.head.wanted);
        ensure!(
            part.is_whole(),
            "{} is incomplete: it has {} of {} samples; run its command again to continue it",
            path.display(),
            done - from,
            end - from
        );
    }
    Ok(whole(parts.into_iter().map(|(_, part)| part).collect()))
}

fn told(part: &Part) -> String {
    let PartHeader { shard: [index, of], split, samples, .. } = part.head;
    let split = if split == Split::Tiles { "tiles" } else { "samples" };
    format!("{index} of {of} by {split} of {samples} samples")
}

/// Joins all parts of one picture, given in order.
fn whole(mut parts: Vec<Part>) -> Joined {
    let work = parts.iter().fold(Work::default(), |work, part| work.with(&part.head.work));
    let workers = parts.iter().map(|part| part.head.worker.clone()).collect();
    let dropped: Vec<u32> = parts.iter().map(|part| part.head.dropped).collect();
    let mut aovs = std::mem::take(&mut parts[0].aovs);
    let PartHeader { identity, shard: [_, of], split, samples, bands, halves, parts: names, .. } =
        parts[0].head.clone();
    // Parts by tiles have different pixels; parts by samples have the same pixels.
    let dropped =
        if split == Split::Tiles { dropped.iter().sum() } else { dropped.into_iter().max().unwrap_or_default() };
    let [width, _] = identity.size;
    let mut sums: Vec<Picture> = Vec::new();
    for (index, part) in (0..).zip(parts) {
        let share = TileShare { index, of };
        for piece in part.sums {
            if sums.is_empty() {
                sums = piece;
                continue;
            }
            for (sum, other) in sums.iter_mut().zip(piece) {
                for (at, (pixel, value)) in (0..).zip(sum.rgba.iter_mut().zip(other.rgba)) {
                    match split {
                        Split::Tiles if share.has([at % width, at / width], width) => *pixel = value,
                        Split::Tiles => {}
                        Split::Samples => pixel.iter_mut().zip(value).for_each(|(sum, value)| *sum += value),
                    }
                }
            }
        }
    }
    let scale = |picture: &Picture, scale: f32| Picture {
        rgba: picture.rgba.iter().map(|pixel| pixel.map(|value| value * scale)).collect(),
        ..picture.clone()
    };
    let mean = 1.0 / samples as f32;
    let beside = sums.split_off(halves);
    aovs.extend(names.into_iter().zip(&beside).map(|(name, sum)| Aov {
        name,
        channels: ["R", "G", "B"].map(str::to_owned).into(),
        samples: AovData::F32(sum.rgba.iter().flat_map(|&[r, g, b, _]| [r, g, b].map(|value| value * mean)).collect()),
    }));
    let counts = [samples.div_ceil(2), samples / 2];
    let both = (halves == 2).then(|| [0, 1].map(|half| scale(&sums[half], 1.0 / counts[half] as f32)));
    let error = (halves == 2).then(|| error_of_halves([&sums[0].rgba, &sums[1].rgba], counts));
    // The same arithmetic as shaders/pass/join.comp and accumulate.comp.
    let film = match &sums[..] {
        [a, b] => Picture {
            rgba: a.rgba.iter().zip(&b.rgba).map(|(a, b)| std::array::from_fn(|i| (a[i] + b[i]) * mean)).collect(),
            ..a.clone()
        },
        _ => scale(&sums[0], mean),
    };
    let frames = samples * bands.max(1);
    let work = work.of(identity.size, frames);
    let denoise = both.is_some() && identity.knobs.get("denoise").is_some_and(|rung| rung != Denoise::Off.name());
    Joined { identity, film, halves: both, denoise, error, aovs, samples, bands, work, dropped, workers }
}
