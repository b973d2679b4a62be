//! Mesh files: the shape `serialized`.
#![no_main]

libfuzzer_sys::fuzz_target!(|content: &[u8]| {
    let _ = relt::load::mesh("serialized", content);
});
