//! Any bytes as a meshopt stream: the first four say mode, filter, stride and count.
#![no_main]

use etalon_scene::decompress::streams;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let [mode, filter, stride, count, stream @ ..] = bytes else { return };
    let mode = ["ATTRIBUTES", "TRIANGLES", "INDICES"][usize::from(*mode) % 3];
    let filter = ["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"][usize::from(*filter) % 5];
    let _ = streams::meshopt(mode, filter, 3 * usize::from(*count), 1 + usize::from(*stride), stream);
});
