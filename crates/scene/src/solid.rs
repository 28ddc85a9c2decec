//! Closed dielectric meshes (solids) and thin-walled surfaces, and the solids that contain a point.
//!
//! Refraction needs the side of the surface on which a ray is, and only a watertight mesh separates an inside from an
//! outside. A transmissive mesh is therefore a solid if it is closed, alone or with meshes that continue its edges, and
//! a thin-walled surface otherwise. Read Schmidt and Budge, "Simple Nested Dielectrics in Ray Traced Images", journal
//! of graphics tools, 2002; KHR_materials_volume. Assumes triangles counter-clockwise from the front.

use std::collections::{BTreeMap, HashMap, HashSet};

use glam::{DVec3, Vec3};

use super::{AlphaMode, Bounds, Instance, Material, Mesh, Scene};

/// A volume below this fraction of the sum of its terms' magnitudes is rounding error: the sum over a mesh of a million
/// triangles has errors of 1e-16 each.
const NO_VOLUME: f64 = 1e-12;

/// Open edges whose ends are closer than this fraction of a mesh's size meet in a seam: the sine of 2π, where a turned
/// surface should end at its beginning, is 2e-16 in f64 and 2e-7 in f32.
const SEAM: f64 = 1e-6;

/// Solids and thin-walled surfaces among the instances of a scene; each list has one entry per instance, `medium` one
/// per material.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Solids {
    /// Closed transmissive meshes, and transmissive parts of closed bodies of several meshes.
    pub solid: Vec<bool>,
    /// The body that an instance bounds, by its first instance. A closed mesh is a body of its own. The parts of a body
    /// of several meshes have one number, opaque parts too. `None` for surfaces that bound no body.
    pub body: Vec<Option<usize>>,
    /// The material whose medium a material has inside: the first one of a body of several materials, usually itself.
    pub medium: Vec<usize>,
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
/// duplicate vertices without a gap; edges that are open then, within a millionth of the mesh's size. Triangles with
/// two corners in one place are ignored. The mesh need not be manifold: surfaces may touch or cross themselves, and
/// several may form one mesh. A mesh without triangles is not closed.
#[must_use]
pub fn is_closed(mesh: &Mesh) -> bool {
    let has_triangles = mesh.indices.as_chunks::<3>().0.iter().any(|&[a, b, c]| a != b && b != c && c != a);
    has_triangles && closes_at_seams(mesh, rim(mesh))
}

/// Whether the open edges of a mesh cancel where ends within [`SEAM`] are one vertex.
fn closes_at_seams(mesh: &Mesh, rim: HashMap<Edge, i64>) -> bool {
    if rim.is_empty() {
        return true;
    }
    let all = || mesh.positions.iter().map(|&p| Vec3::from(p).as_dvec3());
    let least = all().fold(DVec3::INFINITY, DVec3::min);
    let reach = SEAM * (all().fold(DVec3::NEG_INFINITY, DVec3::max) - least).max_element();
    // Two sheets as near to each other as the ends of a seam bound nothing either.
    if !(reach > 0.0 && reach.is_finite()) || signed_volume(&[mesh]).abs() <= 4.0 * reach * area(mesh) {
        return false;
    }
    // The first vertex of a place stands for those within reach of it: it is in their cell or beside it.
    let mut ends: Vec<[u32; 3]> = rim.keys().flatten().copied().collect();
    ends.sort_unstable();
    ends.dedup();
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    let mut places: Vec<DVec3> = Vec::new();
    let mut place_of: HashMap<[u32; 3], usize> = HashMap::new();
    for end in ends {
        let p = Vec3::from(end.map(f32::from_bits)).as_dvec3();
        let cell = ((p - least) / reach).floor().to_array().map(|x| x as i64);
        let beside = (0..27).map(|i| [cell[0] + i % 3 - 1, cell[1] + i / 3 % 3 - 1, cell[2] + i / 9 - 1]);
        let known =
            beside.filter_map(|cell| cells.get(&cell)).flatten().copied().find(|&i| places[i].distance(p) <= reach);
        place_of.insert(
            end,
            known.unwrap_or_else(|| {
                places.push(p);
                cells.entry(cell).or_default().push(places.len() - 1);
                places.len() - 1
            }),
        );
    }
    let mut open: HashMap<[usize; 2], i64> = HashMap::new();
    for (edge, count) in rim {
        let [p, q] = edge.map(|end| place_of[&end]);
        *open.entry([p.min(q), p.max(q)]).or_default() += if p < q { count } else { -count };
    }
    open.iter().all(|([p, q], &count)| p == q || count == 0)
}

/// A directed edge: the bits of both ends, the smaller first.
type Edge = [[u32; 3]; 2];

