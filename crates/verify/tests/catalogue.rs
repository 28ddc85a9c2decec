//! Nothing is tagged without a twin, nothing has a twin without a tag, no statement of the lecture is forgotten, and
//! docs/equations.md says what the sources say.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use etalon::optics;
use etalon::shader::PROBES;
use etalon_verify::statements::{By, STATEMENTS};
use etalon_verify::{catalogue, document};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn read(path: impl AsRef<Path>) -> String {
    std::fs::read_to_string(root().join(&path)).unwrap_or_else(|error| panic!("{}: {error}", path.as_ref().display()))
}

/// The contract of `verify --vectors` (docs/functions.md): names with their columns.
const CONTRACT: &[(&str, &str, &str)] = &[
    ("fresnel_schlick", "cos_in n kappa", "F0 F"),
    ("fresnel_dielectric", "cos_in n", "F rs rp cos_t tir"),
    ("fresnel_conductor", "cos_in n kappa", "F Rs Rp"),
    ("reflect", "vx vy vz Nx Ny Nz", "Rx Ry Rz"),
    ("refract", "vx vy vz Nx Ny Nz n", "Tx Ty Tz tir disc"),
    ("critical_angle", "n_in n_out", "exists theta_rad theta_deg cos_theta"),
    ("lambert", "Nx Ny Nz Lx Ly Lz Lin kd", "cos_plus Lref"),
    ("blinn_phong", "Nx Ny Nz Lx Ly Lz Vx Vy Vz Lin kd ks shine", "cos_in cos_delta sin2_delta spec Lref"),
    ("reciprocal_phong", "Nx Ny Nz Lx Ly Lz Vx Vy Vz Lin kd ks shine", "LV2 fr_spec Lref"),
    ("ggx_d", "Nx Ny Nz Hx Hy Hz alpha", "cos_h sin2_h D"),
    ("ggx_g", "NoL NoV alpha", "G1_L G1_V G2 Vis"),
    ("ggx_f", "F0 VoH", "F"),
    ("ggx", "Nx Ny Nz Lx Ly Lz Vx Vy Vz alpha F0", "D G2 F fr fr_cos"),
    ("beer_lambert", "L0 sigma d", "tau T one_minus_T L"),
    ("beer_lambert_sum", "n s0 ds seed", "tau T one_minus_T"),
    ("light_directional", "Nx Ny Nz Lx Ly Lz E", "cos_plus irradiance"),
    ("light_point", "Px Py Pz Qx Qy Qz Nx Ny Nz I", "r2 cos_plus E_perp irradiance"),
    ("srgb", "x", "encode decode"),
    ("cmf_integral", "", "X Y Z sR sG sB r10 g10 b10"),
    ("cmf_gaussian", "A mu_nm width_nm", "X Y Z r10 g10 b10"),
];

#[test]
fn the_contract_of_vector_files_is_kept() {
    for (name, inputs, outputs) in CONTRACT {
        let Some(probe) = PROBES.iter().find(|probe| probe.name == *name) else { panic!("{name} has no function") };
        assert_eq!(probe.outputs.join(" "), *outputs, "{name}");
        if *name == "cmf_integral" {
            let wavelengths: Vec<_> = (0..81).map(|k| format!("s{}", 380 + 5 * k)).collect();
            assert_eq!(probe.inputs, wavelengths, "{name}");
        } else {
            assert_eq!(probe.inputs.join(" "), *inputs, "{name}");
        }
    }
}

#[test]
fn every_tag_has_a_twin_and_every_twin_a_tag() {
    let tagged: BTreeSet<_> = PROBES.iter().map(|probe| probe.name).collect();
    let twins: Vec<_> = optics::equations().map(|equation| equation.name).collect();
    let unique: BTreeSet<_> = twins.iter().copied().collect();
    assert_eq!(unique.len(), twins.len(), "an equation is in the catalogue twice");
    let without_twin: Vec<_> = tagged.difference(&unique).collect();
    let without_tag: Vec<_> = unique.difference(&tagged).collect();
    assert!(without_twin.is_empty(), "tagged in shaders/lib/, no entry in crates/optics/src/: {without_twin:?}");
    assert!(without_tag.is_empty(), "in crates/optics/src/, not tagged in shaders/lib/: {without_tag:?}");
    assert!(tagged.len() > 50, "only {} equations", tagged.len());
}

