//! What the compiler calls to copy, fill and compare memory, and the C library would have.
//!
//! The string instructions of the processor, since a loop in Rust might be compiled into a call of itself.

use core::arch::asm;

/// # Safety
/// `n` bytes at `from` are readable and at `to` writable; they do not overlap.
#[unsafe(no_mangle)]
unsafe extern "C" fn memcpy(to: *mut u8, from: *const u8, n: usize) -> *mut u8 {
    // SAFETY: reads and writes only the bytes that the caller vouches for; the direction flag is clear by convention.
    unsafe {
        asm!("rep movsb", inout("rdi") to => _, inout("rsi") from => _, inout("rcx") n => _, options(nostack, preserves_flags));
    }
    to
}

/// # Safety
/// `n` bytes at `from` are readable and at `to` writable.
#[unsafe(no_mangle)]
unsafe extern "C" fn memmove(to: *mut u8, from: *const u8, n: usize) -> *mut u8 {
    if (to as usize).wrapping_sub(from as usize) >= n {
        // SAFETY: forwards no byte is overwritten before it is read.
        return unsafe { memcpy(to, from, n) };
    }
    // SAFETY: `to` lies inside the source, so n > 0 and both last bytes exist; backwards no byte is overwritten before it
    // is read. The direction flag is left clear.
    unsafe {
        asm!("std", "rep movsb", "cld", inout("rdi") to.add(n - 1) => _, inout("rsi") from.add(n - 1) => _, inout("rcx") n => _, options(nostack));
    }
    to
}

/// # Safety
/// `n` bytes at `to` are writable.
#[unsafe(no_mangle)]
unsafe extern "C" fn memset(to: *mut u8, byte: i32, n: usize) -> *mut u8 {
    // SAFETY: writes only the bytes that the caller vouches for.
    unsafe {
        asm!("rep stosb", inout("rdi") to => _, in("al") byte as u8, inout("rcx") n => _, options(nostack, preserves_flags));
    }
    to
}

/// # Safety
/// `n` bytes at `a` and at `b` are readable.
#[unsafe(no_mangle)]
unsafe extern "C" fn memcmp(a: *const u8, b: *const u8, n: usize) -> i32 {
    for i in 0..n {
        // SAFETY: i < n. Volatile, so that the loop stays one.
        let (x, y) = unsafe { (a.add(i).read_volatile(), b.add(i).read_volatile()) };
        if x != y {
            return i32::from(x) - i32::from(y);
        }
    }
    0
}

/// # Safety
/// As [`memcmp`].
#[unsafe(no_mangle)]
unsafe extern "C" fn bcmp(a: *const u8, b: *const u8, n: usize) -> i32 {
    // SAFETY: the caller's.
    unsafe { memcmp(a, b, n) }
}
