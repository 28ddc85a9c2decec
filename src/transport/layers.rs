//! Layered BSDF in f64: the twin of shaders/lib/layers.glsl for rays on the host, which are photons
//! ([`super::photon_guiding`]) and the ray of a picked pixel ([`super::events`]). BSDF sampling chooses a layer by its
//! share of the energy, then a direction of its lobe.
//!
//! Read pbrt (4th ed.), chapter 9 (BSDFs) and section 14.3 (layered materials); Schmidt and Budge 2002, "Simple Nested
//! Dielectrics in Ray Traced Images"; the glTF extensions `KHR_materials_clearcoat`, `KHR_materials_specular`,
//! `KHR_materials_transmission` and `KHR_materials_volume`.
//!
//! From the top: a clear coat; the base, which is a dielectric interface, a conductor, or a mixture of both; below the
//! interface a diffuse base layer, or transmission. A layer passes on the energy left under its Fresnel reflectance at
//! the ray's angle. Fresnel terms are exact. Only the factors of a material count: photons take texels and vertex
//! colours as 1, and the rays of a picked pixel multiply them into the factors first ([`super::surface_point`]).

use glam::DVec3;

use crate::optics::brdf::visible_half_vector;
use crate::optics::fresnel::{fresnel_conductor, fresnel_dielectric, nested_f0, normal_reflectance, schlick};
use crate::optics::snell::{reflect, refract};
use crate::scene::lobe::{IRIDESCENCE, LOBES};
use crate::scene::material::Material;
use crate::scene::solid::{Solids, media_at};
use crate::scene::{AlphaMode, Scene, TextureRef};
use crate::share::COAT_INDEX;
pub use crate::share::MIN_ROUGHNESS as SMOOTHEST;

/// The media around a ray as materials, in the order in which the ray entered them (nested dielectrics,
/// shaders/lib/media.glsl).
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Media(Vec<usize>);

impl Media {
    /// The media that contain a point.
    #[must_use]
    pub fn at(scene: &Scene, solids: &Solids, p_world: DVec3) -> Self {
        let bodies = media_at(scene, solids, p_world);
        let material = |instance: usize| scene.meshes[scene.instances[instance].mesh].material;
        Self(bodies.into_iter().map(|instance| solids.medium[material(instance)]).collect())
    }

    /// The medium of the highest priority; of several the one entered last.
    fn present(&self, scene: &Scene) -> Option<usize> {
        self.0.iter().copied().max_by_key(|&material| scene.materials[material].priority)
    }

    /// The interface at a surface for a ray in these media (nested dielectrics, shaders/lib/boundary.glsl). `front`:
    /// the ray meets the outer side; `index`: index of refraction of a material at the ray's wavelength.
    #[must_use]
    pub fn cross(
        &self,
        scene: &Scene,
        solids: &Solids,
        instance: usize,
        front: bool,
        index: impl Fn(&Material) -> f64,
    ) -> Boundary {
        let material = scene.meshes[scene.instances[instance].mesh].material;
        let of = |medium: Option<usize>| medium.map_or(1.0, |medium| index(&scene.materials[medium]));
        let mut beyond = self.clone();
        let present = self.present(scene);
        let ior = index(&scene.materials[material]);
        if !solids.solid[instance] {
            return Boundary { before: of(present), behind: ior, ior, body: false, hidden: false, beyond };
        }
        let medium = solids.medium[material];
        let entered = self.0.iter().rposition(|&known| known == medium);
        match (front, entered) {
            (true, _) => beyond.0.push(medium),
            (false, Some(place)) => drop(beyond.0.remove(place)),
            (false, None) => {}
        }
        // A medium that the ray leaves without having entered it was around the ray from its start.
        let here = if front || entered.is_some() { present } else { Some(medium) };
        let there = beyond.present(scene);
        Boundary { before: of(here), behind: of(there), ior, body: true, hidden: here == there, beyond }
    }
}

