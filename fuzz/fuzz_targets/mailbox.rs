//! libFuzzer on `linesman_fuzz::mailbox`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| linesman_fuzz::mailbox(data));
