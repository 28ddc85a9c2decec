//! Costs of changing one knob: in words, as a table, and as a tornado chart.

use maud::{Markup, html};

use super::{class, digits, percent, time, words};
use crate::table::{Family, INVISIBLE, Price, Table};

/// Error that a change adds or removes, without sign.
fn bought(price: &Price) -> f64 {
    price.shown_delta.median.abs().sqrt()
}

/// Largest number of changes in a list.
const MOST: usize = 6;
/// Least fraction of the largest effect that counts as nearly the same.
const NEARLY: f64 = 0.95;

fn from_to(price: &Price) -> Markup {
    html! { b { (price.knob) } " " (price.from) " → " (price.to) }
}

/// For each knob of a list that begins with the largest effect, the cheapest change with nearly its effect.
fn cheapest_of_each_knob<'a>(list: &[&'a Price]) -> Vec<&'a Price> {
    let mut all: Vec<&Price> = Vec::new();
    for most in list {
        if all.iter().any(|price| price.knob == most.knob) {
            continue;
        }
        let nearly = list.iter().filter(|price| price.knob == most.knob && bought(price) >= NEARLY * bought(most));
        all.extend(nearly.min_by(|a, b| a.gpu_ms_delta.median.total_cmp(&b.gpu_ms_delta.median)));
    }
    all
}

/// Sections about the changes that matter and about useless rungs.
pub(super) fn matters(table: &Table) -> Markup {
    let of = |family: Family| table.prices.iter().filter(move |price| price.base == family);
    let nearer = |p: &&Price| p.error_told && p.shown_delta.median < 0.0 && !p.undoes_another();
    let mut better: Vec<&Price> = of(Family::Local).filter(nearer).collect();
    let undoing: Vec<&Price> = of(Family::Local).filter(|p| p.undoes_another()).collect();
    let mut worse: Vec<&Price> = of(Family::Local).filter(|p| p.error_told && p.shown_delta.median > 0.0).collect();
    for list in [&mut better, &mut worse] {
        list.sort_by(|a, b| bought(b).total_cmp(&bought(a)));
        *list = cheapest_of_each_knob(list);
        list.truncate(MOST);
    }
    let wasted: Vec<&Price> = table.prices.iter().filter(|price| price.is_wasted()).collect();
    let knobs = table.knobs.iter().filter(|knob| knob.called_for);
    let changes_error = |name: &str| better.iter().chain(&worse).chain(&undoing).any(|price| price.knob == name);
    let unseen = knobs.filter(|knob| harmless(table, &knob.knob) && !changes_error(&knob.knob));
    let (unseen, unseen_in_local): (Vec<&str>, Vec<&str>) =
        unseen.map(|knob| knob.knob.as_str()).partition(|knob| of(Family::Exact).any(|price| price.knob == *knob));
    let hidden = table.prices.iter().filter(|p| !p.error_told && !p.same && p.flip_between >= INVISIBLE).count();
    let spent = |price: &Price| {
        html! {
            @if price.takes_longer() { ", takes " (time(price.gpu_ms_delta.median)) " more" }
            @else if price.saves() { ", saves " (time(-price.gpu_ms_delta.median)) }
            @else { ", no measurable time difference" }
        }
    };
    let error = |name: &str| {
        table.points.iter().find(|point| point.name == name).map(|point| format!("{:.2} %", 100.0 * point.error()))
    };
    let changes = |price: &Price| {
        html! { (from_to(price)) ": " @if let (Some(base), Some(now)) = (error("local"), error(&price.point)) { (base) " → " (now) } (spent(price)) @if price.shown_delta.median > 0.0 && price.to_more_exact() { ", although it is more exact: " (price.from) " cancels another error" } @if price.flip_between < INVISIBLE { ", not visible" } }
    };
    html! {
        section #matters {
            h2 { "Changes that matter here" }
            @if better.is_empty() && worse.is_empty() { p { "No change of one knob of " em { "local" } " has a significant effect on the error." } }
            @if !better.is_empty() {
                p { "Relative to " (words::link("preset", "local")) ", these changes lower the " (words::link("error", "error")) " (of " em { "local" } " → with the change); of each knob the cheapest rung with nearly the largest effect:" }
                ul { @for price in &better { li { (changes(price)) } } }
            }
            @if !worse.is_empty() {
                p { "These changes raise the error:" }
                ul { @for price in &worse { li { (changes(price)) } } }
            }
            @if !undoing.is_empty() {
                p { "These changes lower the error although they approximate more: their error cancels another error of " em { "local" } ". They are not recommended." }
                ul { @for price in &undoing { li { (changes(price)) } } }
            }
            h2 { "Useless here" }
            @if wasted.is_empty() && unseen.is_empty() && unseen_in_local.is_empty() { p { "No measured rung costs time without an effect." } }
            @if !unseen.is_empty() { p { "No visible effect here: " (unseen.join(", ")) "." } }
            @if !unseen_in_local.is_empty() { p { "No visible effect in " em { "local" } ", and not measured with the reference's rungs: " (unseen_in_local.join(", ")) "." } }
            @if !wasted.is_empty() {
                ul { @for price in &wasted { li { (from_to(price)) " (" (class(price.base)) ") takes " (time(price.gpu_ms_delta.median)) " more without a measurable change" } } }
            }
            @if hidden > 0 { p.quiet { "For " (hidden) " more changes, noise hides whether they help." } }
        }
    }
}

