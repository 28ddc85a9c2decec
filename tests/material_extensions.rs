//! Anisotropy, iridescence, diffuse transmission, specular colours and specular-glossiness materials in pictures of all
//! three models: against their formulas in f64, in uniform light, by their textures, and from files.

use std::f64::consts::PI;

use etalon::frame::{Background, Settings};
use etalon::image::Picture;
use etalon::optics::anisotropy::{anisotropic_distribution, anisotropic_visibility};
use etalon::optics::fresnel::{fresnel_dielectric, normal_reflectance};
use etalon::optics::thin_film::film_reflectance;
use etalon::plan::Model;
use etalon::scene::environment::Environment;
use etalon::scene::lobe::{ANISOTROPY, DIFFUSE_TRANSMISSION, IRIDESCENCE};
use etalon::scene::{Image, LightKind, LoadOptions, Material, Sampler, Scene, TextureRef, load};
use etalon::study::shape::Shape;
use etalon_testing::gltf_builder::{Builder, png};
use etalon_testing::gpu::{Gpu, largest_difference};
use etalon_testing::lobe::{DOME, Facet, MODELS, alpha, base, dielectric, dome, metal, model, rgb, schlick, worst};
use etalon_testing::made::{Made, at, lambert, orthographic};
use glam::{Affine2, DAffine3, DVec3};
use serde_json::json;

const IRRADIANCE: [f32; 3] = [3.0, 2.0, 5.0];

fn directional(scene: Scene, l: DVec3) -> Scene {
    let mut made = Made(scene);
    made.light(IRRADIANCE, LightKind::Directional { direction: -l });
    made.0
}

fn texture(image: usize) -> TextureRef {
    TextureRef { image, uv_set: 0, uv_transform: Affine2::IDENTITY, sampler: Sampler::default() }
}

fn with(lobe: usize, factors: [f32; 4], below: Material) -> Material {
    let mut material = below;
    material.lobes[lobe].factors = factors;
    material
}

fn plastic(base_color: [f32; 3], roughness: f32) -> Material {
    Material { specular: 1.0, roughness, ..lambert(base_color) }
}

fn gold(roughness: f32) -> Material {
    Material { base_color: [0.9, 0.6, 0.3, 1.0], metallic: 1.0, roughness, ..Material::default() }
}

/// One facet is one mesh: gives each a tangent, around the axis of the dome.
fn with_tangents(scene: &mut Scene) {
    for mesh in &mut scene.meshes {
        let n = DVec3::from(mesh.normals[0].map(f64::from));
        let t = tangent(n).as_vec3();
        mesh.tangents = vec![[t.x, t.y, t.z, 1.0]; mesh.positions.len()].into();
    }
}

fn tangent(n: DVec3) -> DVec3 {
    DVec3::Z.cross(n).try_normalize().unwrap_or(DVec3::X)
}

// ---------------------------------------------------------------------------------------------------------------------
// Anisotropy

/// The lobe's frame on a facet, and α along and across.
fn lobe_frame(m: &Material, n: DVec3) -> ([DVec3; 2], [f64; 2]) {
    let [strength, rotation, ..] = m.lobes[ANISOTROPY].factors.map(f64::from);
    let (t, b) = (tangent(n), n.cross(tangent(n)));
    let along = t * rotation.cos() + b * rotation.sin();
    let across = alpha(m.roughness);
    ([along, n.cross(along)], [across + (1.0 - across) * strength * strength, across])
}

/// D G₂/(4 cosθ_l cosθ_v) of the base.
fn anisotropic_lobe(m: &Material, n: DVec3, l: DVec3, v: DVec3) -> f64 {
    let ([along, across], alphas) = lobe_frame(m, n);
    let local = |w: DVec3| DVec3::new(w.dot(along), w.dot(across), w.dot(n));
    let (l, v, h) = (local(l), local(v), local((l + v).normalize()));
    let sin2 = h.x * h.x + h.y * h.y;
    let share = if sin2 > 0.0 { h.x * h.x / sin2 } else { 0.5 };
    anisotropic_distribution(h.z, sin2, share, alphas) * anisotropic_visibility(l, v, alphas)
}

fn brushed(m: &Material, exact: bool, n: DVec3, l: DVec3, v: DVec3) -> DVec3 {
    let (cos_l, h) = (n.dot(l), (l + v).normalize());
    if cos_l <= 0.0 {
        return DVec3::ZERO;
    }
    let f_dielectric = dielectric(m, exact, h.dot(v));
    let f = f_dielectric.lerp(metal(m, exact, h.dot(v)), m.metallic.into());
    let diffuse = base(m) * (1.0 - f64::from(m.metallic)) / PI * (1.0 - f_dielectric.max_element());
    (diffuse + f * anisotropic_lobe(m, n, l, v)) * cos_l
}

