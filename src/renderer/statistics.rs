//! How much work a view is.
//!
//! In: counters and timestamps that the GPU has sent back. Out: [`ViewStatistics`].

use super::PassTime;

/// Work of a view in a frame. What the GPU counts is that of the newest frame whose counters have arrived, some frames late.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ViewStatistics {
    /// Gaussians of all captures in view.
    pub total: u32,
    /// Those that the temporal filters leave active.
    pub active: u32,
    /// Those that become splats of at least one tile.
    pub visible: u32,
    /// Splat–tile pairs.
    pub pairs: u32,
    /// Bytes of the view's working buffers and targets.
    pub bytes: u64,
    /// GPU time of each pass, in frame order; empty until it has been measured.
    pub passes: Vec<PassTime>,
}
