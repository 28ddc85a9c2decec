//! Transparent surfaces against the over operator: far to near, in f64, whatever the order in which they were drawn.
//! Panes are unlit, so that coverage and order are all there is to get wrong.

use etalon::frame::{Background, Settings};
use etalon::image::Picture;
use etalon::optics::SplitMix64;
use etalon::scene::{AlphaMode, Camera, Image, LightKind, Material, Sampler, Scene, TextureRef};
use etalon::study;
use etalon::study::shape::Shape;
use etalon_testing::gpu::{Gpu, bits, knobs, settings};
use etalon_testing::made::{Made, at, lambert, pane, unlit};
use glam::{Affine2, DAffine3, DVec3};

const SIZE: [u32; 2] = [80, 45];

/// The film of a picture from which nothing may be dropped.
fn whole(gpu: &Gpu, scene: &Scene, settings: Settings) -> Picture {
    let (rendered, film) = gpu.shot(scene, None, settings);
    assert_eq!(rendered.dropped, 0, "{}: dropped fragments", scene.name);
    film
}

/// Radiance and coverage behind a pixel: every surface along its ray, far to near, over nothing.
fn over(scene: &Scene, camera: &Camera, size: [u32; 2], x: u32, y: u32) -> [f64; 4] {
    let world =
        etalon_testing::raycast::World::new(scene, etalon_testing::raycast::Options { blend: true, textures: true });
    over_in(
        scene,
        &world,
        &etalon_testing::raycast::camera_ray(camera, size[0], size[1], f64::from(x) + 0.5, f64::from(y) + 0.5),
    )
}

fn over_in(scene: &Scene, world: &etalon_testing::raycast::World<'_>, ray: &etalon_testing::raycast::Ray) -> [f64; 4] {
    let mut ray = *ray;
    let mut sum = DVec3::ZERO;
    let mut through = 1.0;
    while let Some(hit) = world.closest(&ray) {
        // What a mask leaves is opaque.
        let blends = scene.materials[hit.material].alpha_mode == AlphaMode::Blend;
        let alpha = if blends { hit.alpha } else { 1.0 };
        sum += through * alpha * hit.albedo;
        through *= 1.0 - alpha;
        if alpha >= 1.0 {
            break;
        }
        ray.nearest = hit.distance * (1.0 + 1e-12);
    }
    [sum.x, sum.y, sum.z, 1.0 - through]
}

/// Whether a pixel's ray and the four beside it, a 64th of a pixel away, see the same stack of surfaces to `slack`:
/// centres on outlines are anyone's.
fn steady(
    scene: &Scene,
    world: &etalon_testing::raycast::World<'_>,
    size: [u32; 2],
    x: u32,
    y: u32,
    slack: f64,
) -> Option<[f64; 4]> {
    let camera = &scene.cameras[0];
    let ray = |dx: f64, dy: f64| {
        etalon_testing::raycast::camera_ray(camera, size[0], size[1], f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy)
    };
    let here = over_in(scene, world, &ray(0.0, 0.0));
    let step = 1.0 / 64.0;
    [(-step, 0.0), (step, 0.0), (0.0, -step), (0.0, step)]
        .into_iter()
        .all(|(dx, dy)| {
            let there = over_in(scene, world, &ray(dx, dy));
            here.iter().zip(there).all(|(a, b)| (a - b).abs() <= slack)
        })
        .then_some(here)
}

/// Largest difference from the over operator, and how many pixels were left out as unsteady.
fn against_over(film: &Picture, scene: &Scene, slack: f64) -> (f64, usize) {
    let world =
        etalon_testing::raycast::World::new(scene, etalon_testing::raycast::Options { blend: true, textures: true });
    let size = [film.width, film.height];
    let (mut worst, mut left_out) = (0.0_f64, 0);
    for (i, got) in film.rgba.iter().enumerate() {
        let (x, y) = (i as u32 % size[0], i as u32 / size[0]);
        let Some(want) = steady(scene, &world, size, x, y, slack) else {
            left_out += 1;
            continue;
        };
        for (got, want) in got.iter().zip(want) {
            worst = worst.max((f64::from(*got) - want).abs());
        }
    }
    (worst, left_out)
}

