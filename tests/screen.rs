//! The rungs `screen`: mirror images against an f64 ray cast of the reflected ray, which also says whether what it
//! meets is in the picture at all; the view through bodies against Snell's law and their nominal thickness.

use etalon::frame::{Rendered, Settings};
use etalon::image::Picture;
use etalon::scene::environment::Environment;
use etalon::scene::{Camera, Material, Projection, Scene};
use etalon::study;
use etalon::study::shape::Shape;
use etalon_testing::gpu::{Gpu, bits, knobs, largest_difference, settings};
use etalon_testing::made::{Made, at, unlit};
use etalon_testing::raycast::{Options, Ray, World, camera_ray};
use glam::{DAffine3, DVec2, DVec3};

const SIZE: [u32; 2] = [160, 90];
const PLAIN: Options = Options { blend: false, textures: false };

fn on(choices: &[&str]) -> Settings {
    let all: Vec<&str> = ["samples=1"].iter().chain(choices).copied().collect();
    Settings { knobs: knobs(&all), ..settings(SIZE) }
}

fn mirror() -> Material {
    Material { metallic: 1.0, roughness: 0.0, double_sided: true, ..Material::default() }
}

/// A wall of square cells in the plane z = 0, unlit, whose colours encode their position: column and row in red and
/// green over blue.
fn cells(made: &mut Made, columns: u32, rows: u32, edge: f64, world_from_wall: DAffine3) {
    for (i, j) in (0..columns).flat_map(|i| (0..rows).map(move |j| (i, j))) {
        let color = [(i + 1) as f32 / 16.0, (j + 1) as f32 / 16.0, 1.0];
        let place = at((f64::from(i) - 0.5 * f64::from(columns - 1)) * edge, (f64::from(j) + 0.5) * edge, 0.0);
        made.add(Shape::panel(edge, edge), unlit(color), world_from_wall * place);
    }
}

/// A pixel of the picture divided by its blue: what a grey share of a cell's radiance keeps.
fn hue(pixel: &[f32; 4]) -> Option<DVec2> {
    (pixel[2] > 0.0).then(|| DVec2::new(f64::from(pixel[0] / pixel[2]), f64::from(pixel[1] / pixel[2])))
}

/// Where a camera sees a point, in pixels, and how far away along the view.
fn project(camera: &Camera, size: [u32; 2], p: DVec3) -> (DVec2, f64) {
    let local = camera.world_from_camera.inverse().transform_point3(p);
    let (w, h) = (f64::from(size[0]), f64::from(size[1]));
    let half = match camera.projection {
        Projection::Perspective { fov_y, .. } => -local.z * (0.5 * fov_y).tan(),
        Projection::Orthographic { half_height, .. } => half_height,
    };
    let y = 0.5 * h - local.y / half * 0.5 * h;
    (DVec2::new(0.5 * w + local.x / half * 0.5 * h, y), -local.z)
}

fn pixels(size: [u32; 2]) -> impl Iterator<Item = (usize, DVec2)> {
    (0..size[0] * size[1])
        .map(move |i| (i as usize, DVec2::new(f64::from(i % size[0]) + 0.5, f64::from(i / size[0]) + 0.5)))
}

fn reflect(d: DVec3, n: DVec3) -> DVec3 {
    d - n * (2.0 * d.dot(n))
}

/// Whether the picture shows a point: in it, and nothing before it.
fn shown(world: &World<'_>, camera: &Camera, size: [u32; 2], p: DVec3) -> bool {
    let (at, depth) = project(camera, size, p);
    let inside =
        depth > 0.0 && at.cmpge(DVec2::ZERO).all() && at.cmplt(DVec2::new(size[0].into(), size[1].into())).all();
    inside
        && world
            .closest(&camera_ray(camera, size[0], size[1], at.x, at.y))
            .is_some_and(|hit| (hit.position - p).length() < 1e-6 * depth)
}

