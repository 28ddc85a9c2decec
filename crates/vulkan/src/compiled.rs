//! Statistics of compiled pipelines from the driver's compiler: registers, spills, code size.
//!
//! Read the Vulkan documentation of `VK_KHR_pipeline_executable_properties`. RADV of Mesa 25.0 has the extension,
//! lavapipe of 22.3 has not. Names and units of the figures are the driver's own.

use std::collections::BTreeMap;

use anyhow::{Context as _, Result};
use ash::vk;
use serde::{Deserialize, Serialize};

use super::device::{Device, lock, text};
use super::shader::Program;

/// Statistics of one executable of a pipeline, as a rule one shader stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Compiled {
    /// The driver's name of the executable.
    pub stage: String,
    /// Statistics by name.
    pub figures: BTreeMap<String, f64>,
}

/// What an executable takes of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Footprint {
    /// Vector registers of an invocation.
    pub registers: u64,
    /// Vector registers of a subgroup that the compiler keeps in memory for want of registers (spills).
    pub spilled: u64,
    /// Bytes of memory of a subgroup: arrays of the shader, and spills.
    pub scratch_bytes: u64,
    /// Bytes of shared memory of a workgroup.
    pub shared_bytes: u64,
    /// Bytes of machine code.
    pub code_bytes: u64,
    /// Subgroups that a SIMD unit runs at once (occupancy).
    pub subgroups: u64,
}

impl Compiled {
    /// The footprint, by the names that RADV gives its statistics; `None` for another driver's.
    #[must_use]
    pub fn footprint(&self) -> Option<Footprint> {
        let figure = |name: &str| self.figures.get(name).map(|&figure| figure as u64);
        Some(Footprint {
            registers: figure("VGPRs")?,
            spilled: figure("Spilled VGPRs")?,
            scratch_bytes: figure("Scratch size")?,
            shared_bytes: figure("LDS size")?,
            code_bytes: figure("Code size")?,
            subgroups: figure("Subgroups per SIMD")?,
        })
    }
}

/// A statistic as a number; `true` is 1.
fn number(figure: &vk::PipelineExecutableStatisticKHR<'_>) -> f64 {
    use vk::PipelineExecutableStatisticFormatKHR as Format;
    // SAFETY: the format says which field the driver has written.
    unsafe {
        match figure.format {
            Format::BOOL32 => f64::from(figure.value.b32),
            Format::INT64 => figure.value.i64 as f64,
            Format::UINT64 => figure.value.u64 as f64,
            _ => figure.value.f64,
        }
    }
}

impl Device {
    /// Whether the driver reports statistics of compiled pipelines.
    #[must_use]
    pub fn tells_compiled(&self) -> bool {
        self.executables.is_some()
    }

    /// Statistics of a program with these specialization constants, of each pipeline: raster programs have one for each
    /// set of attachments. Empty when the driver reports none, or when no pipeline exists yet.
    ///
    /// # Errors
    /// When memory is short.
    pub fn compiled(&self, program: &'static Program, constants: &[(u32, u32)]) -> Result<Vec<Compiled>> {
        let Some(asked) = &self.executables else { return Ok(Vec::new()) };
        let known = lock(&self.caches);
        let of = |key: &super::cache::PipelineKey| key.program.name == program.name && key.constants == constants;
        let asking = || format!("asking what \"{}\" was compiled to", program.name);
        let mut all = Vec::new();
        for (_, &pipeline) in known.pipelines.iter().filter(|(key, _)| of(key)) {
            // SAFETY: the pipeline lives as long as its cache, which is locked; it was created with `capture`'s flags.
            let stages = unsafe {
                asked
                    .get_pipeline_executable_properties(&vk::PipelineInfoKHR::default().pipeline(pipeline))
                    .with_context(asking)?
            };
            for (index, stage) in stages.iter().enumerate() {
                let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline).executable_index(index as u32);
                // SAFETY: as above; the driver has just named this many executables.
                let figures = unsafe { asked.get_pipeline_executable_statistics(&info) }.with_context(asking)?;
                let figures = figures.iter().map(|f| (text(f.name_as_c_str()), number(f))).collect();
                all.push(Compiled { stage: text(stage.name_as_c_str()), figures });
            }
        }
        Ok(all)
    }

    /// Flags of pipelines whose statistics will be queried.
    pub(super) fn capture(&self) -> vk::PipelineCreateFlags {
        match self.executables {
            Some(_) => vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR,
            None => vk::PipelineCreateFlags::empty(),
        }
    }
}
