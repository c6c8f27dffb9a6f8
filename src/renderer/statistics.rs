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
    /// Bytes of the view's own working buffers and targets.
    pub bytes: u64,
    /// Bytes of the working buffers that all views share, since they are drawn one after another.
    pub shared_bytes: u64,
    /// GPU time of each pass, in frame order; a single time named `frame` if frames are
    /// [measured](super::Measured) as a whole; empty until it has been measured.
    pub passes: Vec<PassTime>,
}

impl ViewStatistics {
    /// Returns the bytes of the view's own buffers and targets, and of the shared ones.
    pub(crate) fn all_bytes(&self) -> u64 {
        self.bytes + self.shared_bytes
    }
}
