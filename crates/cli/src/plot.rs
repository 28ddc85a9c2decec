//! `etalon plot`: a shader function over one of its inputs as SVG, beside another function.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, Result, ensure};
use clap::Args;

use super::choices::one_of;
use super::options::DeviceOptions;
use super::setup::validated;
use super::{print, usage};
use etalon::gpu::Device;
use etalon::image::file;
use etalon::optics::Tier;
use etalon_verify::curve::{Column, Over, Plot};
use etalon_verify::{Entry, arguments, find};

/// Draw a shader function over one of its inputs as SVG; with --against another function and the difference below
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
    etalon plot fresnel_dielectric --over cos_in=0..1 --against fresnel_schlick n=1.5 kappa=0 -o fresnel.svg")]
pub struct PlotArgs {
    /// The function; `etalon verify --list` names them
    function: String,
    /// The other inputs, NAME=VALUE; a vector is an angle in degrees from +Z (L=30) or three numbers (L=0,3,4)
    #[arg(value_name = "NAME=VALUE")]
    inputs: Vec<String>,
    /// The input along the axis: a number, the angle of a vector in degrees, or with --metal the wavelength in nm
    #[arg(long, value_name = "NAME=A..B")]
    over: String,
    /// A function that is drawn beside it, with the difference below; it gets the same inputs
    #[arg(long, value_name = "FUNCTION")]
    against: Option<String>,
    /// Compare with the same function after two vectors have changed places: Helmholtz reciprocity
    #[arg(long, value_name = "A,B", conflicts_with = "against")]
    swap: Option<String>,
    /// One curve for each of these values of an input
    #[arg(long, value_name = "NAME=V1,V2")]
    each: Option<String>,
    /// A curve with the measured n and kappa of gold, silver, copper or aluminium; repeatable
    #[arg(long, value_name = "NAME")]
    metal: Vec<String>,
    /// The output column that is drawn, or a ratio of two, such as Lref/cos_in
    #[arg(long, value_name = "COLUMN")]
    column: Option<String>,
    /// Form of the arithmetic
    #[arg(long, value_name = "TIER", value_parser = one_of::<Tier>(), default_value = "stable")]
    tier: Tier,
    /// Draw the error against the f64 twin in place of the value
    #[arg(long)]
    error: bool,
    /// Logarithmic axes
    #[arg(long)]
    log: bool,
    /// The picture; by default the function's name with .svg
    #[arg(short, long, value_name = "FILE.svg")]
    output: Option<PathBuf>,
    /// Which device, and whether it is validated
    #[command(flatten)]
    device: DeviceOptions,
}

/// The output that is drawn where none is named: the first that both functions have, else the last.
fn column(entry: &Entry, wanted: Option<&str>, other: Option<&Entry>) -> Result<Column> {
    let outputs = entry.probe.outputs;
    let place = |name: &str| {
        outputs
            .iter()
            .position(|output| *output == name)
            .with_context(|| format!("--column {name}: the outputs of {} are {}", entry.probe.name, outputs.join(", ")))
    };
    let of = match (wanted, other) {
        (Some(names), _) => {
            let (of, per) = names.split_once('/').map_or((names, None), |(of, per)| (of, Some(per)));
            return Ok(Column { of: place(of)?, per: per.map(place).transpose()? });
        }
        (None, Some(other)) => {
            outputs.iter().position(|output| other.probe.outputs.contains(output)).with_context(|| {
                format!("--against {}: it has no output that {} has", other.probe.name, entry.probe.name)
            })?
        }
        // A sum or a reflectance stands first for Fresnel's functions, and last for those that list their parts.
        (None, None) => outputs.iter().position(|output| *output == "F").unwrap_or(outputs.len() - 1),
    };
    Ok(Column { of, per: None })
}

fn over(text: &str) -> Result<Over> {
    let parts = text.split_once('=').and_then(|(name, range)| Some((name, range.split_once("..")?)));
    let parsed = parts.and_then(|(name, (a, b))| Some((name, [a.trim().parse().ok()?, b.trim().parse().ok()?])));
    let (name, range): (&str, [f64; 2]) =
        parsed.with_context(|| format!("--over {text}: expected NAME=A..B, for example cos_in=0..1"))?;
    ensure!(range[0] < range[1] && range.iter().all(|x| x.is_finite()), "--over {text}: A has to be below B");
    Ok(Over { name: name.to_owned(), range })
}

/// The plot that the options describe.
fn checked(args: &PlotArgs, output: &Path) -> Result<Plot> {
    let svg = output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("svg"));
    ensure!(svg, "{} cannot be written: a plot is an .svg file", output.display());
    let entry = find(&args.function)?;
    let against = args.against.as_deref().map(find).transpose()?;
    let of = column(&entry, args.column.as_deref(), against.as_ref())?;
    let against = match against {
        Some(other) => Some((other, column(&other, Some(&of.name(&entry)), None)?)),
        None => None,
    };
    let swap = match &args.swap {
        Some(text) => {
            let (a, b) =
                text.split_once(',').with_context(|| format!("--swap {text}: expected two vectors, as L,V"))?;
            for name in [a, b] {
                let known = arguments::names(&entry);
                ensure!(known.iter().any(|k| k == name), "--swap {text}: the inputs are {}", known.join(", "));
            }
            Some([a.to_owned(), b.to_owned()])
        }
        None => None,
    };
    let each = match &args.each {
        Some(text) => {
            let (name, values) = text.split_once('=').with_context(|| format!("--each {text}: expected NAME=V1,V2"))?;
            Some((name.to_owned(), values.split(',').map(|value| value.trim().to_owned()).collect()))
        }
        None => None,
    };
    let over = over(&args.over)?;
    ensure!(!args.log || over.range[0] > 0.0, "--log: the range of --over has to begin above 0");
    let plot = Plot {
        entry,
        column: of,
        over,
        values: arguments::parse(&args.inputs)?,
        each,
        metals: args.metal.clone(),
        against,
        swap,
        tier: args.tier,
        log: args.log,
        error: args.error,
    };
    plot.check_names()?;
    Ok(plot)
}

/// Runs the command.
///
/// # Errors
/// One sentence: an unknown function, column or input, a range that is none, a device that fails, a file that cannot be
/// written.
pub fn run(args: &PlotArgs) -> Result<ExitCode> {
    let output = args.output.clone().unwrap_or_else(|| format!("{}.svg", args.function).into());
    let plot = usage(checked(args, &output))?;
    file::check_writable(&output)?;
    let device = Device::open(&args.device.choice(), args.device.validate)?;
    let drawn = plot.draw(&device)?;
    validated(&device)?;
    file::write(&output, drawn.svg.as_bytes())?;
    for curve in &drawn.differences {
        let worst = curve.points.iter().copied().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        if let Some((x, y)) = worst {
            // The label names the first curve, a minus sign, and the second curve.
            let side = if y > 0.0 {
                " (the first is above the second)"
            } else if y < 0.0 {
                " (the first is below the second)"
            } else {
                ""
            };
            let (label, over) = (&curve.label, &plot.over.name);
            print(&format!("{label}: largest difference {:.4}{side} at {over} = {x:.4}", y.abs()))?;
        }
    }
    print(&output.display().to_string())?;
    Ok(ExitCode::SUCCESS)
}
