//! Plots of the error of an equation over an input such as angle, index or shininess, as SVG with one line per tier.

use anyhow::{Result, anyhow};
use plotters::prelude::*;

use super::{Cases, Entry, absolute_error};
use etalon::optics::Tier;

const SIZE: (u32, u32) = (760, 440);
const BINS: usize = 96;
/// Smaller errors are drawn at this value: an eighth of an ulp.
const FLOOR: f64 = 7.45e-9;
const CEILING: f64 = 1e3;

/// Largest error of the plotted column in each bin of the axis; `None` for bins without cases.
fn series(entry: &Entry, cases: &Cases, outputs: &[f32], range: (f64, f64)) -> Vec<Option<f64>> {
    let axis = entry.equation.axis;
    let width = entry.equation.outputs.len();
    let mut bins = vec![None; BINS];
    let (low, high) = range;
    for row in 0..cases.count {
        let at = (axis.of)(&cases.row(row));
        let exact = cases.exact[row * width + axis.column];
        if !at.is_finite() || !exact.is_finite() || (axis.relative && exact == 0.0) || (axis.log && at <= 0.0) {
            continue;
        }
        let part = if axis.log { (at / low).ln() / (high / low).ln() } else { (at - low) / (high - low) };
        let bin: &mut Option<f64> = &mut bins[((part * BINS as f64) as usize).min(BINS - 1)];
        let scale = if axis.relative { exact.abs() } else { 1.0 };
        let error = absolute_error(outputs[axis.column * cases.count + row], exact) / scale;
        let error = if error.is_finite() { error.clamp(FLOOR, CEILING) } else { CEILING };
        *bin = Some(bin.map_or(error, |known| known.max(error)));
    }
    bins
}

/// The plot; `None` where the axis has no extent in these cases.
///
/// # Errors
/// When drawing fails.
pub fn svg(entry: &Entry, cases: &Cases, tiers: &[(Tier, &[f32])]) -> Result<Option<String>> {
    let axis = entry.equation.axis;
    let values = (0..cases.count).map(|row| (axis.of)(&cases.row(row)));
    let values: Vec<f64> = values.filter(|x| x.is_finite() && (!axis.log || *x > 0.0)).collect();
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if low.partial_cmp(&high) != Some(std::cmp::Ordering::Less) {
        return Ok(None);
    }
    let drawn: Vec<_> =
        tiers.iter().map(|&(tier, outputs)| (tier, series(entry, cases, outputs, (low, high)))).collect();
    let mut text = String::new();
    let kind = if axis.relative { "relative" } else { "absolute" };
    let title = format!("{}: {kind} error of {}", entry.probe.name, entry.equation.outputs[axis.column].name);
    let failed = |error: &dyn std::fmt::Display| anyhow!("drawing the plot of {}: {error}", entry.probe.name);
    {
        let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        root.fill(&WHITE).map_err(|e| failed(&e))?;
        let mut builder = ChartBuilder::on(&root);
        builder.caption(title, ("sans-serif", 18)).margin(12).x_label_area_size(42).y_label_area_size(64);
        // Linear and logarithmic axes have different chart types.
        macro_rules! draw {
            ($x:expr) => {{
                let mut chart = builder.build_cartesian_2d($x, (FLOOR..CEILING).log_scale()).map_err(|e| failed(&e))?;
                chart
                    .configure_mesh()
                    .x_desc(axis.name)
                    .y_desc(format!("largest {kind} error"))
                    .x_label_formatter(&|x| format!("{x:.3e}").replace(".000", ""))
                    .y_label_formatter(&|y| format!("{y:.0e}"))
                    .light_line_style(WHITE)
                    .draw()
                    .map_err(|e| failed(&e))?;
                for (tier, bins) in &drawn {
                    let color = match tier {
                        Tier::Fast => RGBColor(213, 94, 0),
                        Tier::Stable => RGBColor(0, 114, 178),
                        Tier::Compensated => RGBColor(0, 158, 115),
                    };
                    let edge = |bin: usize| {
                        let part = bin as f64 / BINS as f64;
                        if axis.log { low * (high / low).powf(part) } else { low + (high - low) * part }
                    };
                    let step = |(bin, error): (usize, f64)| [(edge(bin), error), (edge(bin + 1), error)];
                    // One line per run of bins with cases, so that no line crosses a gap.
                    let known: Vec<(usize, f64)> =
                        bins.iter().enumerate().filter_map(|(bin, error)| Some((bin, (*error)?))).collect();
                    for run in known.chunk_by(|a, b| b.0 == a.0 + 1) {
                        let points = run.iter().copied().flat_map(step);
                        chart.draw_series(LineSeries::new(points, color.stroke_width(2))).map_err(|e| failed(&e))?;
                    }
                    chart
                        .draw_series(std::iter::empty::<PathElement<(f64, f64)>>())
                        .map_err(|e| failed(&e))?
                        .label(tier.name())
                        .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
                }
                chart
                    .configure_series_labels()
                    .position(SeriesLabelPosition::UpperRight)
                    .background_style(WHITE.mix(0.8))
                    .border_style(BLACK.mix(0.3))
                    .draw()
                    .map_err(|e| failed(&e))?;
            }};
        }
        if axis.log {
            draw!((low..high).log_scale())
        } else {
            draw!(low..high)
        }
        root.present().map_err(|e| failed(&e))?;
    }
    Ok(Some(text))
}
