//! Every equation of the shaders against its f64 twin, on the device: the bound of each output over its domain, no NaN
//! outside of it, and the vector files that were computed at 50 digits by a program that knows neither.

#[path = "support/gpu.rs"]
mod gpu;
#[path = "support/probe.rs"]
mod probe;

use std::path::{Path, PathBuf};

use etalon::optics::{Case, Draw, Tier, ulp};
use etalon::verify::{self, Cases, Entry, catalogue, vectors};
use gpu::Gpu;
use probe::{PROMISING, evaluate};

const CASES: usize = 100_000;

/// What a set of cases breaks, one sentence per output.
fn broken(gpu: &Gpu, entry: &Entry, tier: Tier, cases: &Cases) -> Vec<String> {
    let outputs =
        verify::evaluate(&gpu.device, entry.probe, tier, &cases.inputs, cases.count).expect("it runs").outputs;
    let figures = verify::judge(entry, tier, cases, &outputs);
    let failed = entry.equation.outputs.iter().zip(figures).filter(|(_, figures)| !figures.pass);
    failed
        .map(|(output, figures)| {
            format!(
                "{} ({}), {}, {}: bound {}, {:?}",
                entry.probe.name,
                entry.probe.ids.join(" "),
                output.name,
                tier.name(),
                output.bound,
                figures.worst
            )
        })
        .collect()
}

#[test]
fn every_output_of_every_equation_is_within_its_bound() {
    let gpu = Gpu::new();
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

#[test]
fn inputs_from_outside_every_domain_never_give_nan() {
    let gpu = Gpu::new();
    let mut wrong = Vec::new();
    for entry in catalogue() {
        for tier in PROMISING {
            let (count, first) = verify::nan_of_hostile(&gpu.device, &entry, tier, 20_000, 3).expect("it runs");
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
    ("expf", &[1e30], "y", f32::INFINITY),
    ("expf", &[-1e30], "y", 0.0),
    ("logf", &[0.0], "y", f32::NEG_INFINITY),
    ("logf", &[-3.0], "y", f32::NEG_INFINITY),
    ("log1pf", &[-2.0], "y", f32::NEG_INFINITY),
    ("powf", &[-1.0, 2.0], "z", 0.0),
    ("powf", &[0.0, 0.0], "z", 1.0),
    ("powf", &[0.0, -1.0], "z", f32::INFINITY),
    ("asinf", &[2.0], "y", std::f32::consts::FRAC_PI_2),
    ("acosf", &[2.0], "y", 0.0),
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
    ("half_round_trip", &[1e6], "y", 65504.0),
    ("safe_normalize", &[0.0, 0.0, 0.0], "is_zero", 1.0),
    ("triangle_normal", &[1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 4.0, 4.0, 4.0], "degenerate", 1.0),
];

#[test]
fn out_of_domain_values_are_the_documented_ones() {
    let gpu = Gpu::new();
    let mut wrong = Vec::new();
    for &(name, inputs, output, value) in OUT_OF_DOMAIN {
        for tier in PROMISING {
            let got = evaluate(&gpu, name, tier, &[inputs.to_vec()])[0][probe::column(name, output)];
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
    let gpu = Gpu::new();
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
                if error > slack && !(beyond(twin[column]) && beyond(exact[column])) {
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
    let gpu = Gpu::new();
    let mut draw = Draw::new(5);
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

/// Largest relative (or absolute) error of an output over its domain.
fn largest(gpu: &Gpu, name: &str, output: &str, tier: Tier, relative: bool) -> f64 {
    let entry = probe::entry(name);
    let cases = Cases::draw(&entry, CASES, 11);
    let outputs = verify::evaluate(&gpu.device, entry.probe, tier, &cases.inputs, CASES).expect("it runs").outputs;
    let figures = verify::judge(&entry, tier, &cases, &outputs).swap_remove(probe::column(name, output));
    match (relative, figures.non_finite) {
        (_, 1..) => f64::INFINITY,
        (true, _) => figures.max_rel,
        (false, _) => figures.max_abs,
    }
}

/// Outputs that are right in fewer than a fifth of the cases: what a format of few bits stores, and an offset that is
/// another rule than the fixed one of textbooks.
const TEXTBOOK_RARELY_RIGHT: &[(&str, &str)] = &[
    ("octahedral_round_trip", "dx"),
    ("octahedral_round_trip", "dy"),
    ("octahedral_round_trip", "dz"),
    ("octahedral_round_trip_precise", "dx"),
    ("octahedral_round_trip_precise", "dy"),
    ("octahedral_round_trip_precise", "dz"),
    ("half_round_trip", "y"),
    ("offset_origin", "shift"),
];

#[test]
fn the_textbook_form_is_the_same_formula() {
    let gpu = Gpu::new();
    let mut wrong = Vec::new();
    for entry in catalogue() {
        let cases = Cases::draw(&entry, 20_000, 13);
        let outputs = verify::evaluate(&gpu.device, entry.probe, Tier::Fast, &cases.inputs, cases.count)
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
            if (right * 5 < judged) != exempt {
                let (equation, ids) = (entry.probe.name, entry.probe.ids.join(" "));
                wrong.push(format!("{equation} ({ids}), {name}: {right} of {judged} within 1e-5"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_textbook_form_is_worse_where_numerics_says_so() {
    let gpu = Gpu::new();
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
        assert!(stable * 10.0 < fast, "{row}: {name}.{output}: stable {stable:e}, textbook {fast:e}");
    }
}

#[test]
fn the_judge_sees_nan_infinity_and_what_is_beyond_a_bound() {
    let entry = probe::entry("fresnel_schlick");
    let cases = Cases::from_rows(&entry, &[vec![1.0, 1.5, 0.0], vec![0.5, 1.5, 0.0]]);
    let right: Vec<f32> = (0..2).flat_map(|c| [cases.exact[c] as f32, cases.exact[2 + c] as f32]).collect();
    let judged = |at: usize, value: f32| {
        let mut outputs = right.clone();
        outputs[at] = value;
        verify::judge(&entry, Tier::Stable, &cases, &outputs)
    };
    assert!(judged(0, right[0]).iter().all(|figures| figures.pass && figures.non_finite == 0));
    for (value, non_finite) in [(f32::NAN, 1), (f32::INFINITY, 1), (0.05, 0)] {
        let found = judged(3, value);
        assert!(found[0].pass, "the other output is right");
        assert_eq!((found[1].pass, found[1].non_finite), (false, non_finite), "{value}");
        assert_eq!(found[1].worst.as_ref().map(|worst| worst.row), Some(1), "{value}");
        assert!(verify::judge(&entry, Tier::Fast, &cases, &right).iter().all(|figures| figures.pass));
    }
}
