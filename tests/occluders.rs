//! The radiosity of occluders on the host, against closed forms.
//!
//! Read docs/decisions/ambient-occlusion.md.

use std::f64::consts::{FRAC_PI_2, PI};

use etalon::prepare::ray_offset;
use etalon::scene::environment::Environment;
use etalon::scene::lobe::DIFFUSE_TRANSMISSION;
use etalon::scene::solid::solids;
use etalon::scene::{Extent, LightKind, Material, Scene};
use etalon::study::shape::Shape;
use etalon::transport::bvh::Bvh;
use etalon::transport::emitters::{Emitters, Sky};
use etalon::transport::occluders::{OccluderRadiosity, squares};
use etalon_testing::made::Made;
use glam::{DAffine3, DMat3, DVec3};

fn found(scene: &Scene, sky: Option<&Environment>) -> OccluderRadiosity {
    let bvh = Bvh::build(scene).expect("a tree");
    let lamps = Emitters::of(scene, None, true);
    let sky = sky.map(|map| Sky { map, intensity: 1.0, rotation: 0.0 });
    OccluderRadiosity::of(scene, &solids(scene), &bvh, &lamps, sky, ray_offset(1.0))
}

/// Squares of 3 m with these materials, at z = 0, 1, …
fn squares_above(materials: Vec<Material>) -> Scene {
    let mut made = Made::new("squares");
    for (z, material) in (0..).zip(materials) {
        made.add(Shape::panel(3.0, 3.0), material, DAffine3::from_translation(DVec3::new(0.0, 0.0, f64::from(z))));
    }
    made.0
}

fn painted([r, g, b]: [f32; 3]) -> Material {
    Material { base_color: [r, g, b, 1.0], metallic: 0.0, double_sided: true, ..Material::default() }
}

/// A sphere of 1 m around a lamp, which everything sees from the inside.
fn sphere_around(albedo: [f32; 3]) -> Made {
    let mut made = Made::new("integrating sphere");
    made.add(Shape::sphere(1.0, 64), painted(albedo), DAffine3::IDENTITY);
    made
}

/// With a lamp of 1 cd in its middle E = I + ρ E everywhere, and B = ρ E.
#[test]
fn an_integrating_sphere_has_the_radiosity_of_the_geometric_series() {
    let mut made = sphere_around([0.8, 0.5, 0.2]);
    made.light([1.0; 3], LightKind::Point { position: DVec3::ZERO, range: None });
    let radiosity = found(&made.0, None);
    for side in [radiosity.along, radiosity.against].iter().flat_map(|m| [m.x_axis, m.y_axis, m.z_axis]) {
        for (found, albedo) in side.to_array().into_iter().zip([0.8_f32, 0.5, 0.2].map(f64::from)) {
            let wanted = albedo / (1.0 - albedo);
            // 8192 rays inside. The standard deviation of a path's B is below B, and a side has a sixth of the rays.
            assert!((found / wanted - 1.0).abs() < 4.0 / (8192.0_f64 / 6.0).sqrt(), "{found}, not {wanted}");
        }
    }
    assert!(radiosity.by_place.to_cols_array().iter().all(|slope| slope.abs() < 0.4), "{radiosity:?}");
}

/// On average the radiosity in the sphere is ρ/(1 − ρ) times the lamp's flux over the area, whatever the lamp is.
#[test]
fn every_lamp_has_its_flux() {
    let [position, direction] = [DVec3::new(0.2, 0.0, 0.1), DVec3::new(0.6, 0.8, 0.0)];
    let [inner, outer] = [0.5_f64, 0.9];
    let spot = LightKind::Spot { position, direction, range: None, inner, outer };
    // ∫ ((cos θ − cos outer)/(cos inner − cos outer))² dΩ between the cones, and the inner one.
    let of_spot = 2.0 * PI * (1.0 - inner.cos() + (inner.cos() - outer.cos()) / 3.0);
    let rectangle = Extent::Rectangle { across: 0.1 * DVec3::Z, half_height: 0.05 };
    let point = LightKind::Point { position, range: None };
    let sun = LightKind::Directional { direction };
    for (kind, extent, flux) in [
        (point, None, 4.0 * PI),
        (point, Some(Extent::Sphere { radius: 0.05 }), 4.0 * PI),
        (spot, None, of_spot),
        // A diffuse emitter: ∫ cos θ dΩ over a half.
        (spot, Some(Extent::Disk { radius: 0.1 }), PI),
        (spot, Some(rectangle), PI),
        (sun, None, 0.0),
    ] {
        let mut made = sphere_around([0.5; 3]);
        made.light([1.0; 3], kind);
        made.0.lights[0].extent = extent;
        let found = mean(&found(&made.0, None));
        assert!((found - flux / (4.0 * PI)).abs() <= 0.05 * flux / (4.0 * PI), "{kind:?}, {extent:?}: {found}");
    }
    // A black panel of 0.1 m that emits on both sides: 2 π L A.
    let mut made = sphere_around([0.5; 3]);
    let panel = Material { emissive: [1.0; 3], ..painted([0.0; 3]) };
    made.add(Shape::panel(0.1, 0.1), panel, DAffine3::from_translation(position));
    let (found, flux) = (mean(&found(&made.0, None)), 2.0 * PI * 0.01);
    assert!((found - flux / (4.0 * PI)).abs() < 0.05 * flux / (4.0 * PI), "{found}");
}

