//! Report about the workers of a distributed picture or sequence: time line, scaling and devices, as an HTML page.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result, bail};
use maud::{DOCTYPE, PreEscaped, html};
use serde::Deserialize;
use serde_json::Value;

use crate::part::{Part, PartHeader};
use crate::worker::FarmWorker;

/// Work of one process.
#[derive(Debug, Clone, PartialEq)]
pub struct Shift {
    /// The process.
    pub worker: FarmWorker,
    /// Its work in words.
    pub what: String,
    /// Start and end of each of its pictures in seconds since 1970; empty for a part of a picture.
    pub pictures: Vec<[f64; 2]>,
}

/// Summary of the work of several processes.
#[derive(Debug, Clone, PartialEq)]
pub struct Account {
    /// Work of each process, by start.
    pub shifts: Vec<Shift>,
    /// Seconds from the first start to the last end.
    pub took_s: f64,
    /// Sum of the seconds of all processes.
    pub busy_s: f64,
    /// Largest number of simultaneous processes.
    pub at_once: usize,
    /// Number of processes by device and driver.
    pub devices: BTreeMap<String, usize>,
}

/// A picture in the report of a sequence.
#[derive(Deserialize)]
struct AccountPicture {
    frame: i32,
    began: f64,
    prepare_ms: f64,
    draw_ms: f64,
    write_ms: f64,
    found: bool,
}

impl Shift {
    /// Reads the work records of a file: a part, a report of `render --report` about a sequence, or a report of
    /// `merge --report`.
    ///
    /// # Errors
    /// When the file is none of these.
    pub fn read(path: &Path) -> Result<Vec<Self>> {
        let bytes = etalon::image::file::read(path)?;
        if bytes.first() != Some(&b'{') {
            let PartHeader { worker, shard: [index, of], .. } = Part::read(path)?.head;
            return Ok(vec![Self { worker, what: format!("part {index} of {of}"), pictures: Vec::new() }]);
        }
        let place = || format!("reading {}", path.display());
        let value: Value = serde_json::from_slice(&bytes).with_context(place)?;
        match value["schema"].as_str() {
            Some("etalon.sequence/1") => {
                let worker = serde_json::from_value(value["worker"].clone()).with_context(place)?;
                let pictures: Vec<AccountPicture> =
                    serde_json::from_value(value["pictures"].clone()).with_context(place)?;
                let mut frames: Vec<i32> = pictures.iter().map(|picture| picture.frame).collect();
                frames.dedup();
                let drawn = pictures.iter().filter(|picture| !picture.found);
                let span = |p: &AccountPicture| [p.began, p.began + (p.prepare_ms + p.draw_ms + p.write_ms) * 1e-3];
                let what = format!("{} pictures, {} of them drawn", pictures.len(), drawn.clone().count());
                Ok(vec![Self { worker, what, pictures: drawn.map(span).collect() }])
            }
            Some("etalon.merge/1") => {
                let workers: Vec<FarmWorker> = serde_json::from_value(value["workers"].clone()).with_context(place)?;
                let of = workers.len();
                let shift =
                    |(i, worker)| Self { worker, what: format!("part {} of {of}", i + 1), pictures: Vec::new() };
                Ok(workers.into_iter().enumerate().map(shift).collect())
            }
            _ => bail!(
                "{}: this file is neither a part of a picture nor a report of a sequence or of a merged picture",
                path.display()
            ),
        }
    }
}

impl Account {
    /// Summarises the work of several processes.
    ///
    /// # Errors
    /// When `shifts` is empty.
    pub fn of(mut shifts: Vec<Shift>) -> Result<Self> {
        shifts.sort_by(|a, b| a.worker.began.total_cmp(&b.worker.began));
        let Some(first) = shifts.first() else { bail!("the files record no work") };
        let began = first.worker.began;
        let ended = shifts.iter().map(|shift| shift.worker.ended).fold(began, f64::max);
        let mut devices = BTreeMap::new();
        for shift in &shifts {
            *devices.entry(shift.worker.device.join(", ")).or_default() += 1;
        }
        // The number of simultaneous processes has its maximum at some start.
        let at = |when: f64| shifts.iter().filter(|s| s.worker.began <= when && when < s.worker.ended).count();
        let at_once = shifts.iter().map(|shift| at(shift.worker.began)).max().unwrap_or_default().max(1);
        let busy_s = shifts.iter().map(|shift| shift.worker.ended - shift.worker.began).sum();
        Ok(Self { took_s: ended - began, busy_s, at_once, devices, shifts })
    }

    /// Mean number of busy processes; an ideal farm reaches [`Account::at_once`].
    #[must_use]
    pub fn at_work(&self) -> f64 {
        if self.took_s > 0.0 { self.busy_s / self.took_s } else { 1.0 }
    }

