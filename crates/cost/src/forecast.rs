//! How long the rest of a run takes: what each picture is expected to, scaled by how right that was so far.

use std::collections::VecDeque;

use super::warm::turns;
use etalon::plan::Knobs;
use etalon::plan::rungs::{Indirect, Reflection, Refraction, Shadows};

/// Seconds for what is done once for each picture, at least: uploading, compiling, comparing, writing.
const ONCE_S: f64 = 0.4;

/// What is still to be drawn.
#[derive(Debug, Default)]
pub struct Forecast {
    /// Milliseconds of a sample along paths, in three colours or in one band.
    pub path_ms: f64,
    /// Of a sample of the preset `local`.
    pub raster_ms: f64,
    /// Seconds that uploading and compiling the preset `local` took.
    pub start_s: f64,
    /// Pictures are timed again until they took so long.
    pub enough_ms: f64,
    /// Seconds of each picture to come, in order.
    coming: VecDeque<f64>,
    /// Seconds that were expected of those that were drawn, and that they took.
    was: [f64; 2],
}

fn by_rays(knobs: &Knobs) -> bool {
    knobs.shadows == Shadows::Ray || knobs.reflection == Reflection::Ray || knobs.refraction == Refraction::Ray
}

impl Forecast {
    fn picture_ms(&self, knobs: &Knobs) -> f64 {
        let sample = match (knobs.indirect, by_rays(knobs)) {
            (Indirect::Path, _) => self.path_ms,
            (_, true) => 2.0 * self.raster_ms,
            (_, false) => self.raster_ms,
        };
        sample * f64::from(knobs.samples.count()) * f64::from(knobs.colour.bands().max(1))
    }

    /// A picture to come, drawn in turns with another.
    pub fn expect(&mut self, knobs: &Knobs, base: &Knobs) {
        let ms = self.picture_ms(knobs);
        let warm = ms * 2.0_f64.min(f64::from(knobs.samples.count())) / f64::from(knobs.samples.count());
        let all = warm + turns(ms, self.enough_ms) as f64 * (ms + self.picture_ms(base));
        // Rungs are programs of their own, and those that send rays are longer ones.
        let programs = if by_rays(knobs) { 2.0 } else { 1.0 };
        self.coming.push_back(ONCE_S.max(programs * self.start_s) + all / 1e3);
    }

    /// The next one begins: its expected seconds. It, and what comes after it, are `left`.
    pub fn begin(&mut self) -> f64 {
        self.coming.pop_front().unwrap_or(ONCE_S)
    }

    /// The expected seconds of the next one.
    #[must_use]
    pub fn next(&self) -> f64 {
        self.coming.front().copied().unwrap_or(ONCE_S)
    }

    /// So many are not drawn.
    pub fn skip(&mut self, count: usize) {
        self.coming.drain(..count.min(self.coming.len()));
    }

    /// One is there.
    pub fn took(&mut self, expected: f64, seconds: f64) {
        self.was = [self.was[0] + expected, self.was[1] + seconds];
    }

    /// Seconds left.
    #[must_use]
    pub fn left(&self) -> f64 {
        self.as_it_went(self.coming.iter().sum())
    }

    /// What was expected, by what it turned out to be so far. One picture says little: the first ten seconds are taken as they were
    /// expected.
    #[must_use]
    pub fn as_it_went(&self, seconds: f64) -> f64 {
        let [expected, took] = self.was;
        seconds * (10.0 + took) / (10.0 + expected)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use etalon::plan::Model;

    #[test]
    fn what_took_twice_as_long_goes_on_to() {
        let mut forecast = Forecast { path_ms: 100.0, raster_ms: 10.0, enough_ms: 1000.0, ..Forecast::default() };
        let (local, exact) = (Knobs::of(Model::Local), Knobs::exact());
        (0..10).for_each(|_| forecast.expect(&local, &local));
        forecast.expect(&exact, &exact);
        // 64 samples in 32 bands: one picture that is drawn once, and its base.
        let exact_s = 100.0 * 64.0 * 32.0 * (2.0 + 2.0 / 64.0) / 1e3 + ONCE_S;
        let local_s = (10.0 * 2.0 + 7.0 * 80.0) / 1e3 + ONCE_S;
        assert!((forecast.left() - 10.0 * local_s - exact_s).abs() < 1e-9, "{}", forecast.left());
        let begun = forecast.begin();
        assert!((begun - local_s).abs() < 1e-9, "{begun}");
        forecast.took(1000.0, 2000.0);
        forecast.skip(9);
        assert!((forecast.left() / exact_s - 2.0).abs() < 0.02, "{}", forecast.left());
    }
}
