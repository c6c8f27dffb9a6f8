//! Files of other makes, and the comparison of their values.
//!
//! In: the name of a file below `formats/` in the folder that `GS4D_DATA` names. Out: its path; values compared with
//! those of an independent decoder.

use crate::support::data::data;
use crate::support::skip::skip;
use std::path::PathBuf;

/// Returns the path of a file; without it, reports the skipped test and returns `None`.
pub fn fixture(name: &str) -> Option<PathBuf> {
    let path = data()?.join("formats").join(name);
    if path.exists() {
        return Some(path);
    }
    skip(format!("GS4D_DATA has no formats/{name}"));
    None
}

/// Returns the activated opacity of a logit.
pub fn opacity(logit: f32) -> f32 {
    1.0 / (1.0 + (-logit).exp())
}

/// Checks that values differ from the expected values by at most `tolerance`.
pub fn assert_near<const N: usize>(what: &str, found: [f32; N], expected: [f32; N], tolerance: f32) {
    let is_near = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() <= tolerance);
    assert!(is_near, "{what}: {found:?}, expected {expected:?} up to {tolerance}");
}
