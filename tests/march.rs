//! Absorption by marching through grids of σ, against sums and integrals in f64 (lecture A2).
//!
//! All bodies have the index 1: rays go straight, nothing is reflected, and a pixel before a wall of radiance 1 is the
//! transmittance of its path.

use std::sync::Arc;

use etalon::frame::Settings;
use etalon::optics::SplitMix64;
use etalon::plan::rungs::Quadrature;
use etalon::plan::{Attenuation, Facts, Knobs, Model, Plan, Surroundings};
use etalon::scene::canonical::CanonicalForm;
use etalon::scene::{Camera, LightKind, Material, Scene, SigmaGrid};
use etalon::study::shape::Shape;
use etalon::upload::rays::Traversal;
use etalon_testing::gpu::{Gpu, knobs, settings};
use etalon_testing::made::{Made, at, lambert, perspective, unlit};
use glam::{DAffine3, DMat3, DQuat, DVec3};

fn marching(size: [u32; 2], more: &[&str]) -> Settings {
    let rungs = ["samples=1", "reflection=ray", "refraction=ray", "fresnel=exact"];
    Settings { knobs: knobs(&[&rungs[..], more].concat()), ..settings(size) }
}

/// How far rays start off surfaces, where the largest coordinate of the scene, from the middle of its box, is `extent`.
fn offset(extent: f64) -> f64 {
    32.0 * extent * 2.0_f64.powi(-24)
}

/// A body of index 1 whose only property is its σ.
fn smoke(grid: SigmaGrid) -> Material {
    Material {
        ior: 1.0,
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        thickness: 1.0,
        sigma: Some(Arc::new(grid)),
        ..Material::default()
    }
}

/// A grid over `bounds`; a function of point and channel gives its values.
fn filled(
    size: [usize; 3],
    bounds: [DVec3; 2],
    channels: usize,
    mut value: impl FnMut([usize; 3], usize) -> f64,
) -> SigmaGrid {
    let mut values = Vec::new();
    for z in 0..size[2] {
        for y in 0..size[1] {
            for x in 0..size[0] {
                values.extend((0..channels).map(|c| value([x, y, z], c) as f32));
            }
        }
    }
    SigmaGrid::new(size.map(|n| n as u64), values, Some(bounds)).expect("a grid")
}

/// A placed box of `edges` about its own origin that holds a grid over `bounds`.
struct Body {
    edges: DVec3,
    frame: DAffine3,
    grid: SigmaGrid,
    bounds: [DVec3; 2],
}

impl Body {
    /// σ at a point of the world: trilinear, from the grid's points and box alone.
    fn sigma(&self, p_world: DVec3, channel: usize) -> f64 {
        let p = self.frame.inverse().transform_point3(p_world);
        let size = self.grid.size();
        let mut cell = [0; 3];
        let mut share = [0.0; 3];
        for i in 0..3 {
            let [low, high] = self.bounds.map(|b| b[i]);
            let place =
                if size[i] > 1 { ((p[i] - low) / (high - low)).clamp(0.0, 1.0) * (size[i] - 1) as f64 } else { 0.0 };
            cell[i] = (place.floor() as usize).min(size[i].saturating_sub(2));
            share[i] = place - cell[i] as f64;
        }
        let mut sum = 0.0;
        for corner in 0..8 {
            let step = [corner & 1, corner >> 1 & 1, corner >> 2];
            let weight: f64 = (0..3).map(|i| if step[i] == 1 { share[i] } else { 1.0 - share[i] }).product();
            let point = [0, 1, 2].map(|i| (cell[i] + step[i]).min(size[i] - 1));
            sum += weight * f64::from(self.grid.at(point, channel));
        }
        sum
    }

    /// Where a ray is inside: distances in and out.
    fn span(&self, o: DVec3, d: DVec3) -> Option<[f64; 2]> {
        let inverse = self.frame.inverse();
        let (o, d) = (inverse.transform_point3(o), inverse.transform_vector3(d));
        let (a, b) = ((-0.5 * self.edges - o) / d, (0.5 * self.edges - o) / d);
        let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
        (near < far && far > 0.0).then_some([near.max(0.0), far])
    }

