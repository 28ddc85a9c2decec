//! Clock of a run: progress, remaining time, and the decision which pictures the time budget leaves out.

use std::time::Instant;

use super::forecast::Forecast;

/// Progress of a run.
pub struct Step<'a> {
    /// Name of the picture that is drawn now.
    pub name: &'a str,
    /// Number of pictures done.
    pub done: usize,
    /// Number of all pictures.
    pub of: usize,
    /// Estimated seconds left.
    pub left_s: f64,
}

/// Initial estimate of the seconds to evaluate a picture and show it in the report.
const JUDGED_S: f64 = 0.05;

/// Clock of a run.
pub struct Pace<'a> {
    start: Instant,
    budget_s: f64,
    /// Whether pictures beyond the budget are left out.
    ends: bool,
    /// Whether the user asked to stop the run.
    stopped: &'a dyn Fn() -> bool,
    /// Estimated seconds to evaluate a picture and show it in the report.
    judged_s: f64,
    /// Seconds reserved for the reference.
    pub reserved_s: f64,
    /// Seconds reserved for work after all pictures are drawn.
    pub after_s: f64,
    /// Estimated times of the coming pictures.
    pub forecast: Forecast,
    done: usize,
    of: usize,
    left_out: usize,
    left_out_s: f64,
}

impl<'a> Pace<'a> {
    /// Starts the clock.
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

    /// Seconds since the start.
    #[must_use]
    pub fn took_s(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Seconds that the budget leaves for drawing, without the time to evaluate and show the drawn pictures.
    #[must_use]
    pub fn left_s(&self) -> f64 {
        let after = self.judging_s() + self.after_s;
        if (self.stopped)() { 0.0 } else { self.budget_s - after - self.took_s() }
    }

    /// Estimated seconds to evaluate and show all drawn pictures once.
    #[must_use]
    pub fn judging_s(&self) -> f64 {
        self.judged_s * self.done as f64
    }

    /// Estimated seconds of the next picture.
    #[must_use]
    pub fn next_s(&self) -> f64 {
        self.forecast.as_it_went(self.forecast.next())
    }

    /// Adds `count` coming pictures.
    pub fn expects(&mut self, count: usize) {
        self.of += count;
    }

    /// Records the seconds that evaluating and showing `pictures` pictures took.
    pub fn judged(&mut self, pictures: usize, seconds: f64) {
        self.judged_s = (1.2 * seconds / pictures.max(1) as f64).max(JUDGED_S);
    }

    /// Reports that the next picture begins, and returns its estimated seconds.
    pub fn tell(&mut self, name: &str, progress: &mut dyn FnMut(Step<'_>)) -> f64 {
        progress(Step { name, done: self.done, of: self.of.max(self.done + 1), left_s: self.until_end() });
        self.done += 1;
        self.forecast.begin()
    }

    /// Seconds until the end: the estimate for the coming pictures, limited by the budget.
    fn until_end(&self) -> f64 {
        let after = self.judged_s * self.of as f64;
        let rest = self.forecast.left() + after;
        if self.ends { rest.max(0.0).min((self.budget_s - self.took_s()).max(0.0)) } else { rest }
    }

    /// Seconds left of the budget, or of the estimate where the budget does not end the run.
    #[must_use]
    pub fn all_left_s(&self) -> f64 {
        if self.ends { (self.budget_s - self.took_s()).max(0.0) } else { self.forecast.left() }
    }

    /// Whether there is no time for a picture of so many estimated seconds; the picture is then counted as left out.
    pub fn too_late(&mut self, expected: f64) -> bool {
        self.too_long(self.forecast.as_it_went(expected))
    }

    /// The same for measured seconds.
    pub fn too_long(&mut self, seconds: f64) -> bool {
        let late = (self.stopped)() || self.ends && seconds + self.judged_s + self.reserved_s > self.left_s();
        if late {
            self.left_out += 1;
            self.left_out_s += seconds;
        }
        late
    }

    /// Whether there is time to evaluate all drawn pictures before the end, in addition to the evaluation at the end.
    #[must_use]
    pub fn can_judge(&self) -> bool {
        self.left_s() > self.judging_s()
    }

    /// Leaves out the next `count` pictures.
    pub fn leave_out(&mut self, count: usize) {
        for _ in 0..count {
            let expected = self.forecast.begin();
            self.left_out_s += self.forecast.as_it_went(expected);
        }
        self.left_out += count;
    }

    /// Removes `count` coming pictures that are not needed.
    pub fn skip(&mut self, count: usize) {
        self.of = self.of.saturating_sub(count);
        self.forecast.skip(count);
    }

    /// Number of the current picture, from 1.
    #[must_use]
    pub fn place(&self) -> usize {
        self.done
    }

    /// Warning about the pictures that were left out.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        if (self.stopped)() {
            return Some("the run was stopped before all pictures were drawn".to_owned());
        }
        (self.left_out > 0).then(|| {
            format!(
                "{} of {} pictures were not drawn because the budget of {:.0} s ended; --budget {:.0} should be enough for all of them",
                self.left_out,
                self.of,
                self.budget_s,
                self.budget_s + 1.2 * self.left_out_s
            )
        })
    }
}
