//! The memory of the process over a long time.
//!
//! In: what is allocated in Rust and the resident set, each time that the app holds no capture. Out: whether they stay as they are.

use crate::support::allocations::ALLOCATED;
use std::fs;
use std::sync::atomic::Ordering;

/// How much larger the median of the last quarter may be than that of the third, percent. The resident set is as large as it gets after some
/// 800 changes, which on a busy machine are half of five minutes: it has what the driver allocates for pipelines that are compiled late, and
/// the scatter of an allocator that is given many sizes by many threads. What remains of what is allocated is Bevy's: its clustering of lights
/// keeps 40 bytes for each view and frame.
const GROWTH_PERCENT: u64 = 5;
/// Fewer times say nothing.
const LEAST: usize = 8;

/// What is allocated in Rust and the resident set, bytes, time after time.
#[derive(Default)]
pub struct Memory([Vec<u64>; 2]);

impl Memory {
    /// Notes the memory of now.
    pub fn note(&mut self) {
        self.0[0].push(allocated());
        self.0[1].extend(resident());
    }

    /// Returns what can be said about all of it.
    ///
    /// # Errors
    /// The memory grows.
    pub fn verdict(&self) -> Result<String, String> {
        let said: Result<Vec<String>, String> =
            ["allocated", "resident"].iter().zip(&self.0).map(|(name, noted)| verdict(name, noted)).collect();
        Ok(said?.join(", "))
    }
}

fn verdict(name: &str, noted: &[u64]) -> Result<String, String> {
    let Some(last) = noted.last() else { return Ok(format!("{name} not measured")) };
    let quarter = noted.len() / 4;
    if noted.len() < LEAST {
        return Ok(format!("{name} {}, too short to say whether it grows", mebibytes(*last)));
    }
    let [early, late] =
        [noted.len() - 2 * quarter, noted.len() - quarter].map(|first| median(&noted[first..first + quarter]));
    let said = format!("{name} {} in the third quarter, {} in the last", mebibytes(early), mebibytes(late));
    if late > early + early / 100 * GROWTH_PERCENT { Err(format!("memory grows: {said}")) } else { Ok(said) }
}

/// Returns the bytes that are allocated in Rust.
pub fn allocated() -> u64 {
    ALLOCATED.load(Ordering::Relaxed) as u64
}

/// Returns the resident set in bytes. Only Linux tells it.
pub fn resident() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|kibibytes| kibibytes << 10)
}

/// Returns a number of bytes for people.
pub fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

fn median(values: &[u64]) -> u64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable();
    sorted[sorted.len() / 2]
}
