//! The scene on the device: vertex and index buffers, tables of materials, instances and lights, texture pages.
//!
//! Read docs/scene-input.md and shaders/share/ for the layouts; the Vulkan specification, chapter Fixed-Function Vertex
//! Processing. Positions are camera-relative: differences are computed in f64 and stored in f32.

use std::sync::Arc;

use anyhow::{Result, bail};
use ash::vk;
use glam::{DMat3, DVec3};

use super::sigma_grid::SigmaGrids;
use super::spectrum::{SpectrumConstants, SpectrumOnDevice};
use super::table::upload;
use super::texture::{SLOTS, Textures, texture_slots};
use super::view::View;
use crate::gpu::{
    BoundSet, Buffer, DescriptorSet, Device, Draw, Place, Resource, Specialization as _, TooLarge, VertexStream,
};
use crate::optics::ray::camera_relative;
use crate::plan::rungs::{self, Brdf};
use crate::plan::{Knobs, Plan, casts_in_maps, is_transparent, mirrors};
use crate::scene::lobe::{self, LOBES, LobeOf};
use crate::scene::solid::Solids;
use crate::scene::wavelengths::{Banded, Slice, Wavelengths};
use crate::scene::{AlphaMode, Bounds, Extent, Light, LightKind, Material, Meaning, Scene, SigmaGrid, TextureRef};
use crate::shader::lib::light_table::{SHAPE_DISK, SHAPE_NONE, SHAPE_RECTANGLE, SHAPE_SPHERE};
use crate::shader::{PAGES, lib};
use crate::share;
use crate::spectra::{self, Upsampling};

/// Texels of a material before those of its lobes: constants, then texture slots.
const MATERIAL_LOBES_AT: usize =
    lib::material::MATERIAL_SLOTS_AT as usize + SLOTS * lib::material::SLOT_TEXELS as usize;
/// Texture slots that use tangents: normal maps.
pub(super) const BENT: u32 = 1 << lib::texels::SLOT_NORMAL | 1 << lib::texels::SLOT_CLEARCOAT_NORMAL;
/// Texels per light.
const LIGHT_TEXELS: usize = lib::light_table::LIGHT_TEXELS as usize;
const _: () = assert!(size_of::<share::Light>() == 16 * LIGHT_TEXELS);
const _: () = assert!(lobe::COUNT == lib::texels::LOBES as usize);
const _: () = assert!(lobe::SHEEN == lib::texels::LOBE_SHEEN as usize);
const _: () = assert!(lobe::ANISOTROPY == lib::texels::LOBE_ANISOTROPY as usize);
const _: () = assert!(lobe::IRIDESCENCE == lib::texels::LOBE_IRIDESCENCE as usize);
const _: () = assert!(lobe::DIFFUSE_TRANSMISSION == lib::texels::LOBE_DIFFUSE_TRANSMISSION as usize);
const _: () = assert!(size_of::<share::Material>() == 16 * lib::material::MATERIAL_SLOTS_AT as usize);

/// Ranges of a mesh in the scene's buffers.
struct MeshRange {
    first_index: u32,
    index_count: u32,
    material: usize,
    has_tangents: bool,
    has_uvs: [bool; 2],
    has_colors: bool,
    /// Centre and half extent of the mesh's bounding box.
    extent: [DVec3; 2],
}

/// An instance in f64, from which every view computes camera-relative transforms.
struct Placement {
    world_from_object: glam::DAffine3,
    mesh: usize,
    /// A closed dielectric mesh with inverted winding.
    flipped: bool,
    /// Whether the normals of the mesh point inwards, too.
    normals_flipped: bool,
    sheet: bool,
    first_triangle: u32,
}

impl Placement {
    fn mirrors(&self) -> bool {
        (self.world_from_object.matrix3.determinant() < 0.0) != self.flipped
    }
}

/// One vertex attribute of all meshes that have it, concatenated; the others read the fallback with stride 0.
struct Stream {
    data: Buffer,
    /// Offset of each mesh in bytes.
    offsets: Vec<u64>,
    stride: u32,
}

impl Stream {
    fn of(&self, mesh: usize) -> VertexStream<'_> {
        VertexStream { buffer: &self.data, offset: self.offsets[mesh], stride: self.stride }
    }
}

