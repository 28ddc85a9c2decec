//! What must hold of the shaders' formulas together, on the device: energy, reciprocity, Snell's law there and back,
//! the furnace, and the lecture's quiz.

use std::f64::consts::{FRAC_PI_2, PI};

use etalon::optics::catalogue::{columns, vector};
use etalon::optics::{SplitMix64, Tier};
use etalon_testing::gpu::Gpu;
use etalon_testing::probe::{PROMISING, column, evaluate, value};
use glam::DVec3;

const CASES: usize = 100_000;

fn wide(row: &[f32]) -> Vec<f64> {
    row.iter().map(|&x| f64::from(x)).collect()
}

/// A direction on N's side, at least `least` radians above the horizon.
fn above(draw: &mut SplitMix64, n: DVec3, least: f64) -> DVec3 {
    let angle = draw.between(0.0, FRAC_PI_2 - least);
    draw.at_angle(n, angle)
}

#[test]
fn reflected_and_transmitted_power_are_one() {
    let gpu = Gpu::open();
    let mut draw = SplitMix64::new(1);
    let dielectrics: Vec<Vec<f32>> = (0..CASES).map(|_| vec![draw.unit() as f32, draw.log(0.2, 5.0) as f32]).collect();
    let metals: Vec<Vec<f32>> =
        (0..CASES).map(|_| vec![draw.unit() as f32, draw.log(0.05, 5.0) as f32, draw.log(0.5, 8.0) as f32]).collect();
    for tier in PROMISING {
        // A metal's two numbers come from different sums, each good to 8 ulp of what is at most 1/2 or off 1 by that.
        let dielectrics = (&dielectrics, "fresnel_dielectric", "dielectric_transmitted", 2e-7);
        let metals = (&metals, "fresnel_conductor", "conductor_absorbed", 5e-7);
        for (rows, reflected, kept, slack) in [dielectrics, metals] {
            let f = evaluate(&gpu, reflected, tier, rows);
            let t = evaluate(&gpu, kept, tier, rows);
            for ((row, f), t) in rows.iter().zip(&f).zip(&t) {
                let sum = f64::from(f[0]) + f64::from(t[2]);
                assert!((sum - 1.0).abs() <= slack, "{reflected} + {kept} at {row:?}: {sum}");
                assert!((0.0..=1.0).contains(&f[0]), "{reflected} at {row:?}: {}", f[0]);
            }
        }
    }
}

#[test]
fn reflectance_never_falls_on_the_way_to_the_critical_angle() {
    let gpu = Gpu::open();
    for n in [0.4_f32, 0.66, 0.75, 0.9, 0.99] {
        let critical = (1.0 - f64::from(n).powi(2)).sqrt();
        // Beyond Brewster's angle, arctan n, both parts grow until all is reflected.
        let brewster = 1.0 / f64::from(n).hypot(1.0);
        let rows: Vec<Vec<f32>> = (0..20_000)
            .map(|i| {
                let part = f64::from(i) / 20_000.0;
                vec![(brewster + (critical * 0.999 - brewster) * part) as f32, n]
            })
            .collect();
        for tier in PROMISING {
            let f: Vec<f32> = evaluate(&gpu, "fresnel_dielectric", tier, &rows).iter().map(|r| r[0]).collect();
            for (pair, row) in f.windows(2).zip(&rows) {
                assert!(pair[1] >= pair[0] - 4e-7, "n = {n}, cos {}: {} then {}", row[0], pair[0], pair[1]);
            }
            assert_eq!(f.last(), Some(&1.0), "beyond the critical angle all is reflected");
        }
    }
}

