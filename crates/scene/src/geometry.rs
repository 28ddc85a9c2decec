//! Mesh preparation: clean triangles, normals, tangent space (MikkTSpace), texture coordinates.
//!
//! Read glTF 2.0 section 3.7.2.1 (meshes, attributes). The steps change one [`Mesh`] in place and count their repairs;
//! the caller reports the counts. Arithmetic on file data is f64, so that slivers keep their normal: differences of f32
//! coordinates and the products of such differences are nearly exact in f64.

use std::collections::HashMap;

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{DVec3, Vec3};

use super::{Mesh, Shared};

/// Number of faults that [`finish`] repaired, by kind.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Repairs {
    /// Triangles with a corner at NaN or infinity.
    pub(crate) not_finite: usize,
    /// Triangles without area, dropped because they have no flat normal.
    pub(crate) no_area: usize,
    /// Vertex normals that were zero or not finite, replaced by the area-weighted mean of the faces around the vertex.
    pub(crate) bad_normals: usize,
    /// Vertex tangents that were zero or not finite, replaced by an arbitrary perpendicular.
    pub(crate) bad_tangents: usize,
    /// Texture coordinates or colours that were not finite, replaced by zero.
    pub(crate) bad_attributes: usize,
}

impl Repairs {
    /// One sentence for each kind of fault that occurred.
    pub(crate) fn sentences(&self, place: &str) -> Vec<String> {
        [
            (self.not_finite, "triangle(s) with a corner that is not finite were dropped"),
            (self.no_area, "triangle(s) without area were dropped"),
            (self.bad_normals, "normal(s) of zero or infinite length were replaced by the face's normal"),
            (self.bad_tangents, "tangent(s) of zero or infinite length were replaced by a perpendicular to the normal"),
            (self.bad_attributes, "texture coordinate(s) or colour(s) that are not finite were set to zero"),
        ]
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("{place}: {count} {what}"))
        .collect()
    }
}

/// Completes a mesh of decoded attributes: adds flat normals if it has none, and tangents from texture-coordinate set
/// `tangent_set` if requested and missing.
pub(crate) fn finish(mesh: &mut Mesh, tangent_set: Option<usize>) -> Repairs {
    let mut repairs = Repairs { not_finite: drop_not_finite(mesh), ..Repairs::default() };
    compact(mesh);
    for uvs in &mut mesh.uvs {
        repairs.bad_attributes += zero_not_finite(uvs);
    }
    repairs.bad_attributes += zero_not_finite(&mut mesh.colors);
    if mesh.normals.is_empty() {
        // Tangents in a file are relative to its normals, so without normals they are dropped.
        mesh.tangents = Shared::default();
        repairs.no_area = flatten(mesh);
    } else {
        repairs.bad_normals = normalize_normals(mesh);
    }
    match tangent_set {
        Some(set) if mesh.tangents.is_empty() => generate(mesh, set),
        Some(_) => repairs.bad_tangents = normalize_tangents(mesh),
        None => mesh.tangents = Shared::default(),
    }
    repairs
}

fn position(mesh: &Mesh, index: u32) -> DVec3 {
    Vec3::from(mesh.positions[index as usize]).as_dvec3()
}

/// Normal of a triangle with the length of twice its area.
fn area_vector(mesh: &Mesh, corners: [u32; 3]) -> DVec3 {
    let [a, b, c] = corners.map(|i| position(mesh, i));
    (b - a).cross(c - a)
}

fn drop_not_finite(mesh: &mut Mesh) -> usize {
    let finite = |p: &[f32; 3]| p.iter().all(|x| x.is_finite());
    if mesh.positions.iter().all(finite) {
        return 0;
    }
    let before = mesh.indices.len();
    let kept =
        mesh.indices.as_chunks::<3>().0.iter().filter(|t| t.iter().all(|&i| finite(&mesh.positions[i as usize])));
    mesh.indices = kept.flatten().copied().collect();
    (before - mesh.indices.len()) / 3
}

fn zero_not_finite<const N: usize>(values: &mut [[f32; N]]) -> usize {
    let mut count = 0;
    for value in values {
        if !value.iter().all(|x| x.is_finite()) {
            *value = [0.0; N];
            count += 1;
        }
    }
    count
}

/// Copies every attribute of `mesh` so that new vertex `i` is old vertex `sources[i]`.
fn gather(mesh: &mut Mesh, sources: &[u32]) {
    fn pick<T: Copy>(values: &mut Vec<T>, sources: &[u32]) {
        if !values.is_empty() {
            *values = sources.iter().map(|&i| values[i as usize]).collect();
        }
    }
    pick(&mut mesh.positions, sources);
    pick(&mut mesh.normals, sources);
    pick(&mut mesh.tangents, sources);
    mesh.uvs.iter_mut().for_each(|uvs| pick(uvs, sources));
    pick(&mut mesh.colors, sources);
}

/// Removes vertices without triangles: they would enlarge the bounds and cost memory.
fn compact(mesh: &mut Mesh) {
    let mut used = vec![false; mesh.positions.len()];
    mesh.indices.iter().for_each(|&i| used[i as usize] = true);
    if used.iter().all(|&u| u) {
        return;
    }
    let mut renamed = vec![u32::MAX; mesh.positions.len()];
    let mut sources = Vec::new();
    for index in &mut mesh.indices {
        let slot = &mut renamed[*index as usize];
        if *slot == u32::MAX {
            *slot = sources.len() as u32;
            sources.push(*index);
        }
        *index = *slot;
    }
    gather(mesh, &sources);
}