/// An interface between two media.
#[derive(Debug, Clone, PartialEq)]
pub struct Boundary {
    /// Index of refraction on the ray's side.
    pub before: f64,
    /// Index of refraction on the other side; at a surface without an interior, that of its dielectric part.
    pub behind: f64,
    /// Index of refraction of the surface's dielectric part.
    pub ior: f64,
    /// Whether the surface belongs to a closed dielectric mesh.
    pub body: bool,
    /// Whether a medium of higher priority suppresses the interface: the ray passes unchanged.
    pub hidden: bool,
    /// The media of a ray that has passed through.
    pub beyond: Media,
}

/// A layer of the BSDF: the way on which light continues.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layer {
    /// Specular reflection by the clear coat.
    Coat,
    /// Specular reflection by the base.
    Base,
    /// Diffuse reflection by the base layer.
    Ground,
    /// Transmission.
    Through,
}

impl Layer {
    /// All layers, from the top.
    pub const ALL: [Self; 4] = [Self::Coat, Self::Base, Self::Ground, Self::Through];
}

/// The layers of a surface at an angle of incidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layers {
    /// Share of the energy in each of [`Layer::ALL`], per channel; the rest is absorbed.
    shares: [DVec3; 4],
    /// Perceptual roughness of coat and of base.
    roughness: [f32; 2],
    /// Fresnel reflectance of the dielectric and of the metallic part of the base, before the mixture of both.
    pub fresnel: [DVec3; 2],
    /// Relative index of refraction: behind the surface over before it.
    pub ratio: f64,
    /// Whether the surface belongs to a closed dielectric mesh.
    body: bool,
    /// Whether reflection is total at this angle (F6).
    pub total: bool,
}

fn rgb([r, g, b]: [f32; 3]) -> DVec3 {
    DVec3::new(r.into(), g.into(), b.into())
}

fn base_color(m: &Material) -> DVec3 {
    let [r, g, b, _] = m.base_color;
    rgb([r, g, b])
}

/// Fresnel reflectance of the interface, normalised: 0 is its value at normal incidence, 1 at grazing incidence and
/// under total reflection; 0 between equal indices.
fn boundary_share(cos: f64, before: f64, behind: f64) -> f64 {
    if before == behind {
        return 0.0;
    }
    let f0 = nested_f0(before, behind);
    ((fresnel_dielectric(cos, behind / before)[0] - f0) / (1.0 - f0).max(1e-12)).clamp(0.0, 1.0)
}

/// Fresnel reflectance of the dielectric part, from the normalised reflectance `share`. KHR_materials_specular tints
/// F0, so the exact curve is rescaled between F0 and F90; a tint in air applies between two media, too. An index of 1
/// has nothing in air that could be tinted, and reflects between two media like any other.
fn fresnel_of_dielectric(m: &Material, at: &Boundary, share: f64) -> DVec3 {
    let specular = f64::from(m.specular);
    let (in_air, between) = (nested_f0(1.0, at.ior), nested_f0(at.before, at.behind));
    // An interface between equal indices reflects nothing, at any angle.
    let f90 = if at.before == at.behind { 0.0 } else { 1.0 };
    let (f0, f90) = match in_air > 0.0 {
        true => ((rgb(m.specular_color) * in_air).min(DVec3::ONE) * specular * (between / in_air), specular * f90),
        false => (DVec3::splat(between), f90),
    };
    f0 + (DVec3::splat(f90) - f0) * share
}

/// Fresnel reflectance of the conductor part, in a medium: Schlick's approximation when only a colour is known;
/// otherwise n and κ, tinted by the ratio of the colour to their reflectance at normal incidence.
fn fresnel_of_metal(m: &Material, n_outside: f64, cos: f64) -> DVec3 {
    let f0 = base_color(m);
    let curve = |f0: f64, index: Option<[f64; 2]>| match index {
        Some([n, kappa]) => {
            let tint = f0 / normal_reflectance(n, kappa);
            tint * fresnel_conductor(cos, n / n_outside, kappa / n_outside)[0]
        }
        None => schlick(f0, 1.0, cos),
    };
    DVec3::from([0, 1, 2].map(|c| curve(f0[c], m.conductor.map(|index| index[c].map(f64::from)))))
}

