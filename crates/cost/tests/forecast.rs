//! `etalon plan --forecast`: what it says of a picture by some of its tiles, against what is then measured of all.

use etalon::frame::{Settings, TileShare};
use etalon::image::png::decode_display;
use etalon::open::Opened;
use etalon::plan::{Knobs, Model};
use etalon_cost::pace::Step;
use etalon_cost::predict::{Trial, predict, score};
use etalon_cost::reference::Refined;
use etalon_cost::size::shared;
use etalon_cost::sweep::{Listener, Sweep, SweepExtent};
use etalon_cost::tiles::{packed_picture, spread};
use etalon_cost::warm::Bench;
use etalon_testing::gpu::Gpu;

const SIZE: [u32; 2] = [128, 72];
const PIXELS: f64 = 64.0 * 36.0;

/// Errors come from few pixels and are those of many; times are only counted, for no test judges a machine's pace.
#[test]
fn errors_of_few_pixels_are_those_of_many() {
    let gpu = Gpu::hasty();
    let opened = Opened::load("study:lamps").expect("a study scene");
    let (environment, settings) = opened.lit(Settings { size: SIZE, ..Settings::default() });
    let camera = opened.camera(SIZE).expect("a camera");
    let bench = || Bench {
        device: &gpu.device,
        original: &opened.original,
        environment,
        settings: settings.clone(),
        camera: &camera,
    };
    let folder = tempfile::tempdir().expect("a folder");
    let extent = SweepExtent { budget_s: 10, reference_samples: Some(16), shard: [1, 1] };
    let trial = Trial { folder: &folder.path().join("forecast"), extent: extent.clone(), pixels: PIXELS };
    let predictions = predict(&bench(), &trial, &mut |_: Step<'_>| ()).expect("a forecast");
    let own = folder.path().join("cost");
    let sweep = Sweep::alone(bench(), &own, extent);
    let table = sweep.run(&mut Listener { step: &mut |_| (), early: &mut |_| Ok(()) }).expect("a run");
    let score = score(&predictions, &table);
    eprintln!("{score:?}");
    assert!(score.pictures >= 12, "{score:?}");
    assert!(score.rank[0] >= 0.95, "{score:?}");
    assert!(score.covered[0] as f64 >= 0.85 * score.pictures as f64, "{score:?}");
    assert_eq!(gpu.errors(), Vec::<String>::new());
}

/// What is measured of a share are the pixels of the whole picture, also where its rungs look up other tiles, and also
/// of a reference that has several rounds.
#[test]
fn tiles_of_a_share_are_those_of_the_picture() {
    let gpu = Gpu::hasty();
    let opened = Opened::load("study:lamps").expect("a study scene");
    let (environment, settings) = opened.lit(Settings { size: SIZE, ..Settings::default() });
    let camera = opened.camera(SIZE).expect("a camera");
    let whole = Bench { device: &gpu.device, original: &opened.original, environment, settings, camera: &camera };
    let bench = |share: TileShare| shared(&whole, share);
    let share = spread(SIZE, 4.0);
    for choice in ["reflection=ray", "reflection=screen"] {
        let mut knobs = Knobs::of(Model::Local);
        knobs.set("samples=1").expect("a rung");
        knobs.set(choice).expect("a rung");
        let film = |share: TileShare| {
            let mut renderer = bench(share).renderer(&knobs, 0).expect("a renderer");
            renderer.render(&camera, &mut |_| ()).expect("a picture");
            bench(share).film(renderer.film_alone().expect("a film"))
        };
        assert_eq!(bench(share).draws_all(&knobs).expect("a plan"), choice == "reflection=screen", "{choice}");
        let tiles = film(share);
        assert_eq!([tiles.width, tiles.height], bench(share).film_size());
        assert!(tiles == packed_picture(film(TileShare::ALL), share), "{choice}");
        assert!(tiles.rgba.iter().filter(|pixel| pixel[1] > 0.01).count() > 1000, "{choice}: something is seen");
    }
    let mut knobs = Knobs::exact();
    knobs.set("colour=rgb").expect("a rung");
    let bench = bench(share);
    let round = |known| Refined::round(known, &bench, &knobs, 4, &mut |_| ()).expect("a round");
    let refined = round(Some(round(None)));
    let truth = refined.truth(&bench.settings.view_transform());
    let (_, png) = refined.describe(&truth, "", 4, &bench).expect("a reference");
    let display = decode_display(&png).expect("a picture");
    assert_eq!([display.width, display.height], bench.film_size());
    assert_eq!(gpu.errors(), Vec::<String>::new());
}
