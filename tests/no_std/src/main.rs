//! A rig of one spring, in a program with nothing underneath: no standard library, no allocator, no C library.
//!
//! Half a second of ticks goes through the frames of the serial line in both directions. Exits with 0 where every
//! result is right, with the number of the first that is not (see [`rig::run`]), or with 101 from a panic.
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
