//! The lecture's statements that rungs and equations name by their ids, from docs/lecture.md.

const LECTURE: &str = include_str!("../docs/lecture.md");

/// What the lecture says under an id such as `R5`; `None` for an id that it does not have.
#[must_use]
pub fn statement(id: &str) -> Option<&'static str> {
    let rows = LECTURE.lines().filter_map(|line| line.strip_prefix("| ")?.split_once(" | "));
    rows.into_iter().find(|(known, _)| *known == id).map(|(_, rest)| rest.split(" | ").next().unwrap_or(rest))
}
