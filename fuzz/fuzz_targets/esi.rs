//! libFuzzer on `linesman_fuzz::esi`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| linesman_fuzz::esi(data));
