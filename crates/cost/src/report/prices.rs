//! What each knob costs and buys, in words, in a table and in bars.

use maud::{Markup, html};

use super::{class, digits, percent, time, words};
use crate::table::{Family, INVISIBLE, Price, Table};

/// Error that a price changes, without a sign.
fn bought(price: &Price) -> f64 {
    price.shown_delta.median.abs().sqrt()
}

/// Changes of `local` that matter most, as a list of at most so many.
const MOST: usize = 6;

fn from_to(price: &Price) -> Markup {
    html! { b { (price.knob) } " " (price.from) " → " (price.to) }
}

/// What matters here and what is wasted here.
pub(super) fn matters(table: &Table) -> Markup {
    let of = |family: Family| table.prices.iter().filter(move |price| price.base == family);
    let nearer = |p: &&Price| p.error_told && p.shown_delta.median < 0.0 && !p.undoes_another();
    let mut better: Vec<&Price> = of(Family::Local).filter(nearer).collect();
    let undoing: Vec<&Price> = of(Family::Local).filter(|p| p.undoes_another()).collect();
    let mut worse: Vec<&Price> = of(Family::Local).filter(|p| p.error_told && p.shown_delta.median > 0.0).collect();
    for list in [&mut better, &mut worse] {
        list.sort_by(|a, b| bought(b).total_cmp(&bought(a)));
        list.truncate(MOST);
    }
    let wasted: Vec<&Price> = table.prices.iter().filter(|price| price.verdict.ends_with("wasted here")).collect();
    let knobs = table.knobs.iter().filter(|knob| knob.called_for);
    let changes_error = |name: &str| better.iter().chain(&worse).chain(&undoing).any(|price| price.knob == name);
    let unseen = knobs.filter(|knob| harmless(table, &knob.knob) && !changes_error(&knob.knob));
    let unseen: Vec<&str> = unseen.map(|knob| knob.knob.as_str()).collect();
    let hidden = table.prices.iter().filter(|p| !p.error_told && !p.same && p.flip_between >= INVISIBLE).count();
    let spent = |price: &Price| {
        html! {
            @if price.takes_longer() { ", for " (time(price.gpu_ms_delta.median)) " more" }
            @else if price.saves() { ", and saves " (time(-price.gpu_ms_delta.median)) }
            @else { ", in about the same time" }
        }
    };
    let error = |name: &str| table.points.iter().find(|point| point.name == name).map(|point| percent(point.error()));
    let changes = |price: &Price| {
        html! { (from_to(price)) ": " @if let (Some(base), Some(now)) = (error("local"), error(&price.point)) { (base) " → " (now) } (spent(price)) @if price.flip_between < INVISIBLE { ", which no eye sees" } }
    };
    html! {
        section #matters {
            h2 { "What matters here" }
            @if better.is_empty() && worse.is_empty() { p { "No change of one knob of " em { "local" } " has an effect on its error that can be told." } }
            @if !better.is_empty() {
                p { "From " (words::link("preset", "local")) ", these lower the " (words::link("error", "error")) ", from that of " em { "local" } " to their own:" }
                ul { @for price in &better { li { (changes(price)) } } }
            }
            @if !worse.is_empty() {
                p { "and these raise it:" }
                ul { @for price in &worse { li { (changes(price)) } } }
            }
            @if !undoing.is_empty() {
                p { "These have less error though they approximate more: what they do wrong cancels something else that " em { "local" } " does wrong. None is recommended." }
                ul { @for price in &undoing { li { (changes(price)) } } }
            }
            h2 { "What is wasted here" }
            @if wasted.is_empty() && unseen.is_empty() { p { "Nothing that was drawn costs time without an effect." } }
            @if !unseen.is_empty() { p { "Nobody sees which rung these knobs are on: " (unseen.join(", ")) "." } }
            @if !wasted.is_empty() {
                ul { @for price in &wasted { li { (from_to(price)) " (" (class(price.base)) ") takes " (time(price.gpu_ms_delta.median)) " more and changes nothing that can be told" } } }
            }
            @if hidden > 0 { p.quiet { "Of " (hidden) " more changes the noise hides whether they help." } }
        }
    }
}

/// Whether it was priced and no rung of it can be seen.
fn harmless(table: &Table, knob: &str) -> bool {
    let mut all = table.prices.iter().filter(|price| price.knob == knob).peekable();
    all.peek().is_some() && all.all(|price| price.same || price.flip_between < INVISIBLE)
}

/// All prices, with a field that leaves out what does not contain a word, and columns that sort.
pub(super) fn table(table: &Table) -> Markup {
    let mut all: Vec<&Price> = table.prices.iter().collect();
    let worth =
        |price: &Price| if price.error_told { bought(price) / price.gpu_ms_delta.median.abs().max(0.05) } else { 0.0 };
    all.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
    html! {
        p { label { "Only rows with " input.filter type="search" data-of="prices-table"; } }
        div.scroll { table.sortable #prices-table {
            thead { tr {
                @for (name, number) in [("knob", false), ("from → to", false), ("others", false), ("time", true), ("of the base's", true), ("error", true), ("FLIP", true), ("in words", false)] {
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

/// Time and visible change of every knob's changes as bars.
pub(super) fn tornado(table: &Table) -> Markup {
    let mut all: Vec<&Price> = table.prices.iter().filter(|price| !price.same).collect();
    all.sort_by(|a, b| b.flip_between.total_cmp(&a.flip_between));
    all.truncate(24);
    // One change that takes forty times as long would leave no room for the others.
    let most_time = all.iter().map(|p| p.share.abs()).fold(1e-3, f64::max).min(2.0);
    let most_seen = all.iter().map(|p| p.flip_between).fold(1e-6, f64::max);
    let part = |value: f64, most: f64| format!("width:{:.1}%", 100.0 * (value.abs() / most).min(1.0));
    html! {
        div.tornado role="img" aria-label="Time and visible change of every change" {
            div.bars-row.quiet { span { "change" } span.bar-left { "time, of the base's; the scale ends at " (format!("{:.0} %", 100.0 * most_time)) } span { "FLIP; the scale ends at " (digits(most_seen)) } }
            @for price in all {
                @let seen = price.is_seen() || price.base == Family::Local;
                div.bars-row {
                    span { (price.knob) "=" (price.to) " (" (class(price.base)) ")" }
                    span.bar-left {
                        small { (format!("{:+.0} %", 100.0 * price.share).replace('-', "−")) }
                        i class=(if price.share < 0.0 { "saves" } else { "takes" }) .noise[!price.time_told] style=(part(price.share, most_time)) {}
                    }
                    span.bar-right { i.seen.noise[!seen] style=(part(price.flip_between, most_seen)) {} small { (digits(price.flip_between)) } }
                }
            }
        }
    }
}
