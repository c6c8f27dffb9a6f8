//! The memory that an input takes.
//!
//! In: every allocation of the process. Out: the most bytes that were allocated at any moment since an input began, and
//! the largest request.

use crate::support::allocations::{ALLOCATED, LARGEST, PEAK};
use std::sync::atomic::{AtomicUsize, Ordering};

static START: AtomicUsize = AtomicUsize::new(0);

/// Starts a new count.
pub fn begin() {
    let now = ALLOCATED.load(Ordering::Relaxed);
    START.store(now, Ordering::Relaxed);
    PEAK.store(now, Ordering::Relaxed);
    LARGEST.store(0, Ordering::Relaxed);
}

/// Returns the most bytes that were allocated at any moment since [`begin`], beyond those allocated then.
pub fn peak() -> usize {
    PEAK.load(Ordering::Relaxed).saturating_sub(START.load(Ordering::Relaxed))
}

/// Returns the size of the largest request since [`begin`].
pub fn largest() -> usize {
    LARGEST.load(Ordering::Relaxed)
}