#[test]
fn columns_of_bounds_are_those_of_the_shader() {
    for entry in catalogue() {
        let named: Vec<_> = entry.equation.outputs.iter().map(|output| output.name).collect();
        assert_eq!(named, entry.probe.outputs, "{}", entry.probe.name);
        assert!(entry.equation.axis.column < named.len(), "{}", entry.probe.name);
        assert!(!entry.equation.regions.is_empty(), "{}", entry.probe.name);
        for region in entry.equation.regions {
            let row = (region.draw)(&mut optics::SplitMix64::new(1));
            assert_eq!(row.len(), entry.probe.inputs.len(), "{}, {}", entry.probe.name, region.name);
            let twin = (entry.equation.twin)(&row.iter().map(|&x| f64::from(x)).collect::<Vec<_>>());
            assert_eq!(twin.len(), named.len(), "twin of {}", entry.probe.name);
        }
    }
}

/// `/// @eq IDS: ...` lines before `pub fn NAME` of a twin's file.
fn tags_of_twins(subject: &str) -> BTreeMap<String, BTreeSet<String>> {
    let mut found = BTreeMap::new();
    let mut ids = BTreeSet::new();
    for line in read(format!("crates/optics/src/{subject}.rs")).lines() {
        if let Some(rest) = line.trim_start().strip_prefix("/// @eq ") {
            let before = rest.split(':').next().unwrap_or_default();
            ids = before.split_whitespace().map(str::to_owned).collect();
        } else if let Some(rest) = line.strip_prefix("pub fn ") {
            let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            if !ids.is_empty() {
                found.insert(name, std::mem::take(&mut ids));
            }
        }
    }
    found
}

