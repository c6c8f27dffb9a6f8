//! The memory that the process has allocated.
//!
//! In: every allocation in Rust; allocations of a driver are not counted. Out: counts of bytes.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The system's allocator, with counters.
struct Counting;

/// Number of allocated bytes.
pub static ALLOCATED: AtomicUsize = AtomicUsize::new(0);
/// Largest number of allocated bytes since this counter was last written.
pub static PEAK: AtomicUsize = AtomicUsize::new(0);
/// Size of the largest request since this counter was last written, in bytes.
pub static LARGEST: AtomicUsize = AtomicUsize::new(0);

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Counts a request before it is granted, so that failed requests also count.
fn grow(size: usize) {
    let now = ALLOCATED.fetch_add(size, Ordering::Relaxed).saturating_add(size);
    PEAK.fetch_max(now, Ordering::Relaxed);
    LARGEST.fetch_max(size, Ordering::Relaxed);
}

fn shrink(size: usize) {
    ALLOCATED.fetch_sub(size, Ordering::Relaxed);
}

#[expect(unsafe_code, reason = "the trait of allocators is unsafe")]
// SAFETY: all functions forward the caller's guarantees to `System` and return its result.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the caller fulfills the contract, which is the same.
        unsafe { System.alloc(layout) }
    }

    // The default implementation would write zeros into pages that are not in use yet.
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both blocks count, because the old block may have to be moved.
        grow(size);
        // SAFETY: as above; the block came from `System`.
        let moved = unsafe { System.realloc(block, layout, size) };
        shrink(if moved.is_null() { size } else { layout.size() });
        moved
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        shrink(layout.size());
        // SAFETY: as above; the block came from `System`.
        unsafe { System.dealloc(block, layout) }
    }
}
