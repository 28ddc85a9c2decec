//! Study scenes in one white material before light from everywhere: nothing shows.

use etalon::study;
use etalon_testing::furnace::{FurnaceRadiance, in_one_material, shown, whites};
use etalon_testing::gpu::Gpu;

/// Light that takes more than the 32 surfaces of a path to come out, of Lambert's 1: 0.8 % between the walls of
/// `cornell`, 0.5 % in the glass of `nested`, measured with 256 samples; elsewhere less.
const KEPT: f64 = 0.01;
/// What rough metals may send beyond what they receive: the texels of their table are good to 6e-4 in the mean, its
/// lines between them to 5e-4.
const TABLE: f64 = 1e-3;
/// Standard errors. The few long paths that Russian roulette keeps have long tails: `radiance` in glass is 4.03 of them
/// above 1 with 16 samples, and 1.000003 ± 0.000012 with 256.
const SPREAD: f64 = 5.0;

#[test]
fn no_study_scene_shows_in_a_white_furnace() {
    let gpu = Gpu::open();
    // Into the closed room of the pool no light comes.
    for &name in study::NAMES.iter().filter(|&&name| name != "pool") {
        let scene = study::load(name).expect("a scene");
        for (kind, white) in &whites() {
            let FurnaceRadiance { mean, error } = shown(&gpu, &in_one_material(scene.clone(), white), 16);
            eprintln!("{name}, {kind}: {mean:.6} ± {error:.6}");
            let above = if *kind == "rough metal" { TABLE } else { 0.0 };
            assert!(mean <= 1.0 + above + SPREAD * error, "{name}, {kind}: {mean} ± {error}");
            assert!(mean >= 1.0 - KEPT - above - SPREAD * error, "{name}, {kind}: {mean} ± {error}");
        }
    }
}
