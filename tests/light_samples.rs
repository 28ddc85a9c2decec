//! Light samples outside of path tracing: what lights with an extent send to surfaces, also to those that rays meet.
//!
//! Read pbrt (4th ed.), section 13.3 (next event estimation). Truth is the path tracer, whose light sampling is tested
//! against closed forms (tests/paths.rs), in scenes where light is scattered once.

use etalon::image::Picture;
use etalon::plan::rungs::EffectId;
use etalon::plan::{EffectState, LightSamples, Model};
use etalon::scene::lobe::DIFFUSE_TRANSMISSION;
use etalon::scene::{Extent, LightKind, Material, Scene};
use etalon::study::shape::Shape;
use etalon_testing::gpu::{Gpu, bits, settings_of, spread};
use etalon_testing::made::{Made, at, lambert, orthographic, perspective};
use glam::{DAffine3, DVec3};

fn shot(gpu: &Gpu, scene: &Scene, model: Model, choices: &[&str]) -> Picture {
    gpu.shot(scene, None, settings_of(model, [16, 16], choices)).1
}

/// Emits 3, 2, 1 on both sides, and reflects nothing.
fn glowing() -> Material {
    Material { emissive: [3.0, 2.0, 1.0], double_sided: true, ..lambert([0.0; 3]) }
}

fn lying() -> DAffine3 {
    DAffine3::from_rotation_x(-std::f64::consts::FRAC_PI_2)
}

/// A floor of one material, a glowing panel that stands at its end, and the eye, which sees the floor at 45° in the
/// direction of the panel's mirror image.
fn floor(material: Material) -> Made {
    let mut made = Made::new("floor");
    made.add(Shape::panel(4.0, 4.0), material, lying());
    made.add(Shape::panel(1.0, 1.0), glowing(), at(0.0, 0.6, -0.7));
    made.camera(DVec3::new(0.0, 2.0, 2.0), DVec3::ZERO, orthographic(0.1));
    made
}

/// Light of lamps alone: what surfaces send to others is found for the whole scene, and would hide errors of a few
/// percent.
const DIRECT: &str = "indirect=off";

/// The same mean as paths, in each channel, within the noise of both and `share`.
fn agree(gpu: &Gpu, scene: &Scene, what: &str, choices: &[&str], share: f64) {
    let paths = shot(gpu, scene, Model::Global, &[&["samples=256"], choices].concat());
    let single = shot(gpu, scene, Model::Recursive, &[&["samples=64", DIRECT], choices].concat());
    for channel in 0..3 {
        let ([wanted, of_paths, _], [mean, error, _]) = (spread(&paths, channel), spread(&single, channel));
        eprintln!("{what}, {channel}: {mean:.5} ± {error:.5} for {wanted:.5} ± {of_paths:.5}");
        assert!(wanted > 0.01, "{what}: the scene is dark");
        assert!((mean - wanted).abs() < 4.0 * error.hypot(of_paths) + share * wanted, "{what}: {mean}, not {wanted}");
    }
}

/// Of smooth lobes rays find the light, of rough ones light samples do: neither counts twice, and none is missing.
#[test]
fn every_lobe_has_the_light_of_a_surface_once() {
    let gpu = Gpu::open();
    let same = ["brdf=ggx", "fresnel=exact"];
    let metal = |roughness| Material { metallic: 1.0, roughness, ..lambert([0.9, 0.8, 0.7]) };
    let plastic = |roughness| Material { roughness, specular: 1.0, ..lambert([0.3, 0.2, 0.6]) };
    // Rays sample lobes up to a roughness of 0.2.
    for roughness in [0.0, 0.15, 0.4] {
        agree(&gpu, &floor(metal(roughness)).0, &format!("metal {roughness}"), &same, 0.01);
    }
    for roughness in [0.15, 0.4] {
        agree(&gpu, &floor(plastic(roughness)).0, &format!("plastic {roughness}"), &same, 0.015);
    }
    for clearcoat_roughness in [0.05, 0.5] {
        let coated = Material { clearcoat: 1.0, clearcoat_roughness, ..plastic(0.5) };
        agree(&gpu, &floor(coated).0, &format!("coat {clearcoat_roughness}"), &same, 0.02);
    }
}

