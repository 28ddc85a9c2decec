//! First sections of the page: recommended settings, what they simplify, how far to trust the measurements, and a
//! comparison with the reference.

use std::path::Path;

use anyhow::Result;
use maud::{Markup, html};

use super::pictures::{embedded, size};
use super::{digits, error, percent, plain, time, title, words};
use crate::statistics::Interval;
use crate::table::{AtSize, Point, REFERENCE, RESOLVED, Recommended, Table};

/// Time of a recommended point at the requested size, in words.
fn at_size<'a>(table: &'a Table, point: &Point) -> Option<(String, &'a AtSize)> {
    let asked = table.asked.as_ref()?;
    let place =
        table.recommended.iter().position(|r| table.points.get(r.point).is_some_and(|p| p.name == point.name))?;
    let at = asked.settings.get(place)?;
    let about = if at.measured { "" } else { "about " };
    Some((format!("{about}{} at {}×{}", time(at.gpu_ms.median), asked.size[0], asked.size[1]), at))
}

/// Time of a point, at the requested size if known.
fn takes(table: &Table, point: &Point) -> String {
    at_size(table, point).map_or_else(|| time(point.gpu_ms.median), |(words, _)| words)
}

/// Shortest and longest time of a point, at the requested size if known.
fn spread(table: &Table, point: &Point) -> String {
    let Interval { low, high, .. } = at_size(table, point).map_or(point.gpu_ms, |(_, at)| at.gpu_ms);
    if high > low { format!(" ({} to {})", time(low), time(high)) } else { String::new() }
}

/// Recommended points, each with all settings (`quick`, `balanced`, `exact`) that it is recommended for.
fn recommended(table: &Table) -> Vec<(Vec<&str>, &Point)> {
    let mut all: Vec<(Vec<&str>, &Point)> = Vec::new();
    for Recommended { setting, point } in &table.recommended {
        let Some(point) = table.points.get(*point) else { continue };
        match all.iter_mut().find(|(_, known)| known.name == point.name) {
            Some((settings, _)) => settings.push(setting),
            None => all.push((vec![setting], point)),
        }
    }
    all
}

/// The recommendation in a sentence.
pub(super) fn lead(table: &Table) -> Markup {
    let all = recommended(table);
    let balanced = all.iter().find(|(settings, _)| settings.contains(&"balanced"));
    let Some((_, point)) = balanced else {
        return html! { "No picture is faster than the reference: there is nothing to choose." };
    };
    let seen = table.prices.iter().any(|price| !price.same && price.flip_between >= crate::table::INVISIBLE);
    html! {
        "Use " b { (title(point)) } ": a picture takes " (takes(table, point)) " on this device and has an " (words::link("error", "error"))
        " of " (percent(point.error())) " of the range from black to white."
        @if !table.reference.converged {
            " The " (words::link("reference", "reference")) " is still noisy: do not trust differences below " (percent(table.reference.resolution)) "."
        }
        @if !seen { " No knob changes this picture visibly." }
    }
}

/// The recommended settings, side by side.
pub(super) fn settings(table: &Table, folder: &Path) -> Result<Markup> {
    let cards = recommended(table)
        .into_iter()
        .map(|(settings, point)| {
            let command = at_size(table, point).map_or(&point.command, |(_, at)| &at.command);
            let picture = embedded(&folder.join(format!("{}.png", point.picture)))?;
            Ok(html! {
                article.setting {
                    h3 { (settings.join(" and ")) ": " (title(point)) }
                    img src=(picture) width=(size(table)[0]) height=(size(table)[1]) alt={ "Picture of the setting " (title(point)) };
                    table.facts { tbody {
                        tr { th scope="row" { "time" } td { b { (takes(table, point)) } (spread(table, point)) @if table.asked.is_some() { ", " (time(point.gpu_ms.median)) " at " (table.size[0]) "×" (table.size[1]) } } }
                        tr { th scope="row" { "error" } td { @if point.name == REFERENCE { "noise below " b { (percent(point.error())) } "; the other pictures are compared with the reference" } @else { (error(point)) } } }
                        tr { th scope="row" { "simplified" } td { (given_up(table, point)) } }
                    } }
                    @if point.name == REFERENCE && table.reference.rounds.len() > 1 { p.quiet { "A picture of about this quality:" } }
                    p.command { code { (command.replace(" --repeat 3", "")) } button.copy type="button" { "copy" } }
                }
            })
        })
        .collect::<Result<Vec<Markup>>>()?;
    Ok(html! {
        section #settings {
            h2 { "Recommended settings" }
            div.settings { @for card in &cards { (card) } }
        }
    })
}

