//! Curves of equations over one input, as SVG: the functions of the shaders as a device evaluates them, and below them
//! the difference to another function (the error of a model, not of its arithmetic; [`plot`](super::plot) draws that).

use std::sync::Arc;

use anyhow::{Result, anyhow, ensure};
use plotters::prelude::*;

use super::arguments::{self, Values};
use super::{Entry, evaluate};
use etalon::gpu::Device;
use etalon::optics::Tier;
use etalon::spectra;

/// Points of a curve.
const POINTS: usize = 512;
const SIZE: (u32, u32) = (760, 560);
/// Colour-blind safe (Okabe and Ito 2008).
const COLORS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];

/// The input that varies.
#[derive(Debug, Clone)]
pub struct Over {
    /// A column, a vector (then its angle in degrees), or `wavelength` in nm where the curves are of metals.
    pub name: String,
    /// First and last value.
    pub range: [f64; 2],
}

/// What is drawn.
#[derive(Debug, Clone)]
pub struct Plot {
    /// The function.
    pub entry: Entry,
    /// Its output column, and the one that it is divided by, if any.
    pub column: Column,
    /// The input along the axis.
    pub over: Over,
    /// All other inputs.
    pub values: Values,
    /// An input that takes several values, a curve for each.
    pub each: Option<(String, Vec<String>)>,
    /// Metals whose measured n and kappa are inputs, a curve for each.
    pub metals: Vec<String>,
    /// The function that each curve is compared with, and its output column.
    pub against: Option<(Entry, Column)>,
    /// Two vectors that change places in the curve that each is compared with.
    pub swap: Option<[String; 2]>,
    /// Form of the arithmetic.
    pub tier: Tier,
    /// Both axes are logarithmic.
    pub log: bool,
    /// The error against the f64 twin is drawn in place of the value.
    pub error: bool,
}

/// An output column, or the ratio of two: a BRDF is reflected radiance over irradiance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Column {
    /// The column.
    pub of: usize,
    /// What it is divided by.
    pub per: Option<usize>,
}

impl Column {
    /// Its name.
    #[must_use]
    pub fn name(self, entry: &Entry) -> String {
        let name = |column: usize| entry.probe.outputs[column];
        self.per.map_or_else(|| name(self.of).to_owned(), |per| format!("{}/{}", name(self.of), name(per)))
    }
}

/// A curve: points (input, output), finite ones alone.
#[derive(Debug, Clone)]
pub struct Curve {
    /// Name in the legend.
    pub label: String,
    /// Points from left to right.
    pub points: Vec<(f64, f64)>,
}

/// What was drawn, with the largest difference to the function of comparison.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// The picture.
    pub svg: String,
    /// Curves of the function.
    pub curves: Vec<Curve>,
    /// Other function minus function.
    pub differences: Vec<Curve>,
}

impl Plot {
    /// Places along the axis.
    fn places(&self) -> Vec<f64> {
        let [low, high] = self.over.range;
        let part = |i: usize| i as f64 / (POINTS - 1) as f64;
        let at = |i: usize| if self.log { low * (high / low).powf(part(i)) } else { low + (high - low) * part(i) };
        (0..POINTS).map(at).collect()
    }

    /// Outputs of one function at all places, for the values of one curve.
    fn outputs(
        &self,
        device: &Arc<Device>,
        (entry, column): (Entry, Column),
        values: &Values,
        metal: Option<&str>,
        used: &mut Vec<String>,
    ) -> Result<Vec<(f64, f64)>> {
        let indices = match metal {
            Some(name) => Some(
                spectra::metal(name)
                    .ok_or_else(|| anyhow!("--metal {name}: measured metals are gold, silver, copper, aluminium"))?,
            ),
            None => None,
        };
        let mut rows = Vec::with_capacity(POINTS);
        let whole = entry.probe.whole.contains(&self.over.name.as_str());
        let mut places = self.places();
        if whole {
            for at in &mut places {
                *at = at.round();
            }
            places.dedup();
        }
        for &at in &places {
            let mut values = values.clone();
            values.insert(self.over.name.clone(), if whole { (at as u32).to_string() } else { at.to_string() });
            if let Some([n, kappa]) = &indices {
                let Some(nm) = values.remove("wavelength") else {
                    return Err(anyhow!("--metal needs wavelength=NM, or --over wavelength=380..780"));
                };
                used.push("wavelength".to_owned());
                let nm: f64 = nm.parse().map_err(|_| anyhow!("wavelength={nm}: no number"))?;
                values.insert("n".to_owned(), n.at(nm).to_string());
                values.insert("kappa".to_owned(), kappa.at(nm).to_string());
            }
            rows.push(arguments::row(&entry, &values, used)?);
        }
        let columns: Vec<f64> =
            (0..entry.probe.inputs.len()).flat_map(|column| rows.iter().map(move |row| row[column])).collect();
        let outputs = evaluate(device, entry.probe, self.tier, &columns, rows.len())?.outputs;
        let value = |outputs: &dyn Fn(usize) -> f64| outputs(column.of) / column.per.map_or(1.0, outputs);
        let points = places.iter().zip(&rows).enumerate().map(|(i, (&at, row))| {
            let y = value(&|column| f64::from(outputs[column * rows.len() + i]));
            if !self.error {
                return (at, y);
            }
            let exact = (entry.equation.twin)(row);
            (at, (y - value(&|column| exact[column])).abs())
        });
        Ok(points.filter(|(_, y)| y.is_finite()).collect())
    }

