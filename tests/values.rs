//! What a material says of itself is what its picture shows: lobes, layers and Fresnel's curves of all three models
//! against f64 closed forms (crates/testing/src/lobe.rs), on a dome whose facets stand at many angles to the eye and
//! the light; and exchanging the two.

use etalon::frame::Settings;
use etalon::image::Picture;
use etalon::plan::Model;
use etalon::plan::rungs::{Brdf, Fresnel};
use etalon::scene::environment::Environment;
use etalon::scene::{AlphaMode, Camera, LightKind, Material, Projection, Scene};
use etalon::study::shape::Shape;
use etalon::transport::layers::{Boundary, Layer, Layers, Media};
use etalon_testing::gpu::Gpu;
use etalon_testing::lobe::{DOME, Facet, MODELS, Rungs, dome, model, reflected, worst};
use etalon_testing::made::{Made, at, lambert, orthographic};
use glam::{DAffine3, DVec3};

/// Towards lights: one that lies before the dome, one beside it, where half of the facets are turned away.
const LIGHTS: [DVec3; 2] = [DVec3::new(0.2, 0.5, 1.0), DVec3::new(-0.7, 0.15, 0.4)];
const IRRADIANCE: [f32; 3] = [3.0, 2.0, 5.0];
const GOLD: [f32; 4] = [0.9, 0.6, 0.3, 1.0];

fn metal(base_color: [f32; 4], roughness: f32) -> Material {
    Material { base_color, metallic: 1.0, roughness, ..Material::default() }
}

fn plastic(base_color: [f32; 3], roughness: f32) -> Material {
    Material { specular: 1.0, roughness, ..lambert(base_color) }
}

/// Rough surfaces of every kind without layers. None reflects more than it receives, diffuse part and F0 together, so
/// that no bound on the energy of a model has anything to take away.
fn rough() -> [Material; 6] {
    let tinted =
        Material { ior: 1.8, specular: 0.6, specular_color: [1.0, 0.5, 0.25], ..plastic([0.2, 0.5, 0.3], 0.55) };
    let half = Material { metallic: 0.5, ..plastic([0.5, 0.3, 0.7], 0.45) };
    let rubber = plastic([0.3, 0.2, 0.1], 1.0);
    [plastic([0.6, 0.4, 0.2], 0.35), tinted, metal(GOLD, 0.3), metal([0.5, 0.7, 0.9, 1.0], 0.6), half, rubber]
}

/// The dome under one light, and how far it is off what the formulas say.
fn lit(gpu: &Gpu, materials: &[Material], light: DVec3, of: Model, choices: &[&str], floor: f64) -> f64 {
    let (mut scene, facets) = dome(materials);
    let l = light.normalize();
    let mut made = Made(std::mem::take(&mut scene));
    made.light(IRRADIANCE, LightKind::Directional { direction: -l });
    let settings = model(of, DOME, choices);
    let rungs = Rungs { brdf: settings.knobs.brdf, exact: settings.knobs.fresnel == Fresnel::Exact };
    let film = gpu.film(&made.0, settings);
    eprint!("{of:?} {choices:?} ");
    worst(&film, &facets, floor, |facet: &Facet| {
        let m = &materials[facet.material];
        reflected(m, rungs, facet.n, l, DVec3::Z) * etalon_testing::lobe::rgb(IRRADIANCE)
    })
}

/// A facet's normal and the light's direction have roundings of 1e-7, which a lobe of exponent 245 (roughness 0.3)
/// makes some 3e-5 of at half of its height, where sin²δ counts 245 times over; and pixels count from 1e-3 of the
/// brightest on.
const LOBES: f64 = 1e-4;
const FAINT: f64 = 1e-3;

#[test]
fn phong_rungs_reflect_a_light_as_the_lecture_says() {
    let gpu = Gpu::hasty();
    for (of, light) in MODELS.into_iter().zip([LIGHTS[0], LIGHTS[1], LIGHTS[0]]) {
        for brdf in ["brdf=blinn-phong", "brdf=blinn-phong-reciprocal"] {
            let error = lit(&gpu, &rough(), light, of, &[brdf, "fresnel=schlick"], FAINT);
            assert!(error < LOBES, "{of:?}, {brdf}: {error:e}");
        }
    }
}

