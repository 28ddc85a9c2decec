//! Parts of a picture: what rays brought that were first mirrored, and what those brought that first went through.

use etalon::frame::{Part, Rendered, Settings};
use etalon::image::Picture;
use etalon::optics::fresnel::fresnel_dielectric;
use etalon::plan::{Knobs, Model};
use etalon::scene::environment::Environment;
use etalon::scene::{AlphaMode, Camera, Material, Scene};
use etalon::study::{self, shape::Shape};
use etalon_testing::gpu::{Gpu, bits, knobs, settings};
use etalon_testing::made::{Made, at, lambert, pane, perspective, unlit};
use glam::{DAffine3, DVec3};

const BOTH: [Part; 2] = [Part::Reflection, Part::Refraction];

/// Rays for mirrors and glass, without shadows, and some other rungs.
fn traced(size: [u32; 2], more: &[&str]) -> Settings {
    let rungs = ["samples=1", "reflection=ray", "refraction=ray", "fresnel=exact", "absorption=path"];
    Settings { knobs: knobs(&[&rungs[..], more].concat()), ..settings(size) }
}

struct Shot {
    film: Picture,
    parts: [Option<Picture>; 2],
    rendered: Rendered,
    warnings: Vec<String>,
}

fn shot(gpu: &Gpu, scene: &Scene, environment: Option<&Environment>, settings: Settings, parts: &[Part]) -> Shot {
    let mut renderer = gpu.renderer(scene, environment, Settings { parts: parts.to_vec(), ..settings });
    let rendered = renderer.render(&scene.cameras[0], &mut |_| ()).expect("a picture");
    let film = renderer.film().expect("the film");
    let parts = BOTH.map(|part| renderer.part(part).expect("a part"));
    // Comparisons do not see NaN.
    let all = std::iter::once(&film).chain(parts.iter().flatten());
    assert!(all.flat_map(|picture| picture.rgba.iter().flatten()).all(|value| value.is_finite()));
    Shot { film, parts, rendered, warnings: renderer.warnings.clone() }
}

fn glass(n: f32) -> Material {
    Material { ior: n, metallic: 0.0, roughness: 0.0, transmission: 1.0, thickness: 1.0, ..Material::default() }
}

fn metal(roughness: f32) -> Material {
    Material { base_color: [0.9, 0.7, 0.5, 1.0], metallic: 1.0, roughness, ..Material::default() }
}

fn shining(color: [f32; 3]) -> Material {
    Material { emissive: color, specular: 0.0, ..lambert([0.0; 3]) }
}

/// What keeps a scene one for rays, whose surfaces are known more exactly, where everything else is without.
const OUT_OF_SIGHT: &str = "out of sight";

/// Whether rays take over all of a surface's light but what it emits.
fn is_traced(material: &Material) -> bool {
    if material.name == OUT_OF_SIGHT {
        return false;
    }
    material.transmission > 0.0 || material.metallic > 0.0 || material.clearcoat > 0.0
}

/// The same scene where such surfaces are black, as far as `which` says so: what is left of the picture where the
/// primary surface sends rays is its own light.
fn without(scene: &Scene, which: impl Fn(&Material) -> bool) -> Scene {
    let mut scene = scene.clone();
    for material in &mut scene.materials {
        if which(material) {
            let emissive = material.emissive;
            *material = Material { emissive, ..shining([0.0; 3]) };
        }
    }
    scene
}

