//! Facts about a scene and its surroundings that a plan is decided from.

use super::effect::ForcedEffects;
use crate::scene::Scene;
use crate::scene::canonical::CanonicalForm;
use crate::scene::solid::{Solids, deepest_nesting, solids};

/// Derived facts about a scene.
#[derive(Debug, Clone, Default)]
pub struct Facts {
    /// Closed dielectric meshes, which enclose a medium.
    pub solids: Solids,
    /// Largest number of closed meshes that contain one point.
    pub nesting: usize,
    /// Record of the canonicalisation.
    pub form: CanonicalForm,
}

impl Facts {
    /// Facts about a scene in canonical form.
    #[must_use]
    pub fn of(scene: &Scene, form: CanonicalForm) -> Self {
        let solids = solids(scene);
        Self { nesting: deepest_nesting(scene, &solids), solids, form }
    }
}

/// Facts about the surroundings of a scene.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings {
    /// Whether there is an environment that lights the scene.
    pub environment: bool,
    /// Whether the environment's radiance is the same in all directions.
    pub constant: bool,
    /// Whether the environment is grey everywhere.
    pub grey: bool,
    /// Whether the environment is also the background.
    pub sky: bool,
    /// Whether it is blurred there.
    pub blurred: bool,
    /// Whether surfaces send light to other surfaces; true where it is not known.
    pub interreflection: bool,
    /// Effects that are planned although the scene does not call for them.
    pub forced: ForcedEffects,
}

impl Surroundings {
    /// No environment, and no forced effects.
    pub const DARK: Self = Self {
        environment: false,
        constant: false,
        grey: false,
        sky: false,
        blurred: false,
        interreflection: true,
        forced: ForcedEffects::None,
    };
}