/// Over all directions from the middle of a closed room.
fn mean(radiosity: &OccluderRadiosity) -> f64 {
    radiosity.at(DVec3::ZERO, [DVec3::splat(1.0 / 6.0); 2], 1.0).x
}

/// In uniform light of radiance 1 white surfaces have its radiosity π, whatever they face, and whether they reflect
/// light or transmit it.
#[test]
fn white_surfaces_in_uniform_light_have_its_radiosity() {
    let mut leaf = painted([1.0, 1.0, 1.0]);
    leaf.lobes[DIFFUSE_TRANSMISSION].factors = [0.4, 1.0, 1.0, 1.0];
    for material in [painted([1.0, 1.0, 1.0]), leaf] {
        let radiosity = found(&squares_above(vec![material.clone(), material]), Some(&Environment::constant([1.0; 3])));
        // The mean squares around z by the cosine: 1/2 along z, 1/4 along x and y, half of it on either side.
        let [up, aside] = [DVec3::new(0.125, 0.125, 0.5), DVec3::new(0.125, 0.125, 0.0)];
        for squares in [[up, aside], [aside, up]] {
            let found = radiosity.at(DVec3::ZERO, squares, 0.5);
            // Some 2000 rays, whose B varies by two thirds with its light samples: two standard errors.
            assert!((found / PI - 1.0).abs().max_element() < 0.03, "{found}: {radiosity:?}");
        }
    }
}

/// Between a red wall and a white one rays see red on one side.
#[test]
fn rays_see_the_colour_that_lies_in_their_direction() {
    let wall = |x: f64| DAffine3 { matrix3: DMat3::from_rotation_y(FRAC_PI_2), translation: DVec3::new(x, 0.0, 0.0) };
    let mut made = Made::new("walls");
    made.add(Shape::panel(8.0, 8.0), painted([0.8, 0.0, 0.0]), wall(-1.0));
    made.add(Shape::panel(8.0, 8.0), painted([0.8, 0.8, 0.8]), wall(1.0));
    let radiosity = found(&made.0, Some(&Environment::constant([1.0; 3])));
    let [left, right] = [DVec3::NEG_X, DVec3::X].map(|d| radiosity.at(DVec3::ZERO, squares(d), 0.5));
    assert!(left.y.abs() < 0.1 * left.x && left.z.abs() < 0.1 * left.x, "{left}");
    assert!(right.y > 0.3 * right.x && right.x > 0.5, "{right}");
}

#[test]
fn rays_pass_glass_and_a_square_alone_sends_nothing() {
    let glass = Material { transmission: 1.0, ..painted([1.0, 1.0, 1.0]) };
    let sky = Environment::constant([1.0; 3]);
    let [white, red] = [painted([0.7, 0.7, 0.7]), painted([0.7, 0.0, 0.0])];
    let seen = found(&squares_above(vec![white.clone(), glass, red]), Some(&sky));
    let [up, down] = [seen.along.z_axis, seen.against.z_axis];
    assert!(up.x > 1.0 && up.y.abs() < 0.1 * up.x && down.y > 0.2 * down.x, "{seen:?}");
    assert!(found(&squares_above(vec![white.clone()]), Some(&sky)).is_zero());
    assert!(found(&squares_above(vec![white.clone(), white]), None).is_zero(), "no light");
}
