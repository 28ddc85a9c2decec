//! Settings that cannot be followed.

use std::fmt;

/// What a caller chose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Setting {
    /// A rung of a knob: `KNOB=RUNG`.
    Knob,
    /// The picture's pixels.
    Size,
    /// What lies behind the scene.
    Background,
    /// A part of the picture that is kept beside it.
    Part,
    /// The largest error of a picture by paths.
    MaxError,
}

/// A setting that cannot be followed, with the reason: what a caller may match on in an [`anyhow::Error`].
///
/// ```
/// use etalon::plan::{Knobs, Refused, Setting};
/// let error = Knobs::default().set("samples=5").unwrap_err();
/// assert_eq!(error.downcast_ref::<Refused>().unwrap().setting, Setting::Knob);
/// assert!(error.to_string().ends_with("the nearest is 4"));
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refused {
    /// Which.
    pub setting: Setting,
    /// Its value, and what is wrong with it.
    pub why: String,
}

impl Refused {
    /// An error of its own.
    pub(crate) fn error(setting: Setting, why: String) -> anyhow::Error {
        Self { setting, why }.into()
    }
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.setting {
            Setting::Knob => "",
            Setting::Size => "size ",
            Setting::Background => "background ",
            Setting::Part => "part ",
            Setting::MaxError => "largest error ",
        };
        write!(f, "{name}{}", self.why)
    }
}

impl std::error::Error for Refused {}
