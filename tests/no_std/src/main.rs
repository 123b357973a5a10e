//! An example of an embedded program: a controller that renders a spring without an operating
//! system layer. It uses no standard library, no allocator and no C library.
//!
//! ```text
//! .ci/no_std.sh                                    # builds it, runs it, looks for an allocator
//! cd tests/no_std && cargo run --release; echo $?  # only runs it: 0 if every result is right
//! ```
//!
//! Read `rig.rs`: it contains what firmware or a small computer would have, apart from the motor
//! controllers' end of the line. It states a rig and a scene and then runs ticks: a reading in,
//! [`hbot_core::Controller::tick`], a command out as a frame of hbot-link. `memory.rs` and the
//! entry point below exist only because this program has no C library. On a microcontroller a
//! runtime such as cortex-m-rt provides both.
//!
//! The exit code is the number of the first wrong result (see [`rig::run`]), or 101 after a panic.
#![no_std]
#![no_main]

#[cfg(feature = "heap")]
mod heap;
mod memory;
mod rig;

use core::arch::{asm, naked_asm};

/// The entry point. The kernel jumps here with the stack pointer aligned to 16 bytes.
///
/// # Safety
/// Only the kernel calls it.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn _start() -> ! {
    // A call pushes 8 bytes, which the calling convention expects at the entry of a function.
    naked_asm!("xor ebp, ebp", "call {main}", "ud2", main = sym main)
}

extern "C" fn main() -> ! {
    #[cfg(feature = "heap")]
    heap::allocate_once();
    exit(rig::run().err().unwrap_or(0))
}

fn exit(code: i32) -> ! {
    // SAFETY: exit_group (231) takes a number and does not return.
    unsafe { asm!("syscall", in("rax") 231, in("rdi") code, options(noreturn, nostack)) }
}

/// A symbol that would be needed to unwind the stack. The precompiled core library refers to it.
/// With panic = "abort" it is never called.
#[unsafe(no_mangle)]
extern "C" fn rust_eh_personality() {}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    exit(101)
}
