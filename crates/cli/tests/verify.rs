//! `etalon verify` as a user runs it: the table, the JSON document, vector files good and bad, plots.

#[path = "support/program.rs"]
mod program;

use std::path::Path;

use program::{Run, etalon};
use serde_json::Value;

fn run(arguments: &[&str]) -> Run {
    let folder = tempfile::tempdir().expect("a folder");
    etalon(folder.path(), arguments, &[])
}

/// A vector file `name` with this content, verified.
fn vectors(name: &str, content: &str, more: &[&str]) -> Run {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join(name), content).expect("a file");
    let arguments = [&["verify", "--device", "cpu", "--vectors", name], more].concat();
    etalon(folder.path(), &arguments, &[])
}

fn document(run: &Run) -> Value {
    serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}: {run:?}"))
}

#[test]
fn the_list_names_inputs_and_outputs() {
    let listed = run(&["verify", "--list"]).succeeded().stdout;
    for line in [
        "fresnel_dielectric: cos_in n -> F rs rp cos_t tir",
        "refract: vx vy vz Nx Ny Nz n -> Tx Ty Tz tir disc",
        "cmf_integral: s380 … s780 -> X Y Z sR sG sB r10 g10 b10",
    ] {
        assert!(listed.lines().any(|l| l == line), "{line}\n{listed}");
    }
    let json = document(&run(&["verify", "--list", "--json", "--function", "cmf_integral"]).succeeded());
    assert_eq!(json["schema"], "etalon.functions/1");
    assert_eq!(json["functions"][0]["inputs"].as_array().map(Vec::len), Some(81));
}

#[test]
fn json_has_the_names_of_the_contract() {
    let arguments =
        ["verify", "--device", "cpu", "--json", "--function", "fresnel_schlick", "--cases", "1000", "--validate"];
    let json = document(&run(&arguments).succeeded());
    assert_eq!(json["schema"], "etalon.verify/1");
    assert!(json["device"]["name"].is_string());
    let outputs = json["outputs"].as_array().expect("outputs");
    assert_eq!(outputs.len(), 6, "two outputs in three tiers");
    for row in outputs {
        assert_eq!(row["function"], "fresnel_schlick");
        assert_eq!(row["cases"], 1000);
        for number in ["max_ulp", "max_rel", "max_abs", "non_finite", "ms_per_million"] {
            assert!(row[number].is_number(), "{number}: {row}");
        }
        assert_eq!(row["bound"].is_null(), row["tier"] == "fast", "{row}");
        assert_eq!(row["pass"], true);
        let worst = &row["worst"];
        assert!(worst["row"].is_u64() && worst["inputs"]["cos_in"].is_number(), "{worst}");
        assert!(worst["got"].is_number() && worst["expected"].is_number(), "{worst}");
    }
}

/// The sine of 30° is 1/2.
#[test]
fn eval_prints_the_value_of_every_tier() {
    let json = document(&run(&["eval", "--json", "critical_angle", "n_in=2", "n_out=1", "--validate"]).succeeded());
    let outputs = json["outputs"].as_array().expect("outputs");
    let degrees = outputs.iter().find(|output| output["output"] == "theta_deg").expect("an angle");
    // In the textbook form Vulkan allows 4096 ulp of the angle in radians, 0.014°; the others promise 5.
    for (tier, bound) in [("fast", 1.4e-2), ("stable", 1e-5), ("compensated", 1e-5), ("twin", 1e-12)] {
        let value = degrees[tier].as_f64().expect("a number");
        assert!((value - 30.0).abs() < bound, "{tier}: {value}");
    }
}

/// Blinn and Phong's lobe changes when light and viewer change places, and the reciprocal one does not.
#[test]
fn plot_tells_what_an_exchange_of_two_vectors_changes() {
    let difference = |function: &str, column: &str| {
        let inputs = "--over L=-80..80 --swap L,V N=0 V=60 Lin=1 kd=0 ks=1 shine=20 -o x.svg";
        let line = format!("plot {function} --column {column} {inputs}");
        let said = run(&line.split(' ').collect::<Vec<_>>()).succeeded().stdout;
        let (_, rest) = said.split_once("largest difference ").expect("a difference");
        rest.split_whitespace().next().and_then(|number| number.parse::<f64>().ok()).expect("a number")
    };
    // At L = -75°: cos²⁰ 7.5° (1/cos 75° − 1/cos 60°) is 1.6.
    let (phong, reciprocal) = (difference("blinn_phong", "Lref/cos_in"), difference("reciprocal_phong", "fr_spec"));
    assert!(phong > 1.0 && reciprocal < 1e-4, "{phong} and {reciprocal}");
}

#[test]
fn the_same_seed_gives_the_same_figures() {
    let figures = |seed: &str| {
        let arguments =
            ["verify", "--device", "cpu", "--json", "--function", "ggx_g", "--cases", "3000", "--seed", seed];
        let json = document(&run(&arguments).succeeded());
        json["outputs"].as_array().expect("outputs").iter().map(|row| row["worst"].clone()).collect::<Vec<_>>()
    };
    assert_eq!(figures("5"), figures("5"));
    assert_ne!(figures("5"), figures("6"));
}

