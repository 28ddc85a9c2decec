//! `report.html`: one file that shows a [`Table`], with its pictures in it and nothing loaded from anywhere.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context as _, Result};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::table::{Family, INVISIBLE, Order, Point, Price, REFERENCE, Table};
use etalon::image::png::{Display, encode_png, read_display};

const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// Width and height of the charts, in their own units.
const CHART: [f64; 2] = [760.0, 420.0];
/// Room for labels: left, right, top, bottom.
const MARGIN: [f64; 4] = [64.0, 16.0, 32.0, 44.0];
/// Quality of the pictures in the page; the folder `pictures` has them as they are.
const QUALITY: u8 = 82;
/// Colours of causes and passes, told apart by those who see few of them (Okabe and Ito 2008).
const COLOURS: [[u8; 3]; 8] = [
    [230, 159, 0],
    [86, 180, 233],
    [0, 158, 115],
    [240, 228, 66],
    [0, 114, 178],
    [213, 94, 0],
    [204, 121, 167],
    [150, 150, 150],
];

fn hex(index: usize) -> String {
    let [r, g, b] = COLOURS[index.min(COLOURS.len() - 1)];
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn embedded(kind: &str, bytes: &[u8]) -> String {
    format!("data:image/{kind};base64,{}", STANDARD.encode(bytes))
}

fn jpeg(picture: &Display) -> Result<String> {
    let rgb: Vec<u8> = picture
        .rgba
        .iter()
        .flat_map(|&[r, g, b, a]| {
            // Nothing shows as the grey that a PNG's viewer might put there.
            let over = |c: u8| ((u32::from(c) * u32::from(a) + 119 * u32::from(255 - a)) / 255) as u8;
            [over(r), over(g), over(b)]
        })
        .collect();
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY).encode(
        &rgb,
        picture.width,
        picture.height,
        ExtendedColorType::Rgb8,
    )?;
    Ok(embedded("jpeg", &bytes))
}

/// A number with three digits that say something.
fn digits(x: f64) -> String {
    match x.abs() {
        0.0 => "0".to_owned(),
        a if a >= 100.0 => format!("{x:.0}"),
        a if a >= 10.0 => format!("{x:.1}"),
        a if a >= 1.0 => format!("{x:.2}"),
        a if a >= 0.001 => format!("{x:.3}"),
        _ => format!("{x:.1e}"),
    }
}

fn percent(x: f64) -> String {
    format!("{} %", digits(100.0 * x))
}

/// Where a logarithm falls.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    /// Around some numbers above 0, in whole steps of 1, 2 and 5.
    fn around(values: impl Iterator<Item = f64> + Clone, from: f64, to: f64) -> Self {
        let high = values.clone().fold(1e-9, f64::max);
        let low = values.fold(high, f64::min).max(1e-9);
        Self { low: low / 1.4, high: high * 1.4, from, to }
    }

    fn at(&self, value: f64) -> f64 {
        let part = (value.max(self.low) / self.low).ln() / (self.high / self.low).ln();
        self.from + part * (self.to - self.from)
    }

    fn ticks(&self) -> Vec<f64> {
        let decades = (self.high / self.low).log10();
        let steps: &[f64] = if decades > 3.0 {
            &[1.0]
        } else if decades > 1.5 {
            &[1.0, 3.0]
        } else {
            &[1.0, 2.0, 5.0]
        };
        let first = self.low.log10().floor() as i32;
        (first..=self.high.log10().ceil() as i32)
            .flat_map(|power| steps.iter().map(move |step| step * 10_f64.powi(power)))
            .filter(|tick| *tick >= self.low && *tick <= self.high)
            .collect()
    }
}

