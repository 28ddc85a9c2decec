//! Every real model and every broken file of the shared collection, where it is present.
#![allow(clippy::unwrap_used, reason = "a test may stop where it stands")]

use std::{
    fs,
    path::{Path, PathBuf},
};

use etalon::scene::{self, LoadOptions, Scene};
use glam::{DVec3, Vec3};

/// The collection beside the checkout, or `None` with a note.
fn assets() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/assets");
    if !folder.is_dir() {
        eprintln!("skipped: {} is absent", folder.display());
        return None;
    }
    Some(folder)
}

struct Row {
    file: String,
    triangles: usize,
    bounds: [[f64; 3]; 2],
}

/// Rows of the table of models: file, …, triangles, …, bounds, ….
fn rows(index: &str) -> Vec<Row> {
    let triple = |s: &str| -> Option<[f64; 3]> {
        let numbers: Option<Vec<f64>> =
            s.trim().trim_matches(['(', ')']).split(',').map(|n| n.trim().parse().ok()).collect();
        numbers?.try_into().ok()
    };
    let row = |line: &str| -> Option<Row> {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        if !cells.first()?.starts_with("models/") || cells.len() < 8 {
            return None;
        }
        let (min, max) = cells[7].split_once("..")?;
        Some(Row { file: cells[0].to_owned(), triangles: cells[3].parse().ok()?, bounds: [triple(min)?, triple(max)?] })
    };
    index.lines().filter_map(row).collect()
}

/// Box around the placed boxes of the meshes, which is how most tools compute bounds.
fn boxed_bounds(scene: &Scene) -> [DVec3; 2] {
    let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    for instance in &scene.instances {
        let positions = scene.meshes[instance.mesh].positions.iter().map(|&p| Vec3::from(p).as_dvec3());
        let (min, max) =
            positions.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), p| (min.min(p), max.max(p)));
        for corner in 0..8 {
            let pick = |bit: usize| if corner >> bit & 1 == 0 { min[bit] } else { max[bit] };
            let p = instance.world_from_object.transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
            bounds = [bounds[0].min(p), bounds[1].max(p)];
        }
    }
    bounds
}

fn check_is_drawable(scene: &Scene, file: &str) {
    for mesh in &scene.meshes {
        let n = mesh.positions.len();
        assert_eq!(mesh.normals.len(), n, "{file}: normals of {}", mesh.name);
        assert!(mesh.tangents.is_empty() || mesh.tangents.len() == n, "{file}: tangents of {}", mesh.name);
        assert!(mesh.colors.is_empty() || mesh.colors.len() == n, "{file}: colours of {}", mesh.name);
        assert!(mesh.uvs.iter().all(|uvs| uvs.is_empty() || uvs.len() == n), "{file}: uvs of {}", mesh.name);
        assert!(mesh.indices.iter().all(|&i| (i as usize) < n), "{file}: indices of {}", mesh.name);
        assert!(mesh.material < scene.materials.len(), "{file}: material of {}", mesh.name);
        let unit = |v: &[f32; 3]| (v.iter().map(|x| x * x).sum::<f32>() - 1.0).abs() < 1e-5;
        assert!(mesh.normals.iter().all(unit), "{file}: normals of {} are not unit", mesh.name);
        assert!(mesh.tangents.iter().all(|[x, y, z, w]| unit(&[*x, *y, *z]) && w.abs() == 1.0), "{file}: tangents");
        let has_map = scene.materials[mesh.material].normal_texture.is_some();
        assert!(!has_map || mesh.tangents.len() == n, "{file}: {} has a normal map and no tangents", mesh.name);
    }
    for image in &scene.images {
        assert_eq!(image.rgba.len(), image.width as usize * image.height as usize * 4, "{file}: {}", image.name);
    }
}

