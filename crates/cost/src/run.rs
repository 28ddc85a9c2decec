//! Sequence of a run of `etalon cost`.
//!
//! A first round of the reference; presets and every rung relative to `local`; a search for combinations; every rung
//! relative to the reference's rungs; in the remaining time, more rounds of the reference. Then all pictures are
//! evaluated against it.

use std::time::Instant;

use anyhow::{Context as _, Result, ensure};

use super::agenda::{Agenda, States, Task};
use super::difference::Truth;
use super::judge::{Judge, Judged};
use super::measure::Measuring;
use super::orders;
use super::pace::{Pace, Step};
use super::reference::{BANDS, LEAST_SAMPLES, NotMeasured, Pilot, Refined, refine, samples_within};
use super::search::{PICTURES, search, without_waste};
use super::size::{Growth, resized};
use super::statistics::Interval;
use super::sweep::{Listener, Sweep, SweepExtent};
use super::table::{
    AtSize, Family, QuadratureOrder, REFERENCE, RESOLVED, Recommended, Reference, RequestedSize, Table, Tried,
};
use super::warm::{Bench, enough_ms};
use etalon::frame::{Progress, TileShare};
use etalon::image::file;
use etalon::image::metric::AnyPicture;
use etalon::plan::{Knobs, Model};

/// Fractions of the budget: for the reference before the changes relative to `exact` are drawn, and for pictures of the
/// requested size if fewer pixels are measured.
const REFERENCE_SHARE: f64 = 0.4;
const AFTER_SHARE: f64 = 0.08;
/// Fraction of the budget for the first round of the reference.
const FIRST_SHARE: f64 = 0.12;
/// A later run aims at this many times the samples of a reference that is still noisy.
const AGAIN: u32 = 4;
/// Budgets from this many seconds on write a preliminary report.
const EARLY_S: f64 = 90.0;
/// Resolution of the first round above which changes of `local` can hardly be judged. Changes relative to `exact` are
/// compared with each other, and come first, in at most half of the time for both.
const UNRESOLVED: f64 = 0.1;
/// Estimated time to measure the growth of times with pixels: seconds for four starts, and a number of path-traced
/// samples. Chosen rather too large.
const GROWTH_S: f64 = 1.6;
const GROWTH_SAMPLES: f64 = 10.0;
/// A picture is drawn twice, the first time to compile.
const TWICE: f64 = 2.0;

/// A run at a measured size.
pub(super) struct Run<'a> {
    /// The requested run.
    pub sweep: &'a Sweep<'a>,
    /// Bench with the measured size.
    pub bench: Bench<'a>,
    /// Beginning of every printed command.
    pub command: &'a str,
    /// Results of the pilot.
    pub pilot: Pilot,
}

/// Results of a run other than pictures.
#[derive(Default)]
struct Found {
    search: Vec<Tried>,
    orders: Vec<QuadratureOrder>,
}

impl Sweep<'_> {
    /// Runs all measurements; each picture is written when it is drawn.
    ///
    /// # Errors
    /// When the budget is too small, or when the reference cannot be drawn or a file cannot be written.
    pub fn run(&self, listener: &mut Listener<'_>) -> Result<Table> {
        self.claim_folder()?;
        let budget_s = f64::from(self.extent.budget_s);
        let ends = self.limit_s().is_finite();
        let mut pace = Pace::new(budget_s, ends, self.stopped);
        (listener.step)(Step { name: "pilot", done: 0, of: 1, left_s: budget_s });
        let states = States::of(&self.bench)?;
        let begun = Refined::read(self.folder)?.map(|(known, _)| known);
        let asked = self.bench.settings.size;
        let begun_size = begun.as_ref().map(Refined::size).filter(|_| self.bench.settings.share == TileShare::ALL);
        let bench = resized(&self.bench, begun_size.unwrap_or(asked));
        let may_shrink = self.may_shrink && ends && self.others.is_empty() && begun.is_none();
        let budget = [self.limit_s() * 1e3, REFERENCE_SHARE];
        let pilot = Pilot::draw(&bench, states.calls_for("colour"), budget, may_shrink)?;
        let size = pilot.size;
        if size != asked {
            pace.after_s = AFTER_SHARE * budget_s;
        }
        let run = Run { sweep: self, bench: resized(&bench, size), command: &(self.command)(size), pilot };
        run.measure(&states, pace, begun, listener)
    }
}

