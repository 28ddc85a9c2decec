//! The G-buffer: attributes of the nearest opaque surface of every pixel, rasterised for deferred shading
//! (shaders/pass/gbuffer.*).
//!
//! Read Real-Time Rendering (4th ed.), section 20.1 (deferred shading). 24 bytes a pixel beside depth: RGBA16F base
//! colour and metallic, two octahedral normals (RG32UI, or as the knob `normals` says), RG32UI ids, roughness and
//! occlusion. 16 more for positions where the knob `position` stores them; 4 for triangles with rays, 8 for emissive
//! textures, 16 for layers and 16 for lobes where the plan has them. docs/decisions/gbuffer.md has the cost of narrower
//! and wider formats.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use crate::gpu::{Buffer, ColorTarget, DepthTarget, Device, Draw, Frame, Image, ImageDesc, NOTHING, Place, Raster};
use crate::plan::{Normals, Plan};
use crate::shader::{gbuffer, lib};
use crate::upload::scene::SceneOnDevice;

const POSITION: vk::Format = vk::Format::R32G32B32A32_SFLOAT;
const LOBES: vk::Format = vk::Format::R32G32B32A32_UINT;

/// Format of the normals, two octahedral encodings as integer words (shaders/lib/normals.glsl): every device supports
/// these formats as colour attachments and storage images, unlike RGBA16_SNORM.
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
    /// The same depth as a texel buffer in row order, for later passes. The copy costs half a millisecond at 1280x720.
    depth_rows: Buffer,
    /// Base colour and metallic texels.
    pub base: Image,
    /// Shading normal and geometric normal.
    pub normals: Image,
    /// Depth and position, where positions are stored, as an image and as a texel buffer.
    positions: Option<(Image, Buffer)>,
    /// Material, roughness, instance, occlusion.
    pub ids: Image,
    /// Index of the triangle in the scene; one texel where the plan has no rays.
    pub triangles: Image,
    /// Emissive colours; one texel where the plan has none.
    pub emissive: Image,
    /// Clear coat, specular and transmission; one texel where the plan has none.
    pub layers: Image,
    /// Texels of lobes where the plan has them, as an image, and as a buffer in row order that passes read.
    lobes: (Option<Image>, Buffer),
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
        let lobes = plan.lobe_texels.then(|| -> Result<_> {
            let bytes = 16 * u64::from(size[0]) * u64::from(size[1]);
            let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC;
            let image = Image::new(device, "G-buffer lobes", ImageDesc::flat(LOBES, size[0], size[1], usage))?;
            Ok((image, Buffer::new(device, "G-buffer lobe rows", bytes, Place::Device)?))
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
            lobes: lobes.transpose()?.map_or_else(
                || Buffer::new(device, NOTHING, 16, Place::Device).map(|rows| (None, rows)),
                |(image, rows)| Ok((Some(image), rows)),
            )?,
            size,
            with,
        })
    }

    /// Bindings of the passes that read the G-buffer.
    #[must_use]
    pub fn bind(&self) -> lib::gbuffer::Bind<'_> {
        lib::gbuffer::Bind {
            depths: self.positions.as_ref().map_or(&self.depth_rows, |(_, rows)| rows),
            base: &self.base,
            normals: &self.normals,
            ids: &self.ids,
            emissive: &self.emissive,
            layers: &self.layers,
            lobes: &self.lobes.1,
            triangles: &self.triangles,
        }
    }
}

/// Draws surfaces with a depth test: the nearest surface of each pixel is kept.
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
    // Only depth is cleared: later passes read the other targets only where depth shows a surface.
    let color = |image: &'a Image| Some(ColorTarget { image, clear: None });
    let [triangles, emissive, layers] = target.with;
    let mut colors = vec![color(&target.base), color(&target.normals), color(&target.ids)];
    for (image, exists) in [(&target.triangles, triangles), (&target.emissive, emissive), (&target.layers, layers)] {
        colors.push(color(image).filter(|_| exists));
    }
    // The positions' depth is also read at pixels without a surface, so this target is cleared.
    colors.push(target.positions.as_ref().map(|(image, _)| ColorTarget { image, clear: Some([0; 4]) }));
    colors.push(target.lobes.0.as_ref().and_then(color));
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
    if let (Some(image), rows) = &target.lobes {
        frame.download("copy lobes", image, rows);
    }
    Ok(())
}
