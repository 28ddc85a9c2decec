//! The documentation against the program: generated tables, commands that are printed, links and anchors, field terms.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use etalon_cli::documents;
use etalon_testing::document::replaced;
use etalon_testing::gpu::Gpu;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("the repository")
}

/// Every page of the repository: README, CONTRIBUTING, CHANGELOG, docs/ and shaders/README.
fn pages() -> Vec<(String, String)> {
    let root = root();
    let mut all = Vec::new();
    let mut folders = vec![root.join("docs"), root.join("docs/decisions")];
    folders.extend([root.clone(), root.join("shaders")]);
    for folder in folders {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.extension().is_some_and(|extension| extension == "md") {
                let name = path.strip_prefix(&root).expect("inside").display().to_string();
                all.push((name, std::fs::read_to_string(&path).expect("a page")));
            }
        }
    }
    all.sort();
    assert!(all.len() > 30, "the pages are somewhere else");
    all
}

#[test]
fn generated_tables_are_those_of_the_program() {
    let mut blocks: BTreeMap<&str, String> = documents::blocks().into_iter().collect();
    let device = &Gpu::open().device;
    let passes = |of_paths| documents::passes(device, of_paths).expect("the passes of the study scenes");
    blocks.extend([("passes", passes(false)), ("passes of path tracing", passes(true))]);
    let mut seen = BTreeSet::new();
    let mut old = Vec::new();
    for (page, text) in pages() {
        let mut fresh = text.clone();
        for (name, block) in &blocks {
            let Some(with) = replaced(&fresh, name, block) else { continue };
            fresh = with;
            seen.insert(*name);
        }
        if fresh != text {
            if std::env::var_os("ETALON_BLESS").is_some() {
                std::fs::write(root().join(&page), fresh).expect("a page is written");
            } else {
                let line = text.lines().zip(fresh.lines()).find(|(a, b)| a != b);
                old.push(format!("{page}: {line:?}"));
            }
        }
    }
    assert!(old.is_empty(), "old: run ETALON_BLESS=1 ./x test --test documents: {old:#?}");
    assert_eq!(seen.into_iter().collect::<Vec<_>>(), blocks.keys().copied().collect::<Vec<_>>(), "a block has no page");
}

/// An anchor as GitHub makes it of a heading.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    kept.chars()
        .filter_map(|c| match c {
            ' ' => Some('-'),
            c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c),
            _ => None,
        })
        .collect()
}

#[test]
fn links_and_anchors_lead_somewhere() {
    let pages = pages();
    let anchors: BTreeMap<&str, BTreeSet<String>> = pages
        .iter()
        .map(|(name, text)| {
            let headings = text.lines().filter(|line| line.starts_with('#'));
            let plain = |line: &str| anchor(&line.trim_start_matches('#').replace('`', ""));
            (name.as_str(), headings.map(plain).collect())
        })
        .collect();
    let mut broken = Vec::new();
    for (name, text) in &pages {
        let folder = root().join(name).parent().expect("a folder").to_path_buf();
        for (at, _) in text.match_indices("](") {
            let target: String = text[at + 2..].chars().take_while(|c| *c != ')' && *c != ' ').collect();
            if target.starts_with("http") || target.is_empty() {
                continue;
            }
            let (file, hash) = target.split_once('#').map_or((target.as_str(), None), |(f, h)| (f, Some(h)));
            let path = if file.is_empty() { root().join(name) } else { folder.join(file) };
            if !path.exists() {
                broken.push(format!("{name}: {target}"));
            } else if let Some(hash) = hash {
                let path = path.canonicalize().expect("a path");
                let page = path.strip_prefix(root()).expect("inside").display().to_string();
                if anchors.get(page.as_str()).is_some_and(|known| !known.contains(hash)) {
                    broken.push(format!("{name}: {target}"));
                }
            }
        }
    }
    assert!(broken.is_empty(), "links to nothing: {broken:#?}");
}

