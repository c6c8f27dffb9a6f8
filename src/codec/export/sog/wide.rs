//! Numbers of 16 bits, linear in their signed logarithms.
//!
//! In: three numbers for each Gaussian. Out: [`Wide`], their codes between the limits of each axis, in two textures.

use rayon::prelude::*;
use serde_json::{Value, json};

/// Codes of three axes and their limits.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Wide {
    mins: [f64; 3],
    maxs: [f64; 3],
    pub codes: Vec<[u16; 3]>,
}

impl Wide {
    /// Codes finite numbers.
    pub(super) fn of(numbers: &[[f64; 3]]) -> Self {
        let logs: Vec<[f64; 3]> =
            numbers.par_iter().map(|numbers| numbers.map(|number| number.abs().ln_1p().copysign(number))).collect();
        let limit = |start: f64, pick: fn(f64, f64) -> f64| {
            logs.iter().fold([start; 3], |limit, logs| std::array::from_fn(|axis| pick(limit[axis], logs[axis])))
        };
        let (mins, maxs) = (limit(f64::INFINITY, f64::min), limit(f64::NEG_INFINITY, f64::max));
        if logs.is_empty() {
            return Self { mins: [0.0; 3], maxs: [0.0; 3], codes: Vec::new() };
        }
        let code = |axis: usize, log: f64| {
            let span = maxs[axis] - mins[axis];
            if span > 0.0 { ((log - mins[axis]) / span * 65535.0).round() as u16 } else { 0 }
        };
        let codes = logs.par_iter().map(|logs| std::array::from_fn(|axis| code(axis, logs[axis]))).collect();
        Self { mins, maxs, codes }
    }

    /// Returns the texel of the low bytes of a Gaussian.
    pub(super) fn low(&self, index: usize) -> [u8; 4] {
        let [x, y, z] = self.codes[index].map(|code| code.to_le_bytes()[0]);
        [x, y, z, u8::MAX]
    }

    /// Returns the texel of the high bytes of a Gaussian.
    pub(super) fn high(&self, index: usize) -> [u8; 4] {
        let [x, y, z] = self.codes[index].map(|code| code.to_le_bytes()[1]);
        [x, y, z, u8::MAX]
    }

    /// Returns its description for `meta.json`.
    pub(super) fn described(&self, files: [&str; 2]) -> Value {
        json!({ "mins": self.mins, "maxs": self.maxs, "files": files })
    }
}