#[test]
fn every_model_has_the_triangles_and_bounds_of_the_table() {
    let Some(assets) = assets() else { return };
    let rows = rows(&fs::read_to_string(assets.join("INDEX.md")).unwrap());
    assert!(rows.len() > 30, "only {} rows were understood", rows.len());
    for Row { file, triangles, bounds } in rows {
        let start = std::time::Instant::now();
        let scene = scene::load(&assets.join(&file), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e:#}"));
        let seconds = start.elapsed().as_secs_f64();
        eprintln!("{file}: {} triangles in {seconds:.3} s {:?}", scene.triangles(), scene.warnings);
        check_is_drawable(&scene, &file);
        let strokes = file.contains("MeshPrimitiveModes");
        if !strokes {
            assert_eq!(scene.triangles(), triangles, "{file}: triangles");
        }
        let exact = scene.bounds().map(|b| [b.min, b.max]).unwrap();
        let loose = boxed_bounds(&scene);
        let expected = bounds.map(DVec3::from);
        // The table has three decimals; thin lines and points stick out by their thickness.
        let tolerance = if strokes { 0.02 } else { 0.0006 };
        let differs = |found: [DVec3; 2]| {
            (0..2).map(|i| (found[i] - expected[i]).abs().max_element()).fold(0.0, f64::max) > tolerance
        };
        assert!(!differs(exact) || !differs(loose), "{file}: the bounds are {exact:?} or {loose:?}, not {expected:?}");
    }
}

#[test]
fn every_broken_file_is_one_sentence() {
    let Some(assets) = assets() else { return };
    let mut seen = 0;
    for entry in fs::read_dir(assets.join("invalid")).unwrap() {
        let path = entry.unwrap().path();
        let is_scene = path.extension().is_some_and(|e| e == "gltf" || e == "glb");
        if !is_scene {
            continue;
        }
        seen += 1;
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        match scene::load(&path, &LoadOptions::default()) {
            Ok(scene) => {
                assert_eq!(name, "glb__valid.glb", "a broken file was read");
                assert_eq!(scene.triangles(), 0);
            }
            Err(error) => {
                let sentence = format!("{error:#}");
                eprintln!("{sentence}");
                assert_ne!(name, "glb__valid.glb", "{sentence}");
                assert!(sentence.starts_with("loading ") && sentence.contains(&name), "{sentence}");
                assert!(!sentence.contains('\n'), "{sentence}");
            }
        }
    }
    assert!(seen >= 16, "only {seen} files were found");
}

#[test]
fn moments_of_a_source_are_what_is_loaded_and_share_what_does_not_move() {
    let Some(assets) = assets() else { return };
    for name in ["BoxAnimated", "AnimatedMorphCube", "SimpleSkin", "CesiumMan", "CesiumMilkTruck", "WaterBottle"] {
        let folder = assets.join("models").join(name);
        let entries = fs::read_dir(&folder).expect("a folder of the collection");
        let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        files.retain(|path| path.extension().is_some_and(|e| e == "glb" || e == "gltf"));
        files.sort();
        let path = &files[0];
        let mut source =
            scene::Source::open(path, LoadOptions { prune: scene::Prune::Nothing, ..LoadOptions::default() }).unwrap();
        let mut first: Option<Scene> = None;
        for time in [None, Some(0.0), Some(0.4), Some(1.3), None] {
            let known = source.at(time).unwrap();
            let loaded =
                scene::load(path, &LoadOptions { time, prune: scene::Prune::Nothing, ..LoadOptions::default() })
                    .unwrap();
            let all = |scene: &Scene| {
                let Scene { meshes, instances, materials, images, lights, cameras, duration, .. } = scene;
                format!("{meshes:?}{instances:?}{materials:?}{images:?}{lights:?}{cameras:?}{duration:?}")
            };
            assert!(all(&known) == all(&loaded), "{name} at {time:?}");
            if let Some(first) = &first {
                let same = first.images.iter().zip(&known.images).all(|(a, b)| a.rgba.mark() == b.rgba.mark());
                assert!(same, "{name} at {time:?}: an image was decoded again");
            }
            first.get_or_insert(known);
        }
    }
}