/// What a mirroring pixel may show: the hues seen within `bound` pixels of where the picture shows the point.
fn hues_around(world: &World<'_>, scene: &Scene, size: [u32; 2], at: DVec2, bound: f64) -> Vec<DVec2> {
    let camera = &scene.cameras[0];
    let steps = [-1.0, -0.5, 0.0, 0.5, 1.0];
    let near = steps.iter().flat_map(|x| steps.map(|y| at + DVec2::new(*x, y) * bound));
    near.filter_map(|at| {
        let color =
            scene.materials[world.closest(&camera_ray(camera, size[0], size[1], at.x, at.y))?.material].base_color;
        hue(&color)
    })
    .collect()
}

struct Counted {
    right: usize,
    wrong: usize,
    /// Of mirrored points that the picture does not show: those that show nothing …
    empty: usize,
    /// … and those that show something else.
    invented: usize,
}

/// Compares the pixels in which instance 0 mirrors something with the ray cast. Nothing lights the scene and there is
/// no environment: what a mirror shows comes off the screen.
fn against_rays(film: &Picture, scene: &Scene, bound: f64) -> Counted {
    let size = [film.width, film.height];
    let world = World::new(scene, PLAIN);
    let camera = &scene.cameras[0];
    let mut counted = Counted { right: 0, wrong: 0, empty: 0, invented: 0 };
    // What the floor mirrors there; `None` off the floor.
    let mirrored = |at: DVec2| {
        let ray = camera_ray(camera, size[0], size[1], at.x, at.y);
        let floor = world.closest(&ray).filter(|hit| hit.instance == 0)?;
        let mut mirrored = Ray::new(floor.position, reflect(ray.direction, floor.shading_normal));
        mirrored.nearest = 1e-9;
        Some(world.closest(&mirrored))
    };
    let corners = [DVec2::ONE, DVec2::NEG_ONE, DVec2::new(1.0, -1.0), DVec2::new(-1.0, 1.0)];
    for (i, at) in pixels(size) {
        let Some(found) = mirrored(at) else { continue };
        let Some(hit) = found else {
            let alone = [DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y]
                .iter()
                .all(|step| mirrored(at + *step * bound).is_none_or(|found| found.is_none()));
            assert!(!alone || film.rgba[i][..3] == [0.0; 3], "{at}: mirrors nothing");
            continue;
        };
        let got = hue(&film.rgba[i]);
        let (place, _) = project(camera, size, hit.position);
        // Points at the border or at an outline are anyone's.
        let beside = [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y];
        let fates = beside.map(|step| {
            let ray = camera_ray(camera, size[0], size[1], place.x + step.x * bound, place.y + step.y * bound);
            let same = world
                .closest(&ray)
                .is_some_and(|h| scene.instances[h.instance].name == scene.instances[hit.instance].name);
            let (x, y) = (place.x + step.x * bound, place.y + step.y * bound);
            same && x >= 0.0 && y >= 0.0 && x < f64::from(size[0]) && y < f64::from(size[1])
        });
        let is_shown = shown(&world, camera, size, hit.position);
        if is_shown && fates.iter().all(|f| *f) {
            // As far off may be what the ray passes on its way: what a ray from beside here meets.
            let beside = corners.iter().filter_map(|step| mirrored(at + *step * bound)??.material.into());
            let passed = beside.filter_map(|material| hue(&scene.materials[material].base_color));
            let mut may = hues_around(&world, scene, size, place, bound).into_iter().chain(passed);
            let right = got.is_some_and(|got| may.any(|hue| (hue - got).length() < 1e-3));
            *(if right { &mut counted.right } else { &mut counted.wrong }) += 1;
            if !right && counted.wrong < 4 {
                eprintln!("{at}: {got:?} for {place}");
            }
        } else if !is_shown && fates.iter().all(|f| !*f) {
            *(if got.is_none() { &mut counted.empty } else { &mut counted.invented }) += 1;
        }
    }
    counted
}

/// A mirroring floor before a wall of cells.
fn room(camera: (DVec3, DVec3, Projection)) -> Made {
    let mut made = Made::new("room");
    made.add(Shape::plane(8.0, 8.0, 1), mirror(), DAffine3::IDENTITY);
    cells(&mut made, 14, 8, 0.25, at(0.0, 0.0, -2.0));
    made.camera(camera.0, camera.1, camera.2);
    made
}

fn standing() -> (DVec3, DVec3, Projection) {
    (DVec3::new(0.3, 1.1, 3.0), DVec3::new(0.1, 0.2, -1.0), etalon_testing::made::perspective(40.0))
}

