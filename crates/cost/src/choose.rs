//! Chooses a point of a measured table for a time or error budget.

use super::table::{Point, REFERENCE, Table};

/// Safety factor for times: the scatter of the median of three times of one picture.
pub const SPARE: f64 = 1.05;

/// Points whose median GPU time is at most `ms` divided by [`SPARE`], sorted by error. The caller times the chosen
/// point again, because the machine may be slower than when the table was measured.
#[must_use]
pub fn within(table: &Table, ms: f64) -> Vec<&Point> {
    let fits = |point: &&Point| point.gpu_ms.median * SPARE <= ms;
    let mut all: Vec<&Point> = drawn(table).filter(fits).collect();
    all.sort_by(|a, b| a.error().total_cmp(&b.error()).then(a.gpu_ms.median.total_cmp(&b.gpu_ms.median)));
    all
}

/// The fastest point whose error is at most `error`, judged by the upper end of its confidence interval.
#[must_use]
pub fn at_most(table: &Table, error: f64) -> Option<&Point> {
    let fits = |point: &&Point| point.errors.error.high <= error;
    drawn(table).filter(fits).min_by(|a, b| a.gpu_ms.median.total_cmp(&b.gpu_ms.median))
}

/// The fastest point.
#[must_use]
pub fn quickest(table: &Table) -> Option<&Point> {
    drawn(table).min_by(|a, b| a.gpu_ms.median.total_cmp(&b.gpu_ms.median))
}

/// The point with the least error, judged by the upper end of its confidence interval.
#[must_use]
pub fn most_exact(table: &Table) -> Option<&Point> {
    drawn(table).min_by(|a, b| a.errors.error.high.total_cmp(&b.errors.error.high))
}

/// All points except the reference, which may be the mean of many pictures.
fn drawn(table: &Table) -> impl Iterator<Item = &Point> {
    table.points.iter().filter(|point| point.name != REFERENCE)
}
