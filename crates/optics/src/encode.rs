//! Round trips of encoded quantities: octahedral normals, depth, sRGB bytes, equirectangular coordinates.
//!
//! Read RTR 16.6 for quantised vertex data. The exact value of a round trip is its input; its error bound is the step
//! of the format.

use glam::{DVec2, DVec3};
use std::f64::consts::{PI, SQRT_2, TAU};

use super::catalogue::{Axis, Case, Equation, Output, Region, SplitMix64, columns, vector};

/// @eq N16: n itself, and no angle between it and what comes back.
#[must_use]
pub fn octahedral_round_trip(n: DVec3) -> [f64; 4] {
    let n = n.normalize();
    [n.x, n.y, n.z, 0.0]
}

/// @eq N45: sRGB's transfer function undone (IEC 61966-2-1).
#[must_use]
pub fn linear_from_srgb(x: f64) -> f64 {
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// @eq N42: z, but not nearer than the near plane; infinite where near/z is below the normal range of f32.
#[must_use]
pub fn depth_round_trip(z: f64, near: f64) -> f64 {
    if near <= 0.0 { 0.0 } else { z.max(near) }
}

/// @eq N10: longitude and colatitude of a direction as parts of the map.
#[must_use]
pub fn equirectangular_from_direction(d: DVec3) -> DVec2 {
    DVec2::new(d.z.atan2(d.x) / TAU + 0.5, 0.5 - d.y.atan2(d.x.hypot(d.z)) / PI)
}

/// @eq N10: the direction at a place of the map.
#[must_use]
pub fn direction_from_equirectangular(uv: DVec2) -> DVec3 {
    let (phi, elevation) = (TAU * (uv.x - 0.5), PI * (0.5 - uv.y));
    DVec3::new(elevation.cos() * phi.cos(), elevation.sin(), elevation.cos() * phi.sin())
}

// The octahedral map is stretched most at the centre of a face, where steps (x, y) are √6 √(x² + xy + y²) radians: a
// hexagonal lattice. Rounding the coordinates is off by at most half a step in both, 3/√2. The largest error of 200,000
// directions in row 16 of docs/numerics.md is 1 or 2 % below; the best of four steps would have at most the lattice's
// covering radius, √2.
const NEAREST: f64 = 1.5 * SQRT_2;

fn steps(case: &Case<'_>) -> f64 {
    2_f64.powf(case.inputs[3] - 1.0) - 1.0
}

/// `part` of a step in degrees, with the curvature of the sphere within a step and the rounding of f32.
fn degrees(case: &Case<'_>, part: f64) -> f64 {
    (part / steps(case) * (1.0 + 1.0 / steps(case)) + 3e-7).to_degrees()
}

fn nearest_degrees(case: &Case<'_>) -> f64 {
    degrees(case, NEAREST)
}

fn normal_and_bits(d: &mut SplitMix64, n: DVec3) -> Vec<f32> {
    let mut all = columns(&[n]);
    all.push([8.0, 10.0, 12.0, 16.0][d.below(4)]);
    all
}

const DIRECTIONS_AND_BITS: &[Region] = &[
    Region {
        name: "directions, 2x8 to 2x16 bits",
        share: 3,
        draw: |d| {
            let n = d.direction();
            normal_and_bits(d, n)
        },
    },
    Region {
        name: "edges and corners of the octahedron",
        share: 1,
        draw: |d| {
            let mut n = d.direction().to_array();
            n[d.below(3)] = d.sign() * d.log(1e-9, 1e-2);
            if d.below(2) == 0 {
                n[d.below(3)] = 0.0;
            }
            let n = DVec3::from_array(n);
            let n = if n.length() > 0.0 { n.normalize() } else { DVec3::Z };
            normal_and_bits(d, n)
        },
    },
];

/// The equations of this file.
pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        name: "octahedral_round_trip",
        twin: |x| octahedral_round_trip(vector(x, 0)).to_vec(),
        regions: DIRECTIONS_AND_BITS,
        outputs: &[
            Output { name: "dx", bound: "as error_deg", allowed: |c| nearest_degrees(c).to_radians() },
            Output { name: "dy", bound: "as error_deg", allowed: |c| nearest_degrees(c).to_radians() },
            Output { name: "dz", bound: "as error_deg", allowed: |c| nearest_degrees(c).to_radians() },
            Output {
                name: "error_deg",
                bound: "0.965 at 8 bits, 0.239 at 10, 0.06 at 12, 3.73e-3 at 16",
                allowed: nearest_degrees,
            },
        ],
        axis: Axis { name: "bits", log: false, of: |x| x[3], column: 3, relative: false },
        extreme: 1e38,
    },
    Equation {
        name: "linear_from_srgb",
        twin: |x| x.iter().map(|&x| linear_from_srgb(x)).collect(),
        regions: &[
            Region { name: "bytes", share: 1, draw: |d| [0; 3].map(|_| (d.below(256) as f64 / 255.0) as f32).to_vec() },
            Region { name: "between them", share: 1, draw: |d| [0; 3].map(|_| d.unit() as f32).to_vec() },
        ],
        outputs: &[
            Output { name: "linearx", bound: "rel 2.1e-6", allowed: |c| c.rel(2.1e-6) },
            Output { name: "lineary", bound: "rel 2.1e-6", allowed: |c| c.rel(2.1e-6) },
            Output { name: "linearz", bound: "rel 2.1e-6", allowed: |c| c.rel(2.1e-6) },
        ],
        axis: Axis { name: "x", log: false, of: |x| x[0], column: 0, relative: true },
        // Texels are bytes.
        extreme: -1.0,
    },
    Equation {
        name: "depth_round_trip",
        twin: |x| vec![depth_round_trip(x[0], x[1])],
        regions: &[
            Region { name: "near 0.1, z to 1e6", share: 2, draw: |d| vec![d.log(0.1, 1e6) as f32, 0.1, 1e6] },
            Region {
                name: "near 1e-4 … 1, z to 1e9",
                share: 1,
                draw: |d| {
                    let near = d.log(1e-4, 1.0) as f32;
                    vec![(d.log(f64::from(near), 1e9) as f32).max(near), near, 1e9]
                },
            },
            Region {
                name: "nearer than the near plane",
                share: 1,
                draw: |d| {
                    let near = d.log(1e-4, 1.0) as f32;
                    vec![(d.sign() * d.log(1e-6, 1.0)) as f32 * near, near, 100.0]
                },
            },
        ],
        outputs: &[Output { name: "z_back", bound: "rel 1.2e-7", allowed: |c| c.rel(1.2e-7) }],
        axis: Axis { name: "z/near", log: true, of: |x| x[0] / x[1], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "equirectangular_from_direction",
        twin: |x| equirectangular_from_direction(vector(x, 0)).to_array().to_vec(),
        regions: &[
            Region { name: "directions", share: 2, draw: |d| columns(&[d.direction()]) },
            Region {
                name: "near the poles",
                share: 1,
                draw: |d| {
                    let (angle, pole) = (d.log(1e-9, 0.1), DVec3::Y * d.sign());
                    columns(&[d.at_angle(pole, angle)])
                },
            },
            Region {
                name: "near the seam and the axes",
                share: 1,
                draw: |d| {
                    let axis = [DVec3::X, DVec3::NEG_X, DVec3::Z, DVec3::NEG_Z][d.below(4)];
                    let angle = d.log(1e-9, 0.1);
                    columns(&[d.at_angle(axis, angle)])
                },
            },
        ],
        outputs: &[
            Output { name: "uvx", bound: "abs 1.2e-7", allowed: |_| 1.2e-7 },
            Output { name: "uvy", bound: "abs 1.2e-7", allowed: |_| 1.2e-7 },
        ],
        axis: Axis {
            name: "distance from the pole, rad",
            log: true,
            of: |x| x[0].hypot(x[2]).atan2(x[1].abs()),
            column: 1,
            relative: false,
        },
        extreme: 1e38,
    },
    Equation {
        name: "direction_from_equirectangular",
        twin: |x| direction_from_equirectangular(DVec2::new(x[0], x[1])).to_array().to_vec(),
        regions: &[
            Region { name: "the map", share: 3, draw: |d| vec![d.unit() as f32, d.unit() as f32] },
            Region {
                name: "its edges and middle",
                share: 1,
                draw: |d| {
                    let u = d.near(&[0.0, 0.25, 0.5, 0.75, 1.0]);
                    vec![u, d.near(&[0.0, 0.25, 0.5, 0.75, 1.0]).clamp(0.0, 1.0)]
                },
            },
        ],
        outputs: &[
            Output { name: "dx", bound: "abs 2e-7", allowed: |_| 2e-7 },
            Output { name: "dy", bound: "abs 2e-7", allowed: |_| 2e-7 },
            Output { name: "dz", bound: "abs 2e-7", allowed: |_| 2e-7 },
        ],
        axis: Axis { name: "v", log: true, of: |x| x[1], column: 0, relative: false },
        extreme: 1e38,
    },
];
