//! Sends the hashes of what the control law computes on a recorded run, in f32 and in f64.
//!
//! ```text
//! .ci/same_bits.sh                            # on a microcontroller, on arm64 and on this machine
//! cd firmware/core-hash && cargo run --release  # only on this machine
//! ```
//!
//! It prints one line for each width: `f32 0x0123456789ABCDEF 0x0123456789ABCDEF`. The second hash
//! is of all outputs, also with a lead. The exit code is 0 if all hashes are those that
//! tests/core/same_bits of the main workspace expects, and 1 otherwise.
//!
//! With no operating system, the image is for a Cortex-M4F (QEMU's board mps2-an386). It prints by
//! semihosting.
#![cfg_attr(target_os = "none", no_std, no_main)]

/// The control law in f64.
#[path = "."]
mod double {
    pub(crate) use hbot_core as core;

    #[path = "hash.rs"]
    mod hash;
    #[path = "run.rs"]
    pub(crate) mod run;
}

/// The control law in f32.
#[path = "."]
mod single {
    pub(crate) use hbot_core_f32 as core;

    #[path = "hash.rs"]
    mod hash;
    #[path = "run.rs"]
    pub(crate) mod run;
}

#[cfg(target_os = "none")]
mod board;

/// Returns the hashes of each width, with its name and the hashes that are expected.
fn hashes() -> [(&'static str, [u64; 2], [u64; 2]); 2] {
    [("f32", single::run::hashes(), single::run::GOLDEN), ("f64", double::run::hashes(), double::run::GOLDEN)]
}

#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    let hashes = hashes();
    for (width, [first, all], _) in hashes {
        println!("{width} 0x{first:016X} 0x{all:016X}");
    }
    std::process::ExitCode::from(u8::from(hashes.iter().any(|(_, hash, golden)| hash != golden)))
}
