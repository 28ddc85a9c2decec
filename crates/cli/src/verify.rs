//! `etalon verify`: compares the shipped shader functions on a device with their f64 twins. The evaluation is in the
//! crate `etalon_verify`; docs/equations.md lists functions and bounds.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use anyhow::{Context as _, Result, anyhow};
use clap::Args;
use comfy_table::{Cell, CellAlignment, Table, presets};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::choices::one_of;
use super::options::{DeviceOptions, When};
use super::{heading, print, usage};
use etalon::gpu::{Device, DeviceInfo, Severity};
use etalon::image::file;
use etalon::optics::Tier;
use etalon::shader::Probe;
use etalon_verify::{self, Cases, Entry, Figures, Worst, document, plot, vectors};

/// Hostile cases (inputs outside the domain) per function and tier.
const HOSTILE: usize = 4096;

/// Compare every shader function on the device with its double-precision reference (f64 twin), in three tiers: `fast`
/// is the textbook form and has no bounds, `stable` is used for pictures, `compensated` is the most accurate
///
/// It prints the bounds that do not hold and a verdict, with -v the errors of every output.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
    etalon verify --cases 1000
    etalon verify -v --function refract
    etalon verify --list")]
pub struct VerifyArgs {
    /// Only this function; repeatable. With --vectors: the function of the file [default: the stem of the file name]
    #[arg(long, value_name = "NAME")]
    pub function: Vec<String>,
    /// Only this tier; repeatable
    #[arg(long, value_name = "TIER", value_parser = one_of::<Tier>())]
    pub tier: Vec<Tier>,
    /// Inputs per function
    #[arg(long, value_name = "N", default_value_t = 100_000, value_parser = clap::value_parser!(u32).range(1..=50_000_000))]
    pub cases: u32,
    /// Random seed of the inputs; the same seed gives the same inputs on every machine
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Read inputs and expected outputs from a CSV file: columns by name, expected outputs with a leading `=`
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = ["cases", "seed", "output"])]
    pub vectors: Option<PathBuf>,
    /// List every function with its inputs and outputs
    #[arg(long, conflicts_with_all = ["vectors", "output", "cases", "seed", "tier", "device", "validate", "progress"])]
    pub list: bool,
    /// Write an SVG plot of the error over its domain into this folder, one per function
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Device and validation
    #[command(flatten)]
    pub device: DeviceOptions,
    /// Print one JSON document
    #[arg(long)]
    pub json: bool,
    /// Progress on standard error
    #[arg(long, value_enum, default_value_t = When::Auto, help_heading = heading::MESSAGES)]
    pub progress: When,
}

#[derive(Serialize)]
struct VerifyJson<'a> {
    schema: &'static str,
    device: &'a DeviceInfo,
    seed: Option<u64>,
    vectors: Option<String>,
    /// Cases that are not judged, because the device flushes denormal numbers.
    #[serde(skip_serializing_if = "is_zero")]
    tiny: usize,
    outputs: Vec<Value>,
    hostile: Vec<Value>,
    pass: bool,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// The errors of a function in a tier.
struct Finding {
    entry: Entry,
    tier: Tier,
    /// GPU milliseconds per million evaluations.
    per_million: f64,
    figures: Vec<Figures>,
    /// Number of hostile cases that returned NaN, and the inputs of the first; `None` where inputs come from a file.
    hostile: Option<(usize, Option<Vec<f64>>)>,
}

impl Finding {
    fn passes(&self) -> bool {
        let nan = self.hostile.as_ref().map_or(0, |(count, _)| *count);
        self.figures.iter().all(|figures| figures.pass) && (self.tier == Tier::Fast || nan == 0)
    }
}