fn brushed_materials() -> [Material; 6] {
    [
        with(ANISOTROPY, [0.8, 0.0, 0.0, 0.0], gold(0.3)),
        with(ANISOTROPY, [0.8, 1.1, 0.0, 0.0], gold(0.3)),
        with(ANISOTROPY, [0.5, 0.4, 0.0, 0.0], plastic([0.3, 0.2, 0.5], 0.5)),
        with(ANISOTROPY, [1.0, -2.0, 0.0, 0.0], gold(0.2)),
        with(ANISOTROPY, [0.3, 0.7, 0.0, 0.0], plastic([0.1, 0.6, 0.2], 0.25)),
        gold(0.4),
    ]
}

#[test]
fn an_anisotropic_lobe_is_that_of_heitz_in_every_model() {
    let gpu = Gpu::open();
    for of in MODELS {
        for (exact, light) in [(false, DVec3::new(0.2, 0.5, 1.0)), (true, DVec3::new(-0.7, 0.3, 0.4))] {
            let (mut scene, facets) = dome(&brushed_materials());
            with_tangents(&mut scene);
            let l = light.normalize();
            let scene = directional(scene, l);
            let fresnel = if exact { "fresnel=exact" } else { "fresnel=schlick" };
            let film = gpu.film(&scene, model(of, DOME, &["brdf=ggx", fresnel]));
            let error = worst(&film, &facets, 0.05, |facet: &Facet| {
                brushed(&scene.materials[facet.material], exact, facet.n, l, DVec3::Z) * rgb(IRRADIANCE)
            });
            // The direction is stored in 2 x 16 bits, 4e-5 rad; the slope of the narrowest lobe (α = 0.04) turns this
            // into 3e-3.
            assert!(error < 3e-3, "{of:?}, {fresnel}: {error:e}");
        }
    }
}

/// Directional albedo of a lobe with F = 1, by the midpoint rule in cosθ and φ.
fn albedo(m: &Material, n: DVec3, v: DVec3) -> f64 {
    const CELLS: u32 = 300;
    let ([t, b], _) = lobe_frame(m, n);
    let mut sum = 0.0;
    for i in 0..CELLS {
        for j in 0..2 * CELLS {
            let z = (f64::from(i) + 0.5) / f64::from(CELLS);
            let (sin, cos) = (PI * (f64::from(j) + 0.5) / f64::from(CELLS)).sin_cos();
            let across = (1.0 - z * z).sqrt();
            sum += anisotropic_lobe(m, n, t * (across * cos) + b * (across * sin) + n * z, v) * z;
        }
    }
    sum * PI / f64::from(CELLS * CELLS)
}

/// Mean of a facet's pixels and its standard error.
fn mean(film: &Picture, facet: &Facet, channel: usize) -> (f64, f64) {
    let all: Vec<f64> = facet.pixels.iter().map(|&pixel| f64::from(film.rgba[pixel][channel])).collect();
    let n = all.len() as f64;
    let mean = all.iter().sum::<f64>() / n;
    let spread = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n.max(2.0);
    (mean, if n > 3.0 { (spread / n).sqrt() } else { 0.02 * mean })
}

#[test]
fn a_white_brushed_metal_sends_what_its_lobe_keeps_of_uniform_light() {
    let gpu = Gpu::open();
    let white = |roughness| Material { base_color: [1.0; 4], ..gold(roughness) };
    let materials = [
        with(ANISOTROPY, [0.7, 0.3, 0.0, 0.0], white(0.4)),
        with(ANISOTROPY, [0.4, 0.0, 0.0, 0.0], white(0.6)),
        with(ANISOTROPY, [1.0, 0.8, 0.0, 0.0], white(0.5)),
    ];
    let (mut scene, facets) = dome(&materials);
    with_tangents(&mut scene);
    let sky = Environment::constant([1.0; 3]);
    // Without paths the albedo is the mean of 32 directions.
    for (of, samples, bound) in [(Model::Local, 1, 0.037), (Model::Recursive, 1, 0.037), (Model::Global, 1024, 2e-3)] {
        let settings = model(of, DOME, &[&format!("samples={samples}"), "brdf=ggx", "lobes=0.2"]);
        let (_, film) = gpu.shot(&scene, Some(&sky), settings);
        let mut largest = 0.0_f64;
        for facet in facets.iter().step_by(5) {
            let want = albedo(&materials[facet.material], facet.n, DVec3::Z);
            let (got, error) = mean(&film, facet, 0);
            let off = ((got - want).abs() - 4.0 * error).max(0.0);
            largest = largest.max(off);
            assert!(off < bound, "{of:?}, material {}, {}: {got} ± {error}, not {want}", facet.material, facet.n.z);
            assert!(got < 1.0 + bound + 4.0 * error, "{of:?}: {got}");
        }
        eprintln!("{of:?}: {largest:.1e}");
    }
}

