//! The same picture, to the last bit, every time: from one renderer drawn twice, from two renderers, and from programs
//! that give lavapipe no, one or two threads beside the main one. Fragment lists, work lists and sums over samples are
//! the places where an order could show.

#[path = "support/program.rs"]
mod program;

use etalon::frame::Settings;
use etalon::scene::environment::Environment;
use etalon::study::{self, generate};
use etalon_testing::gpu::{Gpu, bits, knobs, settings};

#[test]
fn a_picture_is_drawn_the_same_again() {
    let gpu = Gpu::open();
    let environment = Environment::constant([0.3, 0.4, 0.5]);
    for name in ["etalon", "blend", "lamps"] {
        let scene = study::load(name).expect("a study scene");
        let settings = Settings { knobs: knobs(&["samples=4"]), ..settings([96, 54]) };
        let mut renderer = gpu.renderer(&scene, Some(&environment), settings.clone());
        let mut draw = || {
            let rendered = renderer.render(&scene.cameras[0], &mut |_| ()).expect("a picture");
            (rendered.display, bits(&renderer.film().expect("the film")))
        };
        let first = draw();
        for _ in 0..2 {
            assert!(draw() == first, "{name}: the same renderer, another picture");
        }
        let (rendered, film) = gpu.shot(&scene, Some(&environment), settings);
        assert!((rendered.display, bits(&film)) == first, "{name}: another renderer, another picture");
    }
}

/// The film of a picture that is stopped is the mean of the samples that it has, also where one sum is the film.
#[test]
fn a_picture_that_is_stopped_is_a_mean() {
    let gpu = Gpu::open();
    let environment = Environment::constant([0.3, 0.4, 0.5]);
    let scene = study::load("lamps").expect("a study scene");
    let settings = Settings { knobs: knobs(&["samples=16"]), ..settings([96, 54]) };
    let mut renderer = gpu.renderer(&scene, Some(&environment), settings);
    let mean = |film: &etalon::image::Picture| {
        let sum: f64 = film.rgba.iter().flatten().map(|value| f64::from(*value)).sum();
        sum / (4 * film.rgba.len()) as f64
    };
    renderer.render(&scene.cameras[0], &mut |_| ()).expect("a picture");
    let whole = mean(&renderer.film().expect("the film"));
    let mut drawing = renderer.begin(&scene.cameras[0], 16);
    for samples in 1..=3 {
        renderer.step(&mut drawing).expect("a sample");
        let film = renderer.film().expect("the film");
        assert!((mean(&film) / whole - 1.0).abs() < 0.05, "{samples}: {} for {whole}", mean(&film));
        assert!(film.rgba.iter().all(|pixel| pixel[3] <= 1.0 + 1e-6), "{samples}");
    }
}

#[test]
fn other_cameras_leave_no_trace() {
    let gpu = Gpu::open();
    let scene = generate::lights(40);
    let mut renderer = gpu.renderer(&scene, None, settings([75, 41]));
    let front = scene.cameras[0].clone();
    let aside =
        etalon::scene::Camera::looking_at(glam::DVec3::new(30.0, 5.0, 0.0), glam::DVec3::ZERO, glam::DVec3::Y, 1.0)
            .expect("a camera");
    let mut draw = |camera| {
        renderer.render(camera, &mut |_| ()).expect("a picture");
        bits(&renderer.film().expect("the film"))
    };
    let first = draw(&front);
    assert!(draw(&aside) != first);
    assert!(draw(&front) == first, "the camera between them shows");
}

#[test]
fn threads_do_not_show_in_the_files() {
    let folder = tempfile::tempdir().expect("a folder");
    for scene in ["study:blend", "study:etalon", "study:lamps"] {
        let mut files = Vec::new();
        for threads in ["0", "1", "2"] {
            let png = format!("{threads}.png");
            let exr = format!("{threads}.exr");
            let arguments = [
                "render",
                scene,
                "--size",
                "83x47",
                "--set",
                "samples=4",
                "--device",
                "cpu",
                "-q",
                "-o",
                &png,
                "-o",
                &exr,
                "--aov",
                "normal,instance",
            ];
            program::etalon(folder.path(), &arguments, &[("LP_NUM_THREADS", threads)]).succeeded();
            let read = |name: &str| std::fs::read(folder.path().join(name)).expect("an output");
            files.push((read(&png), read(&exr)));
        }
        assert!(files[0].0 == files[1].0 && files[1].0 == files[2].0, "{scene}: the PNGs differ");
        assert!(files[0].1 == files[1].1 && files[1].1 == files[2].1, "{scene}: the EXRs differ");
    }
}