/// The page.
///
/// # Errors
/// When a picture cannot be read.
pub fn page(table: &Table, pictures: &Path) -> Result<String> {
    let read = |name: &str| read_display(&pictures.join(name));
    let reference = jpeg(&read("reference.png")?)?;
    let gallery = table
        .points
        .iter()
        .filter(|point| point.name != REFERENCE)
        .map(|point| shown(point, table, pictures))
        .collect::<Result<Vec<_>>>()?;
    let causes = causes(table, pictures)?;
    let title = format!("What accuracy costs: {}", table.scene);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                header {
                    h1 { (title) }
                    p.lead { (summary(table)) }
                    nav aria-label="Sections" {
                        @for (id, name) in SECTIONS {
                            @if has(table, id) && (*id != "causes" || causes.is_some()) { a href={ "#" (id) } { (name) } }
                        }
                    }
                }
                main {
                    section #reference {
                        h2 { "The reference" }
                        div.pair {
                            figure {
                                img src=(reference) alt={ "The reference picture of " (table.scene) };
                                figcaption { (table.reference.samples) " samples of each pixel, own FLIP " (digits(table.reference.own_flip)) }
                            }
                            (facts(table))
                        }
                        @if !table.warnings.is_empty() {
                            ul.warnings { @for warning in &table.warnings { li { (warning) } } }
                        }
                    }
                    section #frontier {
                        h2 { "Error against time" }
                        p { "Each point is a picture: GPU time across, FLIP's mean error up, both logarithmic. On the line lies what nothing beats in both; the broken line is the reference's own error, below which nothing is known. Point at a point, or step through them with Tab." }
                        div.chart-and-card {
                            (chart(table))
                            aside #card aria-live="polite" { p.quiet { "Point at a point." } }
                        }
                        (choices(table))
                    }
                    section #prices {
                        h2 { "Price of each rung alone" }
                        p { "One knob changed, all others as in " em { "local" } " or as in the reference (" em { "exact" } "). Sorted by error bought per millisecond. Error is the root mean square of displayed values, in percent of their range: against the reference from " em { "local" } ", without the noise of paths from " em { "exact" } "." }
                        (prices(table))
                    }
                    section #tornado {
                        h2 { "Which knobs matter" }
                        p { "To the left the time that a change takes or saves, to the right what an eye sees of it: FLIP between both pictures." }
                        (tornado(table))
                    }
                    @if let Some(causes) = &causes {
                        section #causes {
                            h2 { "Error by cause" }
                            p { "The picture of " em { "local" } ", and for each pixel the change of one knob that brings it nearest to the reference. Dark pixels are not brought nearer by any." }
                            (causes)
                        }
                    }
                    @if !table.orders.is_empty() {
                        section #orders {
                            h2 { "Orders of quadrature" }
                            p { "The error of the sum through media that vary, by its steps: rays with one sample, so that no noise is in it, against " em { "simpson" } " with 64 steps; root mean square, as a share of the picture's. Both logarithmic: the slope is the order." }
                            (orders(table))
                        }
                    }
                    section #passes {
                        h2 { "Where the time goes" }
                        (passes(table))
                    }
                    section #knobs {
                        h2 { "What the scene calls for" }
                        (knobs(table))
                    }
                    @if !table.search.is_empty() {
                        section #search {
                            h2 { "The search" }
                            p { "Each step takes what single prices promise most of for its time. Where the promise was not kept, two knobs do not add up." }
                            (search(table))
                        }
                    }
                    section #pictures {
                        h2 { "Every picture" }
                        div.gallery { @for entry in &gallery { (entry) } }
                    }
                }
                footer { p { "Etalon " (table.program) ", " (table.points.len()) " pictures, " (format!("{:.0}", table.took_s)) " s of the " (format!("{:.0}", table.budget_s)) " s asked for. The same numbers are in cost.json and cost.csv, the pictures as they are in the folder pictures." } }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    Ok(page.into_string())
}

const SECTIONS: &[(&str, &str)] = &[
    ("reference", "Reference"),
    ("frontier", "Frontier"),
    ("prices", "Prices"),
    ("tornado", "Knobs that matter"),
    ("causes", "Causes"),
    ("orders", "Orders"),
    ("passes", "Passes"),
    ("knobs", "Called for"),
    ("search", "Search"),
    ("pictures", "Pictures"),
];