#[test]
fn pages_name_only_sources_that_exist() {
    let mut broken = Vec::new();
    for (name, text) in pages().iter().filter(|(name, _)| name != "CHANGELOG.md") {
        for word in text.split(|c: char| c.is_whitespace() || "`()[],;|<>\"".contains(c)) {
            let word = word.trim_end_matches(['.', ':']);
            let roots = ["src/", "shaders/", "crates/", "tests/", "docs/", "examples/", "benches/"];
            let is_file = [".rs", ".glsl", ".comp", ".frag", ".vert", ".md"].iter().any(|end| word.ends_with(end));
            let placeholder = word.contains(['*', '{', '$']) || word.contains("NAME");
            if is_file && !placeholder && roots.iter().any(|root| word.starts_with(root)) && !root().join(word).exists()
            {
                broken.push(format!("{name}: {word}"));
            }
        }
    }
    assert!(broken.is_empty(), "files that are not there: {broken:#?}");
}

/// Calls of the program in pages: lines after four spaces or between fences, and code within sentences and tables.
fn commands() -> Vec<(String, Vec<String>)> {
    let mut all = Vec::new();
    for (name, text) in pages() {
        let mut fenced = false;
        for line in text.lines() {
            if line.trim_start().starts_with("```") {
                fenced = !fenced;
                continue;
            }
            let of_line = if fenced { Some(line.trim()) } else { line.strip_prefix("    ") };
            // A span of code is every second part between backticks.
            let spans = line.split('`').skip(1).step_by(2).map(|code| code.replace("\\|", "|"));
            // In a sentence a name alone, or a word that stands for something, mentions a command and calls none.
            let calls = |code: &String| {
                let words: Vec<&str> = code.split_whitespace().collect();
                let form =
                    words.iter().any(|word| word.len() > 2 && word.chars().all(|c| c.is_uppercase() || c == '.'));
                words.len() > 3 && !form
            };
            let spans = spans.filter(calls);
            let codes = of_line.map(|code| vec![code.to_owned()]).unwrap_or_else(|| spans.collect());
            for code in codes {
                let code = code.split("  #").next().unwrap_or_default().trim().trim_start_matches("$ ");
                let words: Vec<String> =
                    code.split_whitespace().map(|word| word.trim_matches('"').to_owned()).collect();
                let call = match words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
                    ["etalon", ..] => words[1..].to_vec(),
                    ["./x", "run", ..] => words[2..].to_vec(),
                    ["./x", "render", ..] => [vec!["render".to_owned()], words[2..].to_vec()].concat(),
                    _ => continue,
                };
                // A line that goes on, or that shows several forms, is no call.
                if code.ends_with('\\') || code.contains(['|', '&', '>', '$', '…', '[', '{', ';']) {
                    continue;
                }
                all.push((name.clone(), call));
            }
        }
    }
    assert!(all.len() > 60, "pages print commands: {}", all.len());
    all
}

