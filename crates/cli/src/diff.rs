//! `etalon diff A B`: compares two pictures by FLIP or another image metric.

use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use clap::Args;
use serde::Serialize;

use super::choices::one_of;
use etalon::image::metric::{AnyPicture, Comparison, Metric, compare, map_rgba};
use etalon::image::{file, png};

/// Compare two pictures of the same size: two OpenEXR files by radiance, or two PNG, JPEG or WebP files by display
/// values
#[derive(Debug, Clone, Args)]
pub struct DiffArgs {
    /// Reference picture
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
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    pub max: Option<f64>,
    /// Write the error of each pixel as PNG: FLIP in magma colours, other metrics as absolute difference in grey (white
    /// is 1)
    #[arg(short, long, value_name = "FILE.png")]
    pub output: Option<PathBuf>,
    /// Print one JSON document instead of the number
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

/// Runs the command: the result goes to stdout, notes go to stderr. The exit code is 0 within the limit or without one,
/// else 1.
pub fn run(args: &DiffArgs) -> Result<ExitCode> {
    let (a, b) = (args.a.display().to_string(), args.b.display().to_string());
    ensure!(!args.max.is_some_and(f64::is_nan), "--max NaN: expected a number");
    if let Some(output) = &args.output {
        let png = output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
        ensure!(png, "--output {}: the error map can only be written as .png", output.display());
        file::check_writable(output)?;
    }
    let (first, second) = (AnyPicture::load(&args.a)?, AnyPicture::load(&args.b)?);
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
    let line = if args.json { document(args, &a, &b, &found, pass)? } else { found.value.to_string() };
    let mut out = io::stdout().lock();
    let written = writeln!(out, "{line}").and_then(|()| out.flush());
    if let Err(error) = written
        // A closed pipe is no failure of the comparison.
        && error.kind() != io::ErrorKind::BrokenPipe
    {
        return Err(error).context("writing the result to stdout");
    }
    if let Some(max) = args.max
        && !args.metric.within(found.value, max)
    {
        let side = if args.metric.grows_with_likeness() { "below" } else { "above" };
        note(&format!("{b} differs from {a}: {} {} is {side} {max}", args.metric.name(), found.value));
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