/// The data of a scene that outlives a frame.
pub struct SceneOnDevice {
    device: Arc<Device>,
    positions: Stream,
    normals: Stream,
    tangents: Stream,
    uvs: [Stream; 2],
    colors: Stream,
    /// Fallback attributes: 0, 0, 0, 0 and 1, 1, 1, 1.
    fallback: Buffer,
    indices: Buffer,
    meshes: Vec<MeshRange>,
    placements: Vec<Placement>,
    materials_cpu: Vec<Material>,
    /// The material table with texture slots, for the current slice of wavelengths.
    pub materials: Buffer,
    texture_slots: Vec<[u32; 4]>,
    /// Conversion of RGB colours to the current slice of wavelengths.
    pub spectrum: SpectrumOnDevice,
    /// Spectra of the materials; `None` for RGB rendering.
    wavelengths: Option<Wavelengths>,
    knobs: Knobs,
    eye: DVec3,
    /// Heterogeneous media, for rays.
    pub grids: SigmaGrids,
    /// Instances, relative to the eye of the current view.
    pub instances: Buffer,
    /// Lights, relative to the eye of the current view: directional first, `LIGHT_TEXELS` each; then the shadow map
    /// table.
    pub lights: Buffer,
    lights_cpu: Vec<Light>,
    /// Shadow maps of each light, stored in its last texel.
    light_shadows: Vec<LightMaps>,
    refraction: bool,
    stored_normals: lib::normals::Constants,
    lobe_texels: bool,
    /// The material whose medium each material has ([`Solids::medium`]).
    media: Vec<usize>,
    /// Textures for rasterisation and for rays.
    pub textures: Textures,
    /// Per material, index of its set in [`SceneOnDevice::pages`].
    page_of_material: Vec<usize>,
    page_materials: Vec<usize>,
    page_sets: Vec<DescriptorSet>,
    /// World-space bounding box of the drawn triangles.
    pub bounds: Option<Bounds>,
}

/// One bit per texture slot: the textures that a material has.
#[must_use]
pub fn texture_bits(m: &Material) -> u32 {
    texture_slots(m).iter().enumerate().map(|(slot, (texture, _))| u32::from(texture.is_some()) << slot).sum()
}

fn extent(positions: &[[f32; 3]]) -> [DVec3; 2] {
    let mut all = positions.iter().map(|&p| glam::Vec3::from(p).as_dvec3());
    let first = all.next().unwrap_or_default();
    let (min, max) = all.fold((first, first), |(min, max), p| (min.min(p), max.max(p)));
    [(min + max) * 0.5, (max - min) * 0.5]
}

fn stream<T: bytemuck::NoUninit>(
    device: &Arc<Device>,
    name: &str,
    scene: &Scene,
    attribute: impl Fn(&crate::scene::Mesh) -> &Vec<T>,
) -> Result<Stream> {
    let mut offsets = Vec::with_capacity(scene.meshes.len());
    let mut all: Vec<T> = Vec::with_capacity(scene.meshes.iter().map(|m| attribute(m).len()).sum());
    for mesh in &scene.meshes {
        offsets.push(size_of_val(all.as_slice()) as u64);
        let of_vertices = attribute(mesh);
        if device.offers().primitive_ids || of_vertices.is_empty() {
            all.extend_from_slice(of_vertices);
        } else {
            all.extend(mesh.indices.iter().map(|&vertex| of_vertices[vertex as usize]));
        }
    }
    Ok(Stream { data: upload(device, name, &all, None)?, offsets, stride: size_of::<T>() as u32 })
}