/// Fresnel reflectance of the clear coat, in a medium.
fn fresnel_of_coat(m: &Material, n_outside: f64, cos: f64) -> f64 {
    if m.clearcoat == 0.0 {
        return 0.0;
    }
    f64::from(m.clearcoat) * fresnel_dielectric(cos, f64::from(COAT_INDEX) / n_outside)[0]
}

impl Layers {
    /// The layers of a surface at an angle of incidence, given by its cosine. Unlit surfaces reflect nothing.
    #[must_use]
    pub fn of(m: &Material, at: &Boundary, cos: f64) -> Self {
        // Coats and metals of closed meshes are evaluated as from air on both sides.
        let n_outside = if at.body { 1.0 } else { at.before };
        let share = boundary_share(cos, at.before, at.behind);
        let total = at.body && share >= 1.0;
        let f_dielectric = if total { DVec3::ONE } else { fresnel_of_dielectric(m, at, share) };
        let [metallic, transmission] = [m.metallic, m.transmission].map(f64::from);
        let coat = fresnel_of_coat(m, n_outside, cos);
        let f_metal = if metallic > 0.0 { fresnel_of_metal(m, n_outside, cos) } else { f_dielectric };
        let base = f_dielectric.lerp(f_metal, metallic);
        // The largest component, so that a tinted F0 causes no complementary colour below. Metals have no layer below.
        let enters = (1.0 - f_dielectric.max_element()) * (1.0 - metallic);
        let color = base_color(m);
        // Light enters and leaves a closed mesh, and each crossing takes the square root of the colour.
        let tint = if at.body { color.map(f64::sqrt) } else { color };
        let ground = color * (enters * (1.0 - transmission));
        let through = tint * (enters * transmission);
        let shown = if m.unlit { 0.0 } else { 1.0 };
        let below = |share: DVec3| share * ((1.0 - coat) * shown);
        let straight = at.body && at.before == at.behind;
        Self {
            shares: [DVec3::splat(coat * shown), below(base), below(ground), below(through)],
            roughness: [m.clearcoat_roughness, if straight { 0.0 } else { m.roughness }],
            fresnel: [f_dielectric, f_metal],
            ratio: at.behind / at.before,
            body: at.body,
            total,
        }
    }

    /// The energy share of a layer, per channel.
    #[must_use]
    pub fn share(&self, layer: Layer) -> DVec3 {
        self.shares[layer as usize]
    }

    /// Whether a layer scatters (diffuse or glossy) instead of having a specular (delta) lobe: its roughness exceeds
    /// `roughest`.
    #[must_use]
    pub fn spreads(&self, layer: Layer, roughest: f32) -> bool {
        match layer {
            Layer::Coat => self.roughness[0] > roughest,
            Layer::Base | Layer::Through => self.roughness[1] > roughest,
            Layer::Ground => true,
        }
    }

    /// Whether some layer with energy scatters, given the roughness limit `roughest`.
    #[must_use]
    pub fn spreads_some(&self, roughest: f32) -> bool {
        Layer::ALL.into_iter().any(|layer| self.share(layer) != DVec3::ZERO && self.spreads(layer, roughest))
    }

    /// Samples a layer in proportion to its mean energy share; `None` when the light is absorbed. `x` is uniform in [0,
    /// 1).
    #[must_use]
    pub fn sample(&self, x: f64) -> Option<Layer> {
        let mut before = 0.0;
        Layer::ALL.into_iter().find(|&layer| {
            before += self.share(layer).element_sum() / 3.0;
            x < before
        })
    }