/// Whether there is anything to be told in a section.
fn has(table: &Table, section: &str) -> bool {
    match section {
        "search" => !table.search.is_empty(),
        "orders" => !table.orders.is_empty(),
        _ => true,
    }
}

fn summary(table: &Table) -> String {
    let called: Vec<&str> = table.knobs.iter().filter(|k| k.called_for).map(|k| k.knob.as_str()).collect();
    let free: Vec<&str> = called.iter().copied().filter(|knob| harmless(table, knob)).collect();
    let visible = |price: &Price| !price.same && price.flip_between >= INVISIBLE;
    if !table.prices.iter().any(visible) {
        return "This scene calls for nothing that can be seen: no rung of any knob changes its picture visibly."
            .to_owned();
    }
    let worst =
        table.prices.iter().filter(|price| price.is_seen()).max_by(|a, b| a.flip_between.total_cmp(&b.flip_between));
    let mut text = format!("Of {} knobs the scene calls for {}.", table.knobs.len(), called.len());
    if let Some(worst) = worst {
        text += &format!(
            " Most is seen of {}={} instead of {} (FLIP {} between both pictures).",
            worst.knob,
            worst.to,
            worst.from,
            digits(worst.flip_between)
        );
    }
    if !free.is_empty() {
        text += &format!(" Nobody sees any rung of {} here.", free.join(", "));
    }
    text
}

/// Whether it was priced and no rung of it can be seen.
fn harmless(table: &Table, knob: &str) -> bool {
    let mut all = table.prices.iter().filter(|price| price.knob == knob).peekable();
    all.peek().is_some() && all.all(|price| price.same || price.flip_between < INVISIBLE)
}

fn facts(table: &Table) -> Markup {
    let t = table;
    html! {
        table.facts {
            tbody {
                tr { th scope="row" { "Scene" } td { (t.scene) ", " (t.size[0]) "×" (t.size[1]) } }
                tr { th scope="row" { "Device" } td { (t.device.name) " (" (t.device.kind) ")" } }
                tr { th scope="row" { "Driver" } td { (t.device.driver) " " (t.device.version) } }
                tr { th scope="row" { "Reference" } td { (t.reference.samples) " samples, " (digits(t.reference.gpu_ms)) " ms of GPU time" } }
                tr { th scope="row" { "Its own error" } td { "FLIP " (digits(t.reference.own_flip)) ", √relMSE " (percent(t.reference.own_error)) @if !t.reference.converged { ", not converged" } } }
                tr { th scope="row" { "Made by" } td { code { (t.reference.command) } } }
            }
        }
    }
}

/// Where the page shows a point.
fn anchor(point: &Point) -> String {
    if point.name == REFERENCE { "#reference".to_owned() } else { format!("#p-{}", point.picture) }
}

fn class(family: Family) -> &'static str {
    match family {
        Family::Preset => "preset",
        Family::Local => "local",
        Family::Exact => "exact",
        Family::Search => "search",
    }
}

