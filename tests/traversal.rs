//! The traversal alone: what rays meet, by three ways through the tree and by brute force in f64, and that a ray
//! neither meets the surface it leaves nor slips out of a closed one, at any scale.

use etalon::optics::SplitMix64;
use etalon::pass::trace_rays::{Hit, Mode, Ray, Tracer};
use etalon::scene::Scene;
use etalon::study::shape::Shape;
use etalon::transport::bvh::Bvh;
use etalon::upload::rays::Traversal;
use etalon_testing::gpu::Gpu;
use etalon_testing::made::{Made, at, lambert};
use glam::{DAffine3, DVec3, Vec3};

const WAYS: [Traversal; 3] = [Traversal::Links16, Traversal::Links32, Traversal::Stack];

fn direction(random: &mut SplitMix64) -> DVec3 {
    let z = random.between(-1.0, 1.0);
    let turn = random.between(0.0, std::f64::consts::TAU);
    let r = (1.0 - z * z).sqrt();
    DVec3::new(r * turn.cos(), r * turn.sin(), z)
}

fn vec(p: [f32; 3]) -> DVec3 {
    Vec3::from(p).as_dvec3()
}

/// Balls, boxes, a soup of small triangles, and slivers as long as the scene, far from the origin. Rays meet the boxes
/// of nearly all slivers, so more children wait than a short stack holds.
fn scene() -> Scene {
    let mut random = SplitMix64::new(7);
    let mut made = Made::new("traversal");
    let ball = made.mesh(Shape::sphere(0.5, 24), lambert([0.5; 3]));
    let cube = made.mesh(Shape::cuboid(DVec3::new(0.4, 1.7, 0.01)), lambert([0.5; 3]));
    for i in 0..12 {
        let place = DVec3::new(random.between(-3.0, 3.0), random.between(-3.0, 3.0), random.between(-3.0, 3.0));
        let turn = DAffine3::from_axis_angle(direction(&mut random), random.between(0.0, 6.0));
        made.place(if i % 2 == 0 { ball } else { cube }, DAffine3::from_translation(place) * turn);
    }
    let mut soup = Shape::default();
    for i in 0..1400_u32 {
        let corner = direction(&mut random) * random.between(0.0, 4.0);
        let other_end = corner + direction(&mut random) * 8.0;
        for k in 0..3 {
            let size = if i < 400 { 0.3 } else { 0.1 };
            let end = if i >= 400 && k == 0 { other_end } else { corner };
            soup.positions.push((end + direction(&mut random) * size).as_vec3().to_array());
            soup.normals.push([0.0, 1.0, 0.0]);
            soup.uvs.push([0.0; 2]);
        }
        soup.indices.extend([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    made.add(soup, lambert([0.5; 3]), at(1000.0, -200.0, 30.0));
    for instance in &mut made.0.instances {
        if instance.mesh != 2 {
            instance.world_from_object.translation += DVec3::new(1000.0, -200.0, 30.0);
        }
    }
    made.0
}

/// Rays from everywhere around and inside, with lengths from 0.1 to 10 and some along the axes.
fn rays(count: usize, reach: f64) -> Vec<Ray> {
    let mut random = SplitMix64::new(11);
    (0..count)
        .map(|i| {
            let origin = direction(&mut random) * random.between(0.0, reach);
            let mut d = (direction(&mut random) * reach * 0.5 - origin) * random.between(0.1, 10.0);
            if i % 16 == 0 {
                d = [DVec3::X, DVec3::NEG_Y, DVec3::Z][i / 16 % 3];
            }
            Ray {
                origin: origin.as_vec3().to_array(),
                t_max: if i % 3 == 0 { random.between(0.1, 3.0) as f32 } else { 1e30 },
                direction: d.as_vec3().to_array(),
                from: Hit::NONE,
            }
        })
        .collect()
}

/// Möller and Trumbore in f64: t, and how far inside the triangle, in barycentric coordinates.
fn meets(ray: &Ray, corners: &[[f32; 3]; 3]) -> Option<(f64, f64)> {
    let [a, b, c] = corners.map(vec);
    let (o, d) = (vec(ray.origin), vec(ray.direction));
    let p = d.cross(c - a);
    let det = (b - a).dot(p);
    let s = o - a;
    let q = s.cross(b - a);
    let (u, v, t) = (s.dot(p) / det, d.dot(q) / det, (c - a).dot(q) / det);
    let inside = u.min(v).min(1.0 - u - v);
    (inside > -1e-4 && t > -1e-4 * t.abs().max(1.0) && t.is_finite()).then_some((t, inside))
}

/// All traversals find the same hits to the last bit, alone and in pairs, and the hits agree with brute force in f64.
/// Where a ray passes within 1e-5 of an edge, or two hits lie within 1e-5 of each other, f32 may decide otherwise:
/// counted as doubtful, and few.
#[test]
fn every_traversal_finds_what_brute_force_finds() {
    let gpu = Gpu::open();
    let scene = scene();
    let bvh = Bvh::build(&scene).expect("a tree");
    let rays = rays(6000, 6.0);
    let truth: Vec<Vec<(f64, f64, u32)>> = rays
        .iter()
        .map(|ray| {
            let mut all: Vec<_> = bvh
                .triangles
                .iter()
                .enumerate()
                .filter_map(|(i, t)| meets(ray, &t.corners).map(|(t, inside)| (t, inside, i as u32)))
                .filter(|(t, ..)| *t > 1e-6 && *t < f64::from(ray.t_max) * (1.0 + 1e-5))
                .collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            all
        })
        .collect();
    let mut first: Option<Vec<Hit>> = None;
    for way in WAYS {
        let mut tracer = Tracer::new(&gpu.device, &scene, Some(way)).expect("a tracer");
        assert!((tracer.rays().anchor() - bvh.anchor).length() == 0.0);
        let (hits, ..) = tracer.trace(&rays, Mode::default(), 1).expect("hits");
        let (pairs, ..) = tracer.trace(&rays, Mode { pairs: true, ..Mode::default() }, 1).expect("hits");
        assert_eq!(bits(&hits), bits(&pairs), "{way:?}: pairs");
        let (any, ..) = tracer.trace(&rays, Mode { any_hit: true, ..Mode::default() }, 1).expect("hits");
        assert!(hits.iter().zip(&any).all(|(h, a)| (h.triangle == Hit::NONE) == (a.triangle == Hit::NONE)), "{way:?}");
        match &first {
            None => {
                let (mut doubtful, mut met) = (0, 0);
                for ((hit, ray), truth) in hits.iter().zip(&rays).zip(&truth) {
                    let near = |a: f64, b: f64| (a - b).abs() < 1e-5 * (1.0 + a.abs());
                    let clear = truth.iter().all(|(t, inside, _)| *inside > 1e-5 && !near(*t, f64::from(ray.t_max)));
                    let apart = truth.windows(2).all(|pair| !near(pair[0].0, pair[1].0));
                    if !(clear && apart) {
                        doubtful += 1;
                        continue;
                    }
                    match truth.first() {
                        None => assert_eq!(hit.triangle, Hit::NONE, "{ray:?}: {hit:?}"),
                        Some((t, _, triangle)) => {
                            met += 1;
                            assert_eq!(hit.triangle, *triangle, "{ray:?}: {hit:?}, truth {truth:?}");
                            assert!(near(f64::from(hit.t), *t), "{ray:?}: {} is {t}", hit.t);
                        }
                    }
                }
                assert!(doubtful < rays.len() / 50 && met > rays.len() / 4, "{doubtful} doubtful, {met} met");
                first = Some(hits);
            }
            Some(first) => assert_eq!(bits(first), bits(&hits), "{way:?}"),
        }
    }
}

fn bits(hits: &[Hit]) -> Vec<[u32; 4]> {
    hits.iter().map(|h| [h.t.to_bits(), h.triangle, h.u.to_bits(), h.v.to_bits()]).collect()
}

/// Nodes and triangles are counted exactly: alone or in pairs, in one dispatch or in parts, and again and again.
#[test]
fn work_is_counted_exactly() {
    let gpu = Gpu::open();
    let scene = scene();
    let rays = rays(5000, 6.0);
    for way in [Traversal::Links16, Traversal::Stack] {
        let mut tracer = Tracer::new(&gpu.device, &scene, Some(way)).expect("a tracer");
        let mut count = |rays: &[Ray], pairs: bool| {
            let (_, work, _) = tracer.trace(rays, Mode { count: true, pairs, any_hit: false }, 1).expect("hits");
            (work.node_visits[0], work.triangle_tests[0])
        };
        let whole = count(&rays, false);
        assert!(whole.0 > 20_000 && whole.1 > 2_000, "{way:?}: {whole:?}");
        assert_eq!(whole, count(&rays, false), "{way:?}");
        assert_eq!(whole, count(&rays, true), "{way:?}");
        let parts = rays.chunks(777).map(|part| count(part, false)).fold((0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        assert_eq!(whole, parts, "{way:?}");
    }
}

/// Points on every triangle, an eighth each on edges and in corners, and directions away from it: outwards as steep as
/// it gets and down to 1e-6 above it, inwards to other faces. As the passes send them: from `ray_origin`.
fn leaving(bvh: &Bvh, tracer: &Tracer, count: usize, outwards: bool, random: &mut SplitMix64) -> Vec<Ray> {
    let offset = tracer.rays().offset();
    (0..count)
        .map(|i| {
            let index = (random.unit() * bvh.triangles.len() as f64) as usize;
            let [a, b, c] = bvh.triangles[index].corners.map(vec);
            // Also on edges and in corners.
            let (mut u, mut v) = (random.unit(), random.unit());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            match i % 8 {
                0 => u = 0.0,
                1 => v = 1.0 - u,
                2 => (u, v) = (0.0, 1e-7),
                _ => {}
            }
            // As the shader computes it: in f32.
            let (a32, b32, c32) = (a.as_vec3(), b.as_vec3(), c.as_vec3());
            let p = a32 + (u as f32 * (b32 - a32) + v as f32 * (c32 - a32));
            let n = (b - a).cross(c - a).normalize() * if outwards { 1.0 } else { -1.0 };
            let height = match i % 3 {
                0 => random.unit(),
                1 => 10.0_f64.powf(random.between(-6.0, 0.0)),
                _ => 10.0_f64.powf(random.between(-3.0, 0.0)),
            };
            let across = n.cross(direction(random)).normalize();
            let mut d = n * height + across * (1.0 - height * height).max(0.0).sqrt();
            if !outwards {
                // To a point of another face: of a convex body, all in between is inside. Not of a face that p lies in.
                let size = a.length().max(b.length()).max(c.length());
                d = loop {
                    let other = &bvh.triangles[(random.unit() * bvh.triangles.len() as f64) as usize];
                    let [a, b, c] = other.corners.map(vec);
                    let u = random.unit();
                    let v = random.unit() * (1.0 - u);
                    let d = a + u * (b - a) + v * (c - a) - p.as_dvec3();
                    let across = (b - a).cross(c - a).normalize();
                    if d.dot(n).min(d.dot(across)) > 1e-5 * size {
                        break d;
                    }
                };
            }
            Ray {
                origin: (p + n.as_vec3() * offset).to_array(),
                t_max: 1e30,
                direction: d.as_vec3().to_array(),
                from: tracer.face(index as u32),
            }
        })
        .collect()
}

/// How many hits are so: of rays from inside triangles, and of rays from edges and corners.
fn tally(hits: &[Hit], is_so: impl Fn(&Hit) -> bool) -> [usize; 2] {
    [false, true].map(|edge| hits.iter().enumerate().filter(|(i, h)| (i % 8 < 3) == edge && is_so(h)).count())
}

/// Convex closed bodies: a ray that leaves outwards meets nothing, one that leaves inwards meets the other side. Three
/// million rays, a third of those outwards at angles down to 1e-6 from the surface. From exactly on an edge a ray along
/// the other face may meet it: of bodies 200 times longer than thick 2 in 10,000 do.
#[test]
fn rays_neither_hit_their_own_surface_nor_leak() {
    let gpu = Gpu::open();
    let turn = DAffine3::from_axis_angle(DVec3::new(0.3, 0.5, -0.8).normalize(), 1.1);
    let bodies: [(&str, Shape, DVec3); 5] = [
        ("ball", Shape::sphere(1.0, 48), DVec3::ONE),
        ("cube", Shape::cuboid(DVec3::ONE * 2.0), DVec3::ONE),
        ("thin plate", Shape::cuboid(DVec3::new(2.0, 0.02, 3.0)), DVec3::ONE),
        ("needle", Shape::cuboid(DVec3::new(0.01, 2.0, 0.01)), DVec3::ONE),
        ("flattened ball", Shape::sphere(1.0, 48), DVec3::new(1.0, 0.05, 1.0)),
    ];
    for (name, shape, stretch) in bodies {
        for scale in [1e-4, 1.0, 1e6] {
            let mut made = Made::new(name);
            let place = DAffine3::from_translation(DVec3::new(3.0, -7.0, 11.0) * scale);
            let stretched = DAffine3::from_scale(stretch * scale);
            made.add(shape.clone(), lambert([0.5; 3]), place * turn * stretched);
            let bvh = Bvh::build(&made.0).expect("a tree");
            for way in [Traversal::Links16, Traversal::Stack] {
                let mut tracer = Tracer::new(&gpu.device, &made.0, Some(way)).expect("a tracer");
                let mut random = SplitMix64::new(3);
                let count = 50_000;
                let out = leaving(&bvh, &tracer, count, true, &mut random);
                let (hits, ..) = tracer.trace(&out, Mode::default(), 1).expect("hits");
                let met = tally(&hits, |h| h.triangle != Hit::NONE);
                let inwards = leaving(&bvh, &tracer, count, false, &mut random);
                let (hits, ..) = tracer.trace(&inwards, Mode::default(), 1).expect("hits");
                let lost = tally(&hits, |h| h.triangle == Hit::NONE);
                eprintln!("{name} at {scale:e}, {way:?}: self-hits {met:?}, leaks {lost:?} of {count} each");
                assert_eq!((met[0], lost), (0, [0, 0]), "{name} at {scale:e}, {way:?}");
                assert!(met[1] * 1000 <= count, "{name} at {scale:e}, {way:?}: {met:?}");
            }
        }
    }
}
