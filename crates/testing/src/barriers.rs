//! The proof that barriers are needed: a validation that sees nothing would prove nothing of a frame that is clean.

use etalon::gpu::Frame;

use super::gpu::Gpu;

/// Validation's errors after a frame, with or without its buffer barriers.
fn errors_of<T>(
    forget: bool,
    make: impl Fn(&Gpu) -> T,
    describe: impl for<'a> Fn(&'a T, &'a Gpu) -> Frame<'a>,
) -> Vec<String> {
    let mut gpu = Gpu::alone();
    gpu.expects_errors = true;
    let things = make(&gpu);
    let mut frame = describe(&things, &gpu);
    if forget {
        frame.forget_barriers();
    }
    frame.finish().expect("a frame");
    gpu.errors()
}

/// Fails unless synchronization validation finds nothing in a frame with its derived barriers, and a hazard in the same frame
/// without them. `make` makes what the frame uses, `describe` the frame.
///
/// # Panics
/// Where it finds something else.
pub fn are_needed<T>(name: &str, make: impl Fn(&Gpu) -> T, describe: impl for<'a> Fn(&'a T, &'a Gpu) -> Frame<'a>) {
    let clean = errors_of(false, &make, &describe);
    assert!(clean.is_empty(), "{name}, with barriers: {clean:?}");
    let hazards = errors_of(true, &make, &describe);
    assert!(hazards.iter().any(|text| text.contains("SYNC-HAZARD")), "{name}, without barriers: {hazards:?}");
}
