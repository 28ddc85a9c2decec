//! The architecture that passes are written for: CPUs and GPUs run different forms of the same equations.
//!
//! Read docs/decisions/architectures.md.

use serde::Serialize;

/// The kind of device that the passes are written for. On lavapipe both forms draw the same film, bit by bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Architecture {
    /// Few threads, each with long vectors and one contiguous piece of a dispatch: two paths per invocation, selections
    /// instead of branches, no stack in traversal.
    #[default]
    Cpu,
    /// Thousands of invocations that share registers and caches: one path or ray tree per invocation, kernels for rays
    /// and kernels for surfaces, traversal with branches and a short stack in shared memory, neighbouring tiles in
    /// neighbouring workgroups.
    Gpu,
}

impl Architecture {
    /// The name of such devices.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "CPUs",
            Self::Gpu => "GPUs",
        }
    }

    /// The architecture of a device.
    #[must_use]
    pub fn of(is_software: bool) -> Self {
        if is_software { Self::Cpu } else { Self::Gpu }
    }
}
