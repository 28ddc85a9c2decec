//! First sections of the page: recommended settings, what they simplify, how far to trust the measurements, and a
//! comparison with the reference.

use std::cmp::Ordering;
use std::path::Path;

use anyhow::Result;
use maud::{Markup, html};

use super::pictures::{WORST, embedded, size};
use super::{command_line, command_text, digits, error, percent, plain, time, title, words};
use crate::judge::{DEARER, WORTH};
use crate::loss::{Loss, Simplified};
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

/// The setting `balanced` among the recommended ones.
fn balanced<'a>(all: &[(Vec<&str>, &'a Point)]) -> Option<&'a Point> {
    all.iter().find(|(settings, _)| settings.contains(&"balanced")).map(|(_, point)| *point)
}

/// True when the error of the balanced setting is known, so that it can be recommended.
fn is_decided(table: &Table, balanced: &Point) -> bool {
    table.reference.converged || balanced.name == REFERENCE || balanced.error() > table.reference.resolution
}

/// The recommendation in a sentence.
pub(super) fn lead(table: &Table) -> Markup {
    let all = recommended(table);
    let Some(point) = balanced(&all) else {
        return html! { "No picture is faster than the reference: there is nothing to choose." };
    };
    let r = &table.reference;
    let [lacks, remedy] = r.shortcoming(table.reference_samples.is_some());
    if !is_decided(table, point) {
        return html! {
            "No setting can be recommended yet: the " (words::link("reference", "reference")) " " (lacks) ", and no "
            (words::link("error", "error")) " below " (percent(r.resolution)) " is significant; " (remedy) "."
        };
    }
    let seen = table.prices.iter().any(|price| !price.same && price.flip_between >= crate::table::INVISIBLE);
    html! {
        "Use " b { (title(point)) } ", the balanced setting: a picture takes " (takes(table, point)) (spread(table, point))
        @if table.device.kind == "cpu" { " on the CPU (" (table.device.name) ")" } @else { " on " (table.device.name) }
        " and has an " (words::link("error", "error")) " of " (percent(point.error())) " of the range from black to white"
        @if table.asked.is_some() { " (measured at " (table.size[0]) "×" (table.size[1]) ")" } ". "
        (most_lost(table, point))
        @if r.converged { " The " (words::link("reference", "reference")) " has converged: only errors below " (percent(r.resolution)) " may be noise." }
        @else { " The " (words::link("reference", "reference")) " " (lacks) ": errors below " (percent(r.resolution)) " may be noise." }
        @if !seen { " No knob changes this picture visibly." }
    }
}

/// The recommended settings, side by side.
pub(super) fn settings(table: &Table, folder: &Path) -> Result<Markup> {
    let all = recommended(table);
    let decided = balanced(&all).is_none_or(|point| is_decided(table, point));
    let cards = all
        .into_iter()
        .map(|(settings, point)| {
            let command = at_size(table, point).map_or(&point.command, |(_, at)| &at.command);
            let picture = embedded(&folder.join(format!("{}.png", point.picture)))?;
            let worst = match point.name == REFERENCE {
                true => None,
                false => Some(embedded(&folder.join(format!("{}.worst.png", point.picture)))?),
            };
            Ok(html! {
                article.setting {
                    h3 { (settings.join(" and ")) ": " (title(point)) }
                    @if table.asked.is_some() { p.quiet { "drawn at " (table.size[0]) "×" (table.size[1]) } }
                    img src=(picture) width=(size(table)[0]) height=(size(table)[1]) alt={ "Picture of the setting " (title(point)) };
                    @if let Some(worst) = worst {
                        figure {
                            figcaption { "the place where it differs most, enlarged: the reference on the left, this picture on the right" }
                            img.pixels src=(worst) width=(WORST[0]) height=(WORST[1]) alt="The pixels with the largest difference";
                        }
                    }
                    table.facts { tbody {
                        tr { th scope="row" { (words::link("time", "time")) } td { b { (takes(table, point)) } (spread(table, point)) @if table.asked.is_some() { ", " (time(point.gpu_ms.median)) " at " (table.size[0]) "×" (table.size[1]) } } }
                        tr { th scope="row" { "error" } td { @if point.name == REFERENCE { "noise below " b { (percent(point.error())) } "; the other pictures are compared with the reference" } @else { (error(point)) } } }
                        tr { th scope="row" { "you lose" } td { (lost(table, point)) } }
                    } }
                    @if point.name == REFERENCE && table.reference.rounds.len() > 1 {
                        p.quiet { "It is the mean of " (table.reference.rounds.len()) " pictures, with " (table.reference.samples) " samples of each pixel in all; the time is that of all of them. One picture of about this quality:" }
                    }
                    (command_line(&command.replace(" --repeat 3", "")))
                }
            })
        })
        .collect::<Result<Vec<Markup>>>()?;
    Ok(html! {
        section #settings {
            h2 { @if decided { "Recommended settings" } @else { "Settings so far, none of them recommended" } }
            @if !decided { p { "Their errors are not known well enough to choose by. A longer run may put others in their places." } }
            p { "Each setting is a list of choices, as in refraction=off: a " (words::link("rung", "knob and its rung")) ". " b { "quick" } " is the fastest, or a slower one with far less error for less than twice its time. " b { "balanced" } " has nearly the least error (within " (plain(100.0 * (WORTH - 1.0))) " %) that " (plain(DEARER)) " times the time of quick can buy. " b { "exact" } " has the least error, whatever its time. In parentheses is the error that a more exact choice takes away; these do not add up to the whole." }
            div.settings { @for card in &cards { (card) } }
        }
    })
}

