//! Test that pipeline barriers are necessary: validation must report a hazard without them, or a clean report proves
//! nothing.
//!
//! Read the Vulkan specification, chapter "Synchronization and Cache Control".

use etalon::gpu::Frame;

use super::gpu::Gpu;

/// Validation errors of a frame, with or without its buffer barriers.
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

/// Asserts that synchronization validation reports no hazard in a frame with its derived barriers, and reports one in
/// the same frame without them. `make` creates the resources, and `describe` the frame. It proves nothing on a GPU,
/// where every pass that has not been timed yet is a submission of its own, and says so.
///
/// # Panics
/// Validation reports otherwise.
pub fn are_needed<T>(name: &str, make: impl Fn(&Gpu) -> T, describe: impl for<'a> Fn(&'a T, &'a Gpu) -> Frame<'a>) {
    let clean = errors_of(false, &make, &describe);
    assert!(clean.is_empty(), "{name}, with barriers: {clean:?}");
    if !Gpu::alone().device.is_software() {
        eprintln!("{name}: not proven, the passes are submissions of their own");
        return;
    }
    let hazards = errors_of(true, &make, &describe);
    assert!(hazards.iter().any(|text| text.contains("SYNC-HAZARD")), "{name}, without barriers: {hazards:?}");
}