#[test]
fn refraction_obeys_snell_and_can_be_undone() {
    let gpu = Gpu::open();
    let mut draw = SplitMix64::new(2);
    let rows: Vec<Vec<f32>> = (0..CASES)
        .map(|_| {
            let n = draw.direction();
            let v = -above(&mut draw, n, 1e-3);
            let mut row = columns(&[v, n]);
            row.push(draw.log(0.4, 2.5) as f32);
            row
        })
        .collect();
    for tier in PROMISING {
        let there = evaluate(&gpu, "refract", tier, &rows);
        let passed: Vec<_> = rows.iter().zip(&there).filter(|(_, out)| out[3] == 0.0).collect();
        assert!(passed.len() > CASES / 2);
        let back: Vec<Vec<f32>> = passed
            .iter()
            .map(|(row, out)| {
                let t = &out[..3];
                // Backwards along T, from the other side: −T comes in, −N faces it, and the index is inverted.
                let facing = [-t[0], -t[1], -t[2], -row[3], -row[4], -row[5]];
                [&facing[..], &[1.0 / row[6]]].concat()
            })
            .collect();
        let back = evaluate(&gpu, "refract", tier, &back);
        let mut worst: f64 = 0.0;
        for ((row, out), returned) in passed.iter().zip(&back) {
            let (x, t) = (wide(row), wide(out));
            let (v, normal, n) = (vector(&x, 0), vector(&x, 3).normalize(), x[6]);
            let (t, disc) = (vector(&t, 0), t[4]);
            assert!((t.length() - 1.0).abs() <= 2e-7, "|T| at {row:?}");
            // sin α = n sin β, as vectors in the surface; beside it the rounding of v and T.
            let along = (normal.cross(v) - n * normal.cross(t)).length();
            assert!(along <= 5e-7 * n.max(1.0), "Snell's law at {row:?}: {along:e}");
            // The rounding of T, 1e-7 in angle, is magnified where T or the returning ray grazes.
            let cos_in = -v.dot(normal);
            let amplified = 1.0 / disc.sqrt().min(cos_in) * n.max(1.0 / n);
            let error = (vector(&wide(returned), 0) + v).length();
            worst = worst.max(error / amplified);
            assert!(error <= 5e-7 * amplified, "there and back at {row:?}: {error:e}");
        }
        eprintln!("{}: there and back within {worst:.2e} of the magnification", tier.name());
    }
}

#[test]
fn a_chain_of_reflections_keeps_its_length() {
    let gpu = Gpu::open();
    let mut draw = SplitMix64::new(3);
    let mut drift = |tier: Tier| {
        let mut directions: Vec<DVec3> = (0..1000).map(|_| draw.direction()).collect();
        let mut longest: f64 = 0.0;
        for _ in 0..256 {
            let rows: Vec<Vec<f32>> = directions.iter().map(|v| columns(&[*v, draw.direction()])).collect();
            directions = evaluate(&gpu, "reflect", tier, &rows).iter().map(|r| vector(&wide(r), 0)).collect();
            assert!(directions.iter().all(|v| v.is_finite()), "{}: NaN or infinity", tier.name());
            longest = directions.iter().fold(longest, |all, v| all.max((v.length() - 1.0).abs()));
        }
        longest
    };
    let [fast, stable, compensated] = Tier::ALL.map(&mut drift);
    eprintln!("length after 256 reflections is off by {fast:.1e}, {stable:.1e}, {compensated:.1e}");
    assert!(stable <= 2e-7 && compensated <= 2e-7, "{stable:e}, {compensated:e}");
    assert!(fast > 1e-6, "the textbook form drifts: {fast:e}");
}

/// N, L, V and the parameters after them.
fn configuration(n: DVec3, l: DVec3, v: DVec3, parameters: &[f32]) -> Vec<f32> {
    let mut row = columns(&[n, l, v]);
    row.extend_from_slice(parameters);
    row
}

/// Rows with L and V, and the same with both exchanged.
fn exchanged(seed: u64, parameters: impl Fn(&mut SplitMix64) -> Vec<f32>) -> [Vec<Vec<f32>>; 2] {
    let mut draw = SplitMix64::new(seed);
    let mut pairs = (Vec::new(), Vec::new());
    for _ in 0..CASES {
        let n = draw.direction();
        let (l, v) = (above(&mut draw, n, 1e-2), above(&mut draw, n, 1e-2));
        let rest = parameters(&mut draw);
        pairs.0.push(configuration(n, l, v, &rest));
        pairs.1.push(configuration(n, v, l, &rest));
    }
    [pairs.0, pairs.1]
}

#[test]
fn brdfs_that_claim_reciprocity_have_it() {
    let gpu = Gpu::open();
    let phong = |draw: &mut SplitMix64| vec![1.0, 0.1, 0.5, draw.log(1.0, 1e4) as f32];
    let ggx = |draw: &mut SplitMix64| vec![draw.log(1e-3, 1.0) as f32, draw.unit() as f32];
    for tier in PROMISING {
        for (name, output, [a, b]) in
            [("reciprocal_phong", "fr_spec", exchanged(4, phong)), ("ggx", "fr", exchanged(5, ggx))]
        {
            let at = column(name, output);
            let (there, back) = (evaluate(&gpu, name, tier, &a), evaluate(&gpu, name, tier, &b));
            for ((row, x), y) in a.iter().zip(&there).zip(&back) {
                let (x, y) = (f64::from(x[at]), f64::from(y[at]));
                assert!((x - y).abs() <= 1e-6 * x.abs().max(1e-30), "{name}, {} at {row:?}: {x:e}, {y:e}", tier.name());
            }
        }
    }
}

