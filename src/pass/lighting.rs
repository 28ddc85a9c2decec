//! Inputs shared by all passes that light surfaces, and the division of lights among dispatches.

use super::rows::TileShare;
use super::tiles::Tiles;
use crate::plan::Plan;
use crate::shader::Library;
use crate::shader::light::LightRange;

/// Lights per dispatch when each sends a shadow ray: a traversal takes some 20 to 200 loop iterations, of 65,535 that
/// lavapipe grants an invocation.
const LIGHTS_AT_ONCE: u32 = 64;

/// Inputs of the passes that light surfaces.
#[derive(Clone, Copy)]
pub struct Lighting<'a> {
    /// The plan.
    pub plan: &'a Plan,
    /// Specialization constants.
    pub library: Library,
    /// Light masks of tiled light culling.
    pub tiles: &'a Tiles,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The share of the picture's tiles that is drawn.
    pub share: TileShare,
}

/// The ranges of lights for each dispatch: directional lights and light samples, then local lights, at most
/// [`LIGHTS_AT_ONCE`] each. The last range of the first kind takes the first one of the second if both are small.
/// Local lights are divided at the same indices with and without tiled light culling, so the sums are bit-identical.
fn parts(directional: u32, local: u32, listed: bool) -> Vec<LightRange> {
    let of =
        |count: u32| (0..count).step_by(LIGHTS_AT_ONCE as usize).map(move |i| [i, (i + LIGHTS_AT_ONCE).min(count)]);
    let range =
        |[first, end]: [u32; 2], [first_word, end_word]: [u32; 2]| LightRange { first, end, first_word, end_word };
    let mut parts: Vec<LightRange> = of(directional).map(|lights| range(lights, [0; 2])).collect();
    for [from, to] in of(local) {
        let [lights, words] = match listed {
            true => [[directional; 2], [from / 32, to.div_ceil(32)]],
            false => [[directional + from, directional + to], [0; 2]],
        };
        match parts.last_mut().filter(|last| from == 0 && last.end - last.first + to <= LIGHTS_AT_ONCE) {
            Some(last) => *last = range([last.first, lights[1]], words),
            None => parts.push(range(lights, words)),
        }
    }
    parts
}

impl Lighting<'_> {
    /// Whether lights use shadow rays.
    #[must_use]
    pub fn shadow_rays(&self) -> bool {
        self.plan.rays.is_some_and(|rays| rays.shadows)
    }

    /// The range of each dispatch: all lights at once, or a few at a time when each sends a shadow ray.
    #[must_use]
    pub fn ranges(&self) -> Vec<LightRange> {
        let Plan { directional_lights, local_lights, tiles, light_samples, .. } = *self.plan;
        let first = directional_lights + light_samples.count;
        match self.shadow_rays() {
            true => parts(first, local_lights, tiles),
            false => vec![LightRange {
                first: 0,
                end: first + self.library.lighting.local_lights,
                first_word: 0,
                end_word: self.tiles.words(),
            }],
        }
    }
}

#[cfg(test)]
mod tests {
    fn parts(directional: u32, local: u32, listed: bool) -> Vec<[u32; 4]> {
        super::parts(directional, local, listed).into_iter().map(bytemuck::cast).collect()
    }

    #[test]
    fn lights_are_divided_at_the_same_ones_with_and_without_lists() {
        assert_eq!(parts(1, 3, false), [[0, 4, 0, 0]]);
        assert_eq!(parts(1, 3, true), [[0, 1, 0, 1]]);
        assert_eq!(parts(0, 70, false), [[0, 64, 0, 0], [64, 70, 0, 0]]);
        assert_eq!(parts(0, 70, true), [[0, 0, 0, 2], [0, 0, 2, 3]]);
        assert_eq!(parts(65, 63, false), [[0, 64, 0, 0], [64, 128, 0, 0]]);
        assert_eq!(parts(65, 63, true), [[0, 64, 0, 0], [64, 65, 0, 2]]);
        // More lights than one dispatch takes.
        assert_eq!(parts(2, 130, false), [[0, 2, 0, 0], [2, 66, 0, 0], [66, 130, 0, 0], [130, 132, 0, 0]]);
        assert_eq!(parts(2, 130, true), [[0, 2, 0, 0], [2, 2, 0, 2], [2, 2, 2, 4], [2, 2, 4, 5]]);
    }
}
