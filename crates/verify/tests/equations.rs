//! Every equation of the shaders against its f64 twin, on the device: the bound of each output over its domain, no NaN
//! outside of it, and the vector files that were computed at 50 digits by a program that knows neither.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use etalon::optics::{Case, SplitMix64, Tier, ulp};
use etalon_testing::gpu::Gpu;
use etalon_testing::probe::{PROMISING, evaluate};
use etalon_verify::{Cases, Entry, catalogue, vectors};

const CASES: usize = 100_000;

/// What a set of cases breaks, one sentence per output. A twin that is NaN in all cases would switch a bound off.
fn broken(gpu: &Gpu, entry: &Entry, tier: Tier, cases: &Cases) -> Vec<String> {
    let outputs =
        etalon_verify::evaluate(&gpu.device, entry.probe, tier, &cases.inputs, cases.count).expect("it runs").outputs;
    let figures = etalon_verify::judge(entry, tier, cases, &outputs);
    let all = entry.equation.outputs.iter().zip(figures).zip(&cases.judged);
    let failed = all.filter(|((_, figures), judged)| !figures.pass || (**judged && figures.cases == 0));
    failed
        .map(|((output, figures), _)| {
            format!(
                "{} ({}), {}, {}: bound {}, {} cases, {:?}",
                entry.probe.name,
                entry.probe.ids.join(" "),
                output.name,
                tier.name(),
                output.bound,
                figures.cases,
                figures.worst
            )
        })
        .collect()
}

