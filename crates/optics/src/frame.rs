//! Directions, tangent frames and normals.
//!
//! Read pbrt 3.3 and 3.10; Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1) 2017. Differences of two
//! f32 are exact in f64 when their exponents differ by less than 29, and products always are: the cross product of f32
//! vectors is nearly exact.

use glam::{DMat3, DVec3};

use super::brdf::cosine_allowed;
use super::catalogue::{Axis, Case, EXACT, Equation, Output, Region, SplitMix64, columns, flag, vector};

/// @eq N14: v/|v|, and whether v has no direction: all components below the normal range of f32.
#[must_use]
pub fn safe_normalize(v: DVec3) -> (DVec3, bool) {
    let is_zero = v.abs().max_element() < f64::from(f32::MIN_POSITIVE);
    (if is_zero { DVec3::NAN } else { v.normalize() }, is_zero)
}

/// @eq B2 N25: the cosine of two directions.
#[must_use]
pub fn cosine(a: DVec3, b: DVec3) -> f64 {
    a.normalize().dot(b.normalize())
}

/// @eq N10: the angle between two directions.
#[must_use]
pub fn angle_between(u: DVec3, v: DVec3) -> f64 {
    u.cross(v).length().atan2(u.dot(v))
}

/// @eq N15: two unit vectors t, b such that (t, b, n) is a right-handed orthonormal frame: those of Duff et al.
#[must_use]
pub fn orthonormal_basis(n: DVec3) -> (DVec3, DVec3) {
    let n = n.normalize();
    let s = if n.z < 0.0 { -1.0 } else { 1.0 };
    // 1/(s + n_z) without cancellation: n_z and s have the same sign.
    let part = 1.0 / (1.0 + n.z.abs());
    let t = DVec3::new(1.0 - n.x * n.x * part, -n.x * n.y * part, -s * n.x);
    let b = DVec3::new(-s * n.x * n.y * part, s * (1.0 - n.y * n.y * part), -n.y);
    (t, b)
}

/// @eq N15: how far a frame is from orthonormal: not at all.
#[must_use]
pub fn basis_gram(_n: DVec3) -> f64 {
    0.0
}

/// @eq N41: the normal n under the linear map with columns a, b, c, by the inverse transpose.
#[must_use]
pub fn transformed_normal(a: DVec3, b: DVec3, c: DVec3, n: DVec3) -> DVec3 {
    // Normalised columns; their lengths divide the components of n: (M S)^-T = M^-T S^-1.
    let lengths = DVec3::new(a.length(), b.length(), c.length());
    let unit = DMat3::from_cols(a / lengths.x, b / lengths.y, c / lengths.z);
    let scaled = n / lengths;
    (unit.inverse().transpose() * (scaled / scaled.length())).normalize()
}

/// @eq N40: (b − a) × (c − a), normalised, and whether it is 0.
#[must_use]
pub fn triangle_normal(a: DVec3, b: DVec3, c: DVec3) -> (DVec3, bool) {
    let doubled = (b - a).cross(c - a);
    let degenerate = doubled == DVec3::ZERO;
    (if degenerate { DVec3::NAN } else { doubled.normalize() }, degenerate)
}

/// Two unit vectors at a small angle, a random angle, or an angle near π.
fn units_apart(d: &mut SplitMix64, angle: f64) -> Vec<f32> {
    let u = d.direction();
    let v = d.at_angle(u, angle);
    columns(&[u, v])
}

const ANGLES: &[Region] = &[
    Region {
        name: "small angles",
        share: 2,
        draw: |d| {
            let angle = d.log(1e-6, 0.1);
            units_apart(d, angle)
        },
    },
    Region {
        name: "every angle",
        share: 1,
        draw: |d| {
            let angle = d.between(0.0, std::f64::consts::PI);
            units_apart(d, angle)
        },
    },
    Region {
        name: "nearly opposite",
        share: 1,
        draw: |d| {
            let angle = std::f64::consts::PI - d.log(1e-6, 0.1);
            units_apart(d, angle)
        },
    },
    Region {
        name: "nearly perpendicular",
        share: 1,
        draw: |d| {
            let angle = std::f64::consts::FRAC_PI_2 + d.sign() * d.log(1e-8, 0.1);
            units_apart(d, angle)
        },
    },
];

