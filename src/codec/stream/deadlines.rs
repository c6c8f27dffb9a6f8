//! Deadlines: when a request that does not end counts as failed.
//!
//! In: the times at which requests begin. Out: which of them are overdue: after 30 s, and a second more for each 32 KiB
//! of the file, since a slow link is not a broken one.

use std::collections::BTreeMap;

/// Seconds for a request of a file of any length.
const SECONDS: f64 = 30.0;
/// Bytes of a file for each further second.
const BYTES: f64 = 32_768.0;

/// The time at which the last request of each file began, seconds of the host's clock.
#[derive(Debug, Default, Clone)]
pub(super) struct Deadlines(BTreeMap<usize, f64>);

impl Deadlines {
    /// Notes that the request of a file begins.
    pub(super) fn begin(&mut self, file: usize, now: f64) {
        self.0.insert(file, now);
    }

    /// Returns whether the request of a file of this length should have ended.
    pub(super) fn is_over(&self, file: usize, bytes: u64, now: f64) -> bool {
        self.0.get(&file).is_some_and(|began| now >= began + SECONDS + bytes as f64 / BYTES)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_file_has_more_time() {
        let mut deadlines = Deadlines::default();
        deadlines.begin(3, 100.0);
        let is_over = |bytes, now| deadlines.is_over(3, bytes, now);
        assert_eq!([is_over(0, 129.9), is_over(0, 130.0)], [false, true], "an empty file");
        assert_eq!([is_over(1 << 20, 161.9), is_over(1 << 20, 162.0)], [false, true], "32 s more for a MiB");
        assert!(!deadlines.is_over(4, 0, 1e9), "a file that was never asked for");
        deadlines.begin(3, 150.0);
        assert!(!deadlines.is_over(3, 0, 179.9), "another request has its own deadline");
    }
}
