//! The memory of the process over a long run.
//!
//! In: the bytes allocated in Rust and the resident set, each time that the app has no capture. Out: whether they grow.

use crate::support::allocations::ALLOCATED;
use std::fs;
use std::sync::atomic::Ordering;

/// Largest growth of the median from the third to the last quarter, percent. The resident set reaches its final size
/// after about 800 changes, which on a busy machine take half of five minutes: it contains the driver's allocations for
/// pipelines that are compiled late, and varies because the allocator serves many sizes from many threads. The
/// remaining growth of allocated bytes is Bevy's: its clustering of lights keeps 40 bytes for each view and frame.
const GROWTH_PERCENT: u64 = 5;
/// Smallest number of values for a verdict.
const LEAST: usize = 8;

/// The bytes allocated in Rust and the resident set in bytes, in the order of measurement.
#[derive(Default)]
pub struct Memory([Vec<u64>; 2]);

impl Memory {
    /// Records the current memory.
    pub fn record(&mut self) {
        self.0[0].push(allocated());
        self.0[1].extend(resident());
    }

    /// Returns a text about the allocated bytes and the resident set.
    ///
    /// # Errors
    /// The allocated bytes or the resident set grow.
    pub fn verdict(&self) -> Result<String, String> {
        let texts: Result<Vec<String>, String> =
            ["allocated", "resident"].iter().zip(&self.0).map(|(name, values)| verdict(name, values)).collect();
        Ok(texts?.join(", "))
    }
}

fn verdict(name: &str, values: &[u64]) -> Result<String, String> {
    let Some(last) = values.last() else { return Ok(format!("{name} not measured")) };
    let quarter = values.len() / 4;
    if values.len() < LEAST {
        return Ok(format!("{name} {}, run too short for a verdict on growth", mebibytes(*last)));
    }
    let [early, late] =
        [values.len() - 2 * quarter, values.len() - quarter].map(|first| median(&values[first..first + quarter]));
    let text = format!("{name} {} in the third quarter, {} in the last", mebibytes(early), mebibytes(late));
    if late > early + early / 100 * GROWTH_PERCENT { Err(format!("memory grows: {text}")) } else { Ok(text) }
}

/// Returns the number of bytes allocated in Rust.
pub fn allocated() -> u64 {
    ALLOCATED.load(Ordering::Relaxed) as u64
}

/// Returns the resident set in bytes; `None` on systems other than Linux.
pub fn resident() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|kibibytes| kibibytes << 10)
}

/// Formats a number of bytes in MiB.
pub fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

fn median(values: &[u64]) -> u64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable();
    sorted[sorted.len() / 2]
}