#[test]
fn a_floor_mirrors_what_the_picture_shows() {
    let gpu = Gpu::open();
    let cameras = [
        standing(),
        // Near the floor and rolled, so to speak: the wall runs off the side and the top of the picture.
        (DVec3::new(1.4, 0.3, 1.0), DVec3::new(0.0, 0.35, -2.0), etalon_testing::made::perspective(30.0)),
        (DVec3::new(2.0, 3.0, 3.0), DVec3::new(0.0, 0.0, -1.2), etalon_testing::made::orthographic(1.3)),
    ];
    for camera in cameras {
        let made = room(camera);
        let film = gpu.film(&made.0, on(&["reflection=screen"]));
        let counted = against_rays(&film, &made.0, 1.0);
        eprintln!(
            "right {}, wrong {}, empty {}, invented {}",
            counted.right, counted.wrong, counted.empty, counted.invented
        );
        assert!(counted.right > 500 && counted.wrong == 0, "{} right, {} wrong", counted.right, counted.wrong);
        // The wall is all there is: what lies outside of the picture is not found in it.
        assert_eq!(counted.invented, 0);
    }
    let without = gpu.film(&room(standing()).0, on(&["reflection=environment"]));
    assert_eq!(against_rays(&without, &room(standing()).0, 1.0).right, 0, "the rung below mirrors none of it");
}

/// Something in between, and curved: a ball, and a post before the wall.
#[test]
fn what_stands_on_the_floor_is_mirrored_and_hides() {
    let gpu = Gpu::open();
    let mut made = room(standing());
    made.add(Shape::sphere(0.35, 48), unlit([2.0, 0.5, 1.0]), at(-0.5, 0.4, -0.5));
    made.add(Shape::cuboid(DVec3::new(0.2, 1.2, 0.2)), unlit([0.5, 2.0, 1.0]), at(0.6, 0.6, -0.8));
    for (i, name) in ["ball", "post"].iter().enumerate() {
        let at = made.0.instances.len() - 2 + i;
        made.0.instances[at].name = (*name).to_owned();
    }
    let film = gpu.film(&made.0, on(&["reflection=screen"]));
    let counted = against_rays(&film, &made.0, 1.0);
    eprintln!(
        "right {}, wrong {}, empty {}, invented {}",
        counted.right, counted.wrong, counted.empty, counted.invented
    );
    // The ball's outline is a pixel deep: where it is seen nearly edge-on, at its foot, a ray may pass behind that.
    assert!(
        counted.right > 1000 && counted.wrong * 500 < counted.right,
        "{} right, {} wrong",
        counted.right,
        counted.wrong
    );
    // A hidden point's ray may go on to another one that is shown: the far side of the ball and of the post, where the
    // wall behind them takes their place.
    assert!(counted.invented * 10 < counted.right, "{} invented", counted.invented);
}

#[test]
fn nothing_behind_the_camera_or_hidden_is_mirrored() {
    let gpu = Gpu::open();
    let environment = Environment::constant([0.25, 0.5, 0.125]);
    let seen = |made: &Made, rung: &str| gpu.shot(&made.0, Some(&environment), on(&[rung])).1;
    // A mirror that faces the camera, and light behind that.
    let mut made = Made::new("behind");
    made.add(Shape::panel(4.0, 4.0), mirror(), at(0.0, 0.0, -1.0) * DAffine3::from_rotation_x(-0.2));
    cells(&mut made, 12, 8, 0.5, at(0.0, -1.0, 6.0));
    made.camera(DVec3::new(0.1, 0.2, 4.0), DVec3::ZERO, etalon_testing::made::perspective(40.0));
    assert_eq!(bits(&seen(&made, "reflection=screen")), bits(&seen(&made, "reflection=environment")));
    // A red panel lies face down on the far side of a block: the floor would mirror it, the eye cannot see it.
    let mut made = Made::new("hidden");
    made.add(Shape::plane(8.0, 8.0, 1), mirror(), DAffine3::IDENTITY);
    made.add(Shape::cuboid(DVec3::new(6.0, 1.0, 0.1)), unlit([0.0, 1.0, 0.0]), at(0.0, 1.0, 0.0));
    made.add(Shape::panel(5.0, 0.9), unlit([1.0, 0.0, 0.0]), at(0.0, 1.0, -0.2));
    made.camera(DVec3::new(0.0, 1.0, 4.0), DVec3::new(0.0, 0.8, 0.0), etalon_testing::made::perspective(35.0));
    let film = gpu.film(&made.0, on(&["reflection=screen"]));
    assert!(film.rgba.iter().all(|p| p[0] == 0.0), "the hidden panel shows");
    let green = film.rgba.iter().filter(|p| p[1] > 0.5).count();
    assert!(green > 2000, "{green} pixels of the block and its image");
}