#[test]
fn ggx_reflects_a_light_as_walter_and_heitz_say() {
    let gpu = Gpu::hasty();
    for (of, light) in MODELS.into_iter().zip([LIGHTS[1], LIGHTS[0], LIGHTS[1]]) {
        let error = lit(&gpu, &rough(), light, of, &["brdf=ggx", "fresnel=schlick"], FAINT);
        assert!(error < LOBES, "{of:?}: {error:e}");
    }
}

#[test]
fn compensated_ggx_gives_back_what_single_scattering_loses() {
    let gpu = Gpu::hasty();
    for of in MODELS {
        let error = lit(&gpu, &rough(), LIGHTS[0], of, &["brdf=ggx-multi", "fresnel=schlick"], FAINT);
        // The table of directional reflectance E is good to 4e-3 (src/upload/split_sum.rs), and E is 0.6 at least
        // here.
        assert!(error < 1e-2, "{of:?}: {error:e}");
    }
}

/// n and κ of gold, copper and silver at red, green and blue, or near it: what counts is that no two numbers are alike.
const METALS: [[[f32; 2]; 3]; 3] = [
    [[0.18, 3.43], [0.42, 2.35], [1.37, 1.77]],
    [[0.27, 3.61], [0.68, 2.63], [1.32, 2.29]],
    [[0.16, 3.93], [0.15, 3.19], [0.14, 2.55]],
];

fn conductor(index: [[f32; 2]; 3], roughness: f32) -> Material {
    // As a file's metal has it (crates/scene/src/gltf_extras.rs): its colour is what it reflects at normal incidence.
    let [r, g, b] = index.map(|[n, kappa]| etalon_testing::lobe::fresnel(1.0, n.into(), kappa.into()) as f32);
    Material { conductor: Some(index), ..metal([r, g, b, 1.0], roughness) }
}

#[test]
fn metals_by_n_and_kappa_and_dielectrics_by_n_reflect_as_fresnel_says_of_each_channel() {
    let gpu = Gpu::hasty();
    let [gold, copper, silver] = METALS.map(|index| conductor(index, 0.4));
    let dense = Material { ior: 2.4, ..plastic([0.1, 0.2, 0.3], 0.5) };
    let half = Material { metallic: 0.5, ..conductor(METALS[1], 0.6) };
    let materials = [gold, copper, silver, plastic([0.5, 0.4, 0.2], 0.4), dense, half];
    for (of, light) in MODELS.into_iter().zip([LIGHTS[1], LIGHTS[1], LIGHTS[0]]) {
        let error = lit(&gpu, &materials, light, of, &["brdf=ggx", "fresnel=exact"], FAINT);
        assert!(error < LOBES, "{of:?}: {error:e}");
    }
}

/// A dome in light that is the same from everywhere: what is mirrored of it is the reflectance.
fn mirrored(gpu: &Gpu, materials: &[Material], of: Model, choices: &[&str]) -> f64 {
    let (scene, facets) = dome(materials);
    let environment = Environment::constant([1.0, 0.5, 2.0]);
    let settings = model(of, DOME, choices);
    let exact = settings.knobs.fresnel == Fresnel::Exact;
    let (_, film) = gpu.shot(&scene, Some(&environment), settings);
    eprint!("{of:?} {choices:?} ");
    worst(&film, &facets, 1e-2, |facet| {
        let m = &materials[facet.material];
        let f = etalon_testing::lobe::dielectric(m, exact, facet.n.z)
            .lerp(etalon_testing::lobe::metal(m, exact, facet.n.z), m.metallic.into());
        f * DVec3::new(1.0, 0.5, 2.0)
    })
}

#[test]
fn smooth_mirrors_show_fresnels_curve_over_all_angles() {
    let gpu = Gpu::hasty();
    let [gold, copper, silver] = METALS.map(|index| conductor(index, 0.0));
    let black = |ior| Material { ior, ..plastic([0.0; 3], 0.0) };
    let materials = [gold, copper, silver, black(1.5), black(2.4), metal(GOLD, 0.0)];
    for of in [Model::Recursive, Model::Global] {
        for fresnel in ["fresnel=exact", "fresnel=schlick"] {
            // Fresnel's equations in f32, and their cosine: a dozen roundings.
            let error = mirrored(&gpu, &materials, of, &[fresnel]);
            assert!(error < 1e-5, "{of:?}, {fresnel}: {error:e}");
        }
    }
    // Out of the table of directional reflectance, good to 4e-3 of what is 1.
    let error = mirrored(&gpu, &materials, Model::Local, &["fresnel=schlick"]);
    assert!(error < 2e-2, "{error:e}");
}

