//! What is known of a scene and around it before it is planned.

use super::effect::Demand;
use crate::scene::Scene;
use crate::scene::normal_form::NormalForm;
use crate::scene::solid::{Solids, deepest_nesting, solids};

/// What is known of a scene beside what it says.
#[derive(Debug, Clone, Default)]
pub struct Facts {
    /// Which surfaces enclose a medium.
    pub solids: Solids,
    /// How many of those one point may be in, at most.
    pub nesting: usize,
    /// What was said more simply.
    pub form: NormalForm,
}

impl Facts {
    /// Of a scene in normal form.
    #[must_use]
    pub fn of(scene: &Scene, form: NormalForm) -> Self {
        let solids = solids(scene);
        Self { nesting: deepest_nesting(scene, &solids), solids, form }
    }
}

/// What is known beside the scene.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings {
    /// There is an environment that lights the scene.
    pub environment: bool,
    /// The same light comes from everywhere.
    pub constant: bool,
    /// All its light is grey.
    pub grey: bool,
    /// It is also the background.
    pub sky: bool,
    /// What is asked for beside what the scene calls for.
    pub demand: Demand,
}
