//! The plan of what a scene calls for and the plan of everything give the same picture, to the last bit.

#[path = "support/gpu.rs"]
mod gpu;

use std::path::{Path, PathBuf};

use etalon::frame::{Renderer, Settings};
use etalon::image::Picture;
use etalon::plan::{Demand, Effect, Knobs, Model};
use etalon::scene::camera::DEFAULT_FOV_Y;
use etalon::scene::environment::Environment;
use etalon::scene::{Ambience, Camera, LoadOptions, Reads, Scene};
use etalon::study;
use gpu::{Gpu, bits};

const SIZE: [u32; 2] = [48, 27];

fn draw(gpu: &Gpu, scene: &Scene, knobs: &Knobs, demand: Demand) -> (Picture, Vec<Effect>) {
    let studio = Environment::studio();
    let share = scene.studio.or(scene.lights.is_empty().then_some(1.0));
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let framing = || Camera::framing(scene.bounds().expect("something to draw"), aspect, DEFAULT_FOV_Y);
    let camera = scene.cameras.first().cloned().unwrap_or_else(framing);
    let settings = Settings {
        size: SIZE,
        knobs: knobs.clone(),
        demand,
        environment_intensity: share.unwrap_or(1.0),
        ..Settings::default()
    };
    let environment = share.map(|_| &studio);
    let mut renderer = Renderer::new(&gpu.device, scene.clone(), environment, settings).expect("a renderer");
    renderer.render(&camera, &mut |_, _| ()).expect("a picture");
    (renderer.film().expect("the film"), renderer.plan.effects.clone())
}

/// Both plans of a scene as it was loaded for each. Everything is kept in the one but what a knob drops, and bodies that
/// touch.
fn is_the_same(gpu: &Gpu, name: &str, [lean, full]: [&Scene; 2], knobs: &Knobs) {
    let (planned, _) = draw(gpu, lean, knobs, Demand::Scene);
    let (everything, effects) = draw(gpu, full, knobs, Demand::Full);
    for effect in effects.iter().filter(|effect| effect.state == "not called for") {
        assert_eq!(effect.name, "bodies that touch", "{name}: {}", effect.reason);
    }
    let different = bits(&planned).iter().zip(bits(&everything)).filter(|(a, b)| *a != b).count();
    assert_eq!(different, 0, "{name}: pixels that differ");
}

fn knobs(model: Model, choices: &[&str]) -> Knobs {
    let mut knobs = Knobs::of(model);
    choices.iter().for_each(|choice| knobs.set(choice).expect("a rung"));
    knobs
}

fn studies(knobs: &Knobs) {
    let gpu = Gpu::new();
    for name in study::NAMES {
        let scene = study::load(name).expect("a scene");
        is_the_same(&gpu, name, [&scene, &scene], knobs);
    }
}

#[test]
fn studies_by_rays() {
    studies(&knobs(Model::Recursive, &["samples=4", "interfaces=4"]));
}

#[test]
fn studies_by_rays_that_march_and_sample_lobes() {
    studies(&knobs(Model::Recursive, &["samples=1", "absorption=march:4", "lobes=1", "brdf=ggx-multi"]));
}

#[test]
fn studies_by_the_local_model() {
    studies(&knobs(Model::Local, &["samples=1"]));
}

#[test]
fn studies_on_the_screen() {
    let choices = ["samples=1", "reflection=screen", "refraction=screen", "indirect=off", "fresnel=exact"];
    studies(&knobs(Model::Local, &choices));
}

#[test]
fn studies_with_some_rays() {
    studies(&knobs(Model::Recursive, &["samples=1", "shadows=map", "refraction=off", "brdf=blinn-phong"]));
}

/// Files of a folder and those below it that can be loaded.
fn files(folder: &Path, all: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files(&path, all);
        } else if path.extension().is_some_and(|e| ["gltf", "glb", "obj"].iter().any(|known| e == *known)) {
            all.push(path);
        }
    }
    all.sort();
}

#[test]
fn models_of_the_shared_assets() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/assets/models");
    if !folder.is_dir() {
        eprintln!("skipped: there are no shared assets beside the repository");
        return;
    }
    let mut all = Vec::new();
    files(&folder, &mut all);
    assert!(all.len() >= 33, "{} models", all.len());
    let gpu = Gpu::new();
    let knobs = knobs(Model::Recursive, &["samples=1"]);
    for path in all {
        let load = |reads| etalon::scene::load(&path, &LoadOptions { reads, ..LoadOptions::default() });
        let lean = load(Reads::Visible(Ambience::WithoutLights)).expect("a scene");
        let full = load(Reads::Everything).expect("a scene");
        is_the_same(&gpu, &path.display().to_string(), [&lean, &full], &knobs);
    }
}
