//! `report.html`: a page that shows a [`Table`]: first which setting to use and how far to trust it, then everything else.
//!
//! The pictures of the answer are in it; those of every point are beside it in the folder `pictures`, and loaded when they are
//! looked at. Nothing is loaded from anywhere else.

mod answer;
mod chart;
mod pictures;
mod prices;
mod tables;
mod words;

use std::path::Path;

use anyhow::Result;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::reference::NotMeasured;
use super::table::{Family, Point, REFERENCE, Table};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

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
    .replace('-', "−")
}

fn percent(x: f64) -> String {
    format!("{} %", digits(100.0 * x))
}

/// A number of an axis, or one that was chosen: without digits that say nothing.
fn plain(x: f64) -> String {
    let text = digits(x);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// A time in the unit that one would say it in.
fn time(ms: f64) -> String {
    if ms >= 1000.0 { format!("{} s", digits(ms / 1000.0)) } else { format!("{} ms", digits(ms)) }
}

/// An error with its interval.
fn error(point: &Point) -> Markup {
    let e = &point.errors.error;
    html! { b { (percent(e.median)) } " (" (digits(100.0 * e.low)) " to " (digits(100.0 * e.high)) ")" }
}

/// What a point is called on the page.
fn title(point: &Point) -> String {
    match (point.family, point.name.strip_prefix("search: ")) {
        (Family::Search, Some("quickest")) => "the quickest of every knob".to_owned(),
        (Family::Search, Some("exact without waste")) => "exact, less what is wasted".to_owned(),
        (Family::Search, Some(step)) => format!("combination {}", step.trim_start_matches("step ")),
        _ => point.name.clone(),
    }
}

/// Where the page shows a point.
fn anchor(point: &Point) -> String {
    if point.name == REFERENCE { "#trust".to_owned() } else { format!("#p-{}", point.picture) }
}

fn class(family: Family) -> &'static str {
    match family {
        Family::Preset => "preset",
        Family::Local => "local",
        Family::Exact => "exact",
        Family::Search => "search",
    }
}

/// A part of the page that opens when it is asked for.
fn folded(id: &str, name: &str, about: Markup, content: Markup) -> Markup {
    html! {
        details id=(id) {
            summary { h2 { (name) } }
            p { (about) }
            (content)
        }
    }
}

fn head(title: &str) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta name="color-scheme" content="light dark";
            title { (title) }
            style { (PreEscaped(STYLE)) }
        }
    }
}

/// The page; `folder` holds the pictures, and the page lies beside it.
///
/// # Errors
/// When a picture cannot be read.
pub fn page(table: &Table, folder: &Path) -> Result<String> {
    let causes = pictures::causes(table, folder)?;
    let title = format!("What accuracy costs: {}", table.scene);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (head(&title))
            body {
                header {
                    h1 { (title) }
                    p.lead { (answer::lead(table)) }
                }
                main {
                    (answer::settings(table, folder)?)
                    (answer::trust(table))
                    (answer::slider(table, folder)?)
                    section #frontier {
                        h2 { "Error against time" }
                        p {
                            "Each point is a picture. GPU time goes across and "
                            (words::link("error", "error")) " up, both logarithmic. The line joins the "
                            (words::link("frontier", "frontier")) ". Below the broken line nothing can be told: that is the noise of the "
                            (words::link("reference", "reference")) ". Point at a dot, or step through them with Tab."
                        }
                        div.chart-and-card {
                            (chart::errors(table))
                            aside #card { p.quiet { "Point at a dot." } }
                        }
                        (tables::frontier(table))
                    }
                    (prices::matters(table))
                    (folded("prices", "The price of each rung alone", html! {
                        "One " (words::link("rung", "knob")) " changed, all others as in the preset " em { "local" } ", or on the reference's rungs with fewer samples ("
                        em { "exact" } "). Error is what the change adds or takes away; errors add by their squares, so that 1 % less of 3 % leaves 2.8 %. From exact it is the difference of what both pictures converge to. A question mark stands where noise hides it."
                    }, prices::table(table)))
                    (folded("tornado", "Time and visible change of each knob", html! {
                        "To the left the time that a change takes or saves, to the right " (words::link("flip", "FLIP")) " between both pictures. Both scales are linear; bars that are longer than a scale are cut. Pale bars are no more than noise."
                    }, prices::tornado(table)))
                    @if let Some(causes) = causes {
                        (folded("causes", "What would help each pixel most", html! {
                            "The picture of the preset " em { "local" } ", and for each pixel the change of one knob that brings it nearest to the reference. Only changes whose error is told take part. Dark pixels are not brought nearer by any."
                        }, causes))
                    }
                    @if !table.others.is_empty() {
                        (folded("others", "Pictures of other programs", html! {
                            "Held against the same reference. The mean is that of radiance over the reference's, in red, green and blue."
                        }, tables::others(table)))
                    }
                    @if !table.orders.is_empty() {
                        (folded("orders", "Orders of quadrature", html! {
                            "The error of the sum through media that vary, by its steps: rays with one sample, so that no noise is in it, against " em { "simpson" } " with 64 steps; root mean square, as a share of the picture's. Both logarithmic: the slope is the order."
                        }, chart::orders(table)))
                    }
                    (folded("passes", "Where the time goes", html! {
                        "Shares of GPU time of the frontier's pictures by pass. Beside them stands the wall time of a start: uploading, and compiling what no picture before had compiled."
                    }, tables::passes(table)))
                    (folded("knobs", "What the scene calls for", html! {
                        "A knob is called for where some effect that it shapes is planned for this scene. The others change nothing here and are not priced."
                    }, tables::knobs(table)))
                    @if !table.search.is_empty() {
                        (folded("search", "The search for combinations", html! {
                            "Each step takes what single prices promise most of for its time, and is kept if the picture has less error by more than noise. Where the promise was not kept, two knobs do not add up."
                        }, tables::search(table)))
                    }
                    (folded("pictures", "Every picture", html! { "Each with the map of its error and its worst pixel." }, pictures::gallery(table)))
                    (folded("words", "Words", html! { "What the terms of this page mean." }, words::list()))
                    (words::statements(table))
                }
                footer {
                    p {
                        "Etalon " (table.program) ", " (table.points.len()) " pictures, " (format!("{:.0}", table.took_s)) " s of the "
                        (format!("{:.0}", table.budget_s)) " s asked for. The same numbers are in cost.json and cost.csv. Pictures are read from the folder pictures beside this page."
                    }
                }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    Ok(page.into_string())
}

/// The page of a run whose budget was too small for anything.
#[must_use]
pub fn nothing(scene: &str, why: &NotMeasured) -> String {
    let title = format!("What accuracy costs: {scene}");
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (head(&title))
            body { header { h1 { (title) } p.lead { "Nothing was measured: " (why) "." } } }
        }
    };
    page.into_string()
}
