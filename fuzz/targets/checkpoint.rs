//! Checkpoints; the checksum is put right, or hardly any input would get past it.
#![no_main]

mod support;

libfuzzer_sys::fuzz_target!(|content: &[u8]| {
    let sealed = [content, &crc32fast::hash(content).to_le_bytes()].concat();
    let path = support::file("checkpoint", &sealed);
    if let Ok(mut resumed) = relt::render::checkpoint::open_one(&path) {
        let _ = resumed.engine();
    }
});