#[test]
fn blinn_phong_is_not_reciprocal_by_the_ratio_of_the_cosines() {
    let gpu = Gpu::open();
    let [a, b] = exchanged(6, |draw| vec![1.0, 0.0, 1.0, draw.between(1.0, 20.0) as f32]);
    let (radiance, cos) = (column("blinn_phong", "Lref"), column("blinn_phong", "cos_in"));
    let (there, back) =
        (evaluate(&gpu, "blinn_phong", Tier::Stable, &a), evaluate(&gpu, "blinn_phong", Tier::Stable, &b));
    let mut broken = 0;
    for (x, y) in there.iter().zip(&back) {
        // f_r = L_ref / (L_in cosθ_in); k_d = 0 and L_in = 1.
        let f = |row: &[f32]| f64::from(row[radiance]) / f64::from(row[cos]);
        if x[radiance] < 1e-6 {
            continue;
        }
        let (ratio, cosines) = (f(x) / f(y), f64::from(y[cos]) / f64::from(x[cos]));
        assert!((ratio / cosines - 1.0).abs() < 1e-5, "f(L,V)/f(V,L) = {ratio}, cosV/cosL = {cosines}");
        broken += usize::from((ratio - 1.0).abs() > 0.01);
    }
    assert!(broken > CASES / 2, "B5 must fail: only {broken} of {CASES} do");
}

/// Directional albedo for a viewer at `angle`: the integral of f_r cosθ, which is the output for unit light, over the
/// hemisphere by the midpoint rule; and what the rule is off by, its change from half as many places a side.
fn albedo(gpu: &Gpu, name: &str, output: &str, angle: f64, parameters: &[f32]) -> (f64, f64) {
    let [coarse, fine] = [256, 512].map(|side| quadrature(gpu, name, output, angle, parameters, side));
    (fine, (fine - coarse).abs())
}

fn quadrature(gpu: &Gpu, name: &str, output: &str, angle: f64, parameters: &[f32], side: u32) -> f64 {
    let n = DVec3::Z;
    let v = DVec3::new(angle.sin(), 0.0, angle.cos());
    let mut rows = Vec::new();
    let mut weights = Vec::new();
    for i in 0..side {
        // u = sin²θ is uniform: dω cosθ = du dφ / 2.
        let u = (f64::from(i) + 0.5) / f64::from(side);
        let (sin, cos) = (u.sqrt(), (1.0 - u).sqrt());
        for j in 0..side {
            let phi = (f64::from(j) + 0.5) / f64::from(side) * 2.0 * PI;
            rows.push(configuration(n, DVec3::new(sin * phi.cos(), sin * phi.sin(), cos), v, parameters));
            weights.push(PI / f64::from(side * side) / cos);
        }
    }
    let at = column(name, output);
    let values = evaluate(gpu, name, Tier::Stable, &rows);
    values.iter().zip(weights).map(|(row, weight)| f64::from(row[at]) * weight).sum()
}