/// Over what is black, all that a coat in such light shows is its own reflectance; over a mirror, what that reflects
/// besides, less it.
#[test]
fn a_smooth_coat_mirrors_what_is_around_and_takes_that_from_its_base() {
    let gpu = Gpu::hasty();
    let coat = |clearcoat: f32, base: Material| Material { clearcoat, clearcoat_roughness: 0.0, ..base };
    let black = lambert([0.0; 3]);
    let materials =
        [coat(1.0, black.clone()), coat(0.6, black), coat(0.6, metal(GOLD, 0.0)), coat(1.0, plastic([0.0; 3], 0.0))];
    let (scene, facets) = dome(&materials);
    for of in MODELS {
        // Paths follow the coat or the base.
        let samples = if of == Model::Global { "samples=256" } else { "samples=1" };
        let settings = model(of, DOME, &["fresnel=schlick", samples]);
        let (_, film) = gpu.shot(&scene, Some(&Environment::constant([1.0; 3])), settings);
        let of_materials = |which: [usize; 2]| -> Vec<Facet> {
            let chosen = facets.iter().filter(|facet| which.contains(&facet.material));
            chosen.map(|facet| Facet { pixels: facet.pixels.clone(), ..*facet }).collect()
        };
        let expected = |facet: &Facet| {
            let m = &materials[facet.material];
            let coat = f64::from(m.clearcoat) * etalon_testing::lobe::schlick(DVec3::splat(0.04), 1.0, facet.n.z).x;
            let f = etalon_testing::lobe::dielectric(m, false, facet.n.z)
                .lerp(etalon_testing::lobe::metal(m, false, facet.n.z), m.metallic.into());
            f * (1.0 - coat) + coat
        };
        // The deferred pass has the coat's normal to 6.5e-5, and at 78° the curve falls by 2 per radian of what is 0.4;
        // the table is good to 4e-3 of what is 1 (here 0.04).
        let bound = if of == Model::Local { 2e-2 } else { 4e-4 };
        eprint!("{of:?} black ");
        let error = worst(&film, &of_materials([0, 1]), 1e-3, expected);
        assert!(error < bound, "{of:?}, black: {error:e}");
        // 256 even points of what is 1 or F: 1/256 of a share, twice.
        let bound = if of == Model::Global { 2e-2 } else { bound };
        eprint!("{of:?} mirrors ");
        let error = worst(&film, &of_materials([2, 3]), 1e-3, expected);
        assert!(error < bound, "{of:?}, mirrors: {error:e}");
    }
}

/// The twin that photons and the picked pixel use has the material of pictures: coat and base reflect such light alike.
#[test]
fn what_the_host_says_of_coats_and_bases_is_what_pictures_show() {
    let gpu = Gpu::hasty();
    let coat = |clearcoat: f32, base: Material| Material { clearcoat, clearcoat_roughness: 0.0, ..base };
    let plastic = |ior, specular| Material { ior, specular, ..plastic([0.0; 3], 0.0) };
    let half = Material { metallic: 0.5, ..plastic(1.8, 0.9) };
    let materials = [
        plastic(1.5, 0.6),
        coat(1.0, plastic(1.5, 1.0)),
        coat(0.6, plastic(2.4, 0.5)),
        coat(0.5, metal([0.7, 0.7, 0.7, 1.0], 0.0)),
        coat(0.8, Material { specular_color: [0.9; 3], ..half }),
        coat(1.0, lambert([0.0; 3])),
    ];
    let (scene, facets) = dome(&materials);
    for of in [Model::Recursive, Model::Global] {
        // All is grey: whatever layer a path chooses has the same weight.
        let settings = model(of, DOME, &["fresnel=exact"]);
        let (_, film) = gpu.shot(&scene, Some(&Environment::constant([1.0; 3])), settings);
        eprint!("{of:?} ");
        let error = worst(&film, &facets, 1e-2, |facet| {
            let m = &materials[facet.material];
            let ior = f64::from(m.ior);
            let air = Boundary { before: 1.0, behind: ior, ior, body: false, hidden: false, beyond: Media::default() };
            let layers = Layers::of(m, &air, facet.n.z);
            layers.share(Layer::Coat) + layers.share(Layer::Base)
        });
        // As for Fresnel's curve alone.
        assert!(error < 1e-5, "{of:?}: {error:e}");
    }
}

