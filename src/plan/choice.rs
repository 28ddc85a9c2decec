//! A rung that a user or a model has chosen.

use std::fmt::{self, Display, Formatter};

/// A knob with one of its rungs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Choice {
    /// Name of the knob.
    pub knob: &'static str,
    /// Name of the rung.
    pub rung: &'static str,
}

impl Display for Choice {
    /// `KNOB=RUNG`.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.knob, self.rung)
    }
}
