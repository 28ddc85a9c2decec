//! Greedy search for combinations of rungs, guided by the measured costs of single changes.

use std::collections::BTreeMap;

use anyhow::Result;

use super::agenda::{Agenda, States, Task, with_indirect};
use super::command::{named, set};
use super::judge::{Judge, Record};
use super::measure::{Base, Measuring};
use super::pace::Step;
use super::statistics::{Estimate, Interval, MANY, mean, standard_errors};
use super::table::{Family, INVISIBLE, Price, Tried};
use etalon::plan::{KNOBS, Knobs};

/// Largest number of pictures that the search draws.
pub const PICTURES: usize = 8;
/// Approximate number of statements of a search, for the Bonferroni correction: the error of each rung, and each step.
const STATEMENTS: usize = 100;
/// Least fraction of the squared error that a step must be predicted to remove.
const WORTH: f64 = 0.01;
/// Mean squared difference of display values below which a costly rung counts as useless: (a thousandth of their
/// range)².
const NOTHING: f64 = 1e-6;

/// Change of squared error and time when one knob of `local` is set to a rung.
struct Rung {
    knob: &'static str,
    to: &'static str,
    more: Estimate,
    ms: f64,
}

fn task(name: String, knobs: &Knobs) -> Task {
    Task { name, family: Family::Search, knobs: knobs.clone(), change: None }
}

/// The drawn preset with these knobs: that is what a combination may come back to.
fn preset<'r>(records: &'r [Record], knobs: &Knobs) -> Option<&'r Record> {
    records.iter().find(|record| record.family == Family::Preset && record.knobs == named(knobs))
}

/// Measured changes of each rung relative to `local`, and the time of `local` in milliseconds.
fn rungs(records: &[Record], judge: &Judge<'_>) -> Result<(Vec<Rung>, f64)> {
    let Some(local) = records.iter().find(|record| record.name == "local") else { return Ok((Vec::new(), 0.0)) };
    let base_ms = Interval::of(&local.ms).median;
    let shown = judge.display(local)?;
    let mut all = Vec::new();
    for record in records.iter().filter(|record| record.family == Family::Local) {
        let Some((change, pair)) = record.pair.as_ref().filter(|(_, pair)| !pair.same) else { continue };
        let Some(knob) = KNOBS.iter().find(|knob| knob.name == change.knob) else { continue };
        let Some(&to) = knob.rungs.iter().find(|rung| **rung == change.to) else { continue };
        let more = if pair.flip == 0.0 {
            Estimate::default()
        } else {
            judge.truth.shown.more_error(&judge.display(record)?, &shown)
        };
        let ratios: Vec<f64> = record.ms.iter().zip(&record.baseline_ms).map(|(ms, other)| ms / other - 1.0).collect();
        all.push(Rung { knob: knob.name, to, more, ms: mean(&ratios) * base_ms });
    }
    Ok((all, base_ms))
}

/// Greedy search from the fastest rungs towards less error. Each step applies the change to a more exact rung with the
/// best predicted error reduction per millisecond, and is kept only if the drawn picture has significantly less error.
///
/// # Errors
/// When files cannot be read or written.
pub fn search(
    measuring: &mut Measuring<'_>,
    judge: &Judge<'_>,
    (agenda, states): (&Agenda, &States),
    base: &mut Base,
    progress: &mut dyn FnMut(Step<'_>),
) -> Result<Vec<Tried>> {
    let (rungs, base_ms) = rungs(&measuring.records, judge)?;
    let sure = standard_errors(STATEMENTS, MANY);
    let local = &agenda.local;
    let before = measuring.pace.place();
    let mut tried = Vec::new();
    let mut knobs = local.clone();
    for rung in &rungs {
        let now = rungs.iter().find(|known| known.knob == rung.knob && local_rung(&knobs, known.knob) == known.to);
        let quickest = rung.ms < now.map_or(0.0, |now| now.ms);
        if let (true, Some(changed)) = (quickest, knobs.with(rung.knob, rung.to)) {
            knobs = changed;
        }
    }
    let mut draw = |measuring: &mut Measuring<'_>, name: String, knobs: &Knobs| match preset(&measuring.records, knobs)
    {
        Some(known) => Ok(Some(known.clone())),
        None => measuring.picture(&task(name, knobs), base, progress),
    };
    let mut current = draw(measuring, "search: quickest".to_owned(), &knobs)?;
    let mut refused: Vec<(&str, &str)> = Vec::new();
    for step in 1..PICTURES - 1 {
        let Some(known) = &current else { break };
        let nothing = Estimate::default();
        let at = |knob: &str, to: &str| {
            let found = rungs.iter().find(|rung| rung.knob == knob && rung.to == to);
            found.map_or((nothing, 0.0), |rung| (rung.more, rung.ms))
        };
        let mut best: Option<(f64, &'static str, &'static str, f64)> = None;
        for knob in states.called_for() {
            let now = at(knob.name, knob.rung(&knobs));
            for &to in knob.rungs {
                let measured =
                    to == knob.rung(local) || rungs.iter().any(|rung| rung.knob == knob.name && rung.to == to);
                // A rung that approximates more but has less error cancels another error: it is no improvement of its
                // own.
                let further = knobs.with(knob.name, to).filter(|then| knob.place(then) > knob.place(&knobs));
                let possible = further.is_some();
                if !measured || !possible || refused.contains(&(knob.name, to)) {
                    continue;
                }
                let then = at(knob.name, to);
                // An error change that is not significant counts as 0; its time counts.
                let told = |more: Estimate| if more.is_significant(sure) { more.mean } else { 0.0 };
                let gain = told(now.0) - told(then.0);
                let ms = (then.1 - now.1).max(0.01 * base_ms);
                if gain > 0.0 && best.is_none_or(|(ratio, ..)| gain / ms > ratio) {
                    best = Some((gain / ms, knob.name, to, gain));
                }
            }
        }
        let now = judge.display(known)?;
        let now_error = judge.truth.shown.error(&now);
        let worth = best.filter(|(.., gain)| *gain > WORTH * now_error.mean);
        let Some((_, knob, to, gain)) = worth else { break };
        let changed = set(&knobs, knob, to)?;
        let change = format!("{knob}: {} → {to}", local_rung(&knobs, knob));
        let Some(found) = draw(measuring, format!("search: step {step}"), &changed)? else { break };
        let then = judge.display(&found)?;
        let found_error = judge.truth.shown.error(&then);
        let kept = judge.truth.shown.more_error(&then, &now).is_below(sure);
        let promised = (now_error.mean - gain).max(0.0).sqrt();
        tried.push(Tried { change, promised, found: found_error.interval().root().median, kept });
        if kept {
            knobs = changed;
            current = Some(found);
        } else {
            refused.push((knob, to));
        }
    }
    let drawn = measuring.pace.place() - before;
    measuring.pace.skip((PICTURES - 1).saturating_sub(drawn));
    Ok(tried)
}

fn local_rung(knobs: &Knobs, name: &str) -> &'static str {
    KNOBS.iter().find(|knob| knob.name == name).map_or("", |knob| knob.rung(knobs))
}

