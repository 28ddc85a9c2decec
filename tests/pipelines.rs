//! Pipelines are made while the passes before run, but not under validation: the picture is the same.

use etalon::frame::{Renderer, Settings};
use etalon::gpu::Device;
use etalon::plan::Knobs;
use etalon_testing::gpu::{Gpu, choice};

/// Many devices, one after the other, each of which makes all pipelines of two scenes anew.
#[test]
fn a_frame_that_waits_for_its_pipelines_is_the_same() {
    const ROUNDS: u32 = 12;
    let gpu = Gpu::open();
    for study in ["etalon", "blend"] {
        let scene = etalon::study::load(study).expect("a study scene");
        let mut knobs = Knobs::default();
        knobs.set("samples=1").expect("a rung");
        let settings = Settings { size: [64, 36], knobs, ..Settings::default() };
        let (whole, _) = gpu.shot(&scene, None, settings.clone());
        for round in 0..ROUNDS {
            let device = Device::open(&choice(), false).expect("the device");
            let mut renderer = Renderer::new(&device, scene.clone(), None, settings.clone()).expect("a renderer");
            let piecewise = renderer.render(&scene.cameras[0], &mut |_| ()).expect("a picture");
            assert!(piecewise.display == whole.display, "{study}, round {round}");
            assert!(piecewise.display.iter().any(|&byte| byte > 0), "{study}: something is seen");
        }
    }
}