#[test]
fn a_clear_coat_of_index_one_and_a_half_reflects_and_takes_that_from_its_base() {
    let gpu = Gpu::hasty();
    let coat =
        |clearcoat: f32, clearcoat_roughness: f32, base: Material| Material { clearcoat, clearcoat_roughness, ..base };
    let materials = [
        coat(1.0, 0.3, lambert([0.0; 3])),
        coat(0.4, 0.5, lambert([0.0; 3])),
        coat(1.0, 0.6, plastic([0.6, 0.4, 0.2], 0.4)),
        coat(0.7, 0.35, metal(GOLD, 0.5)),
    ];
    for (of, light) in MODELS.into_iter().zip([LIGHTS[0], LIGHTS[1], LIGHTS[1]]) {
        for brdf in ["brdf=ggx", "brdf=blinn-phong-reciprocal"] {
            // The deferred pass has the coat's normal to 6.5e-5 (octahedra of 2 x 16 bits): a lobe of α = 0.09 falls by
            // 22 per radian of its half vector, and a cosine of the twentieth of the brightest or more by 20.
            let (floor, bound) = if of == Model::Global { (FAINT, LOBES) } else { (0.05, 3e-3) };
            let error = lit(&gpu, &materials, light, of, &[brdf, "fresnel=schlick"], floor);
            assert!(error < bound, "{of:?}, {brdf}: {error:e}");
        }
    }
}

#[test]
fn a_clear_coat_keeps_from_the_eye_what_it_reflects_of_emitted_light() {
    let gpu = Gpu::hasty();
    let glow = [4.0, 1.0, 0.25];
    let coat = |clearcoat: f32, clearcoat_roughness: f32| Material {
        clearcoat,
        clearcoat_roughness,
        emissive: glow,
        ..lambert([0.0; 3])
    };
    let materials = [coat(1.0, 0.0), coat(0.5, 0.0), coat(1.0, 0.7), coat(0.0, 0.0)];
    let (scene, facets) = dome(&materials);
    for of in MODELS {
        let film = gpu.film(&scene, model(of, DOME, &["brdf=ggx", "fresnel=schlick"]));
        let error = worst(&film, &facets, 1e-3, |facet| {
            let coat = f64::from(materials[facet.material].clearcoat);
            etalon_testing::lobe::rgb(glow)
                * (1.0 - coat * etalon_testing::lobe::schlick(DVec3::splat(0.04), 1.0, facet.n.z).x)
        });
        // A cosine to 1e-7, five times over; the deferred pass has the coat's normal to 6.5e-5 (octahedra of 2 x 16
        // bits), and the curve's slope is 2 at 78°.
        let bound = if of == Model::Global { 3e-6 } else { 1.5e-4 };
        assert!(error < bound, "{of:?}: {error:e}");
    }
}

/// BRDFs of four surfaces in one plane, by channel: radiance over irradiance, from a picture seen along −`v` in light
/// along −`l`.
fn brdfs(gpu: &Gpu, materials: &[Material; 4], of: Model, choices: &[&str], l: DVec3, v: DVec3) -> [DVec3; 4] {
    let mut made = Made::new("exchange");
    for (i, material) in materials.iter().enumerate() {
        made.add(Shape::panel(1.9, 1.9), material.clone(), at(2.0 * i as f64 - 3.0, 0.0, 0.0));
    }
    made.camera(v * 12.0, DVec3::ZERO, orthographic(2.0));
    made.light([1.0; 3], LightKind::Directional { direction: -l });
    let size = [48, 24];
    let film = gpu.film(&made.0, model(of, size, choices));
    let eye = made.0.cameras[0].world_from_camera.inverse();
    [0, 1, 2, 3].map(|i| {
        let middle = eye.transform_point3(DVec3::X * (2.0 * f64::from(i) - 3.0));
        let [x, y] = [24.0 + 6.0 * middle.x, 12.0 - 6.0 * middle.y];
        let [r, g, b, _] = film.rgba[(y as u32 * size[0] + x as u32) as usize].map(f64::from);
        DVec3::new(r, g, b) / l.z
    })
}

const HERE: DVec3 = DVec3::new(0.15, 0.45, 0.9);
const THERE: DVec3 = DVec3::new(-0.5, -0.6, 0.55);