/// Gives every triangle its own three vertices with a flat normal; returns the number of triangles without area.
fn flatten(mesh: &mut Mesh) -> usize {
    let mut normals = Vec::with_capacity(mesh.indices.len());
    let mut sources = Vec::with_capacity(mesh.indices.len());
    for &triangle in mesh.indices.as_chunks::<3>().0 {
        if let Some(normal) = area_vector(mesh, triangle).try_normalize() {
            normals.extend([normal.as_vec3().to_array(); 3]);
            sources.extend(triangle);
        }
    }
    let dropped = (mesh.indices.len() - sources.len()) / 3;
    gather(mesh, &sources);
    mesh.normals = normals.into();
    mesh.indices = (0..mesh.positions.len() as u32).collect();
    dropped
}

fn is_unit(v: [f32; 3]) -> bool {
    (Vec3::from(v).length_squared() - 1.0).abs() < 1e-6
}

fn unit(v: [f32; 3]) -> Option<[f32; 3]> {
    Vec3::from(v).as_dvec3().try_normalize().map(|n| n.as_vec3().to_array())
}

fn normalize_normals(mesh: &mut Mesh) -> usize {
    let mut bad = Vec::new();
    for (i, normal) in mesh.normals.iter_mut().enumerate() {
        if !is_unit(*normal) {
            match unit(*normal) {
                Some(n) => *normal = n,
                None => bad.push(i),
            }
        }
    }
    if bad.is_empty() {
        return 0;
    }
    // Area-weighted sum of the faces around the vertex.
    let mut sums: HashMap<usize, DVec3> = bad.iter().map(|&i| (i, DVec3::ZERO)).collect();
    for &triangle in mesh.indices.as_chunks::<3>().0 {
        for corner in triangle {
            if sums.contains_key(&(corner as usize)) {
                *sums.entry(corner as usize).or_default() += area_vector(mesh, triangle);
            }
        }
    }
    for &i in &bad {
        mesh.normals[i] = sums[&i].try_normalize().unwrap_or(DVec3::Y).as_vec3().to_array();
    }
    bad.len()
}

/// An arbitrary unit vector perpendicular to `normal`.
fn perpendicular(normal: [f32; 3]) -> [f32; 3] {
    Vec3::from(normal).any_orthonormal_vector().to_array()
}

fn normalize_tangents(mesh: &mut Mesh) -> usize {
    let mut bad = 0;
    for (tangent, &normal) in mesh.tangents.iter_mut().zip(&mesh.normals) {
        let [x, y, z, w] = *tangent;
        let [x, y, z] = if is_unit([x, y, z]) {
            [x, y, z]
        } else {
            unit([x, y, z]).unwrap_or_else(|| {
                bad += 1;
                perpendicular(normal)
            })
        };
        *tangent = [x, y, z, if w < 0.0 { -1.0 } else { 1.0 }];
    }
    bad
}

/// Adapter from a mesh to the MikkTSpace generator, with one resulting tangent per corner.
struct TangentCorners<'a> {
    mesh: &'a Mesh,
    set: usize,
    tangents: Vec<[f32; 4]>,
}

impl TangentCorners<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.indices[face * 3 + corner] as usize
    }
}

impl Geometry for TangentCorners<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.indices.len() / 3
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.positions[self.vertex(face, corner)]
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.normals[self.vertex(face, corner)]
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        // MikkTSpace assumes v upwards, glTF downwards; glTF files are baked with the handedness of the flipped
        // coordinate.
        let [u, v] = self.mesh.uvs[self.set].get(self.vertex(face, corner)).copied().unwrap_or_default();
        [u, 1.0 - v]
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        let normal = self.mesh.normals[self.vertex(face, corner)];
        let [x, y, z, w] = space.map_or([0.0; 4], |s| s.tangent_encoded());
        let [x, y, z] = unit([x, y, z]).unwrap_or_else(|| perpendicular(normal));
        self.tangents[face * 3 + corner] = [x, y, z, if w < 0.0 { -1.0 } else { 1.0 }];
    }
}

/// Generates MikkTSpace tangents; a vertex whose corners have different tangents is split.
fn generate(mesh: &mut Mesh, set: usize) {
    let mut corners = TangentCorners { mesh, set, tangents: vec![[1.0, 0.0, 0.0, 1.0]; mesh.indices.len()] };
    // The error type of the generator is uninhabited.
    let _ = generate_tangents(&mut corners);
    let per_corner = corners.tangents;
    let mut sources: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let mut tangents: Vec<Option<[f32; 4]>> = vec![None; sources.len()];
    let mut splits: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    for (index, tangent) in mesh.indices.iter_mut().zip(per_corner) {
        match tangents[*index as usize] {
            None => tangents[*index as usize] = Some(tangent),
            Some(present) if present == tangent => {}
            Some(_) => {
                *index = *splits.entry((*index, tangent.map(f32::to_bits))).or_insert_with(|| {
                    sources.push(*index);
                    tangents.push(Some(tangent));
                    sources.len() as u32 - 1
                });
            }
        }
    }
    if sources.len() > mesh.positions.len() {
        mesh.tangents = Shared::default();
        gather(mesh, &sources);
    }
    let fallback = |(t, &n): (Option<[f32; 4]>, _)| {
        t.unwrap_or_else(|| {
            let [x, y, z] = perpendicular(n);
            [x, y, z, 1.0]
        })
    };
    mesh.tangents = tangents.into_iter().zip(&mesh.normals).map(fallback).collect();
}
