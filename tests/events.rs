//! The events of a pixel's rays, compared with closed forms for plates, spheres, metals and shadows.

use etalon::optics::fresnel::fresnel_dielectric;
use etalon::prepare::Original;
use etalon::scene::{Instance, LightKind, Material, Scene};
use etalon::study::shape::Shape;
use etalon::transport::events::{Event, EventTracer, Limits, Way};
use etalon_testing::made::{Made, at, lambert, perspective};
use glam::DVec3;

const LIMITS: Limits = Limits { surfaces: 8, roughest: 0.2, least_share: 0.01, proxies: true };

fn glass(ior: f32) -> Material {
    Material {
        ior,
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        thickness: 1.0,
        base_color: [1.0; 4],
        ..Material::default()
    }
}

/// The ray of the middle of a picture of 3x3 pixels.
fn middle(scene: &Scene) -> Vec<Event> {
    EventTracer::new(scene, Original::from(scene.clone()).bvh().expect("a tree")).follow(
        scene,
        &scene.cameras[0],
        [3, 3],
        [1, 1],
        &LIMITS,
    )
}

/// The event that goes on from another by a way.
fn after(events: &[Event], index: Option<usize>, way: Way) -> Option<(usize, Event)> {
    events.iter().cloned().enumerate().find(|(_, event)| event.after == index && event.way == way)
}

#[test]
fn a_plate_shifts_a_ray_and_shares_its_light() {
    let mut made = Made::new("plate");
    made.add(Shape::cuboid(DVec3::new(4.0, 4.0, 0.5)), glass(1.5), at(0.0, 0.0, 0.0));
    let direction = DVec3::new(0.6, 0.0, -0.8);
    made.camera(-direction * 5.0, DVec3::ZERO, perspective(30.0));
    let events = middle(&made.0);
    let (first, seen) = after(&events, None, Way::Seen).expect("the plate");
    let interaction = seen.interaction.expect("a surface");
    let [reflected, ..] = fresnel_dielectric(0.8, 1.5);
    assert!(
        (interaction.cos - 0.8).abs() < 1e-6
            && (interaction.ratio - 1.5).abs() < 1e-6
            && (interaction.reflected - reflected).abs() < 1e-6
    );
    let (second, inside) = after(&events, Some(first), Way::Bent).expect("it enters");
    // sin β = 0.6/1.5.
    let way = (inside.to - inside.from).normalize();
    assert!((way - DVec3::new(0.4, 0.0, -(1.0 - 0.16_f64).sqrt())).length() < 1e-6, "{way}");
    assert!((inside.share - (1.0 - reflected)).abs() < 1e-6, "{}", inside.share);
    let leaves = inside.interaction.expect("the other side");
    assert!((leaves.ratio - 1.0 / 1.5).abs() < 1e-6 && !leaves.total);
    let (_, out) = after(&events, Some(second), Way::Bent).expect("it leaves");
    assert!(((out.to - out.from).normalize() - direction).length() < 1e-6, "parallel to where it came from");
    assert!((out.share - (1.0 - reflected).powi(2)).abs() < 1e-6 && out.interaction.is_none());
    let (_, mirrored) = after(&events, Some(first), Way::Mirrored).expect("a mirror image");
    assert!(((mirrored.to - mirrored.from).normalize() - DVec3::new(0.6, 0.0, 0.8)).length() < 1e-6);
    // The weights of all rays that end add up to 1, less the weight of rays below the cutoff.
    let ends = |index: usize| events.iter().all(|event| event.after != Some(index));
    let sum: f64 = events.iter().enumerate().filter(|(i, _)| ends(*i)).map(|(_, event)| event.share).sum();
    assert!(sum > 0.98 && sum <= 1.0 + 1e-9, "{sum}");
}

#[test]
fn steep_rays_stay_inside() {
    let mut made = Made::new("prism");
    made.add(Shape::cuboid(DVec3::new(2.0, 2.0, 2.0)), glass(1.5), at(0.0, 0.0, 0.0));
    // Through a side face near its middle, far off the normal of the top.
    made.camera(DVec3::new(-3.0, -4.5, 0.1), DVec3::new(-1.0, 0.0, 0.1), perspective(30.0));
    let events = middle(&made.0);
    let total =
        events.iter().filter(|event| event.interaction.as_ref().is_some_and(|interaction| interaction.total)).count();
    assert!(total > 0, "the top throws all back: {events:?}");
    for (index, event) in events
        .iter()
        .enumerate()
        .filter(|(_, event)| event.interaction.as_ref().is_some_and(|interaction| interaction.total))
    {
        assert!(after(&events, Some(index), Way::Bent).is_none(), "nothing goes on from {event:?}");
        assert_eq!(event.interaction.as_ref().map(|interaction| interaction.reflected), Some(1.0));
    }
}

