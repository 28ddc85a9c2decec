//! Bugs that are known and not yet mended, each as a test that passes while the bug is there. A test that fails here is
//! good news: delete it, and tighten the test that its comment names.

#[path = "support/gpu.rs"]
mod gpu;
#[path = "support/made.rs"]
mod made;

use etalon::study::shape::Shape;
use glam::DVec3;
use gpu::{Gpu, settings};

/// A mesh without vertex colours and textures passes the constant 1 through perspective interpolation (0.99999994 at
/// some pixels) and then into RGBA16F, which lavapipe rounds downwards: 0.99951. Albedo, and with it radiance, is off by
/// 2^-11 at those pixels. When mended: raster.rs, `check`, demands equal bits of albedo.
#[test]
fn untextured_albedo_loses_an_ulp_of_half() {
    let gpu = Gpu::new();
    let mut scene = made::Made::new("albedo");
    scene.add(Shape::plane(8.0, 8.0, 1), made::lambert([0.7, 0.3, 0.1]), made::at(0.0, -1.0, -4.0));
    scene.camera(DVec3::ZERO, DVec3::new(0.0, -1.0, -4.0), made::perspective(40.0));
    let (aovs, _) = gpu.renderer(&scene.0, None, settings([64, 36])).aovs(&scene.0.cameras[0]).expect("AOVs");
    let seen: Vec<_> = aovs.iter().filter(|p| p.material != 0).collect();
    let wrong = seen.iter().filter(|p| p.albedo != [0.7, 0.3, 0.1]).count();
    println!("{wrong} of {} pixels", seen.len());
    assert!(wrong > 0, "mended");
}