    /// The outward normal at a point of the surface.
    fn normal(&self, p: DVec3) -> DVec3 {
        let local = self.frame.inverse().transform_point3(p) / self.edges;
        let axis = (0..3).max_by(|&i, &j| local[i].abs().total_cmp(&local[j].abs())).unwrap_or(0);
        let mut outwards = DVec3::ZERO;
        outwards[axis] = local[axis].signum();
        (self.frame.matrix3.inverse().transpose() * outwards).normalize()
    }

    /// The segment of a ray inside as it is marched, which starts `off` below the face that it enters by, and where the
    /// ray starts behind, `off` outside of the other.
    fn segment(&self, o: DVec3, d: DVec3, off: f64) -> Option<[DVec3; 3]> {
        let [near, _] = self.span(o, d)?;
        let p = o + d * near;
        let start = p - self.normal(p) * off;
        let [_, far] = self.span(start, d)?;
        let end = start + d * far;
        Some([start, end, end + self.normal(end) * off])
    }

    /// The sum of lecture A2 over a segment of the world.
    fn depth(&self, from: DVec3, to: DVec3, channel: usize, steps: usize, rule: &str) -> f64 {
        let at = |i: f64| self.sigma(from + (to - from) * (i / steps as f64), channel);
        let each = |i: usize| match (rule, i as f64) {
            ("left", i) => at(i),
            ("midpoint", i) => at(i + 0.5),
            (_, i) => (at(i) + 4.0 * at(i + 0.5) + at(i + 1.0)) / 6.0,
        };
        (0..steps).map(each).sum::<f64>() * (to - from).length() / steps as f64
    }

    fn add(&self, made: &mut Made) {
        made.add(Shape::cuboid(self.edges), smoke(self.grid.clone()), self.frame);
    }
}

fn ray(camera: &Camera, size: [u32; 2], i: usize, shift: [f64; 2]) -> (DVec3, DVec3) {
    let (x, y) = (i as u32 % size[0], i as u32 / size[0]);
    let r = etalon_testing::raycast::camera_ray(
        camera,
        size[0],
        size[1],
        f64::from(x) + 0.5 + shift[0],
        f64::from(y) + 0.5 + shift[1],
    );
    (r.origin, r.direction)
}

const AROUND: [[f64; 2]; 5] =
    [[0.0, 0.0], [-1.0 / 64.0, 0.0], [1.0 / 64.0, 0.0], [0.0, -1.0 / 64.0], [0.0, 1.0 / 64.0]];

/// A room all around that is white wherever one looks.
fn white_room(made: &mut Made, size: f64, place: DAffine3) {
    made.add(Shape::cuboid(DVec3::splat(size)), unlit([1.0; 3]), place);
}

// ---------------------------------------------------------------------------------------------------- rules

/// A slab of 0.6 m in a white room of 3 m, seen up to 59° off its normal. σ depends on the depth below z = 0.3 alone.
fn slab(points: usize, channels: usize, sigma: impl Fn(f64, usize) -> f64) -> (Made, Body) {
    let (edges, far) = (DVec3::new(2.9, 2.9, 0.6), (points - 1) as f64);
    let bounds = [-0.5 * edges, 0.5 * edges];
    let grid = filled([1, 1, points], bounds, channels, |[.., z], c| sigma(0.6 - 0.6 * z as f64 / far, c));
    let body = Body { edges, frame: DAffine3::IDENTITY, grid, bounds };
    let mut made = Made::new("slab");
    body.add(&mut made);
    white_room(&mut made, 3.0, DAffine3::IDENTITY);
    made.camera(DVec3::new(0.03, -0.02, 0.8), DVec3::new(0.0, 0.0, -0.3), perspective(95.0));
    (made, body)
}

