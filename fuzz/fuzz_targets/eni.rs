//! libFuzzer on `linesman_fuzz::eni`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| linesman_fuzz::eni(data));
