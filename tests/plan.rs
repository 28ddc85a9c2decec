//! What a scene does not call for is not there, and nothing is missed: the same scene with a surface that calls for it, out
//! of sight, is planned with it and gives the same picture to the last bit.

#[path = "support/gpu.rs"]
mod gpu;
#[path = "support/made.rs"]
mod made;

use etalon::frame::Settings;
use etalon::image::Picture;
use etalon::plan::{Knobs, Plan};
use etalon::scene::environment::Environment;
use etalon::scene::material::{Sampler, TextureRef};
use etalon::scene::{Image, LightKind, Material, Scene};
use etalon::study::shape::Shape;
use glam::DVec3;
use gpu::{Gpu, bits};
use made::{Made, at, lambert, orthographic, unlit};

const SIZE: [u32; 2] = [48, 36];

/// A texture of 4x4 texels of one colour, the only one of its scene.
fn one_colour(made: &mut Made, rgba: [u8; 4]) -> TextureRef {
    made.0.images = vec![Image { name: "texels".to_owned(), width: 4, height: 4, rgba: rgba.repeat(16) }];
    TextureRef { image: 0, uv_set: 0, uv_transform: glam::Affine2::IDENTITY, sampler: Sampler::default() }
}

/// A ball of one material before a darker one, and inside the first a small card of another.
fn ball(surface: Material, hidden: Option<Material>) -> Made {
    let mut made = Made::new("plan");
    made.add(Shape::sphere(1.0, 16), surface.clone(), at(0.0, 0.0, 0.0));
    made.add(Shape::sphere(0.4, 12), Material { base_color: [0.4, 0.2, 0.1, 1.0], ..surface }, at(0.9, 0.5, 1.2));
    if let Some(hidden) = hidden {
        made.add(Shape::panel(0.1, 0.1), hidden, at(0.0, 0.0, 0.0));
    }
    made.camera(DVec3::Z * 10.0, DVec3::ZERO, orthographic(1.5));
    made
}

fn metal(roughness: f32) -> Material {
    Material { base_color: [0.9, 0.7, 0.4, 1.0], metallic: 1.0, roughness, ..Material::default() }
}

struct Drawn {
    plan: Plan,
    film: Picture,
    /// Bytes of a buffer or an image by its name.
    bytes: Box<dyn Fn(&str) -> u64>,
}

fn draw(scene: &Scene, environment: Option<&Environment>, choices: &[&str]) -> Drawn {
    let gpu = Gpu::new();
    let mut knobs = Knobs::default();
    for choice in ["samples=1"].iter().chain(choices) {
        knobs.set(choice).expect("a rung");
    }
    let mut renderer = gpu.renderer(scene, environment, Settings { size: SIZE, knobs, ..Settings::default() });
    renderer.render(&scene.cameras[0], &mut |_, _| ()).expect("a picture");
    let film = renderer.film().expect("the film");
    let created = gpu.device.created();
    let bytes = move |name: &str| created.iter().find(|made| made.name == name).map_or(0, |made| made.bytes);
    Drawn { plan: renderer.plan.clone(), film, bytes: Box::new(bytes) }
}

fn state(plan: &Plan, name: &str) -> (&'static str, String) {
    let effect = plan.effects.iter().find(|effect| effect.name == name).expect("an effect");
    (effect.state, effect.reason.clone())
}

/// Two pictures, without and with what calls for an effect: not called for and kept, and the same to the last bit.
fn is_absent(effect: &str, reason: &str, without: Made, with: Made, environment: Option<&Environment>) -> [Drawn; 2] {
    let [without, with] = [without, with].map(|made| draw(&made.0, environment, &[]));
    assert_eq!(state(&without.plan, effect), ("not called for", reason.to_owned()));
    assert_eq!(state(&with.plan, effect).0, "kept");
    assert!(bits(&without.film) == bits(&with.film), "{effect}: the pictures differ");
    assert!(without.film.rgba.iter().any(|pixel| pixel[0] > 0.1), "{effect}: something is seen");
    [without, with]
}

#[test]
fn metals_call_for_no_ambient_light() {
    let environment = Environment::studio();
    let with = ball(metal(0.5), Some(lambert([0.5; 3])));
    let reason = "no material in use scatters light";
    is_absent("ambient light", reason, ball(metal(0.5), None), with, Some(&environment));
}

#[test]
fn chalk_calls_for_no_mirrored_environment() {
    let environment = Environment::studio();
    let with = ball(lambert([0.5; 3]), Some(metal(0.5)));
    let reason = "no material in use mirrors anything";
    let without = ball(lambert([0.5; 3]), None);
    let [without, with] = is_absent("mirrored environment", reason, without, with, Some(&environment));
    let name = "prefiltered environment";
    assert!((without.bytes)(name) < 1000 && (with.bytes)(name) > 10_000, "{} bytes", (without.bytes)(name));
}