#[test]
fn the_furnace_gives_back_no_more_than_it_gets() {
    let gpu = Gpu::open();
    let angles = [0.0, 30.0, 60.0, 80.0, 89.0_f64].map(f64::to_radians);
    for angle in angles {
        // Lambert with k_d = 1/π reflects everything: L_ref is f cosθ, so the weight is without the cosine.
        let row = [1.0, std::f32::consts::FRAC_1_PI, 0.0, 1.0];
        let (lambert, _) = albedo(&gpu, "reciprocal_phong", "Lref", angle, &row);
        assert!((lambert - 1.0).abs() < 1e-6, "Lambert: {lambert}");
        for shine in [1.0_f32, 3.0, 10.0, 100.0] {
            // The limit of B6 with half of the light for the diffuse part.
            let kd = 0.5 / PI;
            let ks = (f64::from(shine) + 2.0) / (2.0 * PI) * (1.0 - PI * kd);
            let row = [1.0, kd as f32, ks as f32, shine];
            let (found, off) = albedo(&gpu, "reciprocal_phong", "Lref", angle, &row);
            assert!(found <= 1.0 + 1e-6 + off, "B6, shine {shine}, {:.0}°: {found} ± {off:e}", angle.to_degrees());
        }
        for alpha in [0.1_f32, 0.3, 0.6, 1.0] {
            let (found, off) = albedo(&gpu, "ggx", "fr_cos", angle, &[alpha, 1.0]);
            eprintln!("GGX, α {alpha}, {:.0}°: white furnace {found:.4}", angle.to_degrees());
            assert!(found <= 1.0 + 1e-6 + off, "GGX, α {alpha}, {:.0}°: {found} ± {off:e}", angle.to_degrees());
            assert!(found > 0.3, "GGX, α {alpha}, {:.0}°: {found}", angle.to_degrees());
        }
    }
    // Beyond the limit B6 does make light: k_s = 1, shine 3 at 89° reflects 1.18 (docs/numerics.md S13).
    let (beyond, _) = albedo(&gpu, "reciprocal_phong", "Lref", 89_f64.to_radians(), &[1.0, 0.0, 1.0, 3.0]);
    assert!((beyond - 1.18).abs() < 0.01, "{beyond}");
}

#[test]
fn the_quiz_comes_out_of_the_shaders() {
    let gpu = Gpu::open();
    for tier in Tier::ALL {
        let close = |found: f64, want: f64, what: &str| {
            // 1.2 is no f32, and F0 changes 4δn/(n² − 1) with n: 4.4e-7.
            let slack = if tier == Tier::Fast { 2e-4 } else { 1e-6 };
            assert!((found - want).abs() <= slack * want.abs(), "{what}, {}: {found}, not {want}", tier.name());
        };
        // Q1: n = 1.2 at normal incidence.
        close(value(&gpu, "fresnel_schlick", tier, &[1.0, 1.2, 0.0], "F"), 1.0 / 121.0, "Q1 Schlick");
        close(value(&gpu, "fresnel_dielectric", tier, &[1.0, 1.2], "F"), 1.0 / 121.0, "Q1 exact");
        close(value(&gpu, "fresnel_conductor", tier, &[1.0, 1.2, 0.0], "F"), 1.0 / 121.0, "Q1 conductor");
        // Q2: light from (0, 3, 4), L_in = 4, k_d = 0.1; where the camera is does not matter.
        let lambert = [0.0, 0.0, 1.0, 0.0, 0.6, 0.8, 4.0, 0.1];
        close(value(&gpu, "lambert", tier, &lambert, "Lref"), 0.32, "Q2");
        // Q3: from index 10 to air.
        close(value(&gpu, "critical_angle", tier, &[10.0, 1.0], "theta_deg"), 5.7391704772668, "Q3");
        // Q4: k_s = √2, shine 3, light from (0, 3, 4), camera toward (0, 4, 3).
        let sqrt2 = std::f32::consts::SQRT_2;
        let shiny = [0.0, 0.0, 1.0, 0.0, 0.6, 0.8, 0.0, 0.8, 0.6, 4.0, 0.0, sqrt2, 3.0];
        close(value(&gpu, "blinn_phong", tier, &shiny, "Lref"), 2.0, "Q4");
        close(value(&gpu, "reciprocal_phong", tier, &shiny, "Lref"), 20.0 / 49.0, "Q4 by B6");
        // Q5: f = (x² + y² − z²)/3 − K at (3, 3, 2): the normal is the gradient.
        let third = 1.0 / 3.0;
        let quadric = [3.0, 3.0, 2.0, third, third, -third];
        let [x, y, z] = ["Nx", "Ny", "Nz"].map(|axis| value(&gpu, "quadric_normal", tier, &quadric, axis));
        close(x / y, 1.0, "Q5");
        close(z / x, -2.0 / 3.0, "Q5, the third component");
        // Q6: irradiance of a point source falls with 1/r², and F lies in [0, 1].
        let at =
            |r: f32| value(&gpu, "light_point", tier, &[0.0, 0.0, 0.0, 0.0, 0.0, r, 0.0, 0.0, 1.0, 5.0], "irradiance");
        close(at(2.0) / at(6.0), 9.0, "Q6");
    }
}

