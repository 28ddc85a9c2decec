//! The plan: the effects that a scene calls for, with reasons, before any Vulkan object exists. Pure and printable.
//!
//! Read docs/plan.md; docs/glossary.md defines knob, rung, effect and plan.
//!
//! ```text
//! planner ─► left_out ─► surfaces ─► facts ─► effect ─► choice, effect_id
//!    │                       │                  ▲              ▲
//!    └───────────────────────┴──► work ─────────┴─► knobs ─────┘
//!                                 └─► architecture
//! ```

mod ability;
mod architecture;
mod choice;
mod effect;
mod facts;
mod knobs;
mod left_out;
mod planner;
mod refused;
mod surfaces;
mod work;

pub use ability::Ability;
pub use architecture::Architecture;
pub use choice::Choice;
pub use effect::{Effect, EffectState, Evidence, ForcedEffects};
pub use facts::{Facts, Surroundings};
pub use knobs::rungs::{self, EffectId, Normals};
pub use knobs::{KNOBS, Knob, Knobs, Model};
pub use planner::needs_lights;
pub use refused::{Refused, Setting};
pub use surfaces::{casts_in_maps, is_transparent, mirrors};
pub use work::{Attenuation, FEWER_AT_HITS, LightSamples, March, Paths, Plan, Rays, Screen, Stored};
