//! Effects with the reasons for and against them, decided one by one.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};

use serde::Serialize;
use serde::ser::{SerializeStruct as _, Serializer};

use super::choice::Choice;
use super::knobs::rungs::EffectId;

/// What became of an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EffectState {
    /// The scene calls for it, or somebody has asked for it.
    Kept,
    /// The scene calls for it, and a rung leaves it out.
    DroppedBy(Choice),
    /// The scene does without.
    NotCalledFor,
}

impl EffectState {
    /// As reports call it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Kept => "kept",
            Self::DroppedBy(_) => "dropped",
            Self::NotCalledFor => "not called for",
        }
    }
}

impl Display for EffectState {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// One effect, kept or not, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// Which one.
    pub id: EffectId,
    /// What became of it.
    pub state: EffectState,
    /// The rung of the knob that decides on it, where one does.
    pub choice: Option<Choice>,
    /// What in the scene calls for it, or does not: one sentence, for people.
    pub cause: String,
    /// What that rests on.
    pub evidence: Evidence,
    /// The materials that call for it, as indices of the scene's.
    pub materials: Vec<usize>,
}

impl Effect {
    /// Why it is kept or not: the rung that drops it, else the cause.
    #[must_use]
    pub fn reason(&self) -> String {
        match self.state {
            EffectState::DroppedBy(choice) => choice.to_string(),
            EffectState::Kept | EffectState::NotCalledFor => self.cause.clone(),
        }
    }

    /// The rung of its knob; empty where none decides on it.
    #[must_use]
    pub fn rung(&self) -> &'static str {
        self.choice.map_or("", |choice| choice.rung)
    }
}

impl Serialize for Effect {
    /// As docs/plan.md has it: `name`, `state`, `rung`, `reason`, `evidence`.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut effect = serializer.serialize_struct("Effect", 5)?;
        effect.serialize_field("name", self.id.name())?;
        effect.serialize_field("state", self.state.name())?;
        effect.serialize_field("rung", self.rung())?;
        effect.serialize_field("reason", &self.reason())?;
        effect.serialize_field("evidence", &self.evidence)?;
        effect.end()
    }
}

/// What a reason rests on, by name.
pub type Evidence = BTreeMap<&'static str, String>;

/// What is planned beside that which the scene calls for. The picture stays the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Demand {
    /// Nothing.
    #[default]
    Scene,
    /// One effect.
    With(EffectId),
    /// Every effect that its knob allows.
    Full,
}

impl Demand {
    /// Whether an effect is planned even if the scene does not call for it.
    #[must_use]
    pub fn includes(self, effect: EffectId) -> bool {
        match self {
            Self::Scene => false,
            Self::With(wanted) => wanted == effect,
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

/// What a knob says of an effect.
#[derive(Clone, Copy)]
pub(super) struct Verdict {
    choice: Choice,
    allowed: bool,
}

impl Choice {
    /// This rung allows an effect, or does not.
    pub(super) fn allows(self, allowed: bool) -> Verdict {
        Verdict { choice: self, allowed }
    }
}

/// Decides effects in order and keeps the account.
pub(super) struct Decisions {
    pub(super) demand: Demand,
    pub(super) effects: Vec<Effect>,
}

impl Decisions {
    /// An effect that only the scene decides on.
    pub(super) fn decide(&mut self, effect: EffectId, cause: Cause) -> bool {
        self.decide_as(effect, None, cause, self.demand)
    }

    /// An effect that a knob allows or not: if not, its rung is the reason.
    pub(super) fn decide_with(&mut self, effect: EffectId, knob: Verdict, cause: Cause) -> bool {
        self.decide_as(effect, Some(knob), cause, self.demand)
    }

    /// An effect that a knob may say no to, if any knob.
    pub(super) fn decide_unless(&mut self, effect: EffectId, knob: Option<Verdict>, cause: Cause) -> bool {
        self.decide_as(effect, knob, cause, self.demand)
    }

    /// The same of one that no demand includes: even where nothing calls for it, it is a picture with other roundings.
    pub(super) fn decide_apart(&mut self, effect: EffectId, knob: Verdict, cause: Cause) -> bool {
        self.decide_as(effect, Some(knob), cause, Demand::Scene)
    }

    fn decide_as(&mut self, id: EffectId, knob: Option<Verdict>, cause: Cause, demand: Demand) -> bool {
        let Cause { called_for, reason, evidence, materials } = cause;
        let demanded = !called_for && demand.includes(id);
        let state = match (called_for || demanded, knob) {
            (false, _) => EffectState::NotCalledFor,
            (true, Some(Verdict { choice, allowed: false })) => EffectState::DroppedBy(choice),
            (true, _) => EffectState::Kept,
        };
        let cause = if demanded { format!("asked for, although {reason}") } else { reason };
        let choice = knob.map(|knob| knob.choice);
        self.effects.push(Effect { id, state, choice, cause, evidence, materials });
        state == EffectState::Kept
    }
}