#[test]
fn sums_are_those_of_f64_and_midpoints_are_exact_where_sigma_is_linear() {
    let gpu = Gpu::open();
    let size = [48, 27];
    let (low, high) = ([0.1, 0.8, 0.4], [1.2, 0.2, 0.4]);
    for channels in [1, 3] {
        let (made, body) = slab(9, channels, |depth, c| low[c] + (high[c] - low[c]) * depth / 0.6);
        for (rule, steps) in [("left", 4), ("left", 64), ("midpoint", 4), ("midpoint", 32), ("simpson", 8)] {
            let rungs = [format!("absorption=march:{steps}"), format!("quadrature={rule}")];
            let film = gpu.film(&made.0, marching(size, &rungs.each_ref().map(String::as_str)));
            let (mut worst, mut worst_exact, mut steepest) = (0.0_f64, 0.0_f64, 1.0_f64);
            for (i, pixel) in film.rgba.iter().enumerate() {
                let (o, d) = ray(&made.0.cameras[0], size, i, [0.0; 2]);
                let [from, to, _] = body.segment(o, d, offset(1.5)).expect("the slab fills the picture");
                if to.truncate().abs().max_element() > 1.44 {
                    continue;
                }
                steepest = steepest.min(-d.z);
                for (c, &got) in pixel[..3].iter().enumerate() {
                    let k = if channels == 1 { 0 } else { c };
                    let (length, sum) = ((to - from).length(), body.depth(from, to, k, steps, rule));
                    let got = f64::from(got);
                    worst = worst.max((got / (-sum).exp() - 1.0).abs());
                    // ∫σ from the values at both sides alone; a left sum lacks half a step of their difference.
                    let lacks = if rule == "left" { 0.5 * (high[k] - low[k]) / steps as f64 } else { 0.0 };
                    let exact = length * (0.5 * (low[k] + high[k]) - lacks);
                    worst_exact = worst_exact.max((got / (-exact).exp() - 1.0).abs());
                }
            }
            eprintln!(
                "{channels}, {rule}, {steps} steps: {worst:e} off the sum, {worst_exact:e} off the integral, to {:.1}°",
                steepest.acos().to_degrees()
            );
            assert!(steepest < 0.52);
            // T has a few roundings; lengths up to 1.5 m have some 2e-7 m, and σ is up to 1.2.
            assert!(worst < 1.5e-6, "{rule}, {steps} steps: {worst:e}");
            // And σ changes by 1.8 /m per metre, 2.9e-6 m below the face.
            assert!(worst_exact < 1e-5, "{rule}, {steps} steps: {worst_exact:e}");
        }
    }
}

#[test]
fn errors_fall_by_the_order_of_the_rule() {
    let gpu = Gpu::open();
    let size = [8, 6];
    // e^(−10 z/m) over 0.6 m. Simpson's error is (h k)⁴/2880 of the integral, 5e-4 for 4 steps and 2e-6 for 16. Between
    // its points the grid is linear, which any rule that looks at points only takes for the curve itself: (k/4096)² ·
    // 0.6²/12 = 2e-7 of the integral, and less than any error here.
    let (made, body) = slab(4097, 1, |depth, _| 8.0 * (-10.0 * depth).exp());
    for (rule, factor, steps) in
        [("left", 2.0, [8, 16, 32, 64]), ("midpoint", 4.0, [8, 16, 32, 64]), ("simpson", 16.0, [4, 8, 16, 0])]
    {
        let steps: Vec<usize> = steps.into_iter().filter(|&n| n > 0).collect();
        let errors: Vec<f64> = steps
            .iter()
            .map(|n| {
                let rungs = [format!("absorption=march:{n}"), format!("quadrature={rule}")];
                let film = gpu.film(&made.0, marching(size, &rungs.each_ref().map(String::as_str)));
                let relative = film.rgba.iter().enumerate().map(|(i, pixel)| {
                    let (o, d) = ray(&made.0.cameras[0], size, i, [0.0; 2]);
                    let [from, to, _] = body.segment(o, d, offset(1.5)).expect("the slab fills the picture");
                    // The field is linear between points: its integral is the sum over many midpoints, as good as any.
                    let exact = body.depth(from, to, 0, 40_000, "midpoint");
                    (-f64::from(pixel[0]).ln() / exact - 1.0).abs()
                });
                relative.sum::<f64>() / film.rgba.len() as f64
            })
            .collect();
        eprintln!("{rule}: {errors:?} for {steps:?} steps");
        for pair in errors.windows(2) {
            // Terms of the next order: (h k)² of 2.25 for 4 steps against coefficients that fall by 40. And places are
            // good to 5e-8 m, which is 5e-7 of σ here.
            let off = (pair[1] - pair[0] / factor).abs();
            assert!(off < 0.1 * pair[0] / factor + 5e-7, "{rule}: {errors:?}, {off:e}");
        }
    }
}

