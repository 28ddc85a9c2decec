//! Mesh files without materials: STL (stereolithography) and PLY (Stanford polygons).
//!
//! The crates `stl_io` and `ply-rs-bw` parse; this file makes a scene of one grey, rough, two-sided surface. STL has +Z
//! up, as printers have it, and flat normals of its own making. PLY may have normals, vertex colours in sRGB; a PLY
//! file without faces is a cloud of points.

use std::io::Cursor;
use std::path::Path;

use anyhow::{Context, Result, bail};
use etalon_image::tone;
use glam::{DAffine3, DMat3};
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

use super::thin::{self, Stroke, StrokeGroup};
use super::{Instance, Material, Mesh, Scene, Shared, contents, geometry};

/// The surface of a file that has no materials.
fn surface() -> Material {
    Material {
        name: "surface".to_owned(),
        base_color: [0.8, 0.8, 0.8, 1.0],
        metallic: 0.0,
        roughness: 0.6,
        double_sided: true,
        ..Material::default()
    }
}

fn empty(path: &Path) -> Mesh {
    Mesh {
        name: path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned(),
        positions: Shared::default(),
        normals: Shared::default(),
        tangents: Shared::default(),
        uvs: [Shared::default(), Shared::default()],
        colors: Shared::default(),
        indices: Shared::default(),
        material: 0,
    }
}

/// A scene of one mesh: finished triangles, or a thin solid for each point where there is no triangle.
fn scene_of(path: &Path, mut mesh: Mesh, world_from_object: DAffine3, mut warnings: Vec<String>) -> Scene {
    let (mut meshes, mut instances) = (Vec::new(), Vec::new());
    let name = mesh.name.clone();
    if mesh.indices.is_empty() {
        let finite = |p: &[f32; 3]| p.iter().all(|x| x.is_finite());
        let strokes = (0_u32..).zip(&mesh.positions[..]).filter(|(_, p)| finite(p)).map(|(i, _)| Stroke::Point(i));
        let strokes = strokes.collect();
        let placements = vec![(name, world_from_object)];
        thin::add(&[StrokeGroup { placements, mesh, strokes }], &mut meshes, &mut instances);
    } else {
        let repairs = geometry::finish(&mut mesh, None);
        warnings.extend(repairs.sentences(&format!("mesh \"{name}\"")));
        meshes.push(mesh);
        instances.push(Instance { name, mesh: 0, world_from_object });
    }
    let file = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    Scene {
        name: path.display().to_string(),
        meshes,
        instances,
        materials: vec![surface()],
        warnings: warnings.into_iter().map(|warning| format!("{file}: {warning}")).collect(),
        ..Scene::default()
    }
}

/// Reads an `.stl` file, text or binary. Coordinates are metres.
pub(crate) fn load_stl(path: &Path) -> Result<Scene> {
    let read = stl_io::read_stl(&mut Cursor::new(contents(path)?)).context("it cannot be read as STL")?;
    let mut mesh = empty(path);
    mesh.positions = read.vertices.iter().map(|vertex| vertex.0).collect::<Vec<_>>().into();
    mesh.indices = read.faces.iter().flat_map(|face| face.vertices.map(|i| i as u32)).collect::<Vec<_>>().into();
    // +Z up to +Y up.
    let upright = DAffine3::from_mat3(DMat3::from_rotation_x(-std::f64::consts::FRAC_PI_2));
    Ok(scene_of(path, mesh, upright, Vec::new()))
}

/// A vertex of a PLY file, or a face: elements of other names are parsed and ignored.
#[derive(Debug, Default)]
struct PlyElement {
    position: [f32; 3],
    normal: [Option<f32>; 3],
    color: [Option<f32>; 4],
    corners: Vec<u32>,
}

impl PropertyAccess for PlyElement {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if let ("vertex_indices" | "vertex_index", Some(list)) = (name, property.to_u32_list()) {
            self.corners = list;
            return PropertyAccessResult::Set;
        }
        // Colours are bytes, or fractions.
        let scale = match property {
            Property::UChar(_) => 1.0 / 255.0,
            Property::UShort(_) => 1.0 / 65535.0,
            _ => 1.0,
        };
        let Some(value) = property.to_f32_lossy() else { return PropertyAccessResult::Ignored };
        match name {
            "x" => self.position[0] = value,
            "y" => self.position[1] = value,
            "z" => self.position[2] = value,
            "nx" => self.normal[0] = Some(value),
            "ny" => self.normal[1] = Some(value),
            "nz" => self.normal[2] = Some(value),
            "red" => self.color[0] = Some(value * scale),
            "green" => self.color[1] = Some(value * scale),
            "blue" => self.color[2] = Some(value * scale),
            "alpha" => self.color[3] = Some(value * scale),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// The values of an attribute, if every vertex has it.
fn attribute<const N: usize>(
    vertices: &[PlyElement],
    of: impl Fn(&PlyElement) -> [Option<f32>; N],
) -> Shared<[f32; N]> {
    let values: Option<Vec<[f32; N]>> = vertices
        .iter()
        .map(|vertex| {
            let found = of(vertex);
            found.iter().all(Option::is_some).then(|| found.map(Option::unwrap_or_default))
        })
        .collect();
    values.unwrap_or_default().into()
}

/// Reads a `.ply` file, text or binary of either byte order. Coordinates are metres.
pub(crate) fn load_ply(path: &Path) -> Result<Scene> {
    let bytes = contents(path)?;
    let read = Parser::<PlyElement>::new().read_ply(&mut Cursor::new(bytes)).context("it cannot be read as PLY")?;
    let none = Vec::new();
    let vertices = read.payload.get("vertex").unwrap_or(&none);
    let faces = read.payload.get("face").unwrap_or(&none);
    let count = u32::try_from(vertices.len()).context("it has more than 2^32 vertices")?;
    let mut mesh = empty(path);
    mesh.positions = vertices.iter().map(|vertex| vertex.position).collect::<Vec<_>>().into();
    mesh.normals = attribute(vertices, |vertex| vertex.normal);
    let linear = |value: f32| tone::srgb_decode(f64::from(value.clamp(0.0, 1.0))) as f32;
    mesh.colors = attribute(vertices, |vertex| {
        let [r, g, b, a] = vertex.color;
        [r.map(linear), g.map(linear), b.map(linear), a.or(Some(1.0))]
    });
    let mut triangles = Vec::new();
    for (face, PlyElement { corners, .. }) in faces.iter().enumerate() {
        if let Some(wrong) = corners.iter().find(|&&corner| corner >= count) {
            bail!("face {face} names vertex {wrong}, but there are {count}");
        }
        // Polygons as fans.
        triangles.extend(corners.windows(2).skip(1).flat_map(|edge| [corners[0], edge[0], edge[1]]));
    }
    mesh.indices = triangles.into();
    let mut warnings = Vec::new();
    let ignored = read.payload.keys().filter(|name| !["vertex", "face"].contains(&name.as_str()));
    warnings.extend(ignored.map(|name| format!("elements \"{name}\" are ignored")));
    Ok(scene_of(path, mesh, DAffine3::IDENTITY, warnings))
}
