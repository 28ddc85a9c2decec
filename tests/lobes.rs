//! Rough mirrors by rays (knob `lobes`): the mean over the samples of a lobe is the integral of BRDF times cosine,
//! worked out in f64 over the only thing that there is to be mirrored.

use etalon::frame::Settings;
use etalon::optics::brdf;
use etalon::optics::fresnel::fresnel_dielectric;
use etalon::scene::environment::Environment;
use etalon::scene::{Material, Projection, Scene};
use etalon::study::shape::Shape;
use etalon_testing::gpu::Gpu;
use etalon_testing::made::{Made, lambert, orthographic, unlit};
use glam::{DAffine3, DVec3};

const RADIANCE: [f32; 3] = [2.0, 1.0, 0.5];
/// Towards the viewer, everywhere.
const V: DVec3 = DVec3::new(std::f64::consts::FRAC_1_SQRT_2, 0.0, std::f64::consts::FRAC_1_SQRT_2);
/// The card: |y| ≤ 1 and z from 0.4 to 2.4 of the plane x = −1.5.
const CARD: DVec3 = DVec3::new(-1.5, 0.0, 1.4);

/// A surface in the plane z = 0 before an upright card that glows.
fn before_a_card(surface: Material) -> Scene {
    let mut made = Made::new("lobes");
    made.add(Shape::panel(8.0, 8.0), surface, DAffine3::IDENTITY);
    let upright = DAffine3::from_translation(CARD) * DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2);
    made.add(Shape::panel(2.0, 2.0), unlit(RADIANCE), upright);
    made.camera(V * 10.0, DVec3::ZERO, orthographic(0.5));
    made.0
}

/// Of a surface with this α and these F0: radiance in units of the card's.
fn mirrored(p: DVec3, alpha: f64, f0: [f32; 3]) -> [f64; 3] {
    reflected(p, |l| f0.map(|f0| brdf::ggx(DVec3::Z, l, V, alpha, f0.into())[4]))
}

/// The card's light by a BRDF times cosine for light from a direction.
fn reflected(p: DVec3, brdf: impl Fn(DVec3) -> [f64; 3]) -> [f64; 3] {
    const CELLS: i32 = 64;
    let size = 2.0 / f64::from(CELLS);
    let mut sum = [0.0; 3];
    for i in 0..CELLS {
        for j in 0..CELLS {
            let at = CARD + DVec3::new(0.0, f64::from(i) + 0.5, f64::from(j) + 0.5) * size - DVec3::new(0.0, 1.0, 1.0);
            let to = at - p;
            let l = to.normalize();
            let solid_angle = l.x.abs() / to.length_squared() * size * size;
            for (sum, reflected) in sum.iter_mut().zip(brdf(l)) {
                *sum += reflected * solid_angle;
            }
        }
    }
    sum
}

/// Directional reflectance of a lobe with F = 1.
fn albedo(alpha: f64) -> f64 {
    const CELLS: i32 = 300;
    let mut sum = 0.0;
    for i in 0..CELLS {
        for j in 0..2 * CELLS {
            // Uniform in cosθ and φ.
            let (z, phi) = ((f64::from(i) + 0.5) / f64::from(CELLS), (f64::from(j) + 0.5) / f64::from(CELLS));
            let across = (1.0 - z * z).sqrt();
            let (sin, cos) = (phi * std::f64::consts::PI).sin_cos();
            let [.., reflected] = brdf::ggx(DVec3::Z, DVec3::new(across * cos, across * sin, z), V, alpha, 1.0);
            sum += reflected;
        }
    }
    sum * 2.0 * std::f64::consts::PI / f64::from(2 * CELLS * CELLS)
}

fn settings(choices: &[&str]) -> Settings {
    let mut settings = Settings { size: [32, 24], ..Settings::default() };
    for choice in ["samples=256", "brdf=ggx"].iter().chain(choices) {
        settings.knobs.set(choice).expect("a rung");
    }
    settings
}

/// Compares the picture, pixel by pixel, with `expected` at each pixel's point. The samples of a pixel are random: it
/// is their mean over all pixels that must agree, to four times the deviation that the pixels' own scatter gives it.
fn agrees(name: &str, surface: Material, choices: &[&str], expected: impl Fn(DVec3) -> [f64; 3]) {
    let gpu = Gpu::open();
    let scene = before_a_card(surface);
    let (film, aovs, view) = gpu.all(&scene, &scene.cameras[0], settings(choices));
    let expected: Vec<[f64; 3]> =
        aovs.iter().map(|aov| expected(view.eye + glam::Vec3::from(aov.p_rel).as_dvec3())).collect();
    for channel in 0..3 {
        let glows = f64::from(RADIANCE[channel]);
        let off: Vec<f64> = film
            .rgba
            .iter()
            .zip(&expected)
            .map(|(pixel, expected)| f64::from(pixel[channel]) / (expected[channel] * glows) - 1.0)
            .collect();
        let count = off.len() as f64;
        let mean = off.iter().sum::<f64>() / count;
        let deviation = (off.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count * (count - 1.0))).sqrt();
        eprintln!("{name}, channel {channel}: {mean:+.1e}, deviation {deviation:.1e}");
        assert!(deviation < 3e-3 && mean.abs() < 4.0 * deviation, "{name}: {mean:e} ± {deviation:e}");
    }
}

const GOLD: [f32; 3] = [0.9, 0.6, 0.3];

fn metal(roughness: f32) -> Material {
    let [r, g, b] = GOLD;
    Material { base_color: [r, g, b, 1.0], metallic: 1.0, roughness, ..Material::default() }
}

