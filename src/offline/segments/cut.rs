//! How a capture is cut into chunk files.
//!
//! In: the length of a stretch of time, the shares of the layers. Out: [`Cut`], and the number of stretches of a capture.

use super::layers::LayerShares;
use crate::scene::ChunkTable;
use serde::{Deserialize, Serialize};

/// How a capture is cut into chunk files. Default: stretches of one second, layers of 25, 25 and 50 percent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cut {
    /// Length of a stretch of time at speed 1, seconds, above 0.
    pub seconds: f32,
    /// The shares of the layers.
    pub layers: LayerShares,
}

impl Default for Cut {
    fn default() -> Self {
        Self { seconds: 1.0, layers: LayerShares::default() }
    }
}

impl Cut {
    /// Returns the number of stretches of time of a capture that plays for `duration` seconds; `None` if they are more
    /// than [`ChunkTable::MOST_STRETCHES`].
    pub fn stretches(&self, duration: f32) -> Option<u32> {
        let count = (f64::from(duration) / f64::from(self.seconds)).ceil().max(1.0);
        (count <= f64::from(ChunkTable::MOST_STRETCHES)).then_some(count as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_cover_the_capture() {
        let of = |seconds| Cut { seconds, ..Cut::default() };
        assert_eq!(
            [0.0, 0.4, 1.0, 1.1].map(|duration| of(0.5).stretches(duration)),
            [1, 1, 2, 3].map(Some),
            "rounded up"
        );
        assert_eq!([10_000.0, 10_000.1].map(|duration| of(1.0).stretches(duration)), [Some(10_000), None], "the most");
    }
}