#[test]
fn unlit_surfaces_call_for_no_lights_and_no_rays() {
    let lamp = LightKind::Point { position: DVec3::new(1.0, 2.0, 3.0), range: None };
    let [mut without, mut with] = [None, Some(lambert([0.5; 3]))].map(|hidden| ball(unlit([0.5, 0.6, 0.7]), hidden));
    without.light([10.0; 3], lamp);
    with.light([10.0; 3], lamp);
    let reason = "all materials in use are unlit";
    let [without, with] = is_absent("shadows", reason, without, with, None);
    assert_eq!(state(&without.plan, "punctual lights").1, reason);
    assert!(without.plan.rays.is_none() && with.plan.rays.is_some());
    assert!((without.bytes)("BVH nodes") == 0 && (with.bytes)("BVH nodes") > 0);
}

/// Neither mirrors nor scattered light are needed for what is seen through glass: all that enters a ball leaves it, which at
/// the middle is 1 − F0 of a white environment; the rest is mirrored.
#[test]
fn glass_shows_the_environment_whatever_surfaces_do() {
    let environment = Environment::constant([1.0; 3]);
    let glass = Material { transmission: 1.0, thickness: 1.0, roughness: 0.0, ior: 1.5, ..Material::default() };
    let mut made = Made::new("glass");
    made.add(Shape::sphere(1.0, 32), Material { metallic: 0.0, ..glass }, at(0.0, 0.0, 0.0));
    made.camera(DVec3::Z * 10.0, DVec3::ZERO, orthographic(1.5));
    for choices in [&["reflection=off"][..], &["reflection=off", "indirect=off"], &["indirect=off"]] {
        let drawn = draw(&made.0, Some(&environment), choices);
        let middle = drawn.film.rgba[(SIZE[1] / 2 * SIZE[0] + SIZE[0] / 2) as usize];
        let expected = if choices.contains(&"reflection=off") { 0.96 } else { 1.0 };
        assert!((middle[0] - expected).abs() < 1e-4, "{choices:?}: {middle:?}");
    }
}

/// What has a black texture for a factor is drawn as if the factor were 0, with a plan as if there were neither.
#[test]
fn black_textures_call_for_nothing() {
    let environment = Environment::studio();
    let plain = Material { base_color: [0.5, 0.6, 0.7, 1.0], roughness: 0.6, metallic: 0.0, ..Material::default() };
    type Change = fn(&mut Material, TextureRef);
    let changes: [(&str, [u8; 4], Change); 4] = [
        ("emissive textures", [0, 0, 0, 255], |m, t| (m.emissive, m.emissive_texture) = ([5.0; 3], Some(t))),
        ("refraction", [0, 255, 255, 255], |m, t| (m.transmission, m.transmission_texture) = (1.0, Some(t))),
        ("clear coat", [0, 255, 255, 255], |m, t| (m.clearcoat, m.clearcoat_texture) = (1.0, Some(t))),
        ("mirrors", [255, 255, 0, 255], |m, t| {
            (m.metallic, m.specular, m.metallic_roughness_texture) = (1.0, 0.0, Some(t));
        }),
    ];
    for (effect, texel, change) in changes {
        let drawn = |texel: Option<[u8; 4]>| {
            let mut made = ball(plain.clone(), None);
            let texture = one_colour(&mut made, texel.unwrap_or([255; 4]));
            for material in &mut made.0.materials {
                change(material, texture);
                if texel.is_none() {
                    // The same material by its factors.
                    *material = plain_of(material);
                }
            }
            draw(&made.0, Some(&environment), &[])
        };
        let (black, without) = (drawn(Some(texel)), drawn(None));
        assert_eq!(state(&without.plan, effect).0, "not called for", "{effect}");
        assert_eq!(state(&black.plan, effect).0, "not called for", "{effect}");
        assert!(bits(&black.film) == bits(&without.film), "{effect}: the pictures differ");
    }
}

/// Without what its textures multiply.
fn plain_of(material: &Material) -> Material {
    Material {
        emissive: [0.0; 3],
        emissive_texture: None,
        transmission: 0.0,
        transmission_texture: None,
        clearcoat: 0.0,
        clearcoat_texture: None,
        metallic: 0.0,
        metallic_roughness_texture: None,
        ..material.clone()
    }
}

#[test]
fn dark_lights_are_no_lights() {
    let lamp = |x| LightKind::Point { position: DVec3::new(x, 2.0, 3.0), range: None };
    let mut lit = ball(lambert([0.5; 3]), None);
    lit.light([10.0; 3], lamp(1.0));
    let alone = draw(&lit.0, None, &[]);
    lit.light([0.0; 3], lamp(-1.0));
    let both = draw(&lit.0, None, &[]);
    assert!(bits(&alone.film) == bits(&both.film));
    assert_eq!((alone.plan.local_lights, both.plan.local_lights), (1, 1));
    let effect = both.plan.effects.iter().find(|effect| effect.name == "shadows").expect("an effect");
    assert_eq!(effect.evidence["dark"], "1");

    let mut dark = ball(lambert([0.5; 3]), None);
    dark.light([0.0; 3], lamp(1.0));
    let dark = draw(&dark.0, None, &[]);
    assert_eq!(state(&dark.plan, "shadows"), ("not called for", "all lights of the scene are dark".to_owned()));
    assert!(dark.plan.rays.is_none());
    assert!(dark.film.rgba.iter().all(|pixel| pixel[..3] == [0.0; 3]));
}