#[test]
fn nested_dielectrics_refract_by_the_ratio_of_their_indices() {
    let mut made = Made::new("nested");
    made.add(Shape::cuboid(DVec3::splat(4.0)), glass(1.3), at(0.0, 0.0, 0.0));
    made.add(Shape::cuboid(DVec3::splat(2.0)), glass(1.7), at(0.0, 0.0, 0.0));
    made.camera(DVec3::Z * 9.0, DVec3::ZERO, perspective(30.0));
    let events = middle(&made.0);
    let mut ratios = Vec::new();
    let mut at = after(&events, None, Way::Seen);
    while let Some((index, event)) = at {
        ratios.extend(event.interaction.as_ref().map(|interaction| interaction.ratio));
        at = after(&events, Some(index), Way::Bent);
    }
    let expected = [1.3, 1.7 / 1.3, 1.3 / 1.7, 1.0 / 1.3];
    assert_eq!(ratios.len(), 4, "{ratios:?}");
    assert!(ratios.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{ratios:?}");
}

/// A ray enters twice and leaves twice. Where the second mesh begins and where the first ends, the medium does not
/// change (shaders/lib/media.glsl).
#[test]
fn overlapping_meshes_of_one_glass_act_as_one() {
    let mut made = Made::new("overlap");
    made.add(Shape::cuboid(DVec3::splat(2.0)), glass(1.5), at(0.0, 0.0, 0.0));
    let second = Instance { world_from_object: at(0.1, 0.1, 1.0), ..made.0.instances[0].clone() };
    made.0.instances.push(second);
    made.camera(DVec3::Z * 9.0, DVec3::ZERO, perspective(30.0));
    let events = middle(&made.0);
    let mut ways = Vec::new();
    let mut from = None;
    loop {
        let on = [Way::Seen, Way::Bent, Way::Straight].into_iter().find_map(|way| after(&events, from, way));
        let Some((index, event)) = on else { break };
        ways.push((event.way, event.interaction.as_ref().map(|interaction| interaction.ratio)));
        from = Some(index);
    }
    let expected = [
        (Way::Seen, Some(1.5)),
        (Way::Bent, Some(1.0)),
        (Way::Straight, Some(1.0)),
        (Way::Straight, Some(1.0 / 1.5)),
        (Way::Bent, None),
    ];
    assert_eq!(ways, expected);
}

#[test]
fn a_coat_and_what_lies_below_share_a_mirror_image() {
    let gold = Material {
        base_color: [0.9, 0.6, 0.3, 1.0],
        metallic: 1.0,
        roughness: 0.0,
        clearcoat: 0.5,
        clearcoat_roughness: 0.0,
        ..Material::default()
    };
    // Green light; a metal that is given by its colour alone has Schlick's curve.
    let coat = 0.5 * fresnel_dielectric(0.8, 1.5)[0];
    let metal = 0.6 + 0.4 * 0.2_f64.powi(5);
    let rough = Material { roughness: 0.5, ..gold.clone() };
    for (material, followed) in [(gold, coat + (1.0 - coat) * metal), (rough, coat)] {
        let mut made = Made::new("coated");
        made.add(Shape::cuboid(DVec3::new(4.0, 4.0, 0.5)), material, at(0.0, 0.0, 0.0));
        made.camera(DVec3::new(-3.0, 0.0, 4.0), DVec3::ZERO, perspective(30.0));
        // The ray meets the top, 0.25 m nearer than the middle.
        let events = middle(&made.0);
        let (first, seen) = after(&events, None, Way::Seen).expect("the plate");
        let interaction = seen.interaction.expect("a surface");
        assert!((interaction.reflected - (coat + (1.0 - coat) * metal)).abs() < 1e-6, "{}", interaction.reflected);
        let (_, mirrored) = after(&events, Some(first), Way::Mirrored).expect("a mirror image");
        assert!((mirrored.share - followed).abs() < 1e-6, "{} for {followed}", mirrored.share);
        // What is too rough to be followed is spread.
        assert_eq!(interaction.spreads, followed == coat);
    }
}

#[test]
fn a_sheet_tints_what_goes_straight_through() {
    let sheet = Material { base_color: [1.0, 0.5, 0.2, 1.0], thickness: 0.0, double_sided: true, ..glass(1.5) };
    let mut made = Made::new("sheet");
    made.add(Shape::panel(4.0, 4.0), sheet, at(0.0, 0.0, 0.0));
    made.camera(DVec3::new(0.0, 3.0, 4.0), DVec3::ZERO, perspective(30.0));
    let events = middle(&made.0);
    let (first, _) = after(&events, None, Way::Seen).expect("the sheet");
    let (_, through) = after(&events, Some(first), Way::Straight).expect("it goes through");
    let expected = 0.5 * (1.0 - fresnel_dielectric(0.8, 1.5)[0]);
    assert!((through.share - expected).abs() < 1e-6, "{} for {expected}", through.share);
}

#[test]
fn events_name_what_occludes_a_light() {
    let mut made = Made::new("shadow");
    made.add(Shape::cuboid(DVec3::new(8.0, 0.1, 8.0)), lambert([0.5; 3]), at(0.0, -0.05, 0.0));
    made.add(Shape::cuboid(DVec3::new(1.0, 0.1, 1.0)), lambert([0.5; 3]), at(0.0, 2.0, 0.0));
    let lamp = |x: f64, y: f64| LightKind::Point { position: DVec3::new(x, y, 0.0), range: None };
    for kind in [lamp(0.0, 4.0), lamp(4.0, 4.0), lamp(0.0, -4.0)] {
        made.light([1.0; 3], kind);
    }
    made.camera(DVec3::new(0.0, 1.0, 5.0), DVec3::ZERO, perspective(30.0));
    let events = middle(&made.0);
    let (floor, seen) = after(&events, None, Way::Seen).expect("the floor");
    assert!(
        seen.interaction.as_ref().is_some_and(|interaction| interaction.instance == 0 && interaction.spreads)
            && seen.to.length() < 1e-6,
        "{seen:?}"
    );
    let to = |light: usize| after(&events, Some(floor), Way::ToLight(light)).map(|(_, event)| event);
    assert_eq!(
        to(0).and_then(|event| event.interaction).map(|interaction| interaction.instance),
        Some(1),
        "the board stands before the first"
    );
    assert!(
        to(1)
            .is_some_and(|event| event.interaction.is_none() && (event.to - DVec3::new(4.0, 4.0, 0.0)).length() < 1e-9)
    );
    assert!(to(2).is_none(), "the third lies below the floor");
}
