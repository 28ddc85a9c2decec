//! Directions in which rays of ambient occlusion look at the environment.
//!
//! Read Real-Time Rendering (4th ed.), section 11.3; Agarwal et al. 2003, "Structured Importance Sampling of
//! Environment Maps". Every second direction is drawn from the environment's radiance, the others from the whole
//! sphere; both parts follow a low-discrepancy sequence, so that the first directions of any number cover the sphere.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use super::emitters::{EnvironmentCdf, Sky};

/// A direction and its weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkyDirection {
    /// Unit vector in world axes.
    pub direction: DVec3,
    /// Radiance of the map over the density of the direction, in W/m².
    pub weight: [f64; 3],
    /// 1 over the density of the direction, in sr.
    pub solid_angle: f64,
}

/// Point `index` of the R₂ sequence, shifted (Roberts 2018): the plastic number's generalisation of the golden ratio.
fn point(index: u32, shift: f64) -> [f64; 2] {
    [0.754_877_666_246_692_7, 0.569_840_290_998_053_2].map(|step| (0.5 + shift + f64::from(index) * step).fract())
}

/// The first `count` directions for an environment; `seed` shifts the sequence.
#[must_use]
pub fn sky_directions(sky: Sky<'_>, count: u32, seed: u32) -> Vec<SkyDirection> {
    let cdf = EnvironmentCdf::of(sky.map);
    let world_from_map = DMat3::from_rotation_y(f64::from(sky.rotation).to_radians());
    let shift = (f64::from(seed) * 0.618_033_988_749_894_9).fract();
    let direction = |index: u32| {
        let [x, y] = point(index / 2, shift);
        let direction = match index % 2 {
            0 => cdf.sample([x, y]),
            _ => {
                let height = 1.0 - 2.0 * y;
                let across = (1.0 - height * height).max(0.0).sqrt();
                DVec3::new(across * (TAU * x).cos(), height, across * (TAU * x).sin())
            }
        };
        // The density of a direction is the mean of both parts' densities.
        let density = 0.5 * (cdf.density(direction) + 1.0 / (4.0 * PI));
        let weight = sky.map.sample(direction).map(|radiance| radiance / density);
        SkyDirection { direction: world_from_map * direction, weight, solid_angle: density.recip() }
    };
    (0..count).map(direction).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::environment::{Environment, direction};

    /// The mean of weights with cosines is the irradiance of any normal, summed over the texels of the map.
    #[test]
    fn directions_give_the_irradiance_of_the_map() {
        let map = Environment::studio();
        let sky = Sky { map: &map, intensity: 1.0, rotation: 0.0 };
        let directions = sky_directions(sky, 4096, 0);
        for normal in [DVec3::Y, DVec3::NEG_Y, DVec3::X, DVec3::new(0.6, 0.0, -0.8)] {
            let found: f64 =
                directions.iter().map(|at| at.weight[0] * normal.dot(at.direction).max(0.0) / 4096.0).sum();
            let mut expected = 0.0;
            for y in 0..map.height {
                let v = (f64::from(y) + 0.5) / f64::from(map.height);
                let texel = 2.0 * PI * PI * (PI * v).sin() / f64::from(map.width * map.height);
                for x in 0..map.width {
                    let d = direction((f64::from(x) + 0.5) / f64::from(map.width), v);
                    let radiance = map.radiance[(y * map.width + x) as usize][0];
                    expected += f64::from(radiance) * normal.dot(d).max(0.0) * texel;
                }
            }
            assert!((found / expected - 1.0).abs() < 0.02, "{normal}: {found}, not {expected}");
        }
    }

    #[test]
    fn rotation_turns_directions_and_keeps_weights() {
        let map = Environment::studio();
        let at = |rotation| sky_directions(Sky { map: &map, intensity: 1.0, rotation }, 16, 3);
        for (a, b) in at(0.0).iter().zip(at(90.0)) {
            assert_eq!((a.weight, a.solid_angle), (b.weight, b.solid_angle));
            assert!((DMat3::from_rotation_y(PI / 2.0) * a.direction).distance(b.direction) < 1e-12);
        }
    }
}