    /// The half vector of reflection or refraction of light from `direction`: the normal for a specular lobe, otherwise
    /// a visible normal (VNDF) sampled with two uniform numbers in [0, 1).
    #[must_use]
    pub fn half_vector(&self, layer: Layer, direction: DVec3, n: DVec3, u: [f64; 2]) -> DVec3 {
        if !self.spreads(layer, SMOOTHEST) {
            return n;
        }
        let roughness = self.roughness[usize::from(layer != Layer::Coat)];
        let (x, y) = n.any_orthonormal_pair();
        let v = DVec3::new(-direction.dot(x), -direction.dot(y), -direction.dot(n));
        let h = visible_half_vector(v, [f64::from(roughness).powi(2); 2], u);
        x * h.x + y * h.y + n * h.z
    }

    /// The outgoing direction of light from `direction` at a half vector, for any layer but the diffuse one. The
    /// shading normal and the geometric normal are on the side of the incident light. `None` when a rough lobe leaves
    /// on the wrong side, and beyond the critical angle.
    #[must_use]
    pub fn direction(&self, layer: Layer, direction: DVec3, [n, flat]: [DVec3; 2], h: DVec3) -> Option<DVec3> {
        let rough = self.spreads(layer, SMOOTHEST);
        if layer == Layer::Through && self.body && self.ratio != 1.0 {
            let (bent, total, _) = refract(direction, h, self.ratio);
            return if total { None } else { on_side(bent, -flat, rough) };
        }
        let mirrored = reflect(direction, h);
        let up = mirrored.dot(n);
        match layer {
            _ if rough && up <= 0.0 => None,
            // A rough thin-walled surface transmits its reflected lobe, mirrored to the other side.
            Layer::Through if rough => on_side(mirrored - 2.0 * up * n, -flat, rough),
            Layer::Through => Some(direction),
            _ => on_side(mirrored, flat, rough),
        }
    }
}

/// Keeps a direction on one side of the geometric normal `flat`: a specular direction on the wrong side is mirrored
/// back, a rough one is discarded.
fn on_side(direction: DVec3, flat: DVec3, rough: bool) -> Option<DVec3> {
    let wrong = direction.dot(flat).min(0.0);
    (!rough || wrong == 0.0).then(|| direction - 2.0 * wrong * flat)
}

/// Opacity of a surface from its alpha; `None` when a texture decides.
#[must_use]
pub fn coverage(m: &Material) -> Option<f64> {
    let alpha = m.base_color[3];
    match m.alpha_mode {
        AlphaMode::Opaque => Some(1.0),
        _ if m.base_color_texture.is_some() => None,
        AlphaMode::Mask(cutoff) => Some(f64::from(u8::from(alpha >= cutoff))),
        AlphaMode::Blend => Some(f64::from(alpha.clamp(0.0, 1.0))),
    }
}

/// Whether the base of a surface in air has specular reflection. An index of refraction of 1 reflects nothing, but a
/// film on it does.
#[must_use]
pub fn mirrors(m: &Material) -> bool {
    let film = || LOBES[IRIDESCENCE].is_on(&m.lobes[IRIDESCENCE]);
    m.metallic > 0.0 || (m.specular > 0.0 && m.ior != 1.0) || (m.ior == 1.0 && film())
}

/// Whether a material may enclose others in a medium of another index than 1, in which an index of 1 reflects and
/// refracts.
#[must_use]
pub fn immerses(m: &Material) -> bool {
    m.transmission > 0.0 && m.thickness > 0.0 && m.ior != 1.0 && m.alpha_mode != AlphaMode::Blend
}

/// Whether a surface has a specular (delta) lobe of reflection or transmission. A texture only lowers a factor.
#[must_use]
pub fn is_smooth(m: &Material) -> bool {
    let base = m.roughness <= SMOOTHEST && !m.has_direction() && (mirrors(m) || m.transmission > 0.0);
    let coat = m.clearcoat > 0.0 && m.clearcoat_roughness <= SMOOTHEST;
    !m.unlit && coverage(m).is_some_and(|share| share > 0.0) && (base || coat)
}

