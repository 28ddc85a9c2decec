//! Effects with the reasons for and against them, decided one by one.
//!
//! Read docs/plan.md. An effect is a feature of rendering that a scene may call for, such as refraction.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};

use serde::Serialize;
use serde::ser::{SerializeStruct as _, Serializer};

use super::choice::Choice;
use super::knobs::rungs::EffectId;

/// The state of an effect in a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EffectState {
    /// The scene calls for the effect, or a caller forces it.
    Kept,
    /// The scene calls for the effect, but a rung switches it off.
    DroppedBy(Choice),
    /// The scene does not call for the effect.
    NotCalledFor,
}

impl EffectState {
    /// The state's name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Kept => "used",
            Self::DroppedBy(_) => "switched off",
            Self::NotCalledFor => "not needed",
        }
    }
}

impl Display for EffectState {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// An effect with its state and reasons.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// The effect.
    pub id: EffectId,
    /// The state.
    pub state: EffectState,
    /// The rung of the knob that decides on the effect, if one does.
    pub choice: Option<Choice>,
    /// The reason why the scene calls for the effect or does not: one sentence for users.
    pub cause: String,
    /// The facts behind the cause.
    pub evidence: Evidence,
    /// Indices of the scene's materials that call for the effect.
    pub materials: Vec<usize>,
}

impl Effect {
    /// The reason of the state: the rung that switches the effect off, otherwise the cause.
    #[must_use]
    pub fn reason(&self) -> String {
        match self.state {
            EffectState::DroppedBy(choice) => choice.to_string(),
            EffectState::Kept | EffectState::NotCalledFor => self.cause.clone(),
        }
    }

    /// The rung of the knob that decides on the effect; empty when no knob does.
    #[must_use]
    pub fn rung(&self) -> &'static str {
        self.choice.map_or("", |choice| choice.rung)
    }
}

impl Serialize for Effect {
    /// The fields of docs/plan.md: `name`, `state`, `rung`, `reason`, `evidence`.
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

/// Facts behind a cause, by name.
pub type Evidence = BTreeMap<&'static str, String>;

/// Effects that are planned although the scene does not call for them. The picture stays the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ForcedEffects {
    /// No forced effect.
    #[default]
    None,
    /// One forced effect.
    One(EffectId),
    /// Every effect that its knob allows.
    All,
}

impl ForcedEffects {
    /// Whether an effect is planned although the scene does not call for it.
    #[must_use]
    pub fn includes(self, effect: EffectId) -> bool {
        match self {
            Self::None => false,
            Self::One(wanted) => wanted == effect,
            Self::All => true,
        }
    }
}

/// Whether this scene calls for an effect, with the reason.
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

    /// A cause for the effect if `called_for`, otherwise a cause against it.
    pub(super) fn when(called_for: bool, of: impl Into<String>, against: &str) -> Self {
        if called_for { Self::of(of) } else { Self::against(against) }
    }

    pub(super) fn with(mut self, name: &'static str, value: impl ToString) -> Self {
        self.evidence.insert(name, value.to_string());
        self
    }

    /// Adds evidence unless `values` is empty.
    pub(super) fn with_some(self, name: &'static str, values: &[String]) -> Self {
        if values.is_empty() { self } else { self.with(name, values.join(", ")) }
    }
}

/// A knob's rung, and whether it allows an effect.
#[derive(Clone, Copy)]
pub(super) struct Verdict {
    choice: Choice,
    allowed: bool,
}

impl Choice {
    /// The verdict of this rung on an effect.
    pub(super) fn allows(self, allowed: bool) -> Verdict {
        Verdict { choice: self, allowed }
    }
}

/// Decides effects in order and records them.
pub(super) struct Decisions {
    pub(super) forced: ForcedEffects,
    pub(super) effects: Vec<Effect>,
}

impl Decisions {
    /// Decides an effect that depends on the scene only.
    pub(super) fn decide(&mut self, effect: EffectId, cause: Cause) -> bool {
        self.decide_as(effect, None, cause, self.forced)
    }

    /// Decides an effect that a knob allows or forbids; if it forbids, its rung is the reason.
    pub(super) fn decide_with(&mut self, effect: EffectId, knob: Verdict, cause: Cause) -> bool {
        self.decide_as(effect, Some(knob), cause, self.forced)
    }

    /// Decides an effect that a knob may forbid; `None` when no knob does.
    pub(super) fn decide_unless(&mut self, effect: EffectId, knob: Option<Verdict>, cause: Cause) -> bool {
        self.decide_as(effect, knob, cause, self.forced)
    }

    /// Decides an effect that cannot be forced: even without a cause it would change roundings of the picture.
    pub(super) fn decide_apart(&mut self, effect: EffectId, knob: Verdict, cause: Cause) -> bool {
        self.decide_as(effect, Some(knob), cause, ForcedEffects::None)
    }

    fn decide_as(&mut self, id: EffectId, knob: Option<Verdict>, cause: Cause, forced: ForcedEffects) -> bool {
        let Cause { called_for, reason, evidence, materials } = cause;
        let is_forced = !called_for && forced.includes(id);
        let state = match (called_for || is_forced, knob) {
            (false, _) => EffectState::NotCalledFor,
            (true, Some(Verdict { choice, allowed: false })) => EffectState::DroppedBy(choice),
            (true, _) => EffectState::Kept,
        };
        let cause = if is_forced { format!("asked for, although {reason}") } else { reason };
        let choice = knob.map(|knob| knob.choice);
        self.effects.push(Effect { id, state, choice, cause, evidence, materials });
        state == EffectState::Kept
    }
}
