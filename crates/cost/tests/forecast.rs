//! `etalon plan --forecast`: what it says of a size at which it draws nothing, against what is then measured there.

use etalon::frame::Settings;
use etalon::open::Opened;
use etalon_cost::pace::Step;
use etalon_cost::predict::{Trial, predict, score};
use etalon_cost::sweep::{Listener, Sweep, SweepExtent};
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
