//! Time-sliced submission draws the same picture in short pieces as one submission does, to the last bit.

use std::time::{Duration, Instant};

use etalon::frame::Settings;
use etalon::gpu::Interrupted;
use etalon::plan::{Architecture, Knobs, Model};
use etalon::scene::Scene;
use etalon::scene::environment::Environment;
use etalon::study;
use etalon_testing::gpu::{Gpu, bits};

/// Scenes with the model that they are drawn by, rungs, and the form of the passes.
const PICTURES: &[(&str, Model, &[&str], Architecture)] = &[
    // Lists per tile of 683 lights.
    ("lamps", Model::Local, &["samples=1"], Architecture::Cpu),
    // Mirrors on the screen and transparent surfaces.
    ("blend", Model::Local, &["reflection=screen", "refraction=screen", "samples=1"], Architecture::Cpu),
    // Rays.
    ("etalon", Model::Recursive, &["samples=4"], Architecture::Cpu),
    // Ray trees, whose number of steps the host does not know.
    ("etalon", Model::Recursive, &["samples=4"], Architecture::Gpu),
    // Queues of paths.
    ("cornell", Model::Global, &["samples=4"], Architecture::Cpu),
];

type Bits = Vec<[u32; 4]>;

/// Films of all pictures, each drawn twice in a row: the second time knows how long passes take.
fn films(gpu: &Gpu) -> Vec<[Bits; 2]> {
    let draw = |(name, model, rungs, architecture): &(&str, Model, &[&str], Architecture)| {
        let scene = study::load(name).expect("a scene");
        let mut knobs = Knobs::of(*model);
        rungs.iter().for_each(|rung| knobs.set(rung).expect("a rung"));
        let form = Some(*architecture);
        let settings =
            Settings { size: [176, 99], knobs, architecture: form, ray_trees: Some(4096), ..Settings::default() };
        let environment = scene.studio.map(|_| Environment::studio());
        let mut renderer = gpu.renderer(&scene, environment.as_ref(), settings);
        [(); 2].map(|()| {
            renderer.render(&scene.cameras[0], &mut |_| ()).expect("a picture");
            bits(&renderer.film().expect("a film"))
        })
    };
    PICTURES.iter().map(draw).collect()
}

#[test]
fn pieces_are_the_same_picture() {
    let at_once = {
        let gpu = Gpu::hasty();
        films(&gpu)
    };
    let gpu = Gpu::time_sliced();
    let in_turns = films(&gpu);
    for ((name, ..), (a, b)) in PICTURES.iter().zip(at_once.iter().zip(&in_turns)) {
        assert!(a[0] == b[0], "{name}: another picture in pieces");
        assert!(a[1] == b[1], "{name}: another picture in pieces, when it is known how long they take");
    }
    let cut = gpu.device.cut();
    assert!(cut > 20, "{cut} dispatches were cut");
}

/// A frame that is given up leaves the device and the film as they are: the picture goes on, and is whole.
#[test]
fn what_is_interrupted_goes_on() {
    let gpu = Gpu::time_sliced();
    let scene = study::load("etalon").expect("a scene");
    for architecture in [Architecture::Cpu, Architecture::Gpu] {
        go_on_after_interruptions(&gpu, &scene, architecture);
    }
}

fn go_on_after_interruptions(gpu: &Gpu, scene: &Scene, architecture: Architecture) {
    let settings = Settings {
        size: [176, 99],
        knobs: Knobs::of(Model::Recursive),
        architecture: Some(architecture),
        ray_trees: Some(256),
        ..Settings::default()
    };
    let mut renderer = gpu.renderer(scene, None, settings);
    renderer.render(&scene.cameras[0], &mut |_| ()).expect("a picture");
    let whole = bits(&renderer.film().expect("a film"));
    let (device, mut interruptions) = (gpu.device.clone(), 0);
    for i in 0..12 {
        let mut drawing = renderer.begin(&scene.cameras[0], u32::MAX);
        drawing.interruptible = true;
        let interrupter = {
            let device = device.clone();
            std::thread::spawn(move || {
                std::thread::sleep(Duration::from_millis(3 * i));
                device.interrupt();
            })
        };
        let drawn = (0..4).try_for_each(|_| renderer.step(&mut drawing));
        interrupter.join().expect("it ends");
        if let Err(error) = drawn {
            assert!(error.is::<Interrupted>(), "{error:#}");
            interruptions += 1;
        }
        device.resume();
        // It goes on with the sample that was given up.
        while !drawing.is_done() {
            renderer.step(&mut drawing).expect("a sample");
        }
        renderer.picture(&drawing).expect("a picture");
        assert!(bits(&renderer.film().expect("a film")) == whole, "another picture after {} ms", 3 * i);
    }
    assert!(interruptions > 4, "{interruptions} of 12");
}

/// Passes of known and short times are submitted together: a sample of paths has some hundred passes, and the host
/// waits for it a few times.
#[test]
fn short_passes_share_submissions() {
    let gpu = Gpu::time_sliced();
    let scene = study::load("cornell").expect("a scene");
    for architecture in [Architecture::Cpu, Architecture::Gpu] {
        let settings = Settings {
            size: [16, 9],
            knobs: Knobs::of(Model::Global),
            architecture: Some(architecture),
            ..Settings::default()
        };
        let mut renderer = gpu.renderer(&scene, None, settings);
        let passes = renderer.passes(&scene.cameras[0]).expect("passes").len();
        let mut drawing = renderer.begin(&scene.cameras[0], 64);
        let mut step = || {
            let (before, begun) = (gpu.device.turns(), Instant::now());
            renderer.step(&mut drawing).expect("a sample");
            (gpu.device.turns() - before, begun.elapsed().as_secs_f64())
        };
        let (first, _) = step();
        // Two neighbouring submissions take more than a slice of 10 ms together, or they would be one: a busy machine
        // needs more of them.
        let beyond = |(turns, seconds): (u64, f64)| turns.saturating_sub((seconds / 5e-3) as u64);
        let mut turns: Vec<u64> = (1..16).map(|_| beyond(step())).collect();
        turns.sort_unstable();
        assert!(passes > 90 && first > 60, "{passes} passes, {first} submissions of the first sample");
        assert!(turns[7] <= 4, "submissions of {architecture:?}'s samples beyond those of their time: {turns:?}");
    }
}