#[test]
fn light_and_camera_may_be_exchanged() {
    let gpu = Gpu::hasty();
    let [a, b] = [HERE.normalize(), THERE.normalize()];
    let coated = Material { clearcoat: 0.8, clearcoat_roughness: 0.4, ..plastic([0.6, 0.4, 0.2], 0.6) };
    let materials =
        [plastic([0.6, 0.4, 0.2], 0.5), metal(GOLD, 0.4), coated, Material { metallic: 0.5, ..plastic([0.3; 3], 0.7) }];
    for (of, brdf) in [
        (Model::Local, "brdf=ggx"),
        (Model::Global, "brdf=ggx"),
        (Model::Recursive, "brdf=blinn-phong-reciprocal"),
        (Model::Global, "brdf=blinn-phong-reciprocal"),
    ] {
        for fresnel in ["fresnel=schlick"] {
            let choices = [brdf, fresnel];
            let [there, back] = [(a, b), (b, a)].map(|(l, v)| brdfs(&gpu, &materials, of, &choices, l, v));
            for (i, (there, back)) in there.into_iter().zip(back).enumerate() {
                let off = ((there - back) / there.max(back)).abs().max_element();
                eprintln!("{of:?}, {brdf}, material {i}: {there} and {back}, {off:.1e}");
                assert!(there.min_element() > 1e-4, "{of:?}, {brdf}, material {i}: {there}");
                // Roundings of the same numbers.
                assert!(off < 2e-5, "{of:?}, {brdf}, material {i}: {there} and {back}");
            }
        }
    }
}

/// B5 has no cosine beside its lobe, so that its BRDF has 1/cosθ_l: f(L,V)/f(V,L) = cosθ_v/cosθ_l.
#[test]
fn blinn_phong_is_off_by_the_ratio_of_the_cosines_when_they_are() {
    let gpu = Gpu::hasty();
    let [a, b] = [HERE.normalize(), THERE.normalize()];
    let materials = [metal(GOLD, 0.4), metal(GOLD, 0.7), metal([0.5, 0.7, 0.9, 1.0], 0.5), metal([1.0; 4], 1.0)];
    for of in [Model::Local, Model::Global] {
        let choices = ["brdf=blinn-phong", "fresnel=schlick"];
        let [there, back] = [(a, b), (b, a)].map(|(l, v)| brdfs(&gpu, &materials, of, &choices, l, v));
        for (there, back) in there.into_iter().zip(back) {
            let off = (there / back / (b.z / a.z) - 1.0).abs().max_element();
            assert!(off < 2e-5, "{of:?}: {there} and {back}, not {} times it", b.z / a.z);
        }
    }
}

/// Shared by tests that look at one value of a picture that is the same all over.
fn only(film: &Picture) -> DVec3 {
    let middle = film.rgba[film.rgba.len() / 2 + film.width as usize / 2];
    DVec3::new(middle[0].into(), middle[1].into(), middle[2].into())
}

/// A panel that fills a parallel view, in light that comes from the eye: L = V = N.
fn head_on(material: Material) -> Scene {
    let mut made = Made::new("head on");
    made.add(Shape::panel(4.0, 4.0), material, at(0.0, 0.0, 0.0));
    made.front(0.5);
    made.light([std::f32::consts::PI; 3], LightKind::Directional { direction: DVec3::NEG_Z });
    made.0
}

/// π F0 D(0)/4 = F0/(4α²) of a lobe that is looked at from where the light is.
#[test]
fn at_normal_incidence_a_lobe_is_f0_over_four_alpha_squared() {
    let gpu = Gpu::hasty();
    let draw = |of: Model, material: &Material| -> DVec3 {
        let settings: Settings = model(of, [8, 8], &["brdf=ggx", "fresnel=schlick"]);
        only(&gpu.film(&head_on(material.clone()), settings))
    };
    let black = lambert([0.0; 3]);
    let (water, tinted) = (f64::from(1.333_f32), DVec3::new(1.0, 0.5, 0.25));
    let water = ((water - 1.0) / (water + 1.0)).powi(2);
    for of in [Model::Local, Model::Global] {
        for (what, material, f0, roughness) in [
            ("ior 1.5", Material { specular: 1.0, roughness: 0.5, ..black.clone() }, DVec3::splat(0.04), 0.5_f64),
            (
                "ior 1.333",
                Material { specular: 1.0, ior: 1.333, roughness: 0.5, ..black.clone() },
                DVec3::splat(water),
                0.5,
            ),
            ("specular", Material { specular: 0.25, roughness: 0.5, ..black.clone() }, DVec3::splat(0.01), 0.5),
            (
                "specular colour",
                Material { specular: 1.0, specular_color: [1.0, 0.5, 0.25], roughness: 0.25, ..black.clone() },
                tinted * 0.04,
                0.25,
            ),
            ("coat", Material { clearcoat: 1.0, clearcoat_roughness: 0.25, ..black.clone() }, DVec3::splat(0.04), 0.25),
        ] {
            let (found, wanted) = (draw(of, &material), f0 / (4.0 * roughness.powi(4)));
            let off = (found / wanted - 1.0).abs().max_element();
            eprintln!("{of:?}, {what}: {found}, expected {wanted}, {off:.1e}");
            // A handful of roundings.
            assert!(off < 2e-6, "{of:?}, {what}: {found}, not {wanted}");
        }
    }
}