/// Simplified knobs of a point: the first four, and the rest folded; each with a description of its knob as a tooltip.
fn given_up(table: &Table, point: &Point) -> Markup {
    let all = table.given_up(point);
    let list: Vec<&str> = all.split(", ").collect();
    let [first, rest] = [&list[..list.len().min(4)], &list[list.len().min(4)..]];
    let about = |choice: &str| {
        let name = choice.split('=').next().unwrap_or_default();
        table.knobs.iter().find(|knob| knob.knob == name).map_or("", |knob| knob.about.as_str())
    };
    let choices = |list: &[&str]| {
        html! {
            @for (i, choice) in list.iter().enumerate() { @if i > 0 { ", " } span title=(about(choice)) { (choice) } }
        }
    };
    html! {
        (choices(first))
        @if !rest.is_empty() { details.more { summary { "and " (rest.len()) " more" } (choices(rest)) } }
    }
}

/// Quality of the reference, device and warnings.
pub(super) fn trust(table: &Table) -> Markup {
    let r = &table.reference;
    let rounds = if r.rounds.len() > 1 { format!(", the mean of {} pictures", r.rounds.len()) } else { String::new() };
    html! {
        section #trust {
            h2 { "How far to trust it" }
            p.verdict.good[r.converged].poor[!r.converged] {
                @if r.converged {
                    "The " (words::link("reference", "reference")) " has converged: an " (words::link("error", "error")) " of " (percent(r.resolution)) " or more is significant. The difference between two pictures is known more precisely, because both are compared with the same noisy reference."
                } @else {
                    "The " (words::link("reference", "reference")) " is still noisy: do not trust differences below " (percent(r.resolution)) ". The target is "
                    (plain(100.0 * RESOLVED)) " %. Run the same command again to improve this reference."
                }
                " A question mark marks a difference that may be noise. In at most 1 of 100 runs is any statement of this page "
                "wrong due to noise (each is at least " (digits(table.standard_errors)) " standard errors from zero)."
            }
            table.facts { tbody {
                tr { th scope="row" { "scene" } td { (table.scene) ", " (table.size[0]) "×" (table.size[1]) } }
                tr { th scope="row" { "device" } td { (table.device.name) " (" (table.device.kind) "), " (table.device.driver) " " (table.device.version) } }
                tr { th scope="row" { "reference" } td {
                    (r.samples) " samples per pixel" (rounds) ", " (time(r.gpu_ms)) " of GPU time; its noise is " (digits(r.own_flip)) " in " (words::link("flip", "FLIP"))
                } }
                tr { th scope="row" { (if r.rounds.len() > 1 { "first picture" } else { "command" }) } td { code { (r.command) } } }
            } }
            @if !table.warnings.is_empty() {
                ul.warnings { @for warning in &table.warnings { li { (warning) } } }
            }
        }
    }
}

/// A picture over the reference with a movable dividing line.
pub(super) fn slider(table: &Table, folder: &Path) -> Result<Markup> {
    let reference = embedded(&folder.join("reference.png"))?;
    let all = recommended(table);
    let [width, height] = size(table);
    Ok(html! {
        section #compare {
            h2 { "Comparison with the reference" }
            @if !all.is_empty() {
                p { label { "Left: " select #left {
                    @for (settings, point) in &all { option value=(format!("pictures/{}.png", point.picture)) { (settings.join(" and ")) ": " (title(point)) } }
                    @for point in table.points.iter().filter(|point| point.picture != "reference" && all.iter().all(|(_, known)| known.name != point.name)) {
                        option value=(format!("pictures/{}.png", point.picture)) { (title(point)) }
                    }
                } } "; right: the reference." }
            }
            div.slider style="--at:50%" {
                img src=(reference) width=(width) height=(height) alt="The reference";
                @if let Some((_, point)) = all.first() {
                    img.over src=(format!("pictures/{}.png", point.picture)) width=(width) height=(height) alt="The chosen picture";
                    input type="range" min="0" max="100" value="50" aria-label="Position of the line between the chosen picture and the reference";
                }
            }
        }
    })
}
