//! Generates `docs/equations.md` and `docs/verified.md` from the sources and the catalogue.

use std::fmt::Write as _;

use super::catalogue;
use super::statements::{By, STATEMENTS};
use etalon::shader::{PROBES, Probe};

/// The page `docs/equations.md`: every equation with its function, inputs, bounds and built-ins.
#[must_use]
pub fn equations() -> String {
    let mut page = String::from(
        "# Equations\n\n\
         Written by a test (`crates/verify/tests/catalogue.rs`) from the tags in `shaders/lib/` and the bounds in `crates/optics/src/`.\n\
         Ids are those of [lecture.md](lecture.md); N and a number is a row of [numerics.md](numerics.md).\n\
         `etalon verify` checks the bounds on a device; the tier `fast` has no bounds. On a device that flushes denormal\n\
         numbers it does not judge numbers below 2e-31, whose rounding errors are flushed. Built-ins are listed where their precision\n\
         depends on the device (Vulkan, \"Precision of Individual Operations\"), by tier if the tiers differ. The last line says how\n\
         pictures use the function: passes call it, or host code computes it. A laboratory form (of the lecture, or of\n\
         [functions.md](functions.md)) is not called by pictures; a test compares it with the function that pictures use.\n\
         [verified.md](verified.md) lists the functions by id, with study scenes and tests.\n",
    );
    let mut subject = "";
    for entry in catalogue() {
        let probe = entry.probe;
        if probe.subject != subject {
            subject = probe.subject;
            let _ = write!(
                page,
                "\n## {subject}\n\n[shaders/lib/{subject}.glsl](../shaders/lib/{subject}.glsl), twins in \
                 [crates/optics/src/{subject}.rs](../crates/optics/src/{subject}.rs)\n"
            );
        }
        let outputs: Vec<_> = entry.equation.outputs.iter().map(|o| format!("`{}`: {}", o.name, o.bound)).collect();
        let regions: Vec<_> = entry.equation.regions.iter().map(|region| region.name).collect();
        let _ = write!(
            page,
            "\n### {}\n\n{}: {}\n\n- inputs: `{}`\n- bounds: {}\n- tested in: {}\n- built-ins: {}\n",
            probe.name,
            probe.ids.join(" "),
            probe.formula,
            inputs(probe.inputs),
            outputs.join("; "),
            regions.join("; "),
            builtins(probe.builtins),
        );
        let _ = writeln!(page, "- {}", reached(probe));
        if probe.loop_heads > 0 {
            let _ = writeln!(page, "- loop iterations per call: at most {}", probe.loop_heads);
        }
    }
    page
}

/// How a function contributes to pictures, for `docs/equations.md`.
fn reached(probe: &Probe) -> String {
    let list = |names: &[&str]| format!("`{}`", names.join("`, `"));
    match (probe.host, probe.lab) {
        (Some((file, what)), _) => format!("computed by [{file}](../{file}): {what}"),
        (_, Some((draws, test))) => {
            format!("laboratory form; pictures use `{draws}`, in {}; test `{test}`", list(probe.drawn_by))
        }
        _ => format!("called by: {}", list(probe.passes)),
    }
}

/// The page `docs/verified.md`: for every statement of the lecture and every hard case its functions, how they reach
/// pictures, the study scene that shows it, the test that checks it, and the page that explains it.
#[must_use]
pub fn verified() -> String {
    let mut page = String::from(
        "# What is verified is what draws\n\n\
         Written by a test (`crates/verify/tests/catalogue.rs`) from the tags in `shaders/lib/` and `crates/verify/src/statements.rs`. Ids are those\n\
         of [lecture.md](lecture.md); N and a number is a row of [numerics.md](numerics.md). A function is called by passes of\n\
         `shaders/pass/`, or computed by host code of the renderer (by its twin, or in another way, and a test compares the two), or it\n\
         is a laboratory form: pictures do not call it, and a test compares it with the function that they use. The build fails if neither a pass nor an equation uses a function of\n\
         `shaders/lib/`. Names are those of `etalon eval`. In GLSL `reflect` and `refract` are called `reflect_ray` and `refract_ray`,\n\
         because GLSL has built-ins of these names. Rows F2 to F5 of lecture.md name the functions that call theirs.\n\n",
    );
    let count = |way: fn(&Probe) -> bool| PROBES.iter().filter(|probe| way(probe)).count();
    let _ = write!(
        page,
        "{} equations: {} called by passes, {} computed by the host, {} laboratory forms.\n\n\
         | id | function | reaches pictures by | study scene | test | page |\n|---|---|---|---|---|---|\n",
        PROBES.len(),
        count(|probe| !probe.passes.is_empty()),
        count(|probe| probe.host.is_some()),
        count(|probe| probe.lab.is_some()),
    );
    for statement in STATEMENTS {
        let tagged: Vec<_> = match statement.by {
            By::Nothing(_) => Vec::new(),
            By::Tags => PROBES.iter().filter(|probe| probe.ids.contains(&statement.id)).collect(),
            By::Equations(names) => PROBES.iter().filter(|probe| names.contains(&probe.name)).collect(),
        };
        let (functions, ways) = match statement.by {
            By::Nothing(why) => ("none".to_owned(), why.to_owned()),
            _ => {
                let names: Vec<_> = tagged.iter().map(|probe| format!("`{}`", probe.name)).collect();
                let ways: Vec<_> = tagged.iter().map(|probe| way(probe)).collect();
                (names.join("<br>"), ways.join("<br>"))
            }
        };
        let _ = writeln!(
            page,
            "| {} | {functions} | {ways} | `{}` | `{}` | [{}]({}) |",
            statement.id, statement.scene, statement.test, statement.page, statement.page
        );
    }
    page
}

/// How a function contributes to pictures, for a table cell of `docs/verified.md`.
fn way(probe: &Probe) -> String {
    match (probe.host, probe.lab) {
        (Some((file, _)), _) => format!("host: {file}"),
        (_, Some((draws, _))) => format!("laboratory form: pictures use `{draws}`"),
        _ => probe.passes.join(", "),
    }
}

/// Input names; of more than 16 names only the first and the last.
#[must_use]
pub fn inputs(names: &[&str]) -> String {
    match names {
        [first, .., last] if names.len() > 16 => format!("{first} … {last}"),
        _ => names.join(" "),
    }
}

/// Built-ins by tier; equal lists are merged.
fn builtins(tiers: [&[&str]; 3]) -> String {
    let names = |list: &[&str]| if list.is_empty() { "none".to_owned() } else { list.join(" ") };
    let [fast, stable, compensated] = tiers;
    if fast == stable && stable == compensated {
        return names(stable);
    }
    if stable == compensated {
        return format!("fast {}; stable and compensated {}", names(fast), names(stable));
    }
    format!("fast {}; stable {}; compensated {}", names(fast), names(stable), names(compensated))
}
