//! Tests that need a GPU, where there is none.
//!
//! In: nothing. Out: the one report of it.

use crate::support::skip::skip;

/// Reports that the test, or a part of it, does not run because there is no GPU.
pub fn no_gpu() {
    skip("no GPU, not even a software one");
}
