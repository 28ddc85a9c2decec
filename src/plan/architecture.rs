//! The architecture that passes are written for: CPUs and GPUs run different forms of the same equations.
//!
//! Read docs/decisions/architectures.md.

use serde::Serialize;

/// The kind of device that the passes are written for. Both forms draw the same film, bit by bit, on any one device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Architecture {
    /// Few threads, each with long vectors and one contiguous piece of a dispatch: two paths per invocation, selections
    /// instead of branches, no stack in traversal.
    #[default]
    Cpu,
    /// Thousands of invocations that share registers and caches: one path per invocation, kernels that either traverse
    /// or shade, traversal with branches and a stack in shared memory, neighbouring tiles in neighbouring workgroups.
    Gpu,
}
