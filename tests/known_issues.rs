//! Bugs that are known and not yet mended, each as a test that passes while the bug is there. A test that fails here is
//! good news: delete it, and tighten the test that its comment names.

#[path = "support/gpu.rs"]
mod gpu;
#[path = "support/made.rs"]
mod made;
#[path = "support/program.rs"]
mod program;

use etalon::frame::Settings;
use etalon::image::tone::ToneMap;
use etalon::scene::LightKind;
use etalon::study::shape::Shape;
use glam::{DAffine3, DVec3};
use gpu::{Gpu, settings};

/// A mesh without vertex colours and textures passes the constant 1 through perspective interpolation (0.99999994 at
/// some pixels) and then into RGBA16F, which lavapipe rounds downwards: 0.99951. Albedo, and with it radiance, is off by
/// 2^-11 at those pixels. When mended: raster.rs, `check`, demands equal bits of albedo.
#[test]
fn untextured_albedo_loses_an_ulp_of_half() {
    let gpu = Gpu::new();
    let mut scene = made::Made::new("albedo");
    scene.add(Shape::plane(8.0, 8.0, 1), made::lambert([0.7, 0.3, 0.1]), made::at(0.0, -1.0, -4.0));
    scene.camera(DVec3::ZERO, DVec3::new(0.0, -1.0, -4.0), made::perspective(40.0));
    let (aovs, _) = gpu.renderer(&scene.0, None, settings([64, 36])).aovs(&scene.0.cameras[0]).expect("AOVs");
    let seen: Vec<_> = aovs.iter().filter(|p| p.material != 0).collect();
    let wrong = seen.iter().filter(|p| p.albedo != [0.7, 0.3, 0.1]).count();
    eprintln!("{wrong} of {} pixels", seen.len());
    assert!(wrong > 0, "mended");
}

/// `tone` of lib/colour.glsl does not cut at 65504 as its twin in image/tone.rs does: three curves then divide infinity by
/// infinity, and the brightest pixels of a picture are black. The twin shows white. When mended: tone.rs,
/// `light_beyond_f32_is_counted_as_infinite`, loops over all curves; `every_curve_shows_the_bytes_of_its_twin` may go on
/// to radiances of 1e38.
#[test]
fn infinite_radiance_is_shown_as_black() {
    let gpu = Gpu::new();
    let mut made = made::Made::new("overflow");
    made.add(Shape::panel(8.0, 4.0), made::lambert([1.0; 3]), DAffine3::IDENTITY);
    made.light([1e38; 3], LightKind::Point { position: DVec3::new(0.0, 0.0, 0.01), range: None });
    made.front(1.0);
    for tonemap in [ToneMap::Reinhard, ToneMap::Aces, ToneMap::KhronosNeutral] {
        let (rendered, film) = gpu.shot(&made.0, None, Settings { tonemap, ..settings([64, 36]) });
        let at = film.rgba.iter().position(|p| p[0].is_infinite()).expect("too much light");
        assert_eq!(tonemap.to_display([f64::INFINITY; 3])[0], 255, "the twin's promise");
        assert_eq!(rendered.display[at * 4], 0, "{tonemap:?}: mended");
    }
}

/// The report lacks names of the contract (product.md, "JSON names"): phases, the rays by kind, and all of the plan but
/// its effects. When mended: cli.rs, `the_report_has_every_name_of_the_contract`, takes them into its list.
#[test]
fn the_report_lacks_names_of_the_contract() {
    let folder = tempfile::tempdir().expect("a folder");
    let arguments = ["render", "study:radiance", "--size", "16x9", "-q", "-o", "a.png", "--report", "r.json"];
    program::etalon(folder.path(), &arguments, &[]).succeeded();
    let text = std::fs::read_to_string(folder.path().join("r.json")).expect("the report");
    let report: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    for pointer in [
        "/phases_ms/start",
        "/phases_ms/bvh",
        "/phases_ms/pipelines",
        "/plan/schema",
        "/plan/effects/0/evidence",
        "/plan/passes",
        "/plan/pipelines",
        "/plan/buffers",
        "/plan/warnings",
        "/work/rays/primary",
        "/work/rays/reflection",
        "/work/rays/refraction",
        "/work/rays/shadow",
        "/work/rays/indirect",
    ] {
        assert!(report.pointer(pointer).is_none(), "{pointer}: mended");
    }
}

