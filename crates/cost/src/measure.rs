//! Draws and times pictures, writes each as it is drawn, and reads those that an interrupted run has drawn already.

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

/// A file name for a point.
fn stem(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
    name.chars().map(plain).collect()
}

/// A base that others are drawn in turns with.
pub struct Base {
    warm: WarmRenderer,
    measured: Measurement,
}

/// What is measured with, and what was measured.
pub struct Measuring<'a> {
    /// What draws.
    pub bench: &'a Bench<'a>,
    /// Where results go.
    pub folder: &'a Path,
    /// The first words of every command.
    pub command: &'a str,
    /// This part of so many, counted from 1.
    pub shard: [u32; 2],
    /// Pictures are timed again until they took so long.
    pub enough_ms: f64,
    /// The clock.
    pub pace: Pace<'a>,
    /// What was drawn.
    pub records: Vec<Record>,
    /// What a reader should know.
    pub warnings: Vec<String>,
}

impl Measuring<'_> {
    /// A base: drawn anew in every run, because others are drawn in turns with it.
    ///
    /// # Errors
    /// When it cannot be drawn or written.
    pub fn base(&mut self, task: &Task, progress: &mut dyn FnMut(Step<'_>)) -> Result<Base> {
        let expected = self.pace.tell(&task.name, progress);
        let begun = Instant::now();
        let mut warm = self.bench.warm_up(&task.knobs)?;
        let measured = self.bench.measure(&mut warm, None, self.enough_ms)?;
        self.keep(task, warm.start_ms, &measured, None)?;
        self.pace.forecast.took(expected, begun.elapsed().as_secs_f64());
        Ok(Base { warm, measured })
    }

    /// A picture, in turns with a base. `None` where another part of the run draws it, there is no time for it, or it cannot be drawn:
    /// that is told, and the others are drawn.
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
            let measured = self.bench.measure(&mut warm, Some((&mut base.warm, &base.measured)), self.enough_ms)?;
            Ok((warm.start_ms, measured))
        });
        let (start_ms, measured) = match drawn {
            Ok(drawn) => drawn,
            Err(error) => {
                self.warnings.push(format!("\"{}\" cannot be drawn here: {error:#}", task.name));
                return Ok(None);
            }
        };
        let record = self.keep(task, start_ms, &measured, Some(&base.measured))?;
        self.pace.forecast.took(expected, begun.elapsed().as_secs_f64());
        Ok(Some(record))
    }

    /// What an interrupted run has drawn of the same rungs under this name.
    fn known(&self, name: &str, knobs: &Knobs) -> Result<Option<Record>> {
        let path = self.folder.join("points").join(format!("{}.json", stem(name)));
        if !path.exists() {
            return Ok(None);
        }
        let record: Record =
            serde_json::from_slice(&file::read(&path)?).with_context(|| format!("reading {}", path.display()))?;
        Ok(Some(record).filter(|record| record.knobs == named(knobs)))
    }

    /// Writes a picture and what was measured of it, that last.
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
