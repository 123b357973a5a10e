//! The functions that the compiler calls to copy, fill and compare memory. Normally the C library
//! provides them.
//!
//! They use the string instructions of the processor, since the compiler could turn a loop in Rust
//! into a call of the function itself.

use core::arch::asm;

/// Copies `n` bytes from `from` to `to` and returns `to`, like the C function.
///
/// # Safety
/// `n` bytes at `from` are readable and at `to` writable. They do not overlap.
#[unsafe(no_mangle)]
unsafe extern "C" fn memcpy(to: *mut u8, from: *const u8, n: usize) -> *mut u8 {
    // SAFETY: reads and writes only bytes that the caller guarantees. The direction flag is clear
    // by convention.
    unsafe {
        asm!("rep movsb", inout("rdi") to => _, inout("rsi") from => _, inout("rcx") n => _, options(nostack, preserves_flags));
    }
    to
}

/// Copies `n` bytes from `from` to `to`, which can overlap, and returns `to`.
///
/// # Safety
/// `n` bytes at `from` are readable and at `to` writable.
#[unsafe(no_mangle)]
unsafe extern "C" fn memmove(to: *mut u8, from: *const u8, n: usize) -> *mut u8 {
    if (to as usize).wrapping_sub(from as usize) >= n {
        // SAFETY: copying forwards overwrites no byte before it is read.
        return unsafe { memcpy(to, from, n) };
    }
    // SAFETY: `to` lies inside the source, so n > 0 and both last bytes exist. Copying backwards
    // overwrites no byte before it is read. The direction flag is clear again afterwards.
    unsafe {
        asm!("std", "rep movsb", "cld", inout("rdi") to.add(n - 1) => _, inout("rsi") from.add(n - 1) => _, inout("rcx") n => _, options(nostack));
    }
    to
}

/// Sets `n` bytes at `to` to `byte` and returns `to`.
///
/// # Safety
/// `n` bytes at `to` are writable.
#[unsafe(no_mangle)]
unsafe extern "C" fn memset(to: *mut u8, byte: i32, n: usize) -> *mut u8 {
    // SAFETY: writes only bytes that the caller guarantees.
    unsafe {
        asm!("rep stosb", inout("rdi") to => _, in("al") byte as u8, inout("rcx") n => _, options(nostack, preserves_flags));
    }
    to
}

/// Compares `n` bytes at `a` and `b`. Returns the difference of the first bytes that differ, or 0.
///
/// # Safety
/// `n` bytes at `a` and at `b` are readable.
#[unsafe(no_mangle)]
unsafe extern "C" fn memcmp(a: *const u8, b: *const u8, n: usize) -> i32 {
    for i in 0..n {
        // SAFETY: i < n. Volatile reads keep the compiler from replacing the loop by a call.
        let (x, y) = unsafe { (a.add(i).read_volatile(), b.add(i).read_volatile()) };
        if x != y {
            return i32::from(x) - i32::from(y);
        }
    }
    0
}

/// Compares like [`memcmp`].
///
/// # Safety
/// The conditions are those of [`memcmp`].
#[unsafe(no_mangle)]
unsafe extern "C" fn bcmp(a: *const u8, b: *const u8, n: usize) -> i32 {
    // SAFETY: the caller guarantees the conditions.
    unsafe { memcmp(a, b, n) }
}