const NORMALS: &[Region] = &[
    Region { name: "directions", share: 1, draw: |d| columns(&[d.direction()]) },
    Region {
        name: "n_z → −1",
        share: 1,
        draw: |d| {
            let angle = d.log(1e-8, 0.1);
            columns(&[d.at_angle(-DVec3::Z, angle)])
        },
    },
    Region {
        name: "n_z → 0",
        share: 1,
        draw: |d| {
            let (phi, z) = (d.between(0.0, std::f64::consts::TAU), d.sign() * d.log(1e-9, 1e-2));
            columns(&[DVec3::new(phi.cos(), phi.sin(), z).normalize()])
        },
    },
    Region {
        name: "axes",
        share: 1,
        draw: |d| {
            let mut n = [0.0; 3];
            n[d.below(3)] = d.sign() as f32;
            n.to_vec()
        },
    },
];

/// A rotation about a random axis.
fn rotation(d: &mut SplitMix64) -> DMat3 {
    let angle = d.between(0.0, std::f64::consts::TAU);
    DMat3::from_axis_angle(d.direction(), angle)
}

fn map_and_normal(d: &mut SplitMix64, map: DMat3) -> Vec<f32> {
    columns(&[map.x_axis, map.y_axis, map.z_axis, d.direction()])
}

/// Condition number of the sum of the three cofactor columns: the sum of the magnitudes of its terms over the magnitude
/// of the sum, with products of column lengths for the cross products. 1 for orthogonal columns and a normal along one
/// of them.
fn cofactor_condition(x: &[f64]) -> f64 {
    let [a, b, c] = [0, 3, 6].map(|k| vector(x, k));
    let n = vector(x, 9).normalize();
    let sizes = [b.length() * c.length(), c.length() * a.length(), a.length() * b.length()];
    let terms = sizes[0] * n.x.abs() + sizes[1] * n.y.abs() + sizes[2] * n.z.abs();
    terms / (b.cross(c) * n.x + c.cross(a) * n.y + a.cross(b) * n.z).length()
}

fn map_allowed(case: &Case<'_>) -> f64 {
    (1.2e-7 * cofactor_condition(case.inputs)).max(2e-7)
}

/// Condition number of a sliver's normal: |ab||ac| over twice the area, the factor of the edges' rounding errors.
fn sliver(x: &[f64]) -> f64 {
    let (a, b, c) = (vector(x, 0), vector(x, 3), vector(x, 6));
    let (u, v) = (b - a, c - a);
    u.length() * v.length() / u.cross(v).length()
}

fn normal_allowed(case: &Case<'_>) -> f64 {
    case.tiered(1e-7 + 2_f64.powi(-22) * sliver(case.inputs), 2e-7)
}

/// A triangle with an edge of about `size` and the height `height` above it, within `reach` of the origin.
fn triangle(d: &mut SplitMix64, reach: f64, size: f64, height: f64) -> Vec<f32> {
    let a = d.direction() * reach * d.unit();
    let along = d.direction();
    let across = d.perpendicular(along);
    let (t, length) = (d.between(-0.5, 1.5), size * d.between(0.5, 1.0));
    let mut corners = [a, a + along * length, a + along * (length * t) + across * height];
    let first = d.below(3);
    corners.rotate_left(first);
    columns(&corners)
}

/// @eq Q5: the unit normal of a level surface of a x² + b y² + c z²: its gradient. At its centre there is none: zero.
#[must_use]
pub fn quadric_normal(p: DVec3, k: DVec3) -> DVec3 {
    (2.0 * k * p).normalize_or_zero()
}

