#![no_main]

#[path = "../../tests/fuzz/harness.rs"]
#[allow(dead_code, reason = "each target drives one of its functions")]
mod harness;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| harness::odrive_messages(bytes));