/// `count` panes at depths of their own, each somewhere else and turned, with the opacities that `alpha` gives.
fn stack(count: usize, mut alpha: impl FnMut(&mut SplitMix64) -> f32) -> Scene {
    let mut made = Made::new("stack");
    made.add(Shape::panel(9.0, 5.0), unlit([0.25, 0.5, 0.75]), at(0.0, 0.0, -1.0));
    let mut random = SplitMix64::new(3);
    for i in 0..count {
        let color = [0, 1, 2].map(|_| random.unit() as f32);
        let alpha = alpha(&mut random);
        let frame = at(random.between(-0.8, 0.8), random.between(-0.5, 0.5), 2.0 * i as f64 / count as f64)
            * DAffine3::from_rotation_z(random.between(0.0, 3.0));
        made.add(Shape::panel(2.5, 1.5), pane(color, alpha), frame);
    }
    made.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO, etalon_testing::made::perspective(30.0));
    made.0
}

/// Opacities that a half float holds exactly.
fn eighths(random: &mut SplitMix64) -> f32 {
    ((random.unit() * 7.0) as i32 + 1) as f32 / 8.0
}

#[test]
fn panes_in_any_order_are_composited_far_to_near() {
    let gpu = Gpu::open();
    for count in [1, 2, 7, 60] {
        let scene = stack(count, eighths);
        let film = whole(&gpu, &scene, settings(SIZE));
        let (worst, left_out) = against_over(&film, &scene, 1e-9);
        eprintln!("{count} panes: {worst:e}, left out {left_out}");
        // As many products and sums of numbers below 1: half an ulp each.
        assert!(worst < (count + 2) as f64 * 2.0_f64.powi(-24), "{count} panes: {worst:e}");
        assert!(left_out < 300, "{count} panes: {left_out}");

        let mut shuffled = scene.clone();
        SplitMix64::new(count as u64).shuffle(&mut shuffled.instances);
        let again = whole(&gpu, &shuffled, settings(SIZE));
        assert!(bits(&film) == bits(&again), "{count} panes: the order of drawing shows");
    }
}

#[test]
fn any_opacity_is_good_to_a_half_float() {
    let gpu = Gpu::open();
    let mut scene = stack(20, |random| random.unit() as f32);
    scene.cameras[0].projection = etalon_testing::made::orthographic(1.2);
    let film = whole(&gpu, &scene, settings(SIZE));
    let (worst, left_out) = against_over(&film, &scene, 1e-9);
    eprintln!("{worst:e}, left out {left_out}");
    // Each opacity is rounded to 11 bits, relative 2^-12, and moves what shows by at most alpha times that; what stays
    // visible of all panes adds up to 1, and what shines through changes as much again.
    assert!(worst < 3.0 * 2.0_f64.powi(-12), "{worst:e}");
    assert!(left_out < 200, "{left_out}");
}

#[test]
fn the_study_of_blending_shows_the_over_operator() {
    let gpu = Gpu::open();
    let mut scene = study::load("blend").expect("a study scene");
    for material in &mut scene.materials {
        // The oracle reads level 0 only.
        if let Some(texture) = &mut material.base_color_texture {
            texture.sampler.mips = false;
        }
    }
    let film = whole(&gpu, &scene, settings([160, 90]));
    let (worst, left_out) = against_over(&film, &scene, 2e-3);
    eprintln!("{worst:e}, left out {left_out}");
    // Texels pass through half floats, rounded downwards: 2^-11 for each of up to three surfaces. What changes by as
    // much over a 64th of a pixel is left out. GPUs filter textures by weights of 8 bits, up to 2^-9 off.
    assert!(left_out < 160 * 90 / 5, "{left_out}");
    let filtered = if gpu.device.is_software() { 0.0 } else { 2.0_f64.powi(-9) };
    assert!(worst < 3.0 * 2.0_f64.powi(-11) + 2e-4 + filtered, "{worst:e}");
}

