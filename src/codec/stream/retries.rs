//! Retries: when a file whose request failed is asked for again.
//!
//! In: requests that failed, files that arrived. Out: which files have to wait: a quarter of a second after the first
//! failure, twice as long after each further one, at most 8 seconds.

use std::collections::BTreeMap;

/// Seconds until the first retry.
const FIRST_DELAY: f64 = 0.25;
/// Most seconds until a retry.
const LONGEST_DELAY: f64 = 8.0;

/// The files whose last request failed.
#[derive(Debug, Default, Clone)]
pub(super) struct Retries {
    failed: BTreeMap<usize, Failure>,
    failures: u64,
}

/// The failures of a file since it last arrived.
#[derive(Debug, Clone, Copy)]
struct Failure {
    in_a_row: u32,
    /// The time of the next request, seconds of the host's clock.
    retry_at: f64,
}

impl Retries {
    /// Notes that the request of a file has failed.
    pub(super) fn fail(&mut self, file: usize, now: f64) {
        self.failures = self.failures.saturating_add(1);
        let before = self.in_a_row(file);
        let delay = (FIRST_DELAY * f64::from(before).exp2()).min(LONGEST_DELAY);
        self.failed.insert(file, Failure { in_a_row: before.saturating_add(1), retry_at: now + delay });
    }

    /// Notes that a file has arrived.
    pub(super) fn arrive(&mut self, file: usize) {
        self.failed.remove(&file);
    }

    /// Returns whether a file has to wait before it is asked for again.
    pub(super) fn waits(&self, file: usize, now: f64) -> bool {
        self.failed.get(&file).is_some_and(|failure| now < failure.retry_at)
    }

    /// Returns the number of failures of a file since it last arrived.
    pub(super) fn in_a_row(&self, file: usize) -> u32 {
        self.failed.get(&file).map_or(0, |failure| failure.in_a_row)
    }

    /// Returns the number of requests that have failed.
    pub(super) fn failures(&self) -> u64 {
        self.failures
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_failure_doubles_the_delay_up_to_8_seconds() {
        let mut retries = Retries::default();
        for (number, delay) in [0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 8.0].into_iter().enumerate() {
            let now = 100.0 * number as f64;
            retries.fail(3, now);
            assert!(retries.waits(3, now + 0.99 * delay), "the file waits after failure {number}");
            assert!(!retries.waits(3, now + delay), "the file is asked for {delay} s after failure {number}");
        }
        assert!(!retries.waits(4, 600.0), "another file does not wait");
        assert_eq!([retries.in_a_row(3), retries.in_a_row(4)], [7, 0], "failures in a row");
        retries.arrive(3);
        retries.fail(3, 1000.0);
        assert!(!retries.waits(3, 1000.25), "the delay of a file that has arrived is short again");
        assert_eq!(retries.failures(), 8, "all failures are counted");
    }

    #[test]
    fn any_number_of_failures_has_a_delay() {
        let mut retries = Retries::default();
        for _ in 0..3000 {
            retries.fail(0, 0.0);
        }
        assert!(retries.waits(0, 7.9) && !retries.waits(0, 8.0), "8 s after 3000 failures");
    }
}