/// Mirrors and glass, smooth and rough, before, beside and within each other, on a floor that an environment lights,
/// behind a blended pane. The smooth metal emits some light of its own; what a coat covers would be weakened by it.
fn crowd() -> Made {
    let mut made = Made::new("crowd");
    let mut random = etalon::optics::SplitMix64::new(5);
    let coated = Material { clearcoat: 1.0, ..shining([0.0; 3]) };
    let kinds = [
        glass(1.5),
        Material { roughness: 0.15, base_color: [0.6, 0.9, 0.8, 1.0], ..glass(1.33) },
        Material { thickness: 0.0, base_color: [0.9, 0.5, 0.5, 1.0], ..glass(1.5) },
        Material { emissive: [0.1, 0.2, 0.0], ..metal(0.0) },
        metal(0.15),
        coated,
        shining([2.0, 1.0, 0.5]),
        lambert([0.5, 0.6, 0.7]),
    ];
    for i in 0..40 {
        let place = at(random.between(-3.0, 3.0), random.between(-0.6, 1.0), random.between(-2.0, 1.0));
        let turn = DAffine3::from_rotation_y(random.between(0.0, 3.0));
        let edges = DVec3::new(random.between(0.2, 0.8), random.between(0.2, 0.8), random.between(0.2, 0.8));
        let shape = if i % 3 == 0 { Shape::sphere(0.35, 12) } else { Shape::cuboid(edges) };
        made.add(shape, kinds[i % kinds.len()].clone(), place * turn);
    }
    made.add(Shape::plane(12.0, 12.0, 1), lambert([0.5; 3]), at(0.0, -1.0, 0.0));
    made.add(Shape::panel(9.0, 3.0), metal(0.0), at(0.0, 0.5, -2.6));
    let hidden = Material { name: OUT_OF_SIGHT.to_owned(), ..metal(0.0) };
    made.add(Shape::cuboid(DVec3::splat(0.1)), hidden, at(0.0, -2.0, 0.0));
    made.add(Shape::panel(1.5, 4.0), pane([0.2, 0.3, 0.4], 0.4), at(0.7, 0.0, 2.0));
    made.camera(DVec3::new(0.0, 0.6, 5.0), DVec3::ZERO, perspective(36.0));
    made
}

/// Largest difference between a film and the sum of pictures, relative to the pixel's value where that is above 1.
fn worst_of_sum(film: &Picture, all: &[&Picture]) -> f64 {
    let mut worst = 0.0_f64;
    for (i, pixel) in film.rgba.iter().enumerate() {
        for (c, &value) in pixel.iter().enumerate().take(3) {
            let sum: f64 = all.iter().map(|picture| f64::from(picture.rgba[i][c])).sum();
            let want = f64::from(value);
            assert!(want.is_finite() && sum.is_finite(), "pixel {i}: {want} and {sum}");
            worst = worst.max((sum - want).abs() / want.max(1.0));
        }
    }
    worst
}

fn lit_pixels(picture: &Picture) -> usize {
    picture.rgba.iter().filter(|p| p[..3].iter().any(|&value| value > 1e-3)).count()
}

#[test]
fn a_picture_is_the_sum_of_its_parts_and_what_is_left_without_rays() {
    let gpu = Gpu::open();
    let scene = crowd().0;
    let sky = Environment::studio();
    for rungs in
        [&["samples=1"][..], &["samples=4", "interfaces=32"], &["samples=4", "interfaces=1", "fresnel=schlick"]]
    {
        let drawn = || traced([128, 72], rungs);
        let with = shot(&gpu, &scene, Some(&sky), drawn(), &BOTH);
        let rest = shot(&gpu, &without(&scene, is_traced), Some(&sky), drawn(), &[]);
        let [Some(reflection), Some(refraction)] = &with.parts else { panic!("two parts") };
        let worst = worst_of_sum(&with.film, &[&rest.film, reflection, refraction]);
        let lit = [reflection, refraction].map(lit_pixels);
        eprintln!("{rungs:?}: {worst:e}, pixels with reflection and refraction: {lit:?}");
        // Sums of some tens of f32 in another order.
        assert!(worst < 2e-6, "{rungs:?}: {worst:e}");
        assert!(lit.iter().all(|&many| many > 1000), "{lit:?}");
        assert!(rest.parts.iter().all(Option::is_none));
    }
}

/// Where bodies are laid over the picture of the opaque surfaces, what those mirror is bent and weakened with it.
#[test]
fn screen_space_refraction_bends_mirror_images_with_the_picture() {
    let gpu = Gpu::open();
    let scene = crowd().0;
    for refraction in ["refraction=screen", "refraction=off"] {
        let drawn = || traced([128, 72], &["samples=4", refraction]);
        let with = shot(&gpu, &scene, None, drawn(), &[Part::Reflection]);
        let opaque = |m: &Material| is_traced(m) && m.transmission == 0.0;
        let rest = shot(&gpu, &without(&scene, opaque), None, drawn(), &[]);
        let reflection = with.parts[0].as_ref().expect("a part");
        let worst = worst_of_sum(&with.film, &[&rest.film, reflection]);
        eprintln!("{refraction}: {worst:e}, {} pixels", lit_pixels(reflection));
        assert!(worst < 2e-6 && lit_pixels(reflection) > 500, "{refraction}: {worst:e}");
    }
}

