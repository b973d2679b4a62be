//! Mesh files: the shape `obj`.
#![no_main]

libfuzzer_sys::fuzz_target!(|content: &[u8]| {
    let _ = relt::load::mesh("obj", content);
});
