//! Closed dielectric meshes (solids) and thin-walled surfaces, and the solids that contain a point.
//!
//! Refraction needs the side of the surface on which a ray is, and only a watertight mesh separates an inside from an
//! outside. A transmissive mesh is therefore a solid if it is closed, and a thin-walled surface otherwise. Read Schmidt
//! and Budge, "Simple Nested Dielectrics in Ray Traced Images", journal of graphics tools, 2002; KHR_materials_volume.
//! Assumes triangles counter-clockwise from the front.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::{AlphaMode, Bounds, Instance, Mesh, Scene};

/// A volume below this fraction of the sum of its terms' magnitudes is rounding error: the sum over a mesh of a million
/// triangles has errors of 1e-16 each.
const NO_VOLUME: f64 = 1e-12;

/// Solids and thin-walled surfaces among the instances of a scene; each list has one entry per instance.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Solids {
    /// Closed transmissive meshes.
    pub solid: Vec<bool>,
    /// Transmissive thin-walled surfaces, of their nominal thickness: blended, thickness 0, or a mesh that bounds no
    /// volume. False for surfaces that do not transmit.
    pub sheet: Vec<bool>,
    /// Solids with reversed winding in object space: the front faces look inwards. A mirrored placement does not count.
    pub flipped: Vec<bool>,
    /// Flipped solids whose vertex normals look inwards, too. A mesh may have correct normals with reversed winding.
    pub normals_flipped: Vec<bool>,
    /// One sentence for each mesh whose geometry contradicts its material.
    pub warnings: Vec<String>,
}

/// Whether a mesh is closed (watertight): every directed edge occurs as often as the opposite one.
///
/// Vertices are welded by position, to the last bit (−0 equals 0), because seams of normals and texture coordinates
/// duplicate vertices without a gap. Triangles with two corners in one place are ignored. The mesh need not be
/// manifold: surfaces may touch or cross themselves, and several may form one mesh. A mesh without triangles is not
/// closed.
#[must_use]
pub fn is_closed(mesh: &Mesh) -> bool {
    let mut names = HashMap::with_capacity(mesh.positions.len());
    let welded: Vec<u32> = mesh
        .positions
        .iter()
        .map(|p| {
            let next = names.len() as u32;
            *names.entry(p.map(|x| (x + 0.0).to_bits())).or_insert(next)
        })
        .collect();
    let mut edges = Vec::with_capacity(mesh.indices.len());
    for triangle in mesh.indices.as_chunks::<3>().0 {
        let [a, b, c] = triangle.map(|i| welded[i as usize]);
        if a != b && b != c && c != a {
            edges.extend([(a, b), (b, c), (c, a)].map(|(p, q)| (p.min(q), p.max(q), if p < q { 1 } else { -1 })));
        }
    }
    edges.sort_unstable();
    let ends = |edge: &(u32, u32, i64)| (edge.0, edge.1);
    !edges.is_empty()
        && edges.chunk_by(|e, f| ends(e) == ends(f)).all(|same| same.iter().map(|e| e.2).sum::<i64>() == 0)
}

fn corners(mesh: &Mesh) -> impl Iterator<Item = [DVec3; 3]> {
    let at = |i: u32| Vec3::from(mesh.positions[i as usize]).as_dvec3();
    mesh.indices.as_chunks::<3>().0.iter().map(move |triangle| triangle.map(at))
}

/// Volume of a closed mesh in object space: positive when its fronts look outwards, 0 when it is below rounding error.
fn signed_volume(mesh: &Mesh) -> f64 {
    let all = || mesh.positions.iter().map(|&p| Vec3::from(p).as_dvec3());
    // Tetrahedra from the middle of the mesh: from a distant origin they would be large and cancel.
    let middle = (all().fold(DVec3::INFINITY, DVec3::min) + all().fold(DVec3::NEG_INFINITY, DVec3::max)) * 0.5;
    let (mut sum, mut magnitude) = (0.0, 0.0);
    for [a, b, c] in corners(mesh) {
        let six = (a - middle).dot((b - middle).cross(c - middle));
        sum += six;
        magnitude += six.abs();
    }
    if sum.abs() > NO_VOLUME * magnitude { sum / 6.0 } else { 0.0 }
}

/// Whether the vertex normals of a mesh lie, in sum, on the front side of its triangles.
fn normals_follow_faces(mesh: &Mesh) -> bool {
    let agreement = mesh.indices.as_chunks::<3>().0.iter().zip(corners(mesh)).map(|(triangle, [a, b, c])| {
        let smooth: DVec3 = triangle.iter().map(|&i| Vec3::from(mesh.normals[i as usize]).as_dvec3()).sum();
        (b - a).cross(c - a).dot(smooth)
    });
    agreement.filter(|x| x.is_finite()).sum::<f64>() >= 0.0
}

/// Class of a transmissive mesh with a thickness: closed, closed with reversed winding, not closed, or closed without
/// volume.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Body {
    Solid,
    InsideOut,
    Open,
    Empty,
}

fn body(mesh: &Mesh) -> Body {
    if !is_closed(mesh) {
        return Body::Open;
    }
    match signed_volume(mesh) {
        v if v > 0.0 => Body::Solid,
        v if v < 0.0 => Body::InsideOut,
        _ => Body::Empty,
    }
}

