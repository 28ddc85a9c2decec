//! Any bytes as a Draco mesh.
#![no_main]

use etalon_scene::decompress::streams;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = streams::draco(bytes, 16 << 20);
});