#[test]
fn a_scene_whose_mirror_images_all_miss_is_that_of_the_environment() {
    let gpu = Gpu::open();
    let environment = Environment::studio();
    for material in
        [mirror(), Material { roughness: 0.15, metallic: 0.0, clearcoat: 1.0, clearcoat_roughness: 0.05, ..mirror() }]
    {
        let mut made = Made::new("ball");
        made.add(Shape::sphere(1.0, 48), material, DAffine3::IDENTITY);
        made.camera(DVec3::new(0.0, 1.0, 4.0), DVec3::ZERO, etalon_testing::made::perspective(35.0));
        let [screen, below] = ["screen", "environment"].map(|rung| {
            let (rendered, film) = gpu.shot(&made.0, Some(&environment), on(&[&format!("reflection={rung}")]));
            let marched = rendered.passes.iter().any(|p| p.name == "screen-space reflection");
            assert_eq!(marched, rung == "screen");
            film
        });
        assert_eq!(bits(&screen), bits(&below));
    }
}

/// In a furnace of 1 a wall of 1 takes the environment's place without a trace, so the shares are the same.
#[test]
fn what_is_met_has_the_weight_of_the_environment_that_it_replaces() {
    let gpu = Gpu::open();
    let environment = Environment::constant([1.0; 3]);
    let glossy = Material { roughness: 0.15, ..mirror() };
    for (floor, choices) in [
        (mirror(), vec![]),
        (glossy.clone(), vec!["brdf=ggx-multi"]),
        (Material { metallic: 0.3, base_color: [0.9, 0.5, 0.1, 1.0], ..glossy.clone() }, vec!["fresnel=exact"]),
        (Material { metallic: 0.0, clearcoat: 0.7, clearcoat_roughness: 0.1, ..glossy }, vec![]),
    ] {
        let seen = |color: [f32; 3], rung: &str| {
            let mut made = Made::new("furnace");
            made.add(Shape::plane(8.0, 8.0, 1), floor.clone(), DAffine3::IDENTITY);
            made.add(Shape::panel(4.0, 2.0), unlit(color), at(0.0, 1.0, -2.0));
            let (eye, target, projection) = standing();
            made.camera(eye, target, projection);
            let choices: Vec<&str> = choices.iter().copied().chain([rung]).collect();
            gpu.shot(&made.0, Some(&environment), on(&choices)).1
        };
        let [screen, below] = ["reflection=screen", "reflection=environment"].map(|rung| seen([1.0; 3], rung));
        let error = largest_difference(&screen, &below, 1.0);
        // A product taken away and another added: a rounding of numbers around 1 each, and the map's filter.
        assert!(error < 1e-6, "{error:e}");
        let grey = seen([0.5; 3], "reflection=screen");
        let changed = grey.rgba.iter().zip(&below.rgba).filter(|(a, b)| b[0] - a[0] > 0.01).count();
        assert!(changed > 1000, "a darker wall darkens its image: {changed} pixels");
    }
}

fn glass(thickness: f32) -> Material {
    Material { metallic: 0.0, roughness: 0.0, transmission: 1.0, thickness, ior: 1.5, ..Material::default() }
}

/// A column of cells far behind a plate that is turned by `degrees` about +Y, or tilted as well.
fn plate(shape: Shape, material: Material, degrees: f64, tilt: f64) -> Made {
    let mut made = Made::new("plate");
    let turn = DAffine3::from_rotation_y(degrees.to_radians()) * DAffine3::from_rotation_x(tilt.to_radians());
    made.add(shape, material, turn);
    cells(&mut made, 40, 24, 0.06, at(0.0, -0.72, -3.0));
    made
}

