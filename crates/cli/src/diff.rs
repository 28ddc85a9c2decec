//! `etalon diff A B`: compares two pictures by FLIP or another image metric.

use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Error, Result, ensure};
use clap::Args;
use serde::Serialize;
use strum::EnumMessage as _;

use super::choices::one_of;
use super::picture::{are_same, is_standard};
use super::{print, usage};
use etalon::image::metric::{AnyPicture, Comparison, Metric, compare, map_rgba};
use etalon::image::{file, png};

/// Compare two pictures of the same size: two OpenEXR files by radiance, or two PNG, JPEG or WebP files by display
/// values
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
    etalon diff golden.png picture.png
    etalon diff golden.png picture.png --metric psnr --max 30
    etalon diff golden.png - -o map.png < picture.png")]
pub struct DiffArgs {
    /// Reference picture; - for one of the two reads standard input
    #[arg(value_name = "A")]
    pub a: PathBuf,
    /// Picture to compare with the reference
    #[arg(value_name = "B")]
    pub b: PathBuf,
    /// Metric to print
    #[arg(long, value_parser = one_of::<Metric>(), default_value = Metric::Flip.name())]
    pub metric: Metric,
    /// Exit with code 1 if the value is above X; for psnr and ssim, which grow with similarity, if it is below X.
    /// Pictures with NaN or infinite pixels fail every limit
    #[arg(long, value_name = "X", value_parser = limit, allow_negative_numbers = true)]
    pub max: Option<f64>,
    /// Write the error of each pixel as PNG: FLIP in magma colours, other metrics as absolute difference in grey (white
    /// is 1)
    #[arg(short, long, value_name = "FILE.png")]
    pub output: Option<PathBuf>,
    /// Print one JSON document in place of the line
    #[arg(long)]
    pub json: bool,
}

/// The document of `--json`, schema `etalon.diff/1`.
#[derive(Debug, Serialize)]
struct DiffJson<'a> {
    schema: &'static str,
    metric: Metric,
    /// `null` where the value is infinite: psnr of equal pictures.
    value: Option<f64>,
    max: Option<f64>,
    pass: bool,
    /// Whether the value is positive infinity.
    infinite: bool,
    a: &'a str,
    b: &'a str,
    width: u32,
    height: u32,
    space: &'static str,
    non_finite: NonFinite,
    worst_pixel: WorstDifference,
}

#[derive(Debug, Serialize)]
struct NonFinite {
    a: u64,
    b: u64,
}

#[derive(Debug, Serialize)]
struct WorstDifference {
    x: u32,
    y: u32,
    error: f64,
}

/// A limit; it may be infinite.
fn limit(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| !x.is_nan()).ok_or_else(|| "expected a number".to_owned())
}

impl DiffArgs {
    /// Checks the paths before any is read.
    fn check(&self) -> Result<()> {
        ensure!(!is_standard(&self.a) || !is_standard(&self.b), "-: standard input is one picture; name the other one");
        if let Some(output) = &self.output {
            let png = output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
            ensure!(png, "--output {}: the error map can only be written as .png", output.display());
            let is_input = [&self.a, &self.b].into_iter().any(|input| are_same(input, output));
            ensure!(!is_input, "--output {}: this file is one of the two pictures", output.display());
        }
        Ok(())
    }
}

/// Reads a picture from a file or from standard input.
fn load(path: &Path) -> Result<AnyPicture> {
    if !is_standard(path) {
        return AnyPicture::load(path);
    }
    let mut bytes = Vec::new();
    let read = io::stdin().lock().read_to_end(&mut bytes).map_err(Error::from);
    read.and_then(|_| AnyPicture::decode(&bytes)).context("reading standard input")
}

/// Four significant digits of a value.
fn short(value: f64) -> String {
    let digits = 3 - value.abs().log10().floor().clamp(-300.0, 300.0) as i32;
    match digits {
        _ if value == 0.0 || !value.is_finite() => value.to_string(),
        0..=9 => format!("{value:.*}", digits as usize),
        -6..0 => format!("{value:.0}"),
        _ => format!("{value:.3e}"),
    }
}

/// Runs the command: the result goes to stdout, notes go to stderr. The exit code is 0 within the limit or without one,
/// else 1. `whole` prints all digits, the size and the worst pixel.
pub fn run(args: &DiffArgs, whole: bool) -> Result<ExitCode> {
    usage(args.check())?;
    let (a, b) = (args.a.display().to_string(), args.b.display().to_string());
    args.output.iter().try_for_each(|output| file::check_writable(output))?;
    let (first, second) = (load(&args.a)?, load(&args.b)?);
    let found = compare(args.metric, &first, &second).with_context(|| format!("comparing {a} with {b}"))?;
    let broken = found.non_finite != [0, 0];
    let pass = args.max.is_none_or(|max| args.metric.within(found.value, max) && !broken);

    if let Some(output) = &args.output {
        let bytes = png::encode_png(found.width, found.height, &map_rgba(&found), false)
            .with_context(|| format!("writing {}", output.display()))?;
        file::write(output, &bytes)?;
    }
    for (path, count) in [(&a, found.non_finite[0]), (&b, found.non_finite[1])] {
        if count > 0 {
            note(&format!("warning: {path}: {count} pixels with NaN or infinity are left out of the value"));
        }
    }
    let name = args.metric.name();
    let line = match (args.json, whole) {
        (true, _) => document(args, &a, &b, &found, pass)?,
        (false, false) => format!("{name} {}", short(found.value)),
        (false, true) => {
            let about = args.metric.get_documentation().unwrap_or_default();
            let Comparison { value, width, height, space, worst: [x, y], worst_error, .. } = &found;
            format!(
                "{name} {value}\n{about}\n{width}x{height} pixels, compared as {space}; the largest error, {}, is at {x},{y}",
                short(*worst_error)
            )
        }
    };
    print(&line)?;
    if let Some(max) = args.max
        && !pass
    {
        let side = if args.metric.grows_with_likeness() { "below" } else { "above" };
        note(&match args.metric.within(found.value, max) {
            true => format!("comparing {b} with {a} fails: pixels with NaN or infinity fail every limit"),
            false => format!("{b} differs from {a}: {name} {} is {side} {max}", short(found.value)),
        });
    }
    Ok(if pass { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn document(args: &DiffArgs, a: &str, b: &str, found: &Comparison, pass: bool) -> Result<String> {
    let document = DiffJson {
        schema: "etalon.diff/1",
        metric: args.metric,
        value: found.value.is_finite().then_some(found.value),
        max: args.max,
        pass,
        infinite: found.value == f64::INFINITY,
        a,
        b,
        width: found.width,
        height: found.height,
        space: found.space,
        non_finite: NonFinite { a: found.non_finite[0], b: found.non_finite[1] },
        worst_pixel: WorstDifference { x: found.worst[0], y: found.worst[1], error: found.worst_error },
    };
    Ok(serde_json::to_string(&document)?)
}

/// Prints a sentence to stderr; a write error is ignored.
fn note(sentence: &str) {
    let _ = writeln!(io::stderr().lock(), "{sentence}");
}
