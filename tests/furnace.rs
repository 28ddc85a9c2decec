//! Study scenes in one white material before light from everywhere: nothing shows.

use etalon::frame::Settings;
use etalon::plan::{Knobs, Model};
use etalon::scene::Material;
use etalon::scene::environment::Environment;
use etalon::study;
use etalon_testing::gpu::Gpu;
use etalon_testing::made::lambert;

/// Light that takes more than the 32 surfaces of a path to come out, of Lambert's 1: 0.8 % between the walls of `cornell`, 0.5 % in
/// the glass of `nested`, measured with 256 samples; elsewhere less.
const KEPT: f64 = 0.01;
/// What rough metals may send beyond what they receive: the texels of their table are good to 6e-4 in the mean, its lines between
/// them to 5e-4.
const TABLE: f64 = 1e-3;

#[test]
fn no_study_scene_shows_in_a_white_furnace() {
    let gpu = Gpu::hasty();
    let sky = Environment::constant([1.0; 3]);
    let metal = |roughness: f32| Material { metallic: 1.0, roughness, specular: 1.0, ..lambert([1.0; 3]) };
    let glass =
        Material { transmission: 1.0, ior: 1.5, thickness: 1.0, specular: 1.0, roughness: 0.0, ..lambert([1.0; 3]) };
    let whites =
        [("lambert", lambert([1.0; 3])), ("mirror", metal(0.0)), ("glass", glass), ("rough metal", metal(0.5))];
    // Into the closed room of the pool no light comes.
    for &name in study::NAMES.iter().filter(|&&name| name != "pool") {
        let mut scene = study::load(name).expect("a scene");
        scene.lights.clear();
        for mesh in &mut scene.meshes {
            mesh.material = 0;
            mesh.colors.clear();
        }
        for (kind, white) in &whites {
            scene.materials = vec![white.clone()];
            let mut knobs = Knobs::of(Model::Global);
            knobs.set("samples=16").expect("a rung");
            let (_, film) = gpu.shot(&scene, Some(&sky), Settings { size: [48, 27], knobs, ..Settings::default() });
            let all: Vec<f64> = film.rgba.iter().map(|pixel| f64::from(pixel[1])).collect();
            let n = all.len() as f64;
            let mean = all.iter().sum::<f64>() / n;
            let error = (all.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n * (n - 1.0))).sqrt();
            eprintln!("{name}, {kind}: {mean:.6} ± {error:.6}");
            let above = if *kind == "rough metal" { TABLE } else { 0.0 };
            assert!(mean <= 1.0 + above + 4.0 * error, "{name}, {kind}: {mean} ± {error}");
            assert!(mean >= 1.0 - KEPT - above - 4.0 * error, "{name}, {kind}: {mean} ± {error}");
        }
    }
}
