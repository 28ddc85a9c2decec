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

/// Directional lights in parts and local ones in parts, of which one dispatch takes the last of the former with the first of the
/// latter if both are few. Local lights are divided at the same ones whether or not tiles list them: sums are the same to
/// the last bit then.
fn parts(directional: u32, local: u32, listed: bool) -> Vec<Range> {
    let of =
        |count: u32| (0..count).step_by(LIGHTS_AT_ONCE as usize).map(move |i| [i, (i + LIGHTS_AT_ONCE).min(count)]);
    let mut parts: Vec<Range> = of(directional).map(|[from, to]| [from, to, 0, 0]).collect();
    for [from, to] in of(local) {
        let [lights, words] = match listed {
            true => [[directional; 2], [from / 32, to.div_ceil(32)]],
            false => [[directional + from, directional + to], [0; 2]],
        };
        match parts.last_mut().filter(|last| from == 0 && last[1] - last[0] + to <= LIGHTS_AT_ONCE) {
            Some(last) => *last = [last[0], lights[1], words[0], words[1]],
            None => parts.push([lights[0], lights[1], words[0], words[1]]),
        }
    }
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
        let Plan { directional_lights, local_lights, tiles, .. } = *self.plan;
        match self.shadow_rays() {
            true => parts(directional_lights, local_lights, tiles),
            false => vec![[0, directional_lights + self.unlisted_lights(), 0, self.tiles.words()]],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_are_divided_at_the_same_ones_with_and_without_lists() {
        assert_eq!(parts(1, 3, false), [[0, 4, 0, 0]]);
        assert_eq!(parts(1, 3, true), [[0, 1, 0, 1]]);
        assert_eq!(parts(0, 70, false), [[0, 64, 0, 0], [64, 70, 0, 0]]);
        assert_eq!(parts(0, 70, true), [[0, 0, 0, 2], [0, 0, 2, 3]]);
        assert_eq!(parts(65, 63, false), [[0, 64, 0, 0], [64, 128, 0, 0]]);
        assert_eq!(parts(65, 63, true), [[0, 64, 0, 0], [64, 65, 0, 2]]);
        // Too many for one dispatch.
        assert_eq!(parts(2, 130, false), [[0, 2, 0, 0], [2, 66, 0, 0], [66, 130, 0, 0], [130, 132, 0, 0]]);
        assert_eq!(parts(2, 130, true), [[0, 2, 0, 0], [2, 2, 0, 2], [2, 2, 2, 4], [2, 2, 4, 5]]);
    }
}
