//! Intersections of rays with spheres, boxes and triangles, and ray origins, by the equations of lines and planes.
//!
//! Read pbrt 6; RTR 22. Differences of f32 inputs are exact or nearly exact in f64, and so are their products.

use glam::DVec3;

use super::catalogue::{Axis, Case, EXACT, Equation, Output, Region, SplitMix64, columns, flag, ulp, vector};

/// @eq N34 N35: whether the line meets the sphere, and where: the roots of |o + t d − c|² = r², the smaller first.
#[must_use]
pub fn ray_sphere(origin: DVec3, direction: DVec3, center: DVec3, radius: f64) -> [f64; 3] {
    let f = origin - center;
    let (d2, b) = (direction.length_squared(), -f.dot(direction));
    // The discriminant over 4 d², from the distance of the centre to the line: nothing is squared twice.
    let disc = radius * radius - f.cross(direction).length_squared() / d2;
    if disc < 0.0 {
        return [0.0, f64::NAN, f64::NAN];
    }
    let root = (d2 * disc).sqrt();
    let q = b + root.copysign(b);
    let (by_q, by_d) = ((f.length_squared() - radius * radius) / q, q / d2);
    if b < 0.0 { [1.0, by_d, by_q] } else { [1.0, by_q, by_d] }
}

/// @eq N36: the part of the ray inside a closed box: whether there is any, where it begins and ends.
#[must_use]
pub fn slab(origin: DVec3, direction: DVec3, centre: DVec3, half: DVec3, t_max: f64) -> [f64; 3] {
    let [near, far] = interval(origin, direction, centre, half, t_max);
    if near <= far { [1.0, near, far] } else { [0.0, f64::NAN, f64::NAN] }
}

/// @eq N36: whether intervals have a time in common.
#[must_use]
pub fn meets(near: DVec3, far: DVec3, t_min: f64, t_max: f64) -> bool {
    near.max_element().max(t_min) <= far.min_element().min(t_max)
}

fn interval(origin: DVec3, direction: DVec3, centre: DVec3, half: DVec3, t_max: f64) -> [f64; 2] {
    let (mut near, mut far) = (0.0_f64, t_max);
    for k in 0..3 {
        let to = centre[k] - origin[k];
        let [a, b] = if direction[k] == 0.0 {
            let inside = to.abs() <= half[k];
            if inside { [f64::NEG_INFINITY, f64::INFINITY] } else { [f64::INFINITY, f64::NEG_INFINITY] }
        } else {
            let (a, b) = ((to - half[k]) / direction[k], (to + half[k]) / direction[k]);
            [a.min(b), a.max(b)]
        };
        near = near.max(a);
        far = far.min(b);
    }
    [near, far]
}

/// t and the barycentric coordinates of b and c where the line meets the triangle's plane, by Cramer's rule.
fn plane_meeting(origin: DVec3, direction: DVec3, a: DVec3, b: DVec3, c: DVec3) -> [f64; 3] {
    let (ab, ac, s) = (b - a, c - a, origin - a);
    let det = direction.cross(ac).dot(ab);
    [s.cross(ab).dot(ac) / det, direction.cross(ac).dot(s) / det, s.cross(ab).dot(direction) / det]
}

/// @eq N37: hit, t, u, v of a ray and a closed triangle.
#[must_use]
pub fn ray_triangle(origin: DVec3, direction: DVec3, a: DVec3, b: DVec3, c: DVec3) -> [f64; 4] {
    let [t, u, v] = plane_meeting(origin, direction, a, b, c);
    if t >= 0.0 && u >= 0.0 && v >= 0.0 && 1.0 - u - v >= 0.0 {
        [1.0, t, u, v]
    } else {
        [0.0, f64::NAN, f64::NAN, f64::NAN]
    }
}

/// @eq N38: a point moved along the normal and a direction known to be free.
#[must_use]
pub fn offset_origin(p: DVec3, n: DVec3, free: DVec3, offset: f64) -> DVec3 {
    p + (n + free) * offset
}