impl SceneOnDevice {
    /// Uploads a scene and moves decoded images and geometry out of it. `anchor` is the origin of bvh space. Textures
    /// in `before` are reused when they hold the same images.
    ///
    /// # Errors
    /// When the scene does not fit the device.
    pub fn new(
        device: &Arc<Device>,
        mut scene: Scene,
        plan: &Plan,
        knobs: &Knobs,
        solids: &Solids,
        anchor: DVec3,
        before: Option<Textures>,
    ) -> Result<Self> {
        if scene.materials.len() > 0xffff || scene.instances.len() > 0x7f_ffff {
            bail!(
                "{}: {} materials and {} instances, the G-buffer's ids hold 65535 and 8388607",
                scene.name,
                scene.materials.len(),
                scene.instances.len()
            );
        }
        let bounds = scene.bounds();
        let positions = stream(device, "positions", &scene, |m| &m.positions)?;
        let normals = stream(device, "normals", &scene, |m| &m.normals)?;
        let tangents = stream(device, "tangents", &scene, |m| &m.tangents)?;
        let uvs = [
            stream(device, "texture coordinates 0", &scene, |m| &m.uvs[0])?,
            stream(device, "texture coordinates 1", &scene, |m| &m.uvs[1])?,
        ];
        let colors = stream(device, "vertex colours", &scene, |m| &m.colors)?;
        let mut meshes = Vec::with_capacity(scene.meshes.len());
        let mut all_indices: Vec<u32> = Vec::with_capacity(scene.meshes.iter().map(|m| m.indices.len()).sum());
        for mesh in &scene.meshes {
            let shared = device.offers().primitive_ids;
            let vertices = if shared { mesh.positions.len() } else { mesh.indices.len() };
            if vertices > device.max_vertices() {
                let what = format!("{}: uploading a mesh of {vertices} vertices", scene.name);
                bail!(TooLarge { what, limit: format!("draws at most {} in one", device.max_vertices()) });
            }
            meshes.push(MeshRange {
                first_index: all_indices.len() as u32,
                index_count: mesh.indices.len() as u32,
                material: mesh.material,
                has_tangents: !mesh.tangents.is_empty(),
                has_uvs: [!mesh.uvs[0].is_empty(), !mesh.uvs[1].is_empty()],
                has_colors: !mesh.colors.is_empty(),
                extent: extent(&mesh.positions),
            });
            if shared {
                all_indices.extend_from_slice(&mesh.indices);
            } else {
                all_indices.extend(0..mesh.indices.len() as u32);
            }
        }
        let grids = SigmaGrids::new(device, plan, &scene, anchor)?;
        let first_triangles = scene.first_triangles();
        let spectral = plan.bands > 0;
        let wavelengths = spectral.then(|| Wavelengths::new(&scene, upsampling(knobs)));
        scene.meshes = Vec::new();
        let indices = upload(device, "indices", &all_indices, None)?;
        drop(all_indices);

        let textures = Textures::new(device, &mut scene, plan.rays.is_some(), before)?;

        let fitted =
            wavelengths.as_ref().is_some_and(|known| known.vary) && upsampling(knobs) == Upsampling::JakobHanika;
        let mut texture_slots_of = Vec::with_capacity(scene.materials.len() * SLOTS * 3);
        let mut page_of_material = Vec::with_capacity(scene.materials.len());
        let mut page_materials: Vec<usize> = Vec::new();
        for (index, material) in scene.materials.iter().enumerate() {
            for (texture, meaning) in texture_slots(material) {
                let for_rays = plan.rays.map_or([0; 4], |_| textures.slot(texture, meaning));
                texture_slots_of.extend(shared_slot(texture, &textures, meaning).map(|texel| texel.map(f32::to_bits)));
                texture_slots_of.push(for_rays);
            }
            // Materials with the same pages and samplers share a descriptor set.
            let same = |&other: &usize| same_pages(&textures, material, &scene.materials[other]);
            let set = page_materials.iter().position(same).unwrap_or_else(|| {
                page_materials.push(index);
                page_materials.len() - 1
            });
            page_of_material.push(set);
        }
        let lights_cpu = std::mem::take(&mut scene.lights);

        let instance_bytes = (scene.instances.len() * size_of::<share::Instance>()) as u64;
        device.check_bound("instances", instance_bytes)?;
        let map_texels = if plan.shadow_maps { 6 * lib::light_table::SHADOW_MAP_TEXELS as usize } else { 0 };
        let light_bytes = (lights_cpu.len() * (LIGHT_TEXELS + map_texels) * 16) as u64;
        let media = solids.medium.clone();
        let shared = |(i, m): (usize, &Material)| (shared_material(m, media[i], knobs, grids.places[i], None), m.lobes);
        let table = material_table(scene.materials.iter().enumerate().map(shared), &texture_slots_of);
        let texel_format = vk::Format::R32G32B32A32_UINT;
        let page_sets = page_materials
            .iter()
            .map(|&m| DescriptorSet::new(device, &PAGES, &pages_of(&textures, &scene.materials[m])))
            .collect::<Result<_>>()?;
        Ok(Self {
            materials: match spectral {
                // The buffer is rewritten for each slice of wavelengths.
                true => {
                    let bytes = size_of_val(table.as_slice()) as u64;
                    let mut buffer = Buffer::texels(device, "materials", bytes, Place::Upload, texel_format)?;
                    buffer.write(bytemuck::cast_slice(&table));
                    buffer
                }
                false => upload(device, "materials", &table, Some(texel_format))?,
            },
            texture_slots: texture_slots_of,
            page_sets,
            light_shadows: vec![LightMaps::default(); lights_cpu.len()],
            spectrum: SpectrumOnDevice::new(device, spectral, fitted)?,
            wavelengths,
            knobs: knobs.clone(),
            eye: DVec3::ZERO,
            grids,
            instances: Buffer::new(device, "instances", instance_bytes, Place::Upload)?,
            lights: Buffer::texels(device, "lights", light_bytes, Place::Upload, vk::Format::R32G32B32A32_SFLOAT)?,
            fallback: upload(device, "attribute fallback", &[0.0_f32, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0], None)?,
            device: device.clone(),
            positions,
            normals,
            tangents,
            uvs,
            colors,
            indices,
            meshes,
            placements: scene
                .instances
                .iter()
                .enumerate()
                .map(|(index, i)| Placement {
                    first_triangle: first_triangles[index],
                    world_from_object: i.world_from_object,
                    mesh: i.mesh,
                    flipped: solids.flipped[index],
                    normals_flipped: solids.normals_flipped[index],
                    sheet: solids.sheet[index]
                        || !(plan.screen.refraction || plan.rays.is_some_and(|rays| rays.refraction)),
                })
                .collect(),
            materials_cpu: scene.materials,
            lights_cpu,
            refraction: plan.rays.is_some_and(|rays| rays.refraction),
            stored_normals: lib::normals::Constants { normals: plan.stored.normals as u32 },
            lobe_texels: plan.lobe_texels,
            media,
            textures,
            page_of_material,
            page_materials,
            bounds,
        })
    }