#[test]
fn a_constant_grid_is_a_homogeneous_medium() {
    let gpu = Gpu::open();
    let size = [64, 36];
    let color = [0.3, 0.6, 0.9_f32];
    let sigma = color.map(|c| -c.ln() / 0.5);
    let picture = |material: Material, rungs: &[&str]| {
        let mut made = Made::new("block");
        let turn = DAffine3::from_rotation_y(0.6) * DAffine3::from_rotation_x(0.4);
        made.add(Shape::cuboid(DVec3::new(1.4, 0.8, 0.8)), material, turn);
        white_room(&mut made, 4.0, DAffine3::IDENTITY);
        made.camera(DVec3::new(0.2, 0.3, 1.8), DVec3::ZERO, perspective(45.0));
        gpu.film(&made.0, marching(size, rungs))
    };
    // A box that the body reaches out of: the edge goes on.
    let bounds = [DVec3::new(-0.3, -0.2, -0.1), DVec3::splat(0.2)];
    let grid = |share: f32| filled([3, 4, 2], bounds, 3, |_, c| f64::from(share * sigma[c]));
    let nothing = filled([1; 3], [DVec3::ZERO; 2], 1, |_, _| 0.0);
    let dyed = |grid: SigmaGrid, distance| Material {
        attenuation_color: color,
        attenuation_distance: distance,
        ..smoke(grid)
    };
    let want = picture(Material { sigma: None, ..dyed(nothing.clone(), 0.5) }, &["absorption=path"]);
    assert!(want.rgba.iter().filter(|p| p[0] < 0.5).count() > 300);
    for (name, material, rungs) in [
        ("left", smoke(grid(1.0)), ["absorption=march:8", "quadrature=left"]),
        ("midpoint", smoke(grid(1.0)), ["absorption=march:32", "quadrature=midpoint"]),
        ("simpson", smoke(grid(1.0)), ["absorption=march:4", "quadrature=simpson"]),
        ("beside half of it", dyed(grid(0.5), 1.0), ["absorption=march:16", "quadrature=midpoint"]),
        ("nothing more", dyed(nothing, 0.5), ["absorption=march:16", "quadrature=midpoint"]),
        ("its mean", smoke(grid(1.0)), ["absorption=path", "quadrature=midpoint"]),
    ] {
        let got = picture(material, &rungs);
        let worst = etalon_testing::gpu::largest_difference(&got, &want, 1.0);
        eprintln!("{name}: {worst:e}");
        assert!(worst < 1e-6, "{name}: {worst:e}");
    }
}

// ---------------------------------------------------------------------------------------------------- places