/// The open edges of a mesh, welded by position: how much more often each is run from its smaller to its larger end
/// than back.
fn rim(mesh: &Mesh) -> HashMap<Edge, i64> {
    let at = |i: u32| mesh.positions[i as usize].map(|x| (x + 0.0).to_bits());
    let mut edges = Vec::with_capacity(mesh.indices.len());
    for triangle in mesh.indices.as_chunks::<3>().0 {
        let [a, b, c] = triangle.map(at);
        if a != b && b != c && c != a {
            edges.extend([(a, b), (b, c), (c, a)].map(|(p, q)| ([p.min(q), p.max(q)], if p < q { 1 } else { -1 })));
        }
    }
    edges.sort_unstable();
    let same = edges.chunk_by(|e, f| e.0 == f.0);
    same.map(|same| (same[0].0, same.iter().map(|e| e.1).sum())).filter(|&(_, count)| count != 0).collect()
}

fn corners(mesh: &Mesh) -> impl Iterator<Item = [DVec3; 3]> {
    let at = |i: u32| Vec3::from(mesh.positions[i as usize]).as_dvec3();
    mesh.indices.as_chunks::<3>().0.iter().map(move |triangle| triangle.map(at))
}

/// Area of a mesh in object space.
fn area(mesh: &Mesh) -> f64 {
    corners(mesh).map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).filter(|x| x.is_finite()).sum()
}

