//! Parts of a picture as layers: light by its first interaction, counted from the eye.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use crate::gpu::{Buffer, Device, Image, ImageDesc, Place};
use crate::plan::rungs::{Reflection, Refraction};
use crate::plan::{Knobs, Plan, Refused, Setting};

/// Light that rays bring to a pixel's surface. A picture is the sum of both parts and of the surface's own emission,
/// scattered light and reflection of the prefiltered environment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Light of rays that the surface, or its coat, reflected first.
    Reflection = 1,
    /// Light of rays that passed through the surface first, refracted or straight.
    Refraction = 2,
}

impl Part {
    /// The name of the part's layer, and of the knob that sends its rays.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Reflection => "reflection",
            Self::Refraction => "refraction",
        }
    }

    /// Whether the plan sends rays of this part.
    #[must_use]
    pub fn called_for(self, plan: &Plan) -> bool {
        // Inside a closed mesh its boundary reflects by rays, whatever the rung of `reflection`.
        plan.rays.is_some_and(|rays| rays.refraction || (self == Self::Reflection && rays.mirrors))
    }
}

/// A part's images on the device.
pub struct PartOnDevice {
    /// The part.
    pub part: Part,
    /// Radiance of the last sample.
    pub radiance: Image,
    /// A copy for screen-space refraction; a dummy otherwise.
    pub seen: Buffer,
    /// Mean of the samples, when there is more than one sample or band.
    pub film: Option<Image>,
}

impl PartOnDevice {
    /// Creates images of `size` pixels.
    ///
    /// # Errors
    /// When the chosen rungs send no rays of this part, or memory is short.
    pub fn new(device: &Arc<Device>, plan: &Plan, knobs: &Knobs, part: Part, size: [u32; 2]) -> Result<Self> {
        let name = part.name();
        if plan.paths.is_some() {
            let why = format!(
                "{name}: this layer is what single rays bring, and indirect=path follows paths instead; choose indirect=ambient \
                 with guiding=off, caustics=off and denoise=off"
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
