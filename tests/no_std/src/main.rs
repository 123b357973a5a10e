//! The example of an embedded program: a controller that renders a spring, with nothing underneath. No standard library, no
//! allocator, no C library.
//!
//! ```text
//! .ci/no_std.sh                                    # builds it, runs it, and searches it for an allocator
//! cd tests/no_std && cargo run --release; echo $?  # runs it alone: 0 if every result is right
//! ```
//!
//! Read `rig.rs`: what stands there is what firmware or a small computer would have, apart from its end of the line. It states a
//! rig and a scene, then ticks: a reading in, [`hbot_core::Controller::tick`], a command out as a frame of hbot-link.
//! `memory.rs` and the start below are only there because this program has no C library; on a microcontroller a runtime such
//! as cortex-m-rt has both.
//!
//! It exits with the number of the first result that is wrong (see [`rig::run`]), or with 101 from a panic.
#![no_std]
#![no_main]

#[cfg(feature = "heap")]
mod heap;
mod memory;
mod rig;

use core::arch::{asm, naked_asm};

/// The first instruction: the kernel jumps here with the stack pointer aligned to 16 bytes.
///
/// # Safety
/// Called by the kernel alone.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn _start() -> ! {
    // A call pushes 8 bytes, which is what the calling convention expects of a function's entry.
    naked_asm!("xor ebp, ebp", "call {main}", "ud2", main = sym main)
}

extern "C" fn main() -> ! {
    #[cfg(feature = "heap")]
    heap::allocate_once();
    exit(rig::run().err().unwrap_or(0))
}

fn exit(code: i32) -> ! {
    // SAFETY: exit_group (231) takes a number and does not come back.
    unsafe { asm!("syscall", in("rax") 231, in("rdi") code, options(noreturn, nostack)) }
}

/// What would unwind a frame. The core library, which comes compiled, names it; with panic = "abort" nobody calls it.
#[unsafe(no_mangle)]
extern "C" fn rust_eh_personality() {}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    exit(101)
}