/// Largest number of losses that a card describes; the card folds the others.
const MOST: usize = 4;

/// Simplified knobs of a point whose effect is visible here, with their losses: the largest error first. An error below
/// the reference's resolution is not told beside errors that have to exceed it.
fn visible<'a>(table: &'a Table, point: &'a Point) -> Vec<(Simplified<'a>, Loss)> {
    let told =
        |loss: Loss| Loss { error: if loss.error < table.reference.resolution { 0.0 } else { loss.error }, ..loss };
    let all = table.simplified(point).into_iter();
    let mut all: Vec<_> =
        all.filter_map(|choice| Some((choice, told(choice.loss.filter(|loss| loss.flip > 0.0)?)))).collect();
    all.sort_by(|(_, a), (_, b)| (b.error, b.flip).partial_cmp(&(a.error, a.flip)).unwrap_or(Ordering::Equal));
    all
}

/// Part of a point's squared error that its measured losses add up to.
fn explained(table: &Table, point: &Point) -> f64 {
    let squares: f64 = visible(table, point).iter().map(|(_, loss)| loss.error.powi(2)).sum();
    squares / point.error().powi(2)
}

/// Least part of the squared error of a loss that is called the largest, and of losses that explain an error.
const MOSTLY: f64 = 0.5;

/// The simplification that costs most of a point's accuracy, in a sentence, or that it was not measured.
fn most_lost(table: &Table, point: &Point) -> Markup {
    let (visible, all) = (visible(table, point), table.simplified(point));
    let unknown = all.iter().filter(|choice| choice.loss.is_none()).count();
    let most = visible.first().filter(|(_, loss)| loss.error.powi(2) >= MOSTLY * point.error().powi(2));
    html! {
        @if let Some((choice, loss)) = most { "Most of that error comes from " b { (choice) } (in_parentheses(*loss)) ": " (choice.about()) }
        @else if unknown > 0 && explained(table, point) < MOSTLY {
            "What most of that error comes from is not known: " (unknown) @if unknown == 1 { " simplified knob was" } @else { " simplified knobs were" }
            " not compared with a more exact rung."
        }
        @else if let Some((choice, loss)) = visible.first() { "Of its choices " b { (choice) } (in_parentheses(*loss)) " adds the most error: " (choice.about()) }
        @else { "It loses nothing that is visible here." }
    }
}

/// An error that a more exact rung takes away, in parentheses.
fn in_parentheses(loss: Loss) -> String {
    if loss.error > 0.0 { format!(" ({})", percent(loss.error)) } else { String::new() }
}

