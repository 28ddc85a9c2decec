//! How far a run is, how long the rest takes, and what there is no time for.

use std::time::Instant;

use super::forecast::Forecast;

/// How far it is.
pub struct Step<'a> {
    /// What is drawn now.
    pub name: &'a str,
    /// Pictures done.
    pub done: usize,
    /// Of so many.
    pub of: usize,
    /// Seconds left, as far as what was drawn tells.
    pub left_s: f64,
}

/// Seconds that judging a picture and showing it take, before any was judged.
const JUDGED_S: f64 = 0.05;

/// A run's clock.
pub struct Pace<'a> {
    start: Instant,
    budget_s: f64,
    /// Whether what the budget has no time for is left out.
    ends: bool,
    /// Whether somebody asked the run to end.
    stopped: &'a dyn Fn() -> bool,
    /// Seconds that judging a picture and showing it take.
    judged_s: f64,
    /// Seconds that are not there for pictures, but for the reference.
    pub reserved_s: f64,
    /// Seconds for what comes after all of that is drawn.
    pub after_s: f64,
    /// What pictures are expected to take.
    pub forecast: Forecast,
    done: usize,
    of: usize,
    left_out: usize,
    left_out_s: f64,
}

impl<'a> Pace<'a> {
    /// It begins now.
    pub fn new(budget_s: f64, ends: bool, stopped: &'a dyn Fn() -> bool) -> Self {
        let forecast = Forecast::default();
        let (done, of, left_out, left_out_s, reserved_s) = (0, 0, 0, 0.0, 0.0);
        Self {
            start: Instant::now(),
            budget_s,
            ends,
            stopped,
            judged_s: JUDGED_S,
            reserved_s,
            after_s: 0.0,
            forecast,
            done,
            of,
            left_out,
            left_out_s,
        }
    }

    /// Seconds since it began.
    #[must_use]
    pub fn took_s(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Seconds that the budget leaves for drawing: judging and showing what was drawn comes after.
    #[must_use]
    pub fn left_s(&self) -> f64 {
        let after = self.judged_s * self.done as f64 + self.after_s;
        if (self.stopped)() { 0.0 } else { self.budget_s - after - self.took_s() }
    }

    /// So many pictures more are to come.
    pub fn expects(&mut self, count: usize) {
        self.of += count;
    }

    /// What judging and showing so many pictures took.
    pub fn judged(&mut self, pictures: usize, seconds: f64) {
        self.judged_s = (1.2 * seconds / pictures.max(1) as f64).max(JUDGED_S);
    }

    /// The next picture begins: the seconds that are expected of it.
    pub fn tell(&mut self, name: &str, progress: &mut dyn FnMut(Step<'_>)) -> f64 {
        progress(Step { name, done: self.done, of: self.of.max(self.done + 1), left_s: self.until_end() });
        self.done += 1;
        self.forecast.begin()
    }

    /// Seconds until the end: those of what is to come, or of the budget.
    fn until_end(&self) -> f64 {
        let after = self.judged_s * self.of as f64;
        let rest = self.forecast.left() + after;
        if self.ends { rest.max(0.0).min((self.budget_s - self.took_s()).max(0.0)) } else { rest }
    }

    /// The seconds that are left for all, where a budget ends the run.
    #[must_use]
    pub fn all_left_s(&self) -> f64 {
        if self.ends { (self.budget_s - self.took_s()).max(0.0) } else { self.forecast.left() }
    }

    /// Whether there is no time for a picture, which is then counted.
    pub fn too_late(&mut self, expected: f64) -> bool {
        let seconds = self.forecast.as_it_went(expected);
        let late = (self.stopped)() || self.ends && seconds + self.judged_s + self.reserved_s > self.left_s();
        if late {
            self.left_out += 1;
            self.left_out_s += seconds;
        }
        late
    }

    /// There is no time for the next so many either.
    pub fn leave_out(&mut self, count: usize) {
        for _ in 0..count {
            self.left_out_s += self.forecast.begin();
        }
        self.left_out += count;
    }

    /// So many that were expected are not needed.
    pub fn skip(&mut self, count: usize) {
        self.of = self.of.saturating_sub(count);
        self.forecast.skip(count);
    }

    /// Which picture this is, counted from 1.
    #[must_use]
    pub fn place(&self) -> usize {
        self.done
    }

    /// What a reader should know of what was left out.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        if (self.stopped)() {
            return Some("the run was ended before all of its pictures were drawn".to_owned());
        }
        (self.left_out > 0).then(|| {
            format!(
                "{} of {} pictures were not drawn, because the budget of {:.0} s ended: about --budget {:.0} would draw all of them",
                self.left_out,
                self.of,
                self.budget_s,
                self.budget_s + 1.2 * self.left_out_s
            )
        })
    }
}