/// Bodies with rough grids of every kind: turned, mirrored, scaled unevenly; the last two are one mesh and one
/// material.
fn bodies(moved: DVec3) -> Vec<Body> {
    let mut random = SplitMix64::new(3);
    let bounds = [DVec3::new(-0.4, -0.3, -0.5), DVec3::new(0.3, 0.4, 0.25)];
    let grids = [([3, 4, 5], 3), ([6, 1, 2], 1), ([2, 3, 2], 3)]
        .map(|(size, channels)| filled(size, bounds, channels, |_, _| random.between(0.0, 1.5)));
    let turn = |axis: DVec3, angle: f64| DAffine3::from_quat(DQuat::from_axis_angle(axis.normalize(), angle));
    let scale = |x: f64, y: f64, z: f64| DAffine3::from_scale(DVec3::new(x, y, z));
    let frames = [
        (0, at(-0.75, 0.45, 0.1) * turn(DVec3::new(1.0, 2.0, 0.5), 0.8) * scale(0.6, 0.5, 0.8)),
        (1, at(0.75, -0.4, -0.2) * turn(DVec3::new(0.2, -1.0, 0.5), 2.1) * scale(-0.7, 0.6, 0.6)),
        (2, at(-0.15, -0.25, 0.45) * turn(DVec3::new(0.0, 1.0, 0.3), 0.4) * scale(0.5, 0.5, 0.5)),
        (2, at(0.1, 0.1, -0.8) * turn(DVec3::new(1.0, 0.2, 0.3), 1.4) * scale(0.9, 0.9, 0.9)),
    ];
    let body = |(which, frame): (usize, DAffine3)| Body {
        edges: DVec3::splat(0.9),
        frame: DAffine3::from_translation(moved) * frame,
        grid: grids[which].clone(),
        bounds,
    };
    frames.into_iter().map(body).collect()
}

#[test]
fn grids_move_with_their_meshes() {
    let gpu = Gpu::open();
    let size = [96, 54];
    for (name, moved) in [("here", DVec3::ZERO), ("10 km away", DVec3::new(9e3, -2e3, 4e3))] {
        let bodies = bodies(moved);
        let mut made = Made::new(name);
        bodies[..3].iter().for_each(|body| body.add(&mut made));
        made.place(2, bodies[3].frame);
        white_room(&mut made, 3.6, DAffine3::from_translation(moved));
        made.camera(moved + DVec3::new(0.1, 0.2, 1.4), moved, perspective(60.0));
        for (rule, steps) in [("midpoint", 16), ("simpson", 8)] {
            let rungs = [format!("absorption=march:{steps}"), format!("quadrature={rule}"), "interfaces=32".to_owned()];
            let film = gpu.film(&made.0, marching(size, &rungs.each_ref().map(String::as_str)));
            let (mut worst, mut crossed, mut twice, mut left_out) = (0.0_f64, [0; 4], 0, 0);
            for (i, pixel) in film.rgba.iter().enumerate() {
                let spans = |shift| {
                    let (o, d) = ray(&made.0.cameras[0], size, i, shift);
                    bodies.iter().map(|body| body.span(o, d)).collect::<Vec<_>>()
                };
                let here = spans([0.0; 2]);
                let is: Vec<bool> = here.iter().map(Option::is_some).collect();
                if AROUND.iter().any(|&shift| spans(shift).iter().map(Option::is_some).ne(is.iter().copied())) {
                    left_out += 1;
                    continue;
                }
                twice += usize::from(is.iter().filter(|&&is| is).count() > 1);
                let (mut o, d) = ray(&made.0.cameras[0], size, i, [0.0; 2]);
                let mut depth = [0.0; 3];
                let mut order: Vec<usize> = (0..4).filter(|&k| is[k]).collect();
                order.sort_by(|&a, &b| here[a].map(|s| s[0]).partial_cmp(&here[b].map(|s| s[0])).expect("numbers"));
                for k in order {
                    let body = &bodies[k];
                    let Some([from, to, behind]) = body.segment(o, d, offset(1.8)) else { continue };
                    o = behind;
                    crossed[k] += 1;
                    for (c, depth) in depth.iter_mut().enumerate() {
                        *depth += body.depth(from, to, c.min(body.grid.channels() - 1), steps, rule);
                    }
                }
                for c in 0..3 {
                    worst = worst.max((f64::from(pixel[c]) / (-depth[c]).exp() - 1.0).abs());
                }
            }
            eprintln!("{name}, {rule}: {worst:e}, {crossed:?} pixels, {twice} through two, {left_out} left out");
            assert!(crossed.iter().all(|&n| n > 150) && twice > 20 && left_out < 400);
            // Where a ray meets a face at a grazing angle, its place and so its length are as many times less exact.
            assert!(worst < 3e-5, "{name}, {rule}: {worst:e}");
        }
    }
}

