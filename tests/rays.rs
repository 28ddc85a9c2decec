//! Rays on the device where they are most likely to leak: aimed at an edge that two triangles share, and started from a
//! surface.

use etalon::optics::catalogue::{SplitMix64, columns, vector};
use etalon::optics::{Tier, ray};
use etalon_testing::gpu::Gpu;

use glam::DVec3;

const RAYS: usize = 200_000;

/// Output columns of a function for these rows of inputs, one row per case.
fn evaluated(gpu: &Gpu, name: &str, tier: Tier, rows: &[Vec<f32>]) -> Vec<Vec<f32>> {
    let entry = etalon_verify::find(name).expect("a function");
    let width = entry.probe.inputs.len();
    let inputs: Vec<f32> = (0..width).flat_map(|column| rows.iter().map(move |row| row[column])).collect();
    let outputs =
        etalon_verify::evaluate(&gpu.device, entry.probe, tier, &inputs, rows.len()).expect("outputs").outputs;
    (0..rows.len()).map(|row| (0..entry.probe.outputs.len()).map(|k| outputs[k * rows.len() + row]).collect()).collect()
}

fn exact(row: &[f32]) -> Vec<f64> {
    row.iter().map(|&x| f64::from(x)).collect()
}

/// Triangles abc and bad on both sides of the edge ab as the ray sees them, and the ray, aimed at the edge; a third of
/// the pairs nearly edge-on. Columns of two `ray_triangle` cases.
fn at_shared_edge(d: &mut SplitMix64) -> [Vec<f32>; 2] {
    loop {
        let [a, b] = [0; 2].map(|_| d.direction());
        let target = a.lerp(b, d.between(0.1, 0.9));
        let origin = target + d.direction() * d.log(0.1, 100.0);
        let direction = (target - origin) * d.log(0.01, 100.0);
        // A corner on either side of the plane of ray and edge; near that plane the triangle is seen edge-on.
        let side = (b - a).cross(direction).normalize();
        let mut corner = |sign: f64| {
            let lift = if d.below(3) == 0 { d.log(1e-6, 0.1) } else { d.between(0.1, 1.0) };
            target
                + side * (sign * lift)
                + (b - a) * d.between(-0.5, 0.5)
                + direction.normalize() * d.between(-1.0, 1.0)
        };
        let (c, e) = (corner(1.0), corner(-1.0));
        let ray = columns(&[origin, direction]);
        let rows = [[a, b, c], [b, a, e]].map(|triangle| [ray.clone(), columns(&triangle)].concat());
        // What was rounded to f32 must still be so: both seen from one side, not edge-on, and one of them hit.
        let facing = rows.each_ref().map(|row| {
            let x = exact(row);
            let [d, a, b, c] = [3, 6, 9, 12].map(|k| vector(&x, k));
            let n = (b - a).cross(c - a);
            n.dot(d) / (n.length() * d.length())
        });
        let hit = rows.iter().any(|row| {
            let x = exact(row);
            let [o, d, a, b, c] = [0, 3, 6, 9, 12].map(|k| vector(&x, k));
            ray::ray_triangle(o, d, a, b, c)[0] == 1.0
        });
        if facing[0] * facing[1] > 0.0 && facing.iter().all(|cos| cos.abs() > 1e-6) && hit {
            return rows;
        }
    }
}