#[test]
fn a_plate_shifts_what_lies_behind_by_its_nominal_thickness() {
    let gpu = Gpu::open();
    for (degrees, tilt, thickness) in
        [(40.0_f64, 0.0_f64, 0.4_f64), (-25.0, 15.0, 0.4), (60.0, 0.0, 0.1), (0.0, 0.0, 0.4)]
    {
        let mut made = plate(Shape::cuboid(DVec3::new(6.0, 6.0, 0.4)), glass(thickness as f32), degrees, tilt);
        made.front(0.5);
        let film = gpu.film(&made.0, on(&["refraction=screen"]));
        // Lecture F5 by angles: α to the normal outside, β inside; the shift is along the normal's part across the
        // view.
        let n = made.0.instances[0].world_from_object.transform_vector3(DVec3::Z).normalize();
        let alpha = n.z.acos();
        let beta = (alpha.sin() / 1.5).asin();
        let across = DVec2::new(-n.x, n.y).normalize_or_zero();
        let shift = across * (thickness * (alpha - beta).sin() / 0.5 * 0.5 * f64::from(SIZE[1]));
        eprintln!("{degrees}°, {tilt}°: {shift} pixels");
        let behind = Scene { instances: made.0.instances[1..].to_vec(), ..made.0.clone() };
        let world = World::new(&behind, PLAIN);
        let (mut checked, mut moved) = (0, 0);
        for (i, at) in pixels(SIZE) {
            let place = at + shift;
            if place.x < 1.0
                || place.y < 1.0
                || place.x > f64::from(SIZE[0]) - 1.0
                || place.y > f64::from(SIZE[1]) - 1.0
            {
                continue;
            }
            // The nearest pixel's centre is half a pixel away at most, either way; the rest is rounding.
            let may = hues_around(&world, &behind, SIZE, place, 0.51);
            let got = hue(&film.rgba[i]).unwrap_or_default();
            assert!(may.iter().any(|hue| (*hue - got).length() < 2e-3), "{at}: {got} of {may:?}");
            checked += 1;
            let straight = hues_around(&world, &behind, SIZE, at, 0.0);
            moved += usize::from(straight.iter().all(|hue| (*hue - got).length() > 2e-3));
        }
        assert!(checked > 8000, "{checked}");
        assert!((moved > 3000) == (alpha > 0.1), "{moved} pixels moved");
    }
}

/// The exit point as seen from the eye. A parallel view cannot check it.
#[test]
fn a_ball_bends_every_ray_by_its_own_normal() {
    let gpu = Gpu::open();
    let mut made = plate(Shape::sphere(0.5, 96), glass(0.6), 0.0, 0.0);
    made.camera(DVec3::new(0.2, 0.1, 3.0), DVec3::ZERO, etalon_testing::made::perspective(30.0));
    let film = gpu.film(&made.0, on(&["refraction=screen"]));
    let world = World::new(&made.0, PLAIN);
    let behind = Scene { instances: made.0.instances[1..].to_vec(), ..made.0.clone() };
    let cells = World::new(&behind, PLAIN);
    let camera = &made.0.cameras[0];
    let (mut checked, mut farthest) = (0, 0.0_f64);
    for (i, at) in pixels(SIZE) {
        let ray = camera_ray(camera, SIZE[0], SIZE[1], at.x, at.y);
        let Some(hit) = world.closest(&ray).filter(|hit| hit.instance == 0) else { continue };
        let (v, n) = (ray.direction, hit.shading_normal);
        let cos = -v.dot(n);
        if cos < 0.2 {
            continue;
        }
        let t = v / 1.5 + n * (cos / 1.5 - (1.0 - (1.0 - cos * cos) / 2.25).sqrt());
        let (place, _) = project(camera, SIZE, hit.position + t * 0.6);
        farthest = farthest.max(place.distance(at));
        let got = hue(&film.rgba[i]).unwrap_or_default();
        // Half a pixel for the nearest one; the stored normal turns the ray by 3e-5, far less.
        let may = hues_around(&cells, &behind, SIZE, place, 0.55);
        assert!(may.iter().any(|hue| (*hue - got).length() < 2e-3), "{at}: {got} of {may:?}");
        checked += 1;
    }
    eprintln!("{checked} pixels, up to {farthest} away");
    assert!(checked > 1000 && farthest > 10.0, "{checked}, {farthest}");
}

