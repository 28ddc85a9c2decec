//! Materials in use, and their properties that a plan depends on.

use super::effect::Cause;
use super::facts::Facts;
use super::work::March;
use crate::scene::lobe::SHEEN;
use crate::scene::{AlphaMode, Material, Meaning, Scene};
use crate::transport::layers::immerses;
pub use crate::transport::layers::mirrors;

/// How transmissive and alpha-blended surfaces are rendered.
pub(super) struct Transmission {
    /// Refraction is shown, by rays or in screen space.
    pub(super) bends: bool,
    /// Refraction is shown by rays.
    pub(super) by_rays: bool,
    pub(super) transparency: bool,
    pub(super) march: March,
}

/// Whether a surface is drawn by order-independent transparency: an alpha-blended surface, or a transmissive one when
/// no rays refract (`refracting_rays`).
#[must_use]
pub fn is_transparent(material: &Material, refracting_rays: bool) -> bool {
    material.alpha_mode == AlphaMode::Blend || (material.transmission > 0.0 && !refracting_rays)
}

/// Whether a surface is drawn into shadow maps. Transparent and transmissive surfaces are not: light passes
/// unattenuated.
#[must_use]
pub fn casts_in_maps(material: &Material) -> bool {
    !is_transparent(material, false)
}

/// Whether a surface has a diffuse part: it scatters some of its incident light into all directions.
pub(super) fn scatters(material: &Material) -> bool {
    let by_lobes = material.lobes().any(|(lobe, of)| lobe.scatters && lobe.is_on(of));
    let by_ground = (material.metallic < 1.0 || material.metallic_roughness_texture.is_some())
        // Metals do not transmit.
        && (material.transmission < 1.0 || material.metallic > 0.0 || material.transmission_texture.is_some())
        && material.base_color[..3] != [0.0; 3];
    !material.unlit && (by_ground || by_lobes)
}

/// Whether the surface depends on wavelength; `is_coloured` tells of an image whether some texel is not grey.
pub(super) fn by_wavelength(m: &Material, is_coloured: impl Fn(usize) -> bool) -> bool {
    let differ = |rgb: &[f32]| rgb[0] != rgb[1] || rgb[1] != rgb[2];
    differ(&m.base_color[..3])
        || differ(&m.emissive)
        || differ(&m.specular_color)
        || (m.attenuation_distance.is_finite() && differ(&m.attenuation_color))
        || m.reflectance.is_some()
        || m.emission.is_some()
        || m.conductor.is_some()
        || m.dispersion.disperses(f64::from(m.ior))
        || m.marched_sigma().is_some_and(|grid| grid.channels() > 1)
        || m.lobes().any(|(lobe, of)| lobe.colour(of).is_some_and(|colour| differ(&colour)))
        || m.lobes().any(|(lobe, of)| lobe.by_wavelength && lobe.is_on(of))
        || m.textures().any(|(.., meaning, texture)| {
            meaning == Meaning::Color && texture.is_some_and(|texture| is_coloured(texture.image))
        })
}

/// Whether a surface refracts light.
pub(super) fn refracts(material: &Material) -> bool {
    material.transmission > 0.0 && material.alpha_mode != AlphaMode::Blend
}

/// Whether a surface or its coat has specular reflection with a perceptual roughness up to `roughest`.
pub(super) fn is_smooth(m: &Material, roughest: f32) -> bool {
    let base = mirrors(m) && (m.roughness <= roughest || m.metallic_roughness_texture.is_some());
    let coat = m.clearcoat > 0.0 && (m.clearcoat_roughness <= roughest || m.clearcoat_roughness_texture.is_some());
    !m.unlit && (base || coat)
}

pub(super) fn has_layers(material: &Material) -> bool {
    [
        material.clearcoat_texture,
        material.clearcoat_roughness_texture,
        material.specular_texture,
        material.transmission_texture,
        material.thickness_texture,
    ]
    .iter()
    .chain(&material.lobes[SHEEN].textures)
    .any(Option::is_some)
}

