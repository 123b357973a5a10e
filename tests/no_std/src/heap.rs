//! An allocator, used once: what .ci/no_std.sh must notice. Not part of the program without the feature `heap`.

extern crate alloc;

use alloc::boxed::Box;
use core::alloc::{GlobalAlloc, Layout};
use core::cell::UnsafeCell;

#[repr(align(16))]
struct OneBlock(UnsafeCell<[u8; 256]>);

// SAFETY: there is one thread.
unsafe impl Sync for OneBlock {}

// SAFETY: the block is large enough and aligned for all that is asked of it, which is asked once.
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