/// σ is in 1/m of the world, as an attenuation distance is in metres of the world: what a body absorbs does not ask how
/// its size came about.
#[test]
fn a_node_scales_the_place_of_a_grid_and_not_its_sigma() {
    let gpu = Gpu::open();
    let size = [48, 27];
    let picture = |edge: f64, scale: f64| {
        let b = 0.5 * DVec3::splat(edge);
        let grid = filled([2, 3, 2], [-b, b], 1, |[x, y, z], _| 0.3 + 0.5 * (x + y) as f64 + 0.2 * z as f64);
        let turn = DAffine3::from_rotation_y(0.5) * DAffine3::from_scale(DVec3::splat(scale));
        let mut made = Made::new("scaled");
        made.add(Shape::cuboid(DVec3::splat(edge)), smoke(grid), turn);
        white_room(&mut made, 3.0, DAffine3::IDENTITY);
        made.camera(DVec3::new(0.2, 0.3, 1.4), DVec3::ZERO, perspective(60.0));
        gpu.film(&made.0, marching(size, &["absorption=march:16"]))
    };
    let worst = etalon_testing::gpu::largest_difference(&picture(0.8, 1.0), &picture(0.2, 4.0), 1.0);
    eprintln!("{worst:e}");
    assert!(worst < 1e-6, "{worst:e}");
}

// ---------------------------------------------------------------------------------------------------- light

#[test]
fn light_that_passes_a_grid_is_weakened_along_its_own_way() {
    let gpu = Gpu::open();
    let size = [96, 54];
    let bounds = [DVec3::splat(-0.2), DVec3::splat(0.2)];
    let mut random = SplitMix64::new(5);
    // Three bodies in a row: six surfaces, more than one traversal takes along. The light of the last picture is in
    // one.
    let row: Vec<Body> = [0.35, 0.85, 1.4]
        .into_iter()
        .map(|height| {
            let turn = DAffine3::from_mat3(DMat3::from_rotation_y(height) * DMat3::from_rotation_x(2.0 * height));
            let grid = filled([4, 3, 5], bounds, 3, |_, _| random.between(0.0, 2.0));
            Body { edges: DVec3::splat(0.35), frame: at(0.1 * height, 0.05, height) * turn, grid, bounds }
        })
        .collect();
    let position = DVec3::new(0.3, 0.1, 2.2);
    for (name, kind) in [
        ("sun", LightKind::Directional { direction: DVec3::new(-0.08, -0.03, -1.0).normalize() }),
        ("lamp", LightKind::Point { position, range: None }),
        ("inside", LightKind::Point { position: DVec3::new(0.13, 0.04, 1.42), range: None }),
    ] {
        let mut made = Made::new(name);
        made.add(Shape::panel(4.0, 3.0), lambert([0.5; 3]), DAffine3::IDENTITY);
        row.iter().for_each(|body| body.add(&mut made));
        made.light([5.0; 3], kind);
        // From the side, so that few pixels look through the bodies.
        made.camera(DVec3::new(-1.6, 0.9, 0.7), DVec3::new(0.1, 0.0, 0.0), perspective(40.0));
        let rungs = ["absorption=march:16", "shadows=ray"];
        let lit = gpu.film(&made.0, marching(size, &["absorption=march:16", "shadows=off"]));
        let film = gpu.film(&made.0, marching(size, &rungs));
        let (mut worst, mut passed, mut thrice, mut least) = (0.0_f64, 0, 0, 1.0_f64);
        for i in 0..film.rgba.len() {
            let spans = |shift: [f64; 2]| {
                let (o, d) = ray(&made.0.cameras[0], size, i, shift);
                let p = o - d * (o.z / d.z);
                // Rays to lights start off the wall, and back to where it was seen from.
                let start = p + (DVec3::Z - d) * offset(2.0);
                let (to, length) = match kind {
                    LightKind::Directional { direction } => (-direction, f64::INFINITY),
                    LightKind::Point { position, .. } | LightKind::Spot { position, .. } => {
                        ((position - p).normalize(), (position - p).length())
                    }
                };
                let seen =
                    d.z < 0.0 && p.x.abs() < 1.99 && p.y.abs() < 1.49 && row.iter().all(|b| b.span(o, d).is_none());
                let ways: Vec<_> = row.iter().map(|b| b.span(start, to).map(|[a, b]| [a, b.min(length)])).collect();
                (seen, start, to, ways)
            };
            let (seen, p, to, ways) = spans([0.0; 2]);
            let kinds = |(seen, _, _, ways): &(bool, DVec3, DVec3, Vec<Option<[f64; 2]>>)| {
                (*seen, ways.iter().map(Option::is_some).collect::<Vec<_>>())
            };
            let same = AROUND.iter().all(|&shift| kinds(&spans(shift)) == kinds(&(seen, p, to, ways.clone())));
            if !seen || !same {
                continue;
            }
            let count = ways.iter().filter(|w| w.is_some()).count();
            passed += usize::from(count > 0);
            thrice += usize::from(count == 3);
            for c in 0..3 {
                let depth: f64 = row
                    .iter()
                    .zip(&ways)
                    .map(|(body, way)| way.map_or(0.0, |[a, b]| body.depth(p + to * a, p + to * b, c, 16, "midpoint")))
                    .sum();
                assert!(lit.rgba[i][c] > 0.0, "{name}, pixel {i}: no light without shadows");
                let share = f64::from(film.rgba[i][c]) / f64::from(lit.rgba[i][c]);
                least = least.min(share);
                worst = worst.max((share - (-depth).exp()).abs());
            }
        }
        eprintln!("{name}: {worst:e} over {passed} pixels, {thrice} through all three, down to {least}");
        assert!(passed > 100 && thrice > 20 && least < 0.5, "{name}: {passed}, {thrice}, {least}");
        // The terminator's factor and the light's own terms are the same in both pictures.
        assert!(worst < 1e-5, "{name}: {worst:e}");
    }
}

