//! The memory of the process over a long time.
//!
//! In: its resident set, each time that the app holds no capture. Out: whether it stays as it is.

use std::fs;

/// How much larger the median of the last quarter may be than that of the second, percent. In the first, every pipeline is compiled. What
/// remains is the scatter of an allocator that is given many sizes.
const GROWTH_PERCENT: u64 = 10;
/// Fewer times say nothing.
const LEAST: usize = 8;

/// The resident set of the process, time after time.
#[derive(Default)]
pub struct Memory(Vec<u64>);

impl Memory {
    /// Notes the resident set of now. Only Linux tells it.
    pub fn note(&mut self) {
        self.0.extend(resident());
    }

    /// Returns what can be said about all of it.
    ///
    /// # Errors
    /// The memory grows.
    pub fn verdict(&self) -> Result<String, String> {
        let Some(last) = self.0.last() else { return Ok("memory not measured".to_owned()) };
        let quarter = self.0.len() / 4;
        if self.0.len() < LEAST {
            return Ok(format!("{} MiB resident, too short to say whether it grows", last >> 20));
        }
        let [early, late] = [quarter, self.0.len() - quarter].map(|first| median(&self.0[first..first + quarter]));
        let said = format!("resident {} MiB early, {} MiB late", early >> 20, late >> 20);
        if late > early + early / 100 * GROWTH_PERCENT { Err(format!("memory grows: {said}")) } else { Ok(said) }
    }
}

/// Returns the resident set in bytes.
pub fn resident() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|kibibytes| kibibytes << 10)
}

fn median(values: &[u64]) -> u64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable();
    sorted[sorted.len() / 2]
}
