//! Holds every statement of one run against another run of the same picture with a far better reference:
//!
//! ```text
//! cargo run -p etalon-cost --example contradictions -- A/cost.json B/cost.json …
//! ```
//!
//! of each pair of files the first is judged. Counted are signs of errors and of times, what is said to be wasted, steps of the
//! frontier, and how many intervals of errors cover what the second run found.

#![expect(clippy::print_stdout, reason = "a program that prints what it finds")]

use anyhow::{Context as _, Result, ensure};
use etalon_cost::table::{Family, Point, Price, REFERENCE, Table};

#[derive(Default)]
struct Count {
    statements: usize,
    wrong: Vec<String>,
    intervals: usize,
    covered: usize,
}

impl Count {
    fn say(&mut self, right: bool, what: impl FnOnce() -> String) {
        self.statements += 1;
        if !right {
            self.wrong.push(what());
        }
    }
}

fn point<'a>(table: &'a Table, name: &str) -> Option<&'a Point> {
    table.points.iter().find(|point| point.name == name)
}

fn price<'a>(table: &'a Table, name: &str) -> Option<&'a Price> {
    table.prices.iter().find(|price| price.point == name)
}

fn compare(a: &Table, b: &Table, count: &mut Count) {
    for now in &a.prices {
        let Some(truth) = price(b, &now.point) else { continue };
        let told = |x: &Price| if x.error_told { x.shown_delta.median.signum() } else { 0.0 };
        if now.error_told {
            // What nobody else can tell is not contradicted; the other sign is, or an interval that leaves no room for this one.
            let rules_out = match now.base {
                Family::Local => told(truth) * told(now) < 0.0,
                _ => truth.shown_delta.high <= 0.0,
            };
            count.say(!rules_out, || format!("{}: {} / {}", now.point, now.verdict, truth.verdict));
        }
        if now.time_told {
            let rules_out = truth.time_told && truth.share * now.share < 0.0;
            count.say(!rules_out, || format!("{}: {:+.3} of the time / {:+.3}", now.point, now.share, truth.share));
        }
        if now.verdict.ends_with("wasted here") {
            let helps = truth.base == Family::Local && told(truth) < 0.0 && truth.is_seen();
            count.say(!helps, || format!("{}: {} / {}", now.point, now.verdict, truth.verdict));
        }
    }
    let frontier: Vec<&Point> = a.frontier.iter().map(|&i| &a.points[i]).filter(|p| p.name != REFERENCE).collect();
    for pair in frontier.windows(2) {
        let [Some(quick), Some(slow)] = [point(b, &pair[0].name), point(b, &pair[1].name)] else { continue };
        // Combinations may have other rungs in another run.
        if quick.knobs == pair[0].knobs && slow.knobs == pair[1].knobs {
            let says = || format!("{} before {}: error {} / {}", quick.name, slow.name, quick.error(), slow.error());
            count.say(quick.error() > slow.error(), says);
            let says =
                || format!("{} before {}: {} ms / {} ms", quick.name, slow.name, quick.gpu_ms.low, slow.gpu_ms.high);
            count.say(quick.gpu_ms.low < slow.gpu_ms.high, says);
        }
    }
    for now in a.points.iter().filter(|point| point.name != REFERENCE) {
        let Some(truth) = point(b, &now.name).filter(|truth| truth.image == now.image) else { continue };
        let (now, truth) = (now.errors.error, truth.errors.error);
        count.intervals += 1;
        count.covered += usize::from(now.low <= truth.high && truth.low <= now.high);
    }
}

fn main() -> Result<()> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    ensure!(!paths.is_empty() && paths.len().is_multiple_of(2), "expected pairs of cost.json");
    let read = |path: &String| -> Result<Table> {
        let text = std::fs::read(path).with_context(|| format!("reading {path}"))?;
        serde_json::from_slice(&text).with_context(|| format!("reading {path}"))
    };
    let mut all = Count::default();
    for pair in paths.chunks(2) {
        let (a, b) = (read(&pair[0])?, read(&pair[1])?);
        let before = (all.statements, all.wrong.len(), all.intervals, all.covered);
        compare(&a, &b, &mut all);
        println!(
            "{}: {} statements, {} contradicted; {} of {} intervals cover; resolution {:.4} / {:.4}",
            a.scene,
            all.statements - before.0,
            all.wrong.len() - before.1,
            all.covered - before.3,
            all.intervals - before.2,
            a.reference.resolution,
            b.reference.resolution
        );
    }
    for wrong in &all.wrong {
        println!("  {wrong}");
    }
    println!(
        "{} statements, {} contradicted; {} of {} intervals cover",
        all.statements,
        all.wrong.len(),
        all.covered,
        all.intervals
    );
    Ok(())
}