/// Whether a surface may deflect light by a delta lobe: some texel is smooth, of what reflects, of a coat, or of what
/// refracts. `immersed`: whether some material of the scene [immerses] it.
#[must_use]
pub fn deflects(scene: &Scene, m: &Material, immersed: bool) -> bool {
    // Roughness is in the green channel, and a texture scales the factor.
    let smoothest = |factor: f32, texture: Option<TextureRef>| {
        let texels = texture.filter(|_| factor > SMOOTHEST).map(|texture| &scene.images[texture.image].rgba);
        let least = texels.and_then(|rgba| rgba.as_chunks::<4>().0.iter().map(|texel| texel[1]).min());
        factor * least.map_or(1.0, |least| f32::from(least) / 255.0)
    };
    let bends = mirrors(m) || (m.transmission > 0.0 && m.ior != 1.0) || (m.ior == 1.0 && immersed);
    let base = bends && !m.has_direction() && smoothest(m.roughness, m.metallic_roughness_texture) <= SMOOTHEST;
    let coat = m.clearcoat > 0.0 && smoothest(m.clearcoat_roughness, m.clearcoat_roughness_texture) <= SMOOTHEST;
    !m.unlit && coverage(m) != Some(0.0) && (base || coat)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::snell::{brewster_angle, critical_angle};
    use crate::share::COAT_F0;

    const COSINES: [f64; 6] = [1.0, 0.9, 0.6, 0.3, 0.05, 1e-6];

    fn white() -> Material {
        Material { metallic: 0.0, ..Material::default() }
    }

    /// An interface between two media, of a closed mesh or of a surface without an interior.
    fn between(before: f64, behind: f64, body: bool) -> Boundary {
        let ior = before.max(behind);
        Boundary { before, behind, ior, body, hidden: false, beyond: Media::default() }
    }

    fn layers(m: &Material, cos: f64) -> Layers {
        Layers::of(m, &between(1.0, m.ior.into(), false), cos)
    }

    fn sum(layers: &Layers) -> DVec3 {
        Layer::ALL.into_iter().map(|layer| layers.share(layer)).sum()
    }

    fn near(found: DVec3, expected: DVec3) {
        assert!((found - expected).abs().max_element() < 1e-12, "{found} for {expected}");
    }

    #[test]
    fn what_is_white_keeps_all_light() {
        let [glass, half] = [1.0, 0.5].map(|transmission| Material { transmission, ..white() });
        for m in [white(), glass, half, Material { metallic: 1.0, ..white() }] {
            for clearcoat in [0.0, 0.5, 1.0] {
                let m = Material { clearcoat, ..m.clone() };
                for at in [between(1.0, 1.5, true), between(1.5, 1.0, true), between(1.0, 1.5, false)] {
                    // White metals, whose colour is 1, hide as much of the dielectric part as they reflect.
                    COSINES.iter().for_each(|&cos| near(sum(&Layers::of(&m, &at, cos)), DVec3::ONE));
                }
            }
        }
    }

    #[test]
    fn nothing_sends_more_than_it_receives() {
        let gold = Some([[0.18, 3.43], [0.42, 2.35], [1.37, 1.77]]);
        for (metallic, conductor) in [(0.0, None), (0.5, None), (0.5, gold), (1.0, gold)] {
            let tinted = Material { specular_color: [1.0, 0.3, 0.0], specular: 0.7, metallic, conductor, ..white() };
            for (transmission, clearcoat) in [(0.0, 0.0), (0.6, 0.3), (1.0, 1.0)] {
                // Conductors with n and kappa reflect at most their reflectance.
                let color = [0.9, 0.7, 0.3, 1.0];
                let m = Material { transmission, clearcoat, base_color: color, ..tinted.clone() };
                for cos in COSINES {
                    let all = sum(&layers(&m, cos));
                    assert!(all.max_element() <= 1.0 + 1e-6 && all.min_element() >= 0.0, "{all}");
                }
            }
        }
    }

    #[test]
    fn a_dielectric_mirrors_a_25th_from_the_front_and_all_from_the_side() {
        near(layers(&white(), 1.0).share(Layer::Base), DVec3::splat(0.04));
        near(layers(&white(), 1.0).share(Layer::Ground), DVec3::splat(0.96));
        near(layers(&white(), 0.0).share(Layer::Base), DVec3::ONE);
        // Between water and glass: ((1.5 − 1.25) / (1.5 + 1.25))² = 1/121.
        let under_water = Layers::of(&white(), &between(1.25, 1.5, false), 1.0);
        near(under_water.share(Layer::Base), DVec3::splat(1.0 / 121.0));
        // A bubble of air in glass, whose own index says nothing of what it reflects.
        for cos in COSINES {
            let bubble = Boundary { ior: 1.0, ..between(1.5, 1.0, true) };
            let share = Layers::of(&Material { ior: 1.0, ..white() }, &bubble, cos).share(Layer::Base);
            near(share, DVec3::splat(fresnel_dielectric(cos, 1.0 / 1.5)[0]));
        }
    }

    /// At Brewster's angle r_p is 0 and r_s is (1 − n²)/(1 + n²).
    #[test]
    fn brewsters_angle_leaves_one_polarisation() {
        let m = Material { transmission: 1.0, ..white() };
        for (before, behind) in [(1.0_f64, 1.5_f64), (1.5, 1.0), (1.25, 1.5)] {
            let n2 = (behind / before).powi(2);
            let [_, cos] = brewster_angle(before, behind);
            let half = 0.5 * ((1.0 - n2) / (1.0 + n2)).powi(2);
            near(Layers::of(&m, &between(before, behind, true), cos).share(Layer::Base), DVec3::splat(half));
        }
    }

    #[test]
    fn nothing_leaves_glass_beyond_the_critical_angle() {
        let m = Material { transmission: 1.0, ior: 1.5, ..white() };
        let [_, _, _, critical] = critical_angle(1.5, 1.0);
        let inside = |cos: f64| Layers::of(&m, &between(1.5, 1.0, true), cos);
        let beyond = inside(critical - 1e-9);
        assert!(beyond.total && beyond.share(Layer::Through) == DVec3::ZERO);
        near(beyond.share(Layer::Base), DVec3::ONE);
        assert!(!inside(critical + 1e-6).total && inside(critical + 1e-6).share(Layer::Through).x > 0.0);
        // A surface without an interior has no total internal reflection.
        assert!(!Layers::of(&m, &between(1.5, 1.0, false), critical - 1e-9).total);
    }

    #[test]
    fn a_coat_takes_its_share_from_what_lies_below() {
        assert!((f64::from(COAT_F0) - nested_f0(1.0, COAT_INDEX.into())).abs() < 1e-8);
        let gold = [0.9, 0.6, 0.3, 1.0];
        let m = Material { metallic: 1.0, clearcoat: 0.5, base_color: gold, ..Material::default() };
        let found = layers(&m, 1.0);
        near(found.share(Layer::Coat), DVec3::splat(0.02));
        near(found.share(Layer::Base), base_color(&m) * 0.98);
        let steep = layers(&m, 0.3);
        let coat = 0.5 * fresnel_dielectric(0.3, 1.5)[0];
        near(steep.share(Layer::Coat), DVec3::splat(coat));
        near(steep.share(Layer::Base), base_color(&m).map(|f0| schlick(f0, 1.0, 0.3)) * (1.0 - coat));
    }

    #[test]
    fn metal_transmits_nothing_and_has_no_ground() {
        let m = Material { transmission: 0.5, metallic: 0.25, ..white() };
        let dielectric = layers(&Material { metallic: 0.0, ..m.clone() }, 0.8);
        let mixed = layers(&m, 0.8);
        for layer in [Layer::Ground, Layer::Through] {
            near(mixed.share(layer), dielectric.share(layer) * 0.75);
        }
        near(layers(&Material { metallic: 1.0, ..m }, 0.8).share(Layer::Base), DVec3::ONE);
    }

    /// Numbers from Fresnel's equations with complex numbers (Born and Wolf 14.2): at normal incidence, and in water.
    #[test]
    fn a_metal_by_n_and_kappa_reflects_as_its_index_says() {
        let index = [[0.25_f32, 3.0], [0.5, 2.0], [1.5, 2.0]];
        let f0 = index.map(|[n, kappa]| normal_reflectance(n.into(), kappa.into()));
        let [r, g, b] = f0.map(|f0| f0 as f32);
        let m = Material { conductor: Some(index), base_color: [r, g, b, 1.0], ..Material::default() };
        let from_air = layers(&m, 1.0).share(Layer::Base);
        assert!((from_air - DVec3::from(f0)).abs().max_element() < 1e-7, "{from_air}");
        let in_water = Layers::of(&m, &between(1.25, 1.5, false), 1.0).share(Layer::Base);
        let expected = index.map(|[n, kappa]| normal_reflectance(f64::from(n) / 1.25, f64::from(kappa) / 1.25));
        assert!((in_water - DVec3::from(expected)).abs().max_element() < 1e-7, "{in_water}");
    }

    #[test]
    fn specular_tints_and_weakens_the_dielectric() {
        let m = Material { specular: 0.5, specular_color: [1.0, 0.5, 0.0], ..white() };
        near(layers(&m, 1.0).share(Layer::Base), DVec3::new(0.02, 0.01, 0.0));
        near(layers(&m, 0.0).share(Layer::Base), DVec3::splat(0.5));
        // The diffuse base layer gets the energy that the largest component leaves.
        near(layers(&m, 1.0).share(Layer::Ground), DVec3::splat(0.98));
    }

    #[test]
    fn layers_are_drawn_as_often_as_they_send_light() {
        let m = Material { transmission: 0.25, clearcoat: 1.0, base_color: [0.8, 0.5, 0.2, 1.0], ..white() };
        let found = layers(&m, 0.5);
        let mut counts = [0_u32; 5];
        for i in 0..10_000 {
            counts[found.sample((f64::from(i) + 0.5) / 10_000.0).map_or(4, |layer| layer as usize)] += 1;
        }
        let absorbed = 1.0 - sum(&found).element_sum() / 3.0;
        let shares = Layer::ALL.map(|layer| found.share(layer).element_sum() / 3.0);
        for (count, share) in counts.into_iter().zip(shares.into_iter().chain([absorbed])) {
            assert!((f64::from(count) / 10_000.0 - share).abs() < 2e-4, "{counts:?}, {shares:?}");
        }
    }

    /// Glossy directions stay on their side; a specular lobe has one reflected and one refracted direction for all
    /// random numbers.
    #[test]
    fn directions_leave_on_the_side_of_their_layer() {
        let direction = DVec3::new(0.6, 0.0, -0.8);
        for roughness in [0.0, 0.4] {
            let glass = Material { transmission: 1.0, roughness, clearcoat: 1.0, clearcoat_roughness: 0.0, ..white() };
            let found = Layers::of(&glass, &between(1.0, 1.5, true), 0.8);
            assert_eq!(found.spreads(Layer::Through, SMOOTHEST), roughness > 0.0);
            assert!(!found.spreads(Layer::Coat, SMOOTHEST));
            for u in [[0.1, 0.2], [0.5, 0.9], [0.8, 0.4]] {
                let at = |layer| {
                    let h = found.half_vector(layer, direction, DVec3::Z, u);
                    found.direction(layer, direction, [DVec3::Z; 2], h)
                };
                let [mirrored, bent] = [DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.4, 0.0, -0.84_f64.sqrt())];
                near(at(Layer::Coat).expect("a mirror"), mirrored);
                let [base, through] = [Layer::Base, Layer::Through].map(|layer| at(layer).expect("a direction"));
                assert!(base.z > 0.0 && through.z < 0.0 && (through.length() - 1.0).abs() < 1e-12);
                assert_eq!([base.distance(mirrored) < 1e-12, through.distance(bent) < 1e-12], [roughness == 0.0; 2]);
            }
        }
        let sheet = Material { transmission: 1.0, roughness: 0.0, ..white() };
        assert_eq!(layers(&sheet, 0.8).direction(Layer::Through, direction, [DVec3::Z; 2], DVec3::Z), Some(direction));
    }
}