fn chart(table: &Table) -> Markup {
    let [width, height] = CHART;
    let [left, right, top, bottom] = MARGIN;
    let visible = || table.points.iter().filter(|p| p.error() > 0.0 && p.gpu_ms.median > 0.0);
    let x = Axis::around(visible().map(|p| p.gpu_ms.median), left, width - right);
    let y = Axis::around(visible().map(Point::error), height - bottom, top);
    let line: Vec<String> = table
        .frontier
        .iter()
        .filter_map(|&i| table.points.get(i))
        .map(|p| format!("{:.1},{:.1}", x.at(p.gpu_ms.median), y.at(p.error())))
        .collect();
    html! {
        svg.chart viewBox=(format!("0 0 {width} {height}")) role="group" aria-label="FLIP against GPU time" {
            @for tick in x.ticks() {
                line.grid x1=(x.at(tick)) x2=(x.at(tick)) y1=(top) y2=(height - bottom) {}
                text.tick x=(x.at(tick)) y=(height - bottom + 16.0) text-anchor="middle" { (digits(tick)) }
            }
            @for tick in y.ticks() {
                line.grid x1=(left) x2=(width - right) y1=(y.at(tick)) y2=(y.at(tick)) {}
                text.tick x=(left - 8.0) y=(y.at(tick) + 4.0) text-anchor="end" { (digits(tick)) }
            }
            text.axis x=((left + width - right) * 0.5) y=(height - 8.0) text-anchor="middle" { "GPU time of a picture, ms" }
            text.axis x="8" y="20" { "FLIP, mean" }
            line.own x1=(left) x2=(width - right) y1=(y.at(table.reference.own_flip)) y2=(y.at(table.reference.own_flip)) {}
            polyline.pareto points=(line.join(" ")) {}
            @for (index, p) in table.points.iter().enumerate() {
                @let on = table.frontier.contains(&index);
                @let [cx, cy] = [x.at(p.gpu_ms.median), y.at(p.error())];
                line.bar x1=(x.at(p.gpu_ms.low)) x2=(x.at(p.gpu_ms.high)) y1=(cy) y2=(cy) {}
                a.point href=(anchor(p)) data-point=(p.picture) {
                    title { (p.name) ": " (digits(p.gpu_ms.median)) " ms, FLIP " (digits(p.error())) }
                    circle class={ (class(p.family)) @if on { " on" } } cx=(cx) cy=(cy) r=(if on { 6.0 } else { 4.0 }) {}
                    // A finger's width.
                    circle.touch cx=(cx) cy=(cy) r="11" {}
                }
            }
            @for (i, name) in labels(table, &x, &y) {
                text.label x=(name[0]) y=(name[1]) text-anchor=(if name[0] > width * 0.7 { "end" } else { "start" }) { (table.points[i].name) }
            }
        }
        p.legend {
            @for (family, name) in [(Family::Preset, "presets"), (Family::Local, "local, one knob changed"), (Family::Exact, "exact, one knob changed"), (Family::Search, "found by the search")] {
                span { svg.dot viewBox="0 0 12 12" aria-hidden="true" { circle class=(class(family)) cx="6" cy="6" r="5" {} } (name) }
            }
        }
    }
}

/// Names of the frontier's points where they do not lie on one another.
fn labels(table: &Table, x: &Axis, y: &Axis) -> Vec<(usize, [f64; 2])> {
    let mut placed: Vec<(usize, [f64; 2])> = Vec::new();
    for &i in &table.frontier {
        let p = &table.points[i];
        let at = [x.at(p.gpu_ms.median), y.at(p.error()) - 10.0];
        let at = if at[0] > CHART[0] * 0.7 { [at[0] - 8.0, at[1]] } else { [at[0] + 8.0, at[1]] };
        if placed.iter().all(|(_, other)| (other[1] - at[1]).abs() > 13.0 || (other[0] - at[0]).abs() > 170.0) {
            placed.push((i, at));
        }
    }
    placed
}

/// The frontier as a list: what each of its points gives up.
fn choices(table: &Table) -> Markup {
    html! {
        div.scroll { table {
            caption { "The frontier, from the quickest to the most exact" }
            thead { tr { th scope="col" { "picture" } th.number scope="col" { "GPU ms" } th.number scope="col" { "FLIP" } th.number scope="col" { "√relMSE" } th.number scope="col" { "ΔE2000" } th scope="col" { "given up" } } }
            tbody {
                @for p in table.frontier.iter().filter_map(|&i| table.points.get(i)) {
                    tr {
                        th scope="row" { a href=(anchor(p)) { (p.name) } }
                        td.number { (digits(p.gpu_ms.median)) }
                        td.number { (digits(p.error())) }
                        td.number { (percent(p.errors.relmse.median.max(0.0).sqrt())) }
                        td.number { @if p.name == REFERENCE { "–" } @else { (digits(p.errors.delta_e_mean)) } }
                        td.knobs { (table.given_up(p)) }
                    }
                }
            }
        } }
    }
}