// ---------------------------------------------------------------------------------------------------------------------
// Iridescence

/// Mean of cos(2π path/λ) over red, green and blue: the Gaussians of Belcour and Barla 2017, relative to white.
fn sensitivity(path: f64) -> DVec3 {
    let k = 2.0 * PI * path * 1e-9;
    let term = |at: f64, variance: f64| (at * k).cos() * (-variance * k * k).exp();
    // The areas of the two Gaussians of X.
    let areas =
        [(5.4856e-13, 4.3278e9), (9.7470e-14, 4.5282e9)].map(|(height, variance): (f64, f64)| height * variance.sqrt());
    let first = areas[0] / (areas[0] + areas[1]);
    let x = first * term(1.6810e6, 4.3278e9) + (1.0 - first) * term(2.2399e6, 4.5282e9);
    let (y, z) = (term(1.7953e6, 9.3046e9), term(2.2084e6, 6.6121e9));
    let rows = *etalon::spectra::RGB_FROM_XYZ;
    DVec3::from(rows.map(|[a, b, c]| (a * x + b * y + c * z) / (a + b + c)))
}

/// Reflectance of a film of thickness d over a dielectric, both polarisations, with as many harmonics as the shaders
/// have.
fn film(m: &Material, cos: f64) -> DVec3 {
    let [factor, n_film, _, d] = m.lobes[IRIDESCENCE].factors.map(f64::from);
    let cos_film = (1.0 - (1.0 - cos * cos) / (n_film * n_film)).sqrt();
    let [_, a_s, a_p, ..] = fresnel_dielectric(cos, n_film);
    let [_, r_s, r_p, ..] = fresnel_dielectric(cos_film, f64::from(m.ior) / n_film);
    let path = 2.0 * n_film * d * cos_film;
    let of = |a: f64, rho: DVec3| {
        let q = -a * rho;
        let t = (1.0 - a * a) * (DVec3::ONE - rho * rho) / (DVec3::ONE - q * q);
        let powers = [q, q * q, q * q * q];
        let harmonics = (0..3).map(|m| 2.0 * powers[m] * sensitivity((m + 1) as f64 * path)).sum::<DVec3>();
        (DVec3::ONE - t * (DVec3::ONE + harmonics)).clamp(DVec3::ZERO, DVec3::ONE)
    };
    let coated = if m.metallic > 0.0 {
        let rho = DVec3::from(schlick(base(m), 1.0, cos_film).to_array().map(f64::sqrt));
        (of(a_s, -rho) + of(a_p, rho)) / 2.0
    } else {
        (of(a_s, DVec3::splat(r_s)) + of(a_p, DVec3::splat(r_p))) / 2.0
    };
    let bare = dielectric(m, true, cos).lerp(metal(m, true, cos), m.metallic.into());
    bare.lerp(coated, factor)
}

fn bubbles() -> [Material; 6] {
    let black = |roughness| plastic([0.0; 3], roughness);
    [
        with(IRIDESCENCE, [1.0, 1.33, 100.0, 400.0], black(0.3)),
        with(IRIDESCENCE, [0.6, 1.8, 100.0, 250.0], black(0.5)),
        with(IRIDESCENCE, [1.0, 1.2, 100.0, 900.0], black(0.4)),
        with(IRIDESCENCE, [0.0, 1.3, 100.0, 400.0], black(0.4)),
        with(IRIDESCENCE, [1.0, 2.0, 100.0, 180.0], gold(0.3)),
        with(IRIDESCENCE, [0.5, 1.4, 100.0, 300.0], gold(0.4)),
    ]
}

