//! `etalon merge`: joins the parts of a picture that several processes drew. The result is bit-identical to the picture
//! of one process.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, Result, bail, ensure};
use clap::{Args, ValueEnum as _};
use serde::Serialize;

use super::options::DeviceOptions;
use super::picture::{AovName, Format, are_same, differs, format_of, layer_between};
use super::report::{WorkFacts, WrittenFile};
use super::setup::validated;
use super::shard::display_settings;
use super::{print, usage};
use etalon::frame::{denoised, shown};
use etalon::gpu::Device;
use etalon::image::halves::SampleError;
use etalon::image::{Aov, Statistics, exr, file, png};
use etalon_farm::identity::{Identity, device_name};
use etalon_farm::join::{Joined, join};
use etalon_farm::worker::FarmWorker;

/// Join the parts that `render --shard` wrote into the picture that one run draws, bit for bit
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
    etalon render study:pool --shard 1/2 -o 1.part
    etalon render study:pool --shard 2/2 -o 2.part
    etalon merge 1.part 2.part -o pool.png")]
pub struct MergeArgs {
    /// Parts in any order
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    /// Output file: .png (display) or .exr (scene-linear radiance); repeatable
    #[arg(short, long, value_name = "FILE", required = true)]
    output: Vec<PathBuf>,
    #[command(flatten)]
    device: DeviceOptions,
    /// Write a JSON report: error, work, workers
    #[arg(long, value_name = "FILE.json")]
    report: Option<PathBuf>,
}

/// The document of `--report`, schema `etalon.merge/1`.
#[derive(Debug, Serialize)]
struct MergeReport<'a> {
    schema: &'static str,
    identity: &'a Identity,
    samples: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<SampleError>,
    work: WorkFacts,
    image: Statistics,
    workers: &'a [FarmWorker],
    outputs: Vec<WrittenFile>,
}

impl MergeArgs {
    /// The outputs with their formats; no two are one file.
    fn outputs(&self) -> Result<Vec<(&Path, Format)>> {
        let mut outputs: Vec<(&Path, Format)> = Vec::new();
        for path in &self.output {
            let format = format_of(path)?;
            let is_part = self.parts.iter().any(|part| are_same(part, path));
            ensure!(!is_part, "--output {}: this file is one of the parts", path.display());
            let is_named = outputs.iter().any(|(other, _)| are_same(other, path));
            ensure!(!is_named, "--output {}: this file is named twice", path.display());
            outputs.push((path, format));
        }
        if let Some(report) = &self.report {
            let others = self.parts.iter().chain(&self.output);
            others.into_iter().try_for_each(|other| differs("--report", report, other))?;
        }
        Ok(outputs)
    }
}

/// Runs the command.
///
/// # Errors
/// One sentence with the part that is missing, duplicate, truncated or of another picture.
pub fn run(args: &MergeArgs) -> Result<ExitCode> {
    let outputs = usage(args.outputs())?;
    args.output.iter().chain(&args.report).try_for_each(|path| file::check_writable(path))?;
    let mut joined = join(&args.parts)?;
    let settings = display_settings(&joined.identity);
    let shows = outputs.iter().any(|(_, format)| *format == Format::Png);
    let display = match shows || joined.denoise {
        true => {
            let why =
                if joined.denoise { "joining parts that are denoised together" } else { "making a PNG of the parts" };
            let device = Device::open(&args.device.choice(), args.device.validate).context(why)?;
            let here = device_name(device.info());
            // The device evaluates the tone curve too, and denoises.
            let without = if joined.denoise { "" } else { "; -o FILE.exr needs no device" };
            ensure!(
                joined.identity.device == here,
                "the parts were drawn on \"{}\", but this device is \"{}\" and may round differently{without}",
                joined.identity.device.join(", "),
                here.join(", ")
            );
            if let Some(halves) = joined.halves.as_ref().filter(|_| joined.denoise) {
                joined.film = denoised(&device, &joined.film, halves)?;
            }
            let display = if shows { Some(shown(&device, &joined.film, &settings, joined.bands > 0)?) } else { None };
            validated(&device)?;
            display
        }
        false => None,
    };
    let mut film = joined.film.clone();
    settings.background.lay_behind(&mut film);
    let aovs = aovs(&joined)?;
    let mut written = Vec::new();
    for (path, format) in outputs {
        let [width, height] = joined.identity.size;
        let bytes = match (format, &display) {
            (Format::Png, Some((pixels, has_alpha, _))) => png::encode_png(width, height, pixels, *has_alpha)?,
            _ => exr::encode_exr(&film, &aovs, &metadata(&joined))?,
        };
        file::write(path, &bytes)?;
        written.push(WrittenFile { path: path.display().to_string(), hash: file::hash(&bytes) });
        print(&path.display().to_string())?;
    }
    if let Some(path) = &args.report {
        let account = MergeReport {
            schema: "etalon.merge/1",
            identity: &joined.identity,
            samples: joined.samples,
            error: joined.error,
            work: (&joined.work).into(),
            image: film.statistics(),
            workers: &joined.workers,
            outputs: written,
        };
        file::write(path, serde_json::to_string_pretty(&account)?.as_bytes())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Text attributes of the EXR, equal to those of one run.
fn metadata(joined: &Joined) -> Vec<(String, String)> {
    super::picture::made(&joined.identity.name, joined.bands)
}

/// The layers of `--aov`, in the order of the option.
fn aovs(joined: &Joined) -> Result<Vec<Aov>> {
    let asked = joined.identity.settings.get("aov").map_or("", String::as_str);
    let names = AovName::value_variants().iter().copied();
    // The parts store the option as `[Normal, HalfA]`.
    let words = asked.trim_matches(['[', ']']).split(", ").filter(|word| !word.is_empty());
    let mut all = Vec::new();
    for word in words {
        let Some(name) = names.clone().find(|name| format!("{name:?}") == word) else {
            bail!("the parts have an unknown layer {word}")
        };
        let title = name.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
        let known = joined.aovs.iter().find(|aov| aov.name == title).cloned();
        all.extend(match (&joined.halves, known) {
            (_, Some(known)) => Some(known),
            (Some(halves), None) if name.of_halves() => {
                let mut halves = halves.clone();
                let background = display_settings(&joined.identity).background;
                halves.iter_mut().for_each(|half| background.lay_behind(half));
                Some(layer_between(&halves, name))
            }
            _ => bail!("no part has the layer {title}"),
        });
    }
    Ok(all)
}
