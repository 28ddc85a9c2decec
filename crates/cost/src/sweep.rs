//! Request of a run of `etalon cost`, its folder, and the merge of a sharded run. `run.rs` measures.

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

/// Extent of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SweepExtent {
    /// Time budget in seconds.
    pub budget_s: u32,
    /// Samples of the reference, regardless of the time; `None`: as many as the budget allows.
    pub reference_samples: Option<u32>,
    /// Index (from 1) and number of the parts of a sharded run.
    pub shard: [u32; 2],
}

/// Request of a run.
pub struct Sweep<'a> {
    /// Bench with the requested size.
    pub bench: Bench<'a>,
    /// Folder of the results.
    pub folder: &'a Path,
    /// Extent of the run.
    pub extent: SweepExtent,
    /// Beginning of every printed command at a size.
    pub command: &'a dyn Fn([u32; 2]) -> String,
    /// Name of the scene.
    pub scene: &'a str,
    /// Hash of the scene and the environment: a file may change without changing its name.
    pub contents: &'a str,
    /// Folder with the reference of an earlier run of a command, which this run continues.
    pub kept: &'a dyn Fn(&str) -> Option<PathBuf>,
    /// Whether to measure fewer pixels if the budget is too small for all.
    pub may_shrink: bool,
    /// Pictures of other programs to evaluate, by name.
    pub others: &'a [(String, AnyPicture)],
    /// Whether the user asked to stop the run.
    pub stopped: &'a dyn Fn() -> bool,
}

/// Callbacks of a run.
pub struct Listener<'a> {
    /// Called before each picture is drawn.
    pub step: &'a mut dyn FnMut(Step<'_>),
    /// Called with a preliminary table in long runs.
    pub early: &'a mut dyn FnMut(&Table) -> Result<()>,
}

/// Identity of a run: an interrupted run is continued only if it is equal.
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
    /// A run for its table alone: it continues no earlier run and records no commands.
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
    /// Seconds after which the run ends; infinite where its samples are given, so that nothing depends on the clock.
    pub(super) fn limit_s(&self) -> f64 {
        if self.extent.reference_samples.is_some() { f64::INFINITY } else { f64::from(self.extent.budget_s) }
    }

    /// Claims the folder for this run: it must be new, or of the same interrupted run.
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
                .with_context(|| format!("reading {}: it does not describe a run of cost", path.display()))?;
            ensure!(
                known == identity,
                "{} holds another run (`{}` with seed {}, a budget of {} s, part {}/{}, on {}), or the scene has changed since that \
                 run: name another folder, or remove this one",
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
                bail!("{} is not empty and does not hold a run of cost: name another folder", self.folder.display());
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
        .map_err(|e| anyhow::anyhow!("creating the folder {}: {}", folder.display(), file::cause(&e)))
}

/// Extent of the run that a folder holds; `None` where it holds none.
#[must_use]
pub fn extent_of(folder: &Path) -> Option<SweepExtent> {
    let bytes = file::read(&folder.join("run.json")).ok()?;
    Some(serde_json::from_slice::<SweepIdentity>(&bytes).ok()?.extent)
}

/// Merges the parts of a sharded run into `folder` and evaluates all pictures against their common reference, as the
/// parts show them.
///
/// # Errors
/// When the folders are not the parts of one run, or when a file cannot be read or written.
pub fn merge(parts: &[PathBuf], folder: &Path) -> Result<Table> {
    let read = |part: &PathBuf| -> Result<Table> {
        let path = part.join("cost.json");
        serde_json::from_slice(&file::read(&path)?).with_context(|| format!("reading {}", path.display()))
    };
    let mut table = Table::merge(parts.iter().map(read).collect::<Result<_>>()?)?;
    let first = parts.first().context("merging: no folders are given")?;
    let (refined, reference) =
        Refined::read(first)?.with_context(|| format!("reading {}: the folder has no reference", first.display()))?;
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
    let truth = refined.truth(&reference.view);
    let judged = Judge { truth: &truth, reference: &reference, folder }.judge(&records)?;
    table.frontier = judged.frontier;
    table.recommended = judged.recommended;
    table.standard_errors = judged.standard_errors;
    table.points = judged.points;
    table.prices = judged.prices;
    Ok(table)
}
