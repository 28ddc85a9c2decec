//! What materials in use mean for a plan.

use super::effect::Cause;
use super::facts::Facts;
use super::work::March;
use crate::scene::{AlphaMode, Material, Meaning, Scene};
pub use crate::transport::layers::mirrors;

/// What lets light through, and how.
pub(super) struct Transmission {
    /// A knob shows it bent …
    pub(super) bends: bool,
    /// … by rays.
    pub(super) by_rays: bool,
    pub(super) see_through: bool,
    pub(super) march: March,
}

/// Whether a surface is laid over what lies behind it, in passes of its own: blended surfaces, and transmissive ones where
/// no rays refract in them (`refracting_rays`).
#[must_use]
pub fn is_see_through(material: &Material, refracting_rays: bool) -> bool {
    material.alpha_mode == AlphaMode::Blend || (material.transmission > 0.0 && !refracting_rays)
}

/// Whether a surface is drawn into shadow maps. What lets light through does not stop it there: it passes unweakened.
#[must_use]
pub fn casts_in_maps(material: &Material) -> bool {
    !is_see_through(material, false)
}

/// Whether some of the light that a surface receives leaves it in all directions.
pub(super) fn scatters(material: &Material) -> bool {
    let by_lobes = material.lobes().any(|(lobe, of)| lobe.scatters && lobe.is_on(of));
    let by_ground = (material.metallic < 1.0 || material.metallic_roughness_texture.is_some())
        // Metal transmits nothing.
        && (material.transmission < 1.0 || material.metallic > 0.0 || material.transmission_texture.is_some())
        && material.base_color[..3] != [0.0; 3];
    !material.unlit && (by_ground || by_lobes)
}

/// Whether a surface treats wavelengths differently.
pub(super) fn by_wavelength(m: &Material) -> bool {
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
        || m.textures().any(|(.., meaning, texture)| meaning == Meaning::Color && texture.is_some())
}

/// Whether a surface bends light.
pub(super) fn refracts(material: &Material) -> bool {
    material.transmission > 0.0 && material.alpha_mode != AlphaMode::Blend
}

/// Whether a surface or its coat mirrors, with a perceptual roughness up to `roughest`.
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
    .chain(material.lobes.iter().flat_map(|of| &of.textures))
    .any(Option::is_some)
}

/// The materials of what is drawn, with what is known of their surfaces.
pub(super) struct Surfaces<'a> {
    used: Vec<Used<'a>>,
    facts: &'a Facts,
}

struct Used<'a> {
    index: usize,
    material: &'a Material,
    /// Of its instances those that enclose a medium, and all.
    closed: usize,
    instances: usize,
    /// Some mesh has colours.
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

    /// The first material in use on a mesh whose vertices are coloured.
    pub(super) fn with_colours(&self) -> Option<&'a Material> {
        self.used.iter().find(|used| used.coloured).map(|used| used.material)
    }

    pub(super) fn find(&self, test: impl Fn(&Material) -> bool) -> Option<&'a Material> {
        self.used.iter().map(|used| used.material).find(|material| test(material))
    }

    /// For an effect, where a material in use passes a test; with the first one that does.
    pub(super) fn cause(&self, test: impl Fn(&Material) -> bool, says: impl Fn(&Material) -> String) -> Cause {
        let found: Vec<&Used> = self.used.iter().filter(|used| test(used.material)).collect();
        let Some(first) = found.first() else {
            let form = &self.facts.form;
            return Cause::against("no material in use has it")
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

    /// Whether a material that lets light through encloses nothing, at least in one place.
    pub(super) fn is_sheet(&self, material: &Material) -> bool {
        let used = self.used.iter().find(|used| std::ptr::eq(used.material, material));
        used.is_some_and(|used| used.closed < used.instances)
    }

    /// A sentence's end about a material that lets light through.
    pub(super) fn body(&self, material: &Material) -> String {
        let used = self.used.iter().find(|used| std::ptr::eq(used.material, material));
        let closed = match used.map(|used| (used.closed, used.instances)) {
            Some((closed, all)) if closed == all => "closed".to_owned(),
            Some((closed, all)) if closed > 0 => format!("closed in {closed} of {all} places"),
            _ => "a sheet".to_owned(),
        };
        let bends = if material.ior == 1.0 { ", which bends nothing" } else { "" };
        format!(
            "has transmission {}, thickness {} m, n = {}{bends}; {closed}",
            material.transmission, material.thickness, material.ior
        )
    }
}
