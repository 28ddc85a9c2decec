//! Rungs for a budget, out of a table that was measured before.

use super::table::{Point, REFERENCE, Table};

/// What the middle of three times of one picture scatters by.
pub const SPARE: f64 = 1.05;

/// Points that take no longer than so many milliseconds of GPU time, with some to spare: the least error first. The middle of their
/// times counts: who chooses one draws it to see whether the machine is as quick as it was.
#[must_use]
pub fn within(table: &Table, ms: f64) -> Vec<&Point> {
    let fits = |point: &&Point| point.gpu_ms.median * SPARE <= ms;
    let mut all: Vec<&Point> = drawn(table).filter(fits).collect();
    all.sort_by(|a, b| a.error().total_cmp(&b.error()).then(a.gpu_ms.median.total_cmp(&b.gpu_ms.median)));
    all
}

/// The quickest point whose error is no more than this, as far as the reference's noise tells: the upper end of its interval.
#[must_use]
pub fn at_most(table: &Table, error: f64) -> Option<&Point> {
    let fits = |point: &&Point| point.errors.error.high <= error;
    drawn(table).filter(fits).min_by(|a, b| a.gpu_ms.median.total_cmp(&b.gpu_ms.median))
}

/// The quickest of all.
#[must_use]
pub fn quickest(table: &Table) -> Option<&Point> {
    drawn(table).min_by(|a, b| a.gpu_ms.median.total_cmp(&b.gpu_ms.median))
}

/// The one with the least error.
#[must_use]
pub fn most_exact(table: &Table) -> Option<&Point> {
    drawn(table).min_by(|a, b| a.errors.error.high.total_cmp(&b.errors.error.high))
}

/// The reference is what others are held against, and may be of many pictures.
fn drawn(table: &Table) -> impl Iterator<Item = &Point> {
    table.points.iter().filter(|point| point.name != REFERENCE)
}