    /// Updates instances and lights to the eye of `view`: differences in f64, stored in f32.
    pub fn set_view(&mut self, view: &View) {
        self.eye = view.eye;
        let table = self.instances_around(view.eye);
        self.instances.write(bytemuck::cast_slice(&table));
        self.write_lights(None);
    }

    fn write_lights(&mut self, slice: Option<&Slice>) {
        let color = |light: &Light| slice.map_or(light.color, |slice| slice.light(light));
        let lights = self.lights_cpu.iter().zip(&self.light_shadows);
        let table: Vec<_> =
            lights.map(|(light, &shadow)| shared_light(light, color(light), self.eye, shadow)).collect();
        self.lights.write(bytemuck::cast_slice(&table));
    }

    /// Stores the shadow map table after the light table.
    pub(crate) fn keep_shadow_maps(&mut self, of_lights: Vec<LightMaps>, maps: &[[f32; 4]]) {
        self.lights.write_at(of_lights.len() * LIGHT_TEXELS * 16, bytemuck::cast_slice(maps));
        self.light_shadows = of_lights;
    }

    /// Converts materials and lights to a slice of wavelengths, or to RGB for `None`, in spectral rendering.
    pub fn upload_band(&mut self, slice: Option<&Slice>) {
        let Some(wavelengths) = &self.wavelengths else { return };
        let shared = |(i, m): (usize, &Material)| {
            let place = self.grids.places[i];
            let Some(slice) = slice else {
                return (shared_material(m, self.media[i], &self.knobs, place, None), m.lobes);
            };
            let Banded { material, base_rgb, varies_rgb, emissive_rgb } = wavelengths.material(i, m, slice);
            let mut shared =
                shared_material(&material, self.media[i], &self.knobs, place, Some(spectra::shares(&slice.band)));
            shared.flags |= if base_rgb { share::MATERIAL_BASE_RGB } else { 0 };
            shared.flags |= if varies_rgb { share::MATERIAL_VARIES_RGB } else { 0 };
            shared.flags |= if emissive_rgb { share::MATERIAL_EMISSIVE_RGB } else { 0 };
            (shared, material.lobes)
        };
        let table = material_table(self.materials_cpu.iter().enumerate().map(shared), &self.texture_slots);
        self.materials.write(bytemuck::cast_slice(&table));
        if let Some(slice) = slice {
            self.spectrum.upload_band(slice);
        }
        self.write_lights(slice);
    }

    /// Specialization constants of programs that read colours.
    #[must_use]
    pub fn colours(&self) -> SpectrumConstants {
        self.spectrum.constants(self.wavelengths.is_some())
    }

    /// The instance table relative to a world-space point.
    #[must_use]
    pub fn instances_around(&self, origin: DVec3) -> Vec<share::Instance> {
        self.placements
            .iter()
            .map(|placement| shared_instance(placement, origin, self.meshes[placement.mesh].material))
            .collect()
    }

    /// The lights in table order: directional ones first.
    #[must_use]
    pub fn lights_in_order(&self) -> &[Light] {
        &self.lights_cpu
    }

