//! Holds every statement of one run against another run of the same picture with a far better reference:
//!
//! ```text
//! cargo run -p etalon-cost --example contradictions -- A/cost.json B/cost.json …
//! ```
//!
//! of each pair of files the first is judged. Counted are signs of errors and of times, what is said to be wasted,
//! steps of the frontier, and how many intervals of errors miss what the second run found.
//!
//! Of two folders the pictures of the first are judged by the reference of the second, which
//! `--reference-samples N --seed S --shard 2/1000` draws alone; maps of errors in the first folder become those against
//! it. Times, and prices of paths from the reference's rungs, are not compared then.

#![expect(clippy::print_stdout, reason = "a program that prints what it finds")]

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use etalon_cost::judge::{Judge, Record};
use etalon_cost::reference::Refined;
use etalon_cost::table::{Family, Point, Price, REFERENCE, Table};

#[derive(Default)]
struct Count {
    statements: usize,
    wrong: Vec<String>,
    intervals: usize,
    missed: Vec<String>,
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

/// `measured`: whether the second has pictures of its own.
fn compare(a: &Table, b: &Table, measured: bool, count: &mut Count) {
    for now in &a.prices {
        let Some(truth) = price(b, &now.point) else { continue };
        // Pictures along paths are priced by their bases, which the second run has not drawn.
        let by_paths = point(a, &now.point).is_some_and(Point::is_path_traced);
        if !measured && now.base != Family::Local && by_paths {
            continue;
        }
        let told = |x: &Price| if x.error_told { x.shown_delta.median.signum() } else { 0.0 };
        if now.error_told {
            // A reference without a significant sign contradicts nothing. The opposite sign is a contradiction, and so
            // is an interval that excludes this one.
            let rules_out = match now.base {
                Family::Local => told(truth) * told(now) < 0.0,
                _ => truth.shown_delta.high <= 0.0,
            };
            count.say(!rules_out, || format!("{}: {} / {}", now.point, now.verdict, truth.verdict));
        }
        if now.time_told && measured {
            let rules_out = truth.time_told && truth.share * now.share < 0.0;
            count.say(!rules_out, || format!("{}: {:+.3} of the time / {:+.3}", now.point, now.share, truth.share));
        }
        if now.is_wasted() {
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
            if !measured {
                continue;
            }
            let says =
                || format!("{} before {}: {} ms / {} ms", quick.name, slow.name, quick.gpu_ms.low, slow.gpu_ms.high);
            count.say(quick.gpu_ms.low < slow.gpu_ms.high, says);
        }
    }
    for now in a.points.iter().filter(|point| point.name != REFERENCE) {
        let Some(truth) = point(b, &now.name).filter(|truth| truth.image == now.image) else { continue };
        let (found, truth) = (now.errors.error, truth.errors.error);
        count.intervals += 1;
        if found.low > truth.high || truth.low > found.high {
            let [found, truth] = [found, truth].map(|x| format!("{:.4} ({:.4} to {:.4})", x.median, x.low, x.high));
            count.missed.push(format!("{}: error {found} / {truth}", now.name));
        }
    }
}

fn main() -> Result<()> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    ensure!(!paths.is_empty() && paths.len().is_multiple_of(2), "expected pairs of cost.json, or of folders");
    let read = |path: &Path| -> Result<Table> {
        let text = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
        serde_json::from_slice(&text).with_context(|| format!("reading {}", path.display()))
    };
    let rejudged = |a: &Path, b: &Path| -> Result<Table> {
        let table = read(&a.join("cost.json"))?;
        let (refined, reference) = Refined::read(b)?.with_context(|| format!("{} has no reference", b.display()))?;
        ensure!(refined.size() == table.size, "{} and {} have different sizes", a.display(), b.display());
        let truth = refined.truth(&table.reference.view);
        let record = |point: &Point| -> Result<Record> {
            let path = a.join("points").join(format!("{}.json", point.picture));
            let text = std::fs::read(&path).with_context(|| format!("reading {}", path.display()))?;
            serde_json::from_slice(&text).with_context(|| format!("reading {}", path.display()))
        };
        let drawn = table.points.iter().filter(|point| point.name != REFERENCE);
        let records = drawn.map(record).collect::<Result<Vec<_>>>()?;
        let judge = Judge { truth: &truth, reference: &reference, folder: a };
        let judged = judge.judge(&records)?;
        Ok(Table { points: judged.points, prices: judged.prices, frontier: judged.frontier, reference, ..table })
    };
    let mut all = Count::default();
    for pair in paths.chunks(2) {
        let (a, b) = (Path::new(&pair[0]), Path::new(&pair[1]));
        let measured = a.is_file();
        let (a, b) = match measured {
            true => (read(a)?, read(b)?),
            false => (read(&a.join("cost.json"))?, rejudged(a, b)?),
        };
        let before = (all.statements, all.wrong.len(), all.intervals, all.missed.len());
        compare(&a, &b, measured, &mut all);
        println!(
            "{}: {} statements, {} contradicted; {} intervals, {} miss; resolution {:.4} / {:.4}",
            a.scene,
            all.statements - before.0,
            all.wrong.len() - before.1,
            all.intervals - before.2,
            all.missed.len() - before.3,
            a.reference.resolution,
            b.reference.resolution
        );
    }
    for line in all.wrong.iter().chain(&all.missed) {
        println!("  {line}");
    }
    println!(
        "{} statements, {} contradicted; {} intervals, {} miss",
        all.statements,
        all.wrong.len(),
        all.intervals,
        all.missed.len()
    );
    Ok(())
}
