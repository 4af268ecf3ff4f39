//! libFuzzer on `linesman_fuzz::pasted`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| linesman_fuzz::pasted(data));
