//! Parts of a picture: its light by what first happened to it, on the way back from the eye.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use crate::gpu::{Buffer, Device, Image, ImageDesc, Place};
use crate::plan::rungs::{Reflection, Refraction};
use crate::plan::{Knobs, Plan, Refused, Setting};

/// Light that rays bring to the surface that a pixel shows. A picture is the sum of both parts and of what that surface
/// itself emits, scatters and takes from the prefiltered environment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// By rays that the surface, or its coat, mirrored first.
    Reflection = 1,
    /// By rays that went through it first, bent or straight on.
    Refraction = 2,
}

impl Part {
    /// The name of its layer, and of the knob that sends its rays.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Reflection => "reflection",
            Self::Refraction => "refraction",
        }
    }

    /// Whether the plan sends any rays that may begin in this way.
    #[must_use]
    pub fn called_for(self, plan: &Plan) -> bool {
        // Inside a body its own boundary is mirrored by rays, whatever the rung for mirrors.
        plan.rays.is_some_and(|rays| rays.refraction || (self == Self::Reflection && rays.mirrors))
    }
}

/// A part on the device.
pub struct PartOnDevice {
    /// Which one.
    pub part: Part,
    /// Of the sample drawn last.
    pub radiance: Image,
    /// A copy for the rung `screen` of `refraction`; next to nothing with another one.
    pub seen: Buffer,
    /// The mean of the samples, where there is more than one.
    pub film: Option<Image>,
}

impl PartOnDevice {
    /// Images of `size` pixels.
    ///
    /// # Errors
    /// When no ray makes this part under the chosen rungs, or memory is short.
    pub fn new(device: &Arc<Device>, plan: &Plan, knobs: &Knobs, part: Part, size: [u32; 2]) -> Result<Self> {
        let name = part.name();
        if plan.paths.is_some() {
            let why = format!(
                "{name}: this layer is what single rays bring, and indirect=path follows paths instead; choose indirect=ambient \
                 and lights=points"
            );
            return Err(Refused::error(Setting::Part, why));
        }
        let (choice, sends) = match part {
            Part::Reflection => (knobs.reflection.choice(), knobs.reflection == Reflection::Ray),
            Part::Refraction => (knobs.refraction.choice(), knobs.refraction == Refraction::Ray),
        };
        if !sends {
            let why = format!("{name}: this layer is what rays bring, and {choice} sends none; choose {name}=ray");
            return Err(Refused::error(Setting::Part, why));
        }
        let target = |what: &str| {
            let usage = vk::ImageUsageFlags::STORAGE;
            let desc = ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, size[0], size[1], usage);
            Image::new(device, &format!("{what} of the part {name}"), desc)
        };
        let seen = if plan.screen.refraction { 16 * u64::from(size[0]) * u64::from(size[1]) } else { 0 };
        Ok(Self {
            part,
            radiance: target("radiance")?,
            seen: Buffer::new(device, "part on the screen", seen, Place::Device)?,
            film: if plan.samples > 1 || plan.bands > 0 { Some(target("film")?) } else { None },
        })
    }

    /// The mean of the samples.
    #[must_use]
    pub fn film(&self) -> &Image {
        self.film.as_ref().unwrap_or(&self.radiance)
    }
}