/// `FragmentLists::dropped` is created and then only ever added to: a second picture of the same renderer counts the
/// first one's pixels again, and more samples count each pixel again, so that the warning speaks of more pixels than there
/// are. When mended: see_through.rs,
/// `what_one_invocation_cannot_sort_is_counted`, draws twice and with samples=4.
#[test]
fn dropped_pixels_are_counted_again_with_every_picture() {
    let gpu = Gpu::new();
    let mut made = made::Made::new("too many");
    for i in 0..230 {
        made.add(Shape::panel(1.0, 8.0), made::pane([1.0; 3], 0.125), made::at(0.0, 0.0, 0.01 * f64::from(i)));
    }
    made.front(2.0);
    let mut renderer = gpu.renderer(&made.0, None, settings([32, 16]));
    let mut dropped = || renderer.render(&made.0.cameras[0], &mut |_, _| ()).expect("a picture").dropped;
    let (first, second) = (dropped(), dropped());
    eprintln!("{first} pixels, then {second}");
    assert_eq!(second, 2 * first, "mended");
}

/// The same counter is never cleared: it begins with what the memory held before, here staging of the environment or of a
/// texture, so that the plainest call of a see-through scene warns of a thousand million pixels. When mended: delete this;
/// see_through.rs asserts `dropped == 0` where it draws.
#[test]
fn dropped_pixels_begin_with_whatever_the_memory_held() {
    let gpu = Gpu::new();
    let scene = etalon::study::load("blend").expect("a study scene");
    let environment = etalon::scene::environment::Environment::studio();
    let (rendered, _) = gpu.shot(&scene, Some(&environment), settings([96, 54]));
    eprintln!("{} of {} pixels", rendered.dropped, 96 * 54);
    assert!(rendered.dropped > 96 * 54, "mended");
}

/// A spot whose cones differ by less than 0.001 in cosine (any spot narrower than 2.6 degrees) has its ramp stretched over
/// 0.001 (`shared_light`), so that its axis gets a fraction of the intensity: 2 % at an outer angle of 1 degree. When
/// mended: light.rs, `a_spot_has_a_squared_ramp_between_its_cones`, takes these cones into its list.
#[test]
fn narrow_spots_never_reach_their_strength() {
    let gpu = Gpu::new();
    for (inner, outer, share) in [(0.5_f64, 1.0_f64, 0.05), (0.0, 2.0, 0.5)] {
        let mut made = made::Made::new("narrow");
        made.add(Shape::panel(8.0, 4.0), made::lambert([1.0; 3]), DAffine3::IDENTITY);
        let (inner, outer) = (inner.to_radians(), outer.to_radians());
        let kind = LightKind::Spot { position: DVec3::Z, direction: DVec3::NEG_Z, range: None, inner, outer };
        made.light([std::f32::consts::PI; 3], kind);
        made.front(0.001);
        let film = gpu.film(&made.0, settings([9, 9]));
        let axis = film.rgba[40][0];
        eprintln!("{inner} to {outer}: {axis} on the axis, not 1");
        assert!(f64::from(axis) < share, "mended");
    }
}

/// lavapipe runs no more than 65,535 iterations of all loops of an invocation together (lavapipe.md). The lights of a pixel
/// with many see-through surfaces, or more lights than that, go beyond it, and what is left over is left out in silence:
/// no count, no warning.
#[test]
fn loops_end_at_lavapipe_s_limit_in_silence() {
    let gpu = Gpu::new();
    let shot = |panes: usize, lights: usize| {
        let mut made = made::Made::new("loops");
        let material = etalon::scene::Material {
            base_color: [1.0, 1.0, 1.0, 0.03],
            alpha_mode: etalon::scene::AlphaMode::Blend,
            ..made::lambert([1.0; 3])
        };
        let opaque = made::lambert([1.0; 3]);
        for i in 0..panes.max(1) {
            let material = if panes == 0 { opaque.clone() } else { material.clone() };
            made.add(Shape::panel(8.0, 4.0), material, made::at(0.0, 0.0, -0.01 * i as f64));
        }
        for _ in 0..lights {
            let kind = LightKind::Point { position: DVec3::Z * 5.0, range: None };
            made.light([1e5 / lights as f32; 3], kind);
        }
        made.front(1.0);
        let (rendered, film) = gpu.shot(&made.0, None, settings([8, 8]));
        (film.rgba[36][0], rendered.counts)
    };
    for (panes, few, many) in [(0, 100, 70_000), (100, 10, 1000)] {
        let ((want, _), (got, counts)) = (shot(panes, few), shot(panes, many));
        eprintln!("{panes} panes: {want} of {few} lights, {got} of {many}; {counts:?}");
        // The same light in all: rounding of the longer sum is 70,000 · 2^-24 at most.
        assert!(f64::from(got) < 0.97 * f64::from(want), "{panes} panes: mended");
    }
}
