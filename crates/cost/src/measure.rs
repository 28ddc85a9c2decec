//! Draws and times the pictures of a run. Each picture is written when it is drawn; an interrupted run reads the
//! pictures that it finds.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context as _, Result};

use super::agenda::Task;
use super::command::{arguments, named};
use super::judge::Record;
use super::pace::{Pace, Step};
use super::price::Pair;
use super::warm::{Bench, Measurement, WarmRenderer};
use etalon::image::{exr, file};
use etalon::plan::Knobs;

/// File name of a point.
fn stem(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
    name.chars().map(plain).collect()
}

/// A warmed-up baseline that other pictures are timed interleaved with.
pub struct Base {
    warm: WarmRenderer,
    measured: Measurement,
}

/// State of a run: how to measure, and the measurements so far.
pub struct Measuring<'a> {
    /// Bench that draws.
    pub bench: &'a Bench<'a>,
    /// Folder of the results.
    pub folder: &'a Path,
    /// Beginning of every printed command.
    pub command: &'a str,
    /// Index (from 1) and number of the parts of a sharded run.
    pub shard: [u32; 2],
    /// Total milliseconds after which a picture is not timed again.
    pub enough_ms: f64,
    /// Clock of the run.
    pub pace: Pace<'a>,
    /// Measurements so far.
    pub records: Vec<Record>,
    /// Warnings for the report.
    pub warnings: Vec<String>,
}

impl Measuring<'_> {
    /// Draws a base. Every run draws its bases anew, because other pictures are timed interleaved with them.
    ///
    /// # Errors
    /// When the base cannot be drawn or written.
    pub fn base(&mut self, task: &Task, progress: &mut dyn FnMut(Step<'_>)) -> Result<Base> {
        let expected = self.pace.tell(&task.name, progress);
        let begun = Instant::now();
        let mut warm = self.bench.warm_up(&task.knobs)?;
        let measured = self.bench.measure(&mut warm, None, self.enough_ms)?;
        self.keep(task, warm.start_ms, &measured, None)?;
        self.pace.forecast.took(expected, begun.elapsed().as_secs_f64());
        Ok(Base { warm, measured })
    }

    /// Draws a picture, timed interleaved with a base. `None` where another shard draws it, where there is no time for
    /// it, or where it cannot be drawn; a failure becomes a warning and the run goes on.
    ///
    /// # Errors
    /// When files cannot be read or written.
    pub fn picture(
        &mut self,
        task: &Task,
        base: &mut Base,
        progress: &mut dyn FnMut(Step<'_>),
    ) -> Result<Option<Record>> {
        let [shard, of] = self.shard;
        let elsewhere = self.pace.place() as u32 % of != shard - 1;
        let expected = self.pace.tell(&task.name, progress);
        if elsewhere {
            return Ok(None);
        }
        if let Some(record) = self.known(&task.name, &task.knobs)? {
            self.records.push(record.clone());
            return Ok(Some(record));
        }
        if self.pace.too_late(expected) {
            return Ok(None);
        }
        let begun = Instant::now();
        let drawn = self.bench.warm_up(&task.knobs).and_then(|mut warm| {
            // The estimate was a guess; the warm-up has measured.
            if self.pace.too_long(warm.sample_s * f64::from(task.knobs.samples.count())) {
                return Ok(None);
            }
            let measured = self.bench.measure(&mut warm, Some((&mut base.warm, &base.measured)), self.enough_ms)?;
            Ok(Some((warm.start_ms, measured)))
        });
        let (start_ms, measured) = match drawn {
            Ok(Some(drawn)) => drawn,
            Ok(None) => return Ok(None),
            Err(error) => {
                self.warnings.push(format!("\"{}\" cannot be drawn on this device: {error:#}", task.name));
                return Ok(None);
            }
        };
        let record = self.keep(task, start_ms, &measured, Some(&base.measured))?;
        self.pace.forecast.took(expected, begun.elapsed().as_secs_f64());
        Ok(Some(record))
    }

    /// The record of an interrupted run with the same name and knobs.
    fn known(&self, name: &str, knobs: &Knobs) -> Result<Option<Record>> {
        let path = self.folder.join("points").join(format!("{}.json", stem(name)));
        if !path.exists() {
            return Ok(None);
        }
        let record: Record =
            serde_json::from_slice(&file::read(&path)?).with_context(|| format!("reading {}", path.display()))?;
        Ok(Some(record).filter(|record| record.knobs == named(knobs)))
    }

    /// Writes a picture and then its record.
    fn keep(
        &mut self,
        task: &Task,
        start_ms: f64,
        measured: &Measurement,
        base: Option<&Measurement>,
    ) -> Result<Record> {
        let picture = stem(&task.name);
        file::write(&self.folder.join("pictures").join(format!("{picture}.png")), &measured.png)?;
        let points = self.folder.join("points");
        file::write(&points.join(format!("{picture}.exr")), &exr::encode_exr_quickly(&measured.film, &[])?)?;
        let seed = match self.bench.settings.seed {
            0 => String::new(),
            seed => format!(" --seed {seed}"),
        };
        let pair = match (&task.change, base) {
            (Some(change), Some(base)) => Some((change.clone(), Pair::of(change, measured, base)?)),
            _ => None,
        };
        let record = Record {
            name: task.name.clone(),
            family: task.family,
            knobs: named(&task.knobs),
            ms: measured.ms.clone(),
            baseline_ms: measured.baseline_ms.clone(),
            start_ms,
            passes: measured.passes.clone(),
            noise: measured.noise,
            work: measured.work.clone(),
            compiled: measured.compiled.clone(),
            command: format!("{}{seed} {} --repeat 3 -o {picture}.png", self.command, arguments(&task.knobs)),
            image: file::hash(&measured.png),
            picture: picture.clone(),
            pair,
        };
        file::write(&points.join(format!("{picture}.json")), serde_json::to_string_pretty(&record)?.as_bytes())?;
        self.records.push(record.clone());
        Ok(record)
    }
}