#[test]
fn a_film_reflects_as_airy_says_in_every_model() {
    let gpu = Gpu::open();
    let l = DVec3::new(0.3, 0.4, 1.0).normalize();
    let (scene, facets) = dome(&bubbles());
    let scene = directional(scene, l);
    let ggx =
        |m: &Material, n: DVec3| etalon_testing::lobe::ggx(n, l, DVec3::Z, alpha(m.roughness)) * n.dot(l).max(0.0);
    for of in MODELS {
        let pictured = gpu.film(&scene, model(of, DOME, &["brdf=ggx", "fresnel=exact"]));
        let error = worst(&pictured, &facets, 0.05, |facet: &Facet| {
            let m = &scene.materials[facet.material];
            let h = (l + DVec3::Z).normalize();
            film(m, h.z) * ggx(m, facet.n) * rgb(IRRADIANCE)
        });
        // exp and cos of the device: 1e-5 of the amplitude, where the sum of four harmonics is a third of it.
        assert!(error < 1e-3, "{of:?}: {error:e}");
    }
}

#[test]
fn a_film_without_thickness_changes_nothing() {
    let gpu = Gpu::open();
    let l = DVec3::new(0.3, 0.4, 1.0).normalize();
    let bare = plastic([0.2, 0.3, 0.1], 0.4);
    let flat = with(IRIDESCENCE, [1.0, 1.4, 100.0, 0.0], bare.clone());
    for of in MODELS {
        let [a, b] = [&bare, &flat].map(|m| {
            let (scene, _) = dome(std::slice::from_ref(m));
            gpu.film(&directional(scene, l), model(of, DOME, &["fresnel=exact"]))
        });
        let difference = largest_difference(&a, &b, 1.0);
        assert!(difference < 1e-4, "{of:?}: {difference}");
    }
}

/// A shadow ray through a sheet with a film loses what the film reflects, in every model.
#[test]
fn a_film_takes_its_colour_from_the_light_of_a_lamp() {
    let gpu = Gpu::open();
    let l = DVec3::new(0.5, 0.3, 1.0).normalize();
    let clear = Material { transmission: 1.0, double_sided: true, ..plastic([1.0; 3], 0.0) };
    for thickness in [150.0, 400.0] {
        let sheet = with(IRIDESCENCE, [1.0, 1.9, 100.0, thickness], clear.clone());
        let passes = 1.0 - film(&sheet, l.z).max_element();
        let mut made = Made::new("a film before a lamp");
        made.add(Shape::panel(4.0, 4.0), lambert([0.5; 3]), at(0.0, 0.0, 0.0));
        made.add(Shape::panel(4.0, 4.0), sheet, at(0.0, 0.0, 1.0));
        // Below the sheet, onto the middle of the floor.
        made.camera(DVec3::new(0.0, -3.0, 0.6), DVec3::ZERO, orthographic(0.1));
        let scene = directional(made.0, l);
        let expected = rgb(IRRADIANCE) * (0.5 / PI * l.z * passes);
        for (of, choices) in [(Model::Recursive, "indirect=off"), (Model::Global, "interfaces=1")] {
            let seen = gpu.film(&scene, model(of, [16, 16], &["fresnel=exact", choices]));
            let pixel = rgb([0, 1, 2].map(|channel| seen.rgba[136][channel]));
            let error = (pixel / expected - 1.0).abs().max_element();
            assert!(error < 1e-3, "{of:?}, {thickness} nm: {pixel} is {expected}");
        }
    }
}

