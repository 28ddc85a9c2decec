//! Raster G-buffer: the nearest opaque surface of every pixel (shaders/pass/gbuffer.*).
//!
//! 24 bytes a pixel beside depth: RGBA16F base colour and metallic, two octahedral normals (RG32UI, or as the knob
//! `normals` says), RG32UI ids, roughness and occlusion; 16 more for positions where the knob `position` stores them; 4 for
//! triangles where there are rays, 8 for emissive textures and 16 for layers where the plan has them. docs/decisions/gbuffer.md has
//! what narrower and wider choices cost.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use crate::gpu::{Buffer, ColorTarget, DepthTarget, Device, Draw, Frame, Image, ImageDesc, Place, Raster};
use crate::plan::{Normals, Plan};
use crate::shader::{gbuffer, lib};
use crate::upload::scene::SceneOnDevice;

const POSITION: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

/// Words of two octahedral normals (shaders/lib/normals.glsl): every device draws to such formats and stores them, which is not so of
/// RGBA16_SNORM.
fn normal_format(normals: Normals) -> vk::Format {
    match normals {
        Normals::Oct16 => vk::Format::R32_UINT,
        Normals::Oct24 | Normals::Oct32 => vk::Format::R32G32_UINT,
        Normals::F32 => vk::Format::R32G32B32A32_UINT,
    }
}

/// The images of the G-buffer.
pub struct GBuffer {
    /// Reversed depth; 0 where nothing was drawn.
    pub depth: Image,
    /// The same depth as texels, row by row: what the passes after it read. The copy costs half a millisecond at 1280x720.
    depth_rows: Buffer,
    /// Base colour and metallic texels.
    pub base: Image,
    /// Shading and geometric normal.
    pub normals: Image,
    /// Depth and position, where positions are stored, and the same as texels.
    positions: Option<(Image, Buffer)>,
    /// Material, roughness, instance, occlusion.
    pub ids: Image,
    /// Triangle of the scene; one pixel where the plan has no rays.
    pub triangles: Image,
    /// Emissive texels; one pixel where the plan has none.
    pub emissive: Image,
    /// Layer texels; one pixel where the plan has none.
    pub layers: Image,
    size: [u32; 2],
    with: [bool; 3],
}

impl GBuffer {
    /// Images for a picture of `size` pixels.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, plan: &Plan, size: [u32; 2]) -> Result<Self> {
        let target = |name, format, exists: bool| {
            let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::STORAGE;
            match exists {
                true => Image::new(device, name, ImageDesc::flat(format, size[0], size[1], usage)),
                false => Image::nothing(device, format, usage),
            }
        };
        let with = [plan.rays.is_some(), plan.emissive, plan.layers];
        let positions = plan.stored.positions.then(|| -> Result<_> {
            let bytes = 16 * u64::from(size[0]) * u64::from(size[1]);
            let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC;
            let image = Image::new(device, "G-buffer positions", ImageDesc::flat(POSITION, size[0], size[1], usage))?;
            Ok((image, Buffer::texels(device, "G-buffer position rows", bytes, Place::Device, POSITION)?))
        });
        let usage = vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT | vk::ImageUsageFlags::SAMPLED;
        Ok(Self {
            depth: Image::new(
                device,
                "G-buffer depth",
                ImageDesc::flat(vk::Format::D32_SFLOAT, size[0], size[1], usage),
            )?,
            depth_rows: Buffer::texels(
                device,
                "G-buffer depth rows",
                4 * u64::from(size[0]) * u64::from(size[1]),
                Place::Device,
                vk::Format::R32_SFLOAT,
            )?,
            base: target("G-buffer base colour", vk::Format::R16G16B16A16_SFLOAT, true)?,
            normals: target("G-buffer normals", normal_format(plan.stored.normals), true)?,
            positions: positions.transpose()?,
            ids: target("G-buffer ids", vk::Format::R32G32_UINT, true)?,
            triangles: target("G-buffer triangles", vk::Format::R32_UINT, with[0])?,
            emissive: target("G-buffer emissive", vk::Format::R16G16B16A16_SFLOAT, with[1])?,
            layers: target("G-buffer layers", vk::Format::R32G32B32A32_UINT, with[2])?,
            size,
            with,
        })
    }

    /// What passes read of it.
    #[must_use]
    pub fn bind(&self) -> lib::gbuffer::Bind<'_> {
        lib::gbuffer::Bind {
            depths: self.positions.as_ref().map_or(&self.depth_rows, |(_, rows)| rows),
            base: &self.base,
            normals: &self.normals,
            ids: &self.ids,
            emissive: &self.emissive,
            layers: &self.layers,
            triangles: &self.triangles,
        }
    }
}

/// Draws surfaces: the nearest of each pixel stays.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn gbuffer<'a>(
    frame: &mut Frame<'a>,
    scene: &'a SceneOnDevice,
    target: &'a GBuffer,
    lod_bias: f32,
    draws: Vec<Draw<'a>>,
) -> Result<()> {
    // Only depth is cleared: the other targets are read where depth says that something was drawn.
    let color = |image| Some(ColorTarget { image, clear: None });
    let [triangles, emissive, layers] = target.with;
    let mut colors = vec![color(&target.base), color(&target.normals), color(&target.ids)];
    for (image, exists) in [(&target.triangles, triangles), (&target.emissive, emissive), (&target.layers, layers)] {
        colors.push(color(image).filter(|_| exists));
    }
    // What is read of pixels that nothing was drawn at is their depth.
    colors.push(target.positions.as_ref().map(|(image, _)| ColorTarget { image, clear: Some([0; 4]) }));
    while colors.last().is_some_and(Option::is_none) {
        colors.pop();
    }
    let raster = Raster {
        name: "G-buffer",
        colors,
        depth: Some(DepthTarget { image: &target.depth, clear: true, write: true }),
        origin: [0, 0],
        size: target.size,
        rows: [0, target.size[1]],
    };
    let push = gbuffer::Push { lod_bias, strip: 0 };
    frame.raster(&raster, &gbuffer::Bind {}, &scene.pages(), &push, draws)?;
    frame.download("copy depth", &target.depth, &target.depth_rows);
    if let Some((image, texels)) = &target.positions {
        frame.download("copy positions", image, texels);
    }
    Ok(())
}
