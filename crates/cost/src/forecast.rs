//! Predicts the remaining time of a run: the sum of estimated picture times, corrected by the ratio of measured to
//! estimated time so far.

use std::collections::VecDeque;

use super::warm::turns;
use etalon::plan::Knobs;
use etalon::plan::rungs::{Indirect, Reflection, Refraction, Shadows};

/// Least seconds of fixed work per picture: uploading, compiling, comparing, writing.
const ONCE_S: f64 = 0.4;

/// Estimated times of the pictures that are still to be drawn.
#[derive(Debug, Default)]
pub struct Forecast {
    /// Milliseconds of a path-traced sample, in RGB or in one band.
    pub path_ms: f64,
    /// Milliseconds of a sample of the preset `local`.
    pub raster_ms: f64,
    /// Seconds of uploading and compiling the preset `local`.
    pub start_s: f64,
    /// Total milliseconds after which a picture is not timed again.
    pub enough_ms: f64,
    /// Estimated seconds of each coming picture, in order.
    coming: VecDeque<f64>,
    /// Estimated and measured seconds of the pictures drawn so far.
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

    /// Adds a coming picture, which is timed interleaved with its base.
    pub fn expect(&mut self, knobs: &Knobs, base: &Knobs) {
        let ms = self.picture_ms(knobs);
        let warm = ms * 2.0_f64.min(f64::from(knobs.samples.count())) / f64::from(knobs.samples.count());
        let all = warm + turns(ms, self.enough_ms) as f64 * (ms + self.picture_ms(base));
        // Each rung compiles its own programs; those that trace rays are longer.
        let programs = if by_rays(knobs) { 2.0 } else { 1.0 };
        self.coming.push_back(ONCE_S.max(programs * self.start_s) + all / 1e3);
    }

    /// Removes the next picture and returns its estimated seconds.
    pub fn begin(&mut self) -> f64 {
        self.coming.pop_front().unwrap_or(ONCE_S)
    }

    /// Estimated seconds of the next picture.
    #[must_use]
    pub fn next(&self) -> f64 {
        self.coming.front().copied().unwrap_or(ONCE_S)
    }

    /// Removes the next `count` pictures, which are not drawn.
    pub fn skip(&mut self, count: usize) {
        self.coming.drain(..count.min(self.coming.len()));
    }

    /// Records the estimated and the measured seconds of a drawn picture.
    pub fn took(&mut self, expected: f64, seconds: f64) {
        self.was = [self.was[0] + expected, self.was[1] + seconds];
    }

    /// Estimated seconds of all coming pictures, corrected.
    #[must_use]
    pub fn left(&self) -> f64 {
        self.as_it_went(self.coming.iter().sum())
    }

    /// Corrects an estimate by the ratio of measured to estimated time so far. Ten seconds of correct estimates are
    /// added as a prior, because one picture is little evidence.
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
        // 64 samples in 32 bands: the picture is drawn once, and its base once.
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