/// In bands of wavelengths the film needs no sensitivities: Airy's closed form at the middle of each band, integrated.
#[test]
fn by_wavelength_a_film_is_the_integral_over_the_spectrum() {
    let gpu = Gpu::open();
    let l = DVec3::new(0.3, 0.4, 1.0).normalize();
    let (scene, facets) = dome(&bubbles()[..3]);
    let mut made = Made(scene);
    made.light([1.0; 3], LightKind::Directional { direction: -l });
    let knobs = ["brdf=ggx", "fresnel=exact", "colour=spectral:32"];
    let pictured = gpu.film(&made.0, model(Model::Local, DOME, &knobs));
    let bands: Vec<_> = (0..32).map(|i| etalon::spectra::VISIBLE.part(i, 32)).collect();
    let rows = *etalon::spectra::RGB_FROM_XYZ;
    let rgb_error = std::cell::Cell::new(0.0_f64);
    let error = worst(&pictured, &facets, 0.05, |facet: &Facet| {
        let m = &made.0.materials[facet.material];
        let h = (l + DVec3::Z).normalize();
        let [factor, n_film, _, d] = m.lobes[IRIDESCENCE].factors.map(f64::from);
        let cos_film = (1.0 - (1.0 - h.z * h.z) / (n_film * n_film)).sqrt();
        let [_, a_s, a_p, ..] = fresnel_dielectric(h.z, n_film);
        let [_, r_s, r_p, ..] = fresnel_dielectric(cos_film, f64::from(m.ior) / n_film);
        let xyz: DVec3 = bands
            .iter()
            .map(|band| {
                let cos = (2.0 * PI * 2.0 * n_film * d * cos_film / band.middle()).cos();
                let airy = (film_reflectance(a_s, r_s, cos) + film_reflectance(a_p, r_p, cos)) / 2.0;
                let bare = etalon_testing::lobe::fresnel(h.z, m.ior.into(), 0.0);
                let light = etalon::spectra::light_from_rgb(band);
                let white = DVec3::from([0, 1, 2].map(|k| light[0][k] + light[1][k] + light[2][k]));
                white * (bare + (airy - bare) * factor)
            })
            .sum();
        let of_bands = DVec3::from(rows.map(|[a, b, c]| a * xyz.x + b * xyz.y + c * xyz.z));
        let off = (of_bands - film(m, h.z)).abs().max_element() / of_bands.max_element();
        rgb_error.set(rgb_error.get().max(off));
        of_bands * etalon_testing::lobe::ggx(facet.n, l, DVec3::Z, alpha(m.roughness)) * facet.n.dot(l).max(0.0)
    });
    let rgb_error = rgb_error.get();
    eprintln!("red, green and blue are off by {rgb_error:.3} of the brightest channel");
    assert!(error < 2e-3, "{error:e}");
    assert!(rgb_error < 0.3, "{rgb_error}");
}

// ---------------------------------------------------------------------------------------------------------------------
// Diffuse transmission

fn leaf(factor: f32, color: [f32; 3], below: Material) -> Material {
    with(DIFFUSE_TRANSMISSION, [factor, color[0], color[1], color[2]], below)
}

fn leaves() -> [Material; 4] {
    [
        leaf(0.6, [0.2, 0.9, 0.1], plastic([0.1, 0.5, 0.1], 0.5)),
        leaf(1.0, [1.0, 0.8, 0.6], lambert([0.5; 3])),
        leaf(0.3, [0.5, 0.5, 1.0], plastic([0.8, 0.7, 0.6], 0.3)),
        lambert([0.5; 3]),
    ]
}

/// Light from behind leaves towards the viewer as if it came from the mirrored direction into the diffuse base layer.
fn shines_through(m: &Material, n: DVec3, l: DVec3, v: DVec3) -> DVec3 {
    let [factor, r, g, b] = m.lobes[DIFFUSE_TRANSMISSION].factors.map(f64::from);
    let cos = -n.dot(l);
    let h = (l + 2.0 * cos * n + v).normalize();
    let enters = 1.0 - dielectric(m, false, h.dot(v)).max_element();
    DVec3::new(r, g, b) * (factor * (1.0 - f64::from(m.metallic)) / PI * enters * cos.max(0.0))
}

#[test]
fn light_from_behind_shines_through_leaves() {
    let gpu = Gpu::open();
    let l = DVec3::new(0.1, 0.05, -1.0).normalize();
    let choices = ["brdf=ggx", "fresnel=schlick"];
    let (scene, facets) = dome(&leaves());
    let scene = directional(scene, l);
    for of in [Model::Local, Model::Recursive] {
        let film = gpu.film(&scene, model(of, DOME, &choices));
        let error = worst(&film, &facets, 0.05, |facet: &Facet| {
            shines_through(&scene.materials[facet.material], facet.n, l, DVec3::Z) * rgb(IRRADIANCE)
        });
        assert!(error < 2e-4, "{of:?}: {error:e}");
    }
    // Paths: from inside, the facets of the dome would light each other.
    for leaf in leaves() {
        let mut made = Made::new("leaf");
        made.add(Shape::panel(4.0, 4.0), Material { double_sided: true, ..leaf.clone() }, DAffine3::IDENTITY);
        made.front(0.5);
        let film = gpu.film(&directional(made.0, l), model(Model::Global, [8, 8], &choices));
        let want = shines_through(&leaf, DVec3::Z, l, DVec3::Z) * rgb(IRRADIANCE);
        for pixel in &film.rgba {
            let got = DVec3::new(pixel[0].into(), pixel[1].into(), pixel[2].into());
            assert!((got - want).abs().max_element() < 2e-4 * want.max_element().max(1e-3), "{got}, not {want}");
        }
    }
}

