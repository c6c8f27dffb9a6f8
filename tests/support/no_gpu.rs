//! The report of tests that need a GPU on a machine without one.
//!
//! In: nothing. Out: the same reason for all of these tests.

use crate::support::skip::skip;

/// Reports that the test, or a part of it, does not run because there is no GPU.
pub fn no_gpu() {
    skip("no GPU and no software driver");
}
