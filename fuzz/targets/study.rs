//! Study files; options of methods are taken for granted.
#![no_main]

mod support;

libfuzzer_sys::fuzz_target!(|content: &[u8]| {
    let path = support::file("study.toml", content);
    let _ = relt::study::file::read(&path, &|_| Ok(relt::render::Settings::default()));
});