#[test]
fn what_is_transmitted_is_not_reflected() {
    let gpu = Gpu::open();
    let l = DVec3::new(0.2, 0.5, 1.0).normalize();
    let lit = |m: &Material| directional(dome(std::slice::from_ref(m)).0, l);
    for of in MODELS {
        let [a, b] = [leaf(0.6, [0.0; 3], lambert([0.5; 3])), lambert([0.2; 3])]
            .map(|m| gpu.film(&lit(&m), model(of, DOME, &[])));
        assert!(largest_difference(&a, &b, 1.0) < 1e-5, "{of:?}");
    }
}

/// A white sheet in uniform light from both sides shows that light, whatever share passes through it.
#[test]
fn a_white_leaf_vanishes_in_uniform_light() {
    let gpu = Gpu::open();
    let sky = Environment::constant([0.5; 3]);
    let mut made = Made::new("leaf");
    made.add(
        Shape::panel(1.0, 1.0),
        leaf(0.4, [1.0; 3], Material { double_sided: true, ..lambert([1.0; 3]) }),
        DAffine3::IDENTITY,
    );
    made.front(0.5);
    for (of, samples, bound) in [(Model::Local, 1, 2e-5), (Model::Recursive, 1, 2e-5), (Model::Global, 64, 2e-5)] {
        let (_, film) = gpu.shot(&made.0, Some(&sky), model(of, [16, 16], &[&format!("samples={samples}")]));
        for pixel in &film.rgba {
            assert!((f64::from(pixel[0]) - 0.5).abs() < bound, "{of:?}: {pixel:?}");
        }
    }
}

/// A closed shade in uniform light E₀: its inside has E = τ E₀ + ρ E, and its outside shows ρ E₀ + τ E.
#[test]
fn a_shade_is_lit_through_its_own_walls() {
    let gpu = Gpu::open();
    let sky = Environment::constant([0.5; 3]);
    let mut made = Made::new("shade");
    let paper = leaf(0.5, [0.8; 3], Material { double_sided: true, ..lambert([0.9; 3]) });
    made.add(Shape::sphere(1.0, 24), paper, DAffine3::IDENTITY);
    made.front(0.3);
    let (back, through) = (0.45, 0.4);
    let want = 0.5 * (back + through * through / (1.0 - back));
    // Without visibility it would be 0.5 (ρ + τ), 15 % more. What the inside sends is the mean of some 8000 paths.
    for (of, samples, bound) in [(Model::Recursive, 4, 0.03), (Model::Global, 256, 0.01)] {
        let (_, film) = gpu.shot(&made.0, Some(&sky), model(of, [16, 16], &[&format!("samples={samples}")]));
        let mean = film.rgba.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / film.rgba.len() as f64;
        assert!((mean / want - 1.0).abs() < bound, "{of:?}: {mean}, not {want}");
    }
}

/// The background does not count as light straight ahead, but light from behind that scatters in a leaf does.
#[test]
fn light_from_behind_shines_through_leaves_before_a_transparent_background() {
    let gpu = Gpu::open();
    let sky = Environment::constant([0.5; 3]);
    let mut made = Made::new("leaf");
    let leaf = leaf(1.0, [1.0; 3], Material { double_sided: true, ..lambert([1.0; 3]) });
    made.add(Shape::panel(1.0, 1.0), leaf, DAffine3::IDENTITY);
    made.front(0.5);
    let settings = Settings { background: Background::Transparent, ..model(Model::Global, [16, 16], &["samples=64"]) };
    let (_, film) = gpu.shot(&made.0, Some(&sky), settings);
    for pixel in &film.rgba {
        assert!((f64::from(pixel[0]) - 0.5).abs() < 2e-5 && pixel[3] == 1.0, "{pixel:?}");
    }
}