/// Error that a price changes, without a sign.
fn bought(price: &Price) -> f64 {
    price.shown_delta.median.abs().sqrt()
}

fn prices(table: &Table) -> Markup {
    let mut all: Vec<&Price> = table.prices.iter().collect();
    let worth =
        |price: &Price| if price.error_told { bought(price) / price.gpu_ms_delta.median.abs().max(0.05) } else { 0.0 };
    all.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
    html! {
        div.scroll { table {
            thead { tr {
                th scope="col" { "knob" } th scope="col" { "from → to" } th scope="col" { "others" }
                th.number scope="col" { "ms" } th.number scope="col" { "time" } th.number scope="col" { "error" }
                th.number scope="col" { "FLIP" } th scope="col" { "in words" }
            } }
            tbody {
                @for price in all {
                    @let sign = if price.shown_delta.median < 0.0 { "−" } else { "+" };
                    tr {
                        th scope="row" { (price.knob) }
                        td { a href={ "#p-" (point_of(table, price)) } { (price.from) " → " (price.to) } }
                        td { (class(price.base)) }
                        td.number { (format!("{:+.2}", price.gpu_ms_delta.median)) }
                        td.number { (format!("{:+.0} %", 100.0 * price.share)) }
                        td.number { @if price.same { "0" } @else if price.error_told { (sign) (percent(bought(price))) } @else { "?" } }
                        td.number { (digits(price.flip_between)) }
                        td { (price.verdict) }
                    }
                }
            }
        } }
    }
}

fn point_of<'a>(table: &'a Table, price: &Price) -> &'a str {
    table.points.iter().find(|point| point.name == price.point).map_or("", |point| &point.picture)
}

fn tornado(table: &Table) -> Markup {
    let mut all: Vec<&Price> = table.prices.iter().filter(|price| !price.same).collect();
    all.sort_by(|a, b| b.flip_between.total_cmp(&a.flip_between));
    all.truncate(24);
    let row = 22.0;
    let (width, height) = (760.0, 30.0 + row * all.len() as f64);
    let (middle, reach, names) = (430.0, 200.0, 190.0);
    let most_time = all.iter().map(|p| p.share.abs()).fold(1e-3, f64::max);
    let most_seen = all.iter().map(|p| p.flip_between).fold(1e-6, f64::max);
    // Shares of time reach from a part of a percent to many times: their roots fit on one scale.
    let time = |share: f64| (share.abs() / most_time).sqrt() * (middle - names - 60.0);
    html! {
        div.scroll { svg.tornado viewBox=(format!("0 0 {width} {height}")) role="img" aria-label="Time and visible error of every change" {
            text.axis x=(middle - 8.0) y="14" text-anchor="end" { "time, of the base's" }
            text.axis x=(middle + 8.0) y="14" { "FLIP" }
            @for (i, price) in all.iter().enumerate() {
                @let y = 24.0 + row * i as f64;
                @let w = time(price.share);
                @let seen = price.flip_between / most_seen * reach;
                text.tick x="0" y=(y + 13.0) { (price.knob) "=" (price.to) " (" (class(price.base)) ")" }
                rect class=(if price.share < 0.0 { "saves" } else { "takes" }) x=(middle - w) y=(y) width=(w) height=(row - 5.0) {}
                text.tick x=(middle - w - 5.0) y=(y + 13.0) text-anchor="end" { (format!("{:+.0} %", 100.0 * price.share)) }
                rect class=(if price.is_seen() { "seen" } else { "seen noise" }) x=(middle) y=(y) width=(seen) height=(row - 5.0) {}
                text.tick x=(middle + seen + 5.0) y=(y + 13.0) { (digits(price.flip_between)) }
            }
            line.grid x1=(middle) x2=(middle) y1="20" y2=(height) {}
        } }
        p.legend { span { i.key.saves {} "saves time" } span { i.key.takes {} "takes time" } span { i.key.seen {} "seen" } span { i.key.seen.noise {} "noise, or too little to be seen" } }
    }
}