#[test]
fn a_rough_metal_mirrors_a_card_as_the_integral_says() {
    for (roughness, lobes) in [(0.35_f32, "lobes=0.5"), (0.5, "lobes=0.5"), (0.8, "lobes=1")] {
        let alpha = f64::from(roughness).powi(2);
        let expected = |p| mirrored(p, alpha, GOLD);
        agrees(&format!("roughness {roughness}"), metal(roughness), &[lobes], expected);
    }
}

#[test]
fn a_rough_coat_mirrors_a_card_as_the_integral_says() {
    let black = Material { clearcoat: 1.0, clearcoat_roughness: 0.5, ..lambert([0.0; 3]) };
    // White, times the reflectance of the coat's boundary by the half vector: the lobe of a metal has no F of its own.
    let coat = |l: DVec3| {
        let cos_h = V.dot((V + l).normalize());
        [fresnel_dielectric(cos_h, 1.5)[0] * brdf::ggx(DVec3::Z, l, V, 0.25, 1.0)[4]; 3]
    };
    agrees("coat", black, &["lobes=1"], |p| reflected(p, coat));
}

/// 1 + F0 (1/E − 1) of what is mirrored by rays too; E comes from a table on the device, good to some 1e-3.
#[test]
fn light_lost_to_single_scattering_is_given_back_to_rays() {
    let alpha = 0.8_f64.powi(2);
    let albedo = albedo(alpha);
    assert!(albedo < 0.9, "{albedo}");
    let compensation = GOLD.map(|f0| brdf::ggx_compensation(f0.into(), albedo));
    let expected = |p| {
        let single = mirrored(p, alpha, GOLD);
        [0, 1, 2].map(|i| single[i] * compensation[i])
    };
    agrees("compensated", metal(0.8), &["lobes=1", "brdf=ggx-multi"], expected);
}

/// Rays of rough lobes see the environment filtered over their part of the lobe: four samples of a checkerboard of
/// texels have its mean, as in even light. Clear mirrors see its texels.
#[test]
fn few_samples_of_a_rough_lobe_see_all_of_the_environment_in_it() {
    let gpu = Gpu::open();
    let radiance = (0..128 * 256).map(|i| [if (i / 256 + i % 256) % 2 == 0 { 2.0 } else { 0.0 }; 3]).collect();
    let chequered = Environment { name: "chequered".to_owned(), width: 256, height: 128, radiance };
    // Of each pixel: its radiance by what it would be in even light.
    let seen = |roughness: f32| -> Vec<f64> {
        let mut made = Made::new("chequered");
        let white = Material { base_color: [1.0; 4], ..metal(roughness) };
        made.add(Shape::panel(40.0, 40.0), white, DAffine3::IDENTITY);
        made.camera(V * 10.0, DVec3::ZERO, Projection::Perspective { fov_y: 0.5, near: None });
        let [seen, even] = [&chequered, &Environment::constant([1.0; 3])]
            .map(|environment| gpu.shot(&made.0, Some(environment), settings(&["samples=4", "lobes=0.5"])).1);
        let pairs = seen.rgba.iter().zip(&even.rgba).filter(|(_, even)| even[0] > 0.0);
        pairs.map(|(seen, even)| f64::from(seen[0] / even[0])).collect()
    };
    let far = |pixels: &[f64], by: f64| pixels.iter().filter(|x| (*x - 1.0).abs() > by).count();
    let (rough, clear) = (seen(0.5), seen(0.0));
    // Without the filter 421 pixels are off.
    let (off, kept) = (far(&rough, 0.1), far(&clear, 0.3));
    eprintln!("{off} of {} rough pixels are off, {kept} of {} clear ones show texels", rough.len(), clear.len());
    assert!(rough.len() > 700 && off * 100 < rough.len(), "{off} of {}", rough.len());
    assert!(kept * 10 > clear.len(), "{kept} of {}", clear.len());
}

/// What is rougher than the knob says sends no rays: without light from all around nothing is mirrored.
#[test]
fn rougher_lobes_are_left_to_the_environment() {
    let gpu = Gpu::open();
    for (roughness, lobes, glows) in [(0.35, "lobes=0.2", false), (0.35, "lobes=0.5", true), (0.8, "lobes=0.5", false)]
    {
        let scene = before_a_card(metal(roughness));
        let film = gpu.film(&scene, settings(&[lobes, "samples=1", "indirect=off"]));
        assert_eq!(film.rgba.iter().any(|pixel| pixel[0] > 0.0), glows, "roughness {roughness}, {lobes}");
    }
}

/// The table of directional reflectance at its edge: the roughest metal in a white furnace, without rays. The table's
/// sum is good to 4e-3 (src/upload/split_sum.rs).
#[test]
fn the_roughest_metal_loses_in_a_furnace_what_the_integral_says() {
    let gpu = Gpu::open();
    let mut made = Made::new("furnace");
    let white = Material { base_color: [1.0; 4], metallic: 1.0, roughness: 1.0, ..Material::default() };
    made.add(Shape::panel(8.0, 8.0), white, DAffine3::IDENTITY);
    made.camera(V * 10.0, DVec3::ZERO, orthographic(0.5));
    let (_, film) = gpu.shot(&made.0, Some(&Environment::constant([1.0; 3])), settings(&["samples=1"]));
    let expected = albedo(1.0);
    for pixel in &film.rgba {
        assert!((f64::from(pixel[0]) - expected).abs() < 4e-3, "{} instead of {expected}", pixel[0]);
    }
}