#[test]
fn asking_for_parts_changes_neither_the_picture_nor_its_work() {
    let gpu = Gpu::open();
    let scenes = ["etalon", "pool", "nested", "blend"].map(|name| study::load(name).expect("a study scene"));
    for scene in scenes.into_iter().chain([crowd().0]) {
        let mut knobs = Knobs::of(Model::Recursive);
        knobs.set("samples=4").expect("a rung");
        let drawn = || Settings { size: [96, 54], knobs: knobs.clone(), ..Settings::default() };
        let none = shot(&gpu, &scene, None, drawn(), &[]);
        let with = shot(&gpu, &scene, None, drawn(), &BOTH);
        assert!(bits(&none.film) == bits(&with.film), "{}", scene.name);
        assert_eq!(none.rendered.display, with.rendered.display, "{}", scene.name);
        assert_eq!(none.rendered.work, with.rendered.work, "{}", scene.name);
        assert_eq!(none.rendered.dropped, with.rendered.dropped, "{}", scene.name);
        let extra = |shot: &Shot| shot.rendered.passes.iter().filter(|pass| pass.name.contains("alone")).count();
        assert_eq!(extra(&none), 0);
        // One part does not depend on whether the other is asked for.
        let one = shot(&gpu, &scene, None, drawn(), &[Part::Refraction]);
        assert!(one.parts[0].is_none());
        let [a, b] = [&one, &with].map(|shot| bits(shot.parts[1].as_ref().expect("a part")));
        assert!(a == b, "{}", scene.name);
    }
}

/// A pane between a red wall behind the eye and a green one before it. The shares of both in what goes through: at each
/// face Fresnel's F is mirrored, and branches that weigh less than 1/512 are not followed.
fn through_a_pane(f: f64) -> ([f64; 2], bool) {
    let faintest = 1.0 / 512.0;
    let mut near = false;
    let mut follows = |weight: f64| {
        near |= (weight / faintest - 1.0).abs() < 1e-4;
        weight >= faintest
    };
    let (mut inside, mut shares) = (1.0 - f, [0.0; 2]);
    // Even faces let out to the green wall, odd ones to the red.
    for face in 0..30 {
        if !follows(inside) {
            break;
        }
        let out = inside * (1.0 - f);
        shares[1 - face % 2] += if follows(out) { out } else { 0.0 };
        inside *= f;
    }
    (shares, near)
}

#[test]
fn a_pane_mirrors_f_of_what_lies_before_it_and_lets_the_rest_through() {
    let gpu = Gpu::open();
    let size = [96, 72];
    for n in [1.333_f32, 1.5, 2.4] {
        let mut made = Made::new("pane");
        made.add(Shape::cuboid(DVec3::new(40.0, 40.0, 0.25)), glass(n), at(0.0, 0.0, -0.125));
        made.add(Shape::panel(60.0, 60.0), shining([1.0, 0.0, 0.0]), at(0.0, 0.0, 2.0));
        made.add(Shape::panel(60.0, 60.0), shining([0.0, 1.0, 0.0]), at(0.0, 0.0, -2.0));
        made.camera(DVec3::Z, DVec3::ZERO, perspective(130.0));
        let Shot { film, parts, .. } = shot(&gpu, &made.0, None, traced(size, &["interfaces=32"]), &BOTH);
        let [Some(reflection), Some(refraction)] = &parts else { panic!("two parts") };
        let (mut worst, mut worst_through, mut compared, mut steepest) = (0.0_f64, 0.0_f64, 0, 0.0_f64);
        for i in 0..film.rgba.len() {
            let d = direction(&made.0.cameras[0], size, i);
            let cos = -d.z;
            let f = fresnel_dielectric(cos, f64::from(n))[0];
            let ([red, green], near) = through_a_pane(f);
            if near {
                continue;
            }
            let [r, g, b] = [0, 1, 2].map(|c| f64::from(reflection.rgba[i][c]));
            assert!(g == 0.0 && b == 0.0, "pixel {i}: what is mirrored is red alone, not {g}, {b}");
            worst = worst.max((r / f - 1.0).abs());
            let [r, g, b] = [0, 1, 2].map(|c| f64::from(refraction.rgba[i][c]));
            worst_through = worst_through.max((r - red).abs()).max((g - green).abs()).max(b);
            compared += 1;
            steepest = steepest.max(cos.acos().to_degrees());
        }
        let sum = worst_of_sum(&film, &[reflection, refraction]);
        eprintln!("n = {n}: {worst:e}, through {worst_through:e}, sum {sum:e}, {compared} pixels to {steepest:.1}°");
        // As in tests/optics.rs: F of f32 to a few roundings; the rest is a product of some of them.
        assert!(worst < 4e-6 && worst_through < 4e-6 && sum < 1e-6, "n = {n}");
        assert!(compared > 6000 && steepest > 65.0);
    }
}