#[test]
fn light_comes_through_a_leaf() {
    let gpu = Gpu::open();
    let mut made = Made::new("leaf");
    let mut leaf = Material { double_sided: true, ..lambert([0.5; 3]) };
    leaf.lobes[DIFFUSE_TRANSMISSION].factors = [0.8, 0.9, 0.5, 0.7];
    made.add(Shape::panel(2.0, 2.0), leaf, lying());
    made.add(Shape::panel(1.0, 1.0), glowing(), at(0.3, -0.6, 0.2) * lying());
    made.camera(DVec3::Y * 2.0, DVec3::ZERO, orthographic(0.1));
    agree(&gpu, &made.0, "leaf", &[], 0.01);
}

/// What a mirror shows is lit as well: the eye looks down at a mirror that shows a wall, which the panel lights.
#[test]
fn surfaces_that_rays_meet_are_lit() {
    let gpu = Gpu::open();
    let metal = Material { metallic: 1.0, roughness: 0.0, double_sided: true, ..lambert([0.9, 0.8, 0.7]) };
    let mut made = Made::new("mirror");
    made.add(Shape::panel(1.0, 1.0), glowing(), at(0.0, 0.6, -0.7));
    made.add(Shape::panel(2.0, 2.0), lambert([0.4, 0.6, 0.8]), at(0.0, 2.0, 3.0) * DAffine3::from_rotation_y(3.1));
    made.add(Shape::panel(0.6, 0.6), metal, at(0.0, 2.0, 0.0) * DAffine3::from_rotation_x(-0.7));
    made.camera(DVec3::new(0.0, 5.0, 0.0), DVec3::new(0.0, 2.0, 0.0), orthographic(0.1));
    agree(&gpu, &made.0, "in a mirror", &[], 0.01);
}

/// A single-sided surface emits on its front alone, towards light samples and towards rays.
#[test]
fn the_back_of_a_single_sided_surface_is_dark() {
    let gpu = Gpu::open();
    let one_sided = Material { double_sided: false, ..glowing() };
    let metal = Material { metallic: 1.0, roughness: 0.0, ..lambert([0.9; 3]) };
    for (what, material) in [("matt", lambert([0.9; 3])), ("mirror", metal)] {
        for (turn, is_lit) in [(0.0, true), (std::f64::consts::PI, false)] {
            let mut made = Made::new("floor");
            made.add(Shape::panel(4.0, 4.0), material.clone(), lying());
            made.add(Shape::panel(1.0, 1.0), one_sided.clone(), at(0.0, 0.6, -0.7) * DAffine3::from_rotation_y(turn));
            made.camera(DVec3::new(0.0, 2.0, 2.0), DVec3::ZERO, orthographic(0.1));
            for (model, indirect) in [(Model::Recursive, DIRECT), (Model::Global, "indirect=path")] {
                let [mean, ..] = spread(&shot(&gpu, &made.0, model, &["samples=4", indirect]), 0);
                assert_eq!(mean > 1e-6, is_lit, "{what}, {model:?}, turned by {turn}: {mean}");
            }
        }
    }
}