/// The facets of a sphere make the lanes of a software device diverge: their rays end at different times.
#[test]
fn light_reaches_into_a_mesh_through_its_grid() {
    let gpu = Gpu::open();
    let size = [64, 48];
    let mut random = SplitMix64::new(9);
    let bounds = [DVec3::splat(-0.8), DVec3::splat(0.8)];
    let grid = filled([3, 4, 3], bounds, 3, |_, _| random.between(0.1, 0.9));
    let body = Body { edges: DVec3::splat(1.6), frame: DAffine3::IDENTITY, grid, bounds };
    let direction = DVec3::new(-0.75, -0.8, -0.35).normalize();
    let mut made = Made::new("ball");
    made.add(Shape::sphere(0.22, 12), lambert([0.5; 3]), at(0.1, 0.05, 0.0));
    let ball = made.0.clone();
    let world = etalon_testing::raycast::World::new(&ball, etalon_testing::raycast::Options::default());
    body.add(&mut made);
    made.light([3.0; 3], LightKind::Directional { direction });
    made.camera(DVec3::new(0.6, 0.5, 2.2), DVec3::new(0.1, 0.05, 0.0), perspective(14.0));
    for traversal in [None, Some(Traversal::Links32), Some(Traversal::Stack)] {
        let picture = |absorption| Settings { traversal, ..marching(size, &["shadows=ray", absorption]) };
        let film = gpu.film(&made.0, picture("absorption=march:16"));
        let clear = gpu.film(&made.0, picture("absorption=off"));
        let (mut worst, mut compared, mut off) = (0.0_f64, 0, 0);
        for i in 0..film.rgba.len() {
            let (o, d) = ray(&made.0.cameras[0], size, i, [0.0; 2]);
            let hits = AROUND.map(|shift| {
                let (o, d) = ray(&made.0.cameras[0], size, i, shift);
                world.closest(&etalon_testing::raycast::Ray::new(o, d)).map(|hit| hit.position)
            });
            let (Some(p), true) = (hits[0], hits.iter().all(Option::is_some)) else { continue };
            if clear.rgba[i][0] < 0.01 {
                continue;
            }
            compared += 1;
            let [near, _] = body.span(o, d).expect("the ball is inside");
            let [_, far] = body.span(p, -direction).expect("and sees the sky");
            for c in 0..3 {
                let depth = body.depth(o + d * near, p, c, 16, "midpoint")
                    + body.depth(p, p - direction * far, c, 16, "midpoint");
                let e = (f64::from(film.rgba[i][c]) / f64::from(clear.rgba[i][c]) / (-depth).exp() - 1.0).abs();
                off += usize::from(e > 1e-3);
                worst = worst.max(e);
            }
        }
        eprintln!("{traversal:?}: {worst:e} over {compared} pixels, {off} channels are others");
        // Both rays start up to 3e-6 m off their surface; σ is up to 0.9 and changes by 3 /m per metre.
        assert!(compared > 500 && off == 0 && worst < 2e-5, "{traversal:?}: {worst:e}, {off} of {compared}");
    }
}