    /// The device of the scene's buffers.
    #[must_use]
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// The texture sets of the scene, one per distinct combination of pages; a raster pass's draws select among them.
    #[must_use]
    pub fn pages(&self) -> Vec<BoundSet<'_>> {
        let entries = |&m: &usize| pages_of(&self.textures, &self.materials_cpu[m]);
        self.page_sets.iter().zip(&self.page_materials).map(|(set, m)| set.bind(entries(m))).collect()
    }

    /// The draws of all instances with transparent or with opaque materials, in the file's order. With `inside`, back
    /// faces of transmissive materials are drawn, too, because the eye is inside a closed dielectric mesh.
    #[must_use]
    pub fn draws(&self, transparency: bool, inside: bool) -> Vec<Draw<'_>> {
        self.placements
            .iter()
            .enumerate()
            .filter(|(_, p)| {
                is_transparent(&self.materials_cpu[self.meshes[p.mesh].material], self.refraction) == transparency
            })
            .filter(|(_, p)| self.meshes[p.mesh].index_count > 0)
            .map(|(instance, placement)| self.draw(instance as u32, placement, inside))
            .collect()
    }

    /// The draws of all surfaces in shadow maps, without culling, as a shadow ray stops at either side; only instances
    /// whose world-space bounding box (centre, half extent) passes `is_seen`.
    #[must_use]
    pub fn casters(&self, is_seen: impl Fn(DVec3, DVec3) -> bool) -> Vec<Draw<'_>> {
        let material = |p: &Placement| &self.materials_cpu[self.meshes[p.mesh].material];
        self.placements
            .iter()
            .enumerate()
            .filter(|(_, p)| casts_in_maps(material(p)) && self.meshes[p.mesh].index_count > 0)
            .filter(|(_, p)| {
                let ([middle, half], m) = (self.meshes[p.mesh].extent, p.world_from_object.matrix3);
                let half = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
                is_seen(p.world_from_object.transform_point3(middle), half)
            })
            .map(|(instance, placement)| {
                let masked = matches!(material(placement).alpha_mode, AlphaMode::Mask(_));
                let mesh = &self.meshes[placement.mesh];
                let base = texture_bits(material(placement)) & (1 << lib::texels::SLOT_BASE);
                let has = lib::gbuffer_interface::Constants {
                    masked,
                    textures: if masked { base } else { 0 },
                    has_color: masked && mesh.has_colors,
                    ..Default::default()
                };
                let draw = self.draw(instance as u32, placement, false);
                Draw {
                    pages: if masked { draw.pages } else { 0 },
                    constants: has.words(),
                    // Position, both texture coordinate sets, colour.
                    streams: [0, 3, 4, 5].map(|i| draw.streams[i]).to_vec(),
                    cull_back: false,
                    ..draw
                }
            })
            .collect()
    }

    fn draw(&self, instance: u32, placement: &Placement, inside: bool) -> Draw<'_> {
        let mesh = &self.meshes[placement.mesh];
        let material = &self.materials_cpu[mesh.material];
        let fallback = |offset| VertexStream { buffer: &self.fallback, offset, stride: 0 };
        let has = lib::gbuffer_interface::Constants {
            textures: texture_bits(material) & if mesh.has_tangents { u32::MAX } else { !BENT },
            has_color: mesh.has_colors,
            masked: matches!(material.alpha_mode, AlphaMode::Mask(_)),
            anisotropic: material.has_direction(),
            lobe_texels: self.lobe_texels,
            shared_vertices: self.device.offers().primitive_ids,
        };
        Draw {
            pages: self.page_of_material[mesh.material],
            constants: [has.words(), self.stored_normals.words()].concat(),
            streams: vec![
                self.positions.of(placement.mesh),
                self.normals.of(placement.mesh),
                if mesh.has_tangents { self.tangents.of(placement.mesh) } else { fallback(0) },
                if mesh.has_uvs[0] { self.uvs[0].of(placement.mesh) } else { fallback(0) },
                if mesh.has_uvs[1] { self.uvs[1].of(placement.mesh) } else { fallback(0) },
                if mesh.has_colors { self.colors.of(placement.mesh) } else { fallback(16) },
            ],
            indices: &self.indices,
            first_index: mesh.first_index,
            index_count: mesh.index_count,
            instance,
            // The boundary of a closed mesh is crossed once, so KHR_materials_volume ignores double sidedness there.
            cull_back: (!material.double_sided
                || (material.transmission > 0.0 && material.thickness > 0.0 && !placement.sheet))
                && !(inside && self.refraction && material.transmission > 0.0),
            clockwise: placement.mirrors(),
        }
    }
}

