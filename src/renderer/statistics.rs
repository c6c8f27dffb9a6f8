//! Counts and times of the frames of a view.
//!
//! In: counters and timestamps read back from the GPU. Out: [`ViewStatistics`].

use super::timing::PassTime;

/// Counts and times of a view. Counts of the GPU belong to the newest frame whose counters have arrived, some frames ago.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ViewStatistics {
    /// Number of Gaussians of all captures in the view.
    pub total: u32,
    /// Number of these Gaussians that are active according to the temporal filters.
    pub active: u32,
    /// Number of splats that cover at least one tile.
    pub visible: u32,
    /// Number of splat–tile pairs.
    pub pairs: u32,
    /// Bytes of the view's working buffers and targets.
    pub bytes: u64,
    /// GPU time of each pass, in frame order; a single time named `frame` if the device has no timestamps inside passes; empty until it has
    /// been measured.
    pub passes: Vec<PassTime>,
}
