//! Errors of device results in units in the last place (ulp).

pub use etalon::optics::catalogue::ulp;

/// Distance of `got` from the exact `want`, in units in the last place of f32 at `want`; infinite if `got` is NaN.
///
/// ```
/// use etalon_testing::ulp::ulps;
/// assert_eq!(ulps(1.0, 1.0), 0.0);
/// assert_eq!(ulps(1.0_f32.next_up(), 1.0), 1.0);
/// assert!(ulps(0.1, 0.1) < 0.5); // what rounding 0.1 to f32 costs
/// ```
#[must_use]
pub fn ulps(got: f32, want: f64) -> f64 {
    let apart = (f64::from(got) - want).abs() / ulp(want);
    if apart.is_nan() { f64::INFINITY } else { apart }
}

/// Asserts that `got` is within `most` units in the last place of the exact `want`.
///
/// # Panics
/// The distance is larger.
#[track_caller]
pub fn assert_ulps(what: &str, got: f32, want: f64, most: f64) {
    let apart = ulps(got, want);
    assert!(apart <= most, "{what}: {got:e} for {want:e} is {apart:.2} ulp off, {most} are allowed");
}
