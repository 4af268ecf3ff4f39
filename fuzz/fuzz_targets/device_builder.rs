//! libFuzzer on `linesman_fuzz::device_builder`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| linesman_fuzz::device_builder(data));
