//! `etalon eval`: one equation at one point, in three tiers on the device, beside its f64 twin and its bound.

use std::process::ExitCode;

use anyhow::Result;
use clap::Args;
use comfy_table::{Table, presets};
use serde_json::json;

use super::options::DeviceOptions;
use super::setup::validated;
use super::{print, usage};
use etalon::gpu::Device;
use etalon::optics::{Case, Tier, ulp};
use etalon_verify::{Cases, Entry, absolute_error, arguments, evaluate, find};

/// Evaluate one shader function at one point: three tiers on the device, the f64 twin, the error in ulps, the bound
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
    etalon eval critical_angle n_in=10 n_out=1
    etalon eval fresnel_dielectric cos_in=0.2 n=1.5 --json")]
pub struct EvalArgs {
    /// The function; `etalon verify --list` names them
    function: String,
    /// Its inputs, NAME=VALUE; a vector is an angle in degrees from +Z (L=30) or three numbers (L=0,3,4)
    #[arg(value_name = "NAME=VALUE")]
    inputs: Vec<String>,
    /// Which device, and whether it is validated
    #[command(flatten)]
    device: DeviceOptions,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

impl EvalArgs {
    /// The function and its inputs.
    fn point(&self) -> Result<(Entry, Vec<f64>)> {
        let entry = find(&self.function)?;
        let values = arguments::parse(&self.inputs)?;
        let mut used = Vec::new();
        let row = arguments::row(&entry, &values, &mut used)?;
        arguments::all_used(&values, &used, &[entry])?;
        Ok((entry, row))
    }
}

/// Whether an error is beyond its bound; one that is no number is. Outside its domain an equation has no bound: NaN.
fn is_beyond(error: f64, allowed: f64) -> bool {
    !allowed.is_nan() && (error.is_nan() || error > allowed)
}

/// Runs the command.
///
/// # Errors
/// One sentence: an unknown function, an input that is missing, unknown or no number, a device that fails.
pub fn run(args: &EvalArgs) -> Result<ExitCode> {
    let (entry, row) = usage(args.point())?;
    let cases = Cases::from_rows(&entry, std::slice::from_ref(&row));
    let device = Device::open(&args.device.choice(), args.device.validate)?;
    let mut tiers = Vec::new();
    for tier in Tier::ALL {
        tiers.push((tier, evaluate(&device, entry.probe, tier, &row, 1)?.outputs));
    }
    validated(&device)?;
    let outputs = entry.equation.outputs;
    let allowed = |tier: Tier, column: usize| {
        (outputs[column].allowed)(&Case { tier, inputs: &row, exact: &cases.exact, column })
    };
    if args.json {
        let rows = outputs.iter().enumerate().map(|(i, output)| {
            let of = |tier: usize| tiers[tier].1[i];
            json!({
                "output": output.name, "fast": of(0), "stable": of(1), "compensated": of(2), "twin": cases.exact[i],
                "bound": output.bound, "allowed": [allowed(Tier::Stable, i), allowed(Tier::Compensated, i)],
            })
        });
        let inputs: serde_json::Map<_, _> =
            entry.probe.inputs.iter().zip(&row).map(|(name, value)| ((*name).to_owned(), json!(value))).collect();
        let document = json!({
            "schema": "etalon.eval/1", "function": entry.probe.name, "formula": entry.probe.formula,
            "device": device.info(), "inputs": inputs, "outputs": rows.collect::<Vec<_>>(),
        });
        print(&serde_json::to_string_pretty(&document)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    print(&format!("{}: {}", entry.probe.ids.join(" "), entry.probe.formula))?;
    let inputs: Vec<String> =
        entry.probe.inputs.iter().zip(&row).map(|(name, value)| format!("{name} = {}", *value as f32)).collect();
    print(&format!("{}({})", entry.probe.name, inputs.join(", ")))?;
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(["output", "fast", "stable", "compensated", "twin (f64)", "bound"]);
    for (i, output) in outputs.iter().enumerate() {
        let exact = cases.exact[i];
        let shown = |(tier, values): &(Tier, Vec<f32>)| {
            let value = values[i];
            let error = absolute_error(value, exact);
            let broken = *tier != Tier::Fast && exact.is_finite() && is_beyond(error, allowed(*tier, i));
            let ulps = match error / ulp(exact) {
                ulps if !exact.is_finite() || !ulps.is_finite() => String::new(),
                ulps if ulps >= 1e4 => format!(" ({ulps:.0e} ulp)"),
                ulps => format!(" ({ulps:.1} ulp)"),
            };
            format!("{value}{ulps}{}", if broken { ", beyond its bound" } else { "" })
        };
        let mut cells = vec![output.name.to_owned()];
        cells.extend(tiers.iter().map(shown));
        cells.push(if exact.is_nan() { "no meaning here".to_owned() } else { format!("{exact}") });
        cells.push(output.bound.to_owned());
        table.add_row(cells);
    }
    print(&table.to_string())?;
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_number_is_beyond_every_bound() {
        assert!(is_beyond(f64::NAN, f64::INFINITY) && is_beyond(2.0, 1.0) && is_beyond(f64::INFINITY, 1.0));
        assert!(!is_beyond(1.0, 1.0) && !is_beyond(f64::NAN, f64::NAN));
        // A result that underflows is no error, as in `verify`.
        assert!(!is_beyond(absolute_error(0.0, 1e-40), 1e-45) && is_beyond(absolute_error(0.0, 1e-30), 1e-45));
    }
}