#[test]
fn no_ray_passes_between_two_triangles_with_a_common_edge() {
    let gpu = Gpu::open();
    let mut draw = SplitMix64::new(37);
    let pairs: Vec<[Vec<f32>; 2]> = (0..RAYS).map(|_| at_shared_edge(&mut draw)).collect();
    // How wide the narrower triangle of a pair is seen, in radians.
    let width = |pair: &[Vec<f32>; 2]| {
        let widths = pair.each_ref().map(|row| {
            let x = exact(row);
            let [o, d, a, b, c] = [0, 3, 6, 9, 12].map(|k| vector(&x, k));
            (c - a).dot((b - a).cross(d).normalize()).abs() / (a - o).length()
        });
        widths[0].min(widths[1])
    };
    let leaks = |tier, narrowest| {
        let [first, second] = [0, 1].map(|k| {
            let rows: Vec<Vec<f32>> = pairs.iter().map(|pair| pair[k].clone()).collect();
            evaluated(&gpu, "ray_triangle", tier, &rows)
        });
        let missed = |&i: &usize| first[i][0] == 0.0 && second[i][0] == 0.0 && width(&pairs[i]) > narrowest;
        (0..RAYS).filter(missed).count()
    };
    // f32 coordinates are known to 6e-8 of their distance: what is seen narrower than a few of that may be turned over.
    let [fast, all, wide] = [(Tier::Fast, 0.0), (Tier::Stable, 0.0), (Tier::Stable, 2.5e-7)].map(|(t, w)| leaks(t, w));
    let compensated = leaks(Tier::Compensated, 0.0);
    eprintln!(
        "leaks of {RAYS} rays: fast {fast}, stable {all}, {wide} of them wider than 2.5e-7, compensated {compensated}"
    );
    assert_eq!(wide, 0, "leaks in the tier stable");
    assert_eq!(compensated, 0, "leaks in the tier compensated");
    assert!(fast > 1000, "Möller and Trumbore's test leaks at shared edges: {fast} of {RAYS}");
    assert!(gpu.errors().is_empty(), "{:?}", gpu.errors());
}

/// A triangle with coordinates of about `size` and a place on it.
fn hit_on_triangle(d: &mut SplitMix64, size: f64) -> Vec<f32> {
    let place = DVec3::from_array([0; 3].map(|_| d.sign() * size * d.between(0.1, 1.0)));
    let extent = size * d.log(1e-3, 1.0);
    let [a, b, c] = [0; 3].map(|_| place + d.direction() * extent);
    let (u, v) = (d.unit(), d.unit());
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    [vec![0.0; 7], columns(&[a, b, c]), vec![u as f32, v as f32]].concat()
}

/// Hit points of triangles, moved off them as rays are, by 32 roundings of the largest coordinate, or by a fixed
/// length: how many are not strictly on the side of the normal, and the largest shift.
fn moved_off(gpu: &Gpu, fixed: Option<f32>, hits: &[Vec<f32>], size: f64) -> (usize, f64) {
    let points = evaluated(gpu, "hit_point", Tier::Stable, hits);
    let corners: Vec<Vec<f32>> = hits.iter().map(|hit| hit[7..16].to_vec()).collect();
    let normals = evaluated(gpu, "triangle_normal", Tier::Stable, &corners);
    let offset = fixed.unwrap_or(2.0 * size as f32 * 32.0 / 16_777_216.0);
    let rows: Vec<Vec<f32>> =
        points.iter().zip(&normals).map(|(p, n)| [&p[..], &n[..3], &[0.0; 3], &[offset]].concat()).collect();
    let moved = evaluated(gpu, "offset_origin", Tier::Stable, &rows);
    let wrong = moved.iter().zip(&corners).filter(|(moved, corners)| {
        let (x, p) = (exact(corners), vector(&exact(moved), 0));
        let [a, b, c] = [0, 3, 6].map(|k| vector(&x, k));
        (b - a).cross(c - a).dot(p - a) <= 0.0
    });
    let shift = |(moved, p): (&Vec<f32>, &Vec<f32>)| (vector(&exact(moved), 0) - vector(&exact(p), 0)).length();
    (wrong.count(), moved.iter().zip(&points).map(shift).fold(0.0, f64::max))
}

#[test]
fn a_ray_starts_on_the_right_side_of_its_surface() {
    let gpu = Gpu::open();
    let mut draw = SplitMix64::new(38);
    for (size, fixed_fails) in [(1e-2, false), (1.0, false), (1e2, false), (1e3, true), (1e4, true), (1e5, true)] {
        let hits: Vec<Vec<f32>> = (0..20_000).map(|_| hit_on_triangle(&mut draw, size)).collect();
        let (wrong, shift) = moved_off(&gpu, None, &hits, size);
        let (fixed, _) = moved_off(&gpu, Some(1e-4), &hits, size);
        eprintln!("coordinates {size:e}: {wrong} of 20000 behind, largest shift {shift:e}; by a fixed 1e-4: {fixed}");
        assert_eq!(wrong, 0, "of 20,000 points with coordinates of {size:e} are behind their triangles");
        assert!((fixed > 0) == fixed_fails, "a fixed offset at coordinates of {size:e}: {fixed} behind");
    }
    assert!(gpu.errors().is_empty(), "{:?}", gpu.errors());
}
