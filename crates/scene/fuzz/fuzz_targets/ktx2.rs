//! Any bytes as a KTX2 file of at most 256 by 256 texels. Panics of the transcoder become errors, so they do not end
//! the run.
#![no_main]

use etalon_scene::decompress::streams;

libfuzzer_sys::fuzz_target!(init: std::panic::set_hook(Box::new(|_| ())), |bytes: &[u8]| {
    let side = |at: usize| bytes.get(at..at + 4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
    if side(20).is_none_or(|width| width > 256) || side(24).is_none_or(|height| height > 256) {
        return;
    }
    let _ = streams::ktx2(bytes);
});
