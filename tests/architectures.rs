//! The passes for CPUs and those for GPUs draw the same film, bit by bit, and count the same rays.

use etalon::frame::{Part, Rendered, Renderer, Settings, TileShare, Work};
use etalon::image::Picture;
use etalon::plan::{Architecture, Knobs, Model};
use etalon::scene::Scene;
use etalon::scene::environment::Environment;
use etalon::study;
use etalon_testing::gpu::{Gpu, bits, studio_of};

const SIZE: [u32; 2] = [48, 27];

fn draw(gpu: &Gpu, scene: &Scene, settings: &Settings, architecture: Architecture) -> (Rendered, Vec<Picture>) {
    let studio = Environment::studio();
    let share = studio_of(scene);
    let settings = Settings {
        size: SIZE,
        architecture: Some(architecture),
        environment_intensity: share.unwrap_or(1.0),
        ..settings.clone()
    };
    let (camera, parts) = (scene.cameras[0].clone(), settings.parts.clone());
    let mut renderer = Renderer::new(&gpu.device, scene.clone(), share.map(|_| &studio), settings).expect("a renderer");
    let rendered = renderer.render(&camera, &mut |_| ()).expect("a picture");
    let film = renderer.film().expect("the film");
    let parts = parts.into_iter().map(|part| renderer.part(part).expect("a part").expect("drawn"));
    (rendered, std::iter::once(film).chain(parts).collect())
}

fn knobs(model: Model, choices: &[&str]) -> Knobs {
    let mut knobs = Knobs::of(model);
    choices.iter().for_each(|choice| knobs.set(choice).expect("a rung"));
    knobs
}

fn are_the_same(settings: &Settings, names: &[&str]) {
    let gpu = Gpu::hasty();
    for name in names {
        is_the_same(&gpu, settings, study::load(name).expect("a scene"));
    }
}

fn is_the_same(gpu: &Gpu, settings: &Settings, scene: Scene) {
    let name = &scene.name;
    let draw = |architecture| draw(gpu, &scene, settings, architecture);
    let [(cpu, of_cpu), (gpu, of_gpu)] = [Architecture::Cpu, Architecture::Gpu].map(draw);
    for (a, b) in of_cpu.iter().zip(&of_gpu) {
        let different = bits(a).iter().zip(bits(b)).filter(|(a, b)| *a != b).count();
        assert_eq!(different, 0, "{name}: pixels that differ");
    }
    let counts =
        |w: Work| ([w.reflection, w.refraction, w.shadow, w.indirect, w.unmatched_exits, w.not_finite], w.most_lost);
    assert_eq!(counts(cpu.work), counts(gpu.work), "{name}: rays, exits and the largest loss");
    // Each invocation rounds its loss up to a step, and of two paths together it is one loss.
    assert!(cpu.work.lost.abs_diff(gpu.work.lost) <= gpu.work.indirect, "{name}: {:?} {:?}", cpu.work, gpu.work);
}

fn settings(model: Model, choices: &[&str]) -> Settings {
    Settings { knobs: knobs(model, choices), ..Settings::default() }
}

#[test]
fn by_the_local_model() {
    are_the_same(&settings(Model::Local, &["samples=1"]), &study::NAMES);
}

/// Media, nested and touching bodies, textures, many lights, dispersion, blended surfaces. All scenes were compared
/// once.
const SCENES: [&str; 8] = ["etalon", "pool", "nested", "torture", "haze", "lamps", "finishes", "blend"];

/// By rays the forms are compared on software devices alone: a compiler that fuses products and sums may do so in one
/// form and not in the other.
fn by_rays_are_the_same(settings: &Settings, names: &[&str]) {
    if Gpu::hasty().device.is_software() {
        are_the_same(settings, names);
    } else {
        eprintln!("skipped: by rays both forms are compared on software devices alone");
    }
}

#[test]
fn by_rays() {
    by_rays_are_the_same(&settings(Model::Recursive, &["samples=1"]), &SCENES);
}

/// An unlit surface in mirrors and glass, to which no form sends rays for light.
#[test]
fn by_rays_with_an_unlit_floor() {
    let gpu = Gpu::hasty();
    let mut scene = study::load("etalon").expect("a scene");
    let floor = scene.materials.iter_mut().find(|m| m.name == "table").expect("the floor");
    floor.unlit = true;
    if gpu.device.is_software() {
        is_the_same(&gpu, &settings(Model::Recursive, &["samples=1"]), scene);
    }
}

/// Far fewer ray trees than pixels: complete trees make room for those of other pixels, many times.
#[test]
fn by_rays_with_few_trees_at_a_time() {
    let few = Settings { ray_trees: Some(128), ..settings(Model::Recursive, &["samples=1"]) };
    by_rays_are_the_same(&few, &["etalon", "nested"]);
    let share = TileShare { index: 1, of: 3 };
    by_rays_are_the_same(&Settings { share, ..few }, &["pool"]);
}

#[test]
fn by_paths() {
    are_the_same(&settings(Model::Global, &["samples=4"]), &SCENES);
}

#[test]
fn with_parts_of_the_picture() {
    let parts = vec![Part::Reflection, Part::Refraction];
    by_rays_are_the_same(&Settings { parts, ..settings(Model::Recursive, &["samples=1"]) }, &["pool"]);
}

#[test]
fn with_several_light_samples_guiding_and_a_share_of_the_tiles() {
    are_the_same(&settings(Model::Global, &["samples=1", "lights=area:4"]), &["cornell"]);
    are_the_same(&settings(Model::Global, &["samples=1", "guiding=photons"]), &["pool"]);
    let share = TileShare { index: 1, of: 3 };
    are_the_same(&Settings { share, ..settings(Model::Global, &["samples=1"]) }, &["cornell"]);
}

/// Paths without a light that is sampled: no kernel of shadow rays.
#[test]
fn with_lights_that_paths_find_alone() {
    are_the_same(&settings(Model::Global, &["samples=1", "lights=points"]), &["radiance"]);
}
