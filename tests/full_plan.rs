//! The plan of a scene's effects and the plan of all effects give the same picture, to the last bit.

use std::path::{Path, PathBuf};

use etalon::frame::{Renderer, Settings};
use etalon::image::Picture;
use etalon::plan::rungs::Indirect;
use etalon::plan::{Effect, EffectState, ForcedEffects, Knobs, Model};
use etalon::scene::camera::DEFAULT_FOV_Y;
use etalon::scene::environment::Environment;
use etalon::scene::material::{Sampler, TextureRef};
use etalon::scene::{AlphaMode, AmbientLight, Camera, Image, LightKind, LoadOptions, Material, Prune, Scene};
use etalon::study::{self, shape::Shape};
use etalon_testing::gpu::{Gpu, bits, studio_of};
use etalon_testing::made::{Made, at, lambert, perspective};
use glam::DVec3;

const SIZE: [u32; 2] = [48, 27];

fn draw(gpu: &Gpu, scene: &Scene, knobs: &Knobs, forced: ForcedEffects) -> (Picture, Vec<Effect>) {
    let studio = Environment::studio();
    let share = studio_of(scene);
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let framing = || Camera::framing(scene.bounds().expect("something to draw"), aspect, DEFAULT_FOV_Y);
    let camera = scene.cameras.first().cloned().unwrap_or_else(framing);
    let settings = Settings {
        size: SIZE,
        knobs: knobs.clone(),
        forced,
        environment_intensity: share.unwrap_or(1.0),
        ..Settings::default()
    };
    let environment = share.map(|_| &studio);
    let mut renderer = Renderer::new(&gpu.device, scene.clone(), environment, settings).expect("a renderer");
    renderer.render(&camera, &mut |_| ()).expect("a picture");
    (renderer.film().expect("the film"), renderer.plan().effects.clone())
}

/// Effects that no demand includes: each makes another picture, or one with other noise or roundings, wherever it is.
const APART: [&str; 5] = ["coincident interfaces", "light hierarchy", "spectral rendering", "dispersion", "denoising"];
/// Those that only paths include.
const SAMPLED: [&str; 2] = ["emissive surfaces as lights", "analytic area lights"];

/// Both plans of a scene as it was loaded for each. Everything is kept in the one but what a knob drops, and what
/// stands apart.
fn is_the_same(gpu: &Gpu, name: &str, [lean, full]: [&Scene; 2], knobs: &Knobs) {
    let (planned, _) = draw(gpu, lean, knobs, ForcedEffects::None);
    let (everything, effects) = draw(gpu, full, knobs, ForcedEffects::All);
    let by_paths = knobs.indirect == Indirect::Path;
    for effect in effects.iter().filter(|effect| effect.state == EffectState::NotCalledFor) {
        let stands_apart = |id: &str| APART.contains(&id) || (!by_paths && SAMPLED.contains(&id));
        assert!(stands_apart(effect.id.name()), "{name}: {}: {}", effect.id.name(), effect.reason());
    }
    let different = bits(&planned).iter().zip(bits(&everything)).filter(|(a, b)| *a != b).count();
    assert_eq!(different, 0, "{name}: pixels that differ");
}

fn knobs(model: Model, choices: &[&str]) -> Knobs {
    let mut knobs = Knobs::of(model);
    choices.iter().for_each(|choice| knobs.set(choice).expect("a rung"));
    knobs
}

/// Every `step`th study scene from one on. A full plan takes seconds to compile: each scene is drawn under some of the
/// knobs, and all of them under several.
fn studies(from: usize, step: usize, knobs: &Knobs) {
    let names: Vec<&str> = study::NAMES.iter().copied().skip(from).step_by(step).collect();
    some_studies(&names, knobs);
}

fn some_studies(names: &[&str], knobs: &Knobs) {
    let gpu = Gpu::hasty();
    for name in names {
        let scene = study::load(name).expect("a scene");
        is_the_same(&gpu, name, [&scene, &scene], knobs);
    }
}

#[test]
fn studies_by_rays() {
    studies(0, 2, &knobs(Model::Recursive, &["samples=4", "interfaces=4"]));
}

#[test]
fn studies_by_rays_that_march_and_sample_lobes() {
    studies(0, 3, &knobs(Model::Recursive, &["samples=1", "absorption=march:4", "lobes=1", "brdf=ggx-multi"]));
}

#[test]
fn studies_by_the_local_model() {
    studies(1, 2, &knobs(Model::Local, &["samples=1"]));
}

#[test]
fn studies_on_the_screen() {
    let choices = ["samples=1", "reflection=screen", "refraction=screen", "indirect=off", "fresnel=exact"];
    studies(1, 3, &knobs(Model::Local, &choices));
}

#[test]
fn studies_by_paths() {
    studies(0, 2, &knobs(Model::Global, &["samples=1", "absorption=march:4"]));
}

/// Band by band: what varies, disperses, marches, and lights of many spectra.
#[test]
fn studies_by_wavelengths() {
    let knobs = knobs(Model::Recursive, &["samples=1", "colour=spectral:8", "absorption=march:4"]);
    some_studies(&["materials", "prism", "metamers", "haze"], &knobs);
}

#[test]
fn studies_with_some_rays() {
    studies(2, 3, &knobs(Model::Recursive, &["samples=1", "shadows=map", "refraction=off", "brdf=blinn-phong"]));
}