#[test]
fn twins_carry_ids_of_their_functions() {
    let mut wrong = Vec::new();
    for probe in PROBES {
        match tags_of_twins(probe.subject).get(probe.name) {
            None => wrong
                .push(format!("{}: no `pub fn` with `/// @eq` in crates/optics/src/{}.rs", probe.name, probe.subject)),
            Some(ids) => {
                for id in ids {
                    if !probe.ids.contains(&id.as_str()) {
                        wrong.push(format!("{}: the twin says {id}, the shader {:?}", probe.name, probe.ids));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// First cells of table rows `| ID | …` of a page.
fn ids_of(page: &str, prefix: &str) -> BTreeSet<String> {
    let cells = page.lines().filter_map(|line| line.strip_prefix("| ")?.split(" |").next());
    let is_id = |cell: &&str| {
        let rest = cell.trim_start_matches(|c: char| c.is_ascii_uppercase());
        !rest.is_empty() && rest.chars().all(|c| c.is_ascii_digit()) && rest.len() < 3
    };
    cells.filter(is_id).map(|id| format!("{prefix}{id}")).collect()
}

#[test]
fn no_statement_of_the_lecture_and_no_hard_case_is_forgotten() {
    let lecture = ids_of(&read("docs/lecture.md"), "");
    let numerics = read("docs/numerics.md");
    let (_, hard) = numerics.split_once("## 3. Hard cases").expect("the section of hard cases");
    let (hard, _) = hard.split_once("\n## ").expect("the section after it");
    let rows: BTreeSet<_> = ids_of(hard, "N").into_iter().filter(|id| !id.starts_with("NS")).collect();
    assert!(lecture.len() >= 30, "{lecture:?}");
    assert_eq!(rows.len(), 50, "{rows:?}");
    let mut all: BTreeSet<_> = lecture.union(&rows).cloned().collect();
    all.extend((1..=6).map(|question| format!("Q{question}")));
    let told: BTreeSet<String> = STATEMENTS.iter().map(|statement| statement.id.to_owned()).collect();
    assert_eq!(told.len(), STATEMENTS.len(), "an id is there twice");
    assert_eq!(told, all, "crates/verify/src/statements.rs and the pages differ");
    let tagged: BTreeSet<String> = PROBES.iter().flat_map(|probe| probe.ids).map(|id| (*id).to_owned()).collect();
    let unknown: Vec<_> = tagged.difference(&all).collect();
    assert!(unknown.is_empty(), "tagged with ids that the pages do not have: {unknown:?}");
    for statement in STATEMENTS {
        let is_tagged = tagged.contains(statement.id);
        match statement.by {
            By::Tags => assert!(is_tagged, "no function is tagged with {}", statement.id),
            By::Nothing(_) => assert!(!is_tagged, "{} is said to have no function, and one is tagged", statement.id),
            By::Equations(names) => {
                let known = |name: &&str| PROBES.iter().any(|probe| probe.name == *name);
                assert!(!is_tagged && names.iter().all(known), "{}: {names:?}", statement.id);
            }
        }
    }
}

/// All sources under a folder, as one text.
fn texts(folder: &str) -> String {
    let mut all = String::new();
    let mut open = vec![root().join(folder)];
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(std::fs::read_dir(path).expect("a folder").map(|entry| entry.expect("an entry").path()));
        } else if path.extension().is_some_and(|e| e == "rs") {
            all += &std::fs::read_to_string(path).expect("a source");
        }
    }
    all
}

#[test]
fn scenes_tests_and_pages_of_the_table_are_there() {
    let tests = ["tests", "src", "crates"].map(texts).concat();
    let there = |test: &str| tests.contains(&format!("fn {test}()"));
    for statement in STATEMENTS {
        assert!(etalon::study::NAMES.contains(&statement.scene), "{}: no scene {}", statement.id, statement.scene);
        assert!(there(statement.test), "{}: no test {}", statement.id, statement.test);
        let page = read(format!("docs/{}", statement.page));
        assert!(page.len() > 200, "{}: {}", statement.id, statement.page);
    }
    for probe in PROBES {
        if let Some((draws, test)) = probe.lab {
            assert!(there(test), "{}: `@lab {draws}` names a test {test} that is not there", probe.name);
        }
    }
    let empty: Vec<_> = document::verified().lines().filter(|line| line.contains("|  |")).map(str::to_owned).collect();
    assert!(empty.is_empty(), "{empty:?}");
}

#[test]
fn host_code_of_an_equation_uses_its_twin() {
    for probe in PROBES {
        let Some((file, _)) = probe.host else { continue };
        let text = read(file);
        let paths = ["optics", "crate"].map(|root| format!("{root}::{}", probe.subject));
        let uses = paths.iter().any(|path| text.contains(path)) && text.contains(probe.name);
        assert!(uses, "{file} has no optics::{}::{}", probe.subject, probe.name);
    }
}

/// One of three ways, which the build holds as well.
#[test]
fn every_equation_says_how_it_reaches_pictures() {
    for probe in PROBES {
        let ways = [!probe.passes.is_empty(), probe.host.is_some(), probe.lab.is_some()];
        assert_eq!(ways.iter().filter(|way| **way).count(), 1, "{}: {ways:?}", probe.name);
        assert_eq!(probe.lab.is_some(), !probe.drawn_by.is_empty(), "{}: {:?}", probe.name, probe.lab);
    }
}

/// A page of docs/ is what the sources make of it.
fn says(name: &str, page: &str) {
    let path = root().join("docs").join(name);
    if std::env::var_os("ETALON_BLESS").is_some() {
        std::fs::write(&path, page).expect("a page");
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(written == page, "docs/{name} is old: run ETALON_BLESS=1 ./x test --test catalogue");
}

#[test]
fn equations_md_says_what_the_sources_say() {
    says("equations.md", &document::equations());
}

#[test]
fn verified_md_says_what_the_sources_say() {
    says("verified.md", &document::verified());
}