/// @eq N39: a + u (b − a) + v (c − a)
#[must_use]
pub fn hit_point(a: DVec3, b: DVec3, c: DVec3, u: f64, v: f64) -> DVec3 {
    a + u * (b - a) + v * (c - a)
}

/// @eq N33: (p_hi + p_lo) − (eye_hi + eye_lo)
#[must_use]
pub fn camera_relative(p: [DVec3; 2], eye: [DVec3; 2]) -> DVec3 {
    (p[0] - eye[0]) + (p[1] - eye[1])
}

/// Quantities of a ray of unit direction and a sphere, for error bounds.
struct Approach {
    /// Distance of origin and centre.
    f: f64,
    /// r² − l² and its error bound.
    disc: f64,
    disc_error: f64,
    /// f² − r².
    c: f64,
    /// |q|, the larger magnitude of the roots.
    q: f64,
    r: f64,
}

fn approach(case: &Case<'_>) -> Approach {
    let x = case.inputs;
    let (f, d, r) = (vector(x, 0) - vector(x, 6), vector(x, 3), x[9]);
    let l = f.cross(d).length() / d.length();
    let f_length = f.length();
    let disc = r * r - l * l;
    // Stable: l is a difference of vectors of length f, each rounded. Compensated: the square of a pair, rounded once.
    let stable = 2_f64.powi(-24) * (5.0 * l * f_length + 4.0 * r * r) + 2_f64.powi(-42) * f_length * f_length;
    let compensated = 2_f64.powi(-42) * (f_length * r + r * r) + 2_f64.powi(-60) * f_length * f_length;
    let q = f.dot(d).abs() / d.length() + disc.max(0.0).sqrt();
    Approach { f: f_length, disc, disc_error: case.tiered(stable, compensated), c: f_length * f_length - r * r, q, r }
}

/// Error of √disc, for a direction of unit length.
fn root_error(a: &Approach) -> f64 {
    if a.disc > 2.0 * a.disc_error { a.disc_error / a.disc.sqrt() } else { (3.0 * a.disc_error).sqrt() }
}

fn root_allowed(case: &Case<'_>) -> f64 {
    let a = approach(case);
    if a.disc <= a.disc_error {
        return f64::INFINITY;
    }
    // f² − r² near the surface: each square is rounded. The root of larger magnitude does not use it.
    let smaller = case.x().abs() * vector(case.inputs, 3).length() < 0.999 * a.q;
    let part =
        if smaller { case.tiered(8.0 * 2_f64.powi(-24) * (a.f * a.f + a.r * a.r) / a.c.abs(), 0.0) } else { 0.0 };
    let by_root = root_error(&a) / a.q.max(root_error(&a));
    case.ulps(5.0).max(case.rel(part)) + case.rel(by_root)
}

fn sphere_case(d: &mut SplitMix64, center: DVec3, radius: f64, origin: DVec3, direction: DVec3) -> Vec<f32> {
    let length = if d.below(2) == 0 { 1.0 } else { d.log(1e-3, 1e3) };
    let mut all = columns(&[origin, direction * length, center]);
    all.push(radius as f32);
    all
}

/// A ray from `distance` that passes the centre of a sphere at `impact` radii.
fn toward_sphere(d: &mut SplitMix64, distance: f64, impact: f64) -> Vec<f32> {
    let (radius, along) = (d.log(0.1, 10.0), d.direction());
    let origin = d.direction() * d.unit();
    let across = d.perpendicular(along);
    let center = origin + along * distance;
    let aim = (center + across * (impact * radius) - origin).normalize();
    sphere_case(d, center, radius, origin, aim)
}