// ---------------------------------------------------------------------------------------------------- the plan

fn planned(scene: &Scene, choices: &[&str]) -> Plan {
    let mut knobs = Knobs::of(Model::Recursive);
    choices.iter().for_each(|choice| knobs.set(choice).expect("a rung"));
    let surroundings = Surroundings::DARK;
    Plan::new(scene, &Facts::of(scene, CanonicalForm::default()), surroundings, &knobs)
}

#[test]
fn the_plan_says_which_grid_is_marched_and_what_is_not_said_in_vain() {
    let (mut made, _) = slab(3, 1, |_, _| 1.0);
    made.0.materials[0].name = "fog".to_owned();
    let effect =
        |plan: &Plan, name: &str| plan.effects.iter().find(|e| e.id.name() == name).cloned().expect("an effect");
    let warned = |plan: &Plan, words: &[&str]| plan.warnings.iter().any(|w| words.iter().all(|word| w.contains(word)));

    let plan = planned(&made.0, &["absorption=march:8", "quadrature=simpson"]);
    assert_eq!((plan.march().steps, plan.march().rule), (8, Quadrature::Simpson));
    let kept = effect(&plan, "heterogeneous media");
    assert_eq!((kept.state.name(), kept.rung()), ("used", "march:8"));
    assert!(kept.reason().contains("\"fog\"") && kept.evidence["grid"] == "1 x 1 x 3", "{kept:?}");
    assert_eq!((effect(&plan, "quadrature").state.name(), effect(&plan, "quadrature").rung()), ("used", "simpson"));
    assert!(plan.warnings.is_empty(), "{:?}", plan.warnings);

    let plan = planned(&made.0, &[]);
    assert_eq!((plan.march().steps, plan.march().rule), (8, Quadrature::Midpoint));
    assert!(plan.warnings.is_empty(), "{:?}", plan.warnings);

    let plan = planned(&made.0, &["absorption=path", "quadrature=simpson"]);
    assert_eq!(plan.march().steps, 0);
    assert_eq!(effect(&plan, "heterogeneous media").reason(), "absorption=path");
    assert!(warned(&plan, &["\"fog\"", "absorption=path", "mean", "march:4"]), "{:?}", plan.warnings);
    assert!(warned(&plan, &["quadrature=simpson changes nothing"]), "{:?}", plan.warnings);
    assert_eq!(effect(&plan, "quadrature").state.name(), "not needed");

    let plan = planned(&made.0, &["absorption=march:8", "refraction=off"]);
    assert_eq!((plan.march().steps, effect(&plan, "heterogeneous media").reason().as_str()), (0, "refraction=off"));
    assert!(warned(&plan, &["\"fog\"", "refraction=off"]), "{:?}", plan.warnings);

    made.0.materials[0].sigma = None;
    let plan = planned(&made.0, &["absorption=march:8", "quadrature=left"]);
    assert_eq!((plan.march().steps, plan.rays.map(|rays| rays.attenuation)), (0, Some(Attenuation::Off)));
    assert!(warned(&plan, &["quadrature=left changes nothing"]), "{:?}", plan.warnings);
    assert!(planned(&made.0, &[]).warnings.is_empty());
}
