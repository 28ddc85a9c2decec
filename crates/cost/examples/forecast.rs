//! Scores forecasts: what `etalon plan --forecast` says of scenes against what `etalon cost` then measures, and against
//! what a second measurement says of the first.
//!
//!     cargo run -p etalon-cost --example forecast -- study:metals study:lamps
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use etalon::frame::Settings;
use etalon::gpu::{Device, DeviceChoice};
use etalon::open::Opened;
use etalon_cost::pace::Step;
use etalon_cost::predict::{PIXELS, Prediction, Trial, predict, score};
use etalon_cost::sweep::{Listener, Sweep, SweepExtent};
use etalon_cost::table::Point;
use etalon_cost::warm::Bench;

/// Pixels that are measured.
const SIZE: [u32; 2] = [320, 180];
/// Seconds of the forecast and of each of two measurements.
const SECONDS: [u32; 2] = [60, 120];

fn main() -> anyhow::Result<()> {
    let device = Device::open(&DeviceChoice::Best, false)?;
    for name in std::env::args().skip(1) {
        let opened = Opened::load(&name)?;
        let (environment, settings) = opened.lit(Settings { size: SIZE, ..Settings::default() });
        let camera = opened.camera(SIZE)?;
        let bench = || Bench {
            device: &device,
            original: &opened.original,
            environment,
            settings: settings.clone(),
            camera: &camera,
        };
        let folder = tempfile::tempdir()?;
        let [foretold, measured] =
            SECONDS.map(|budget_s| SweepExtent { budget_s, reference_samples: None, shard: [1, 1] });
        let trial = Trial { folder: &folder.path().join("forecast"), extent: foretold, pixels: PIXELS };
        let predictions = predict(&bench(), &trial, &mut |_: Step<'_>| ())?;
        let measure = |own: &str| {
            let own = folder.path().join(own);
            let sweep = Sweep::alone(bench(), &own, measured.clone());
            sweep.run(&mut Listener { step: &mut |_| (), early: &mut |_| Ok(()) })
        };
        let table = measure("cost")?;
        println!("{name}: {:?}", score(&predictions, &table));
        // What a second measurement says of the first is the most that a forecast can reach.
        let again = measure("again")?;
        let as_foretold = |point: &Point| Prediction {
            picture: point.name.clone(),
            knobs: point.knobs.clone(),
            gpu_ms: point.gpu_ms,
            error: point.errors.error,
        };
        let known: Vec<Prediction> = again.points.iter().map(as_foretold).collect();
        println!("  a second measurement: {:?}", score(&known, &table));
        for p in &predictions {
            let Some(point) = table.points.iter().find(|point| point.name == p.picture) else { continue };
            let [e, t] = [(p.error, point.error()), (p.gpu_ms, point.gpu_ms.median)].map(|(foretold, measured)| {
                let of = |x: f64| x / measured;
                format!("{measured:.4} {:.2} ({:.2} {:.2})", of(foretold.median), of(foretold.low), of(foretold.high))
            });
            println!("  {}: error {e}, ms {t}", p.picture);
        }
    }
    Ok(())
}
