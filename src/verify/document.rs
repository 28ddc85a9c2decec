//! `docs/equations.md` out of the sources and the catalogue.

use std::fmt::Write as _;

use super::catalogue;

/// The page: every equation with its function, columns, bounds and built-ins.
#[must_use]
pub fn equations() -> String {
    let mut page = String::from(
        "# Equations\n\n\
         Written by a test (`tests/catalogue.rs`) from the tags in `shaders/lib/` and the bounds in `src/optics/`.\n\
         Ids are those of [lecture.md](lecture.md); N and a number is a row of [numerics.md](numerics.md).\n\
         `etalon verify` judges the bounds on a device; the tier `fast` has none. Built-ins are those whose precision\n\
         is the device's own (Vulkan, \"Precision of Individual Operations\"), by tier where they differ. Functions that\n\
         no pass calls yet wait for the passes that trace rays.\n",
    );
    let mut subject = "";
    for entry in catalogue() {
        let probe = entry.probe;
        if probe.subject != subject {
            subject = probe.subject;
            let _ = write!(
                page,
                "\n## {subject}\n\n[shaders/lib/{subject}.glsl](../shaders/lib/{subject}.glsl), twins in \
                 [src/optics/{subject}.rs](../src/optics/{subject}.rs)\n"
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
        if !probe.passes.is_empty() {
            let _ = writeln!(page, "- called by: `{}`", probe.passes.join("`, `"));
        }
        if probe.loop_heads > 0 {
            let _ = writeln!(page, "- loop heads in one call: at most {}", probe.loop_heads);
        }
    }
    page
}

/// Input names, a long series by its ends.
#[must_use]
pub fn inputs(names: &[&str]) -> String {
    match names {
        [first, .., last] if names.len() > 16 => format!("{first} … {last}"),
        _ => names.join(" "),
    }
}

/// Built-ins by tier, in one list where they are the same.
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