    /// Checks the names of all inputs, without a device.
    ///
    /// # Errors
    /// One sentence with the first name that is no input, or that is given twice.
    pub fn check_names(&self) -> Result<()> {
        let each = self.each.as_ref().map(|(name, _)| ("--each", name));
        let mut known = arguments::names(&self.entry);
        known.extend(self.entry.probe.inputs.iter().map(|&column| column.to_owned()));
        if !self.metals.is_empty() {
            known.push("wavelength".to_owned());
        }
        for (option, name) in [("--over", &self.over.name)].into_iter().chain(each) {
            let has = arguments::names(&self.entry).join(", ");
            ensure!(known.contains(name), "{option} {name}: the inputs of {} are {has}", self.entry.probe.name);
            ensure!(!self.values.contains_key(name), "{name}={}: {option} gives this input", self.values[name]);
        }
        let is_twice = each.is_some_and(|(_, name)| *name == self.over.name);
        ensure!(!is_twice, "--each {}: --over gives this input", self.over.name);
        Ok(())
    }

    /// Evaluates and draws.
    ///
    /// # Errors
    /// One sentence: an input that is missing or unknown, a device that fails, a function without a finite value there.
    pub fn draw(&self, device: &Arc<Device>) -> Result<Drawn> {
        let mut used = vec![self.over.name.clone()];
        let mut curves = Vec::new();
        let mut others = Vec::new();
        let each = match &self.each {
            Some((name, values)) => values.iter().map(|value| Some((name.clone(), value.clone()))).collect(),
            None => vec![None],
        };
        let metals: Vec<Option<&str>> = if self.metals.is_empty() {
            vec![None]
        } else {
            self.metals.iter().map(|name| Some(name.as_str())).collect()
        };
        for one in &each {
            for &metal in &metals {
                let mut values = self.values.clone();
                let mut names = vec![self.entry.probe.name.to_owned()];
                if let Some((name, value)) = one {
                    values.insert(name.clone(), value.clone());
                    names.push(format!("{name}={value}"));
                }
                names.extend(metal.map(str::to_owned));
                let points = self.outputs(device, (self.entry, self.column), &values, metal, &mut used)?;
                ensure!(!points.is_empty(), "{} has no finite value there", self.entry.probe.name);
                curves.push(Curve { label: names.join(" "), points });
                let other = match (&self.against, &self.swap) {
                    (Some(against), _) => {
                        names[0] = against.0.probe.name.to_owned();
                        Some(self.outputs(device, *against, &values, metal, &mut used)?)
                    }
                    (None, Some([a, b])) => {
                        names.push(format!("{a} and {b} exchanged"));
                        Some(self.swapped(device, &values, [a, b], metal, &mut used)?)
                    }
                    (None, None) => None,
                };
                others.extend(other.map(|points| Curve { label: names.join(" "), points }));
            }
        }
        let entries: Vec<Entry> = [self.entry].into_iter().chain(self.against.map(|(entry, _)| entry)).collect();
        arguments::all_used(&self.values, &used, &entries)?;
        let difference = |(curve, other): (&Curve, &Curve)| Curve {
            label: format!("{} − {}", other.label, curve.label),
            points: curve
                .points
                .iter()
                .filter_map(|&(x, y)| Some((x, other.points.iter().find(|(at, _)| *at == x)?.1 - y)))
                .collect(),
        };
        let differences: Vec<Curve> = curves.iter().zip(&others).map(difference).collect();
        let mut output = self.column.name(&self.entry);
        if self.error {
            output = format!("error of {output} against f64");
        }
        let svg = self.svg(&[&curves[..], &others[..]].concat(), &differences, &output)?;
        Ok(Drawn { svg, curves, differences })
    }

