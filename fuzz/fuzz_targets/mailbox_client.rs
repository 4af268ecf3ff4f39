//! libFuzzer on `linesman_fuzz::mailbox_client`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| linesman_fuzz::mailbox_client(data));
