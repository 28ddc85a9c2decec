//! Denoising by non-local means against a twin in f64, against truth, and where there is no noise.

use etalon::image::Picture;
use etalon::plan::{EffectState, Model};
use etalon::study;
use etalon::study::shape::Shape;
use etalon_testing::gpu::{Gpu, bits, settings_of};
use etalon_testing::made::{Made, at, lambert, unlit};
use glam::DAffine3;

const SIZE: [u32; 2] = [48, 32];

/// shaders/lib/nl_means.glsl, written anew: the mean of two pictures, each filtered by weights of the other. The first
/// is the mean of a share `first` of all samples.
fn twin(halves: &[Picture; 2], first: f64) -> Vec<[f64; 3]> {
    let [width, height] = SIZE.map(|n| n as i32);
    let place = |x: i32, y: i32| (y.clamp(0, height - 1) * width + x.clamp(0, width - 1)) as usize;
    let pixels = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let compared = [0, 1].map(|half: usize| {
        let radiance = halves[half].rgba.iter();
        radiance.map(|p| [0, 1, 2].map(|c| (1.0 + 4.0 * f64::from(p[c]).max(0.0)).ln())).collect::<Vec<[f64; 3]>>()
    });
    let apart = |a: [f64; 3], b: [f64; 3]| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>();
    let own: Vec<f64> = compared[0].iter().zip(&compared[1]).map(|(&a, &b)| 0.5 * apart(a, b)).collect();
    let around = |(x, y)| {
        let square = (-2..=2).flat_map(|j| (-2..=2).map(move |i| (i, j)));
        square.map(|(i, j)| own[place(x + i, y + j)]).sum::<f64>() / 25.0
    };
    let variance: Vec<f64> = pixels().map(around).collect();
    let outlier = |q: usize| if own[q] > 4.0 * variance[q] { 4.0 * variance[q] / own[q] } else { 1.0 };
    let filtered = |(x, y): (i32, i32), half: usize| {
        let guide = &compared[1 - half];
        let (mut sum, mut weights) = ([0.0; 3], 0.0);
        for (j, i) in (-3..=3).flat_map(|j| (-3..=3).map(move |i| (j, i))) {
            if !(0..width).contains(&(x + i)) || !(0..height).contains(&(y + j)) {
                continue;
            }
            let mut distance = 0.0;
            for (v, u) in (-1..=1).flat_map(|v| (-1..=1).map(move |u| (v, u))) {
                let (p, q) = (place(x + u, y + v), place(x + i + u, y + j + v));
                let noise = variance[p] + variance[p].min(variance[q]);
                distance += (apart(guide[p], guide[q]) - noise) / (0.36 * (variance[p] + variance[q]) + 1e-20);
            }
            let q = place(x + i, y + j);
            if (0..2).any(|k| halves[k].rgba[q][3] != halves[k].rgba[place(x, y)][3]) {
                continue;
            }
            let weight = (-(distance / 9.0).max(0.0)).exp() * outlier(q);
            weights += weight;
            for (c, sum) in sum.iter_mut().enumerate() {
                *sum += weight * f64::from(halves[half].rgba[q][c]);
            }
        }
        sum.map(|x| x / weights)
    };
    pixels()
        .map(|at| [filtered(at, 0), filtered(at, 1)])
        .map(|[a, b]| [0, 1, 2].map(|c| first * a[c] + (1.0 - first) * b[c]))
        .collect()
}

/// The device's logarithms and exponentials are coarse, and a distance is the quotient of small differences.
#[test]
fn pixels_are_what_the_twin_says() {
    let gpu = Gpu::open();
    // All samples, and a stop after an odd one, of more blocks than one sample has.
    for (name, samples, stop) in
        [("cornell", "samples=16", 16), ("etalon", "samples=4", 3), ("cornell", "samples=256", 131)]
    {
        let scene = study::load(name).expect("a scene");
        let settings = settings_of(Model::Global, SIZE, &[samples, "denoise=nl-means"]);
        let mut renderer = gpu.renderer(&scene, None, settings);
        let mut drawing = renderer.begin(&scene.cameras[0], u32::MAX);
        while drawing.samples() < stop {
            renderer.step(&mut drawing).expect("a sample");
        }
        renderer.picture(&drawing).expect("a picture");
        let once = bits(&renderer.film_alone().expect("a film"));
        renderer.picture(&drawing).expect("the picture again");
        let film = renderer.film_alone().expect("a film");
        assert_eq!(once, bits(&film), "nothing is denoised twice");
        let halves = renderer.half_means_alone().expect("halves").expect("two of them");
        let first = f64::from(stop.div_ceil(2)) / f64::from(stop);
        let mut off = 0.0_f64;
        let mut moved = 0.0_f64;
        for (i, expected) in twin(&halves, first).into_iter().enumerate() {
            for (c, expected) in expected.into_iter().enumerate() {
                let mean = first * f64::from(halves[0].rgba[i][c]) + (1.0 - first) * f64::from(halves[1].rgba[i][c]);
                off = off.max((f64::from(film.rgba[i][c]) - expected).abs() / (1.0 + expected));
                moved = moved.max((expected - mean).abs() / (1.0 + expected));
            }
        }
        eprintln!("{name} {samples} {stop}: off by {off:.1e}, moved by up to {moved:.2}");
        assert!(off < 1e-4 && moved > 0.01, "{name}: {off:e}, {moved}");
    }
}