    fn swapped(
        &self,
        device: &Arc<Device>,
        values: &Values,
        [a, b]: [&String; 2],
        metal: Option<&str>,
        used: &mut Vec<String>,
    ) -> Result<Vec<(f64, f64)>> {
        // One of both may be the input that varies: then the axis stays, and its values go to the other.
        let mut values = values.clone();
        let [of_a, of_b] = [values.remove(a), values.remove(b)];
        let mut other = self.clone();
        if self.over.name == *a {
            other.over.name.clone_from(b);
        } else if self.over.name == *b {
            other.over.name.clone_from(a);
        }
        if let Some(value) = of_a {
            values.insert(b.clone(), value);
        }
        if let Some(value) = of_b {
            values.insert(a.clone(), value);
        }
        other.outputs(device, (self.entry, self.column), &values, metal, used)
    }

    fn svg(&self, curves: &[Curve], differences: &[Curve], output: &str) -> Result<String> {
        let mut text = String::new();
        let failed = |error: &dyn std::fmt::Display| anyhow!("drawing the curve of {}: {error}", self.entry.probe.name);
        {
            let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
            root.fill(&WHITE).map_err(|e| failed(&e))?;
            let (above, below) = root.split_vertically(if differences.is_empty() { SIZE.1 } else { SIZE.1 * 3 / 5 });
            let panels = [(above, curves, output.to_owned()), (below, differences, format!("difference of {output}"))];
            for (area, curves, title) in panels {
                if curves.is_empty() {
                    continue;
                }
                let ys = || curves.iter().flat_map(|curve| curve.points.iter().map(|(_, y)| *y));
                let (low, high) = (ys().fold(f64::INFINITY, f64::min), ys().fold(f64::NEG_INFINITY, f64::max));
                let room = (0.05 * (high - low)).max(1e-9 * high.abs()).max(1e-12);
                let mut builder = ChartBuilder::on(&area);
                builder.margin(12).x_label_area_size(42).y_label_area_size(72);
                // The two kinds of axes are two types of charts.
                macro_rules! draw {
                    ($x:expr, $y:expr) => {{
                        let mut chart = builder.build_cartesian_2d($x, $y).map_err(|e| failed(&e))?;
                        chart
                            .configure_mesh()
                            .x_desc(self.axis())
                            .y_desc(title.as_str())
                            .x_label_formatter(&|x| short(*x))
                            .y_label_formatter(&|y| short(*y))
                            .label_style(("sans-serif", 14))
                            .axis_desc_style(("sans-serif", 16))
                            .light_line_style(WHITE)
                            .draw()
                            .map_err(|e| failed(&e))?;
                        for (i, curve) in curves.iter().enumerate() {
                            let color = COLORS[i % COLORS.len()];
                            let points = curve.points.iter().copied().filter(|(_, y)| !self.log || *y > 0.0);
                            chart
                                .draw_series(LineSeries::new(points, color.stroke_width(2)))
                                .map_err(|e| failed(&e))?
                                .label(curve.label.as_str())
                                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
                        }
                        chart
                            .configure_series_labels()
                            .position(SeriesLabelPosition::UpperMiddle)
                            .label_font(("sans-serif", 14))
                            .background_style(WHITE.mix(0.8))
                            .border_style(BLACK.mix(0.3))
                            .draw()
                            .map_err(|e| failed(&e))?;
                    }};
                }
                let [from, to] = self.over.range;
                if self.log {
                    let least = ys().filter(|y| *y > 0.0).fold(f64::INFINITY, f64::min);
                    ensure!(
                        least.is_finite(),
                        "{title} is nowhere above 0, and a logarithmic axis has no place for it"
                    );
                    draw!((from..to).log_scale(), (least * 0.8..high * 1.25).log_scale());
                } else {
                    draw!(from..to, low - room..high + room);
                }
            }
            root.present().map_err(|e| failed(&e))?;
        }
        Ok(text)
    }

    /// The axis with its unit.
    fn axis(&self) -> String {
        let name = &self.over.name;
        match () {
            () if name == "wavelength" => "wavelength, nm".to_owned(),
            () if self.entry.probe.inputs.contains(&name.as_str()) => name.clone(),
            () => format!("angle of {name}, degrees"),
        }
    }
}

/// A label without digits that say nothing.
fn short(x: f64) -> String {
    if x != 0.0 && (x.abs() < 1e-3 || x.abs() >= 1e5) {
        return format!("{x:.1e}");
    }
    let text = format!("{x:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