impl Run<'_> {
    /// Runs all measurements. `begun`: the rounds of the reference that an interrupted run has drawn.
    pub(super) fn measure(
        &self,
        states: &States,
        pace: Pace<'_>,
        begun: Option<Refined>,
        listener: &mut Listener<'_>,
    ) -> Result<Table> {
        let SweepExtent { budget_s, reference_samples, shard } = self.sweep.extent;
        let (bench, pilot) = (&self.bench, &self.pilot);
        let (records, warnings) = (Vec::new(), pilot.warnings.clone());
        let (folder, command) = (self.sweep.folder, self.command);
        let enough_ms = enough_ms(f64::from(budget_s));
        let mut m = Measuring { bench, folder, command, shard, enough_ms, pace, records, warnings };
        let mut found = Found::default();

        let known = self.known(begun);
        let known_ms = known.as_ref().map_or(0.0, Refined::gpu_ms);
        let refined = match known {
            Some(known) => known,
            None => self.first_round(&m.pace, listener)?,
        };
        let mut refined = refined.aware_of_bands(bench, pilot.off_in_rgb)?;
        let rungs = refined.knobs().clone();
        let priced = reference_samples.map(|samples| if samples >= 256 { 16 } else { 4 });
        let each = [pilot.each_ms, pilot.plain_ms];
        let agenda = Agenda::new(bench, states, &rungs, each, priced, self.sweep.limit_s() * 1e3)?;
        let (mut truth, mut reference) = self.describe(&refined, agenda.priced())?;
        let wanted = self.wanted(&reference);
        let mut local = m.base(&base_task("local", Family::Preset, &agenda.local), listener.step)?;
        let exact_first = reference.resolution > UNRESOLVED;
        self.expect(&mut m, &agenda, exact_first);
        if self.ends() {
            let begun = Instant::now();
            Judge { truth: &truth, reference: &reference, folder }.judge(&m.records)?;
            m.pace.judged(m.records.len(), begun.elapsed().as_secs_f64());
        }
        // One preset besides `local` is drawn even if the reference needs the rest of the budget.
        let (first, presets) = agenda.presets.split_at(1.min(agenda.presets.len()));
        for task in first {
            m.picture(task, &mut local, listener.step)?;
        }
        m.pace.reserved_s = self.reserved_s(&refined, wanted, known_ms);
        // The most informative pictures come first, in case the budget ends.
        for task in presets {
            m.picture(task, &mut local, listener.step)?;
        }
        if exact_first {
            let of_reference = m.pace.reserved_s;
            m.pace.reserved_s += 0.5 * (m.pace.left_s() - of_reference).max(0.0);
            self.prices_of_exact(&mut m, &agenda, listener)?;
            m.pace.reserved_s = of_reference;
        }
        for task in &agenda.of_local {
            m.picture(task, &mut local, listener.step)?;
        }
        if shard == [1, 1] {
            let judge = Judge { truth: &truth, reference: &reference, folder };
            found.search = search(&mut m, &judge, (&agenda, states), &mut local, listener.step)?;
        } else {
            m.warnings.push("a part of a run does not search for combinations".to_owned());
            m.pace.skip(PICTURES - 1);
        }
        for task in &agenda.ladder {
            m.picture(task, &mut local, listener.step)?;
        }
        // The reference gets its share before the changes relative to `exact`: that of `indirect` needs a good one.
        let share = std::mem::take(&mut m.pace.reserved_s);
        let rounds = refined.rounds();
        refined = self.more(refined, &m.pace, wanted, share, listener)?;
        if refined.rounds() > rounds {
            (truth, reference) = self.describe(&refined, agenda.priced())?;
        }
        if self.ends() && f64::from(budget_s) >= EARLY_S && m.pace.can_judge() {
            let begun = Instant::now();
            let judge = Judge { truth: &truth, reference: &reference, folder };
            (listener.early)(&self.table(&judge.judge(&m.records)?, &m, &reference, states, &found))?;
            m.pace.judged(m.records.len(), begun.elapsed().as_secs_f64());
        }
        if !exact_first {
            self.prices_of_exact(&mut m, &agenda, listener)?;
        }
        self.orders(&mut m, &agenda, &mut found, listener)?;

        let tries_without_waste = shard == [1, 1] && m.records.iter().any(|record| record.name == "exact");
        // That takes a picture, for which all others are judged once more.
        let last_s = if tries_without_waste { m.pace.next_s() + m.pace.judging_s() } else { 0.0 };
        let rounds = refined.rounds();
        refined = self.more(refined, &m.pace, wanted, m.pace.left_s() - last_s, listener)?;
        if refined.rounds() > rounds {
            (truth, reference) = self.describe(&refined, agenda.priced())?;
        }
        let judge = Judge { truth: &truth, reference: &reference, folder };
        if tries_without_waste {
            let prices = judge.judge(&m.records)?.prices;
            let tried = without_waste(&mut m, &judge, (&agenda, &prices), &mut local, listener.step)?;
            found.search.extend(tried);
        }
        m.warnings.extend(few_bands(&reference, &rungs));
        let other = |(name, picture): &(String, AnyPicture)| judge.other(name, picture, &bench.settings);
        let others = self.sweep.others.iter().map(other).collect::<Result<_>>()?;
        let mut table = Table { others, ..self.table(&judge.judge(&m.records)?, &m, &reference, states, &found) };
        if self.is_smaller() {
            table.asked = Some(self.at_size(&table, f64::from(budget_s) - m.pace.took_s())?);
            table.took_s = m.pace.took_s();
        }
        Ok(table)
    }

    /// Whether the budget ends the run.
    fn ends(&self) -> bool {
        self.sweep.limit_s().is_finite()
    }

    /// Samples that the reference should have. A later run improves a reference that has those of the pilot and is
    /// still noisy. That is decided before it draws samples, and by their variance, not by what they show.
    fn wanted(&self, reference: &Reference) -> u32 {
        let enough = reference.samples < self.pilot.wanted || reference.converged || reference.lacks_bands();
        if enough { self.pilot.wanted } else { AGAIN * reference.samples }
    }

    /// Seconds to reserve for more rounds of the reference, of which `known_ms` milliseconds are from earlier runs.
    fn reserved_s(&self, refined: &Refined, wanted: u32, known_ms: f64) -> f64 {
        if !self.ends() {
            return 0.0;
        }
        let share = REFERENCE_SHARE * self.sweep.limit_s() - (refined.gpu_ms() - known_ms) / 1e3;
        let missing = f64::from(wanted.saturating_sub(refined.samples())) * refined.each_ms() / 1e3;
        // Time that is too short for a round is left to pictures.
        let round = f64::from(LEAST_SAMPLES) * refined.each_ms() / 1e3;
        Some(share.min(missing)).filter(|seconds| *seconds >= round).unwrap_or(0.0)
    }

    /// Whether fewer pixels are measured than requested.
    fn is_smaller(&self) -> bool {
        self.bench.settings.size != self.sweep.bench.settings.size
    }

    /// The reference of an interrupted or earlier run.
    fn known(&self, begun: Option<Refined>) -> Option<Refined> {
        // A reference that cannot be read is drawn again.
        let kept = || Some(Refined::read(&(self.sweep.kept)(self.command)?).ok()??.0);
        // More bands of wavelengths than an earlier budget had time for begin anew.
        let has_bands = |known: &Refined| known.knobs().colour.bands() >= self.pilot.knobs.colour.bands();
        begun.or_else(|| if self.ends() { kept().filter(has_bands) } else { None })
    }

    /// The first round of a reference.
    fn first_round(&self, pace: &Pace<'_>, listener: &mut Listener<'_>) -> Result<Refined> {
        let SweepExtent { budget_s, reference_samples, .. } = self.sweep.extent;
        let (budget_s, pilot) = (f64::from(budget_s), &self.pilot);
        let samples = match reference_samples {
            Some(samples) => samples,
            None => {
                let least_s = pace.took_s() + f64::from(LEAST_SAMPLES) * pilot.each_ms / 1e3;
                let enough_s = (4.0 * least_s).max(20.0).ceil() as u32;
                ensure!(least_s < budget_s, NotMeasured { budget_s, least_s, enough_s });
                samples_within(pilot.each_ms, FIRST_SHARE * budget_s * 1e3)
                    .min(pilot.wanted.next_power_of_two().max(LEAST_SAMPLES))
            }
        };
        // Round up to a rung: rungs are powers of four.
        let samples = if samples.trailing_zeros() % 2 == 1 { 2 * samples } else { samples };
        let left_s = |at: &Progress| f64::from(at.of - at.done) * pilot.each_ms / 1e3 + (1.0 - FIRST_SHARE) * budget_s;
        Refined::round(None, &self.bench, &pilot.knobs, samples, &mut |at| {
            let (done, of, left_s) = (at.done as usize, at.of as usize, left_s(&at));
            (listener.step)(Step { name: "reference", done, of, left_s });
        })
    }

    /// Draws more rounds of the reference, for at most `seconds` seconds; none if the samples are given.
    fn more(
        &self,
        refined: Refined,
        pace: &Pace<'_>,
        wanted: u32,
        seconds: f64,
        listener: &mut Listener<'_>,
    ) -> Result<Refined> {
        if !self.ends() {
            return Ok(refined);
        }
        let begun = Instant::now();
        let left = || pace.left_s().min(seconds - begun.elapsed().as_secs_f64());
        refine(refined, &self.bench, wanted, &left, &mut |at: Progress| {
            let (done, of, left_s) = (at.done as usize, at.of as usize, pace.all_left_s());
            (listener.step)(Step { name: "reference", done, of, left_s });
        })
    }

    /// The reference picture and its facts; writes both.
    fn describe(&self, refined: &Refined, priced: u32) -> Result<(Truth, Reference)> {
        let truth = refined.truth(&self.bench.settings.view_transform());
        let (reference, png) = refined.describe(&truth, self.command, priced, &self.bench)?;
        refined.write(self.sweep.folder, &reference, &png)?;
        file::write(&self.sweep.folder.join("pictures/reference.png"), &png)?;
        Ok((truth, reference))
    }

    /// Adds the coming pictures to the clock, in the order in which they are drawn.
    fn expect(&self, m: &mut Measuring<'_>, agenda: &Agenda, exact_first: bool) {
        let pilot = &self.pilot;
        let (local, plain) = (&agenda.local, &agenda.plain);
        let drawn = m.records.last().map_or(0.0, |record| Interval::of(&record.ms).median);
        let pace = &mut m.pace;
        pace.forecast.enough_ms = m.enough_ms;
        pace.forecast.path_ms = pilot.plain_ms;
        pace.forecast.start_s = m.records.last().map_or(0.0, |record| record.start_ms / 1e3);
        pace.forecast.raster_ms = drawn / f64::from(local.samples.count());
        let mut expect = |knobs: &Knobs, base: &Knobs| pace.forecast.expect(knobs, base);
        let of_exact = |expect: &mut dyn FnMut(&Knobs, &Knobs)| {
            expect(plain, plain);
            agenda.of_exact.iter().for_each(|task| expect(&task.knobs, plain));
        };
        agenda.presets.iter().for_each(|task| expect(&task.knobs, local));
        if exact_first {
            of_exact(&mut expect);
        }
        agenda.of_local.iter().for_each(|task| expect(&task.knobs, local));
        (0..PICTURES - 1).for_each(|_| expect(local, local));
        agenda.ladder.iter().for_each(|task| expect(&task.knobs, local));
        if !exact_first {
            of_exact(&mut expect);
        }
        let with_orders = agenda.orders && self.sweep.extent.shard[0] == 1;
        (0..if with_orders { orders::PICTURES } else { 0 }).for_each(|_| expect(local, local));
        expect(plain, local);
        let count = [agenda.presets.len(), agenda.of_local.len(), agenda.of_exact.len(), agenda.ladder.len()];
        pace.expects(1 + count.iter().sum::<usize>() + PICTURES + if with_orders { orders::PICTURES } else { 0 });
    }

    /// Draws every change relative to `exact`.
    fn prices_of_exact(&self, m: &mut Measuring<'_>, agenda: &Agenda, listener: &mut Listener<'_>) -> Result<()> {
        let next = m.pace.forecast.next();
        if m.pace.too_late(next) {
            m.pace.forecast.skip(1);
            m.pace.leave_out(agenda.of_exact.len());
            return Ok(());
        }
        let mut exact = m.base(&base_task("exact", Family::Exact, &agenda.plain), listener.step)?;
        for task in &agenda.of_exact {
            m.picture(task, &mut exact, listener.step)?;
        }
        Ok(())
    }

    /// Measures the orders of the quadrature rules; in a sharded run the first shard draws them.
    fn orders(
        &self,
        m: &mut Measuring<'_>,
        agenda: &Agenda,
        found: &mut Found,
        listener: &mut Listener<'_>,
    ) -> Result<()> {
        if !agenda.orders || self.sweep.extent.shard[0] != 1 {
            return Ok(());
        }
        let path = self.sweep.folder.join("orders.json");
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
            Err(error) => {
                m.warnings.push(format!("the orders of quadrature cannot be measured on this device: {error:#}"))
            }
        }
        Ok(())
    }

    /// Times of the recommended settings at the requested size: measured if there are seconds left, else extrapolated.
    fn at_size(&self, table: &Table, mut left_s: f64) -> Result<RequestedSize> {
        let asked = self.sweep.bench.settings.size;
        let begun = Instant::now();
        // How times grow with pixels is measured if that fits into the seconds left.
        let growth = match left_s > GROWTH_S + GROWTH_SAMPLES * self.pilot.plain_ms / 1e3 {
            true => Growth::of(&self.bench, asked, &[Knobs::of(Model::Local)])?,
            false => Growth::by_pixels(&self.bench, asked),
        };
        left_s -= begun.elapsed().as_secs_f64();
        let begins = (self.sweep.command)(asked);
        let mut settings: Vec<AtSize> = Vec::new();
        for (place, Recommended { point, .. }) in table.recommended.iter().enumerate() {
            // Two of quick, balanced and exact may be the same point, which is timed once.
            if let Some(same) = table.recommended[..place].iter().position(|known| known.point == *point) {
                settings.push(settings[same].clone());
                continue;
            }
            // An extrapolated time, replaced by a measured one while seconds are left.
            let point = &table.points[*point];
            let command = point.command.replacen(self.command, &begins, 1);
            let mut at = AtSize { gpu_ms: growth.of_time(point), measured: false, command };
            let seconds = TWICE * at.gpu_ms.high / 1e3;
            if point.name != REFERENCE && seconds < left_s && !(self.sweep.stopped)() {
                let begun = Instant::now();
                let ms = self.sweep.bench.time(&mut self.sweep.bench.warm_up(&point.rungs()?)?)?;
                at = AtSize { gpu_ms: Interval { median: ms, low: ms, high: ms }, measured: true, ..at };
                left_s -= begun.elapsed().as_secs_f64();
            }
            settings.push(at);
        }
        Ok(RequestedSize { size: asked, settings })
    }

    fn table(
        &self,
        judged: &Judged,
        m: &Measuring<'_>,
        reference: &Reference,
        states: &States,
        found: &Found,
    ) -> Table {
        // Warnings about what limits the table as a whole: the device, the size, the reference.
        let mut warnings = Vec::new();
        if self.bench.device.info().kind == "cpu" {
            warnings.push("software device: GPU times depend on this CPU and on its other load".to_owned());
        }
        if judged.points.iter().all(|point| point.gpu_ms.high == 0.0) {
            warnings.push("this device has no timestamps: errors are measured, times are not".to_owned());
        }
        if self.is_smaller() {
            let ([w, h], [x, y]) = (self.sweep.bench.settings.size, self.bench.settings.size);
            warnings.push(format!(
                "the budget is too small for pictures of {w}x{h}: everything is measured at {x}x{y}, and only the recommended settings are \
                 also timed at {w}x{h}; a larger --budget measures everything there"
            ));
        }
        warnings.extend(m.warnings.iter().cloned());
        if !reference.converged {
            let [lacks, remedy] = reference.shortcoming(!self.ends());
            warnings.push(format!(
                "errors below {:.2} % are not significant: the reference {lacks} after {} samples (target {:.1} %); {remedy}",
                100.0 * reference.resolution,
                reference.samples,
                100.0 * RESOLVED
            ));
        }
        warnings.extend(m.pace.warning());
        Table {
            schema: "etalon.cost/1".to_owned(),
            program: env!("CARGO_PKG_VERSION").to_owned(),
            device: self.sweep.device(),
            scene: self.sweep.scene.to_owned(),
            command: self.command.to_owned(),
            size: self.bench.film_size(),
            asked: None,
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
            shard: self.sweep.extent.shard,
            seed: self.bench.settings.seed,
            reference_samples: self.sweep.extent.reference_samples,
            budget_s: f64::from(self.sweep.extent.budget_s),
            took_s: m.pace.took_s(),
        }
    }
}

/// Warning about a reference with bands of wavelengths, whose pictures are priced in RGB.
fn few_bands(reference: &Reference, rungs: &Knobs) -> Option<String> {
    let off = match reference.off_by_bands {
        0.0 => String::new(),
        off => format!(", which leaves it off by {:.2} % of the range, as far as rays tell", 100.0 * off),
    };
    (rungs.colour.bands() > 0).then(|| {
        format!(
            "the reference has {} of at most {} bands of wavelengths{off}; knobs other than colour are measured in RGB",
            rungs.colour.bands(),
            BANDS[0]
        )
    })
}

fn base_task(name: &str, family: Family, knobs: &Knobs) -> Task {
    Task { name: name.to_owned(), family, knobs: knobs.clone(), change: None }
}
