//! Numbers: quantiles, units, and the line that programs read.
//!
//! In: measured numbers. Out: numbers for people, and [`Figures`], all of them in a line.

use std::fmt;

/// The measured numbers, by name.
#[derive(Debug, Default)]
pub struct Figures(Vec<String>);

impl Figures {
    /// Adds a number.
    pub fn add(&mut self, name: &str, number: impl fmt::Display) {
        self.0.push(format!("{name}={number}"));
    }
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.join(" "))
    }
}

/// Returns the value below which a part of the values are, 0 to 1; 0 without values.
pub fn quantile(values: &[f64], part: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    sorted.get(((part * sorted.len() as f64) as usize).min(last)).copied().unwrap_or(0.0)
}

/// Returns the median of some values; 0 without values.
pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// Returns bytes in mebibytes.
pub fn mebibytes(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

/// Returns the `number`th of evenly scattered numbers, 0 to 1, the same in each run: multiples of the golden ratio.
pub fn scattered(number: u64) -> f64 {
    (number as f64 * 0.618_034).fract()
}

/// Returns the most memory that the process has had, bytes; `None` where the system does not say.
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = peak.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes << 10)
}