#[test]
fn panes_through_each_other_change_places_at_the_line() {
    let gpu = Gpu::open();
    let mut made = Made::new("crossing");
    for (color, turn) in [([1.0, 0.0, 0.0], 40.0_f64), ([0.0, 0.0, 1.0], -40.0)] {
        made.add(Shape::panel(3.0, 1.5), pane(color, 0.5), DAffine3::from_rotation_y(turn.to_radians()));
    }
    made.front(1.0);
    let film = whole(&gpu, &made.0, settings(SIZE));
    let row = &film.rgba[SIZE[0] as usize * 22..][..SIZE[0] as usize];
    // Red is turned towards the viewer on the left (+Y turns its left edge to +z): nearest there, so ½ red over ½ blue.
    assert_eq!(row[30], [0.5, 0.0, 0.25, 0.75]);
    assert_eq!(row[50], [0.25, 0.0, 0.5, 0.75]);
    let (worst, left_out) = against_over(&film, &made.0, 1e-9);
    assert!(worst == 0.0 && left_out < 80, "{worst:e}, {left_out}");
}

#[test]
fn of_coplanar_panes_the_later_one_lies_on_top() {
    let gpu = Gpu::open();
    for turned in [false, true] {
        let mut made = Made::new("coplanar");
        let mut panes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        if turned {
            panes.reverse();
        }
        for color in panes {
            made.add(Shape::panel(9.0, 5.0), pane(color, 0.5), DAffine3::IDENTITY);
        }
        made.front(1.0);
        let film = whole(&gpu, &made.0, settings(SIZE));
        let want = if turned { [0.5, 0.25, 0.125, 0.875] } else { [0.125, 0.25, 0.5, 0.875] };
        assert!(film.rgba.iter().all(|p| *p == want), "{:?}, not {want:?}", film.rgba[0]);
    }
}

#[test]
fn a_mask_is_there_or_not_at_its_cutoff() {
    let gpu = Gpu::open();
    let mut made = Made::new("mask");
    // Alpha runs from 0 to 255 over as many texels; nearest, so that texel i is there exactly where i / 255 ≥ cutoff.
    let rgba = (0..256_u32).flat_map(|i| [255, 255, 255, i as u8]).collect();
    made.0.images.push(Image { name: "ramp".to_owned(), width: 256, height: 1, rgba });
    let sampler = Sampler { mag_nearest: true, min_nearest: true, mips: false, ..Sampler::default() };
    let texture = TextureRef { image: 0, uv_set: 0, uv_transform: Affine2::IDENTITY, sampler };
    for (row, cutoff) in [0.0_f32, 0.25, 0.5, 128.0 / 255.0, 1.0, 1.5].into_iter().enumerate() {
        let material = Material {
            base_color_texture: Some(texture),
            alpha_mode: AlphaMode::Mask(cutoff),
            ..unlit([0.5, 0.25, 1.0])
        };
        made.add(Shape::panel(256.0, 1.0), material, at(0.0, 2.5 - row as f64, 0.0));
    }
    made.front(3.0);
    // One pixel a texel, one row of pixels a mask.
    let film = whole(&gpu, &made.0, settings([256, 6]));
    for (row, cutoff) in [0.0_f32, 0.25, 0.5, 128.0 / 255.0, 1.0, 1.5].into_iter().enumerate() {
        for x in 0..256 {
            let there = film.rgba[row * 256 + x][3] == 1.0;
            assert_eq!(there, x as f32 / 255.0 >= cutoff, "cutoff {cutoff}, texel {x}");
        }
    }
}

#[test]
fn coverage_reaches_the_picture_with_a_transparent_background() {
    let gpu = Gpu::open();
    let mut made = Made::new("coverage");
    made.add(Shape::panel(2.0, 8.0), pane([1.0, 0.5, 0.25], 0.5), at(-2.0, 0.0, 0.0));
    made.add(Shape::panel(2.0, 8.0), unlit([1.0, 0.5, 0.25]), at(2.0, 0.0, 0.0));
    made.front(2.0);
    let settings = Settings { background: Background::Transparent, ..settings([64, 32]) };
    let (rendered, film) = gpu.shot(&made.0, None, settings);
    assert_eq!(rendered.dropped, 0);
    assert!(rendered.has_alpha);
    let alpha = |x: usize| (film.rgba[64 * 16 + x], rendered.display[(64 * 16 + x) * 4 + 3]);
    assert_eq!(alpha(16), ([0.5, 0.25, 0.125, 0.5], 128), "premultiplied in the film; 0.5 rounds up to 128");
    assert_eq!(alpha(48), ([1.0, 0.5, 0.25, 1.0], 255));
    assert_eq!(alpha(32), ([0.0; 4], 0));
    // The display is not premultiplied: the pane and the wall are of one colour.
    let color = |x: usize| &rendered.display[(64 * 16 + x) * 4..][..3];
    assert_eq!(color(16), color(48));
}

