//! An allocator that makes a single allocation. It tests .ci/no_std.sh, which must detect it. It is
//! only part of the program with the feature `heap`.

extern crate alloc;

use alloc::boxed::Box;
use core::alloc::{GlobalAlloc, Layout};
use core::cell::UnsafeCell;

#[repr(align(16))]
struct OneBlock(UnsafeCell<[u8; 256]>);

// SAFETY: there is only one thread.
unsafe impl Sync for OneBlock {}

// SAFETY: the block is large enough and aligned for the single request that is made.
unsafe impl GlobalAlloc for OneBlock {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if layout.size() <= 256 && layout.align() <= 16 { self.0.get().cast() } else { core::ptr::null_mut() }
    }

    unsafe fn dealloc(&self, _: *mut u8, _: Layout) {}
}

#[global_allocator]
static BLOCK: OneBlock = OneBlock(UnsafeCell::new([0; 256]));

pub fn allocate_once() {
    drop(core::hint::black_box(Box::new(core::hint::black_box([1_u8; 64]))));
}
