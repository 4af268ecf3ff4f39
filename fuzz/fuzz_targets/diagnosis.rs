//! libFuzzer on `linesman_fuzz::diagnosis`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| linesman_fuzz::diagnosis(data));