/// Whether the knob was measured and no rung of it makes a visible difference.
fn harmless(table: &Table, knob: &str) -> bool {
    let mut all = table.prices.iter().filter(|price| price.knob == knob).peekable();
    all.peek().is_some() && all.all(|price| price.same || price.flip_between < INVISIBLE)
}

/// Table of all changes, with a filter field and sortable columns.
pub(super) fn table(table: &Table) -> Markup {
    let mut all: Vec<&Price> = table.prices.iter().collect();
    let worth =
        |price: &Price| if price.error_told { bought(price) / price.gpu_ms_delta.median.abs().max(0.05) } else { 0.0 };
    all.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
    html! {
        p { label { "Filter rows: " input.filter type="search" data-of="prices-table"; } }
        div.scroll { table.sortable #prices-table {
            thead { tr {
                @for (name, number) in [("knob", false), ("from → to", false), ("base", false), ("time", true), ("time %", true), ("error", true), ("FLIP", true), ("verdict", false)] {
                    th scope="col" class=(if number { "number" } else { "" }) { button type="button" { (name) } }
                }
            } }
            tbody {
                @for price in all {
                    @let sign = if price.shown_delta.median < 0.0 { "−" } else { "+" };
                    @let told = price.error_told && !price.same;
                    tr {
                        th scope="row" { (price.knob) }
                        td { a href={ "#p-" (point_of(table, price)) } { (price.from) " → " (price.to) } }
                        td { (class(price.base)) }
                        td.number data-value=(price.gpu_ms_delta.median) { @if price.time_told { (signed(price.gpu_ms_delta.median)) } @else { "0?" } }
                        td.number data-value=(price.share) { @if price.time_told { (format!("{:+.0} %", 100.0 * price.share).replace('-', "−")) } @else { "–" } }
                        td.number data-value=(if told { price.shown_delta.median } else { 0.0 }) { @if price.same { "0" } @else if told { (sign) (percent(bought(price))) } @else { "?" } }
                        td.number data-value=(price.flip_between) { (digits(price.flip_between)) }
                        td { (price.verdict) }
                    }
                }
            }
        } }
    }
}

fn signed(ms: f64) -> String {
    format!("{}{}", if ms < 0.0 { "−" } else { "+" }, time(ms.abs()))
}

fn point_of<'a>(table: &'a Table, price: &Price) -> &'a str {
    table.points.iter().find(|point| point.name == price.point).map_or("", |point| &point.picture)
}

/// Tornado chart: time and visible change of each change as bars.
pub(super) fn tornado(table: &Table) -> Markup {
    let mut all: Vec<&Price> = table.prices.iter().filter(|price| !price.same).collect();
    all.sort_by(|a, b| b.flip_between.total_cmp(&a.flip_between));
    all.truncate(24);
    // Limit the scale: one change that takes forty times as long would leave no room for the others.
    let most_time = all.iter().map(|p| p.share.abs()).fold(1e-3, f64::max).min(2.0);
    let most_seen = all.iter().map(|p| p.flip_between).fold(1e-6, f64::max);
    let part = |value: f64, most: f64| format!("width:{:.1}%", 100.0 * (value.abs() / most).min(1.0));
    html! {
        div.tornado role="img" aria-label="Time and visible change of every change" {
            div.bars-row.quiet { span { "change" } span.bar-left { "time relative to the base; scale ends at " (format!("{:.0} %", 100.0 * most_time)) } span { "FLIP; scale ends at " (digits(most_seen)) } }
            @for price in all {
                @let seen = price.is_seen() || price.base == Family::Local;
                div.bars-row {
                    span { (price.knob) "=" (price.to) " (" (class(price.base)) ")" }
                    span.bar-left {
                        small { (format!("{:+.0} %", 100.0 * price.share).replace('-', "−")) }
                        i class=(if price.share < 0.0 { "saves" } else { "takes" }) .noise[!price.time_told] style=(part(price.share, most_time)) {}
                    }
                    span.bar-right {
                        i.seen.noise[!seen] style=(part(price.flip_between, most_seen)) {}
                        small { (digits(price.flip_between)) }
                    }
                }
            }
        }
    }
}
