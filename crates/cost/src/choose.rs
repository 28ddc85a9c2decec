//! Rungs for a budget, out of a table that was measured before.

use super::table::{Point, Table};

/// What times of one picture scatter by, beside what was seen when it was measured.
const SPARE: f64 = 1.05;

/// The point with the least error of those that take no longer than so many milliseconds of GPU time, with some to spare.
#[must_use]
pub fn within(table: &Table, ms: f64) -> Option<&Point> {
    let fits = |point: &&Point| (point.gpu_ms.median * SPARE).max(point.gpu_ms.high) <= ms;
    table.points.iter().filter(fits).min_by(|a, b| a.error().total_cmp(&b.error()))
}

/// The quickest point whose FLIP against the reference is no more than this.
#[must_use]
pub fn at_most(table: &Table, error: f64) -> Option<&Point> {
    table
        .points
        .iter()
        .filter(|point| point.error() <= error)
        .min_by(|a, b| a.gpu_ms.median.total_cmp(&b.gpu_ms.median))
}

/// The quickest of all.
#[must_use]
pub fn quickest(table: &Table) -> Option<&Point> {
    table.points.iter().min_by(|a, b| a.gpu_ms.median.total_cmp(&b.gpu_ms.median))
}

/// The most exact of all.
#[must_use]
pub fn most_exact(table: &Table) -> Option<&Point> {
    table.points.iter().min_by(|a, b| a.error().total_cmp(&b.error()))
}