fn box_case(d: &mut SplitMix64, parallel: bool) -> Vec<f32> {
    let boxed = columns(&[d.direction() * d.log(0.1, 1e3), DVec3::from_array([0; 3].map(|_| d.log(1e-3, 10.0)))]);
    let exact: Vec<f64> = boxed.iter().map(|&x| f64::from(x)).collect();
    let (centre, half) = (vector(&exact, 0), vector(&exact, 3));
    // Targets inside the box, beside it, or on a face, an edge or a corner.
    let target = DVec3::from_array([0, 1, 2].map(|k| {
        let part = [-1.0, 1.0, d.between(-1.0, 1.0), d.between(-1.5, 1.5)][d.below(4)];
        centre[k] + part * half[k]
    }));
    let mut direction = d.direction();
    if parallel {
        direction[d.below(3)] = 0.0;
        if d.below(2) == 0 {
            direction[d.below(3)] = 0.0;
        }
        if direction == DVec3::ZERO {
            direction = DVec3::X;
        }
    }
    let ray = columns(&[target - direction * d.log(0.1, 1e3), direction]);
    let largest = ray[..3].iter().chain(&boxed).fold(0.0_f32, |most, x| most.max(x.abs()));
    let t_max = if d.below(4) == 0 { d.log(0.1, 1e3) as f32 } else { 1e30 };
    [ray, boxed, vec![largest * 32.0 / 16_777_216.0, t_max]].concat()
}

fn box_of(x: &[f64]) -> [f64; 2] {
    interval(vector(x, 0), vector(x, 3), vector(x, 6), vector(x, 9), x[13])
}

/// Tolerance of the padded interval: how much earlier it may begin and later end. It is the pad of the deciding axis, 8
/// roundings of the origin and the scene's offset, and once more for the rounding errors that the pad covers.
fn box_slack(x: &[f64]) -> [f64; 2] {
    let [near, far] = box_of(x);
    let pad = |end: f64| {
        let of = |k: usize| {
            let ends = [-1.0, 1.0].map(|s| (x[6 + k] - x[k] + s * x[9 + k]) / x[3 + k]);
            let decides = x[3 + k] != 0.0 && ends.contains(&end);
            if decides { 2.0 * (x[k].abs() * 2_f64.powi(-21) + x[12]) / x[3 + k].abs() } else { 0.0 }
        };
        of(0).max(of(1)).max(of(2))
    };
    [pad(near), pad(far)]
}

/// A triangle of about unit size around `center`, and a ray from `distance` towards a point in or beside it.
fn toward_triangle(d: &mut SplitMix64, distance: f64, scale: f64) -> Vec<f32> {
    let center = d.direction();
    let [a, b, c] = [0; 3].map(|_| center + d.direction());
    let (u, v) = (d.between(-0.2, 1.2), d.between(-0.2, 1.2));
    let target = hit_point(a, b, c, u, v);
    let direction = d.direction();
    let origin = target - direction * distance;
    let length = if d.below(2) == 0 { 1.0 } else { d.log(1e-3, 1e3) };
    columns(&[origin * scale, direction * length, a * scale, b * scale, c * scale])
}

/// Errors of u, v and 1 − u − v, and of t, that result from the rounding of sheared coordinates.
fn triangle_errors(case: &Case<'_>) -> [f64; 2] {
    let x = case.inputs;
    let [o, d, a, b, c] = [0, 3, 6, 9, 12].map(|k| vector(x, k));
    let corners = [a - o, b - o, c - o];
    let reach = corners.iter().fold(0.0, |m: f64, p| m.max(p.length()));
    let across = corners.iter().fold(0.0, |m: f64, p| m.max(p.cross(d).length() / d.length()));
    let doubled = (b - a).cross(c - a).dot(d).abs() / d.length();
    let rounding = case.tiered(2_f64.powi(-20), 2_f64.powi(-40));
    let weights = rounding * reach * across / doubled;
    let k = if d.x.abs() == d.abs().max_element() {
        0
    } else if d.y.abs() == d.abs().max_element() {
        1
    } else {
        2
    };
    let t = corners.map(|p| p[k] / d[k]);
    let most = t.iter().fold(0.0, |m: f64, t| m.max(t.abs()));
    let spread = (t[0] - t[1]).abs().max((t[1] - t[2]).abs()).max((t[2] - t[0]).abs());
    [weights, 2.0 * weights * spread + 8.0 * 2_f64.powi(-24) * most]
}

