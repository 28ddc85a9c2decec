//! A run: the score of what the other files do.
//!
//! A pilot, a first round of the reference, presets and every rung of `local`, a search for combinations, every rung of the reference's,
//! and with what time is left more rounds of the reference. Then all is judged by it.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, Result, bail, ensure};
use serde::{Deserialize, Serialize};

use super::agenda::{Agenda, States, Task};
use super::difference::Truth;
use super::judge::{Judge, Judged, Record};
use super::measure::Measuring;
use super::orders;
use super::pace::{Pace, Step};
use super::reference::{NotMeasured, Pilot, Refined, refine, samples_within};
use super::search::{PICTURES, search, without_waste};
use super::sitting::{Bench, ENOUGH_MS, enough_ms};
use super::statistics::Interval;
use super::table::{DeviceName, Family, Order, RESOLVED, Reference, Table, Tried};
use etalon::frame::Progress;
use etalon::image::file;
use etalon::image::metric::AnyPicture;

/// Shares of the budget: for the first round of the reference, and for all of its samples before prices are drawn from its rungs.
const FIRST_SHARE: f64 = 0.12;
const REFERENCE_SHARE: f64 = 0.4;
/// Seconds of a budget from which on a page is written before the end.
const EARLY_S: f64 = 90.0;

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
    /// The first words of every command.
    pub command: &'a str,
    /// What the scene is called.
    pub scene: &'a str,
    /// Hash of all that is drawn: a file may change under its name.
    pub contents: &'a str,
    /// Where an earlier run of the same picture left its reference, which this one goes on with.
    pub kept: Option<&'a Path>,
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

/// What is found out beside pictures.
#[derive(Default)]
struct Found {
    search: Vec<Tried>,
    orders: Vec<Order>,
    warnings: Vec<String>,
}

