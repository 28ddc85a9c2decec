//! Charts as SVG: error against GPU time with the Pareto frontier, and convergence of the quadrature rules.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::{anchor, class, digits, percent, plain, time, title};
use crate::table::{Family, QuadratureOrder, Table};

/// Width and height of the charts in SVG units.
const CHART: [f64; 2] = [760.0, 420.0];
/// Margins for labels: left, right, top, bottom.
const MARGIN: [f64; 4] = [64.0, 16.0, 32.0, 44.0];
/// Approximate width of a letter and height of a line.
const LETTER: [f64; 2] = [6.6, 14.0];

/// A logarithmic axis.
struct ChartAxis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl ChartAxis {
    /// An axis that contains some numbers above 0.
    fn around(values: impl Iterator<Item = f64> + Clone, from: f64, to: f64) -> Self {
        let high = values.clone().fold(1e-9, f64::max);
        let low = values.fold(high, f64::min).max(1e-9);
        Self { low: low / 1.4, high: high * 1.4, from, to }
    }

    /// Position of a value; values outside are clamped.
    fn at(&self, value: f64) -> f64 {
        let part = (value.clamp(self.low, self.high) / self.low).ln() / (self.high / self.low).ln();
        self.from + part * (self.to - self.from)
    }

    /// Ticks at 1, 2 and 5 times powers of ten, fewer on long axes.
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

/// Chart of error against time of every picture.
pub(super) fn errors(table: &Table) -> Markup {
    let [width, height] = CHART;
    let [left, right, top, bottom] = MARGIN;
    let visible = || table.points.iter().filter(|p| p.error() > 0.0 && p.gpu_ms.median > 0.0);
    let x = ChartAxis::around(visible().map(|p| p.gpu_ms.median), left, width - right);
    let y = ChartAxis::around(visible().map(|p| p.error()), height - bottom, top);
    let place = |i: usize| [x.at(table.points[i].gpu_ms.median), y.at(table.points[i].error())];
    let line: Vec<String> = table.frontier.iter().map(|&i| place(i)).map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    let own = y.at(table.reference.resolution);
    html! {
        svg.chart viewBox=(format!("0 0 {width} {height}")) role="group" aria-label="Error against GPU time" {
            @for tick in x.ticks() {
                line.grid x1=(x.at(tick)) x2=(x.at(tick)) y1=(top) y2=(height - bottom) {}
                text.tick x=(x.at(tick)) y=(height - bottom + 16.0) text-anchor="middle" { @if tick < 1000.0 { (plain(tick)) " ms" } @else { (plain(tick / 1000.0)) " s" } }
            }
            @for tick in y.ticks() {
                line.grid x1=(left) x2=(width - right) y1=(y.at(tick)) y2=(y.at(tick)) {}
                text.tick x=(left - 8.0) y=(y.at(tick) + 4.0) text-anchor="end" { (plain(100.0 * tick)) " %" }
            }
            text.axis x=((left + width - right) * 0.5) y=(height - 8.0) text-anchor="middle" { "GPU time of a picture, logarithmic" }
            text.axis x="8" y="20" { "error in percent of the range, logarithmic" }
            line.own x1=(left) x2=(width - right) y1=(own) y2=(own) {}
            polyline.pareto points=(line.join(" ")) {}
            @for (index, p) in table.points.iter().enumerate() {
                @let on = table.frontier.contains(&index);
                @let [cx, cy] = place(index);
                line.bar x1=(x.at(p.gpu_ms.low)) x2=(x.at(p.gpu_ms.high)) y1=(cy) y2=(cy) {}
                line.bar x1=(cx) x2=(cx) y1=(y.at(p.errors.error.low)) y2=(y.at(p.errors.error.high)) {}
                a.point href=(anchor(p)) data-point=(p.picture) {
                    title { (title(p)) ": " (time(p.gpu_ms.median)) ", error " (percent(p.error())) }
                    circle class={ (class(p.family)) @if on { " on" } } cx=(cx) cy=(cy) r=(if on { 6.0 } else { 4.0 }) {}
                    // An invisible larger circle for touch screens.
                    circle.touch cx=(cx) cy=(cy) r="11" {}
                }
            }
            @for (i, [x, y], anchor) in labels(table, &place) {
                text.label x=(x) y=(y) text-anchor=(anchor) { (title(&table.points[i])) }
            }
        }
        p.legend {
            @for (family, name) in [(Family::Preset, "presets"), (Family::Local, "local, one knob changed"), (Family::Exact, "exact, one knob changed"), (Family::Search, "combinations")] {
                span { svg.dot viewBox="0 0 12 12" aria-hidden="true" { circle class=(class(family)) cx="6" cy="6" r="5" {} } (name) }
            }
        }
    }
}

/// Positions of the labels of the frontier's points, beside, above or below a point. A label that would overlap a
/// point, the line or another label is left out.
fn labels(table: &Table, place: &dyn Fn(usize) -> [f64; 2]) -> Vec<(usize, [f64; 2], &'static str)> {
    let mut boxes: Vec<[f64; 4]> =
        (0..table.points.len()).map(place).map(|[x, y]| [x - 5.0, x + 5.0, y - 5.0, y + 5.0]).collect();
    // Boxes along the line of the frontier.
    for pair in table.frontier.windows(2) {
        let [[ax, ay], [bx, by]] = [place(pair[0]), place(pair[1])];
        let pieces = ((bx - ax).hypot(by - ay) / 4.0).ceil().max(1.0);
        boxes.extend((0..=pieces as usize).map(|k| {
            let part = k as f64 / pieces;
            let [x, y] = [ax + part * (bx - ax), ay + part * (by - ay)];
            [x - 2.0, x + 2.0, y - 2.0, y + 2.0]
        }));
    }
    let mut placed = Vec::new();
    for &i in &table.frontier {
        let ([x, y], wide) = (place(i), LETTER[0] * title(&table.points[i]).chars().count() as f64);
        let free = |[from, to, above, below]: [f64; 4], boxes: &[[f64; 4]]| {
            from > MARGIN[0]
                && to < CHART[0] - MARGIN[1]
                && above > MARGIN[2] - LETTER[1]
                && below < CHART[1] - MARGIN[3]
                && boxes.iter().all(|b| to < b[0] || b[1] < from || below < b[2] || b[3] < above)
        };
        let places = [
            [8.0, -9.0],
            [10.0, 4.0],
            [8.0, 19.0],
            [-8.0, -9.0],
            [-10.0, 4.0],
            [-8.0, 19.0],
            [8.0, -24.0],
            [-8.0, 34.0],
        ];
        let found = places.into_iter().find_map(|[dx, dy]| {
            let (at, anchor) = ([x + dx, y + dy], if dx > 0.0 { "start" } else { "end" });
            let from = if dx > 0.0 { at[0] } else { at[0] - wide };
            let all = [from, from + wide, at[1] - LETTER[1] + 3.0, at[1] + 3.0];
            free(all, &boxes).then_some((at, anchor, all))
        });
        if let Some((at, anchor, all)) = found {
            boxes.push(all);
            placed.push((i, at, anchor));
        }
    }
    placed
}

/// Chart and table of the convergence of the quadrature rules.
pub(super) fn orders(table: &Table) -> Markup {
    let ([width, height], [left, right, top, bottom]) = (CHART, MARGIN);
    let all = || table.orders.iter().flat_map(|order| order.errors.iter().copied().filter(|error| *error > 0.0));
    let steps = || table.orders.iter().flat_map(|order| order.steps.iter().map(|&n| f64::from(n)));
    let (x, y) = (ChartAxis::around(steps(), left, width - right), ChartAxis::around(all(), height - bottom, top));
    let told: BTreeSet<u32> = table.orders.iter().flat_map(|order| order.steps.iter().copied()).collect();
    let place = |order: &QuadratureOrder, i: usize| [x.at(f64::from(order.steps[i])), y.at(order.errors[i])];
    let line = |order: &QuadratureOrder| -> String {
        let points: Vec<_> = (0..order.steps.len()).map(|i| place(order, i)).collect();
        points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect::<Vec<_>>().join(" ")
    };
    let name = |order: &QuadratureOrder| order.order.map_or_else(String::new, |p| format!(", order {p:.1}"));
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
            text.axis x=((left + width - right) * 0.5) y=(height - 8.0) text-anchor="middle" { "steps per segment" }
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
