//! Terms where they stand: links to what they mean, and the lecture's statements behind rungs.

use std::collections::BTreeSet;

use maud::{Markup, html};

use crate::table::Table;
use etalon::lecture::statement;

/// Name on the page, term, and meaning.
const WORDS: [(&str, &str, &str); 9] = [
    (
        "error",
        "error",
        "How far a picture is from the truth: the root mean squared difference of displayed values, in percent of their range from black to white. 1 % is two and a half of the 256 steps of a display. The truth is what the reference converges to; its noise is measured out of the number, and the interval says how well that went (two standard errors).",
    ),
    (
        "reference",
        "reference",
        "The scene drawn along paths with every knob on the rung that approximates least, and as many samples as there was time for. Its own noise hides differences that are smaller than a number which the page gives.",
    ),
    (
        "frontier",
        "frontier",
        "The pictures that nothing beats in time and error at once (Pareto's). Each has less error than every quicker one by more than noise.",
    ),
    (
        "rung",
        "knob and rung",
        "A knob is one choice of how accurately something is computed, such as shadows; its rungs go from cheap to exact. --set KNOB=RUNG chooses one.",
    ),
    (
        "preset",
        "local, recursive, global",
        "Presets of all knobs: light from lights alone; with ideal mirrors and glass by rays; along paths, with light from surfaces too.",
    ),
    (
        "exact",
        "exact",
        "The reference's rungs with few samples: what is changed of it shows what a rung is worth where all else is right.",
    ),
    (
        "flip",
        "FLIP",
        "What an eye sees when it flips between two pictures on a display, from 0 to 1 (Andersson et al. 2020). Nobody sees less than 0.002. Noise of either picture counts as a difference.",
    ),
    (
        "relmse",
        "√relMSE",
        "Root of the mean squared error of radiance, each pixel over its own square plus 0.01. A few pixels that are far too bright can make it large.",
    ),
    ("delta-e", "ΔE2000", "CIEDE2000, the distance of two displayed colours; 1 is about what can just be seen."),
];

/// A term that leads to what it means.
pub(super) fn link(id: &str, text: &str) -> Markup {
    let meaning = WORDS.iter().find(|(known, ..)| *known == id).map_or("", |(_, _, meaning)| meaning);
    html! { a.term href={ "#w-" (id) } title=(meaning) { (text) } }
}

/// What all of them mean.
pub(super) fn list() -> Markup {
    html! {
        dl { @for (id, term, meaning) in WORDS { dt id={ "w-" (id) } { (term) } dd { (meaning) } } }
    }
}

/// An id of the lecture, which leads to what it says.
pub(super) fn lecture(id: &str) -> Markup {
    html! { a href={ "#s-" (id) } title=(statement(id).unwrap_or_default()) { (id) } }
}

/// What the lecture says under the ids that knobs of this scene name.
pub(super) fn statements(table: &Table) -> Markup {
    let ids: BTreeSet<&String> = table.knobs.iter().flat_map(|knob| &knob.lecture).collect();
    let list = html! {
        dl { @for id in ids { dt id={ "s-" (id) } { (id) } dd { (statement(id).unwrap_or_default().replace("**", "")) } } }
    };
    super::folded(
        "statements",
        "The lecture's statements",
        html! { "What the knobs approximate; the same ids are in the shaders and in docs/lecture.md." },
        list,
    )
}
