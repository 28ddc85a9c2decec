//! The passes for CPUs and those for GPUs draw the same film, bit by bit, and count the same rays and losses.

use etalon::frame::{Rendered, Renderer, Settings, Work};
use etalon::image::Picture;
use etalon::plan::{Architecture, Knobs, Model};
use etalon::scene::environment::Environment;
use etalon::scene::{Camera, Scene};
use etalon::study;
use etalon_testing::gpu::{Gpu, bits};

const SIZE: [u32; 2] = [48, 27];

fn draw(gpu: &Gpu, scene: &Scene, knobs: &Knobs, architecture: Architecture) -> (Rendered, Picture) {
    let studio = Environment::studio();
    let share = scene.studio.or(scene.lights.is_empty().then_some(1.0));
    let settings = Settings {
        size: SIZE,
        knobs: knobs.clone(),
        architecture: Some(architecture),
        environment_intensity: share.unwrap_or(1.0),
        ..Settings::default()
    };
    let camera: Camera = scene.cameras.first().cloned().expect("a camera");
    let mut renderer = Renderer::new(&gpu.device, scene.clone(), share.map(|_| &studio), settings).expect("a renderer");
    let rendered = renderer.render(&camera, &mut |_| ()).expect("a picture");
    (rendered, renderer.film().expect("the film"))
}

fn knobs(model: Model, choices: &[&str]) -> Knobs {
    let mut knobs = Knobs::of(model);
    choices.iter().for_each(|choice| knobs.set(choice).expect("a rung"));
    knobs
}

fn are_the_same(model: Model, choices: &[&str], names: &[&str]) {
    let gpu = Gpu::hasty();
    let knobs = knobs(model, choices);
    for name in names {
        let scene = study::load(name).expect("a scene");
        let [(cpu, a), (gpu, b)] =
            [Architecture::Cpu, Architecture::Gpu].map(|architecture| draw(&gpu, &scene, &knobs, architecture));
        let different = bits(&a).iter().zip(bits(&b)).filter(|(a, b)| *a != b).count();
        assert_eq!(different, 0, "{name}: pixels that differ");
        // Of two paths together, a loss is rounded up once.
        let counts = |w: Work| {
            ([w.reflection, w.refraction, w.shadow, w.indirect, w.unmatched_exits, w.not_finite], w.most_lost)
        };
        assert_eq!(counts(cpu.work), counts(gpu.work), "{name}: rays, exits and losses");
    }
}

#[test]
fn by_the_local_model() {
    are_the_same(Model::Local, &["samples=1"], &study::NAMES);
}

/// Media, nested and touching bodies, textures, many lights, dispersion, blended surfaces. All scenes were compared once.
const SCENES: [&str; 8] = ["etalon", "pool", "nested", "torture", "haze", "lamps", "finishes", "blend"];

#[test]
fn by_rays() {
    are_the_same(Model::Recursive, &["samples=1"], &SCENES);
}

#[test]
fn by_paths() {
    are_the_same(Model::Global, &["samples=4"], &SCENES);
}
