//! A run of `etalon cost`: what is asked for, its folder, how many pixels it measures, and joining its parts (`run.rs` measures).

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail, ensure};
use serde::{Deserialize, Serialize};

use super::agenda::States;
use super::judge::{Judge, Record};
use super::pace::{Pace, Step};
use super::reference::{Pilot, Refined};
use super::run::Run;
use super::sitting::Bench;
use super::size::resized;
use super::table::{DeviceName, Table};
use etalon::image::file;
use etalon::image::metric::AnyPicture;

/// Shares of the budget: for the reference before prices are drawn from its rungs, and for pictures of the size that was asked for where
/// fewer pixels are measured.
pub(super) const REFERENCE_SHARE: f64 = 0.4;
const AFTER_SHARE: f64 = 0.08;

/// How much is measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Extent {
    /// Seconds to be spent.
    pub budget_s: u32,
    /// Samples of the reference, whatever that takes; `None`: what the budget allows.
    pub reference_samples: Option<u32>,
    /// This part of so many, counted from 1.
    pub shard: [u32; 2],
}

/// A run.
pub struct Sweep<'a> {
    /// What draws.
    pub bench: Bench<'a>,
    /// Where the results go.
    pub folder: &'a Path,
    /// How much is measured.
    pub extent: Extent,
    /// The first words of every command of a size.
    pub command: &'a dyn Fn([u32; 2]) -> String,
    /// What the scene is called.
    pub scene: &'a str,
    /// Hash of all that is drawn: a file may change under its name.
    pub contents: &'a str,
    /// Where an earlier run of what a command draws left its reference, which this one goes on with.
    pub kept: &'a dyn Fn(&str) -> Option<PathBuf>,
    /// Whether fewer pixels may be measured where the budget has no time for all.
    pub may_shrink: bool,
    /// Pictures of other programs that are judged too, by name.
    pub others: &'a [(String, AnyPicture)],
    /// Whether somebody asked the run to end with what there is.
    pub stopped: &'a dyn Fn() -> bool,
}

/// What hears of a run.
pub struct Listener<'a> {
    /// Each picture before it is drawn.
    pub step: &'a mut dyn FnMut(Step<'_>),
    /// What is known before the end, of long runs.
    pub early: &'a mut dyn FnMut(&Table) -> Result<()>,
}

/// What two runs must have in common for one to go on with the other's pictures.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Identity {
    program: String,
    command: String,
    device: DeviceName,
    extent: Extent,
    contents: String,
    seed: u32,
}

impl Sweep<'_> {
    /// Measures, and writes each picture as it is drawn.
    ///
    /// # Errors
    /// When something cannot be drawn or written.
    pub fn run(&self, listener: &mut Listener<'_>) -> Result<Table> {
        self.claim_folder()?;
        let budget_s = f64::from(self.extent.budget_s);
        let ends = self.extent.reference_samples.is_none();
        let mut pace = Pace::new(budget_s, ends, self.stopped);
        (listener.step)(Step { name: "pilot", done: 0, of: 1, left_s: budget_s });
        let states = States::of(&self.bench)?;
        let begun = Refined::read(self.folder)?.map(|(known, _)| known);
        let asked = self.bench.settings.size;
        let bench = resized(&self.bench, begun.as_ref().map_or(asked, Refined::size));
        let may_shrink = self.may_shrink && ends && self.others.is_empty() && begun.is_none();
        let share = [budget_s * 1e3, REFERENCE_SHARE];
        let pilot = Pilot::draw(&bench, states.calls_for("colour"), share, may_shrink)?;
        let size = pilot.size;
        if size != asked {
            pace.after_s = AFTER_SHARE * budget_s;
        }
        let run = Run { sweep: self, bench: resized(&bench, size), command: &(self.command)(size), pilot };
        run.measure(&states, pace, begun, listener)
    }

    /// A folder is that of one run: new, or one that was interrupted.
    fn claim_folder(&self) -> Result<()> {
        let identity = Identity {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            command: (self.command)(self.bench.settings.size),
            device: self.device(),
            extent: self.extent.clone(),
            contents: self.contents.to_owned(),
            seed: self.bench.settings.seed,
        };
        let path = self.folder.join("run.json");
        if path.exists() {
            let known: Identity = serde_json::from_slice(&file::read(&path)?)
                .with_context(|| format!("reading {}: it is not that of a run of cost", path.display()))?;
            ensure!(
                known == identity,
                "{} holds another run (`{}` with seed {}, a budget of {} s, part {}/{}, on {}), or one of a scene that has changed \
                 since: name another folder, or remove it",
                self.folder.display(),
                known.command,
                known.seed,
                known.extent.budget_s,
                known.extent.shard[0],
                known.extent.shard[1],
                known.device.name
            );
        } else {
            if self.folder.exists() && self.folder.read_dir().is_ok_and(|mut all| all.next().is_some()) {
                bail!("{} is not empty and holds no run of cost: name another folder", self.folder.display());
            }
            make(self.folder)?;
            file::write(&path, serde_json::to_string_pretty(&identity)?.as_bytes())?;
        }
        make(&self.folder.join("points"))?;
        make(&self.folder.join("pictures"))
    }

    pub(super) fn device(&self) -> DeviceName {
        let info = self.bench.device.info();
        DeviceName {
            name: info.name.clone(),
            driver: info.driver.clone(),
            version: info.version.clone(),
            kind: info.kind.to_owned(),
        }
    }
}

fn make(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder)
        .map_err(|e| anyhow::anyhow!("making the folder {}: {}", folder.display(), file::cause(&e)))
}

/// Joins the parts of a run into `folder`: their pictures are judged together by the reference that they have in common.
///
/// # Errors
/// When they are not the parts of one run, or something cannot be read or written.
pub fn merge(parts: &[PathBuf], folder: &Path, settings: &etalon::frame::Settings) -> Result<Table> {
    let read = |part: &PathBuf| -> Result<Table> {
        let path = part.join("cost.json");
        serde_json::from_slice(&file::read(&path)?).with_context(|| format!("reading {}", path.display()))
    };
    let mut table = Table::merge(parts.iter().map(read).collect::<Result<_>>()?)?;
    let first = parts.first().context("merging: there is nothing to merge")?;
    let (refined, reference) =
        Refined::read(first)?.with_context(|| format!("reading {}: it has no reference", first.display()))?;
    for name in ["points", "pictures"] {
        make(&folder.join(name))?;
        for part in parts {
            let from = part.join(name);
            for entry in from.read_dir().with_context(|| format!("reading {}", from.display()))? {
                let path = entry?.path();
                file::write(&folder.join(name).join(path.file_name().unwrap_or_default()), &file::read(&path)?)?;
            }
        }
    }
    let mut records: Vec<Record> = Vec::new();
    for point in table.points.iter().filter(|point| point.picture != "reference") {
        let path = folder.join("points").join(format!("{}.json", point.picture));
        let record: Record =
            serde_json::from_slice(&file::read(&path)?).with_context(|| format!("reading {}", path.display()))?;
        records.push(record);
    }
    let truth = refined.truth(settings);
    let judged = Judge { truth: &truth, reference: &reference, folder }.judge(&records)?;
    table.frontier = judged.frontier;
    table.recommended = judged.recommended;
    table.standard_errors = judged.standard_errors;
    table.points = judged.points;
    table.prices = judged.prices;
    Ok(table)
}
