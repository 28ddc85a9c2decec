//! Study scenes on a device: a hash and a small picture of each, times, and whether the ways to draw one picture agree.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context as _, Result};
use etalon::frame::{Rendered, Settings};
use etalon::gpu::{Device, DeviceChoice, Program};
use etalon::image::{Picture, file};
use etalon::open::Opened;
use etalon::plan::{Architecture, Knobs, Model};
use etalon::shader::PROGRAMS;
use etalon::upload::rays::Traversal;
use serde::{Deserialize, Serialize};

use crate::json::short;

/// Columns and rows of the small pictures.
const SMALL: [u32; 2] = [8, 4];

/// One scene in one model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DrawnScene {
    /// `study:NAME`.
    pub scene: String,
    /// `local`, `recursive` or `global`.
    pub model: String,
    /// Hash of the radiance of all pixels: equal bits have equal hashes.
    pub hash: String,
    /// Mean radiance of each of 8 times 4 parts of the picture, row by row, with four digits.
    pub small: Vec<[f32; 3]>,
    /// Pixels that are NaN or infinite, and what paths brought that was and was dropped.
    pub not_finite: u64,
    /// Milliseconds of the first picture, with compilation.
    pub first_ms: f64,
    /// Milliseconds of the second one, on the clock.
    pub second_ms: f64,
    /// Milliseconds of each pass of the second picture, on the device.
    pub passes: BTreeMap<String, f64>,
}

/// One way to draw a picture beside the usual one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SamePicture {
    /// What was different.
    pub way: String,
    /// Whether it has the same bits.
    pub same: bool,
    /// Largest difference of a channel, relative to the brightest one.
    pub largest: f64,
}

/// Pictures of a device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pictures {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Every scene in every model.
    pub scenes: Vec<DrawnScene>,
    /// Scenes that were not drawn, with the cause.
    pub refused: Vec<String>,
    /// Other ways to draw a picture.
    pub ways: Vec<SamePicture>,
    /// What the driver's compiler made of each stage of the renderer's programs: the largest of each of its figures
    /// over all pictures, by the driver's names. Empty where the driver tells nothing.
    #[serde(default)]
    pub compiled: BTreeMap<String, BTreeMap<String, f64>>,
}

/// A film with its facts, and the milliseconds of a first and a second drawing.
struct Shot {
    film: Picture,
    rendered: Rendered,
    ms: [f64; 2],
}

fn settings(model: Model, size: [u32; 2]) -> Result<Settings> {
    let mut knobs = Knobs::of(model);
    // One sample of what has no grain, four of paths.
    knobs.set(if model == Model::Global { "samples=4" } else { "samples=1" })?;
    Ok(Settings { size, knobs, ..Settings::default() })
}

fn shot(device: &Arc<Device>, scene: &str, settings: Settings) -> Result<Shot> {
    let opened = Opened::load(scene)?;
    let camera = opened.camera(settings.size)?;
    let begun = Instant::now();
    let mut renderer = opened.renderer(device, settings)?;
    renderer.render(&camera, &mut |_| ())?;
    let first = begun.elapsed();
    let begun = Instant::now();
    let rendered = renderer.render(&camera, &mut |_| ())?;
    let ms = [first, begun.elapsed()].map(|time| short(time.as_secs_f64() * 1e3));
    Ok(Shot { film: renderer.film()?, rendered, ms })
}

fn hash(film: &Picture) -> String {
    file::hash(bytemuck::cast_slice(&film.rgba))
}

/// Means over the parts of a picture.
fn small(film: &Picture) -> Vec<[f32; 3]> {
    let mut sums = vec![([0.0_f64; 3], 0.0_f64); (SMALL[0] * SMALL[1]) as usize];
    for (i, pixel) in film.rgba.iter().enumerate() {
        let (x, y) = (i as u32 % film.width, i as u32 / film.width);
        let part = y * SMALL[1] / film.height * SMALL[0] + x * SMALL[0] / film.width;
        let (sum, count) = &mut sums[part as usize];
        for (sum, value) in sum.iter_mut().zip(pixel) {
            *sum += f64::from(*value);
        }
        *count += 1.0;
    }
    sums.into_iter().map(|(sum, count)| sum.map(|sum| short(sum / count.max(1.0)) as f32)).collect()
}

fn drawn(device: &Arc<Device>, scene: &str, model: Model, size: [u32; 2]) -> Result<DrawnScene> {
    let Shot { film, rendered, ms: [first_ms, second_ms] } = shot(device, scene, settings(model, size)?)?;
    let mut passes = BTreeMap::new();
    for pass in &rendered.passes {
        let ms = passes.entry(pass.name.clone()).or_insert(0.0);
        *ms = short(*ms + pass.ms);
    }
    Ok(DrawnScene {
        scene: scene.to_owned(),
        model: model.name().to_owned(),
        hash: hash(&film),
        small: small(&film),
        // Shaders drop what is not finite from paths before it reaches a pixel.
        not_finite: u64::from(rendered.counts.nan) + u64::from(rendered.counts.inf) + rendered.work.not_finite,
        first_ms,
        second_ms,
        passes,
    })
}

