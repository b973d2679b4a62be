//! Mesh files: the shape `ply`.
#![no_main]

libfuzzer_sys::fuzz_target!(|content: &[u8]| {
    let _ = relt::load::mesh("ply", content);
});
