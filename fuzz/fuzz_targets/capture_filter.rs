//! libFuzzer on `linesman_fuzz::capture_filter`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| linesman_fuzz::capture_filter(data));