/// The picture shows the panel to smooth lobes, so light samples do not.
#[test]
fn lobes_in_screen_space_have_the_light_once() {
    let gpu = Gpu::open();
    let metal = Material { metallic: 1.0, roughness: 0.1, ..lambert([0.9; 3]) };
    let mut made = floor(metal);
    made.0.cameras.clear();
    made.camera(DVec3::new(0.0, 0.6, 2.5), DVec3::new(0.0, 0.2, 0.0), perspective(40.0));
    // The lower half of the picture: the floor, with the mirror image of the panel.
    let floor = |reflection: &str| {
        let film = shot(&gpu, &made.0, Model::Recursive, &["samples=16", "interfaces=1", reflection]);
        film.rgba[8 * 16..].iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / 128.0
    };
    let (by_rays, on_screen) = (floor("reflection=ray"), floor("reflection=screen"));
    eprintln!("{by_rays} by rays, {on_screen} on screen");
    assert!(by_rays > 0.1 && (on_screen / by_rays - 1.0).abs() < 0.2, "{on_screen}, not {by_rays}");
}

/// All kinds of lights beside each other, so many that tiles list the point lights.
#[test]
fn lights_of_every_kind_light_together() {
    let gpu = Gpu::open();
    let mut made = floor(lambert([0.7, 0.5, 0.3]));
    let right = std::f64::consts::FRAC_PI_2;
    for i in 0..18 {
        let position = DVec3::new(0.2 * f64::from(i) - 1.8, 1.0, 0.5);
        made.light([0.2, 0.1, 0.1], LightKind::Point { position, range: Some(3.0) });
        if i % 9 == 4 {
            let direction = DVec3::NEG_Y;
            made.light([1.0; 3], LightKind::Spot { position, direction, range: None, inner: right, outer: right });
            made.0.lights.last_mut().expect("a light").extent = Some(Extent::Disk { radius: 0.3 });
        }
    }
    made.light([0.3, 0.4, 0.5], LightKind::Directional { direction: DVec3::new(0.2, -1.0, -0.3).normalize() });
    let renderer = gpu.renderer(&made.0, None, settings_of(Model::Recursive, [16, 16], &[]));
    let plan = renderer.plan();
    assert_eq!((plan.tiles, plan.directional_lights, plan.local_lights), (true, 1, 18));
    assert!(plan.light_samples.emitting && plan.light_samples.shaped);
    drop(renderer);
    agree(&gpu, &made.0, "all kinds", &[], 0.01);
    let mean = |shadows: &str| spread(&shot(&gpu, &made.0, Model::Recursive, &["samples=64", shadows]), 0)[0];
    let (by_rays, by_maps) = (mean("shadows=ray"), mean("shadows=map"));
    assert!((by_maps / by_rays - 1.0).abs() < 0.01, "{by_maps}, not {by_rays}");
}

/// The number of samples and the sampler change the noise and not the mean.
#[test]
fn rungs_of_light_sampling_agree() {
    let gpu = Gpu::open();
    let mut made = Made::new("panels");
    made.add(Shape::panel(4.0, 4.0), lambert([0.6; 3]), lying());
    for i in 0..12 {
        let turn = DAffine3::from_rotation_y(f64::from(i));
        made.add(Shape::panel(0.2, 0.1), glowing(), turn * at(0.4, 0.1 + 0.05 * f64::from(i), 0.3));
    }
    made.camera(DVec3::Y * 3.0, DVec3::ZERO, orthographic(0.5));
    let mean = |choices: &[&str]| spread(&shot(&gpu, &made.0, Model::Recursive, choices), 0);
    let [wanted, ..] = mean(&["samples=256", "lights=area:16", "light-sampler=power"]);
    let mut noise = Vec::new();
    for lights in ["lights=area:1", "lights=area:4", "lights=area:16"] {
        let [found, ..] = mean(&["samples=64", lights]);
        assert!((found / wanted - 1.0).abs() < 0.01, "{lights}: {found}, not {wanted}");
        let one = shot(&gpu, &made.0, Model::Recursive, &["samples=1", lights]);
        let best = shot(&gpu, &made.0, Model::Recursive, &["samples=64", "lights=area:16"]);
        noise.push(one.rgba.iter().zip(&best.rgba).map(|(a, b)| f64::from(a[0] - b[0]).powi(2)).sum::<f64>());
    }
    assert!(noise[0] > 2.0 * noise[1] && noise[1] > 2.0 * noise[2], "{noise:?}");
    // One of several candidates has less noise than one alone: the panels' backs and grazing ones are not chosen.
    let best = shot(&gpu, &made.0, Model::Recursive, &["samples=256", "lights=area:16"]);
    let noise = ["hierarchy", "resampled:2", "resampled:4"].map(|rung| {
        let sampler = &format!("light-sampler={rung}");
        let [found, ..] = mean(&["samples=64", sampler]);
        assert!((found / wanted - 1.0).abs() < 0.01, "{sampler}: {found}, not {wanted}");
        let few = shot(&gpu, &made.0, Model::Recursive, &["samples=4", "lights=area:1", sampler]);
        few.rgba.iter().zip(&best.rgba).map(|(a, b)| f64::from(a[0] - b[0]).powi(2)).sum::<f64>()
    });
    eprintln!("noise by one sample, and of two and four candidates: {noise:?}");
    assert!(noise[1] < 0.8 * noise[0] && noise[2] < 0.8 * noise[1], "{noise:?}");
}

