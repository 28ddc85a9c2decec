//! The white furnace: before light of 1 from everywhere, a body that takes nothing away shows as 1, and so not at all.

use etalon::frame::Settings;
use etalon::plan::{Knobs, Model};
use etalon::scene::environment::Environment;
use etalon::scene::{Material, Scene};

use super::gpu::Gpu;
use super::made::lambert;

/// What a picture in a furnace shows.
#[derive(Debug, Clone, Copy)]
pub struct FurnaceRadiance {
    /// Mean of the pixels' green.
    pub mean: f64,
    /// Its standard error, over the pixels.
    pub error: f64,
}

/// Materials that take nothing away, by name.
#[must_use]
pub fn whites() -> [(&'static str, Material); 4] {
    let metal = |roughness: f32| Material { metallic: 1.0, roughness, specular: 1.0, ..lambert([1.0; 3]) };
    let glass =
        Material { transmission: 1.0, ior: 1.5, thickness: 1.0, specular: 1.0, roughness: 0.0, ..lambert([1.0; 3]) };
    [("lambert", lambert([1.0; 3])), ("mirror", metal(0.0)), ("glass", glass), ("rough metal", metal(0.5))]
}

/// The scene's shapes in one material, without its lights.
#[must_use]
pub fn in_one_material(mut scene: Scene, white: &Material) -> Scene {
    scene.lights.clear();
    for mesh in &mut scene.meshes {
        mesh.material = 0;
        mesh.colors.clear();
    }
    scene.materials = vec![white.clone()];
    scene
}

/// What the scene shows by paths before light of 1 from everywhere, at 48x27 pixels with `samples` each.
///
/// # Panics
/// Where it cannot be drawn.
#[must_use]
pub fn shown(gpu: &Gpu, scene: &Scene, samples: u32) -> FurnaceRadiance {
    let mut knobs = Knobs::of(Model::Global);
    knobs.set(&format!("samples={samples}")).expect("a number of samples");
    let sky = Environment::constant([1.0; 3]);
    let (_, film) = gpu.shot(scene, Some(&sky), Settings { size: [48, 27], knobs, ..Settings::default() });
    let all: Vec<f64> = film.rgba.iter().map(|pixel| f64::from(pixel[1])).collect();
    let n = all.len() as f64;
    let mean = all.iter().sum::<f64>() / n;
    let error = (all.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n * (n - 1.0))).sqrt();
    FurnaceRadiance { mean, error }
}