#[test]
fn every_printed_command_is_one_of_the_program() {
    let mut wrong = Vec::new();
    for (page, call) in commands() {
        // Words that stand for something, such as SCENE or a column's explanation, end what can be held against the
        // program.
        let prose = call.iter().any(|word| word.len() > 2 && word.chars().all(|c| c.is_uppercase() || c == '.'));
        let words = std::iter::once("etalon".to_owned()).chain(call.iter().cloned());
        if let Err(error) = etalon_cli::arguments::command().try_get_matches_from(words) {
            use clap::error::ErrorKind;
            let explained = prose && matches!(error.kind(), ErrorKind::UnknownArgument | ErrorKind::ValueValidation);
            if !explained && !matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
                wrong.push(format!(
                    "{page}: etalon {}: {}",
                    call.join(" "),
                    error.to_string().lines().next().unwrap_or("")
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "commands that the program refuses: {wrong:#?}");
}

/// Commands that this test runs: those of quick programs on built-in scenes, drawn small, into a folder of the test.
#[test]
fn printed_commands_run_at_a_small_size() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut seen = BTreeSet::new();
    let mut failed = Vec::new();
    for (page, call) in commands() {
        let command = call.first().map(String::as_str);
        let quick = matches!(command, Some("render" | "plan" | "eval" | "plot" | "completions" | "manual" | "devices"));
        let own = call.iter().all(|word| !word.contains(".gl") && !word.contains(".obj") && !word.contains(".hdr"));
        let prose = call.iter().any(|word| word.len() > 2 && word.chars().all(|c| c.is_uppercase() || c == '.'));
        let slow = call.iter().any(|word| {
            ["explain-cost", "--forecast", "--within", "--max-error", "--shard", "--frames", "spectral"]
                .iter()
                .any(|option| word.contains(option))
        });
        if !quick || !own || prose || slow {
            continue;
        }
        let mut words = Vec::new();
        let mut skip = false;
        for word in &call {
            if std::mem::take(&mut skip) {
                continue;
            }
            match word.as_str() {
                "-o" | "--output" | "--size" => skip = true,
                _ => words.push(word.clone()),
            }
        }
        if matches!(command, Some("render" | "plan")) {
            words.extend(["--size", "32x18"].map(str::to_owned));
        }
        if command == Some("render") {
            words.extend(["--set", "samples=1", "-o", "picture.png"].map(str::to_owned));
        }
        if !seen.insert(words.clone()) {
            continue;
        }
        let output = Command::new(env!("CARGO_BIN_EXE_etalon"))
            .args(&words)
            .current_dir(folder.path())
            .output()
            .expect("the program runs");
        if !output.status.success() {
            failed.push(format!("{page}: etalon {}: {}", words.join(" "), String::from_utf8_lossy(&output.stderr)));
        }
    }
    assert!(seen.len() > 12, "pages print commands that can be run: {seen:#?}");
    assert!(failed.is_empty(), "commands that fail: {failed:#?}");
}

/// Rows of a table of a page: cells of each line that begins with `|`, without the two of its head.
fn rows(page: &str) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(root().join(page)).expect("a page");
    let lines =
        text.lines().filter(|line| line.starts_with('|') && !line.starts_with("|---") && !line.starts_with("| term"));
    lines.map(|line| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect()).collect()
}

/// The glossary's rows are `term | meaning | where in the code | where to read | Hungarian`; a place is a file with a
/// word of it.
#[test]
fn the_glossary_leads_to_code_that_uses_the_term() {
    let rows = rows("docs/glossary.md");
    assert!(rows.len() >= 80, "{} terms", rows.len());
    let mut wrong = Vec::new();
    let mut terms = BTreeSet::new();
    for row in &rows {
        let [term, meaning, place, source, hungarian] = &row[..] else {
            wrong.push(format!("{row:?} has not five cells"));
            continue;
        };
        let plain = |text: &str| text.to_lowercase().replace(['-', '‐', '\n'], " ").replace(['*', '`'], "");
        let term = plain(term);
        if !terms.insert(term.clone()) {
            wrong.push(format!("{term} is there twice"));
        }
        if meaning.len() < 15 || source.is_empty() || hungarian.is_empty() {
            wrong.push(format!("{term} has an empty cell"));
        }
        // A symbol belongs to the file named last before it.
        let mut files: Vec<(&str, String)> = Vec::new();
        for word in place.split('`').skip(1).step_by(2) {
            if word.contains('/') {
                match std::fs::read_to_string(root().join(word)) {
                    Ok(text) => files.push((word, text)),
                    Err(error) => wrong.push(format!("{term}: {word}: {error}")),
                }
            } else if !files.last().is_some_and(|(_, text)| text.contains(word)) {
                wrong.push(format!("{term}: {word} is not in {:?}", files.last().map(|(path, _)| path)));
            }
        }
        // The file named first implements the term. Comments break lines anywhere.
        let flat = |text: &str| {
            let lines = text.lines().map(|line| line.trim_start().trim_start_matches(['/', '!', ' ']));
            plain(&lines.collect::<Vec<_>>().join(" "))
        };
        let short = term.split(" (").next().unwrap_or(&term).to_owned();
        if !files.first().is_some_and(|(_, text)| flat(text).contains(&short)) {
            wrong.push(format!("{term} is not said in {:?}", files.first().map(|(path, _)| path)));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The G-buffer's formats in docs/decisions/gbuffer.md are those that the pass asks for.
#[test]
fn the_page_of_the_gbuffer_has_its_formats() {
    let source = std::fs::read_to_string(root().join("src/pass/gbuffer.rs")).expect("a source");
    let page = std::fs::read_to_string(root().join("docs/decisions/gbuffer.md")).expect("a page");
    let mut found = 0;
    for line in source.lines().filter(|line| line.contains("target(\"G-buffer ")) {
        let name = line.split("target(\"G-buffer ").nth(1).and_then(|rest| rest.split('"').next()).expect("a name");
        let Some(format) = line.split("vk::Format::").nth(1) else { continue };
        let format: String = format.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        let key = name.split(' ').next().unwrap_or(name);
        let row = page.lines().find(|row| row.starts_with(&format!("| {key} ")));
        let row = row.unwrap_or_else(|| panic!("the page has no row for {name}"));
        assert!(row.contains(&format), "{name} is {format}: {row}");
        found += 1;
    }
    // Targets of which passes read a copy.
    for (key, name) in [("position", "POSITION"), ("lobes", "LOBES")] {
        let line = source.lines().find(|line| line.starts_with(&format!("const {name}: "))).expect("a format");
        let format = line.split("vk::Format::").nth(1).expect("a format").trim_end_matches(';');
        let row = page.lines().find(|row| row.starts_with(&format!("| {key} "))).expect("a row");
        assert!(row.contains(format), "{name} is {format}: {row}");
    }
    assert!(found >= 5, "{found} targets");
}

/// What a device has to have, by the names that refusals use, is in docs/device.md.
#[test]
fn the_page_of_devices_names_each_requirement() {
    let page = std::fs::read_to_string(root().join("docs/device.md")).expect("a page");
    let device = std::fs::read_to_string(root().join("crates/vulkan/src/device.rs")).expect("a source");
    let features: Vec<&str> =
        device.split("\"feature ").skip(1).filter_map(|rest| rest.split(['"', ' ']).next()).collect();
    assert!(features.len() >= 5, "{features:?}");
    for feature in features {
        assert!(page.contains(feature), "docs/device.md does not name {feature}");
    }
    let limits = std::fs::read_to_string(root().join("crates/vulkan/src/limits.rs")).expect("a source");
    for (name, says) in [
        ("COLOR_TARGETS", "colour targets"),
        ("STORAGE_IMAGES", "storage images"),
        ("SAMPLED_IMAGES", "sampled images"),
        ("STORAGE_BUFFERS_AND_TABLES", "storage buffers"),
    ] {
        let value =
            limits.split(&format!("{name}: u32 = ")).nth(1).and_then(|rest| rest.split(';').next()).expect(name);
        assert!(page.contains(&format!("{value} {says}")), "docs/device.md does not say \"{value} {says}\"");
    }
}

#[test]
fn the_manual_and_completions_know_every_command() {
    let run = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_etalon")).args(arguments).output().expect("the program runs");
        assert!(output.status.success(), "{arguments:?}");
        String::from_utf8(output.stdout).expect("text")
    };
    let manual = run(&["manual"]);
    let bash = run(&["completions", "bash"]);
    for sub in etalon_cli::arguments::command().get_subcommands() {
        assert!(manual.contains(&sub.get_name().to_uppercase()), "the manual lacks {}", sub.get_name());
        assert!(bash.contains(sub.get_name()), "completions lack {}", sub.get_name());
    }
    assert!(manual.contains("EXIT STATUS") && manual.contains("SIGTERM"));
}
