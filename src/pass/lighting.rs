//! What all passes that light surfaces share.

use super::environment::EnvironmentOnDevice;
use super::rays::{LOOP_BUDGET, RaysOnDevice};
use super::scene::SceneOnDevice;
use super::shadow_map::ShadowMaps;
use super::tiles::Tiles;
use crate::gpu::Buffer;
use crate::plan::{Knobs, Plan};

/// Lights of one dispatch where each sends a ray: a traversal evaluates some 20 to 200 loop heads, of 65,535 that lavapipe
/// grants an invocation.
const LIGHTS_AT_ONCE: u32 = 64;

/// `SHADOWS` of shaders/lib/shadow.glsl: places of the rungs in the knob `shadows`.
const SHADOW_MAP: u32 = 1;
const SHADOW_RAY: u32 = 2;

/// What all passes that light surfaces need beside them.
#[derive(Clone, Copy)]
pub struct Lighting<'a> {
    /// Which code.
    pub plan: &'a Plan,
    /// Which formulas.
    pub knobs: &'a Knobs,
    /// Materials, lights, instances.
    pub scene: &'a SceneOnDevice,
    /// What rays go through.
    pub rays: &'a RaysOnDevice,
    /// What lights see.
    pub shadow_maps: &'a ShadowMaps,
    /// Light lists.
    pub tiles: &'a Tiles,
    /// Light from all around.
    pub environment: &'a EnvironmentOnDevice,
    /// The camera's buffer.
    pub camera: &'a Buffer,
    /// Pixels.
    pub size: [u32; 2],
}

/// Directional lights in parts, local ones in parts, the last of the former with the first of the latter. Local lights are
/// divided at the same ones whether or not tiles list them: sums are the same to the last bit then.
fn parts(directional: u32, local: u32, words: u32) -> Vec<Range> {
    let of = |count: u32, most: u32| (0..count).step_by(most as usize).map(move |i| [i, (i + most).min(count)]);
    let mut parts: Vec<Range> = of(directional, LIGHTS_AT_ONCE).map(|[from, to]| [from, to, 0, 0]).collect();
    let mut rest: Vec<Range> = of(local, LIGHTS_AT_ONCE)
        .map(|[from, to]| [directional + from, directional + to, 0, 0])
        .chain(of(words, LIGHTS_AT_ONCE / 32).map(|[from, to]| [directional, directional, from, to]))
        .collect();
    if let (Some(last), Some(first)) = (parts.last_mut(), rest.first()) {
        *last = [last[0], first[1], first[2], first[3]];
        rest.remove(0);
    }
    parts.append(&mut rest);
    parts
}

/// Lights of the table from, up to; words of the tiles' masks from, up to.
pub type Range = [u32; 4];

impl Lighting<'_> {
    /// Lights beside directional ones that every pixel goes through: all or, where tiles list them, none.
    #[must_use]
    pub fn unlisted_lights(&self) -> u32 {
        if self.plan.tiles { 0 } else { self.plan.local_lights }
    }

    /// How lights are looked for: `SHADOWS` of shaders/lib/shadow.glsl.
    #[must_use]
    pub fn shadows(&self) -> u32 {
        if self.plan.shadow_maps { SHADOW_MAP } else { u32::from(self.shadow_rays()) * SHADOW_RAY }
    }

    /// Loop heads that one invocation may evaluate.
    #[must_use]
    pub fn loop_budget(&self) -> u32 {
        if self.scene.device().limits_loops() { LOOP_BUDGET } else { u32::MAX }
    }

    /// Whether rays look for lights.
    #[must_use]
    pub fn shadow_rays(&self) -> bool {
        self.plan.rays.is_some_and(|rays| rays.shadows)
    }

    /// What each dispatch goes through: everything at once, or a few lights at a time where each sends a ray.
    #[must_use]
    pub fn ranges(&self) -> Vec<Range> {
        let (lights, words) = (self.plan.directional_lights + self.unlisted_lights(), self.tiles.words());
        if !self.shadow_rays() {
            return vec![[0, lights, 0, words]];
        }
        parts(self.plan.directional_lights, lights - self.plan.directional_lights, words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_are_divided_at_the_same_ones_with_and_without_lists() {
        assert_eq!(parts(1, 3, 0), [[0, 4, 0, 0]]);
        assert_eq!(parts(1, 0, 1), [[0, 1, 0, 1]]);
        assert_eq!(parts(0, 70, 0), [[0, 64, 0, 0], [64, 70, 0, 0]]);
        assert_eq!(parts(0, 0, 3), [[0, 0, 0, 2], [0, 0, 2, 3]]);
        assert_eq!(parts(65, 130, 0), [[0, 64, 0, 0], [64, 129, 0, 0], [129, 193, 0, 0], [193, 195, 0, 0]]);
        assert_eq!(parts(65, 0, 5), [[0, 64, 0, 0], [64, 65, 0, 2], [65, 65, 2, 4], [65, 65, 4, 5]]);
    }
}