/// Volume in object space of what meshes bound together: positive when their fronts look outwards, 0 when it is below
/// rounding error.
fn signed_volume(meshes: &[&Mesh]) -> f64 {
    let all = || meshes.iter().flat_map(|mesh| mesh.positions.iter()).map(|&p| Vec3::from(p).as_dvec3());
    // Tetrahedra from the middle of the mesh: from a distant origin they would be large and cancel.
    let middle = (all().fold(DVec3::INFINITY, DVec3::min) + all().fold(DVec3::NEG_INFINITY, DVec3::max)) * 0.5;
    let (mut sum, mut magnitude) = (0.0, 0.0);
    for [a, b, c] in meshes.iter().flat_map(|mesh| corners(mesh)) {
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
    if is_closed(mesh) { closed_body(&[mesh]) } else { Body::Open }
}

fn closed_body(meshes: &[&Mesh]) -> Body {
    match signed_volume(meshes) {
        v if v > 0.0 => Body::Solid,
        v if v < 0.0 => Body::InsideOut,
        _ => Body::Empty,
    }
}

/// Whether light in both materials meets the same medium inside.
fn same_medium(a: &Material, b: &Material) -> bool {
    let of = |m: &Material| (m.ior, m.attenuation_distance, m.attenuation_color, m.priority, m.dispersion);
    of(a) == of(b) && a.sigma.is_none() && b.sigma.is_none()
}

/// Whether a material refracts as the boundary of a medium where its mesh is closed. Alpha-blended surfaces do not
/// refract.
fn bounds_medium(m: &Material) -> bool {
    m.transmission > 0.0 && m.thickness > 0.0 && m.alpha_mode != AlphaMode::Blend
}

/// Bodies of several meshes, such as the primitives of one glTF mesh: an open transmissive mesh, and meshes in the same
/// place whose open edges close its own. Each is a list of instances, the first one transmissive. Parts that transmit
/// have one medium.
fn joint_bodies(scene: &Scene, open: &[usize]) -> Vec<Vec<usize>> {
    let material = |instance: usize| &scene.materials[scene.meshes[scene.instances[instance].mesh].material];
    let place = |instance: usize| scene.instances[instance].world_from_object.to_cols_array().map(f64::to_bits);
    let places: HashSet<[u64; 12]> = open.iter().map(|&i| place(i)).collect();
    let mut rims: HashMap<usize, HashMap<Edge, i64>> = HashMap::new();
    let mut at_edge: HashMap<([u64; 12], Edge), Vec<usize>> = HashMap::new();
    for i in (0..scene.instances.len()).filter(|&i| !open.is_empty() && places.contains(&place(i))) {
        let rim = rims.entry(scene.instances[i].mesh).or_insert_with(|| rim(&scene.meshes[scene.instances[i].mesh]));
        for &edge in rim.keys() {
            at_edge.entry((place(i), edge)).or_default().push(i);
        }
    }
    let mut joined: HashSet<usize> = HashSet::new();
    let mut bodies = Vec::new();
    for &first in open {
        if joined.contains(&first) {
            continue;
        }
        let mut parts = vec![first];
        let mut open_edges = rims[&scene.instances[first].mesh].clone();
        while let Some((&edge, &count)) = open_edges.iter().min() {
            let closes = |&&i: &&usize| {
                let fits = !bounds_medium(material(i)) || same_medium(material(first), material(i));
                let opposite = rims[&scene.instances[i].mesh].get(&edge).is_some_and(|other| other * count < 0);
                fits && opposite && !parts.contains(&i) && !joined.contains(&i)
            };
            let Some(&next) = at_edge[&(place(first), edge)].iter().find(closes) else { break };
            for (&edge, &count) in &rims[&scene.instances[next].mesh] {
                let sum = open_edges.entry(edge).or_default();
                *sum += count;
                if *sum == 0 {
                    open_edges.remove(&edge);
                }
            }
            parts.push(next);
        }
        // A pane in a wall closes with it, but the room behind is no glass: most of a body's surface transmits.
        let area_of = |i: usize| area(&scene.meshes[scene.instances[i].mesh]);
        let transmits = |&&i: &&usize| bounds_medium(material(i));
        let whole: f64 = parts.iter().map(|&i| area_of(i)).sum();
        let transmissive: f64 = parts.iter().filter(transmits).map(|&i| area_of(i)).sum();
        let is_body = open_edges.is_empty() && 2.0 * transmissive >= whole;
        // What stays open stays so from the other transmissive parts, too.
        joined.extend(parts.iter().copied().filter(|i| is_body || transmits(&i)));
        if is_body {
            bodies.push(parts);
        }
    }
    bodies
}

/// Classifies the transmissive instances as solids or thin-walled surfaces; each mesh is tested once.
#[must_use]
pub fn solids(scene: &Scene) -> Solids {
    let count = scene.instances.len();
    let mesh = |instance: usize| &scene.meshes[scene.instances[instance].mesh];
    let material = |instance: usize| &scene.materials[mesh(instance).material];
    let mut of_meshes: Vec<Option<Body>> = vec![None; scene.meshes.len()];
    let mut classes: Vec<Option<Body>> = (0..count)
        .map(|i| {
            let known = &mut of_meshes[scene.instances[i].mesh];
            bounds_medium(material(i)).then(|| *known.get_or_insert_with(|| body(mesh(i))))
        })
        .collect();
    let is_solid = |class: Option<Body>| matches!(class, Some(Body::Solid | Body::InsideOut));
    let mut body: Vec<Option<usize>> = (0..count).map(|i| is_solid(classes[i]).then_some(i)).collect();
    let mut medium: Vec<usize> = (0..scene.materials.len()).collect();
    let open: Vec<usize> = (0..count).filter(|&i| classes[i] == Some(Body::Open)).collect();
    for parts in joint_bodies(scene, &open) {
        let whole = closed_body(&parts.iter().map(|&i| mesh(i)).collect::<Vec<_>>());
        if !is_solid(Some(whole)) {
            continue;
        }
        for &i in &parts {
            body[i] = Some(parts[0]);
            if bounds_medium(material(i)) {
                classes[i] = Some(whole);
                let [a, b] = [parts[0], i].map(|i| medium[mesh(i).material]);
                medium.iter_mut().filter(|of| **of == a.max(b)).for_each(|of| *of = a.min(b));
            }
        }
    }
    let mut warned = HashSet::new();
    let mut warnings = Vec::new();
    for i in (0..count).filter(|&i| classes[i].is_some()) {
        let what = match classes[i] {
            Some(Body::InsideOut) => "is inside out: its faces are turned",
            Some(Body::Open) => "is not closed: read as a thin sheet of its nominal thickness",
            Some(Body::Empty) => "bounds no volume: read as a thin sheet of its nominal thickness",
            _ => continue,
        };
        let flat = material(i).sigma.is_some() && classes[i] != Some(Body::InsideOut);
        let grid = if flat { ", its grid of sigma by its mean" } else { "" };
        if warned.insert(scene.instances[i].mesh) {
            warnings.push(format!("mesh \"{}\" transmits light and {what}{grid}", mesh(i).name));
        }
    }
    let inside_out = |i: usize| classes[i] == Some(Body::InsideOut);
    Solids {
        solid: (0..count).map(|i| is_solid(classes[i])).collect(),
        body,
        medium,
        sheet: (0..count).map(|i| material(i).transmission > 0.0 && !is_solid(classes[i])).collect(),
        flipped: (0..count).map(inside_out).collect(),
        normals_flipped: (0..count).map(|i| inside_out(i) && normals_follow_faces(mesh(i))).collect(),
        warnings,
    }
}

/// Bodies that contain a point, by their first instance ([`Solids::body`]), the one with the largest box first: nested
/// solids come from the outside in.
///
/// The test is the winding number: the signed solid angles of the triangles, seen from the point, sum to ±4π inside and
/// to 0 outside, for any winding and mirroring. On the surface itself the result is either.
#[must_use]
pub fn media_at(scene: &Scene, solids: &Solids, p_world: DVec3) -> Vec<usize> {
    let mut bodies: BTreeMap<usize, (Vec<usize>, Bounds)> = BTreeMap::new();
    for (i, instance) in scene.instances.iter().enumerate() {
        if let Some(body) = solids.body[i] {
            let bounds = seen_from(&scene.meshes[instance.mesh], instance, p_world);
            let (parts, all) = bodies.entry(body).or_insert_with(|| (Vec::new(), bounds));
            parts.push(i);
            *all = Bounds { min: all.min.min(bounds.min), max: all.max.max(bounds.max) };
        }
    }
    let mut media = Vec::new();
    for (body, (parts, bounds)) in bodies {
        let is_near = bounds.min.cmple(DVec3::ZERO).all() && bounds.max.cmpge(DVec3::ZERO).all();
        let winding = |&i: &usize| winding_number(&scene.meshes[scene.instances[i].mesh], &scene.instances[i], p_world);
        if is_near && parts.iter().map(winding).sum::<f64>().abs() > 0.5 {
            let size = bounds.max - bounds.min;
            media.push((size.x * size.y * size.z, body));
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