/// Each effect alone, where nothing calls for it.
#[test]
fn each_effect_alone() {
    let gpu = Gpu::hasty();
    let knobs = knobs(Model::Recursive, &["samples=1", "absorption=march:4"]);
    for name in ["radiance", "metals"] {
        let scene = study::load(name).expect("a scene");
        let (planned, effects) = draw(&gpu, &scene, &knobs, ForcedEffects::None);
        for effect in effects.iter().filter(|effect| effect.state == EffectState::NotCalledFor) {
            let (with, account) = draw(&gpu, &scene, &knobs, ForcedEffects::One(effect.id));
            assert!(bits(&planned) == bits(&with), "{name}: {}", effect.id.name());
            let kept = account.iter().filter(|kept| kept.id == effect.id && kept.state == EffectState::Kept).count();
            let of_paths = ["path guiding", "caustics of punctual lights"];
            let stays = [&of_paths[..], &APART, &SAMPLED].concat();
            let kept_alone = !stays.contains(&effect.id.name());
            assert_eq!(kept, usize::from(kept_alone), "{name}: {}", effect.id.name());
        }
    }
}

fn texture() -> TextureRef {
    TextureRef { image: 0, uv_set: 0, uv_transform: glam::Affine2::IDENTITY, sampler: Sampler::default() }
}

/// A ball of one material on a panel of another, seen from the front, with a lamp.
fn pair(ball: Material, panel: Material) -> Made {
    let mut made = Made::new("pair");
    let texels = (0..64_u32).map(|i| (i * 37 % 256) as u8).collect();
    made.0.images.push(Image { name: "texels".to_owned(), width: 4, height: 4, rgba: texels });
    made.add(Shape::sphere(0.7, 16), ball, at(0.2, 0.1, 1.0));
    made.add(Shape::panel(4.0, 4.0), panel, at(0.0, 0.0, 0.0));
    let lamp = LightKind::Point { position: DVec3::new(1.0, 2.0, 3.0), range: None };
    made.light([20.0; 3], lamp);
    made.camera(DVec3::new(0.5, 0.5, 4.0), DVec3::ZERO, perspective(40.0));
    made
}

/// A property of one surface does not change another surface. Each case failed once.
#[test]
fn surfaces_do_not_affect_each_other() {
    let gpu = Gpu::hasty();
    let mirror = || Material { metallic: 1.0, roughness: 0.0, ..Material::default() };
    let glass = || Material { metallic: 0.0, roughness: 0.5, transmission: 1.0, thickness: 0.1, ..Material::default() };
    let is_same = |what: &str, made: &Made, choices: &[&str]| {
        let knobs = knobs(Model::Recursive, &[&["samples=1"], choices].concat());
        is_the_same(&gpu, what, [&made.0, &made.0], &knobs);
    };
    // Occlusion is seen on mirror images of the screen, without light from all around too.
    let occluded = Material { occlusion_texture: Some(texture()), roughness: 0.1, ..mirror() };
    is_same("occlusion", &pair(lambert([0.5; 3]), occluded), &["reflection=screen", "shadows=off"]);
    // The first texture coordinates decide the texel density of the second ones.
    let second = Material { base_color_texture: Some(TextureRef { uv_set: 1, ..texture() }), ..lambert([1.0; 3]) };
    let mut made = pair(second, mirror());
    made.0.meshes[0].uvs[1] = made.0.meshes[0].uvs[0].iter().map(|[u, v]| [9.0 * u, 9.0 * v]).collect();
    is_same("second coordinates", &made, &[]);
    // What blends is no body.
    let veil =
        Material { alpha_mode: AlphaMode::Blend, base_color: [1.0, 0.5, 0.5, 0.5], double_sided: true, ..glass() };
    is_same("blended body", &pair(veil, mirror()), &[]);
    // A rough sheet is as rough beside smooth mirrors as beside rough ones.
    is_same("rough sheet", &pair(Material { thickness: 0.0, ..glass() }, mirror()), &["refraction=off"]);
    is_same("rough glass", &pair(glass(), mirror()), &[]);
    // Where no rays refract it is thin-walled, and the lamp shines through it.
    is_same("rough glass in the picture", &pair(glass(), mirror()), &["refraction=off"]);
    // Metal transmits nothing, the rest scatters.
    let mut half = pair(Material { metallic: 0.5, ..glass() }, mirror());
    half.0.studio = Some(1.0);
    is_same("half metal", &half, &[]);
    // Coats and bodies below a black texture leave no layers.
    let black = Image { name: "black".to_owned(), width: 1, height: 1, rgba: vec![0, 0, 0, 255].into() };
    let none = Some(TextureRef { image: 1, ..texture() });
    let coat =
        Material { clearcoat: 1.0, clearcoat_texture: none, clearcoat_roughness_texture: Some(texture()), ..mirror() };
    let mut made = pair(coat, lambert([0.5; 3]));
    made.0.images.push(black);
    is_same("black coat", &made, &[]);
    let (_, effects) = draw(&gpu, &made.0, &knobs(Model::Recursive, &["samples=1"]), ForcedEffects::None);
    assert!(
        effects.iter().any(|effect| effect.id.name() == "material layers" && effect.state == EffectState::NotCalledFor)
    );
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
    let gpu = Gpu::hasty();
    let knobs = knobs(Model::Recursive, &["samples=1"]);
    for path in all {
        let load = |reads| etalon::scene::load(&path, &LoadOptions { prune: reads, ..LoadOptions::default() });
        let lean = load(Prune::Unused(AmbientLight::Present)).expect("a scene");
        let full = load(Prune::Nothing).expect("a scene");
        is_the_same(&gpu, &path.display().to_string(), [&lean, &full], &knobs);
    }
}
