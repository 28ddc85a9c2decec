//! All images and buffers of a frame whose size depends on the picture's.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use super::Part;
use super::settings::Settings;
use crate::gpu::{Device, Image, ImageDesc};
use crate::pass::classify::{RayTiles, WorkLists};
use crate::pass::denoise::Denoising;
use crate::pass::fragments::FragmentLists;
use crate::pass::gbuffer::GBuffer;
use crate::pass::part::PartOnDevice;
use crate::pass::path::PathsOnDevice;
use crate::pass::ray_trees::RayTrees;
use crate::pass::screen::OnScreen;
use crate::pass::sum::Sum;
use crate::pass::tiles::Tiles;
use crate::pass::tonemap::Display;
use crate::plan::Plan;

/// All resources whose size depends on the picture's.
pub(super) struct Targets {
    pub(super) ray_tiles: RayTiles,
    pub(super) ray_trees: Option<RayTrees>,
    pub(super) gbuffer: GBuffer,
    pub(super) tiles: Tiles,
    pub(super) work: WorkLists,
    pub(super) lists: Option<FragmentLists>,
    pub(super) radiance: Image,
    pub(super) screen: OnScreen,
    /// Sums of samples, when there is more than one. Path tracing sums even and odd samples separately: their random
    /// numbers are independent, so the difference of the two means estimates the picture's error.
    pub(super) sums: Vec<Sum>,
    /// Mean of the samples, when it is not one of the sums.
    pub(super) film: Option<Image>,
    /// What denoises the film, not the sums: errors are those of the samples.
    pub(super) denoising: Option<Denoising>,
    pub(super) parts: Vec<PartOnDevice>,
    pub(super) paths: Option<PathsOnDevice>,
    pub(super) display: Display,
}

impl Targets {
    pub(super) fn new(device: &Arc<Device>, plan: &Plan, settings: &Settings, touching: bool) -> Result<Self> {
        let size = settings.size;
        let target = |name| {
            let usage = vk::ImageUsageFlags::STORAGE;
            Image::new(device, name, ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, size[0], size[1], usage))
        };
        let part = |&part: &Part| PartOnDevice::new(device, plan, &settings.knobs, part, size);
        let sums = match (plan.samples, plan.paths) {
            (1, _) if plan.bands == 0 => Vec::new(),
            (1, _) | (_, None) => vec![Sum::new(device, "sum of samples", size, plan.samples, plan.bands)?],
            (samples, Some(_)) => {
                let half = |name: &str| Sum::new(device, name, size, samples.div_ceil(2), plan.bands);
                vec![half("sum of even samples")?, half("sum of odd samples")?]
            }
        };
        let is_sum = sums.is_empty() || (sums.len() == 1 && sums[0].is_plain());
        Ok(Self {
            ray_tiles: RayTiles::new(device, plan, size)?,
            ray_trees: RayTrees::new(device, plan, size, settings.ray_trees)?,
            gbuffer: GBuffer::new(device, plan, size)?,
            tiles: Tiles::new(device, plan, size)?,
            work: WorkLists::new(device, size, settings.share)?,
            lists: if plan.transparency { Some(FragmentLists::new(device, plan, size)?) } else { None },
            radiance: target("radiance")?,
            screen: OnScreen::new(device, plan, size)?,
            sums,
            film: if is_sum { None } else { Some(target("film")?) },
            denoising: if plan.denoise { Some(Denoising::new(device, size)?) } else { None },
            parts: settings.parts.iter().map(part).collect::<Result<_>>()?,
            paths: plan
                .paths
                .map(|_| PathsOnDevice::new(device, plan, touching, (size, settings.share)))
                .transpose()?,
            display: Display::new(device, size)?,
        })
    }
}
