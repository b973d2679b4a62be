//! Picture files: PNG, JPEG, HDR and OpenEXR.
#![no_main]

libfuzzer_sys::fuzz_target!(|content: &[u8]| {
    let _ = relt::load::picture(content);
});