/// A glossy floor below a row of lamps: each point mirrors one of them, which candidates find by the lobe.
#[test]
fn candidates_are_weighed_by_the_lobe() {
    let gpu = Gpu::open();
    let mut made = Made::new("row of lamps");
    let metal = Material { metallic: 1.0, roughness: 0.3, ..lambert([0.9; 3]) };
    made.add(Shape::panel(8.0, 8.0), metal, lying());
    for i in 0..16 {
        made.add(Shape::panel(0.1, 0.1), glowing(), at(0.3 * f64::from(i) - 2.25, 0.4, -1.0));
    }
    // Only the floor is in the picture: edges of lamps would have an error of their own.
    made.camera(DVec3::new(0.0, 2.0, 3.2), DVec3::new(0.0, 0.0, -0.3), orthographic(0.25));
    let film = |choices: &[&str]| {
        let choices = &[&["interfaces=1", DIRECT, "brdf=ggx"], choices].concat();
        gpu.shot(&made.0, None, settings_of(Model::Recursive, [32, 32], choices)).1
    };
    let best = film(&["samples=256", "lights=area:16", "light-sampler=hierarchy"]);
    let [wanted, ..] = spread(&best, 0);
    let noise = ["light-sampler=hierarchy", "light-sampler=resampled:4"].map(|sampler| {
        let [found, error, _] = spread(&film(&["samples=64", sampler]), 0);
        let few = film(&["samples=4", "lights=area:1", sampler]);
        eprintln!("{sampler}: {found} ± {error} for {wanted}");
        assert!((found / wanted - 1.0).abs() < 0.01, "{sampler}: {found}, not {wanted}");
        few.rgba.iter().zip(&best.rgba).map(|(a, b)| f64::from(a[0] - b[0]).powi(2)).sum::<f64>()
    });
    eprintln!("noise of one sample, and of four candidates: {noise:?}, {}", noise[1] / noise[0]);
    assert!(noise[1] < 0.2 * noise[0], "{noise:?}");
}

/// Candidates are weighed by the light on one side, yet what comes from the other has its mean.
#[test]
fn candidates_find_light_from_behind() {
    let gpu = Gpu::open();
    let mut made = Made::new("leaf between panels");
    let mut leaf = Material { double_sided: true, ..lambert([0.5; 3]) };
    leaf.lobes[DIFFUSE_TRANSMISSION].factors = [0.8, 0.9, 0.5, 0.7];
    made.add(Shape::panel(2.0, 2.0), leaf, lying());
    for i in 0..4 {
        let height = if i % 2 == 0 { -0.6 } else { 0.7 };
        made.add(Shape::panel(0.4, 0.4), glowing(), at(f64::from(i) - 1.5, height, 0.2) * lying());
    }
    made.camera(DVec3::Y * 2.0, DVec3::ZERO, orthographic(0.1));
    let renderer = gpu.renderer(&made.0, None, settings_of(Model::Recursive, [16, 16], &[]));
    assert_eq!(renderer.plan().light_samples.candidates, 4);
    drop(renderer);
    agree(&gpu, &made.0, "leaf between panels", &[], 0.01);
}

