//! What lies in a medium, as pictures against f64: what it reflects is a matter of relative indices.

use etalon::plan::Model;
use etalon::scene::{Material, Scene};
use etalon::study::shape::Shape;
use etalon_testing::gpu::Gpu;
use etalon_testing::lobe::model;
use etalon_testing::made::{Made, at, lambert, perspective, unlit};
use glam::{DAffine3, DVec3};

const WATER: f32 = 1.333;

/// A smooth plate under water, seen from within: all around it is a room whose walls send 1. The plate is turned about
/// the vertical.
fn plate_under_water(plate: Material, degrees: f64) -> Scene {
    let mut made = Made::new("under water");
    let water =
        Material { transmission: 1.0, thickness: 40.0, ior: WATER, specular: 1.0, roughness: 0.0, ..lambert([1.0; 3]) };
    made.add(Shape::cuboid(DVec3::splat(40.0)), water, DAffine3::IDENTITY);
    let walls = Material { double_sided: true, ..unlit([1.0; 3]) };
    made.add(Shape::cuboid(DVec3::splat(20.0)), walls, DAffine3::IDENTITY);
    let turned = at(0.0, 0.0, -4.0) * DAffine3::from_rotation_y(degrees.to_radians());
    made.add(Shape::panel(2.0, 2.0), plate, turned);
    made.camera(DVec3::ZERO, DVec3::NEG_Z, perspective(0.2));
    made.0
}

/// n and κ of gold at red, green and blue, or near it.
const GOLD: [[f32; 2]; 3] = [[0.18, 3.43], [0.42, 2.35], [1.37, 1.77]];

/// In air gold reflects 0.85 of green, in water 0.80; a plastic of index 1.5 0.040 and 0.0035.
#[test]
fn mirrors_under_water_reflect_by_relative_indices() {
    let gpu = Gpu::hasty();
    let water = f64::from(WATER);
    let in_air = GOLD.map(|[n, kappa]| etalon_testing::lobe::fresnel(1.0, n.into(), kappa.into()) as f32);
    let [r, g, b] = in_air;
    let gold = Material {
        conductor: Some(GOLD),
        base_color: [r, g, b, 1.0],
        metallic: 1.0,
        roughness: 0.0,
        ..Material::default()
    };
    let plastic = Material { specular: 1.0, roughness: 0.0, ior: 1.5, ..lambert([0.0; 3]) };
    for of in [Model::Recursive, Model::Global] {
        for degrees in [0.0_f64, 30.0, 60.0] {
            let cos = degrees.to_radians().cos();
            let of_gold = DVec3::from(
                GOLD.map(|[n, k]| etalon_testing::lobe::fresnel(cos, f64::from(n) / water, f64::from(k) / water)),
            );
            let of_plastic = DVec3::splat(etalon_testing::lobe::fresnel(cos, 1.5 / water, 0.0));
            for (name, material, expected) in [("gold", &gold, of_gold), ("plastic", &plastic, of_plastic)] {
                let scene = plate_under_water(material.clone(), degrees);
                let film = gpu.film(&scene, model(of, [4, 4], &["fresnel=exact"]));
                for pixel in &film.rgba {
                    let got = DVec3::from([pixel[0], pixel[1], pixel[2]].map(f64::from));
                    let off = ((got - expected) / expected).abs().max_element();
                    // The field of view is 0.1° either way, by which the plastic's curve moves 1 % at 60°; indices are
                    // f32, and the plastic's F0 is the square of a difference of them.
                    assert!(off < 2e-2, "{of:?}, {name} at {degrees}°: {got} for {expected}");
                }
                // In air it would be something else, by more than that.
                let air = if name == "gold" {
                    DVec3::from(GOLD.map(|[n, k]| etalon_testing::lobe::fresnel(cos, n.into(), k.into())))
                } else {
                    DVec3::splat(etalon_testing::lobe::fresnel(cos, 1.5, 0.0))
                };
                assert!(((air - expected) / expected).abs().max_element() > 4e-2, "{name} at {degrees}°");
            }
        }
    }
}

/// A coat over what is black, under fresnel=exact: Fresnel's equations for index 1.5, not Schlick's curve, in every
/// model.
#[test]
fn coats_follow_fresnels_equations_where_the_rung_says_exact() {
    let gpu = Gpu::hasty();
    let black = Material { clearcoat: 1.0, clearcoat_roughness: 0.0, ..lambert([0.0; 3]) };
    for of in [Model::Local, Model::Recursive, Model::Global] {
        for degrees in [0.0_f64, 45.0, 70.0] {
            let mut made = Made::new("coat");
            made.add(Shape::panel(4.0, 4.0), black.clone(), DAffine3::from_rotation_y(degrees.to_radians()));
            made.camera(DVec3::Z * 4.0, DVec3::ZERO, perspective(0.2));
            let sky = etalon::scene::environment::Environment::constant([1.0; 3]);
            let (_, film) = gpu.shot(&made.0, Some(&sky), model(of, [4, 4], &["fresnel=exact", "samples=16"]));
            let expected = etalon_testing::lobe::fresnel(degrees.to_radians().cos(), 1.5, 0.0);
            let mean = film.rgba.iter().map(|p| f64::from(p[1])).sum::<f64>() / film.rgba.len() as f64;
            // The table of directional albedo is good to 4e-3 of what is 1; paths choose coat or base.
            let bound = if of == Model::Recursive { 1e-4 } else { 6e-3 };
            assert!((mean - expected).abs() < bound, "{of:?} at {degrees}°: {mean} for {expected}");
        }
    }
}