fn same_pages(textures: &Textures, a: &Material, b: &Material) -> bool {
    texture_slots(a).into_iter().zip(texture_slots(b)).all(|((a, meaning), (b, _))| {
        let (a, b) = (textures.sampled(a, meaning), textures.sampled(b, meaning));
        std::ptr::eq(a.image, b.image) && a.sampler == b.sampler
    })
}

/// Entries of a material's texture set: slots and resources.
fn pages_of<'a>(textures: &'a Textures, material: &Material) -> Vec<(u32, Resource<'a>)> {
    let slots = texture_slots(material).into_iter().enumerate();
    slots.map(|(slot, (texture, meaning))| (slot as u32, textures.sampled(texture, meaning).into())).collect()
}

/// The texels of all materials in the layout of shaders/lib/material.glsl: constants, texture slots, lobes.
fn material_table(
    materials: impl Iterator<Item = (share::Material, [LobeOf; lobe::COUNT])>,
    slots: &[[u32; 4]],
) -> Vec<[u32; 4]> {
    let constants = lib::material::MATERIAL_SLOTS_AT as usize;
    let mut table = Vec::new();
    for ((material, lobes), slots) in materials.zip(slots.chunks_exact(MATERIAL_LOBES_AT - constants)) {
        table.extend_from_slice(bytemuck::cast_slice(std::slice::from_ref(&material)));
        table.extend_from_slice(slots);
        table.extend(LOBES.iter().zip(lobes).map(|(lobe, of)| (lobe.texel)(of.factors).map(f32::to_bits)));
    }
    table
}

/// Two texels of a texture slot: row of u, layer | row of v, coordinate set.
fn shared_slot(texture: Option<TextureRef>, textures: &Textures, meaning: Meaning) -> [[f32; 4]; 2] {
    let Some(texture) = texture else { return [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]] };
    let (m, t) = (texture.uv_transform.matrix2, texture.uv_transform.translation);
    let layer = textures.layer(texture, meaning) as f32;
    [[m.x_axis.x, m.y_axis.x, t.x, layer], [m.x_axis.y, m.y_axis.y, t.y, texture.uv_set as f32]]
}

/// The method of spectral upsampling that the knob selects.
fn upsampling(knobs: &Knobs) -> Upsampling {
    match knobs.upsampling {
        rungs::Upsampling::JakobHanika => Upsampling::JakobHanika,
        rungs::Upsampling::MallettYuksel => Upsampling::MallettYuksel,
    }
}

/// The constants of a material. F0 of a dielectric is ((n − 1) / (n + 1))², tinted and scaled by
/// KHR_materials_specular. Optical depth is −ln(attenuation colour) · thickness / attenuation distance (lecture A1,
/// KHR_materials_volume). A grid of σ that is not marched (`grid` is 0) adds its mean. In a band, `shares` are the
/// band's shares of red, green and blue. `index`: the material whose medium it has.
fn shared_material(m: &Material, index: usize, knobs: &Knobs, grid: u32, shares: Option<[f64; 3]>) -> share::Material {
    let r = (m.ior - 1.0) / (m.ior + 1.0);
    let absorbs = knobs.absorption != rungs::Absorption::Off;
    // attenuationDistance is in world-space metres, thickness in object-space metres.
    let sigma = m.attenuation_color.map(|color| {
        let sigma = -color.max(1e-6).ln() / m.attenuation_distance;
        if absorbs && m.thickness > 0.0 && sigma > 0.0 { sigma } else { 0.0 }
    });
    let mean = m.marched_sigma().filter(|_| absorbs).map_or([0.0; 3], SigmaGrid::mean);
    let mean = shares.map_or(mean, |shares| [(0..3).map(|i| shares[i] * mean[i]).sum(); 3]).map(|x| x as f32);
    let of_grid = |share: f32| [0, 1, 2].map(|i| sigma[i] + share * mean[i]);
    let (alpha_cutoff, coverage) = match m.alpha_mode {
        AlphaMode::Mask(cutoff) => (cutoff, 0),
        AlphaMode::Blend => (0.0, share::MATERIAL_BLENDED),
        AlphaMode::Opaque => (0.0, 0),
    };
    let flag = |is: bool, flag: u32| if is { flag } else { 0 };
    let metal = m.conductor.unwrap_or_default();
    // With a texture of colours the product is clamped (lib/surface.glsl).
    let is_clamped_later = m.specular_color_texture.is_some() && knobs.brdf != Brdf::BlinnPhong;
    let most = if is_clamped_later { f32::INFINITY } else { 1.0 };
    let mut f0 = m.specular_color.map(|c| (r * r * c).min(most) * m.specular);
    let [red, green, blue, alpha] = m.base_color;
    let mut base = [red, green, blue];
    if m.phong {
        (f0, base) = phong(m, knobs, f0);
    }
    share::Material {
        base_color: [base[0], base[1], base[2], alpha],
        emissive: m.emissive,
        metallic: m.metallic,
        f0,
        roughness: m.roughness,
        sigma_thickness: of_grid(1.0).map(|sigma| sigma * m.thickness),
        // An interface between equal indices reflects nothing, at no angle.
        f90: if m.ior == 1.0 { 0.0 } else { m.specular },
        ior: m.ior,
        // Rays compute what occlusion textures approximate.
        occlusion_strength: if knobs.indirect.occlusion_rays() > 0 { 0.0 } else { m.occlusion_strength },
        normal_scale: m.normal_scale,
        alpha_cutoff,
        transmission: m.transmission,
        clearcoat: m.clearcoat,
        clearcoat_roughness: m.clearcoat_roughness,
        sigma: of_grid(if grid == 0 { 1.0 } else { 0.0 }),
        medium: medium(m, index),
        n_metal: metal.map(|[n, _]| n),
        flags: flag(m.unlit, share::MATERIAL_UNLIT)
            | coverage
            | flag(m.conductor.is_some(), share::MATERIAL_CONDUCTOR)
            | flag(mirrors(m) && !m.unlit, share::MATERIAL_MIRRORS),
        thickness: m.thickness,
        kappa_metal: metal.map(|[_, kappa]| kappa),
        grid,
    }
}

