//! Glossary of the page: links from terms to their definitions, and the lecture's statements about knobs.

use std::collections::BTreeSet;

use maud::{Markup, html};

use crate::table::Table;
use etalon::lecture::{functions, statement};

/// Id, term and definition.
const WORDS: [(&str, &str, &str); 10] = [
    (
        "error",
        "error",
        "Root mean squared difference between the displayed values of a picture and of the exact picture, in percent of their range from black to white. 1 % is two and a half of the 256 steps of a display. The exact picture is the limit of the reference. The estimate is corrected for the noise of the reference; the interval is the 95 % confidence interval (two standard errors).",
    ),
    (
        "time",
        "time",
        "GPU time of a picture: the median of several renders, each timed between renders of a base picture, whose times even out how fast the machine was. The range goes from the fastest to the slowest that the machine was during the run. Loading, uploading and compiling are not in it.",
    ),
    (
        "reference",
        "reference",
        "The scene drawn by path tracing with every knob on its most exact rung, and with as many samples as there was time for. Its noise hides small differences; the page gives the limit.",
    ),
    (
        "frontier",
        "frontier",
        "Pareto frontier: the pictures that no other picture beats in time and error at once. Each has significantly less error than every faster one.",
    ),
    (
        "rung",
        "knob and rung",
        "A knob is a choice between approximations of one quantity, such as shadows. Its rungs go from cheap to exact. --set KNOB=RUNG chooses one.",
    ),
    (
        "preset",
        "local, recursive, global",
        "Presets of all knobs. local: light of lamps with shadow maps, and the environment's as if nothing were in its way. recursive: adds ray-traced shadows, reflections and refraction. global: path tracing with full indirect light.",
    ),
    (
        "exact",
        "exact",
        "The reference's rungs with few samples. A change relative to exact shows the effect of a rung when everything else is right.",
    ),
    (
        "flip",
        "FLIP",
        "Perceived difference when one flips between two pictures on a display, from 0 to 1 (Andersson et al. 2020). Below 0.002 a difference is invisible. Noise of either picture counts as a difference.",
    ),
    (
        "relmse",
        "√relMSE",
        "Root of the relative mean squared error of radiance: each squared error is divided by the squared radiance of the reference plus 0.01. A few fireflies can make it large.",
    ),
    ("delta-e", "ΔE2000", "CIEDE2000, the difference of two displayed colours; about 1 is just noticeable."),
];

/// A link from a term to its definition.
pub(super) fn link(id: &str, text: &str) -> Markup {
    let meaning = WORDS.iter().find(|(known, ..)| *known == id).map_or("", |(_, _, meaning)| meaning);
    html! { a.term href={ "#w-" (id) } title=(meaning) { (text) } }
}

/// List of all definitions.
pub(super) fn list() -> Markup {
    html! {
        dl { @for (id, term, meaning) in WORDS { dt id={ "w-" (id) } { (term) } dd { (meaning) } } }
    }
}

/// A link from an id of the lecture to its statement.
pub(super) fn lecture(id: &str) -> Markup {
    html! { a href={ "#s-" (id) } title=(statement(id).unwrap_or_default()) { (id) } }
}

/// The lecture's statements about the knobs.
pub(super) fn statements(table: &Table) -> Markup {
    let ids: BTreeSet<&String> = table.knobs.iter().flat_map(|knob| &knob.lecture).collect();
    let list = html! {
        dl { @for id in ids { dt id={ "s-" (id) } { (id) } dd {
            (statement(id).unwrap_or_default().replace("**", ""))
            @let computed = functions(id);
            @if !computed.is_empty() { " Computed by " @for (i, name) in computed.iter().enumerate() { @if i > 0 { ", " } code { (name) } } "." }
        } } }
    };
    super::folded(
        "statements",
        "The lecture's statements",
        html! { "Statements that the knobs approximate. The shaders and docs/lecture.md use the same ids. docs/equations.md describes the functions, and " code { "etalon eval NAME" } " evaluates one." },
        list,
    )
}