/// The pixels of a square share one stratified sequence, so that their errors cancel: the mean of 4x4 pixels is nearer
/// to its limit than that of 16 independent ones.
#[test]
fn errors_of_neighbours_cancel() {
    let gpu = Gpu::open();
    let mut made = floor(lambert([0.6; 3]));
    made.0.cameras.clear();
    made.camera(DVec3::new(0.0, 2.0, 0.5), DVec3::new(0.0, 0.0, 0.2), orthographic(0.2));
    let film = |choices: &[&str]| {
        let choices = &[&["interfaces=1", DIRECT], choices].concat();
        gpu.shot(&made.0, None, settings_of(Model::Recursive, [64, 64], choices)).1
    };
    let (few, truth) = (film(&["samples=4", "lights=area:1"]), film(&["samples=64", "lights=area:16"]));
    let off: Vec<f64> = few.rgba.iter().zip(&truth.rgba).map(|(a, b)| f64::from(a[1] - b[1])).collect();
    let of_pixels = off.iter().map(|off| off * off).sum::<f64>() / off.len() as f64;
    let squares = (0..16).flat_map(|y| (0..16).map(move |x| (x, y)));
    let means = squares.map(|(x, y)| (0..16).map(|i| off[(4 * y + i / 4) * 64 + 4 * x + i % 4]).sum::<f64>() / 16.0);
    let of_squares = means.map(|off| off * off).sum::<f64>() / 256.0;
    let share = 16.0 * of_squares / of_pixels;
    eprintln!("the squares have {share:.3} of the variance of independent pixels");
    assert!(of_pixels > 0.0 && share < 0.5, "{share}");
}

/// Without a light of an extent nothing is sampled: the same picture to the bit, with the same plan.
#[test]
fn a_scene_without_such_lights_pays_nothing() {
    let gpu = Gpu::open();
    let mut made = Made::new("lit floor");
    made.add(Shape::panel(4.0, 4.0), lambert([0.6; 3]), lying());
    made.light([20.0, 10.0, 5.0], LightKind::Point { position: DVec3::new(0.5, 2.0, 0.3), range: None });
    made.camera(DVec3::Y * 3.0, DVec3::ZERO, orthographic(1.0));
    let [area, points] = ["lights=area:4", "lights=points"].map(|lights| {
        let renderer = gpu.renderer(&made.0, None, settings_of(Model::Recursive, [16, 16], &[lights]));
        assert_eq!(renderer.plan().light_samples, LightSamples::default());
        shot(&gpu, &made.0, Model::Recursive, &[lights])
    });
    assert!(bits(&area) == bits(&points));
}

#[test]
fn the_plan_says_what_is_sampled() {
    let gpu = Gpu::open();
    let scene = floor(lambert([0.5; 3])).0;
    let state = |choices: &[&str], id: EffectId| {
        let renderer = gpu.renderer(&scene, None, settings_of(Model::Recursive, [16, 16], choices));
        renderer.plan().effects.iter().find(|effect| effect.id == id).map(|effect| effect.state)
    };
    assert_eq!(state(&[], EffectId::EmissiveLights), Some(EffectState::Kept));
    assert_eq!(state(&[], EffectId::AreaLights), Some(EffectState::NotCalledFor));
    // Two triangles are one panel.
    assert_eq!(state(&[], EffectId::LightHierarchy), Some(EffectState::NotCalledFor));
    let points = etalon::plan::rungs::Lights::Points.choice();
    assert_eq!(state(&["lights=points"], EffectId::EmissiveLights), Some(EffectState::DroppedBy(points)));
}