/// What a point loses: its visible simplifications in words, and the others folded.
fn lost(table: &Table, point: &Point) -> Markup {
    let visible = visible(table, point);
    let (told, rest) = visible.split_at(visible.len().min(MOST));
    let all = table.simplified(point);
    let is_open = explained(table, point) < MOSTLY;
    let folded = |list: &[Simplified<'_>], what: &str, open: bool| {
        html! {
            @if !list.is_empty() {
                details.more open[open] {
                    summary { (list.len()) " " (what) }
                    @for (i, choice) in list.iter().enumerate() { @if i > 0 { ", " } span title=(choice.about()) { (choice) } }
                }
            }
        }
    };
    let with = |wanted: fn(Option<Loss>) -> bool| {
        all.iter().filter(|choice| wanted(choice.loss)).copied().collect::<Vec<Simplified<'_>>>()
    };
    let rest: Vec<Simplified<'_>> = rest.iter().map(|(choice, _)| *choice).collect();
    html! {
        @if point.name == REFERENCE && table.reference.lacks_bands() { "bands of wavelengths; and it has noise" }
        @else if point.name == REFERENCE { "nothing; it has only noise" }
        @else if all.is_empty() { "nothing" }
        @else if told.is_empty() && all.iter().all(|choice| choice.loss.is_some()) { "nothing that is visible here" }
        @else if told.is_empty() { "not known" }
        @for (choice, loss) in told { p { b { (choice) } (in_parentheses(*loss)) ": " (choice.about()) } }
        (folded(&rest, "more that are visible", false))
        (folded(&with(|loss| loss.is_some_and(|loss| loss.flip == 0.0)), "simplified, not visible here", false))
        (folded(&with(|loss| loss.is_none()), "simplified, not compared with a more exact rung", is_open))
    }
}

/// Command of the report, without its folder, which decides nothing, and without parts, which are joined.
fn report_command(table: &Table) -> String {
    let [from, to] =
        [table.size, table.asked.as_ref().map_or(table.size, |asked| asked.size)].map(|[w, h]| format!("{w}x{h}"));
    let scene = table.command.replacen("etalon render", "etalon cost", 1).replacen(&from, &to, 1);
    let extent = match table.reference_samples {
        Some(samples) => format!("--reference-samples {samples}"),
        None => format!("--budget {:.0}", table.budget_s),
    };
    let seed = if table.seed == 0 { String::new() } else { format!(" --seed {}", table.seed) };
    let others: String = table.others.iter().map(|other| format!(" --judge {}", other.file)).collect();
    format!("{scene} {extent}{seed}{others} -o FOLDER")
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
                    "The " (words::link("reference", "reference")) " has converged: an " (words::link("error", "error")) " of " (percent(r.resolution)) " or more is significant."
                } @else {
                    @let [lacks, remedy] = r.shortcoming(table.reference_samples.is_some());
                    "The " (words::link("reference", "reference")) " " (lacks) ": no " (words::link("error", "error")) " below " (percent(r.resolution)) " is significant. The target is "
                    (plain(100.0 * RESOLVED)) " %; " (remedy) "."
                }
                " The difference between two pictures is known more precisely, because both are compared with the same noisy reference."
                " A question mark marks a difference that may be noise. In at most 1 of 100 runs is any statement of this page "
                "wrong due to noise: intervals are two standard errors wide to each side, but a statement is made only from "
                (digits(table.standard_errors)) " standard errors on, because the page makes some two hundred of them."
            }
            table.facts { tbody {
                tr { th scope="row" { "scene" } td { (table.scene) ", " (table.size[0]) "×" (table.size[1]) } }
                tr { th scope="row" { "device" } td { (table.device.name) " (" (table.device.kind) "), " (table.device.driver) " " (table.device.version) } }
                tr { th scope="row" { "this report" } td { (command_text(&report_command(table))) } }
                tr { th scope="row" { "reference" } td {
                    (r.samples) " samples per pixel" (rounds) ", " (time(r.gpu_ms)) " of GPU time; its noise is " (digits(r.own_flip)) " in " (words::link("flip", "FLIP"))
                } }
                tr { th scope="row" { (if r.rounds.len() > 1 { "first picture" } else { "command" }) } td { (command_text(&r.command)) } }
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
                } } "; right: the reference. Its grain is its own noise, for which errors are corrected." }
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
