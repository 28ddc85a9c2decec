//! Warnings of a plan: parts of a scene that the chosen rungs simplify or omit, and rungs that change nothing.

use super::knobs::Knobs;
use super::knobs::rungs::{Absorption, Indirect, Lobes, Quadrature, Reflection};
use super::surfaces::{Surfaces, Transmission, casts_in_maps};
use crate::scene::{AlphaMode, Material};

/// One sentence for each property of these surfaces that the chosen rungs do not show, and for each rung without
/// effect.
pub(super) fn left_out(
    surfaces: &Surfaces,
    knobs: &Knobs,
    transmission: &Transmission,
    shadow_maps: bool,
) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut say = |test: &dyn Fn(&Material) -> bool, what: &str| {
        if let Some(material) = surfaces.find(test) {
            warnings.push(format!("material \"{}\" {what}", material.name));
        }
    };
    let by_rays = transmission.by_rays;
    let straight = |m: &Material| m.transmission > 0.0 && !(transmission.bends && m.alpha_mode != AlphaMode::Blend);
    let clear = |m: &Material| straight(m) || (m.transmission > 0.0 && !by_rays);
    say(&straight, "transmits light without refraction: refraction is off, or the material is alpha-blended");
    let smoothed = |m: &Material| clear(m) && m.roughness > 0.1 && knobs.indirect != Indirect::Path;
    say(&smoothed, "has a rough surface that transmits light; what is behind it is drawn clear");
    let casts = |m: &Material| !shadow_maps || casts_in_maps(m);
    say(&|m| !casts(m), "casts no shadow: shadow maps (shadows=map) contain only opaque and masked surfaces");
    let (absorption, marches) = (knobs.absorption, by_rays && knobs.absorption.steps() > 0);
    let varies = |m: &Material| m.marched_sigma().is_some();
    let instead = format!(
        "has a grid of sigma, but {absorption} with {} uses only its mean; refraction=ray with absorption=march:4 to march:64 marches \
         through the grid",
        knobs.refraction
    );
    say(&|m| varies(m) && !marches && absorption != Absorption::Off, &instead);
    if knobs.colour.bands() == 0 {
        say(
            &|m| transmission.bends && m.disperses(),
            "has dispersion, which colour=rgb does not show; colour=spectral:16 does",
        );
    }
    let (lobes, reflection) = (knobs.lobes, knobs.reflection);
    if lobes != Lobes::default() && reflection != Reflection::Ray {
        warnings.push(format!("{lobes} changes nothing: {reflection} traces no rays"));
    } else if lobes != Lobes::All && knobs.indirect == Indirect::Path {
        warnings.push(format!("{lobes} changes nothing: indirect=path samples every lobe"));
    }
    let rule = knobs.quadrature;
    if rule != Quadrature::default() && !(marches && surfaces.any(varies)) {
        warnings.push(format!("{rule} changes nothing: no medium is ray-marched"));
    }
    warnings
}