/// Whether textures or tangents give a surface what `packed_lobes` of shaders/lib/texels.glsl holds.
pub(super) fn has_lobe_texels(material: &Material) -> bool {
    let others = material.lobes.iter().skip(SHEEN + 1).flat_map(|of| &of.textures);
    material.has_direction() || others.chain([&material.specular_color_texture]).any(Option::is_some)
}

/// The materials in use, with facts about their surfaces.
pub(super) struct Surfaces<'a> {
    used: Vec<Used<'a>>,
    facts: &'a Facts,
}

struct Used<'a> {
    index: usize,
    material: &'a Material,
    /// Instances that enclose a medium; `instances` counts all.
    closed: usize,
    instances: usize,
    /// Whether some mesh of the material has vertex colours.
    coloured: bool,
}

impl<'a> Surfaces<'a> {
    pub(super) fn of(scene: &'a Scene, facts: &'a Facts) -> Self {
        let mut used: Vec<_> = scene
            .materials
            .iter()
            .enumerate()
            .map(|(index, material)| Used { index, material, closed: 0, instances: 0, coloured: false })
            .collect();
        for (i, instance) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[instance.mesh];
            if !mesh.indices.is_empty() {
                let of = &mut used[mesh.material];
                of.instances += 1;
                of.coloured |= mesh.colors.iter().any(|[r, g, b, _]| r != g || g != b);
                of.closed += usize::from(facts.solids.solid[i]);
            }
        }
        used.retain(|used| used.instances > 0);
        Self { used, facts }
    }

    pub(super) fn any(&self, test: impl Fn(&Material) -> bool) -> bool {
        self.used.iter().any(|used| test(used.material))
    }

    /// The first material in use on a mesh with vertex colours.
    pub(super) fn with_colours(&self) -> Option<&'a Material> {
        self.used.iter().find(|used| used.coloured).map(|used| used.material)
    }

    pub(super) fn find(&self, test: impl Fn(&Material) -> bool) -> Option<&'a Material> {
        self.used.iter().map(|used| used.material).find(|material| test(material))
    }

    /// The cause of an effect: the materials in use that pass a test, with the first of them as the reason.
    pub(super) fn cause(&self, test: impl Fn(&Material) -> bool, says: impl Fn(&Material) -> String) -> Cause {
        let found: Vec<&Used> = self.used.iter().filter(|used| test(used.material)).collect();
        let Some(first) = found.first() else {
            let form = &self.facts.form;
            return Cause::against("no visible material uses it")
                .with_some("black textures", &form.black)
                .with_some("alpha 1 everywhere", &form.opaque)
                .with_some("alpha 0 everywhere", &form.unseen);
        };
        let name = &first.material.name;
        let cause = Cause::of(format!("material {} \"{name}\" {}", first.index, says(first.material)));
        Cause { materials: found.iter().map(|used| used.index).collect(), ..cause }
            .with("material", name)
            .with("materials", found.len())
    }

    /// Whether a transmissive material is thin-walled: at least one of its instances is not closed.
    pub(super) fn is_sheet(&self, material: &Material) -> bool {
        let used = self.used.iter().find(|used| std::ptr::eq(used.material, material));
        used.is_some_and(|used| used.closed < used.instances)
    }

    /// A sentence's end that describes a transmissive material.
    pub(super) fn body(&self, material: &Material) -> String {
        let used = self.used.iter().find(|used| std::ptr::eq(used.material, material));
        let closed = match used.map(|used| (used.closed, used.instances)) {
            Some((closed, all)) if closed == all => "closed mesh".to_owned(),
            Some((closed, all)) if closed > 0 => format!("closed mesh in {closed} of {all} instances"),
            _ => "thin-walled".to_owned(),
        };
        let straight = material.ior == 1.0 && !self.any(immerses);
        let bends = if straight { " (no refraction)" } else { "" };
        format!(
            "has transmission {}, thickness {} m, n = {}{bends}; {closed}",
            material.transmission, material.thickness, material.ior
        )
    }
}
