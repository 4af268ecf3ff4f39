//! libFuzzer on `linesman_fuzz::capture`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| linesman_fuzz::capture(data));