#[test]
fn clear_sheets_tint_and_absorb_by_their_thickness() {
    // Refraction `off`, straight on and unlit: what passes is base · (1 − F0) · attenuation^(thickness · scale /
    // distance).
    let gpu = Gpu::open();
    for (ior, scale, thickness) in [(1.0_f32, 1.0, 0.5_f32), (1.5, 1.0, 0.25), (2.0, 3.0, 0.25), (1.5, 1.0, 0.0)] {
        let mut made = Made::new("sheet");
        made.add(Shape::panel(99.0, 50.0), unlit([1.0; 3]), at(0.0, 0.0, -1.0));
        let sheet = Material {
            base_color: [1.0, 0.5, 0.25, 1.0],
            transmission: 1.0,
            metallic: 0.0,
            roughness: 0.0,
            ior,
            thickness,
            attenuation_distance: 0.5,
            attenuation_color: [0.5, 1.0, 0.25],
            ..Material::default()
        };
        made.add(Shape::panel(9.0, 5.0), sheet, DAffine3::from_scale(DVec3::splat(scale)));
        made.front(1.0);
        let film = whole(&gpu, &made.0, settings(SIZE));
        let f0 = ((f64::from(ior) - 1.0) / (f64::from(ior) + 1.0)).powi(2);
        let path = f64::from(thickness) * scale / 0.5;
        let want = [1.0 * 0.5_f64.powf(path), 0.5, 0.25 * 0.25_f64.powf(path)].map(|v| v * (1.0 - f0));
        for pixel in &film.rgba {
            for c in 0..3 {
                // exp is good to 3 + 2 |x| ulps (numerics.md, 2), x below 4.
                assert!((f64::from(pixel[c]) - want[c]).abs() < 1e-6, "{ior}, {thickness}: {pixel:?}, not {want:?}");
            }
            assert!((pixel[3] - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn opaque_walls_hide_what_is_behind_them() {
    let gpu = Gpu::open();
    let mut made = Made::new("hidden");
    made.add(Shape::panel(9.0, 5.0), unlit([0.0, 1.0, 0.0]), at(0.0, 0.0, 0.0));
    made.add(Shape::panel(9.0, 5.0), pane([1.0, 0.0, 0.0], 0.5), at(0.0, 0.0, -0.01));
    made.front(1.0);
    let film = whole(&gpu, &made.0, settings(SIZE));
    assert!(film.rgba.iter().all(|p| *p == [0.0, 1.0, 0.0, 1.0]));
}

#[test]
fn lists_grow_and_split_until_everything_fits() {
    let gpu = Gpu::open();
    // 48 bytes a fragment: more than one storage buffer holds, so that the picture is drawn in strips.
    let size = [320, 180];
    let fit = gpu.device.max_storage_bytes() / 48;
    let panes = (fit / (320 * 180) + 2).min(200) as usize;
    if !gpu.device.is_software() {
        eprintln!("not tested: this device holds {fit} fragments in one buffer");
        return;
    }
    assert!(panes as u64 * 320 * 180 > fit, "this device holds {fit} fragments: the case needs a larger picture");
    let mut made = Made::new("many");
    for i in 0..panes {
        let shade = i as f32 / panes as f32;
        made.add(Shape::panel(9.0, 5.0), pane([shade, 1.0 - shade, 0.5], 0.125), at(0.0, 0.0, 0.01 * i as f64));
    }
    SplitMix64::new(5).shuffle(&mut made.0.instances);
    made.front(1.0);
    let (rendered, film) = gpu.shot(&made.0, None, settings(size));
    let want = over(&made.0, &made.0.cameras[0], size, 7, 11);
    for pixel in &film.rgba {
        for (got, want) in pixel.iter().zip(want) {
            // As many products and sums of numbers below 1.
            let bound = panes as f64 * 2.0_f64.powi(-24);
            assert!((f64::from(*got) - want).abs() < bound, "{pixel:?}, not {want:?}");
        }
    }
    assert_eq!(rendered.dropped, 0);
    eprintln!("{panes} panes, room for {fit} fragments");
}

#[test]
fn what_one_invocation_cannot_sort_is_counted() {
    let gpu = Gpu::open();
    let mut made = Made::new("too many");
    for i in 0..230 {
        made.add(Shape::panel(1.0, 8.0), pane([1.0; 3], 0.125), at(0.0, 0.0, 0.01 * i as f64));
    }
    made.front(2.0);
    // 16 rows are 4 m: the panes of 1 m cover 4 columns.
    for samples in ["samples=1", "samples=4"] {
        let settings = Settings { knobs: knobs(&[samples]), ..settings([32, 16]) };
        let mut renderer = gpu.renderer(&made.0, None, settings);
        for picture in 1..=2 {
            let rendered = renderer.render(&made.0.cameras[0], &mut |_| ()).expect("a picture");
            let covered = renderer.film().expect("the film").rgba.iter().filter(|p| p[3] > 0.0).count();
            eprintln!("{samples}, picture {picture}: {} dropped, {covered} covered", rendered.dropped);
            // Edges lie between pixels: every sample of a covered pixel is covered.
            assert_eq!(covered, 4 * 16);
            let cut = if gpu.device.limits_loops() { covered } else { 0 };
            assert_eq!(rendered.dropped as usize, cut, "{samples}, picture {picture}: each pixel is counted once");
        }
    }
}

#[test]
fn memory_s_old_contents_are_not_counted_as_dropped() {
    let gpu = Gpu::open();
    let scene = study::load("blend").expect("a study scene");
    let environment = etalon::scene::environment::Environment::studio();
    // Staging of textures and of the environment has been where the counter lies.
    let (rendered, _) = gpu.shot(&scene, Some(&environment), settings([96, 54]));
    assert_eq!(rendered.dropped, 0);
}

/// `panes` sheets of white glass, 1 cm apart, under `lights` lights that are as strong together however many they are.
/// With `stairs` each pane reaches less far to the right than the one before it, so that pixels beside each other see
/// other numbers of them.
fn lit_stack(panes: usize, lights: usize, stairs: bool) -> Scene {
    let mut made = Made::new("lit stack");
    let sheet = Material { base_color: [1.0, 1.0, 1.0, 0.03], alpha_mode: AlphaMode::Blend, ..lambert([1.0; 3]) };
    for i in 0..panes {
        let x = if stairs { -2.0 * i as f64 / panes as f64 } else { 0.0 };
        made.add(Shape::panel(if stairs { 2.0 } else { 8.0 }, 4.0), sheet.clone(), at(x, 0.0, -0.01 * i as f64));
    }
    for _ in 0..lights {
        made.light([1e5 / lights as f32; 3], LightKind::Point { position: DVec3::Z * 5.0, range: None });
    }
    made.front(1.0);
    made.0
}

#[test]
fn what_does_not_fit_into_the_loops_of_an_invocation_is_counted() {
    let gpu = Gpu::open();
    // lavapipe ends loops in silence after 65,535 heads; a pane costs a head for each light and for each pane.
    for (panes, lights, stairs, fits) in [
        (1, 10, false, Some(true)),
        (30, 1000, false, Some(true)),
        (36, 1000, false, None),
        (60, 1000, false, Some(false)),
        (100, 1000, false, Some(false)),
        (1, 39_000, false, Some(true)),
        (1, 60_000, false, None),
        (2, 60_000, false, Some(false)),
        (90, 300, true, Some(true)),
        (100, 1000, true, Some(false)),
        (150, 60, true, None),
        (200, 20, true, None),
    ] {
        let want = gpu.film(&lit_stack(panes, 1, stairs), settings([8, 8]));
        let (rendered, got) = gpu.shot(&lit_stack(panes, lights, stairs), None, settings([8, 8]));
        // As many terms, half an ulp of the sum each; 64 pixels are alike or nearly so.
        let bound = (lights + panes) as f64 * 2.0_f64.powi(-24);
        let wrong = want.rgba.iter().zip(&got.rgba).filter(|(w, g)| {
            (0..4).any(|c| (f64::from(w[c]) - f64::from(g[c])).abs() > bound * f64::from(w[c]) + 1e-9)
        });
        let wrong = wrong.count();
        eprintln!("{panes} panes, {lights} lights, stairs {stairs}: {} dropped, {wrong} wrong", rendered.dropped);
        assert!(want.rgba[0][0] > 1.0, "nothing is lit");
        assert!(wrong <= rendered.dropped as usize, "{panes} panes, {lights} lights: wrong in silence");
        assert!(rendered.dropped <= 64);
        if let Some(fits) = fits {
            let fits = fits || !gpu.device.limits_loops();
            assert_eq!(rendered.dropped == 0, fits, "{panes} panes, {lights} lights, stairs {stairs}");
        }
    }
}

#[test]
fn glass_beside_a_nearer_wall_is_lit_through_the_background_s_part_of_its_tile() {
    let gpu = Gpu::open();
    for projection in [etalon_testing::made::orthographic(1.0), etalon_testing::made::perspective(20.0)] {
        let scene = |dark: usize| {
            let mut made = Made::new("behind");
            // The wall ends in the midst of a tile of 16 pixels: column 24 of 64, seen in parallel.
            made.add(Shape::panel(4.0, 8.0), unlit([0.25; 3]), at(-2.25, 0.0, 0.0));
            let glass =
                Material { base_color: [1.0, 0.5, 0.25, 0.5], alpha_mode: AlphaMode::Blend, ..lambert([1.0; 3]) };
            made.add(Shape::panel(9.0, 5.0), glass, at(0.0, 0.0, -6.0));
            // It reaches the glass and not the wall.
            let position = DVec3::new(0.0, 0.0, -4.5);
            made.light([9.0; 3], LightKind::Point { position, range: Some(4.0) });
            for i in 0..dark {
                let position = DVec3::new(0.1 * i as f64, 0.0, -5.0);
                made.light([0.0; 3], LightKind::Point { position, range: Some(3.0) });
            }
            made.camera(DVec3::Z * 6.0, DVec3::ZERO, projection);
            made.0
        };
        let one = whole(&gpu, &scene(0), settings([64, 64]));
        let lists = whole(&gpu, &scene(15), settings([64, 64]));
        let wrong = bits(&one).iter().zip(bits(&lists)).filter(|(a, b)| **a != *b).count();
        eprintln!("{projection:?}: {wrong} pixels");
        let lit = one.rgba.iter().filter(|p| p[0] > 0.26 && p[3] == 0.5).count();
        assert!(lit > 500, "{projection:?}: {lit} pixels of lit glass");
        // Adding zeros is exact: the same bits.
        assert_eq!(wrong, 0, "{projection:?}: lists of lights show");
    }
}

/// The lists begin with one node a pixel. A pane over the whole picture fills them; a sliver that only the second
/// sample meets overflows them, so that this sample is drawn again. The second picture of the same renderer has room
/// from the start: it must be the same.
#[test]
fn a_sample_that_is_drawn_again_counts_once() {
    let gpu = Gpu::open();
    let size = [8, 8];
    let mut made = Made::new("overflow at the second sample");
    made.add(Shape::panel(16.0, 16.0), pane([0.5, 0.25, 1.0], 0.5), DAffine3::IDENTITY);
    // One unit is one pixel; samples lie at jitter(1, 4) from the centres of pixels, y down.
    let jitter = etalon::upload::view::jitter(1, 4);
    made.add(Shape::panel(0.05, 0.05), pane([1.0; 3], 0.5), at(0.5 + jitter.x, 0.5 - jitter.y, 1.0));
    made.front(4.0);
    let settings = Settings { knobs: knobs(&["samples=4"]), ..settings(size) };
    let mut renderer = gpu.renderer(&made.0, None, settings);
    let mut film = || {
        renderer.render(&made.0.cameras[0], &mut |_| ()).expect("a picture");
        renderer.film().expect("a film")
    };
    let (first, second) = (film(), film());
    assert_eq!(bits(&first), bits(&second));
    let brightest = first.rgba.iter().fold(0.0_f32, |most, p| most.max(p[3]));
    assert!(brightest > 0.5 && brightest < 0.7, "the sliver is seen by one sample of four: {brightest}");
}