/// Solid angle of a triangle from the origin, as light is drawn from it: the mean of 1 over the density of its places.
fn solid_angle(gpu: &Gpu, tier: Tier, corners: [[f64; 3]; 3], side: u32) -> f64 {
    let [a, b, c] = corners.map(DVec3::from_array);
    let doubled = (b - a).cross(c - a);
    let per_area = 2.0 / doubled.length();
    let mut rows = Vec::new();
    for i in 0..side {
        for j in 0..side {
            // Centroids of small triangles: the upright ones, and those upside down between them.
            for (u, v) in [(1.0, 1.0), (2.0, 2.0)] {
                let (u, v) =
                    ((3.0 * f64::from(i) + u) / f64::from(3 * side), (3.0 * f64::from(j) + v) / f64::from(3 * side));
                if u + v < 1.0 {
                    let p = a + (b - a) * u + (c - a) * v;
                    let cos = doubled.normalize().dot(p.normalize()).abs();
                    rows.push(vec![per_area as f32, p.length_squared() as f32, cos as f32]);
                }
            }
        }
    }
    let densities = evaluate(gpu, "density_per_solid_angle", tier, &rows);
    densities.iter().map(|row| 1.0 / f64::from(row[0])).sum::<f64>() / rows.len() as f64
}

#[test]
fn solid_angles_of_known_triangles() {
    let gpu = Gpu::open();
    for tier in PROMISING {
        let omega = |corners: [[f64; 3]; 3]| solid_angle(&gpu, tier, corners, 200);
        let octant = omega([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]]);
        assert!((octant - PI / 2.0).abs() < 2e-4, "an octant, {}: {octant}", tier.name());
        // Half a face of a cube seen from its middle: an eighth of a third of the sphere.
        let half = omega([[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0]]);
        assert!((half - PI / 3.0).abs() < 2e-4, "half a face, {}: {half}", tier.name());
        // Far away it is area over distance squared, less 1.5 (size/distance)².
        let far = omega([[0.0, 0.0, 1000.0], [1.0, 0.0, 1000.0], [0.0, 1.0, 1000.0]]);
        assert!((far / 0.5e-6 - 1.0).abs() < 2e-6, "far, {}: {far:e}", tier.name());
    }
}

#[test]
fn both_angles_of_a_boundary_are_those_of_its_reflectance() {
    let gpu = Gpu::open();
    let mut draw = SplitMix64::new(9);
    for tier in PROMISING {
        for _ in 0..200 {
            let (n_in, n_out) = (draw.between(1.05, 3.0) as f32, draw.between(1.0, 1.04) as f32);
            let n = n_out / n_in;
            // What draws is thrown back from a little beyond the critical angle on, and not before it.
            let critical = value(&gpu, "critical_angle", tier, &[n_in, n_out], "cos_theta");
            for (part, thrown_back) in [(1.0 - 1e-5, 1.0), (1.0 + 1e-5, 0.0)] {
                let tir = value(&gpu, "fresnel_dielectric", tier, &[(critical * part) as f32, n], "tir");
                assert_eq!(tir, thrown_back, "{n_in} to {n_out}, {}: {part} of the critical cosine", tier.name());
            }
            // And reflects nothing of p at Brewster's, from either side.
            for [from, to] in [[n_in, n_out], [n_out, n_in]] {
                let brewster = value(&gpu, "brewster_angle", tier, &[from, to], "cos_theta");
                let rp = value(&gpu, "fresnel_dielectric", tier, &[brewster as f32, to / from], "rp");
                assert!(rp.abs() < 5e-6, "{from} to {to}, {}: r_p = {rp:e} at Brewster's angle", tier.name());
            }
        }
    }
}

#[test]
fn eight_bit_colours_survive_decoding_and_encoding() {
    let gpu = Gpu::open();
    for tier in PROMISING {
        let bytes: Vec<Vec<f32>> = (0..256).map(|b| vec![b as f32 / 255.0]).collect();
        let decode = column("srgb", "decode");
        let linear: Vec<Vec<f32>> = evaluate(&gpu, "srgb", tier, &bytes).iter().map(|row| vec![row[decode]]).collect();
        let encode = column("srgb", "encode");
        for (byte, row) in evaluate(&gpu, "srgb", tier, &linear).iter().enumerate() {
            assert_eq!((row[encode] * 255.0 + 0.5).floor() as usize, byte);
        }
    }
}
