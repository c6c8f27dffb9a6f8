//! The amount of work of a view.
//!
//! In: counters and timestamps read back from the GPU. Out: [`ViewStatistics`].

use super::timing::PassTime;

/// Work of a view in a frame. What the GPU counts belongs to the newest frame whose counters have arrived, some frames
/// ago.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ViewStatistics {
    /// Number of Gaussians of all captures in the view.
    pub total: u32,
    /// Number of them that the temporal filters leave active.
    pub active: u32,
    /// Number of splats that cover at least one tile.
    pub visible: u32,
    /// Number of splat–tile pairs.
    pub pairs: u32,
    /// Bytes of the view's working buffers and targets.
    pub bytes: u64,
    /// GPU time of each pass, in frame order; empty until it has been measured.
    pub passes: Vec<PassTime>,
}
