//! Effects with the reasons for and against them, decided one by one.

use std::collections::BTreeMap;

use serde::Serialize;

use super::Knobs;

/// One effect, kept or not, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// What it is.
    pub name: &'static str,
    /// `kept`, `dropped` (a knob says so) or `not called for` (the scene does).
    pub state: &'static str,
    /// The rung of its knob.
    pub rung: &'static str,
    /// One sentence.
    pub reason: String,
    /// What the reason rests on.
    pub evidence: Evidence,
    /// The materials that call for it, as indices of the scene's.
    #[serde(skip)]
    pub materials: Vec<usize>,
}

/// What a reason rests on, by name.
pub type Evidence = BTreeMap<&'static str, String>;

/// What is planned beside that which the scene calls for. The picture stays the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Demand {
    /// Nothing.
    #[default]
    Scene,
    /// One effect, by its name.
    With(&'static str),
    /// Every effect that its knob allows.
    Full,
}

impl Demand {
    /// Whether an effect is planned even if the scene does not call for it.
    #[must_use]
    pub fn includes(self, effect: &str) -> bool {
        match self {
            Self::Scene => false,
            Self::With(name) => name == effect,
            Self::Full => true,
        }
    }
}

/// What speaks for an effect, or against it, in this scene.
#[derive(Clone)]
pub(super) struct Cause {
    pub(super) called_for: bool,
    pub(super) reason: String,
    pub(super) evidence: Evidence,
    pub(super) materials: Vec<usize>,
}

impl Cause {
    pub(super) fn against(reason: impl Into<String>) -> Self {
        Self { called_for: false, reason: reason.into(), evidence: Evidence::new(), materials: Vec::new() }
    }

    pub(super) fn of(reason: impl Into<String>) -> Self {
        Self { called_for: true, reason: reason.into(), evidence: Evidence::new(), materials: Vec::new() }
    }

    /// For it if `called_for`, with the one reason or the other.
    pub(super) fn when(called_for: bool, of: impl Into<String>, against: &str) -> Self {
        if called_for { Self::of(of) } else { Self::against(against) }
    }

    pub(super) fn with(mut self, name: &'static str, value: impl ToString) -> Self {
        self.evidence.insert(name, value.to_string());
        self
    }

    /// Evidence where there is any.
    pub(super) fn with_some(self, name: &'static str, values: &[String]) -> Self {
        if values.is_empty() { self } else { self.with(name, values.join(", ")) }
    }
}

/// Decides effects in order and keeps the account.
pub(super) struct Decisions<'a> {
    pub(super) knobs: &'a Knobs,
    pub(super) demand: Demand,
    pub(super) effects: Vec<Effect>,
}

impl Decisions<'_> {
    /// An effect that only the scene decides on.
    pub(super) fn decide(&mut self, name: &'static str, cause: Cause) -> bool {
        self.decide_with(name, "", true, cause)
    }

    /// An effect whose place paths take, where they do; else one that a knob allows or not, or that only the scene decides on.
    pub(super) fn decide_without(
        &mut self,
        paths: bool,
        name: &'static str,
        (knob, allowed): (&'static str, bool),
        cause: Cause,
    ) -> bool {
        let (knob, allowed) = if paths { ("indirect", false) } else { (knob, allowed) };
        self.decide_with(name, knob, allowed, cause)
    }

    /// An effect that a knob allows or not: if not, its rung is the reason.
    pub(super) fn decide_with(&mut self, name: &'static str, knob: &'static str, allowed: bool, cause: Cause) -> bool {
        self.decide_as(name, (knob, allowed), cause, self.demand)
    }

    /// The same of one that no demand includes: even where nothing calls for it, it is a picture with other roundings.
    pub(super) fn decide_apart(&mut self, name: &'static str, by: (&'static str, bool), cause: Cause) -> bool {
        self.decide_as(name, by, cause, Demand::Scene)
    }

    fn decide_as(
        &mut self,
        name: &'static str,
        (knob, allowed): (&'static str, bool),
        cause: Cause,
        demand: Demand,
    ) -> bool {
        let rung = if knob.is_empty() { "" } else { self.knobs.rung(knob) };
        let Cause { called_for, mut reason, evidence, materials } = cause;
        let demanded = !called_for && demand.includes(name);
        let state = match (called_for || demanded, allowed) {
            (false, _) => "not called for",
            (true, false) => "dropped",
            (true, true) => "kept",
        };
        if state == "dropped" {
            reason = format!("{knob}={rung}");
        } else if demanded {
            reason = format!("asked for, although {reason}");
        }
        self.effects.push(Effect { name, state, rung, reason, evidence, materials });
        state == "kept"
    }
}
