//! Statements of the lecture by their ids, from docs/lecture.md; rungs and equations refer to the ids.

const LECTURE: &str = include_str!("../docs/lecture.md");

/// The lecture's statement with an id such as `R5`; `None` for an unknown id.
#[must_use]
pub fn statement(id: &str) -> Option<&'static str> {
    let rows = LECTURE.lines().filter_map(|line| line.strip_prefix("| ")?.split_once(" | "));
    rows.into_iter().find(|(known, _)| *known == id).map(|(_, rest)| rest.split(" | ").next().unwrap_or(rest))
}
