//! Errors for settings that cannot be satisfied.

use std::fmt;

/// A kind of setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Setting {
    /// A rung of a knob: `KNOB=RUNG`.
    Knob,
    /// The picture's pixels.
    Size,
    /// The background behind the scene.
    Background,
    /// The blur of an environment behind the scene.
    BackgroundBlur,
    /// A part of the picture that is stored as a layer.
    Part,
    /// The target error of path tracing.
    MaxError,
}

/// A setting that cannot be satisfied, with the reason; callers downcast an [`anyhow::Error`] to this type.
///
/// ```
/// use etalon::plan::{Knobs, Refused, Setting};
/// let error = Knobs::default().set("samples=5").unwrap_err();
/// assert_eq!(error.downcast_ref::<Refused>().unwrap().setting, Setting::Knob);
/// assert!(error.to_string().ends_with("the nearest is 4"));
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refused {
    /// The kind of setting.
    pub setting: Setting,
    /// The setting's value, and the reason of the refusal.
    pub why: String,
}

impl Refused {
    /// A refusal as an [`anyhow::Error`].
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
            Setting::BackgroundBlur => "background blur ",
            Setting::Part => "part ",
            Setting::MaxError => "largest error ",
        };
        write!(f, "{name}{}", self.why)
    }
}

impl std::error::Error for Refused {}
