//! Errors that a caller may want to match on.

use super::choice::DeviceChoice;

/// Why no device was opened: what a caller may look for in an [`anyhow::Error`].
///
/// ```
/// use etalon_vulkan::{Device, DeviceChoice, NotOpened};
/// let error = Device::open(&DeviceChoice::Name("no such device".into()), false).err().unwrap();
/// assert!(error.downcast_ref::<NotOpened>().is_some(), "{error}");
/// ```
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotOpened {
    /// The loader's library is not there, or does not load.
    #[error("no Vulkan loader: {0}")]
    NoLoader(String),
    /// The loader has not what a window needs.
    #[error("the Vulkan loader cannot show windows here: it lacks {0}")]
    NoWindows(String),
    /// Validation was asked for.
    #[error("validation needs the Khronos validation layer")]
    NoValidation,
    /// There is a loader, and no driver.
    #[error("Vulkan offers no device here")]
    NoDevice,
    /// None of the devices is the one that was asked for.
    #[error("asked for {choice}, Vulkan offers {}", .offered.join(", "))]
    NoneLike {
        /// What was asked for.
        choice: DeviceChoice,
        /// Names of the devices, quoted.
        offered: Vec<String>,
    },
    /// The best device that was asked for cannot draw.
    #[error("device \"{device}\" ({driver}) lacks {}", .missing.join(", "))]
    Lacks {
        /// Its name.
        device: String,
        /// Its driver.
        driver: String,
        /// Features, extensions, limits.
        missing: Vec<String>,
    },
    /// The process has another device under validation.
    #[error(
        "this process has device \"{device}\" under validation already, as {has}: the layer cannot hold {wanted} beside it"
    )]
    Validated {
        /// Its name.
        device: String,
        /// The kind of the device that is open.
        has: String,
        /// The kind that the caller requested.
        wanted: String,
    },
}

/// Something is larger than the device can hold or bind; a smaller scene or picture may fit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{what}: the device {limit}")]
pub struct TooLarge {
    /// What was being made, with its size.
    pub what: String,
    /// What the device allows.
    pub limit: String,
}
