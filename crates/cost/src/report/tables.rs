//! Tables and bar charts of the page.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::{COLOURS, anchor, digits, error, hex, percent, time, title, words};
use crate::table::{Point, REFERENCE, Table};

/// Table of the frontier with the simplified knobs of each point.
pub(super) fn frontier(table: &Table) -> Markup {
    html! {
        div.scroll { table {
            caption { "The frontier, from fastest to most exact" }
            thead { tr { th scope="col" { "picture" } th.number scope="col" { "time" } th.number scope="col" { "error" } th scope="col" { "simplified" } } }
            tbody {
                @for p in table.frontier.iter().filter_map(|&i| table.points.get(i)) {
                    tr {
                        th scope="row" { a href=(anchor(p)) { (title(p)) } }
                        td.number { (time(p.gpu_ms.median)) }
                        td.number { @if p.name == REFERENCE { "below " (percent(p.error())) } @else { (error(p)) } }
                        td.knobs { (table.given_up(p)) }
                    }
                }
            }
        } }
    }
}

/// Bar chart of GPU time per pass for the points of the frontier.
pub(super) fn passes(table: &Table) -> Markup {
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
        div.bars {
            @for point in &points {
                @let all: f64 = point.passes.iter().map(|(_, ms)| ms).sum();
                @let start = point.start_ms / (point.start_ms + point.gpu_ms.median).max(1e-9);
                div.bar-row {
                    span.bar-name { (title(point)) }
                    span.bar-track role="img" aria-label=(point.passes.iter().map(|(name, ms)| format!("{name} {} ms", digits(*ms))).collect::<Vec<_>>().join(", ")) {
                        @for (name, ms) in &point.passes {
                            i style={ "width:" (format!("{:.2}", 100.0 * ms / all.max(1e-9))) "%;background:" (hex(place(name))) } title={ (name) " " (digits(*ms)) " ms" } {}
                        }
                    }
                    span.bar-value { (time(point.gpu_ms.median)) ", start " (time(point.start_ms)) " (" (format!("{:.0}", 100.0 * start)) " %)" }
                }
            }
        }
        p.legend {
            @for name in &names { span { i.key style={ "background:" (hex(place(name))) } {} (name) } }
            span { i.key style={ "background:" (hex(COLOURS.len() - 1)) } {} "others" }
        }
    }
}

/// Table of the knobs, with whether the scene calls for them and why.
pub(super) fn knobs(table: &Table) -> Markup {
    html! {
        div.scroll { table {
            thead { tr { th scope="col" { "knob" } th scope="col" { "called for" } th scope="col" { "why" } th scope="col" { "what it approximates" } th scope="col" { "lecture" } } }
            tbody {
                @for knob in &table.knobs {
                    tr.off[!knob.called_for] {
                        th scope="row" { (knob.knob) }
                        td { @if knob.called_for { "yes" } @else { "not needed" } }
                        td { (knob.reason) }
                        td { (knob.about) }
                        td { @for id in &knob.lecture { (words::lecture(id)) " " } }
                    }
                }
            }
        } }
    }
}

/// Table of the steps of the search.
pub(super) fn search(table: &Table) -> Markup {
    html! {
        div.scroll { table {
            thead { tr { th scope="col" { "change" } th.number scope="col" { "predicted error" } th.number scope="col" { "measured" } th scope="col" { "kept" } } }
            tbody {
                @for tried in &table.search {
                    tr { th scope="row" { (tried.change) } td.number { (percent(tried.promised)) } td.number { (percent(tried.found)) } td { @if tried.kept { "yes" } @else { "no" } } }
                }
            }
        } }
    }
}

/// Table of pictures of other programs.
pub(super) fn others(table: &Table) -> Markup {
    html! {
        div.scroll { table {
            thead { tr { th scope="col" { "file" } th.number scope="col" { "error" } th.number scope="col" { "FLIP" } th.number scope="col" { "ΔE2000" } th.number scope="col" { "mean" } } }
            tbody {
                @for other in &table.others {
                    @let e = &other.errors;
                    tr {
                        th scope="row" { (other.file) }
                        td.number { (percent(e.error.median)) " (" (digits(100.0 * e.error.low)) " to " (digits(100.0 * e.error.high)) ")" }
                        td.number { (digits(e.flip_mean)) }
                        td.number { (digits(e.delta_e_mean)) }
                        td.number { @if let Some(ratio) = other.mean_ratio { (ratio.map(|r| format!("{r:.4}")).join(", ")) } @else { "–" } }
                    }
                }
            }
        } }
    }
}