/// Surfaces of which one is coated and glows besides.
fn several() -> [Material; 4] {
    let coated = Material {
        clearcoat: 0.8,
        clearcoat_roughness: 0.5,
        emissive: [0.5, 1.0, 0.25],
        ..plastic([0.6, 0.4, 0.2], 0.6)
    };
    [
        plastic([0.6, 0.4, 0.2], 0.4),
        coated,
        metal(GOLD, 0.5),
        Material { metallic: 0.5, ..plastic([0.5, 0.3, 0.7], 0.45) },
    ]
}

/// What such a facet sends along `v`, in light along −`l`: `share` of its diffuse ground is left.
fn sent(m: &Material, rungs: Rungs, n: DVec3, l: DVec3, v: DVec3, share: f64) -> DVec3 {
    let kept = |m: &Material| reflected(m, rungs, n, l, v) * etalon_testing::lobe::rgb(IRRADIANCE);
    let without = Material { base_color: [0.0; 4], ..m.clone() };
    let diffuse = if m.metallic == 0.0 { kept(m) - kept(&without) } else { DVec3::ZERO };
    let coat = f64::from(m.clearcoat) * etalon_testing::lobe::schlick(DVec3::splat(0.04), 1.0, n.dot(v)).x;
    kept(m) - diffuse * (1.0 - share) + etalon_testing::lobe::rgb(m.emissive) * (1.0 - coat)
}

/// Towards a light that comes from above, past what stands before the dome.
const ABOVE: DVec3 = DVec3::new(0.1, 0.9, 0.3);

/// The dome with something before it.
fn with(materials: &[Material], more: impl FnOnce(&mut Made)) -> (Scene, Vec<Facet>) {
    let (scene, facets) = dome(materials);
    let mut made = Made(scene);
    made.light(IRRADIANCE, LightKind::Directional { direction: -ABOVE.normalize() });
    more(&mut made);
    (made.0, facets)
}

#[test]
fn what_a_mirror_shows_and_what_a_pane_lets_through_is_lit_as_what_is_seen_without_them() {
    let gpu = Gpu::hasty();
    let materials = several();
    let tilted = DAffine3::from_translation(DVec3::Z * 20.0) * DAffine3::from_rotation_y(-0.75 * std::f64::consts::PI);
    let (behind, facets) = with(&materials, |made| {
        made.add(Shape::panel(60.0, 40.0), metal([1.0; 4], 0.0), tilted);
        let eye = DVec3::new(-30.0, 0.0, 20.0);
        let projection = made.0.cameras[0].projection;
        made.0.cameras = vec![Camera {
            projection: projection_to(projection, 90.0),
            ..etalon_testing::made::looking(eye, eye + DVec3::X)
        }];
    });
    let pane = Material { transmission: 1.0, roughness: 0.0, specular: 0.0, ..lambert([1.0; 3]) };
    let (through, _) = with(&materials, |made| made.add(Shape::panel(31.0, 31.0), pane, at(0.0, 0.0, 8.0)));
    for (what, scene) in [("mirror", &behind), ("pane", &through)] {
        for of in [Model::Recursive, Model::Global] {
            // Paths end at the dome, which sees itself in the mirror.
            let interfaces = if what == "mirror" { "interfaces=2" } else { "interfaces=8" };
            let choices = ["brdf=ggx", "fresnel=schlick", "refraction=ray", interfaces];
            // The mirror would send light to the dome, and the dome to itself.
            let path = of == Model::Global;
            let more = if path { ["samples=4", "indirect=path"] } else { ["samples=1", "indirect=off"] };
            let mut film = gpu.film(scene, model(of, DOME, &[&choices[..], &more].concat()));
            if what == "mirror" {
                film.rgba.chunks_exact_mut(DOME[0] as usize).for_each(|row| row.reverse());
            }
            eprint!("{of:?}, {what}: ");
            let rungs = Rungs { brdf: Brdf::Ggx, exact: false };
            let error = worst(&film, &facets, 1e-2, |facet| {
                sent(&materials[facet.material], rungs, facet.n, ABOVE.normalize(), DVec3::Z, 1.0)
            });
            // The mirror is turned by sines in f32, 1e-7, and its stored normal by as much: see LOBES.
            assert!(error < LOBES, "{of:?}, {what}: {error:e}");
        }
    }
}