/// F0 and base colour from which shaders/lib/layers.glsl reconstructs k_s and k_d of the scene. B5 lacks (L + V)² in
/// the denominator of its lobe, which is 4 at normal incidence. B6 scales the diffuse base layer by the energy that F0
/// leaves, so the colour is divided by it where specular and diffuse together reflect no more than they receive.
fn phong(m: &Material, knobs: &Knobs, f0: [f32; 3]) -> ([f32; 3], [f32; 3]) {
    let [red, green, blue, _] = m.base_color;
    let r = (m.ior - 1.0) / (m.ior + 1.0);
    let uncapped = m.specular_color.map(|c| r * r * c * m.specular);
    let left = 1.0 - uncapped.into_iter().fold(0.0, f32::max);
    match knobs.brdf {
        Brdf::BlinnPhong => (uncapped.map(|f| 4.0 * f), [red, green, blue]),
        Brdf::BlinnPhongReciprocal if left > 0.0 => (f0, [red, green, blue].map(|albedo| (albedo / left).min(1.0))),
        _ => (f0, [red, green, blue]),
    }
}

/// The cofactor matrix: it transforms normals, up to a factor, without a division.
#[must_use]
pub fn cofactors(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

/// Normals transform by the cofactor matrix, which needs no division and tolerates a singular matrix. The determinant's
/// sign keeps them outside of mirrored objects, and a power of two keeps them in range (numerics.md 41).
fn shared_instance(placement: &Placement, eye: DVec3, material: usize) -> share::Instance {
    let m = placement.world_from_object.matrix3;
    let determinant = m.determinant();
    let sign = if (determinant < 0.0) != placement.normals_flipped { -1.0 } else { 1.0 };
    let cofactors = cofactors(m);
    let largest = cofactors.to_cols_array().iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    let scale = if largest > 0.0 { sign * (-largest.log2().floor()).exp2() } else { 1.0 };
    let normals = cofactors * scale;
    let column = |v: DVec3| v.as_vec3().to_array();
    share::Instance {
        rel_from_object: [
            column(m.x_axis),
            column(m.y_axis),
            column(m.z_axis),
            column(camera_relative([placement.world_from_object.translation, DVec3::ZERO], [eye, DVec3::ZERO])),
        ],
        normal_from_object: [column(normals.x_axis), column(normals.y_axis), column(normals.z_axis)],
        handedness: sign as f32,
        material: material as u32,
        scale: determinant.abs().cbrt() as f32,
        flags: if placement.sheet { share::INSTANCE_SHEET } else { 0 },
        first_triangle: placement.first_triangle,
    }
}

fn shared_light(light: &Light, color: [f32; 3], eye: DVec3, maps: LightMaps) -> share::Light {
    let (shape, extent, across) = match light.extent {
        None => (SHAPE_NONE, 0.0, DVec3::ZERO),
        Some(Extent::Sphere { radius }) => (SHAPE_SPHERE, radius, DVec3::ZERO),
        Some(Extent::Disk { radius }) => (SHAPE_DISK, radius, DVec3::ZERO),
        Some(Extent::Rectangle { across, half_height }) => (SHAPE_RECTANGLE, half_height, across),
    };
    let array = |v: DVec3| v.as_vec3().to_array();
    let shared = share::Light {
        color,
        first_map: maps.first as f32,
        maps: maps.count as f32,
        infinite_far: f32::from(u8::from(maps.infinite_far)),
        ..bytemuck::Zeroable::zeroed()
    };
    let local = |position: DVec3, range: Option<f64>| share::Light {
        position: array(camera_relative([position, DVec3::ZERO], [eye, DVec3::ZERO])),
        // A negative range marks a light without range for tiled light culling.
        range: range.map_or(-1.0, |range| range as f32),
        inv_range2: range.map_or(0.0, |range| (1.0 / (range * range)) as f32),
        spot_offset: 1.0,
        shape: shape as f32,
        extent: extent as f32,
        across: array(across),
        ..shared
    };
    match light.kind {
        LightKind::Directional { direction } => share::Light { position: array(-direction), ..shared },
        LightKind::Point { position, range } => local(position, range),
        LightKind::Spot { position, direction, range, inner, outer } => {
            // The ramp of KHR_lights_punctual: (cosθ − cos outer) / (cos inner − cos outer).
            // Equal cones are a step, which a ramp of 1e-7 represents in f32.
            let scale = 1.0 / (inner.cos() - outer.cos()).max(1e-7);
            share::Light {
                axis: array(direction),
                spot_scale: scale as f32,
                spot_offset: (-outer.cos() * scale) as f32,
                ..local(position, range)
            }
        }
    }
}

/// The shadow maps of a light, in the light table.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct LightMaps {
    /// Texel index of the light's first shadow map in the light table.
    pub(crate) first: usize,
    /// Number of shadow maps: 1, or 6 for a cube; 0 without any.
    pub(crate) count: u32,
    /// Whether depth is near/z with an infinite far plane; otherwise the planes enclose the scene.
    pub(crate) infinite_far: bool,
}