    /// The HTML page.
    #[must_use]
    pub fn page(&self) -> String {
        const WIDTH: f64 = 900.0;
        const ROW: f64 = 22.0;
        let began = self.shifts.first().map_or(0.0, |shift| shift.worker.began);
        let x = |when: f64| (when - began) / self.took_s.max(1e-9) * WIDTH;
        let prepared: f64 = self.shifts.iter().map(|shift| shift.worker.prepared_s).sum();
        let share = |part: f64, of: f64| format!("{:.0} %", 100.0 * part / of.max(1e-9));
        let height = ROW * self.shifts.len() as f64 + 24.0;
        html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width";
                    title { "Workers" }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    h1 { (self.shifts.len()) " processes, " (format!("{:.1} s", self.took_s)) }
                    @if self.devices.len() > 1 {
                        p.warning {
                            "Mixed farm: the processes ran on " (self.devices.len()) " devices or drivers. Their rounding may differ, so a \
                             picture that they drew together may differ from that of one run."
                        }
                    }
                    table {
                        tr { th { "largest number of simultaneous processes" } td { (self.at_once) } }
                        tr { th { "sum of the seconds of all processes" } td { (format!("{:.1}", self.busy_s)) } }
                        tr { th { "mean number of busy processes" } td { (format!("{:.2}", self.at_work())) ", "
                            (share(self.at_work(), self.at_once as f64)) " of the largest number" } }
                        tr { th { "preparation before the first sample" } td { (share(prepared, self.busy_s)) " of the time of all processes" } }
                    }
                    h2 { "Time line" }
                    p { "Each bar is a process. Its light part is the time before the first sample; lines mark the starts of pictures." }
                    div.wide {
                        svg viewBox=(format!("0 0 {} {height}", WIDTH + 220.0)) role="img" aria-label="time line of the processes" {
                            @for (row, shift) in self.shifts.iter().enumerate() {
                                @let y = ROW * row as f64;
                                @let FarmWorker { began, ended, prepared_s, host, process, .. } = &shift.worker;
                                rect.prepare x=(x(*began)) y=(y)
                                    width=(x(began + prepared_s.min(ended - began)) - x(*began)) height=(ROW - 6.0) {}
                                rect.draw x=(x(began + prepared_s.min(ended - began))) y=(y)
                                    width=((x(*ended) - x(began + prepared_s.min(ended - began))).max(1.0))
                                    height=(ROW - 6.0) {}
                                @for [from, _] in &shift.pictures {
                                    line.picture x1=(x(*from)) x2=(x(*from)) y1=(y) y2=(y + ROW - 6.0) {}
                                }
                                text x=(WIDTH + 8.0) y=(y + 12.0) { (host) ":" (process) " " (shift.what) }
                            }
                            text x="0" y=(height - 4.0) { "0 s" }
                            text x=(WIDTH) y=(height - 4.0) text-anchor="end" { (format!("{:.1} s", self.took_s)) }
                        }
                    }
                    h2 { "Devices and drivers" }
                    table {
                        @for (device, count) in &self.devices {
                            tr { th { (device) } td { (count) } }
                        }
                    }
                    h2 { "Processes" }
                    table {
                        tr { th { "host" } th { "process" } th { "work" } th { "start, s" } th { "end, s" } th { "preparation, s" } }
                        @for shift in &self.shifts {
                            tr {
                                td { (shift.worker.host) }
                                td { (shift.worker.process) }
                                td { (shift.what) }
                                td { (format!("{:.1}", shift.worker.began - began)) }
                                td { (format!("{:.1}", shift.worker.ended - began)) }
                                td { (format!("{:.1}", shift.worker.prepared_s)) }
                            }
                        }
                    }
                }
            }
        }
        .into_string()
    }
}

const STYLE: &str = "
:root { color-scheme: light dark; --ink: #1b1b1b; --paper: #fff; --bar: #2b6cb0; --light: #9cc3ea; --line: #fff; }
@media (prefers-color-scheme: dark) {
:root { --ink: #e8e8e8; --paper: #161616; --bar: #5b9bd9; --light: #2c4f70; --line: #161616; }
}
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
max-width: 72rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; } th, td { text-align: left; padding: .15rem 1rem .15rem 0; font-weight: normal; }
td { font-variant-numeric: tabular-nums; }
.wide { overflow-x: auto; } svg { min-width: 700px; width: 100%; } svg text { font-size: 11px; fill: currentColor; }
.prepare { fill: var(--light); } .draw { fill: var(--bar); } .picture { stroke: var(--line); }
.warning { border-left: 4px solid #c05621; padding-left: 1rem; }
";

#[cfg(test)]
mod tests {
    use super::*;

    fn shift(began: f64, ended: f64, driver: &str) -> Shift {
        let device = ["device".to_owned(), driver.to_owned(), "1".to_owned()];
        let worker = FarmWorker { host: "a".to_owned(), process: 1, began, ended, device, prepared_s: 1.0 };
        Shift { worker, what: "part".to_owned(), pictures: Vec::new() }
    }

    #[test]
    fn scaling_is_work_over_time() {
        let account =
            Account::of(vec![shift(4.0, 10.0, "x"), shift(0.0, 10.0, "x"), shift(0.0, 4.0, "x")]).expect("shifts");
        assert_eq!((account.took_s, account.busy_s, account.at_once), (10.0, 20.0, 2));
        assert!((account.at_work() - 2.0).abs() < 1e-12);
        assert!(!account.page().contains("Mixed farm"));
        assert!(Account::of(Vec::new()).is_err());
    }

    #[test]
    fn a_mixed_farm_is_reported() {
        let account = Account::of(vec![shift(0.0, 1.0, "x"), shift(0.0, 1.0, "y")]).expect("shifts");
        assert_eq!(account.devices.len(), 2);
        assert!(account.page().contains("Mixed farm"));
    }
}
