//! Knobs as command-line options.

use std::collections::BTreeMap;

use anyhow::{Context as _, Result};

use etalon::plan::{Knobs, Model};

/// `knobs` with one knob set to another rung.
pub fn set(knobs: &Knobs, knob: &str, rung: &str) -> Result<Knobs> {
    knobs.with(knob, rung).with_context(|| format!("setting {knob}={rung}"))
}

/// Rungs by knob.
pub fn named(knobs: &Knobs) -> BTreeMap<String, String> {
    knobs.list().into_iter().map(|(knob, rung)| (knob.to_owned(), rung.to_owned())).collect()
}

/// The preset that needs the fewest `--set` options for these knobs, and those options.
#[must_use]
pub fn nearest_preset(knobs: &Knobs) -> (&'static str, Vec<String>) {
    let rest = |model: Model| -> Vec<String> {
        let preset = Knobs::of(model).list();
        // --model global selects spectral rendering for dispersive glass unless `colour` is given.
        let said = |knob: &str| model == Model::Global && knob == "colour";
        let others = knobs.list().into_iter().zip(preset).filter(|(a, b)| a != b || said(a.0));
        others.map(|((knob, rung), _)| format!("--set {knob}={rung}")).collect()
    };
    let all = [(Model::Local, "local"), (Model::Recursive, "recursive"), (Model::Global, "global")];
    let least = all.map(|(model, name)| (rest(model), name)).into_iter().min_by_key(|(rest, _)| rest.len());
    let (rest, name) = least.unwrap_or_default();
    (name, rest)
}

/// `--model` and `--set` options for these knobs.
#[must_use]
pub fn arguments(knobs: &Knobs) -> String {
    let (name, rest) = nearest_preset(knobs);
    std::iter::once(format!("--model {name}")).chain(rest).collect::<Vec<_>>().join(" ")
}
