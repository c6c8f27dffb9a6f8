//! The options of the example `stream`.
//!
//! In: options and their values on the command line. Out: [`Options`].

use crate::common::arguments::value;
use crate::link::Quality;
use crate::size::parse_size;
use bevy::prelude::*;
use bevy_gs4d::stream::StreamBudget;
use std::ops::RangeInclusive;
use std::time::Duration;

/// The options, or their defaults.
pub struct Options {
    pub link: Quality,
    pub budget: StreamBudget,
    /// How long playing is measured.
    pub seconds: f64,
    /// The capture that was cut, to compare with.
    pub whole: Option<String>,
    /// The size of pictures.
    pub size: UVec2,
}

impl Default for Options {
    fn default() -> Self {
        let size = UVec2::new(640, 360);
        Self { link: Quality::default(), budget: StreamBudget::default(), seconds: 20.0, whole: None, size }
    }
}

impl Options {
    /// Reads an option and its value. Returns whether there is such an option.
    ///
    /// # Errors
    /// A value that is missing or not allowed.
    pub fn read(&mut self, option: &str, values: &mut dyn Iterator<Item = String>) -> Result<bool> {
        let mut within = |range| number(option, values, range);
        match option {
            "--link" => self.link.rate = Some(within(1e-3..=1e6)? * 1e6),
            "--latency" => self.link.latency = Duration::from_secs_f64(within(0.0..=60e3)? * 1e-3),
            "--lose" => self.link.lost = within(0.0..=100.0)? * 1e-2,
            "--outage" => self.link.outage = Duration::from_secs_f64(within(0.0..=60.0)?),
            "--halve" => self.link.halves = true,
            "--gpu" => self.budget.gpu_bytes = bytes(within(1.0..=1e6)?),
            "--host" => self.budget.host_bytes = bytes(within(1.0..=1e6)?),
            "--seconds" => self.seconds = within(0.1..=3600.0)?,
            "--whole" => self.whole = Some(value(option, "a capture", values)?),
            "--size" => {
                let text = value(option, "a size", values)?;
                self.size = parse_size(&text).ok_or_else(|| format!("--size {text}: not a size such as 640x360"))?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }
}

fn number(option: &str, values: &mut dyn Iterator<Item = String>, range: RangeInclusive<f64>) -> Result<f64> {
    let text = value(option, "a number", values)?;
    let number = text.parse().ok().filter(|number: &f64| range.contains(number));
    Ok(number.ok_or_else(|| format!("{option} {text}: not a number from {} to {}", range.start(), range.end()))?)
}

/// Returns the bytes of some mebibytes.
fn bytes(mebibytes: f64) -> u64 {
    (mebibytes * f64::from(1 << 20)) as u64
}