/// Towards the middle of a pixel.
fn direction(camera: &Camera, size: [u32; 2], i: usize) -> DVec3 {
    let view = etalon::upload::view::View::new(camera, size, None);
    let [width, height] = size.map(f64::from);
    let x = (f64::from(i as u32 % size[0]) + 0.5) / width * 2.0 - 1.0;
    let y = 1.0 - (f64::from(i as u32 / size[0]) + 0.5) / height * 2.0;
    let [right, up, forward] = view.axes;
    (forward + right * (x * view.half.x) + up * (y * view.half.y)).normalize()
}

#[test]
fn a_mirror_has_no_refraction_and_a_mesh_of_index_one_no_reflection() {
    let gpu = Gpu::open();
    for (material, part) in [(metal(0.0), 0), (glass(1.0), 1)] {
        let mut made = Made::new("one part");
        made.add(Shape::cuboid(DVec3::new(2.0, 2.0, 0.5)), material, DAffine3::from_rotation_y(0.3));
        made.add(Shape::panel(60.0, 60.0), shining([1.0; 3]), at(0.0, 0.0, 6.0));
        made.add(Shape::panel(3.0, 3.0), shining([1.0; 3]), at(0.0, 0.0, -2.0));
        // Seen in the mirror alone: what happens to light before the last surface does not count.
        made.add(Shape::sphere(0.7, 16), glass(1.5), at(2.2, 0.0, 3.5));
        made.camera(DVec3::Z * 4.0, DVec3::ZERO, perspective(30.0));
        let parts = shot(&gpu, &made.0, None, traced([64, 36], &[]), &BOTH).parts.map(|part| part.expect("a part"));
        let lit = parts.each_ref().map(|part| part.rgba.iter().filter(|p| p[..3] != [0.0; 3]).count());
        eprintln!("{lit:?}");
        assert!(lit[part] > 500 && lit[1 - part] == 0, "{lit:?}");
    }
}

#[test]
fn where_no_ray_is_sent_parts_are_zero_and_that_is_said() {
    let gpu = Gpu::open();
    let mut made = Made::new("matte");
    made.add(Shape::sphere(0.5, 16), lambert([0.5; 3]), DAffine3::IDENTITY);
    made.add(Shape::panel(1.0, 1.0), unlit([0.5; 3]), at(1.0, 0.0, 0.0));
    let transparency = Material { alpha_mode: AlphaMode::Blend, ..lambert([0.5, 0.5, 0.5]) };
    made.add(Shape::panel(0.5, 0.5), transparency, at(0.0, 0.0, 1.0));
    made.camera(DVec3::Z * 3.0, DVec3::ZERO, perspective(50.0));
    let sky = Environment::constant([1.0; 3]);
    let drawn = || traced([64, 36], &["samples=4"]);
    let matte = shot(&gpu, &made.0, Some(&sky), drawn(), &BOTH);
    for part in matte.parts {
        let part = part.expect("a part");
        assert!(part.rgba.iter().all(|p| p[..3] == [0.0; 3]));
    }
    assert!(lit_pixels(&matte.film) > 1000);
    let said = |part: &str, warnings: &[String]| warnings.iter().any(|w| w.contains(part) && w.contains("layer is 0"));
    assert!(said("reflection", &matte.warnings) && said("refraction", &matte.warnings), "{:?}", matte.warnings);
    // A mirror calls for the one and not for the other.
    made.add(Shape::sphere(0.2, 8), metal(0.0), at(-1.0, 0.0, 0.0));
    let mirror = shot(&gpu, &made.0, Some(&sky), drawn(), &BOTH);
    assert!(!said("reflection", &mirror.warnings) && said("refraction", &mirror.warnings), "{:?}", mirror.warnings);
    assert!(shot(&gpu, &made.0, Some(&sky), drawn(), &[]).warnings.is_empty());
    // With other rungs no ray makes such a layer, whatever the scene.
    for (part, rung) in [(Part::Reflection, "reflection=environment"), (Part::Refraction, "refraction=off")] {
        let settings = Settings { parts: vec![part], ..traced([64, 36], &[rung]) };
        let refused = etalon::frame::Renderer::new(&gpu.device, made.0.clone(), None, settings);
        let sentence = refused.err().map(|error| error.to_string()).unwrap_or_default();
        assert!(sentence.contains(rung) && sentence.contains(part.name()), "{sentence}");
    }
}