/// Runs the command: exit 0 when every bound holds, 1 when one does not.
///
/// # Errors
/// For an unknown function, an unreadable vector file, a device that fails, or a folder that cannot be written.
pub fn run(args: &VerifyArgs, quiet: bool, whole: bool) -> Result<ExitCode> {
    let functions = usage(chosen(args))?;
    if args.list {
        return list(args, functions);
    }
    if args.vectors.is_some() {
        let count = args.function.len();
        usage(if count < 2 { Ok(()) } else { Err(anyhow!("--vectors takes one --function, but {count} were given")) })?;
    }
    let mut given = match &args.vectors {
        Some(path) => Some(vectors::load(path, args.function.first().map(String::as_str))?),
        None => None,
    };
    let entries = match &given {
        Some((entry, _)) => vec![*entry],
        None => functions,
    };
    // Each tier once, in a fixed order, however often it was named.
    let tiers: Vec<Tier> =
        Tier::ALL.into_iter().filter(|tier| args.tier.is_empty() || args.tier.contains(tier)).collect();
    let device = Device::open(&args.device.choice(), args.device.validate)?;

    if let Some(folder) = &args.output {
        std::fs::create_dir_all(folder).with_context(|| format!("creating {}", folder.display()))?;
    }
    let bar = progress(args, quiet, entries.len());
    let flushes = etalon_verify::flushes_denormals(&device)?;
    let (mut findings, mut tiny) = (Vec::new(), 0);
    for entry in entries {
        bar.set_message(entry.probe.name);
        let given = given.take().map(|(_, cases)| cases);
        let mut cases = given.unwrap_or_else(|| Cases::draw(&entry, args.cases as usize, args.seed));
        if flushes {
            tiny += cases.expect_nothing_of_tiny();
        }
        findings.extend(examine(args, &device, entry, &cases, &tiers)?);
        bar.inc(1);
    }
    bar.finish_and_clear();

    let mut pass = findings.iter().all(Finding::passes);
    for message in device.messages().iter().filter(|message| message.severity == Severity::Error) {
        tracing::error!("validation: {}", message.text);
        pass = false;
    }
    if args.json {
        let document = VerifyJson {
            schema: "etalon.verify/1",
            device: device.info(),
            seed: args.vectors.is_none().then_some(args.seed),
            vectors: args.vectors.as_ref().map(|path| path.display().to_string()),
            tiny,
            outputs: findings.iter().flat_map(json_rows).collect(),
            hostile: findings.iter().filter_map(json_hostile).collect(),
            pass,
        };
        print(&serde_json::to_string_pretty(&document)?)?;
    } else {
        let shown = |finding: &Finding, figures: &Figures| whole || (finding.tier != Tier::Fast && !figures.pass);
        if findings.iter().any(|finding| finding.figures.iter().any(|figures| shown(finding, figures))) {
            print(&table(&findings, shown).to_string())?;
        }
        for finding in findings.iter().filter(|finding| whole || !finding.passes()) {
            if let Some((count @ 1.., first)) = &finding.hostile {
                let inputs = first.as_deref().map_or(String::new(), |row| named(finding.entry.probe, row));
                let verdict = if finding.tier == Tier::Fast { "not promised" } else { "FAILS" };
                let (name, tier) = (finding.entry.probe.name, finding.tier.name());
                print(&format!(
                    "{name}, {tier}: NaN for {count} of {HOSTILE} inputs outside its domain ({verdict}): {inputs}"
                ))?;
            }
        }
        let info = device.info();
        let judged = findings.iter().filter(|f| f.tier != Tier::Fast).flat_map(|f| &f.figures).filter(|f| f.cases > 0);
        let (count, held) = judged.fold((0, 0), |(n, held), f| (n + 1, held + usize::from(f.pass)));
        print(&format!("{}, {}: {held} of {count} bounds hold", info.name, info.driver))?;
        if flushes {
            let least = etalon_verify::TINY;
            print(&format!(
                "the device flushes denormal numbers: {tiny} cases with numbers below {least:.0e} are not judged"
            ))?;
        }
        if count == 0 {
            print("the tier fast has no bounds: nothing was judged")?;
        }
    }
    Ok(if pass { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn progress(args: &VerifyArgs, quiet: bool, count: usize) -> ProgressBar {
    use std::io::IsTerminal as _;
    let wanted = match args.progress {
        When::Always => true,
        When::Never => false,
        When::Auto => std::io::stderr().is_terminal() && !quiet,
    };
    if !wanted {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}");
    ProgressBar::new(count as u64).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

fn examine(
    args: &VerifyArgs,
    device: &Arc<Device>,
    entry: Entry,
    cases: &Cases,
    tiers: &[Tier],
) -> Result<Vec<Finding>> {
    let mut findings = Vec::new();
    let mut outputs = Vec::new();
    for &tier in tiers {
        let evaluated = etalon_verify::evaluate(device, entry.probe, tier, &cases.inputs, cases.count)?;
        let figures = etalon_verify::judge(&entry, tier, cases, &evaluated.outputs);
        let hostile = match args.vectors {
            Some(_) => None,
            None => Some(etalon_verify::nan_of_hostile(device, &entry, tier, HOSTILE, args.seed)?),
        };
        let per_million = evaluated.ms * 1e6 / cases.count as f64;
        findings.push(Finding { entry, tier, per_million, figures, hostile });
        outputs.push((tier, evaluated.outputs));
    }
    if let Some(folder) = &args.output {
        let series: Vec<_> = outputs.iter().map(|(tier, values)| (*tier, values.as_slice())).collect();
        if let Some(svg) = plot::svg(&entry, cases, &series)? {
            file::write(&folder.join(format!("{}.svg", entry.probe.name)), svg.as_bytes())?;
        }
    }
    Ok(findings)
}

/// The functions of `--function`, each once, in the order of the catalogue; all functions without the option.
fn chosen(args: &VerifyArgs) -> Result<Vec<Entry>> {
    for name in &args.function {
        etalon_verify::find(name)?;
    }
    let named = |entry: &Entry| args.function.is_empty() || args.function.iter().any(|name| name == entry.probe.name);
    Ok(etalon_verify::catalogue().into_iter().filter(named).collect())
}

/// Prints every function with its inputs and outputs.
fn list(args: &VerifyArgs, entries: Vec<Entry>) -> Result<ExitCode> {
    if args.json {
        let functions: Vec<_> = entries
            .iter()
            .map(|entry| {
                let bounds = entry.equation.outputs.iter().map(|output| output.bound);
                json!({
                    "function": entry.probe.name,
                    "id": entry.probe.ids.join(" "),
                    "formula": entry.probe.formula,
                    "glsl": format!("shaders/lib/{}.glsl", entry.probe.subject),
                    "inputs": entry.probe.inputs,
                    "outputs": entry.probe.outputs,
                    "bounds": bounds.collect::<Vec<_>>(),
                    "builtins": {
                        "fast": entry.probe.builtins[0],
                        "stable": entry.probe.builtins[1],
                        "compensated": entry.probe.builtins[2],
                    },
                })
            })
            .collect();
        print(&serde_json::to_string_pretty(&json!({ "schema": "etalon.functions/1", "functions": functions }))?)?;
        return Ok(ExitCode::SUCCESS);
    }
    for entry in entries {
        let probe = entry.probe;
        print(&format!("{}: {} -> {}", probe.name, document::inputs(probe.inputs), probe.outputs.join(" ")))?;
        print(&format!("    {}: {}", probe.ids.join(" "), probe.formula))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The rows of the outputs that are `shown`.
fn table(findings: &[Finding], shown: impl Fn(&Finding, &Figures) -> bool) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header([
        "id",
        "function",
        "output",
        "tier",
        "cases",
        "max ulp",
        "max rel",
        "max abs",
        "NaN/Inf",
        "ms/M",
        "verdict",
        "bound",
        "worst input",
    ]);
    for index in 4..10 {
        if let Some(column) = table.column_mut(index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    for finding in findings {
        for (output, figures) in finding.entry.equation.outputs.iter().zip(&finding.figures) {
            if figures.cases == 0 || !shown(finding, figures) {
                continue;
            }
            let (verdict, bound) = match (finding.tier, figures.pass) {
                (Tier::Fast, _) => ("-", "none"),
                (_, true) => ("holds", output.bound),
                (_, false) => ("FAILS", output.bound),
            };
            let worst = figures.worst.as_ref().map_or(String::new(), |worst| named_worst(&finding.entry, worst));
            table.add_row([
                Cell::new(finding.entry.probe.ids.join(" ")),
                Cell::new(finding.entry.probe.name),
                Cell::new(output.name),
                Cell::new(finding.tier.name()),
                Cell::new(figures.cases),
                Cell::new(short(figures.max_ulp)),
                Cell::new(short(figures.max_rel)),
                Cell::new(short(figures.max_abs)),
                Cell::new(figures.non_finite),
                Cell::new(format!("{:.2}", finding.per_million)),
                Cell::new(verdict),
                Cell::new(bound),
                Cell::new(worst),
            ]);
        }
    }
    table
}

/// Formats a number with two or three significant digits.
fn short(x: f64) -> String {
    if x == 0.0 || (1e-2..1e5).contains(&x) { format!("{x:.2}") } else { format!("{x:.1e}") }
}

fn named_worst(entry: &Entry, worst: &Worst) -> String {
    let inputs = named(entry.probe, &worst.inputs);
    format!("row {}: {inputs}; got {:e}, exact {:e}", worst.row, worst.got, worst.expected)
}

/// The first 16 inputs by name, in decimal and in hex.
fn named(probe: &Probe, values: &[f64]) -> String {
    let shown = 16;
    let one = |(column, (name, &value)): (usize, (&&str, &f64))| {
        let word = probe.word(column, value);
        if probe.whole.contains(name) {
            format!("{name} {word}")
        } else {
            format!("{name} {:e} (0x{word:08x})", value as f32)
        }
    };
    let mut text = probe.inputs.iter().zip(values).enumerate().take(shown).map(one).collect::<Vec<_>>().join(", ");
    if probe.inputs.len() > shown {
        text += ", …";
    }
    text
}

/// Inputs as the 32-bit words that the device gets.
fn hex(probe: &Probe, values: &[f64]) -> Vec<String> {
    values.iter().enumerate().map(|(column, &value)| format!("0x{:08x}", probe.word(column, value))).collect()
}

fn json_rows(finding: &Finding) -> Vec<Value> {
    let entry = finding.entry;
    let row = |(output, figures): (&etalon::optics::Output, &Figures)| {
        let worst = figures.worst.as_ref().map(|worst| {
            let inputs: Map<_, _> = entry
                .probe
                .inputs
                .iter()
                .zip(&worst.inputs)
                .map(|(name, x)| ((*name).to_owned(), number(*x)))
                .collect();
            let hex = hex(entry.probe, &worst.inputs);
            json!({
                "row": worst.row,
                "inputs": inputs,
                "inputs_hex": hex,
                "got": number(f64::from(worst.got)),
                "expected": number(worst.expected),
                "of_bound": number(worst.excess),
            })
        });
        json!({
            "function": entry.probe.name,
            "id": entry.probe.ids.join(" "),
            "tier": finding.tier,
            "name": output.name,
            "cases": figures.cases,
            "max_ulp": number(figures.max_ulp),
            "max_rel": number(figures.max_rel),
            "max_abs": number(figures.max_abs),
            "non_finite": figures.non_finite,
            "bound": (finding.tier != Tier::Fast).then_some(output.bound),
            "pass": figures.pass,
            "ms_per_million": number(finding.per_million),
            "worst": worst,
        })
    };
    entry.equation.outputs.iter().zip(&finding.figures).filter(|(_, figures)| figures.cases > 0).map(row).collect()
}

fn json_hostile(finding: &Finding) -> Option<Value> {
    let (count, first) = finding.hostile.as_ref()?;
    let hex = first.as_ref().map(|row| hex(finding.entry.probe, row));
    Some(json!({
        "function": finding.entry.probe.name,
        "tier": finding.tier,
        "cases": HOSTILE,
        "nan": count,
        "first_hex": hex,
        "pass": finding.tier == Tier::Fast || *count == 0,
    }))
}

/// A number as JSON; infinities and NaN become strings, because JSON has none.
fn number(x: f64) -> Value {
    if x.is_finite() { json!(x) } else { json!(x.to_string()) }
}
