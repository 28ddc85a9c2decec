//! The furnace test: in a white environment of radiance 1, a body that absorbs nothing has radiance 1 everywhere, so it
//! is invisible.
//!
//! Read: Heitz, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", 2014, section 5 (white
//! furnace).

use etalon::frame::Settings;
use etalon::plan::{Knobs, Model};
use etalon::scene::environment::Environment;
use etalon::scene::{Material, Scene};

use super::gpu::Gpu;
use super::made::lambert;

/// Result of a furnace test.
#[derive(Debug, Clone, Copy)]
pub struct FurnaceRadiance {
    /// Mean of green over all pixels.
    pub mean: f64,
    /// Standard error of the mean, from the variance over the pixels.
    pub error: f64,
}

/// Materials that absorb nothing, with names.
#[must_use]
pub fn whites() -> [(&'static str, Material); 4] {
    let metal = |roughness: f32| Material { metallic: 1.0, roughness, specular: 1.0, ..lambert([1.0; 3]) };
    let glass =
        Material { transmission: 1.0, ior: 1.5, thickness: 1.0, specular: 1.0, roughness: 0.0, ..lambert([1.0; 3]) };
    [("lambert", lambert([1.0; 3])), ("mirror", metal(0.0)), ("glass", glass), ("rough metal", metal(0.5))]
}

/// The scene with one material on all meshes, without its lights.
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

/// Path traces the scene under radiance 1 from all directions, at 48x27 pixels with `samples` per pixel.
///
/// # Panics
/// Rendering fails.
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
