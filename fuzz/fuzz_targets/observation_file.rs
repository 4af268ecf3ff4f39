//! libFuzzer on `linesman_fuzz::observation_file`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| linesman_fuzz::observation_file(data));