/// Draws the exact rungs without all rungs that cost time and change nothing visible, and checks that the combination
/// still changes nothing. `None` where no rung is useless, or where there is no time.
///
/// # Errors
/// When files cannot be read or written.
pub fn without_waste(
    measuring: &mut Measuring<'_>,
    judge: &Judge<'_>,
    (agenda, prices): (&Agenda, &[Price]),
    base: &mut Base,
    progress: &mut dyn FnMut(Step<'_>),
) -> Result<Option<Tried>> {
    // For each knob the rung that saves most time without a visible change.
    let mut best: BTreeMap<&str, &Price> = BTreeMap::new();
    for price in prices.iter().filter(|price| price.base == Family::Exact && price.saves()) {
        let unseen = price.flip_between < INVISIBLE || !price.error_told;
        let nothing = price.same || (unseen && price.shown_delta.high < NOTHING && price.noise_ratio.is_none());
        let saved = |price: &Price| -price.gpu_ms_delta.median;
        if nothing && best.get(price.knob.as_str()).is_none_or(|known| saved(price) > saved(known)) {
            best.insert(&price.knob, price);
        }
    }
    let mut knobs = agenda.plain.clone();
    let mut saved = Vec::new();
    for price in best.into_values() {
        let of_paths = || (price.knob == "indirect").then(|| with_indirect(&knobs, &price.to)).flatten();
        if let Some(changed) = knobs.with(&price.knob, &price.to).or_else(of_paths) {
            saved.push(format!("{}={}", price.knob, price.to));
            knobs = changed;
        }
    }
    if saved.is_empty() {
        measuring.pace.skip(1);
        return Ok(None);
    }
    let exact = measuring.records.iter().find(|record| record.name == "exact").cloned();
    let found = measuring.picture(&task("search: exact without waste".to_owned(), &knobs), base, progress)?;
    let (Some(exact), Some(found)) = (exact, found) else { return Ok(None) };
    let [before, after] = [judge.display(&exact)?, judge.display(&found)?];
    let [promised, now] = [&before, &after].map(|display| judge.truth.shown.error(display).interval().root().median);
    let kept = !judge.truth.shown.more_error(&after, &before).is_above(standard_errors(STATEMENTS, MANY));
    Ok(Some(Tried { change: format!("exact with {}", saved.join(", ")), promised, found: now, kept }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use etalon::plan::Model;

    #[test]
    fn a_combination_that_is_a_preset_is_not_drawn_again() {
        let record = |name: &str, family: &str, knobs: &Knobs| -> Record {
            serde_json::from_value(serde_json::json!({
                "name": name, "family": family, "knobs": named(knobs), "ms": [], "baseline_ms": [], "start_ms": 0.0, "passes": [],
                "noise": null, "work": {}, "command": "", "image": "", "picture": name, "pair": null,
            }))
            .expect("a record")
        };
        let (local, recursive) = (Knobs::of(Model::Local), Knobs::of(Model::Recursive));
        let one = set(&local, "samples", "1").expect("a rung");
        let all = [
            record("local", "preset", &local),
            record("local samples=1", "local", &one),
            record("recursive", "preset", &recursive),
        ];
        let found = |knobs: &Knobs| preset(&all, knobs).map(|record| record.name.as_str());
        assert_eq!([found(&local), found(&recursive)], [Some("local"), Some("recursive")]);
        // A single change may owe its error to two that cancel: only the search recommends it.
        assert_eq!(found(&one), None);
    }
}
