//! Headings of the groups of options in help texts. Options without one are about the command itself.

pub(super) const SCENE: &str = "Scene";
pub(super) const CAMERA: &str = "Camera";
pub(super) const LIGHT: &str = "Environment and background";
pub(super) const PICTURE: &str = "Picture";
pub(super) const QUALITY: &str = "Quality and time";
pub(super) const OUTPUT: &str = "Output";
pub(super) const SEQUENCE: &str = "Sequences and shards";
pub(super) const SWEEP: &str = "Extent of the measurements";
pub(super) const COMPARISON: &str = "Comparisons";
pub(super) const DEVICE: &str = "Device";
#[cfg(feature = "window")]
pub(super) const WINDOW: &str = "Window";
pub(super) const MESSAGES: &str = "Messages";