/// A lamp behind a leaf, and a black card before the lamp or before the leaf.
#[test]
fn shadow_rays_start_on_the_side_of_the_light() {
    let gpu = Gpu::open();
    let lit = |card: Option<f64>| {
        let mut made = Made::new("leaf and lamp");
        let leaf = leaf(0.5, [1.0; 3], Material { double_sided: true, ..lambert([0.5; 3]) });
        made.add(Shape::panel(4.0, 4.0), leaf, DAffine3::IDENTITY);
        if let Some(z) = card {
            let black = Material { double_sided: true, ..lambert([0.0; 3]) };
            // Beside the line of sight.
            made.add(Shape::panel(0.6, 0.6), black, at(1.0, 0.0, z));
        }
        made.light([9.0; 3], LightKind::Point { position: DVec3::new(2.0, 0.0, -2.0), range: None });
        made.front(0.1);
        made.0
    };
    for of in [Model::Recursive, Model::Global] {
        let value = |card| {
            let settings = model(of, [8, 8], &["samples=1", "interfaces=1"]);
            f64::from(gpu.film(&lit(card), settings).rgba[27][0])
        };
        let (open, behind, before) = (value(None), value(Some(-1.0)), value(Some(1.0)));
        // Pixel 27 of 64 shows (−0.0125, 0.0125, 0); 9 cd, albedo 1/2 over π.
        let to_light = DVec3::new(2.0125, -0.0125, -2.0);
        let want = 9.0 * 2.0 / to_light.length().powi(3) * 0.5 / PI;
        // Paths meet another point of the pixel, up to 0.0125 m away.
        let bound = if of == Model::Global { 0.02 } else { 1e-5 };
        assert!((open / want - 1.0).abs() < bound, "{of:?}: {open}, not {want}");
        assert_eq!(behind, 0.0, "{of:?}: a card between leaf and lamp");
        assert!((before / open - 1.0).abs() < 1e-6, "{of:?}: a card on the other side: {before}, not {open}");
    }
}

// ---------------------------------------------------------------------------------------------------------------------
// Specular colour and specular-glossiness

/// The dome in one material, lit from l, with one texel in all textures.
fn of_one_texel(material: &Material, rgba: [u8; 4], l: DVec3) -> Scene {
    let (mut scene, _) = dome(std::slice::from_ref(material));
    with_tangents(&mut scene);
    scene.images.push(Image { name: "texel".to_owned(), width: 1, height: 1, rgba: rgba.to_vec().into() });
    for mesh in &mut scene.meshes {
        mesh.uvs[0] = vec![[0.5; 2]; 4].into();
    }
    directional(scene, l.normalize())
}

/// A texture is the product with its texel, and something else than no texture.
#[test]
fn textures_multiply_the_factors_of_lobes() {
    let gpu = Gpu::open();
    let linear = |byte: f32| ((byte / 255.0 + 0.055) / 1.055).powf(2.4);
    let byte = |byte: f32| byte / 255.0;
    let lobe = |lobe: usize, factors: [f32; 4], texel: [f32; 4], below: &Material| {
        let plain = with(lobe, factors, below.clone());
        let mut textured = plain.clone();
        textured.lobes[lobe].textures = [Some(texture(0)), Some(texture(0))];
        [plain, textured, with(lobe, texel, below.clone())]
    };
    let front = DVec3::new(0.2, 0.5, 1.0);
    let glossy = Material { specular_color: [0.9, 2.0, 5.0], ..plastic([0.2, 0.1, 0.3], 0.4) };
    let specular = [
        glossy.clone(),
        Material { specular_color_texture: Some(texture(0)), ..glossy.clone() },
        Material { specular_color: [0.9 * linear(188.0), 2.0, 5.0 * linear(137.0)], ..glossy },
    ];
    // Of direction and strength: (0, 1) in bytes turns by a right angle. Byte 128 is 0.004 off the middle, which turns
    // the lobe by 4e-3 rad.
    let quarter = std::f32::consts::FRAC_PI_2;
    let brushed = lobe(ANISOTROPY, [0.8, 0.5, 0.0, 0.0], [0.8 * byte(128.0), 0.5 + quarter, 0.0, 0.0], &gold(0.3));
    let of_film = [0.9 * byte(150.0), 1.4, 100.0, 100.0 + 300.0 * byte(200.0)];
    let film = lobe(IRIDESCENCE, [0.9, 1.4, 100.0, 400.0], of_film, &gold(0.3));
    let of_leaf = [0.8 * byte(130.0), linear(188.0), 0.5, 0.9 * linear(137.0)];
    let leaf = lobe(DIFFUSE_TRANSMISSION, [0.8, 1.0, 0.5, 0.9], of_leaf, &lambert([0.5; 3]));
    for (what, texel, l, bound, [plain, textured, product]) in [
        // Texels are stored in bytes of linear light: half a step is 2e-3 of white.
        ("specular colour", [188, 255, 137, 9], front, 4e-3, specular),
        ("anisotropy", [128, 255, 128, 255], front, 0.03, brushed),
        ("iridescence", [150, 200, 7, 7], front, 4e-3, film),
        ("diffuse transmission", [188, 255, 137, 130], DVec3::new(0.1, 0.05, -1.0), 4e-3, leaf),
    ] {
        // Paths would light the facets of the dome from inside.
        for of in MODELS.into_iter().filter(|of| l.z > 0.0 || *of != Model::Global) {
            let drawn = |m: &Material| gpu.film(&of_one_texel(m, texel, l), model(of, DOME, &["brdf=ggx"]));
            let [without, a, b] = [&plain, &textured, &product].map(drawn);
            let (off, changed) = (largest_difference(&a, &b, 1.0), largest_difference(&a, &without, 1.0));
            assert!(off < bound && changed > 10.0 * bound, "{what}, {of:?}: off by {off}, changed by {changed}");
        }
    }
}