#[test]
fn a_vector_file_is_judged_by_what_it_expects() {
    let right = "n,=F,cos_in\n1.5,0.04,1\n";
    let text = vectors("fresnel_dielectric.csv", right, &["-v"]).succeeded().stdout;
    assert!(text.contains("fresnel_dielectric") && text.contains("holds") && !text.contains("FAILS"), "{text}");
    assert!(!text.contains(" rp "), "only F is expected:\n{text}");
    let wrong = "n,=F,cos_in\n1.5,0.041,1\n";
    let failed = vectors("fresnel_dielectric.csv", wrong, &[]);
    assert_eq!(failed.code, Some(1), "{failed:?}");
    assert!(failed.stdout.contains("FAILS") && failed.stdout.contains("0x3fc00000"), "{failed:?}");
    let named = vectors("mine.csv", right, &["--function", "fresnel_dielectric", "--json"]).succeeded();
    assert_eq!(document(&named)["outputs"].as_array().map(Vec::len), Some(3));
    // Empty cells expect nothing.
    vectors("refract.csv", "vx,vy,vz,Nx,Ny,Nz,n,=Tx,=tir\n0.9,0,-0.43588989,0,0,1,0.5,,1\n", &[]).succeeded();
}

#[test]
fn documented_values_out_of_domain_may_be_expected() {
    // Bounds have no number there; exactly the documented value passes.
    let files = [
        ("refract", "vx,vy,vz,Nx,Ny,Nz,n,=Tx\n0.9,0,-0.43588989,0,0,1,0.5,0\n"),
        ("ggx", "Nx,Ny,Nz,Lx,Ly,Lz,Vx,Vy,Vz,alpha,F0,=fr\n0,0,1,0,0.6,-0.8,0,0.6,0.8,0.5,0.04,0\n"),
        ("quadric_normal", "px,py,pz,kx,ky,kz,=Nx\n0,0,0,1,0,0,0\n"),
    ];
    for (name, content) in files {
        vectors(&format!("{name}.csv"), content, &[]).succeeded();
        let wrong = content.strip_suffix("0\n").expect("a zero").to_owned() + "0.5\n";
        assert_eq!(vectors(&format!("{name}.csv"), &wrong, &[]).code, Some(1), "{name}");
    }
}

#[test]
fn bad_vector_files_get_a_sentence() {
    let bad: &[(&str, &str, &str)] = &[
        ("fresnel_dielectric.csv", "cos_in,=F\n1,0.04\n", "the input \"n\" of fresnel_dielectric has no column"),
        (
            "fresnel_dielectric.csv",
            "cos_in,n,m,=F\n1,1,1,1\n",
            "fresnel_dielectric has no input \"m\"; its inputs are cos_in n",
        ),
        (
            "fresnel_dielectric.csv",
            "cos_in,n,=G\n1,1,1\n",
            "fresnel_dielectric has no output \"G\"; its outputs are F rs",
        ),
        ("fresnel_dielectric.csv", "cos_in,n,n,=F\n1,1,1,1\n", "the column \"n\" occurs twice"),
        ("fresnel_dielectric.csv", "cos_in,n\n1,1\n", "the file has no expected output"),
        ("fresnel_dielectric.csv", "cos_in,n,=F\n1,nan,1\n", "line 2: n is \"nan\", but inputs must be finite"),
        (
            "fresnel_dielectric.csv",
            "cos_in,n,=F\n1,1.5,0.04\n1,inf,1\n",
            "line 3: n is \"inf\", but inputs must be finite",
        ),
        ("fresnel_dielectric.csv", "cos_in,n,=F\n1,x,1\n", "line 2: n is \"x\", which is not a number"),
        ("fresnel_dielectric.csv", "cos_in,n,=F\n1,1.5\n", "line: 2"),
        ("fresnel_dielectric.csv", "cos_in,n,=F\n", "the file has no rows"),
        ("fresnel_dielectric.csv", "cos_in,n,=F\n1,1.5,\n", "no cell of the expected outputs contains a number"),
        ("fresnel_dielectric.csv", "", "the input \"cos_in\" of fresnel_dielectric has no column"),
        ("nothing.csv", "x,=y\n1,1\n", "no function is called \"nothing\"; the functions are anisotropic_distribution"),
    ];
    for (name, content, said) in bad {
        vectors(name, content, &[]).failed(1, said);
    }
    run(&["verify", "--vectors", "absent.csv"]).failed(1, "reading absent.csv");
    run(&["verify", "--function", "fresnel"]).failed(2, "no function is called \"fresnel\"");
    run(&["verify", "--cases", "0"]).failed(2, "--cases");
    run(&["verify", "--tier", "exact"]).failed(2, "compensated");
    run(&["verify", "--vectors", "a.csv", "--cases", "5"]).failed(2, "cannot be used with");
}

#[test]
fn whole_numbers_keep_all_their_digits() {
    // By a program that has integers. A reader that rounds the seed to f32, to 1944965632, is 11.7 ulp off in T.
    let row = "n,s0,ds,seed,=tau,=T\n15679,8,4.05251165e-4,1944965690,76.24975757999299,7.6762840453426705e-34\n";
    vectors("beer_lambert_sum.csv", row, &[]).succeeded();
    // With an exponent the number has as many digits as a float.
    let rounded = row.replace("1944965690", "1.944965690e9");
    assert_eq!(vectors("beer_lambert_sum.csv", &rounded, &[]).code, Some(1));
}

#[test]
fn plots_are_written_per_function() {
    let folder = tempfile::tempdir().expect("a folder");
    let arguments =
        ["verify", "--device", "cpu", "--function", "fresnel_dielectric", "--cases", "5000", "-o", "plots", "-q"];
    etalon(folder.path(), &arguments, &[]).succeeded();
    let svg = std::fs::read_to_string(Path::new(folder.path()).join("plots/fresnel_dielectric.svg")).expect("a plot");
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    for word in ["fast", "stable", "compensated", "relative error of F"] {
        assert!(svg.contains(word), "{word}");
    }
    let blocked = folder.path().join("file");
    std::fs::write(&blocked, "").expect("a file");
    etalon(folder.path(), &["verify", "--function", "ggx_f", "-o", "file/plots"], &[]).failed(1, "file/plots");
}
