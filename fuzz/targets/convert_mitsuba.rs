//! Scene files of older versions of Mitsuba, to be converted.
#![no_main]

mod support;

libfuzzer_sys::fuzz_target!(|content: &[u8]| support::converted("in.xml", content));