/// Draws a picture by paths in other ways.
fn ways(device: &Arc<Device>, choice: &DeviceChoice, scene: &str, size: [u32; 2]) -> Result<Vec<SamePicture>> {
    let usual = settings(Model::Global, size)?;
    let reference = shot(device, scene, usual.clone())?.film;
    let brightest = reference.rgba.iter().flat_map(|p| &p[..3]).fold(0.0_f32, |most, x| most.max(*x));
    let beside = |way: &str, film: &Picture| {
        let pairs = film.rgba.iter().zip(&reference.rgba);
        let largest = pairs.flat_map(|(a, b)| (0..4).map(move |c| f64::from((a[c] - b[c]).abs()))).fold(0.0, f64::max);
        let same = hash(film) == hash(&reference);
        SamePicture { way: way.to_owned(), same, largest: short(largest / f64::from(brightest).max(1e-30)) }
    };
    let mut found = vec![beside("drawn again", &shot(device, scene, usual.clone())?.film)];
    for architecture in [Architecture::Cpu, Architecture::Gpu] {
        let other = Settings { architecture: Some(architecture), ..usual.clone() };
        let way = format!("passes for {}", architecture.name());
        found.push(beside(&way, &shot(device, scene, other)?.film));
    }
    for traversal in [Traversal::Links16, Traversal::Links32, Traversal::Stack] {
        let other = Settings { traversal: Some(traversal), ..usual.clone() };
        found.push(beside(&format!("traversal {traversal:?}"), &shot(device, scene, other)?.film));
    }
    let sliced = Device::open_time_sliced(choice, false)?;
    found.push(beside("in short submissions", &shot(&sliced, scene, usual)?.film));
    Ok(found)
}

/// Draws scenes in all models at a size, on the device that `choice` opened; `progress` is called with the name of each
/// picture.
///
/// # Errors
/// When no picture can be drawn.
pub fn measure(
    device: &Arc<Device>,
    choice: &DeviceChoice,
    scenes: &[&str],
    size: [u32; 2],
    progress: &mut dyn FnMut(&str),
) -> Result<Pictures> {
    let mut pictures =
        Pictures { size, scenes: Vec::new(), refused: Vec::new(), ways: Vec::new(), compiled: BTreeMap::new() };
    for scene in scenes {
        for model in [Model::Local, Model::Recursive, Model::Global] {
            progress(&format!("{scene}, {}", model.name()));
            match drawn(device, scene, model, size) {
                Ok(drawn) => pictures.scenes.push(drawn),
                Err(error) if etalon::gpu::is_lost(&error) => return Err(error),
                Err(error) => pictures.refused.push(format!("{scene}, {}: {error:#}", model.name())),
            }
        }
    }
    let first = scenes.first().context("drawing pictures: no scene was asked for")?;
    progress("one picture in several ways");
    match ways(device, choice, first, size) {
        Ok(ways) => pictures.ways = ways,
        Err(error) if etalon::gpu::is_lost(&error) => return Err(error),
        Err(error) => pictures.refused.push(format!("{first} in several ways: {error:#}")),
    }
    // The device has the programs of other sections too.
    let of_renderer = |(program, _): &(&Program, Vec<(u32, u32)>)| PROGRAMS.contains(program);
    for (program, constants) in device.pipelines().into_iter().filter(of_renderer) {
        for compiled in device.compiled(program, &constants)? {
            let known = pictures.compiled.entry(format!("{} {}", program.name, compiled.stage)).or_default();
            keep_largest(known, &compiled.figures);
        }
    }
    Ok(pictures)
}

fn keep_largest(known: &mut BTreeMap<String, f64>, figures: &BTreeMap<String, f64>) {
    for (name, &figure) in figures {
        let largest = known.entry(name.clone()).or_insert(figure);
        *largest = largest.max(figure);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_figures_of_a_program_are_kept() {
        let of = |figures: &[(&str, f64)]| figures.iter().map(|&(name, x)| (name.to_owned(), x)).collect();
        let mut known = of(&[("VGPRs", 40.0), ("Code size", 900.0)]);
        keep_largest(&mut known, &of(&[("VGPRs", 64.0), ("Code size", 800.0), ("Spilled VGPRs", 0.0)]));
        assert_eq!(known, of(&[("VGPRs", 64.0), ("Code size", 900.0), ("Spilled VGPRs", 0.0)]));
    }

    #[test]
    fn small_pictures_are_means() {
        let rgba = (0..16 * 8).map(|i| [if i % 16 < 2 { 1.0 } else { 0.25 }, i as f32, 0.0, 1.0]).collect();
        let found = small(&Picture { width: 16, height: 8, rgba });
        assert_eq!((found.len(), found[0][0], found[1][0]), (32, 1.0, 0.25));
        // Pixels 0, 1, 16 and 17.
        assert_eq!(found[0][1], 8.5);
    }
}
