//! A renderer that goes on with another moment of its scene draws what one does that begins with it, to the last bit.
#![allow(clippy::unwrap_used, reason = "a test may stop where it stands")]

use std::path::Path;

use etalon::frame::{Renderer, Settings, TileShare};
use etalon::open;
use etalon::plan::{Knobs, Model};
use etalon::scene::environment::Environment;
use etalon::scene::{Camera, LoadOptions, Prune, Scene, Source};
use etalon_testing::gpu::{Gpu, bits};

fn settings(model: Model, samples: &str) -> Settings {
    let mut knobs = Knobs::of(model);
    knobs.set(&format!("samples={samples}")).unwrap();
    Settings { size: [48, 40], knobs, ..Settings::default() }
}

/// Draws moments with one renderer, and each with one of its own.
fn same_at_all_moments(gpu: &Gpu, mut source: Source, times: &[Option<f64>], settings: &Settings) {
    let studio = Environment::studio();
    let camera = open::framing(&source.at(None).unwrap(), settings.size, 0.7).unwrap();
    let mut going: Option<Renderer> = None;
    let mut pictures: Vec<Vec<[u32; 4]>> = Vec::new();
    for &time in times {
        let scene = source.at(time).unwrap();
        let mut renderer = match going.take() {
            Some(renderer) => renderer.next(scene.clone(), Some(&studio)).unwrap(),
            None => Renderer::new(&gpu.device, scene.clone(), Some(&studio), settings.clone()).unwrap(),
        };
        renderer.render(&camera, &mut |_| ()).unwrap();
        let film = bits(&renderer.film().unwrap());
        going = Some(renderer);
        let mut anew = Renderer::new(&gpu.device, scene, Some(&studio), settings.clone()).unwrap();
        anew.render(&camera, &mut |_| ()).unwrap();
        assert!(film == bits(&anew.film().unwrap()), "another picture at {time:?}");
        pictures.push(film);
    }
    assert!(pictures.windows(2).any(|pair| pair[0] != pair[1]), "nothing moved");
}

#[test]
fn moments_of_an_animation_are_drawn_as_if_each_were_the_first() {
    let gpu = Gpu::open();
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/assets/models");
    for (name, model, samples) in [
        // Textures, a skin, and a tree of boxes that is another one at each moment.
        ("CesiumMan/CesiumMan.glb", Model::Recursive, "4"),
        // Nodes that move, by paths.
        ("CesiumMilkTruck/CesiumMilkTruck.glb", Model::Global, "4"),
        ("CesiumMilkTruck/CesiumMilkTruck.glb", Model::Local, "1"),
    ] {
        let path = models.join(name);
        if !path.exists() {
            eprintln!("skipped: {} is absent", path.display());
            continue;
        }
        let source = Source::open(&path, LoadOptions { prune: Prune::Nothing, ..LoadOptions::default() }).unwrap();
        same_at_all_moments(&gpu, source, &[None, Some(0.2), Some(0.9)], &settings(model, samples));
    }
    assert_eq!(gpu.errors(), Vec::<String>::new());
}

/// Another plan, other lights, other textures: the renderer keeps only the parts that do not change.
#[test]
fn what_has_nothing_in_common_is_drawn_anew() {
    let gpu = Gpu::open();
    let settings = settings(Model::Recursive, "4");
    let scenes: Vec<Scene> = ["study:metals", "study:lamps", "study:blend", "study:metals"]
        .map(|name| open::scene(name, &Default::default()).unwrap())
        .into();
    let camera = |scene: &Scene| -> Camera { scene.cameras.first().cloned().unwrap() };
    let mut going = Renderer::new(&gpu.device, scenes[0].clone(), None, settings.clone()).unwrap();
    for scene in &scenes[1..] {
        going = going.next(scene.clone(), None).unwrap();
        going.render(&camera(scene), &mut |_| ()).unwrap();
        let mut anew = Renderer::new(&gpu.device, scene.clone(), None, settings.clone()).unwrap();
        anew.render(&camera(scene), &mut |_| ()).unwrap();
        assert!(bits(&going.film().unwrap()) == bits(&anew.film().unwrap()), "{}: another picture", scene.name);
    }
    assert_eq!(gpu.errors(), Vec::<String>::new());
}

/// A share of the picture is what all of it has there, and nothing elsewhere.
#[test]
fn shares_are_the_picture_tile_by_tile() {
    let gpu = Gpu::open();
    for (name, model) in
        [("study:etalon", Model::Recursive), ("study:cornell", Model::Global), ("study:blend", Model::Local)]
    {
        let scene = open::scene(name, &Default::default()).unwrap();
        let camera = scene.cameras.first().cloned().unwrap();
        let draw = |share: TileShare| {
            let settings = Settings { share, ..settings(model, "1") };
            let mut renderer = Renderer::new(&gpu.device, scene.clone(), None, settings).unwrap();
            renderer.render(&camera, &mut |_| ()).unwrap();
            bits(&renderer.film().unwrap())
        };
        let all = draw(TileShare::ALL);
        for index in 0..3 {
            let share = TileShare { index, of: 3 };
            for (at, (mine, whole)) in (0..).zip(draw(share).into_iter().zip(&all)) {
                let has = share.has([at % 48, at / 48], 48);
                assert_eq!(mine, if has { *whole } else { [0; 4] }, "{name}, share {index}, pixel {at}");
            }
        }
    }
    assert_eq!(gpu.errors(), Vec::<String>::new());
}
