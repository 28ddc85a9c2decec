//! Errors that a caller may match on.

use super::choice::DeviceChoice;

/// The reasons why no device was opened; callers downcast an [`anyhow::Error`] to this type.
///
/// ```
/// use etalon_vulkan::{Device, DeviceChoice, NotOpened};
/// let error = Device::open(&DeviceChoice::Name("no such device".into()), false).err().unwrap();
/// assert!(error.downcast_ref::<NotOpened>().is_some(), "{error}");
/// ```
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotOpened {
    /// The loader's library is missing, or does not load.
    #[error("no Vulkan loader: {0}")]
    NoLoader(String),
    /// The loader lacks an instance extension that the window needs.
    #[error("the Vulkan loader cannot show windows here: it lacks {0}")]
    NoWindows(String),
    /// Validation was requested, and the layer is not installed.
    #[error("validation needs the Khronos validation layer")]
    NoValidation,
    /// There is a loader, but no driver.
    #[error("Vulkan offers no device here")]
    NoDevice,
    /// No device matches the choice.
    #[error("asked for {choice}, Vulkan offers {}", .offered.join(", "))]
    NoneLike {
        /// The requested device.
        choice: DeviceChoice,
        /// Names of the present devices, quoted.
        offered: Vec<String>,
    },
    /// The best matching device lacks something that Etalon requires.
    #[error("device \"{device}\" ({driver}) lacks {}", .missing.join(", "))]
    Lacks {
        /// Name of the device.
        device: String,
        /// Driver of the device.
        driver: String,
        /// Missing features, extensions and limits.
        missing: Vec<String>,
    },
    /// The process has another device under validation (`open.rs`).
    #[error(
        "this process has device \"{device}\" under validation already, as {has}: the layer cannot hold {wanted} beside it"
    )]
    Validated {
        /// Name of the open device.
        device: String,
        /// Kind of the open device.
        has: String,
        /// Kind of the requested device.
        wanted: String,
    },
}

/// A resource exceeds a limit of the device; a smaller scene or picture may fit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{what}: the device {limit}")]
pub struct TooLarge {
    /// The resource with its size.
    pub what: String,
    /// The limit of the device.
    pub limit: String,
}
