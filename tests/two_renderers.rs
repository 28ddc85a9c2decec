//! Two renderers in one process, each in a thread of its own: on one device, and on a device each.

use std::sync::Arc;

use etalon::frame::{Renderer, Settings};
use etalon::gpu::{Device, DeviceChoice};
use etalon::study;
use etalon_testing::gpu::{Gpu, choice, knobs, settings};

const NAMES: [&str; 3] = ["etalon", "blend", "lamps"];

fn draw(device: &Arc<Device>, name: &str) -> Vec<u8> {
    let scene = study::load(name).expect("a study scene");
    let settings = Settings { knobs: knobs(&["samples=1", "reflection=ray"]), ..settings([48, 27]) };
    let mut renderer = Renderer::new(device, scene.clone(), None, settings).expect("a renderer");
    let drawn = renderer.render(&scene.cameras[0], &mut |_| ()).expect("a picture").display;
    assert!(drawn.iter().any(|&byte| byte > 0), "{name}: something is seen");
    drawn
}

/// Two threads draw the scenes in turns that differ; every picture is the one that a single thread draws.
fn beside_each_other(device: impl Fn() -> Arc<Device> + Sync) {
    let alone = NAMES.map(|name| draw(&device(), name));
    let (device, alone) = (&device, &alone);
    std::thread::scope(|scope| {
        for first in 0..2 {
            scope.spawn(move || {
                for step in 0..2 * NAMES.len() {
                    let at = (first + step) % NAMES.len();
                    assert!(draw(&device(), NAMES[at]) == alone[at], "{}: beside another renderer", NAMES[at]);
                }
            });
        }
    });
}

#[test]
fn renderers_in_two_threads_share_a_device() {
    let gpu = Gpu::open();
    beside_each_other(|| gpu.device.clone());
}

#[test]
fn renderers_in_two_threads_have_a_device_each() {
    beside_each_other(|| Device::open(&choice(), false).expect("the device"));
}

#[test]
fn a_process_has_one_device_under_validation() {
    let mut gpu = Gpu::alone();
    let again = Device::open(&choice(), true).expect("the same device");
    assert!(Arc::ptr_eq(&gpu.device, &again));
    let error = Device::open(&DeviceChoice::Best, true).expect_err("another choice is another device");
    assert!(error.to_string().contains("under validation already"), "{error:#}");
    let beside = Device::open(&choice(), false).expect("a device without validation");
    assert!(!Arc::ptr_eq(&gpu.device, &beside));
    assert!(gpu.errors().is_empty(), "{:?}", gpu.errors());
    // The validated device goes; other tests of this program still wait.
    gpu.device = beside;
    drop(again);
    Device::open(&DeviceChoice::Best, true).expect("the place is free again");
}