fn from_file(extensions: &serde_json::Value, with_texture: bool) -> Scene {
    let mut b = Builder::new();
    let position = b.triangle();
    if with_texture {
        let bytes = png(2, 2, [255, 128, 0, 51]);
        let view = b.view(&bytes, None);
        b.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
        b.push("textures", json!({ "source": 0 }));
    }
    b.push("materials", json!({ "extensions": extensions }));
    let names: Vec<&String> = extensions.as_object().expect("extensions").keys().collect();
    b.json["extensionsUsed"] = json!(names);
    b.json["extensionsRequired"] = json!(names);
    let mesh = b.mesh(json!({ "attributes": { "POSITION": position }, "material": 0 }));
    b.root(json!({ "mesh": mesh }));
    let folder = tempfile::tempdir().expect("a folder");
    load(&b.save_glb(folder.path()), &LoadOptions::default()).expect("a scene")
}

#[test]
fn files_describe_the_extensions() {
    let scene = from_file(
        &json!({
            "KHR_materials_anisotropy": { "anisotropyStrength": 0.6, "anisotropyRotation": 7.0 },
            "KHR_materials_iridescence": { "iridescenceFactor": 1.5 },
            "KHR_materials_diffuse_transmission": { "diffuseTransmissionFactor": 0.25 },
        }),
        false,
    );
    let m = &scene.materials[0];
    assert_eq!(m.lobes[ANISOTROPY].factors[..2], [0.6, 7.0]);
    assert_eq!(m.lobes[IRIDESCENCE].factors, [1.0, 1.3, 100.0, 400.0]);
    assert_eq!(m.lobes[DIFFUSE_TRANSMISSION].factors, [0.25, 1.0, 1.0, 1.0]);
    assert!(
        scene.warnings.iter().any(|w| w.contains("iridescenceFactor 1.5 lies outside 0 … 1")),
        "{:?}",
        scene.warnings
    );
    let scatters = from_file(&json!({ "KHR_materials_volume_scatter": {} }), false);
    assert!(scatters.warnings.iter().any(|w| w.contains("KHR_materials_volume_scatter")), "{:?}", scatters.warnings);
}

#[test]
fn specular_glossiness_is_a_dielectric_of_that_colour() {
    let glossy =
        json!({ "diffuseFactor": [0.2, 0.3, 0.4, 1.0], "specularFactor": [0.5, 0.04, 1.0], "glossinessFactor": 0.75 });
    let scene = from_file(&json!({ "KHR_materials_pbrSpecularGlossiness": glossy }), false);
    let m = &scene.materials[0];
    assert_eq!((m.metallic, m.ior, m.roughness), (0.0, 1.5, 0.25));
    assert_eq!(m.base_color, [0.2, 0.3, 0.4, 1.0]);
    let f0 = normal_reflectance(1.5, 0.0);
    for (got, want) in m.specular_color.iter().zip([0.5, 0.04, 1.0]) {
        assert!((f64::from(*got) * f0 / want - 1.0).abs() < 1e-6, "{got}, {want}");
    }
    // Of a texture the colour is that of F0, and the alpha 0.2 the glossiness: a roughness of 1 − 0.5 · 0.2 in G.
    let glossy = json!({ "specularGlossinessTexture": { "index": 0 }, "glossinessFactor": 0.5 });
    let scene = from_file(&json!({ "KHR_materials_pbrSpecularGlossiness": glossy }), true);
    let m = &scene.materials[0];
    let [color, roughness] =
        [m.specular_color_texture, m.metallic_roughness_texture].map(|t| t.expect("a texture").image);
    assert_ne!(color, roughness);
    assert_eq!(scene.images[color].rgba[..3], [255, 128, 0]);
    assert_eq!(scene.images[roughness].rgba[1], 230);
    assert_eq!((m.roughness, m.metallic), (1.0, 0.0));
}