/// Error of path tracing against many more samples, which share no random numbers with it.
#[test]
fn pictures_of_paths_have_less_error() {
    let gpu = Gpu::open();
    // With so few pixels most of study:materials is edges.
    for (name, most) in [("cornell", 0.6), ("materials", 0.9)] {
        let scene = study::load(name).expect("a scene");
        let film = |choices: &[&str], seed| {
            let mut settings = settings_of(Model::Global, SIZE, choices);
            settings.seed = seed;
            gpu.film(&scene, settings)
        };
        let truth = film(&["samples=256"], 7);
        let error = |picture: &Picture| {
            let shown = |x: f32| (1.0 + 4.0 * f64::from(x)).ln();
            let pairs = picture.rgba.iter().flatten().zip(truth.rgba.iter().flatten());
            pairs.map(|(&x, &t)| (shown(x) - shown(t)).powi(2)).sum::<f64>()
        };
        let [noisy, denoised] = ["denoise=off", "denoise=nl-means"].map(|rung| error(&film(&["samples=16", rung], 1)));
        eprintln!("{name}: {:.2} of the squared error", denoised / noisy);
        assert!(denoised < most * noisy, "{name}: {denoised} and {noisy}");
    }
}

/// Two surfaces that send light and no paths on meet between pixels: nothing is noise, and no bit changes, nor at the
/// edge.
#[test]
fn without_noise_no_bit_changes() {
    let gpu = Gpu::open();
    let mut made = Made::new("panel");
    made.add(Shape::panel(4.0, 8.0), unlit([0.5, 0.3, 0.1]), at(-2.0, 0.0, 0.0));
    made.add(Shape::panel(4.0, 8.0), unlit([0.5, 0.301, 0.1]), at(2.0, 0.0, 0.0));
    made.front(1.0);
    let film = |rung: &str| {
        let mut renderer = gpu.renderer(&made.0, None, settings_of(Model::Global, SIZE, &["samples=16", rung]));
        renderer.render(&made.0.cameras[0], &mut |_| ()).expect("a picture");
        (renderer.plan().denoise, renderer.film_alone().expect("a film"))
    };
    let [(is_planned, denoised), (is_planned_off, as_it_is)] = ["denoise=nl-means", "denoise=off"].map(film);
    assert!(is_planned && !is_planned_off, "the knob decides");
    assert_eq!(bits(&denoised), bits(&as_it_is));
    let green = |x: usize| as_it_is.rgba[SIZE[0] as usize * 7 + x][1];
    assert!(green(23) < green(24) && green(0) == green(23), "the edge");
}

/// The variance is estimated from two samples of path tracing.
#[test]
fn only_path_tracing_of_several_samples_is_denoised() {
    let gpu = Gpu::open();
    let mut made = Made::new("floor");
    made.add(Shape::panel(8.0, 8.0), lambert([0.5; 3]), DAffine3::IDENTITY);
    made.front(1.0);
    let state = |model, choices: &[&str]| {
        let renderer = gpu.renderer(&made.0, None, settings_of(model, SIZE, choices));
        let plan = renderer.plan();
        let effect = plan.effects.iter().find(|effect| effect.id.name() == "denoising").expect("the effect");
        assert_eq!(plan.denoise, effect.state == EffectState::Kept);
        (effect.state.name(), effect.reason())
    };
    let nl = "denoise=nl-means";
    assert_eq!(state(Model::Recursive, &["samples=4"]), ("not needed", "path tracing is off".to_owned()));
    assert_eq!(state(Model::Global, &["samples=1", nl]).0, "not needed");
    assert_eq!(state(Model::Global, &["samples=4", nl]), ("used", "paths are drawn at random".to_owned()));
    assert_eq!(state(Model::Global, &["samples=4"]), ("switched off", "denoise=off".to_owned()));
}
