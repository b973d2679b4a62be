//! Scene files of pbrt, to be converted.
#![no_main]

mod support;

libfuzzer_sys::fuzz_target!(|content: &[u8]| support::converted("in.pbrt", content));