fn projection_to(projection: Projection, far: f64) -> Projection {
    match projection {
        Projection::Orthographic { half_height, near, .. } => Projection::Orthographic { half_height, near, far },
        perspective => perspective,
    }
}

#[test]
fn what_blends_and_what_lets_light_through_is_lit_as_what_is_opaque() {
    let gpu = Gpu::hasty();
    let blended = several().map(|m| {
        let [r, g, b, _] = m.base_color;
        Material { base_color: [r, g, b, 0.75], alpha_mode: AlphaMode::Blend, ..m }
    });
    let [plain, coated, ..] = several();
    let sheets = [Material { transmission: 0.5, ..plain }, Material { transmission: 0.25, ..coated }];
    for of in [Model::Local, Model::Recursive] {
        for (what, materials) in [("blended", &blended[..]), ("sheets", &sheets[..])] {
            // Rays through rough sheets are spread, and find what the far side of the dome lets through.
            if (of, what) == (Model::Recursive, "sheets") {
                continue;
            }
            // Light behind rough sheets shines through them (tests/light.rs): here it comes from the viewer.
            let l = if what == "sheets" { DVec3::Z } else { ABOVE.normalize() };
            let (mut scene, facets) = with(materials, |_| ());
            scene.lights[0].kind = LightKind::Directional { direction: -l };
            let film = gpu.film(&scene, model(of, DOME, &["brdf=ggx", "fresnel=schlick"]));
            eprint!("{of:?}, {what}: ");
            let rungs = Rungs { brdf: Brdf::Ggx, exact: false };
            let error = worst(&film, &facets, 0.02, |facet| {
                let m = &materials[facet.material];
                let alpha = if what == "blended" { 0.75 } else { 1.0 };
                sent(m, rungs, facet.n, l, DVec3::Z, 1.0 - f64::from(m.transmission)) * alpha
            });
            // The coat's normal is kept in 2 x 16 bits: see there.
            assert!(error < 3e-3, "{of:?}, {what}: {error:e}");
        }
    }
}

/// Through a smooth sheet goes what its one surface does not reflect, at every angle.
#[test]
fn a_slanted_sheet_lets_through_what_it_does_not_reflect() {
    let gpu = Gpu::hasty();
    let sheet = |ior: f32, base: [f32; 3]| Material { transmission: 1.0, ior, ..plastic(base, 0.0) };
    let half = Material { transmission: 0.5, ..sheet(1.5, [1.0; 3]) };
    let materials = [sheet(1.5, [1.0; 3]), sheet(1.8, [0.5, 0.8, 0.2]), half];
    let behind = [3.0, 2.0, 1.0];
    let (scene, facets) = dome(&materials);
    let mut made = Made(scene);
    // As wide as the rings up to 66°: what is mirrored misses it.
    let up = DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2);
    made.add(Shape::disc(12.3, 96), etalon_testing::made::unlit(behind), at(0.0, 0.0, -19.5) * up);
    let facets: Vec<Facet> = facets.into_iter().filter(|facet| facet.n.z > 0.3).collect();
    for (of, fresnel) in [
        (Model::Local, "fresnel=schlick"),
        (Model::Recursive, "fresnel=schlick"),
        (Model::Recursive, "fresnel=exact"),
        (Model::Global, "fresnel=exact"),
    ] {
        let samples = if of == Model::Global { "samples=64" } else { "samples=1" };
        let film = gpu.film(&made.0, model(of, DOME, &[fresnel, samples]));
        eprint!("{of:?}, {fresnel}: ");
        let error = worst(&film, &facets, 1e-2, |facet| {
            let m = &materials[facet.material];
            let passes = 1.0 - etalon_testing::lobe::dielectric(m, fresnel == "fresnel=exact", facet.n.z).x;
            etalon_testing::lobe::rgb(behind) * etalon_testing::lobe::base(m) * (f64::from(m.transmission) * passes)
        });
        // Of the 32 even points of each half one too many or too few goes through, 2 of 64 where 0.4 of them do; the
        // deferred pass has these normals in 2 x 16 bits, 6.5e-5.
        let bound = match of {
            Model::Local => 2e-4,
            Model::Recursive => 1e-5,
            Model::Global => 0.08,
        };
        assert!(error < bound, "{of:?}, {fresnel}: {error:e}");
    }
}