/// The equations of this file.
pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        name: "safe_normalize",
        twin: |x| {
            let (n, is_zero) = safe_normalize(vector(x, 0));
            vec![n.x, n.y, n.z, flag(is_zero)]
        },
        regions: &[
            Region {
                name: "lengths 1e-37 … 1e38",
                share: 3,
                draw: |d| {
                    let length = d.log(1e-37, 1e38);
                    columns(&[d.direction() * length])
                },
            },
            Region {
                name: "axes and zero",
                share: 1,
                draw: |d| {
                    let mut v = [0.0; 3];
                    let values = [0.0, 1.0, -1.0, f32::MIN_POSITIVE, 1e-30, 1e38, -1e-20];
                    v[d.below(3)] = values[d.below(values.len())];
                    v.to_vec()
                },
            },
        ],
        outputs: &[
            Output { name: "nx", bound: "abs 2e-7", allowed: |_| 2e-7 },
            Output { name: "ny", bound: "abs 2e-7", allowed: |_| 2e-7 },
            Output { name: "nz", bound: "abs 2e-7", allowed: |_| 2e-7 },
            Output { name: "is_zero", bound: "exact", allowed: EXACT },
        ],
        axis: Axis { name: "|v|", log: true, of: |x| vector(x, 0).length(), column: 0, relative: false },
        extreme: 1e38,
    },
    Equation {
        name: "cosine",
        twin: |x| vec![cosine(vector(x, 0), vector(x, 3))],
        regions: ANGLES,
        outputs: &[Output {
            name: "cos",
            bound: "1e-7 + 1.04e-7 |cos|; compensated 8 ulp + 1e-14",
            allowed: |c| cosine_allowed(c, c.x()),
        }],
        axis: Axis {
            name: "θ, rad",
            log: false,
            of: |x| angle_between(vector(x, 0), vector(x, 3)),
            column: 0,
            relative: false,
        },
        extreme: 1e9,
    },
    Equation {
        name: "angle_between",
        twin: |x| vec![angle_between(vector(x, 0), vector(x, 3))],
        regions: ANGLES,
        outputs: &[Output { name: "angle", bound: "rel 6e-7", allowed: |c| c.rel(6e-7) }],
        axis: Axis {
            name: "θ, rad",
            log: true,
            of: |x| angle_between(vector(x, 0), vector(x, 3)),
            column: 0,
            relative: true,
        },
        extreme: 1e38,
    },
    Equation {
        name: "orthonormal_basis",
        twin: |x| {
            let (t, b) = orthonormal_basis(vector(x, 0));
            [t.to_array(), b.to_array()].concat()
        },
        regions: NORMALS,
        outputs: &[
            Output { name: "tx", bound: "abs 2e-7", allowed: |_| 2e-7 },
            Output { name: "ty", bound: "abs 2e-7", allowed: |_| 2e-7 },
            Output { name: "tz", bound: "abs 2e-7", allowed: |_| 2e-7 },
            Output { name: "bx", bound: "abs 2e-7", allowed: |_| 2e-7 },
            Output { name: "by", bound: "abs 2e-7", allowed: |_| 2e-7 },
            Output { name: "bz", bound: "abs 2e-7", allowed: |_| 2e-7 },
        ],
        axis: Axis { name: "1 + n_z", log: true, of: |x| 1.0 + x[2], column: 0, relative: false },
        extreme: 1e38,
    },
    Equation {
        name: "basis_gram",
        twin: |x| vec![basis_gram(vector(x, 0))],
        regions: NORMALS,
        outputs: &[Output { name: "gram", bound: "2e-7", allowed: |_| 2e-7 }],
        axis: Axis { name: "1 + n_z", log: true, of: |x| 1.0 + x[2], column: 0, relative: false },
        extreme: 1e38,
    },
    Equation {
        name: "transformed_normal",
        twin: |x| {
            let [a, b, c, n] = [0, 3, 6, 9].map(|k| vector(x, k));
            transformed_normal(a, b, c, n).to_array().to_vec()
        },
        regions: &[
            Region {
                name: "rotations of scale 1e-14 … 1e-8",
                share: 2,
                draw: |d| {
                    let scale = d.log(1e-14, 1e-8);
                    let map = rotation(d) * scale;
                    map_and_normal(d, map)
                },
            },
            Region {
                name: "scaled by axis, mirrored, rotated; 1e-30 … 1e30",
                share: 2,
                draw: |d| {
                    let whole = d.log(1e-27, 1e27);
                    let scale = DVec3::from_array([0; 3].map(|_| d.sign() * d.log(1e-3, 1e3) * whole));
                    let map = rotation(d) * DMat3::from_diagonal(scale);
                    map_and_normal(d, map)
                },
            },
            Region {
                name: "sheared",
                share: 1,
                draw: |d| {
                    let scale = DVec3::from_array([0; 3].map(|_| d.sign() * d.log(0.1, 10.0)));
                    let map = rotation(d) * DMat3::from_diagonal(scale) * rotation(d);
                    map_and_normal(d, map)
                },
            },
        ],
        outputs: &[
            Output {
                name: "Nx", bound: "abs 2e-7; sheared 1.2e-7 Σ|b||c||n_x|/|Σ(b × c) n_x|", allowed: map_allowed
            },
            Output { name: "Ny", bound: "as Nx", allowed: map_allowed },
            Output { name: "Nz", bound: "as Nx", allowed: map_allowed },
        ],
        axis: Axis { name: "|a|", log: true, of: |x| vector(x, 0).length(), column: 0, relative: false },
        extreme: 1e38,
    },
    Equation {
        name: "triangle_normal",
        twin: |x| {
            let (n, degenerate) = triangle_normal(vector(x, 0), vector(x, 3), vector(x, 6));
            vec![n.x, n.y, n.z, flag(degenerate)]
        },
        regions: &[
            Region {
                name: "slivers, height 1e-6 … 0.1",
                share: 2,
                draw: |d| {
                    let height = d.log(1e-6, 0.1);
                    triangle(d, 1.0, 1.0, height)
                },
            },
            Region {
                name: "1e3 from the origin, height 1e-3 … 1",
                share: 1,
                draw: |d| {
                    let height = d.log(1e-3, 1.0);
                    triangle(d, 1e3, 1.0, height)
                },
            },
            Region {
                name: "every size",
                share: 1,
                draw: |d| {
                    let size = d.log(1e-30, 1e30);
                    triangle(d, size, size, size)
                },
            },
            Region {
                name: "no area",
                share: 1,
                draw: |d| {
                    let a: [f64; 3] = [0; 3].map(|_| d.below(64) as f64 - 32.0);
                    let step: [f64; 3] = [0; 3].map(|_| d.below(64) as f64 - 32.0);
                    let (a, step) = (DVec3::from_array(a), DVec3::from_array(step));
                    columns(&[a, a + step * d.below(4) as f64, a + step * d.below(4) as f64])
                },
            },
        ],
        outputs: &[
            Output {
                name: "nx",
                bound: "stable 1e-7 + 2^-22 |ab||ac|/|ab × ac|: degrees for heights of 1e-6; compensated 2e-7",
                allowed: normal_allowed,
            },
            Output { name: "ny", bound: "as nx", allowed: normal_allowed },
            Output { name: "nz", bound: "as nx", allowed: normal_allowed },
            Output { name: "degenerate", bound: "exact", allowed: EXACT },
        ],
        axis: Axis { name: "|ab||ac|/|ab × ac|", log: true, of: sliver, column: 0, relative: false },
        extreme: 1e38,
    },
    Equation {
        name: "quadric_normal",
        twin: |x| quadric_normal(vector(x, 0), vector(x, 3)).to_array().to_vec(),
        regions: &[Region {
            name: "ellipsoids, hyperboloids, cylinders",
            share: 1,
            draw: |d| {
                let p = d.direction() * d.log(1e-3, 1e3);
                let k = [0; 3].map(|_| d.sign() * d.log(1e-2, 1e2) * f64::from(u8::from(d.below(6) > 0)));
                columns(&[p, if k == [0.0; 3] { DVec3::ONE } else { DVec3::from_array(k) }])
            },
        }],
        outputs: &[
            Output { name: "Nx", bound: "abs 2e-7", allowed: |_| 2e-7 },
            Output { name: "Ny", bound: "abs 2e-7", allowed: |_| 2e-7 },
            Output { name: "Nz", bound: "abs 2e-7", allowed: |_| 2e-7 },
        ],
        axis: Axis { name: "|p|", log: true, of: |x| vector(x, 0).length(), column: 0, relative: false },
        extreme: 1e38,
    },
];
