//! What few bands of wavelengths leave a reference off is a part of its intervals.

use etalon::frame::Settings;
use etalon::image::png::Display;
use etalon::open::Opened;
use etalon::plan::{Knobs, Model};
use etalon_cost::difference::ShownReference;
use etalon_cost::reference::off_by_bands;
use etalon_cost::warm::Bench;
use etalon_testing::gpu::Gpu;

#[test]
fn few_bands_widen_intervals() {
    let gpu = Gpu::hasty();
    let opened = Opened::load("study:metamers").expect("a study scene");
    let size = [64, 36];
    let (environment, settings) = opened.lit(Settings { size, ..Settings::default() });
    let camera = opened.camera(size).expect("a camera");
    let bench = Bench { device: &gpu.device, original: &opened.original, environment, settings, camera: &camera };
    let picture = |colour: &str| -> Display {
        let mut knobs = Knobs::of(Model::Local);
        ["samples=1", colour].iter().for_each(|choice| knobs.set(choice).expect("a rung"));
        let mut renderer = bench.renderer(&knobs, 0).expect("a renderer");
        bench.display(&renderer.render(&camera, &mut |_| ()).expect("a picture")).expect("an encoded picture").0
    };
    let off = [8, 16].map(|bands| off_by_bands(&bench, bands).expect("two pictures"));
    // The means of smooth spectra over bands converge with the square of their number.
    assert!(off[0] > 2.0 * off[1] && off[1] > 1e-3, "{off:?}");
    // Pictures without noise, so that nothing else widens an interval. They have eight bits.
    let rgb = picture("colour=rgb");
    let exact_error = ShownReference::exact(&picture("colour=spectral:32")).error(&rgb).mean;
    for (bands, off) in [(8, off[0]), (16, off[1])] {
        let by_bands = || ShownReference::exact(&picture(&format!("colour=spectral:{bands}")));
        let blind = by_bands().error(&rgb).interval();
        assert!(exact_error < blind.low || exact_error > blind.high, "{bands}: {exact_error} in {blind:?}");
        let aware = by_bands().also_off(off + 0.5 / 255.0).error(&rgb).interval();
        assert!(aware.low <= exact_error && exact_error <= aware.high, "{bands}: {exact_error} not in {aware:?}");
    }
    assert_eq!(gpu.errors(), Vec::<String>::new());
}