impl Sweep<'_> {
    /// Measures, and writes each picture as it is drawn.
    ///
    /// # Errors
    /// When something cannot be drawn or written.
    pub fn run(&self, listener: &mut Listener<'_>) -> Result<Table> {
        self.claim_folder()?;
        let Extent { budget_s, reference_samples, shard } = self.extent;
        let (budget_s, ends) = (f64::from(budget_s), reference_samples.is_none());
        let bench = &self.bench;
        let states = States::of(bench)?;
        let pace = Pace::new(budget_s, ends, self.stopped);
        let (records, warnings) = (Vec::new(), Vec::new());
        let (folder, command) = (self.folder, self.command);
        let enough_ms = if ends { enough_ms(budget_s) } else { ENOUGH_MS };
        let mut m = Measuring { bench, folder, command, shard, enough_ms, pace, records, warnings };
        let mut found = Found::default();

        let (mut refined, pilot) = self.first_round(&states, &m.pace, listener)?;
        found.warnings.extend(pilot.warnings.iter().cloned());
        let rungs = refined.knobs().clone();
        // What is given a number of samples is the same whatever the clock says.
        let priced = reference_samples.map(|samples| if samples >= 256 { 16 } else { 4 });
        let each = [pilot.each_ms, pilot.plain_ms];
        let agenda = Agenda::new(bench, &states, &rungs, each, priced, budget_s * 1e3)?;
        let (mut truth, mut reference) = self.describe(&refined, agenda.priced())?;
        let mut local = m.base(&base_task("local", Family::Preset, &agenda.local), listener.step)?;
        self.expect(&mut m, &agenda, &pilot);
        if ends {
            let share = REFERENCE_SHARE * budget_s - reference.gpu_ms / 1e3;
            let missing = f64::from(pilot.wanted.saturating_sub(refined.samples())) * refined.each_ms() / 1e3;
            // What is too little for a round is there for pictures.
            let round = 4.0 * refined.each_ms() / 1e3;
            m.pace.reserved_s = Some(share.min(missing)).filter(|seconds| *seconds >= round).unwrap_or(0.0);
        }
        // First what answers most, should the budget end.
        for task in agenda.presets.iter().chain(&agenda.of_local) {
            m.picture(task, &mut local, listener.step)?;
        }
        if shard == [1, 1] {
            let judge = Judge { truth: &truth, reference: &reference, folder: self.folder };
            found.search = search(&mut m, &judge, (&agenda, &states), &mut local, listener.step)?;
        } else {
            found.warnings.push("a part of a run does not search for combinations".to_owned());
            m.pace.skip(PICTURES - 1);
        }
        for task in &agenda.ladder {
            m.picture(task, &mut local, listener.step)?;
        }
        if ends {
            // Its share comes before prices that nobody could believe without it.
            let share = std::mem::take(&mut m.pace.reserved_s);
            refined = self.more(refined, &m.pace, pilot.wanted, share, listener)?;
            (truth, reference) = self.describe(&refined, agenda.priced())?;
        }
        if ends && budget_s >= EARLY_S {
            let begun = Instant::now();
            let table =
                self.table(&judged(self.folder, &truth, &reference, &m.records)?, &m, &reference, &states, &found);
            (listener.early)(&table)?;
            m.pace.judged(m.records.len(), begun.elapsed().as_secs_f64());
        }
        self.prices_of_exact(&mut m, &agenda, listener)?;
        self.orders(&mut m, &agenda, &mut found, listener)?;

        if ends {
            refined = self.more(refined, &m.pace, pilot.wanted, f64::INFINITY, listener)?;
            (truth, reference) = self.describe(&refined, agenda.priced())?;
        }
        if shard == [1, 1] && m.records.iter().any(|record| record.name == "exact") {
            let judge = Judge { truth: &truth, reference: &reference, folder: self.folder };
            let prices = judge.judge(&m.records)?.prices;
            let tried = without_waste(&mut m, &judge, (&agenda, &prices), &mut local, listener.step)?;
            found.search.extend(tried);
        }
        if agenda.plain.colour != rungs.colour {
            found.warnings.push("knobs other than colour are priced in three colours".to_owned());
        }
        let judge = Judge { truth: &truth, reference: &reference, folder: self.folder };
        let other = |(name, picture): &(String, AnyPicture)| judge.other(name, picture, &bench.settings);
        let others = self.others.iter().map(other).collect::<Result<_>>()?;
        Ok(Table { others, ..self.table(&judge.judge(&m.records)?, &m, &reference, &states, &found) })
    }

    /// A folder is that of one run: new, or one that was interrupted.
    fn claim_folder(&self) -> Result<()> {
        let identity = Identity {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            command: self.command.to_owned(),
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

    /// The reference as far as it is drawn before anything else: what an interrupted or an earlier run has drawn, or a first round.
    fn first_round(&self, states: &States, pace: &Pace<'_>, listener: &mut Listener<'_>) -> Result<(Refined, Pilot)> {
        let Extent { budget_s, reference_samples, .. } = self.extent;
        let budget_s = f64::from(budget_s);
        let kept = self.kept.filter(|_| reference_samples.is_none());
        let mut known = Refined::read(self.folder)?;
        if known.is_none()
            && let Some(kept) = kept
        {
            // What cannot be read is drawn again.
            known = Refined::read(kept).unwrap_or_default();
        }
        (listener.step)(Step { name: "pilot", done: 0, of: 1, left_s: budget_s });
        let mut pilot = Pilot::draw(&self.bench, states.calls_for("colour"), REFERENCE_SHARE * budget_s * 1e3)?;
        if let Some((known, _)) = known {
            pilot.knobs = known.knobs().clone();
            return Ok((known, pilot));
        }
        let samples = match reference_samples {
            Some(samples) => samples,
            None => {
                let least_s = pace.took_s() + 4.0 * pilot.each_ms / 1e3;
                let enough_s = (4.0 * least_s).max(20.0).ceil() as u32;
                ensure!(least_s < budget_s, NotMeasured { budget_s, least_s, enough_s });
                samples_within(pilot.each_ms, FIRST_SHARE * budget_s * 1e3).min(pilot.wanted.next_power_of_two().max(4))
            }
        };
        // The next rung at least, where a power of two is none.
        let samples = if samples.trailing_zeros() % 2 == 1 { 2 * samples } else { samples };
        let left_s = |at: &Progress| f64::from(at.of - at.done) * pilot.each_ms / 1e3 + (1.0 - FIRST_SHARE) * budget_s;
        let refined = Refined::round(None, &self.bench, &pilot.knobs, samples, &mut |at| {
            let (done, of, left_s) = (at.done as usize, at.of as usize, left_s(&at));
            (listener.step)(Step { name: "reference", done, of, left_s });
        })?;
        Ok((refined, pilot))
    }

    /// More rounds of the reference, for so many seconds at most.
    fn more(
        &self,
        refined: Refined,
        pace: &Pace<'_>,
        wanted: u32,
        seconds: f64,
        listener: &mut Listener<'_>,
    ) -> Result<Refined> {
        let begun = Instant::now();
        let left = || pace.left_s().min(seconds - begun.elapsed().as_secs_f64());
        refine(refined, &self.bench, wanted, &left, &mut |at: Progress| {
            let (done, of, left_s) = (at.done as usize, at.of as usize, pace.all_left_s());
            (listener.step)(Step { name: "reference", done, of, left_s });
        })
    }

    /// What errors are told against, and what is said of it; both are written.
    fn describe(&self, refined: &Refined, priced: u32) -> Result<(Truth, Reference)> {
        let truth = refined.truth(&self.bench.settings);
        let (reference, png) = refined.describe(&truth, self.command, priced, &self.bench)?;
        refined.write(self.folder, &reference, &png)?;
        file::write(&self.folder.join("pictures/reference.png"), &png)?;
        Ok((truth, reference))
    }

    /// Tells the clock what is to come.
    fn expect(&self, m: &mut Measuring<'_>, agenda: &Agenda, pilot: &Pilot) {
        let (local, plain) = (&agenda.local, &agenda.plain);
        let drawn = m.records.last().map_or(0.0, |record| Interval::of(&record.ms).median);
        let pace = &mut m.pace;
        pace.forecast.enough_ms = m.enough_ms;
        pace.forecast.path_ms = pilot.plain_ms;
        pace.forecast.raster_ms = drawn / f64::from(local.samples.count());
        let mut expect = |knobs, base| pace.forecast.expect(knobs, base);
        agenda.presets.iter().chain(&agenda.of_local).for_each(|task| expect(&task.knobs, local));
        (0..PICTURES - 1).for_each(|_| expect(local, local));
        agenda.ladder.iter().for_each(|task| expect(&task.knobs, local));
        expect(plain, plain);
        agenda.of_exact.iter().for_each(|task| expect(&task.knobs, plain));
        let with_orders = agenda.orders && self.extent.shard[0] == 1;
        (0..if with_orders { orders::PICTURES } else { 0 }).for_each(|_| expect(local, local));
        expect(plain, local);
        let count = [agenda.presets.len(), agenda.of_local.len(), agenda.of_exact.len(), agenda.ladder.len()];
        pace.expects(1 + count.iter().sum::<usize>() + PICTURES + if with_orders { orders::PICTURES } else { 0 });
    }

    /// Every rung of the reference's rungs, changed alone.
    fn prices_of_exact(&self, m: &mut Measuring<'_>, agenda: &Agenda, listener: &mut Listener<'_>) -> Result<()> {
        let next = m.pace.forecast.next();
        if m.pace.too_late(next) {
            m.pace.leave_out(agenda.of_exact.len());
            return Ok(());
        }
        let mut exact = m.base(&base_task("exact", Family::Exact, &agenda.plain), listener.step)?;
        for task in &agenda.of_exact {
            m.picture(task, &mut exact, listener.step)?;
        }
        Ok(())
    }

    /// Orders of the rules of quadrature: one part of a run in shards draws them.
    fn orders(
        &self,
        m: &mut Measuring<'_>,
        agenda: &Agenda,
        found: &mut Found,
        listener: &mut Listener<'_>,
    ) -> Result<()> {
        if !agenda.orders || self.extent.shard[0] != 1 {
            return Ok(());
        }
        let path = self.folder.join("orders.json");
        if path.exists() {
            found.orders =
                serde_json::from_slice(&file::read(&path)?).with_context(|| format!("reading {}", path.display()))?;
            m.pace.skip(orders::PICTURES);
            return Ok(());
        }
        let all = orders::PICTURES as f64 * m.pace.forecast.next();
        if m.pace.too_late(all) {
            m.pace.skip(orders::PICTURES);
            return Ok(());
        }
        let pace = &mut m.pace;
        let drawn = orders::orders(&self.bench, &mut |name| {
            pace.tell(name, listener.step);
        });
        match drawn {
            Ok(orders) => {
                file::write(&path, serde_json::to_string_pretty(&orders)?.as_bytes())?;
                found.orders = orders;
            }
            Err(error) => m.warnings.push(format!("\"orders\" cannot be drawn here: {error:#}")),
        }
        Ok(())
    }

    fn device(&self) -> DeviceName {
        let info = self.bench.device.info();
        DeviceName {
            name: info.name.clone(),
            driver: info.driver.clone(),
            version: info.version.clone(),
            kind: info.kind.to_owned(),
        }
    }

    fn table(
        &self,
        judged: &Judged,
        m: &Measuring<'_>,
        reference: &Reference,
        states: &States,
        found: &Found,
    ) -> Table {
        let mut warnings = Vec::new();
        if self.bench.device.info().kind == "cpu" {
            warnings.push("a software device: times are those of this processor and of what else it does".to_owned());
        }
        warnings.extend(found.warnings.iter().chain(&m.warnings).cloned());
        if !reference.converged {
            warnings.push(format!(
                "the reference resolves errors of {:.2} % of the range, after {} samples, not of {:.1} %: smaller ones are not told; a \
                 second run goes on with it",
                100.0 * reference.resolution,
                reference.samples,
                100.0 * RESOLVED
            ));
        }
        warnings.extend(m.pace.warning());
        Table {
            schema: "etalon.cost/1".to_owned(),
            program: env!("CARGO_PKG_VERSION").to_owned(),
            device: self.device(),
            scene: self.scene.to_owned(),
            command: self.command.to_owned(),
            size: self.bench.settings.size,
            reference: reference.clone(),
            knobs: states.list(),
            frontier: judged.frontier.clone(),
            recommended: judged.recommended.clone(),
            standard_errors: judged.standard_errors,
            points: judged.points.clone(),
            prices: judged.prices.clone(),
            search: found.search.clone(),
            others: Vec::new(),
            orders: found.orders.clone(),
            warnings,
            shard: self.extent.shard,
            budget_s: f64::from(self.extent.budget_s),
            took_s: m.pace.took_s(),
        }
    }
}

fn base_task(name: &str, family: Family, knobs: &etalon::plan::Knobs) -> Task {
    Task { name: name.to_owned(), family, knobs: knobs.clone(), change: None }
}

fn make(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder)
        .map_err(|e| anyhow::anyhow!("making the folder {}: {}", folder.display(), file::cause(&e)))
}

fn judged(folder: &Path, truth: &Truth, reference: &Reference, records: &[Record]) -> Result<Judged> {
    Judge { truth, reference, folder }.judge(records)
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
    let judged = judged(folder, &truth, &reference, &records)?;
    table.frontier = judged.frontier;
    table.recommended = judged.recommended;
    table.standard_errors = judged.standard_errors;
    table.points = judged.points;
    table.prices = judged.prices;
    Ok(table)
}
