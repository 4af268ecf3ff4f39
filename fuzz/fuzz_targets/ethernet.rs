//! libFuzzer on `linesman_fuzz::ethernet`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| linesman_fuzz::ethernet(data));