/// Classifies the transmissive instances as solids or thin-walled surfaces; each mesh is tested once.
#[must_use]
pub fn solids(scene: &Scene) -> Solids {
    let mut warnings = Vec::new();
    let mut bodies: Vec<Option<Body>> = vec![None; scene.meshes.len()];
    let (mut solid, mut sheet, mut flipped, mut normals_flipped) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh];
        let material = &scene.materials[mesh.material];
        // Alpha-blended surfaces do not refract.
        let blends = material.alpha_mode == AlphaMode::Blend;
        if material.transmission <= 0.0 || material.thickness <= 0.0 || blends {
            solid.push(false);
            sheet.push(material.transmission > 0.0);
            flipped.push(false);
            normals_flipped.push(false);
            continue;
        }
        let body = *bodies[instance.mesh].get_or_insert_with(|| {
            let body = body(mesh);
            let what = match body {
                Body::Solid => return body,
                Body::InsideOut => "is inside out: its faces are turned",
                Body::Open => "is not closed: read as a thin sheet of its nominal thickness",
                Body::Empty => "bounds no volume: read as a thin sheet of its nominal thickness",
            };
            let grid = if material.sigma.is_some() && body != Body::InsideOut {
                ", its grid of sigma by its mean"
            } else {
                ""
            };
            warnings.push(format!("mesh \"{}\" transmits light and {what}{grid}", mesh.name));
            body
        });
        solid.push(matches!(body, Body::Solid | Body::InsideOut));
        sheet.push(matches!(body, Body::Open | Body::Empty));
        flipped.push(body == Body::InsideOut);
        normals_flipped.push(body == Body::InsideOut && normals_follow_faces(mesh));
    }
    Solids { solid, sheet, flipped, normals_flipped, warnings }
}

/// Transmissive solids that contain a point, as indices of instances, the one with the largest box first: nested solids
/// come from the outside in.
///
/// The test is the winding number: the signed solid angles of the triangles, seen from the point, sum to ±4π inside and
/// to 0 outside, for any winding and mirroring. On the surface itself the result is either.
#[must_use]
pub fn media_at(scene: &Scene, solids: &Solids, p_world: DVec3) -> Vec<usize> {
    let mut media = Vec::new();
    for (i, instance) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[instance.mesh];
        if !solids.solid[i] {
            continue;
        }
        let bounds = seen_from(mesh, instance, p_world);
        let is_near = bounds.min.cmple(DVec3::ZERO).all() && bounds.max.cmpge(DVec3::ZERO).all();
        if is_near && winding_number(mesh, instance, p_world).abs() > 0.5 {
            let size = bounds.max - bounds.min;
            media.push((size.x * size.y * size.z, i));
        }
    }
    media.sort_by(|a, b| b.0.total_cmp(&a.0));
    media.into_iter().map(|(_, i)| i).collect()
}

/// Upper bound on the number of solids that contain one point, by their bounding boxes in world axes.
#[must_use]
pub fn deepest_nesting(scene: &Scene, solids: &Solids) -> usize {
    let bodies = scene.instances.iter().zip(&solids.solid).filter(|(_, solid)| **solid);
    let mut boxes: Vec<Bounds> =
        bodies.map(|(instance, _)| seen_from(&scene.meshes[instance.mesh], instance, DVec3::ZERO)).collect();
    boxes.sort_by(|a, b| a.min.x.total_cmp(&b.min.x));
    let meet = |a: &Bounds, b: &Bounds| a.min.cmple(b.max).all() && b.min.cmple(a.max).all();
    // Boxes with a point in common: the one whose x range starts last overlaps all the others.
    let met = |i: usize| boxes[..i].iter().filter(|other| meet(&boxes[i], other)).count() + 1;
    (0..boxes.len()).map(met).max().unwrap_or_default()
}

/// Bounding box of an instance in world axes, relative to a point.
fn seen_from(mesh: &Mesh, instance: &Instance, p_world: DVec3) -> Bounds {
    let linear = instance.world_from_object.matrix3;
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &position in &mesh.positions {
        let p = linear * Vec3::from(position).as_dvec3();
        (min, max) = (min.min(p), max.max(p));
    }
    let offset = instance.world_from_object.translation - p_world;
    Bounds { min: min + offset, max: max + offset }
}

/// Winding number of an instance about a point: the signed solid angles of its triangles over 4π.
///
/// tan(Ω/2) = a·(b×c) / (|a||b||c| + (a·b)|c| + (b·c)|a| + (c·a)|b|) for corners a, b, c seen from the point
/// (van Oosterom & Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng. 30, 125, 1983).
fn winding_number(mesh: &Mesh, instance: &Instance, p_world: DVec3) -> f64 {
    let linear = instance.world_from_object.matrix3;
    let offset = instance.world_from_object.translation - p_world;
    let half_angles = corners(mesh).map(|triangle| {
        let [a, b, c] = triangle.map(|p| linear * p + offset);
        let [la, lb, lc] = [a, b, c].map(DVec3::length);
        let cosine = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        a.dot(b.cross(c)).atan2(cosine)
    });
    half_angles.sum::<f64>() / std::f64::consts::TAU
}