#[test]
fn every_output_of_every_equation_is_within_its_bound() {
    let gpu = Gpu::open();
    let mut wrong = Vec::new();
    for entry in catalogue() {
        let cases = Cases::draw(&entry, CASES, 7);
        assert_eq!(cases.count, CASES);
        for tier in PROMISING {
            wrong.extend(broken(&gpu, &entry, tier, &cases));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Equations whose callers keep to their domains.
const KEPT_TO: &[&str] = &[
    "anisotropic_distribution",
    "anisotropic_g2_over_g1",
    "anisotropic_root",
    "anisotropic_visibility",
    "arriving_light",
    "ball_reach",
    "density_per_solid_angle",
    "film_reflectance",
    "ggx_distribution",
    "ggx_visibility",
    "light_importance",
    "linear_from_srgb",
    "mirrored_pdf",
    "normal_reflectance",
    "phong_lobe",
    "reciprocal_lobe",
    "slab",
    "sphere_cone",
    "visible_half_vector",
];

#[test]
fn inputs_from_outside_a_domain_that_callers_may_leave_never_give_nan() {
    let gpu = Gpu::open();
    let kept_to: BTreeSet<&str> =
        catalogue().iter().filter(|entry| entry.equation.extreme < 0.0).map(|entry| entry.probe.name).collect();
    assert_eq!(kept_to.into_iter().collect::<Vec<_>>(), KEPT_TO);
    let mut wrong = Vec::new();
    for entry in catalogue() {
        for tier in PROMISING {
            let (count, first) = etalon_verify::nan_of_hostile(&gpu.device, &entry, tier, 20_000, 3).expect("it runs");
            if count > 0 {
                let (name, ids) = (entry.probe.name, entry.probe.ids.join(" "));
                wrong.push(format!("{name} ({ids}), {}: {count} NaN, first for {first:?}", tier.name()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// What the comments in shaders/lib/ say of inputs outside a domain: function, inputs, output, value.
const OUT_OF_DOMAIN: &[(&str, &[f32], &str, f32)] = &[
    ("exp_pair", &[1e30, 0.0], "y", f32::INFINITY),
    ("exp_pair", &[-1e30, 0.0], "y", 0.0),
    ("df_log", &[0.0], "hi", f32::NEG_INFINITY),
    ("df_log", &[-3.0], "hi", f32::NEG_INFINITY),
    ("powf", &[-1.0, 2.0], "z", 0.0),
    ("powf", &[0.0, 0.0], "z", 1.0),
    ("powf", &[0.0, -1.0], "z", f32::INFINITY),
    ("atan2f", &[0.0, 0.0], "angle", 0.0),
    ("df_div", &[0.0, 0.0, 0.0, 0.0], "hi", 0.0),
    ("df_sqrt", &[-1.0, 0.0], "hi", 0.0),
    ("fresnel_schlick", &[1.5, 1.5, 0.0], "F", 0.04),
    ("fresnel_schlick", &[-1.0, 1.5, 0.0], "F", 1.0),
    ("fresnel_dielectric", &[0.5, 0.0], "F", 1.0),
    ("fresnel_dielectric", &[-0.5, 1.5], "F", 1.0),
    ("fresnel_dielectric", &[0.0, 1.0], "F", 1.0),
    ("dielectric_transmitted", &[0.5, 0.0], "T", 0.0),
    ("fresnel_conductor", &[0.0, 1.0, 0.0], "F", 1.0),
    // No boundary: the squares of such cosines are no floats.
    ("fresnel_conductor", &[1e-28, 1.0, 0.0], "F", 0.0),
    ("fresnel_dielectric", &[1e-27, 1.0], "F", 0.0),
    ("fresnel_dielectric", &[1e-27, 1.0], "cos_t", 1e-27),
    ("dielectric_transmitted", &[1e-27, 1.0], "T", 1.0),
    ("fresnel_conductor", &[1.0, 1.0, 1e20], "F", 1.0),
    ("reflect", &[0.6, 0.0, -0.8, 0.0, 0.0, 0.0], "Rz", 0.0),
    ("refract", &[0.6, 0.0, -0.8, 0.0, 0.0, 1.0, 0.0], "tir", 1.0),
    ("refract", &[0.8, 0.0, -0.6, 0.0, 0.0, 1.0, 0.5], "Tx", 0.0),
    ("critical_angle", &[1.0, 1.5], "theta_deg", 90.0),
    ("brewster_angle", &[0.0, 0.0], "theta_rad", 0.0),
    ("lambert", &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 4.0, 0.1], "Lref", 0.0),
    ("lambert", &[0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 4.0, 0.1], "Lref", 0.0),
    ("blinn_phong", &[0.0, 0.0, 1.0, 0.0, 0.6, -0.8, 0.0, 0.6, 0.8, 1.0, 1.0, 1.0, 3.0], "spec", 0.0),
    ("blinn_phong", &[0.0, 0.0, 1.0, 0.0, 0.6, 0.8, 0.0, 0.6, 0.8, 1.0, 0.0, 1.0, -5.0], "spec", 1.0),
    ("blinn_phong", &[0.0, 0.0, 1.0, 0.0, 0.6, 0.8, 0.0, -0.6, -0.8, 1.0, 0.0, 1.0, 3.0], "spec", 0.0),
    ("reciprocal_phong", &[0.0, 0.0, 1.0, 0.0, 0.6, 0.8, 0.0, -0.6, -0.8, 1.0, 0.0, 1.0, 3.0], "fr_spec", 0.0),
    ("ggx", &[0.0, 0.0, 1.0, 0.0, 0.6, -0.8, 0.0, 0.6, 0.8, 0.5, 0.04], "fr", 0.0),
    ("beer_lambert", &[1.0, 0.0, 1e38], "T", 1.0),
    ("srgb", &[-0.5], "encode", 0.0),
    ("srgb", &[1.0], "encode", 1.0),
    ("light_directional", &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 5.0], "irradiance", 0.0),
    ("light_point", &[1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 0.0, 0.0, 1.0, 5.0], "E_perp", f32::INFINITY),
    ("light_point", &[1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 0.0, 0.0, 1.0, 5.0], "irradiance", 0.0),
    ("mis_weight", &[0.0, 0.0], "w", 0.0),
    ("safe_normalize", &[0.0, 0.0, 0.0], "is_zero", 1.0),
    ("triangle_normal", &[1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 4.0, 4.0, 4.0], "degenerate", 1.0),
];

#[test]
fn out_of_domain_values_are_the_documented_ones() {
    let gpu = Gpu::open();
    let mut wrong = Vec::new();
    for &(name, inputs, output, value) in OUT_OF_DOMAIN {
        for tier in PROMISING {
            let got = evaluate(&gpu, name, tier, &[inputs.to_vec()])[0][etalon_testing::probe::column(name, output)];
            let near = (got - value).abs() <= 2.0 * ulp(f64::from(value)) as f32;
            if got != value && !near {
                wrong.push(format!("{name} {inputs:?}, {}: {output} is {got}, not {value}", tier.name()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The committed vector files.
fn files() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vectors");
    let entries = std::fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("an entry").path());
    let mut files: Vec<_> = entries.filter(|path| path.extension().is_some_and(|e| e == "csv")).collect();
    files.sort();
    assert_eq!(files.len(), 20, "a file for each name of the contract");
    files
}

#[test]
fn vector_files_of_50_digits_hold() {
    let gpu = Gpu::open();
    let mut wrong = Vec::new();
    for file in files() {
        let (entry, cases) = vectors::load(&file, None).expect("a vector file");
        for tier in PROMISING {
            wrong.extend(broken(&gpu, &entry, tier, &cases));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn twins_agree_with_the_vector_files() {
    let mut wrong = Vec::new();
    for file in files() {
        let (entry, cases) = vectors::load(&file, None).expect("a vector file");
        let width = entry.probe.outputs.len();
        for row in 0..cases.count {
            let inputs = cases.row(row);
            let twin = (entry.equation.twin)(&inputs);
            for (column, output) in entry.equation.outputs.iter().enumerate() {
                let exact = &cases.exact[row * width..][..width];
                if exact[column].is_nan() {
                    continue;
                }
                // The ruler has finer marks than what it measures: a twentieth of an ulp, a hundredth of the bound.
                let case = Case { tier: Tier::Compensated, inputs: &inputs, exact: &twin, column };
                let slack = (0.05 * ulp(exact[column])).max(0.01 * (output.allowed)(&case));
                let beyond = |x: f64| x.abs() > f64::from(f32::MAX);
                let error = (twin[column] - exact[column]).abs();
                let near = error <= slack || (beyond(twin[column]) && beyond(exact[column]));
                if !near {
                    let (got, want) = (twin[column], exact[column]);
                    wrong.push(format!("{} {}, {inputs:?}: {got:e} is {want:e}", entry.probe.name, output.name));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{} values, first {}", wrong.len(), wrong[..wrong.len().min(12)].join("\n"));
}

#[test]
fn double_floats_keep_44_bits() {
    let gpu = Gpu::open();
    let mut draw = SplitMix64::new(5);
    let mut pair = || {
        let exact = draw.sign() * draw.log(1e-3, 1e3);
        let hi = exact as f32;
        [hi, (exact - f64::from(hi)) as f32]
    };
    let rows: Vec<Vec<f32>> = (0..CASES).map(|_| [pair(), pair()].concat()).collect();
    let sum = |pair: &[f32]| f64::from(pair[0]) + f64::from(pair[1]);
    for name in ["df_add", "df_mul", "df_div", "df_sqrt"] {
        let inputs: Vec<Vec<f32>> = match name {
            "df_sqrt" => rows.iter().map(|row| vec![row[0].abs(), row[1] * row[0].signum()]).collect(),
            _ => rows.clone(),
        };
        for (row, got) in rows.iter().zip(evaluate(&gpu, name, Tier::Compensated, &inputs)) {
            let (a, b) = (sum(&row[..2]), sum(&row[2..]));
            let want = match name {
                "df_add" => a + b,
                "df_mul" => a * b,
                "df_div" => a / b,
                _ => a.abs().sqrt(),
            };
            let error = (sum(&got) - want).abs();
            assert!(error <= 2_f64.powi(-44) * want.abs(), "{name} of {a:e}, {b:e}: {:e}, not {want:e}", sum(&got));
        }
    }
}

#[test]
fn the_logarithm_keeps_30_bits() {
    let gpu = Gpu::open();
    let mut draw = SplitMix64::new(6);
    let rows: Vec<Vec<f32>> = (0..CASES).map(|_| vec![draw.log(1.2e-38, 3e38) as f32]).collect();
    for (row, got) in rows.iter().zip(evaluate(&gpu, "df_log", Tier::Stable, &rows)) {
        let want = f64::from(row[0]).ln();
        let error = (f64::from(got[0]) + f64::from(got[1]) - want).abs();
        assert!(error <= 2_f64.powi(-30) * want.abs(), "ln {:e} is off by {error:e}", row[0]);
    }
}

/// The columns of some output for each row, in f64.
fn of(gpu: &Gpu, name: &str, tier: Tier, rows: &[Vec<f32>], output: &str) -> Vec<f64> {
    let column = etalon_testing::probe::column(name, output);
    evaluate(gpu, name, tier, rows).iter().map(|row| f64::from(row[column])).collect()
}

/// Cases of an equation's own regions.
fn drawn(name: &str, count: usize) -> Vec<Vec<f32>> {
    let cases = Cases::draw(&etalon_testing::probe::entry(name), count, 17);
    (0..count).map(|row| cases.row(row).iter().map(|&x| x as f32).collect()).collect()
}

/// Both columns alike, to `rel` of themselves and `abs`.
fn alike(what: &str, tier: Tier, form: &[f64], draws: &[f64], rel: f64, abs: f64) {
    assert!(form.iter().any(|a| !a.is_nan()), "{what}, {}: NaN alone", tier.name());
    for (row, (a, b)) in form.iter().zip(draws).enumerate() {
        let same = (a.is_nan() && b.is_nan()) || (a - b).abs() <= rel * a.abs().max(b.abs()) + abs;
        assert!(same, "{what}, {}, row {row}: {a:e}, what draws {b:e}", tier.name());
    }
}

/// The forms of the lecture and of docs/functions.md that no pass calls, against the functions that draw.
#[test]
fn laboratory_forms_agree_with_the_functions_of_pictures() {
    const ROWS: usize = 20_000;
    let gpu = Gpu::open();
    for tier in PROMISING {
        // B4, B5, B6: a lit surface, as the passes put it together; the albedo is π k_d.
        let rows: Vec<Vec<f32>> = drawn("blinn_phong", ROWS);
        let angle = evaluate(&gpu, "half_angle", tier, &rows.iter().map(|r| r[..9].to_vec()).collect::<Vec<_>>());
        let lit = of(&gpu, "blinn_phong", tier, &rows, "cos_in");
        let lobes: Vec<Vec<f32>> = angle.iter().zip(&rows).map(|(a, r)| [&a[..], &r[12..13]].concat()).collect();
        let lobe = of(&gpu, "phong_lobe", tier, &lobes, "lobe");
        let spec = of(&gpu, "blinn_phong", tier, &rows, "spec");
        // Of wide lobes the passes take the cosine again (phong_half_angle): those are compared where cosδ has digits.
        let sharp = |i: &usize| lit[*i] >= 0.0 && angle[*i][1] < 0.45 && angle[*i][0] > 0.0;
        let some: Vec<usize> = (0..ROWS).filter(sharp).collect();
        assert!(some.len() > ROWS / 4, "{}", some.len());
        let pick = |all: &[f64]| some.iter().map(|&i| all[i]).collect::<Vec<_>>();
        alike("blinn_phong", tier, &pick(&spec), &pick(&lobe), 0.0, 0.0);
        let parts: Vec<Vec<f32>> = angle.iter().zip(&lobe).map(|(a, l)| [&a[..], &[*l as f32]].concat()).collect();
        let drawn_fr: Vec<f64> = of(&gpu, "reciprocal_lobe", tier, &parts, "fr")
            .iter()
            .zip(&rows)
            .map(|(fr, r)| fr * f64::from(r[11]))
            .collect();
        let fr = of(&gpu, "reciprocal_phong", tier, &rows, "fr_spec");
        alike("reciprocal_phong", tier, &pick(&fr), &pick(&drawn_fr), 1.2e-7, 1e-37);
        let rows = drawn("lambert", ROWS);
        let cosines: Vec<Vec<f32>> = rows.iter().map(|r| r[..6].to_vec()).collect();
        let one = of(&gpu, "diffuse_brdf", tier, &[vec![1.0]], "fr")[0];
        let cos = of(&gpu, "cosine", tier, &cosines, "cos");
        let drawn_l: Vec<f64> = cos
            .iter()
            .zip(&rows)
            .map(|(c, r)| f64::from(r[6]) * f64::from(r[7]) * std::f64::consts::PI * one * c.max(0.0))
            .collect();
        let l = of(&gpu, "lambert", tier, &rows, "Lref");
        // Plain sums, whose cosines are good to 2e-7: 1.3e-7 for the products of the largest, 1e6, light.
        for ((a, b), row) in l.iter().zip(&drawn_l).zip(&rows) {
            let slack = f64::from(row[6]) * f64::from(row[7]) * 3e-7;
            assert!((a - b).abs() <= slack, "lambert at {row:?}: {a:e}, what draws {b:e}");
        }
        // B1: D, G and F alone, and their product.
        let rows = drawn("ggx_d", ROWS);
        let d = evaluate(&gpu, "ggx_d", tier, &rows);
        let parts: Vec<Vec<f32>> = d.iter().zip(&rows).map(|(d, r)| vec![d[0], d[1], r[6]]).collect();
        let d: Vec<f64> = d.iter().map(|d| f64::from(d[2])).collect();
        alike("ggx_d", tier, &d, &of(&gpu, "ggx_distribution", tier, &parts, "D"), 0.0, 0.0);
        let rows = drawn("ggx_g", ROWS);
        let vis = of(&gpu, "ggx_g", tier, &rows, "Vis");
        alike("ggx_g", tier, &vis, &of(&gpu, "ggx_visibility", tier, &rows, "Vis"), 0.0, 0.0);
        let rows = drawn("ggx_f", ROWS);
        let parts: Vec<Vec<f32>> = rows.iter().map(|r| vec![r[0], r[0], r[0], 1.0, r[1]]).collect();
        let f = of(&gpu, "ggx_f", tier, &rows, "F");
        alike("ggx_f", tier, &f, &of(&gpu, "schlick", tier, &parts, "Fx"), 0.0, 0.0);
        let rows = drawn("fresnel_schlick", ROWS);
        let f = evaluate(&gpu, "fresnel_schlick", tier, &rows);
        let f0 = of(&gpu, "normal_reflectance", tier, &rows.iter().map(|r| r[1..].to_vec()).collect::<Vec<_>>(), "F0");
        let parts: Vec<Vec<f32>> = f.iter().zip(&rows).map(|(f, r)| vec![f[0], f[0], f[0], 1.0, r[0]]).collect();
        let column = |k: usize| f.iter().map(|f| f64::from(f[k])).collect::<Vec<_>>();
        alike("fresnel_schlick, F0", tier, &column(0), &f0, 0.0, 0.0);
        alike("fresnel_schlick", tier, &column(1), &of(&gpu, "schlick", tier, &parts, "Fx"), 0.0, 0.0);
        let rows: Vec<Vec<f32>> = drawn("ggx", ROWS);
        let g = evaluate(&gpu, "ggx", tier, &rows);
        let angle = evaluate(&gpu, "half_angle", tier, &rows.iter().map(|r| r[..9].to_vec()).collect::<Vec<_>>());
        let parts: Vec<Vec<f32>> = angle.iter().zip(&rows).map(|(a, r)| vec![a[0], a[1], r[9]]).collect();
        let d: Vec<f64> = g.iter().map(|g| f64::from(g[0])).collect();
        // The form of the laboratory cuts sin² to 1.
        alike("ggx, D", tier, &d, &of(&gpu, "ggx_distribution", tier, &parts, "D"), 2e-6, 0.0);
        // C4, and texels.
        let rows = drawn("srgb", ROWS);
        let encode = of(&gpu, "srgb", tier, &rows, "encode");
        alike("srgb, encode", tier, &encode, &of(&gpu, "srgb_encode", tier, &rows, "encode"), 0.0, 0.0);
        let rows: Vec<Vec<f32>> = (0..256).map(|b| vec![b as f32 / 255.0]).collect();
        let texels: Vec<Vec<f32>> = rows.iter().map(|r| vec![r[0]; 3]).collect();
        let decode = of(&gpu, "srgb", tier, &rows, "decode");
        alike("srgb, decode", tier, &decode, &of(&gpu, "linear_from_srgb", tier, &texels, "lineary"), 2.5e-6, 0.0);
        // N10, N15: what is measured in the laboratory, of arcs and frames that draw.
        let turns: Vec<f64> = (0..ROWS).map(|i| (i as f64 + 0.5) / ROWS as f64 * 3.1).collect();
        let pair: Vec<Vec<f32>> =
            turns.iter().map(|t| vec![1.0, 0.0, 0.0, t.cos() as f32, t.sin() as f32, 0.0]).collect();
        let arcs: Vec<Vec<f32>> = pair.iter().map(|p| vec![p[4], p[3]]).collect();
        let angle = of(&gpu, "angle_between", tier, &pair, "angle");
        alike("angle_between", tier, &angle, &of(&gpu, "atan2f", tier, &arcs, "angle"), 6e-7, 0.0);
        let rows = drawn("basis_gram", ROWS);
        let gram = of(&gpu, "basis_gram", tier, &rows, "gram");
        let measured = |(row, frame): (&Vec<f32>, Vec<f32>)| {
            let wide = |v: &[f32]| glam::DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]));
            let (n, t, b) = (wide(row), wide(&frame[..3]), wide(&frame[3..]));
            let all = [t.dot(t) - 1.0, b.dot(b) - 1.0, t.dot(b), t.dot(n), b.dot(n)];
            all.iter().fold(0.0, |most: f64, x| most.max(x.abs()))
        };
        let frames = evaluate(&gpu, "orthonormal_basis", tier, &rows);
        let exact: Vec<f64> = rows.iter().zip(frames).map(measured).collect();
        alike("basis_gram", tier, &gram, &exact, 1e-6, 1e-12);
    }
}

/// Lights as the lecture has them, at a surface, against the light that passes ask the table for.
#[test]
fn lights_of_the_lecture_agree_with_those_of_pictures() {
    const ROWS: usize = 20_000;
    let gpu = Gpu::open();
    let mut draw = SplitMix64::new(23);
    let unit = |v: glam::DVec3| [v.x as f32, v.y as f32, v.z as f32];
    for tier in PROMISING {
        let all: Vec<_> = (0..ROWS).map(|_| (draw.direction(), draw.direction(), draw.log(1e-2, 1e3))).collect();
        let n: Vec<[f32; 3]> = all.iter().map(|(n, ..)| unit(*n)).collect();
        let q: Vec<[f32; 3]> = all.iter().map(|(_, l, r)| unit(*l * *r)).collect();
        let ends = [0.0, 0.0, 0.0, 1.0, 0.0, 1.0];
        // R4: the eye is the origin of what is drawn, and P of the lecture's light.
        let table: Vec<Vec<f32>> = q.iter().map(|q| [&q[..], &[0.0], &ends[..]].concat()).collect();
        let table: Vec<Vec<f32>> = table
            .into_iter()
            .map(|mut row| {
                row.truncate(10);
                row
            })
            .collect();
        let lecture: Vec<Vec<f32>> =
            q.iter().zip(&n).map(|(q, n)| [&[0.0; 3][..], &q[..], &n[..], &[1.0]].concat()).collect();
        let arriving = evaluate(&gpu, "arriving_light", tier, &table);
        let share: Vec<f64> = arriving.iter().map(|r| f64::from(r[3])).collect();
        alike("light_point", tier, &of(&gpu, "light_point", tier, &lecture, "E_perp"), &share, 1e-6, 0.0);
        let cosines: Vec<Vec<f32>> = arriving.iter().zip(&n).map(|(a, n)| [&n[..], &a[..3]].concat()).collect();
        let cos: Vec<f64> = of(&gpu, "cosine", tier, &cosines, "cos").iter().map(|c| c.max(0.0)).collect();
        alike("light_point, cosine", tier, &of(&gpu, "light_point", tier, &lecture, "cos_plus"), &cos, 0.0, 5e-7);
        // R3.
        let far: Vec<Vec<f32>> =
            all.iter().map(|(_, l, _)| [&unit(*l)[..], &[1.0], &ends[..]].concat()[..10].to_vec()).collect();
        let lecture: Vec<Vec<f32>> =
            all.iter().zip(&n).map(|((_, l, _), n)| [&n[..], &unit(*l), &[3.0]].concat()).collect();
        let arriving = evaluate(&gpu, "arriving_light", tier, &far);
        assert!(arriving.iter().all(|row| row[3] == 1.0));
        let cosines: Vec<Vec<f32>> = arriving.iter().zip(&n).map(|(a, n)| [&n[..], &a[..3]].concat()).collect();
        let lit: Vec<f64> = of(&gpu, "cosine", tier, &cosines, "cos").iter().map(|c| 3.0 * c.max(0.0)).collect();
        alike(
            "light_directional",
            tier,
            &of(&gpu, "light_directional", tier, &lecture, "irradiance"),
            &lit,
            0.0,
            1.5e-6,
        );
        // R2: the near side of a ball, and the first root of ray and sphere.
        let balls: Vec<_> = all.iter().map(|(_, l, r)| (*l, *r, r * draw.log(1e-2, 0.9), draw.unit())).collect();
        let reach: Vec<Vec<f32>> = balls
            .iter()
            .map(|(_, d, radius, x)| {
                let sin2 = (radius / d).powi(2) * x * 0.9;
                vec![(d * d) as f32, *radius as f32, (1.0 - sin2).sqrt() as f32, sin2 as f32]
            })
            .collect();
        let rays: Vec<Vec<f32>> = balls
            .iter()
            .map(|(l, d, radius, x)| {
                let sin2 = (radius / d).powi(2) * x * 0.9;
                let towards = draw.at_angle(*l, sin2.sqrt().asin());
                [&[0.0; 3][..], &unit(towards), &unit(*l * *d), &[*radius as f32]].concat()
            })
            .collect();
        let t0 = of(&gpu, "ray_sphere", tier, &rays, "t0");
        let t = of(&gpu, "ball_reach", tier, &reach, "t");
        for (row, (a, b)) in t0.iter().zip(&t).enumerate() {
            let (_, d, ..) = balls[row];
            assert!((a - b).abs() <= 5e-6 * d, "ball of {:?}: {a:e}, what draws {b:e}", reach[row]);
        }
    }
}

/// Largest relative (or absolute) error of an output over its domain.
fn largest(gpu: &Gpu, name: &str, output: &str, tier: Tier, relative: bool) -> f64 {
    let entry = etalon_testing::probe::entry(name);
    let cases = Cases::draw(&entry, CASES, 11);
    let outputs =
        etalon_verify::evaluate(&gpu.device, entry.probe, tier, &cases.inputs, CASES).expect("it runs").outputs;
    let figures =
        etalon_verify::judge(&entry, tier, &cases, &outputs).swap_remove(etalon_testing::probe::column(name, output));
    match (relative, figures.non_finite) {
        (_, 1..) => f64::INFINITY,
        (true, _) => figures.max_rel,
        (false, _) => figures.max_abs,
    }
}

/// Outputs that are right in fewer than a fifth of the cases: what a format of few bits stores.
const TEXTBOOK_RARELY_RIGHT: &[(&str, &str)] =
    &[("octahedral_round_trip", "dx"), ("octahedral_round_trip", "dy"), ("octahedral_round_trip", "dz")];

#[test]
fn the_textbook_form_is_the_same_formula() {
    let gpu = Gpu::open();
    let mut wrong = Vec::new();
    for entry in catalogue() {
        let cases = Cases::draw(&entry, 20_000, 13);
        let outputs = etalon_verify::evaluate(&gpu.device, entry.probe, Tier::Fast, &cases.inputs, cases.count)
            .expect("it runs")
            .outputs;
        let width = entry.probe.outputs.len();
        for (column, name) in entry.probe.outputs.iter().enumerate() {
            let (mut judged, mut right) = (0, 0);
            for row in 0..cases.count {
                let exact = cases.exact[row * width + column];
                let got = f64::from(outputs[column * cases.count + row]);
                judged += usize::from(!exact.is_nan());
                right += usize::from((got - exact).abs() <= 1e-5 * exact.abs());
            }
            let exempt = TEXTBOOK_RARELY_RIGHT.contains(&(entry.probe.name, name));
            if (judged == 0 || right * 5 < judged) != exempt {
                let (equation, ids) = (entry.probe.name, entry.probe.ids.join(" "));
                wrong.push(format!("{equation} ({ids}), {name}: {right} of {judged} within 1e-5"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_textbook_form_is_worse_where_numerics_says_so() {
    let gpu = Gpu::open();
    // Row of docs/numerics.md, output, and the error that the textbook form reaches at least.
    let claims: &[(&str, &str, &str, bool, f64)] = &[
        ("N2", "fresnel_dielectric", "rs", true, 0.1),
        ("N4", "fresnel_dielectric", "F", false, 4e-3),
        ("N3", "dielectric_transmitted", "T", true, 0.5),
        ("N6", "fresnel_conductor", "F", true, 100.0),
        ("N7", "conductor_absorbed", "A", true, 0.9),
        ("N11", "refract", "Tx", false, 1e-4),
        ("N27", "expm1f", "y", true, 0.9),
        ("N47", "nested_f0", "F0", true, 0.1),
    ];
    for &(row, name, output, relative, least) in claims {
        let fast = largest(&gpu, name, output, Tier::Fast, relative);
        let stable = largest(&gpu, name, output, Tier::Stable, relative);
        assert!(fast >= least, "{row}: {name}.{output} is off by {fast:e} in the textbook form, not by {least:e}");
        assert!(stable * 5.0 < fast, "{row}: {name}.{output}: stable {stable:e}, textbook {fast:e}");
    }
}

#[test]
fn the_judge_sees_nan_infinity_and_what_is_beyond_a_bound() {
    let entry = etalon_testing::probe::entry("fresnel_schlick");
    let cases = Cases::from_rows(&entry, &[vec![1.0, 1.5, 0.0], vec![0.5, 1.5, 0.0]]);
    let right: Vec<f32> = (0..2).flat_map(|c| [cases.exact[c] as f32, cases.exact[2 + c] as f32]).collect();
    let judged = |at: usize, value: f32| {
        let mut outputs = right.clone();
        outputs[at] = value;
        etalon_verify::judge(&entry, Tier::Stable, &cases, &outputs)
    };
    assert!(judged(0, right[0]).iter().all(|figures| figures.pass && figures.non_finite == 0));
    for (value, non_finite) in [(f32::NAN, 1), (f32::INFINITY, 1), (0.05, 0)] {
        let found = judged(3, value);
        assert!(found[0].pass, "the other output is right");
        assert_eq!((found[1].pass, found[1].non_finite), (false, non_finite), "{value}");
        assert_eq!(found[1].worst.as_ref().map(|worst| worst.row), Some(1), "{value}");
        assert!(etalon_verify::judge(&entry, Tier::Fast, &cases, &right).iter().all(|figures| figures.pass));
    }
}

/// A device that flushes denormal numbers is judged by all numbers whose rounding errors are none.
#[test]
fn tiny_numbers_are_not_judged_where_denormal_ones_are_flushed() {
    let gpu = Gpu::open();
    assert!(!etalon_verify::flushes_denormals(&gpu.device).expect("it runs"), "lavapipe keeps them");
    let product = etalon_verify::find("two_product").expect("an equation");
    // The high parts of four products, and their low parts.
    let rows = [[1.0_f32, 2.0], [1e-35, 1.0], [1e-20, 1e-20], [0.0, 1.0]].map(|row| row.to_vec());
    let (flushed, wrong) = ([2.0, 0.0, 0.0, 0.0], [3.0, 0.0, 0.0, 0.0]);
    let passes = |cases: &Cases, high: [f32; 4]| {
        let outputs = [high, [0.0; 4]].concat();
        etalon_verify::judge(&product, Tier::Stable, cases, &outputs).swap_remove(0).pass
    };
    let mut cases = Cases::from_rows(&product, &rows);
    assert!(!passes(&cases, flushed), "1e-35 is 1e-35");
    assert_eq!(cases.expect_nothing_of_tiny(), 2);
    assert!(passes(&cases, flushed) && !passes(&cases, wrong));
}