#[test]
fn sheets_shift_nothing() {
    let gpu = Gpu::open();
    let panel = Shape::panel(6.0, 6.0);
    // With an alpha of 1 it would be glass as any other.
    let mut blended = Material { alpha_mode: etalon::scene::AlphaMode::Blend, ..glass(0.4) };
    blended.base_color[3] = 0.9;
    let body = Shape::cuboid(DVec3::new(6.0, 6.0, 0.4));
    for (shape, material) in
        [(panel.clone(), glass(0.0)), (panel, glass(0.4)), (body.clone(), glass(0.0)), (body, blended)]
    {
        let mut made = plate(shape, material, 40.0, 10.0);
        made.front(0.5);
        let [screen, off] = ["refraction=screen", "refraction=off"].map(|rung| gpu.film(&made.0, on(&[rung])));
        assert!(bits(&screen) == bits(&off));
    }
}

#[test]
fn refraction_shows_nothing_in_front_of_the_glass() {
    let gpu = Gpu::open();
    let mut made = plate(Shape::cuboid(DVec3::new(6.0, 6.0, 0.4)), glass(0.4), 40.0, 0.0);
    made.add(Shape::panel(0.3, 6.0), unlit([4.0, 4.0, 1.0]), at(0.1, 0.0, 3.0));
    made.front(0.5);
    let film = gpu.film(&made.0, on(&["refraction=screen"]));
    let world = World::new(&made.0, PLAIN);
    for (i, at) in pixels(SIZE) {
        let hit = world.closest(&camera_ray(&made.0.cameras[0], SIZE[0], SIZE[1], at.x, at.y)).expect("the plate");
        if hit.instance == 0 {
            let hue = hue(&film.rgba[i]);
            assert!(hue.is_some_and(|hue| hue.x < 3.0), "{at}: the post in the plate, or nothing: {hue:?}");
        }
    }
}

fn has(rendered: &Rendered, pass: &str) -> bool {
    rendered.passes.iter().any(|p| p.name == pass)
}

#[test]
fn passes_exist_only_where_they_are_called_for() {
    let gpu = Gpu::open();
    let environment = Environment::studio();
    let rough = Material { roughness: 0.5, ..mirror() };
    for (material, mirrors, transparency) in [(rough, false, false), (mirror(), true, false), (glass(0.4), false, true)]
    {
        let mut made = Made::new("ball");
        made.add(Shape::sphere(1.0, 24), material, DAffine3::IDENTITY);
        made.front(1.5);
        let (rendered, _) = gpu.shot(&made.0, Some(&environment), on(&["reflection=screen", "refraction=screen"]));
        assert_eq!(has(&rendered, "screen-space reflection"), mirrors);
        assert_eq!(has(&rendered, "copy radiance"), mirrors || transparency);
        assert_eq!(has(&rendered, "transparent lighting"), transparency);
        let (rendered, _) = gpu.shot(&made.0, Some(&environment), on(&["reflection=ray", "refraction=ray"]));
        assert!(!has(&rendered, "screen-space reflection") && !has(&rendered, "copy radiance"));
    }
}

#[test]
fn every_pair_of_rungs_gives_radiances() {
    let gpu = Gpu::open();
    let environment = Environment::studio();
    for name in ["etalon", "nested", "pool", "materials"] {
        let scene = study::load(name).expect("a study scene");
        for pair in [["screen", "screen"], ["screen", "ray"], ["ray", "screen"], ["screen", "off"]] {
            for arithmetic in ["fast", "stable"] {
                let [reflection, refraction] = [format!("reflection={}", pair[0]), format!("refraction={}", pair[1])];
                let arithmetic = format!("arithmetic={arithmetic}");
                let chosen = Settings { size: [64, 36], ..on(&[&reflection, &refraction, &arithmetic]) };
                let (rendered, _) = gpu.shot(&scene, Some(&environment), chosen);
                let counts = rendered.counts;
                assert_eq!((counts.nan, counts.inf, counts.negative), (0, 0, 0), "{name}, {pair:?}");
            }
        }
    }
}
