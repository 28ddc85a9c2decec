//! A run of `etalon cost`: what is asked for, its folder, and joining its parts (`run.rs` measures).

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail, ensure};
use serde::{Deserialize, Serialize};

use super::judge::{Judge, Record};
use super::pace::Step;
use super::reference::Refined;
use super::table::{DeviceName, Table};
use super::warm::Bench;
use etalon::image::file;
use etalon::image::metric::AnyPicture;

/// How much is measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SweepExtent {
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
    pub extent: SweepExtent,
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
struct SweepIdentity {
    program: String,
    command: String,
    device: DeviceName,
    extent: SweepExtent,
    contents: String,
    seed: u32,
}

impl<'a> Sweep<'a> {
    /// A run of which nothing but the table is wanted: it goes on with no earlier one, and its commands are not told.
    #[must_use]
    pub fn alone(bench: Bench<'a>, folder: &'a Path, extent: SweepExtent) -> Self {
        Self {
            bench,
            folder,
            extent,
            command: &|_| String::new(),
            scene: "",
            contents: "",
            kept: &|_| None,
            may_shrink: false,
            others: &[],
            stopped: &|| false,
        }
    }
}

impl Sweep<'_> {
    /// A folder is that of one run: new, or one that was interrupted.
    pub(super) fn claim_folder(&self) -> Result<()> {
        let identity = SweepIdentity {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            command: (self.command)(self.bench.settings.size),
            device: self.device(),
            extent: self.extent.clone(),
            contents: self.contents.to_owned(),
            seed: self.bench.settings.seed,
        };
        let path = self.folder.join("run.json");
        if path.exists() {
            let known: SweepIdentity = serde_json::from_slice(&file::read(&path)?)
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
