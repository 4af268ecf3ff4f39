//! libFuzzer on `linesman_fuzz::project`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| linesman_fuzz::project(data));
