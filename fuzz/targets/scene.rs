//! Scene files, Mitsuba 3's XML; the files that they name are not there.
#![no_main]

use std::path::Path;

libfuzzer_sys::fuzz_target!(|content: &[u8]| {
    let Ok(text) = String::from_utf8(content.to_vec()) else { return };
    let _ = relt::load::text(Path::new("fuzz/scene.xml"), text);
});
