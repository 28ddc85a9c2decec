//! The effects and their names.

use std::fmt::{self, Display, Formatter};

use crate::scene::lobe::LOBES;

/// [`EffectId`] and what each is called.
macro_rules! effects {
    ($( $Effect:ident = $name:literal ),+ $(,)?) => {
        /// An effect that a scene may call for.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum EffectId {
            $( #[doc = concat!("`", $name, "`.")] $Effect, )+
            /// A lobe that an extension lays over the base, by its place in [`LOBES`].
            Lobe(usize),
        }

        impl EffectId {
            /// As reports call it.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $( Self::$Effect => $name, )+
                    Self::Lobe(place) => LOBES[place].name,
                }
            }

            /// The effect of that name.
            #[must_use]
            pub fn named(name: &str) -> Option<Self> {
                let lobes = (0..LOBES.len()).map(Self::Lobe);
                [$( Self::$Effect ),+].into_iter().chain(lobes).find(|effect| effect.name() == name)
            }
        }
    };
}

effects! {
    EmissiveTextures = "emissive textures",
    ClearCoat = "clear coat",
    Layers = "layers",
    Conductors = "metals by n and kappa",
    Refraction = "refraction",
    SeeThrough = "see-through surfaces",
    VaryingMedia = "media that vary",
    Quadrature = "quadrature",
    Environment = "environment",
    MirroredEnvironment = "mirrored environment",
    PrefilteredEnvironment = "prefiltered environment",
    Mirrors = "mirrors",
    AmbientLight = "ambient light",
    PunctualLights = "punctual lights",
    Shadows = "shadows",
    LightLists = "light lists per tile",
    Paths = "paths",
    EmittingSurfaces = "surfaces that light",
    ShapedLights = "lights with a shape",
    Aims = "aims",
    Wavelengths = "bands of wavelengths",
    Dispersion = "dispersion",
    Holes = "holes before rays",
    Filters = "light through surfaces",
    Transmission = "transmission before rays",
    RoughRays = "rays by lobes",
    Frosted = "frosted surfaces",
    Absorption = "absorption",
    TouchingBodies = "bodies that touch",
}

impl Display for EffectId {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::KNOBS;

    #[test]
    fn names_lead_back_to_effects() {
        for knob in KNOBS {
            for effect in knob.effects {
                assert_eq!(EffectId::named(effect.name()), Some(*effect), "{}", knob.name);
            }
        }
        assert_eq!(EffectId::named("sheen"), Some(EffectId::Lobe(0)));
        assert_eq!(EffectId::named("haze"), None);
    }
}