/// A medium in the ray's list of media (shaders/lib/media.glsl): priority of nested dielectrics, and material index
/// plus 1.
#[must_use]
pub fn medium(material: &Material, index: usize) -> u32 {
    let priority = (material.priority.clamp(-0x7fff, 0x7fff) + 0x8000) as u32;
    priority << 16 | (index as u32 + 1)
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DQuat};

    use super::*;
    use crate::optics::frame::transformed_normal;

    #[test]
    fn normals_stay_perpendicular_under_any_transform() {
        let tangents = [DVec3::new(1.0, 0.3, -0.2), DVec3::new(-0.4, 2.0, 0.7)];
        let normal = tangents[0].cross(tangents[1]);
        for scale in [DVec3::new(1e-9, 3.0, 2.0), DVec3::new(-1.0, 1.0, 1.0), DVec3::new(1e6, -2.0, -5.0)] {
            let world_from_object = DAffine3::from_scale_rotation_translation(
                scale,
                DQuat::from_rotation_y(0.7),
                DVec3::new(1e7, 0.0, 0.0),
            );
            let instance = shared_instance(
                &Placement {
                    world_from_object,
                    mesh: 0,
                    flipped: false,
                    normals_flipped: false,
                    sheet: false,
                    first_triangle: 0,
                },
                DVec3::new(1e7, 1.0, 0.0),
                3,
            );
            let columns = instance.normal_from_object.map(|c| glam::Vec3::from(c).as_dvec3());
            let n = (columns[0] * normal.x + columns[1] * normal.y + columns[2] * normal.z).normalize();
            let m = world_from_object.matrix3;
            let exact = transformed_normal(m.x_axis, m.y_axis, m.z_axis, normal);
            assert!(n.distance(exact) < 1e-6, "{scale}: {n}, not {exact}");
            for t in tangents {
                let t = world_from_object.transform_vector3(t).normalize();
                assert!(n.dot(t).abs() < 1e-6, "{scale}: {}", n.dot(t));
            }
            // Normals stay outside: the transform of a point just above the surface is on the normal's side.
            assert!(n.dot(world_from_object.transform_vector3(normal)) > 0.0, "{scale}");
            assert_eq!(instance.rel_from_object[3], [0.0, -1.0, 0.0]);
            assert_eq!(instance.handedness < 0.0, scale.x * scale.y * scale.z < 0.0);
        }
    }
}