/// Error by steps, a line for each rule, and the same as a table.
fn orders(table: &Table) -> Markup {
    let ([width, height], [left, right, top, bottom]) = (CHART, MARGIN);
    let all = || table.orders.iter().flat_map(|order| order.errors.iter().copied().filter(|error| *error > 0.0));
    let steps = || table.orders.iter().flat_map(|order| order.steps.iter().map(|&n| f64::from(n)));
    let (x, y) = (Axis::around(steps(), left, width - right), Axis::around(all(), height - bottom, top));
    let told: BTreeSet<u32> = table.orders.iter().flat_map(|order| order.steps.iter().copied()).collect();
    let place = |order: &Order, i: usize| [x.at(f64::from(order.steps[i])), y.at(order.errors[i])];
    let line = |order: &Order| -> String {
        let points: Vec<_> = (0..order.steps.len()).map(|i| place(order, i)).collect();
        points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect::<Vec<_>>().join(" ")
    };
    let name = |order: &Order| order.order.map_or_else(String::new, |p| format!(", order {p:.1}"));
    html! {
        svg.chart viewBox=(format!("0 0 {width} {height}")) role="img" aria-label="Error against steps" {
            @for &tick in &told {
                line.grid x1=(x.at(tick.into())) x2=(x.at(tick.into())) y1=(top) y2=(height - bottom) {}
                text.tick x=(x.at(tick.into())) y=(height - bottom + 16.0) text-anchor="middle" { (tick) }
            }
            @for tick in y.ticks() {
                line.grid x1=(left) x2=(width - right) y1=(y.at(tick)) y2=(y.at(tick)) {}
                text.tick x=(left - 8.0) y=(y.at(tick) + 4.0) text-anchor="end" { (digits(tick)) }
            }
            text.axis x=((left + width - right) * 0.5) y=(height - 8.0) text-anchor="middle" { "steps of each segment" }
            text.axis x="8" y="20" { "error" }
            @for order in &table.orders {
                polyline.pareto points=(line(order)) {}
                @for i in 0..order.steps.len() {
                    circle class="local" cx=(place(order, i)[0]) cy=(place(order, i)[1]) r="4" {
                        title { (order.rule) ", " (order.steps[i]) " steps: " (digits(order.errors[i])) ", " (digits(order.gpu_ms[i])) " ms" }
                    }
                }
                text.label x=(place(order, 0)[0] + 10.0) y=(place(order, 0)[1] - 8.0) { (order.rule) (name(order)) }
            }
        }
        div.scroll {
            table {
                thead { tr { th { "rule" } @for n in &told { th.number { (n) " steps" } } th.number { "order" } } }
                tbody {
                    @for order in &table.orders {
                        tr {
                            th scope="row" { (order.rule) }
                            @for n in &told {
                                @let place = order.steps.iter().position(|known| known == n);
                                td.number { @if let Some(i) = place { (digits(order.errors[i])) ", " (digits(order.gpu_ms[i])) " ms" } }
                            }
                            td.number { (order.order.map_or_else(|| "hidden by rounding".to_owned(), |p| format!("{p:.2}"))) }
                        }
                    }
                }
            }
        }
    }
}

