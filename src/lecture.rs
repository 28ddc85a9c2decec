//! Statements of the lecture by their ids, from docs/lecture.md, and the functions that compute them, from
//! docs/verified.md; rungs and equations refer to the ids.

const LECTURE: &str = include_str!("../docs/lecture.md");
const VERIFIED: &str = include_str!("../docs/verified.md");

/// The rest of a table's row that begins with an id.
fn row(table: &'static str, id: &str) -> Option<&'static str> {
    let mut rows = table.lines().filter_map(|line| line.strip_prefix("| ")?.split_once(" | "));
    rows.find(|(known, _)| *known == id).map(|(_, rest)| rest)
}

/// The lecture's statement with an id such as `R5`; `None` for an unknown id.
#[must_use]
pub fn statement(id: &str) -> Option<&'static str> {
    row(LECTURE, id).map(|rest| rest.split(" | ").next().unwrap_or(rest))
}

/// Names of the functions that compute a statement, as in docs/equations.md; empty where it is no formula.
#[must_use]
pub fn functions(id: &str) -> Vec<&'static str> {
    let cell = row(VERIFIED, id).and_then(|rest| rest.split(" | ").next()).unwrap_or_default();
    cell.split('`').skip(1).step_by(2).collect()
}