/// Whether the ray may miss within rounding errors.
fn undecided(case: &Case<'_>) -> bool {
    let x = case.inputs;
    let [o, d, a, b, c] = [0, 3, 6, 9, 12].map(|k| vector(x, k));
    let [t, u, v] = plane_meeting(o, d, a, b, c);
    let [weights, by_t] = triangle_errors(case);
    u.min(v).min(1.0 - u - v).abs() <= weights || t.abs() <= by_t || weights.is_nan() || weights >= 1.0
}

fn weight_allowed(case: &Case<'_>) -> f64 {
    if undecided(case) { f64::INFINITY } else { triangle_errors(case)[0] + 2e-7 }
}

fn cosine_to_triangle(x: &[f64]) -> f64 {
    let [d, a, b, c] = [3, 6, 9, 12].map(|k| vector(x, k));
    let n = (b - a).cross(c - a);
    n.dot(d).abs() / (n.length() * d.length())
}

fn pair_of(p: DVec3) -> [DVec3; 2] {
    let hi = DVec3::from_array(p.to_array().map(|x| f64::from(x as f32)));
    [hi, p - hi]
}

/// A ray that hits a triangle of about unit size, not edge-on, and t, u, v of the hit.
fn ray_to_point(d: &mut SplitMix64) -> Vec<f32> {
    loop {
        let place = d.direction() * d.between(0.0, 2.0);
        let corners = columns(&[0; 3].map(|_| place + d.direction()));
        let exact = |row: &[f32]| row.iter().map(|&x| f64::from(x)).collect::<Vec<_>>();
        let x = exact(&corners);
        let [a, b, c] = [0, 3, 6].map(|k| vector(&x, k));
        let (target, direction) = (hit_point(a, b, c, d.unit(), d.unit()), d.direction());
        let ray = columns(&[target - direction * d.log(1.0, 1e4), direction]);
        let y = exact(&ray);
        let [t, u, v] = plane_meeting(vector(&y, 0), vector(&y, 3), a, b, c);
        let n = (b - a).cross(c - a);
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && n.dot(direction).abs() > 0.1 * n.length() {
            return [ray, vec![t as f32], corners, vec![u as f32, v as f32]].concat();
        }
    }
}