fn passes(table: &Table) -> Markup {
    let points: Vec<&Point> =
        table.frontier.iter().filter_map(|&i| table.points.get(i)).filter(|point| !point.passes.is_empty()).collect();
    let mut sums: BTreeMap<&str, f64> = BTreeMap::new();
    for point in &points {
        let all: f64 = point.passes.iter().map(|(_, ms)| ms).sum();
        for (name, ms) in &point.passes {
            *sums.entry(name).or_default() += ms / all.max(1e-9);
        }
    }
    let mut names: Vec<&str> = sums.keys().copied().collect();
    names.sort_by(|a, b| sums[b].total_cmp(&sums[a]));
    names.truncate(COLOURS.len() - 1);
    let place = |name: &str| names.iter().position(|known| *known == name).unwrap_or(COLOURS.len() - 1);
    html! {
        p { "Shares of GPU time of the frontier's pictures by pass; beside them the wall time of a start (uploading, and compiling what no picture before had compiled), and what share of start and one picture that is." }
        div.bars {
            @for point in &points {
                @let all: f64 = point.passes.iter().map(|(_, ms)| ms).sum();
                @let start = point.start_ms / (point.start_ms + point.gpu_ms.median).max(1e-9);
                div.bar-row {
                    span.bar-name { (point.name) }
                    span.bar-track role="img" aria-label=(point.passes.iter().map(|(name, ms)| format!("{name} {} ms", digits(*ms))).collect::<Vec<_>>().join(", ")) {
                        @for (name, ms) in &point.passes {
                            i style={ "width:" (format!("{:.2}", 100.0 * ms / all.max(1e-9))) "%;background:" (hex(place(name))) } title={ (name) " " (digits(*ms)) " ms" } {}
                        }
                    }
                    span.bar-value { (digits(point.gpu_ms.median)) " ms, start " (digits(point.start_ms)) " ms (" (format!("{:.0}", 100.0 * start)) " %)" }
                }
            }
        }
        p.legend {
            @for name in &names { span { i.key style={ "background:" (hex(place(name))) } {} (name) } }
            span { i.key style={ "background:" (hex(COLOURS.len() - 1)) } {} "others" }
        }
    }
}

fn knobs(table: &Table) -> Markup {
    html! {
        div.scroll { table {
            thead { tr { th scope="col" { "knob" } th scope="col" { "called for" } th scope="col" { "why" } th scope="col" { "what it approximates" } th scope="col" { "lecture" } } }
            tbody {
                @for knob in &table.knobs {
                    tr.off[!knob.called_for] {
                        th scope="row" { (knob.knob) }
                        td { @if knob.called_for { "yes" } @else { "not called for" } }
                        td { (knob.reason) }
                        td { (knob.about) }
                        td { (knob.lecture.join(", ")) }
                    }
                }
            }
        } }
    }
}

fn search(table: &Table) -> Markup {
    html! {
        div.scroll { table {
            thead { tr { th scope="col" { "change" } th.number scope="col" { "promised FLIP" } th.number scope="col" { "found" } th scope="col" { "kept" } } }
            tbody {
                @for tried in &table.search {
                    tr { th scope="row" { (tried.change) } td.number { (digits(tried.promised)) } td.number { (digits(tried.found)) } td { @if tried.kept { "yes" } @else { "no" } } }
                }
            }
        } }
    }
}

/// A picture, its error, the worst of it and how to draw it.
fn shown(point: &Point, table: &Table, pictures: &Path) -> Result<Markup> {
    let open = |end: &str| read_display(&pictures.join(format!("{}{end}", point.picture)));
    let [picture, error, worst] = [jpeg(&open(".png")?)?, jpeg(&open(".error.png")?)?, jpeg(&open(".worst.png")?)?];
    let e = &point.errors;
    let noise = point.noise.map(|noise| format!(", by chance alone {}", percent(noise.sqrt())));
    Ok(html! {
        article id={ "p-" (point.picture) } data-name=(point.picture) {
            h3 { (point.name) }
            div.three {
                figure { img loading="lazy" src=(picture) alt={ (point.name) ": the picture" }; }
                figure { img loading="lazy" src=(error) alt={ (point.name) ": its error" }; }
                figure { img.pixels loading="lazy" src=(worst) alt="The worst pixel: the reference on the left, the picture on the right"; figcaption { "worst pixel " (e.worst_pixel.x) ", " (e.worst_pixel.y) ": reference, picture" } }
            }
            p.figures {
                span { b { (digits(point.gpu_ms.median)) " ms" } " (" (digits(point.gpu_ms.low)) " to " (digits(point.gpu_ms.high)) ", " (point.timed) " timed)" }
                span { "√relMSE " b { (percent(e.relmse.median.max(0.0).sqrt())) } (noise.unwrap_or_default()) }
                span { "FLIP " b { (digits(e.flip_mean)) } ", 95 of 100 pixels below " (digits(e.flip_p95)) }
                span { "ΔE2000 " b { (digits(e.delta_e_mean)) } }
            }
            p.given { "Given up: " (table.given_up(point)) }
            p { code { (point.command) } }
        }
    })
}

