//! `report.html`: an HTML page of a [`Table`]. It starts with the recommended settings and how far to trust the
//! measurements.
//!
//! The pictures of the recommended settings are embedded. The pictures of all points lie beside the page in the folder
//! `pictures` and are loaded on demand. Nothing is loaded from anywhere else.

mod answer;
mod chart;
mod pictures;
mod prices;
mod tables;
mod words;

use std::path::Path;

use anyhow::Result;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::command::nearest_preset;
use super::reference::NotMeasured;
use super::table::{Family, Point, REFERENCE, Table};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// Colours of causes and passes, from a palette for colour-blind readers (Okabe and Ito 2008).
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

/// A number with three significant digits.
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
    format!("{}\u{a0}%", digits(100.0 * x))
}

/// A number without trailing zeros, for axes and exact values.
fn plain(x: f64) -> String {
    let text = digits(x);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// A time in milliseconds or seconds.
fn time(ms: f64) -> String {
    match ms {
        600_000.0.. => format!("{}\u{a0}min", digits(ms / 60_000.0)),
        1000.0.. => format!("{}\u{a0}s", digits(ms / 1000.0)),
        _ => format!("{}\u{a0}ms", digits(ms)),
    }
}

/// An error with its confidence interval.
fn error(point: &Point) -> Markup {
    let e = &point.errors.error;
    html! { b { (percent(e.median)) } " (" (digits(100.0 * e.low)) " to " (digits(100.0 * e.high)) ")" }
}

/// Title of a point on the page.
fn title(point: &Point) -> String {
    match (point.family, point.name.strip_prefix("search: ")) {
        (Family::Search, Some("quickest")) => "fastest rung of every knob".to_owned(),
        (Family::Search, Some("exact without waste")) => "reference quality, useless rungs off".to_owned(),
        (Family::Search, Some(step)) => {
            let (model, changed) = point.rungs().map(|knobs| nearest_preset(&knobs)).unwrap_or_default();
            let changed: Vec<&str> = changed.iter().map(|option| option.trim_start_matches("--set ")).collect();
            match changed.len() {
                0 => model.to_owned(),
                1 | 2 => format!("{model} with {}", changed.join(" and ")),
                n => format!("combination {} ({model} with {n} knobs changed)", step.trim_start_matches("step ")),
            }
        }
        // `exact` is also a recommended setting.
        _ => match point.name.strip_prefix("exact") {
            Some("") => format!("reference's rungs, {} samples", point.knobs["samples"]),
            Some(changed) => format!("reference's rungs,{changed}"),
            None => point.name.clone(),
        },
    }
}

/// Link to a point on the page.
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

/// A command; lines break between its options.
fn command_text(command: &str) -> Markup {
    let mut parts = command.split(" --");
    html! {
        code {
            (parts.next().unwrap_or_default())
            @for option in parts { " " span.option { "--" (option) } }
        }
    }
}

/// A command with a button that copies it.
fn command_line(command: &str) -> Markup {
    html! { p.command { (command_text(command)) button.copy type="button" { "copy" } } }
}

/// A section of the page that is folded until it is opened.
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

/// The page of a table; `folder` holds the pictures and lies beside the page.
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
                            "Each point is a picture, by GPU time (horizontal) and "
                            (words::link("error", "error")) " (vertical) on logarithmic axes. The line joins the best trade-offs, the "
                            (words::link("frontier", "frontier")) ". Errors below the dashed line are hidden by the noise of the "
                            (words::link("reference", "reference")) ". Hover a point for details, or step through the points with Tab."
                        }
                        div.chart-and-card {
                            (chart::errors(table))
                            aside #card { p.quiet { "Hover a point for details." } }
                        }
                        (tables::frontier(table))
                    }
                    (prices::matters(table))
                    (folded("prices", "Cost of changing one knob", html! {
                        "One " (words::link("rung", "knob")) " is changed; all others are as in the preset " em { "local" } ", or on the reference's rungs with fewer samples ("
                        em { "exact" } "). Error is what the change adds (+) or removes (−). Errors add by their squares: removing 1 % from 3 % leaves 2.8 %. With base exact it is the difference between the limits of both pictures. A question mark means that noise hides the difference."
                    }, prices::table(table)))
                    (folded("tornado", "Time and visible change of each knob", html! {
                        "Left: the time that a change takes or saves. Right: " (words::link("flip", "FLIP")) " between both pictures. Both scales are linear; longer bars are cut. Pale bars may be noise."
                    }, prices::tornado(table)))
                    @if let Some(causes) = causes {
                        (folded("causes", "Most helpful change for each pixel", html! {
                            "The picture of the preset " em { "local" } ", and for each pixel the change of one knob that brings it closest to the reference. Only changes with a significant error take part. No change improves dark pixels."
                        }, causes))
                    }
                    @if !table.others.is_empty() {
                        (folded("others", "Pictures of other programs", html! {
                            "Compared with the same reference. The mean is the mean radiance over that of the reference, in red, green and blue."
                        }, tables::others(table)))
                    }
                    @if !table.orders.is_empty() {
                        (folded("orders", "Order of the quadrature rules", html! {
                            "Error of the integral through heterogeneous media by the number of steps, against " em { "simpson" } " with 64 steps: root mean square, relative to that of the picture. Ray tracing with one sample has no noise here. Both axes are logarithmic, so that the slope is the order."
                        }, chart::orders(table)))
                    }
                    (folded("passes", "GPU time per pass", html! {
                        "GPU time of the frontier's pictures, divided by pass, with the wall time of the start: uploading, and compiling what no earlier picture compiled. The time of a picture is scaled by its base's, those of passes are not."
                    }, tables::passes(table)))
                    (folded("knobs", "Knobs that the scene calls for", html! {
                        "The scene calls for a knob if its plan contains an effect of that knob. The other knobs change nothing here and are not measured."
                    }, tables::knobs(table)))
                    @if !table.search.is_empty() {
                        (folded("search", "The search for combinations", html! {
                            "Each step applies the change with the best predicted gain per millisecond. It is kept if the error falls significantly. Where prediction and measurement differ, two knobs interact. Errors are by the reference as it was then."
                        }, tables::search(table)))
                    }
                    (folded("pictures", "Every picture", html! { "Each with its error map and the place where it differs most." }, pictures::gallery(table)))
                    (folded("words", "Terms", html! { "Meaning of the terms on this page." }, words::list()))
                    (words::statements(table))
                }
                footer {
                    p {
                        "Etalon " (table.program) ", " (table.points.len()) " pictures, " (format!("{:.0}", table.took_s)) " s"
                        @if table.reference_samples.is_none() { " of the " (format!("{:.0}", table.budget_s)) " s budget" } ". The same numbers are in cost.json and cost.csv. Pictures are read from the folder pictures beside this page."
                    }
                }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    Ok(page.into_string())
}

/// The page of a run whose budget was too small to measure anything.
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