/// k_d, k_s in 1/sr and shine as a scene gives them (`extras.etalon`; crates/scene/src/gltf_extras.rs keeps them like
/// this).
fn told(kd: [f32; 3], ks: [f32; 3], shine: f32) -> Material {
    Material {
        specular: 1.0,
        specular_color: ks.map(|k| std::f32::consts::TAU * k / (shine + 2.0) / 0.04),
        roughness: (2.0 / (shine + 2.0)).sqrt().sqrt(),
        phong: true,
        ..lambert(kd.map(|k| std::f32::consts::PI * k))
    }
}

#[test]
fn phong_coefficients_of_a_scene_give_b5_and_b6() {
    let gpu = Gpu::hasty();
    // The second sends more than it receives by B5, which nothing forbids.
    let of = [([0.1, 0.2, 0.05], [0.3, 0.2, 0.4], 20.0), ([0.05; 3], [1.414, 0.7, 0.2], 3.0)];
    let materials = of.map(|(kd, ks, shine)| told(kd, ks, shine));
    let l = LIGHTS[0].normalize();
    let (mut scene, facets) = dome(&materials);
    let mut made = Made(std::mem::take(&mut scene));
    made.light(IRRADIANCE, LightKind::Directional { direction: -l });
    for model_of in MODELS {
        for (brdf, count) in [("blinn-phong", 2), ("blinn-phong-reciprocal", 1)] {
            let film = gpu.film(&made.0, model(model_of, DOME, &[&format!("brdf={brdf}"), "fresnel=schlick"]));
            let seen: Vec<Facet> = facets.iter().filter(|f| f.material < count).map(Facet::clone).collect();
            let error = worst(&film, &seen, FAINT, |facet: &Facet| {
                let (kd, ks, shine) = of[facet.material];
                let (kd, ks) = (etalon_testing::lobe::rgb(kd), etalon_testing::lobe::rgb(ks));
                let (n, sum) = (facet.n, l + DVec3::Z);
                let (cos, lobe) = (n.dot(l).max(0.0), n.dot(sum.normalize()).powf(f64::from(shine)));
                let lit = if cos > 0.0 { 1.0 } else { 0.0 };
                let light = match brdf {
                    "blinn-phong" => kd * cos + ks * lobe * lit,
                    _ => (kd + ks * lobe / sum.length_squared()) * cos,
                };
                light * etalon_testing::lobe::rgb(IRRADIANCE)
            });
            assert!(error < LOBES, "{model_of:?}, {brdf}: {error:e}");
        }
    }
}

/// Before light that is the same from everywhere a rough coat over black shows its directional albedo, along paths too:
/// each direction is weighted by the density that it was drawn with.
#[test]
fn a_rough_coat_over_black_sends_its_albedo_along_paths() {
    let gpu = Gpu::hasty();
    let coated = Material { clearcoat: 1.0, clearcoat_roughness: 0.5, ..lambert([0.0; 3]) };
    let (scene, facets) = dome(std::slice::from_ref(&coated));
    let sky = Environment::constant([1.0; 3]);
    let (_, film) =
        gpu.shot(&scene, Some(&sky), model(Model::Global, DOME, &["samples=256", "brdf=ggx", "fresnel=schlick"]));
    for tilt in etalon_testing::lobe::TILTS {
        let cos_v = tilt.to_radians().cos();
        let same = facets.iter().filter(|facet| (facet.n.z - cos_v).abs() < 1e-6);
        let seen: Vec<f64> =
            same.flat_map(|facet| &facet.pixels).map(|&pixel| f64::from(film.rgba[pixel][1])).collect();
        let n = seen.len() as f64;
        let mean = seen.iter().sum::<f64>() / n;
        let error = (seen.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt();
        let [whole, grazing] =
            etalon_testing::lobe::reflectances(cos_v, etalon_testing::lobe::alpha(coated.clearcoat_roughness));
        let want = 0.04 * (whole - grazing) + grazing;
        // The rule behind `reflectances` is good to 1e-3.
        assert!((mean - want).abs() < 4.0 * error + 2e-3 * want, "{tilt}°: {mean} ± {error}, not {want}");
    }
}
