//! The system's allocator, with a handler for refused memory.
//!
//! The standard library aborts the process if an allocation fails. A handler can end it with a message and an exit code
//! instead. Rule: everything else is the system's allocator, unchanged.
//!
//! ```
//! use mirrorstats_memory::{Allocator, on_refusal};
//!
//! #[global_allocator]
//! static ALLOCATOR: Allocator = Allocator;
//!
//! on_refusal(|bytes| eprintln!("no memory for {bytes} bytes"));
//! ```

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::OnceLock;

static HANDLER: OnceLock<fn(usize)> = OnceLock::new();

thread_local! {
    static IS_HANDLING: Cell<bool> = const { Cell::new(false) };
}

/// Sets the function that gets the size of a refused allocation, in bytes. The first one stays.
///
/// It should end the process. If it returns, the allocation fails. It may allocate; if that fails too, it is not called
/// again.
pub fn on_refusal(handler: fn(usize)) {
    HANDLER.get_or_init(|| handler);
}

/// An allocator for `#[global_allocator]`.
#[derive(Clone, Copy, Debug)]
pub struct Allocator;

impl Allocator {
    #[inline]
    fn checked(memory: *mut u8, size: usize) -> *mut u8 {
        if memory.is_null() {
            refused(size);
        }
        memory
    }
}

#[cold]
fn refused(size: usize) {
    if let Some(handler) = HANDLER.get()
        && !IS_HANDLING.replace(true)
    {
        handler(size);
        IS_HANDLING.set(false);
    }
}

#[expect(unsafe_code, reason = "an allocator is unsafe to implement")]
// SAFETY: every call goes to `System` with the caller's arguments, and its result is returned unchanged.
unsafe impl GlobalAlloc for Allocator {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promise.
        Self::checked(unsafe { System.alloc(layout) }, layout.size())
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promise.
        Self::checked(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    #[inline]
    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller's promise.
        Self::checked(unsafe { System.realloc(memory, layout, size) }, size)
    }

    #[inline]
    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(memory, layout) }
    }
}