/// For each pixel of `local` the change that brings it nearest to the reference, as a picture with a legend.
fn causes(table: &Table, pictures: &Path) -> Result<Option<Markup>> {
    let Some(local) = table.points.iter().find(|point| point.name == "local") else { return Ok(None) };
    let open = |name: &str| read_display(&pictures.join(format!("{name}.png")));
    let (reference, base) = (open("reference")?, open(&local.picture)?);
    let others: Vec<&Point> = table
        .points
        .iter()
        .filter(|point| matches!(point.family, Family::Local) || point.name == "global samples=4")
        .collect();
    let distance = |a: &[u8; 4], b: &[u8; 4]| (0..3).map(|c| (f64::from(a[c]) - f64::from(b[c])).powi(2)).sum::<f64>();
    let mut best: Vec<(f64, usize)> =
        base.rgba.iter().zip(&reference.rgba).map(|(a, r)| (distance(a, r), usize::MAX)).collect();
    let before: Vec<f64> = best.iter().map(|(d, _)| *d).collect();
    for (index, point) in others.iter().enumerate() {
        let picture = open(&point.picture)?;
        for ((known, pixel), r) in best.iter_mut().zip(&picture.rgba).zip(&reference.rgba) {
            let found = distance(pixel, r);
            if found < known.0 {
                *known = (found, index);
            }
        }
    }
    // Squared error that each change takes away where it is the best.
    let mut gains = vec![0.0; others.len()];
    for ((after, index), before) in best.iter().zip(&before) {
        if let Some(gain) = gains.get_mut(*index) {
            *gain += before - after;
        }
    }
    let total: f64 = before.iter().sum::<f64>().max(1e-9);
    // What takes away less than half a percent has no colour.
    let mut order: Vec<usize> = (0..others.len()).filter(|&i| gains[i] > 0.005 * total).collect();
    order.sort_by(|&a, &b| gains[b].total_cmp(&gains[a]));
    order.truncate(COLOURS.len() - 1);
    let rgba: Vec<u8> = best
        .iter()
        .zip(&before)
        .flat_map(|((after, index), before)| {
            let colour = order.iter().position(|i| i == index).map_or([40; 3], |place| COLOURS[place]);
            // As bright as the share of the pixel's error that goes away.
            let share = if *before > 0.0 { ((before - after) / before).sqrt().max(0.25) } else { 0.0 };
            let [r, g, b] = colour.map(|c| (f64::from(c) * share) as u8);
            [r, g, b, 255]
        })
        .collect();
    let map = embedded("png", &encode_png(base.width, base.height, &rgba, false).context("drawing causes")?);
    let picture = jpeg(&base)?;
    Ok(Some(html! {
        div.pair {
            figure { img src=(picture) alt="The picture of the preset local"; figcaption { "local" } }
            figure { img src=(map) alt="Each pixel in the colour of the change that helps it most"; figcaption { "what would help most" } }
        }
        p.legend {
            @for (place, &index) in order.iter().enumerate() {
                span { i.key style={ "background:" (hex(place)) } {} (others[index].name) ", " (format!("{:.0}", 100.0 * gains[index] / total)) " % of the squared error" }
            }
        }
    }))
}