/// The equations of this file.
pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        name: "ray_sphere",
        twin: |x| ray_sphere(vector(x, 0), vector(x, 3), vector(x, 6), x[9]).to_vec(),
        regions: &[
            Region {
                name: "far away, 1e3 … 1e5",
                share: 2,
                draw: |d| {
                    let (distance, impact) = (d.log(1e3, 1e5), d.between(0.0, 1.2));
                    toward_sphere(d, distance, impact)
                },
            },
            Region {
                name: "nearby",
                share: 1,
                draw: |d| {
                    let (distance, impact) = (d.between(-20.0, 20.0), d.between(0.0, 1.2));
                    toward_sphere(d, distance, impact)
                },
            },
            Region {
                name: "small root: the origin near the surface",
                share: 2,
                draw: |d| {
                    let (center, radius) = (d.direction() * d.below(2) as f64, d.log(0.1, 10.0));
                    let origin = center + d.direction() * radius * (1.0 + d.sign() * d.log(1e-6, 0.9));
                    let direction = d.direction();
                    sphere_case(d, center, radius, origin, direction)
                },
            },
        ],
        outputs: &[
            Output {
                name: "hit",
                bound: "exact where |r² − l²| > δ; stable δ = 2^-24 (5lf + 4r²), compensated 2^-42 r(f + r)",
                allowed: |c| {
                    let a = approach(c);
                    flag(a.disc.abs() <= a.disc_error)
                },
            },
            Output {
                name: "t0",
                bound: "5 ulp + δ/√D, √(3δ) where D = r² − l² ≤ 2δ; stable near the surface 2^-21 (f² + r²)/|f² − r²|",
                allowed: root_allowed,
            },
            Output { name: "t1", bound: "as t0", allowed: root_allowed },
        ],
        axis: Axis {
            name: "distance of the center, in radii",
            log: true,
            of: |x| (vector(x, 0) - vector(x, 6)).length() / x[9],
            column: 1,
            relative: true,
        },
        extreme: 1e38,
    },
    Equation {
        name: "meets",
        twin: |x| vec![flag(meets(vector(x, 0), vector(x, 3), x[6], x[7]))],
        regions: &[Region {
            name: "ends of either sign",
            share: 1,
            draw: |d| {
                let mut ends = [0; 6].map(|_| d.sign() * d.log(1e-3, 1e3));
                for k in 0..3 {
                    if ends[k] > ends[k + 3] {
                        ends.swap(k, k + 3);
                    }
                }
                let mut row = ends.map(|t| t as f32).to_vec();
                row.extend([if d.below(2) == 0 { 0.0 } else { d.log(1e-3, 1e3) as f32 }, d.log(1e-3, 1e3) as f32]);
                row
            },
        }],
        outputs: &[Output { name: "hit", bound: "exact", allowed: EXACT }],
        axis: Axis { name: "t_max", log: true, of: |x| x[7], column: 0, relative: false },
        extreme: 1e38,
    },
    Equation {
        name: "slab",
        twin: |x| slab(vector(x, 0), vector(x, 3), vector(x, 6), vector(x, 9), x[13]).to_vec(),
        regions: &[
            Region { name: "inside, beside, at edges and corners", share: 2, draw: |d| box_case(d, false) },
            Region { name: "parallel to planes, half of them in one", share: 2, draw: |d| box_case(d, true) },
        ],
        outputs: &[
            Output {
                name: "hit",
                bound: "no box is missed; one missed by less than the pads may be hit",
                allowed: |c| {
                    let [near, far] = box_of(c.inputs);
                    // A ray parallel to a plane that lies beside the box, within the pad in lengths.
                    let beside = (0..3).any(|k| {
                        let gap = (c.inputs[6 + k] - c.inputs[k]).abs() - c.inputs[9 + k];
                        c.inputs[3 + k] == 0.0 && gap > 0.0 && gap <= 4.0 * c.inputs[12]
                    });
                    let slack: f64 = box_slack(c.inputs).iter().sum();
                    flag(c.x() == 0.0 && (beside || near - far <= slack))
                },
            },
            Output {
                name: "t_near",
                bound: "the pad over the direction",
                allowed: |c| box_slack(c.inputs)[0] + c.ulps(4.0),
            },
            Output { name: "t_far", bound: "as t_near", allowed: |c| box_slack(c.inputs)[1] + c.ulps(4.0) },
        ],
        axis: Axis { name: "t_near", log: true, of: |x| box_of(x)[0], column: 1, relative: true },
        extreme: -1.0,
    },
    Equation {
        name: "ray_triangle",
        twin: |x| {
            let [o, d, a, b, c] = [0, 3, 6, 9, 12].map(|k| vector(x, k));
            ray_triangle(o, d, a, b, c).to_vec()
        },
        regions: &[
            Region {
                name: "distances 0.1 … 1e3",
                share: 3,
                draw: |d| {
                    let distance = d.log(0.1, 1e3);
                    toward_triangle(d, distance, 1.0)
                },
            },
            Region {
                name: "scales 1e-30 … 1e30",
                share: 1,
                draw: |d| {
                    let (distance, scale) = (d.log(0.1, 10.0), d.log(1e-30, 1e30));
                    toward_triangle(d, distance, scale)
                },
            },
            Region {
                name: "grazing, |cos| 1e-5 … 0.1",
                share: 1,
                draw: |d| {
                    let n = d.direction();
                    let e = d.perpendicular(n);
                    let [a, b, c] = [0.0, 2.1, 4.2].map(|phi: f64| e * phi.cos() + n.cross(e) * phi.sin());
                    let (u, v) = (d.between(0.0, 0.7), d.between(0.0, 0.3));
                    let along = d.perpendicular(n);
                    let direction = d.at_angle(along, 0.0) + n * d.sign() * d.log(1e-5, 0.1);
                    let origin = hit_point(a, b, c, u, v) - direction * d.log(0.1, 10.0);
                    columns(&[origin, direction, a, b, c])
                },
            },
        ],
        outputs: &[
            Output {
                name: "hit",
                bound: "exact where the weights are farther from 0 than δ = 2^-20 reach·across/2 area; compensated 2^-40",
                allowed: |c| flag(undecided(c)),
            },
            Output {
                name: "t",
                bound: "2δ of the vertices' spread in t + 2^-21 of the largest of them",
                allowed: |c| if undecided(c) { f64::INFINITY } else { triangle_errors(c)[1] },
            },
            Output { name: "u", bound: "δ + 2e-7", allowed: weight_allowed },
            Output { name: "v", bound: "δ + 2e-7", allowed: weight_allowed },
        ],
        axis: Axis { name: "|cos| of ray and normal", log: true, of: cosine_to_triangle, column: 1, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "offset_origin",
        twin: |x| offset_origin(vector(x, 0), vector(x, 3), vector(x, 6), x[9]).to_array().to_vec(),
        regions: &[Region {
            name: "coordinates 1e-2 … 1e5, of scenes as large or larger",
            share: 1,
            draw: |d| {
                let p = DVec3::from_array([0; 3].map(|_| d.sign() * d.log(1e-2, 1e5)));
                let free = if d.below(2) == 0 { DVec3::ZERO } else { d.direction() };
                let offset = p.abs().max_element() * d.log(1.0, 1e3) * 32.0 / 16_777_216.0;
                [columns(&[p, d.direction(), free]), vec![offset as f32]].concat()
            },
        }],
        outputs: &[
            Output {
                name: "qx",
                bound: "1 ulp + 2.4e-7 of the offset",
                allowed: |c| c.ulps(1.0) + 2.4e-7 * c.inputs[9],
            },
            Output { name: "qy", bound: "as qx", allowed: |c| c.ulps(1.0) + 2.4e-7 * c.inputs[9] },
            Output { name: "qz", bound: "as qx", allowed: |c| c.ulps(1.0) + 2.4e-7 * c.inputs[9] },
        ],
        axis: Axis { name: "|p|", log: true, of: |x| vector(x, 0).length(), column: 0, relative: false },
        extreme: 1e18,
    },
    Equation {
        name: "hit_point",
        twin: |x| hit_point(vector(x, 7), vector(x, 10), vector(x, 13), x[16], x[17]).to_array().to_vec(),
        regions: &[Region {
            name: "origins 1 … 1e4 away from a triangle of unit size", share: 1, draw: ray_to_point
        }],
        outputs: &[
            Output { name: "Px", bound: POINT_BOUND, allowed: point_allowed },
            Output { name: "Py", bound: "as Px", allowed: point_allowed },
            Output { name: "Pz", bound: "as Px", allowed: point_allowed },
        ],
        axis: Axis { name: "t", log: true, of: |x| x[6], column: 0, relative: false },
        extreme: 1e38,
    },
    Equation {
        name: "camera_relative",
        twin: |x| {
            let [p_hi, p_lo, eye_hi, eye_lo] = [0, 3, 6, 9].map(|k| vector(x, k));
            camera_relative([p_hi, p_lo], [eye_hi, eye_lo]).to_array().to_vec()
        },
        regions: &[Region {
            name: "1e-3 … 1e3 m from an eye at 1 … 1e7 m",
            share: 1,
            draw: |d| {
                let eye = d.direction() * d.log(1.0, 1e7);
                let p = eye + d.direction() * d.log(1e-3, 1e3);
                columns(&[pair_of(p), pair_of(eye)].concat())
            },
        }],
        outputs: &[
            Output { name: "p_relx", bound: "1 ulp", allowed: |c| c.ulps(1.0) },
            Output { name: "p_rely", bound: "1 ulp", allowed: |c| c.ulps(1.0) },
            Output { name: "p_relz", bound: "1 ulp", allowed: |c| c.ulps(1.0) },
        ],
        axis: Axis { name: "|eye|, m", log: true, of: |x| vector(x, 6).length(), column: 0, relative: false },
        extreme: 1e38,
    },
];

const POINT_BOUND: &str = "1 ulp + 4e-7 of the triangle's size";

fn point_allowed(case: &Case<'_>) -> f64 {
    let [a, b, c] = [7, 10, 13].map(|k| vector(case.inputs, k));
    ulp(case.x()) + 4e-7 * (b - a).length().max((c - a).length())
}
