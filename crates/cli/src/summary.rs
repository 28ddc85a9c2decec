//! The last line of `etalon render`: what was drawn, how long it took, how large its error is, and what lit it.

use std::time::Duration;

use etalon::frame::Rendered;

/// The sentence about a finished picture of `size` pixels.
pub(super) fn sentence([width, height]: [u32; 2], rendered: &Rendered, took: Duration, lit: &str) -> String {
    let samples = if rendered.samples == 1 { "1 sample".to_owned() } else { format!("{} samples", rendered.samples) };
    let error = rendered
        .errors
        .last()
        .map_or(String::new(), |error| format!(", estimated error {:.1} %", 100.0 * error.relmse.sqrt()));
    format!("{width}x{height}, {samples} per pixel, {:.1} s{error}, {lit}", took.as_secs_f64())
}
