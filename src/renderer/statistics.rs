//! What the renderer has made and how much work it does.
//!
//! In: notes from wherever something is created, uploaded or activated, counters that the GPU has sent back. Out: totals of the
//! process, with which a test can tell that nothing is done twice, and [`ViewStatistics`].

use super::PassTime;
use std::sync::atomic::{AtomicU64, Ordering};

static CREATED: AtomicU64 = AtomicU64::new(0);
static UPLOADED: AtomicU64 = AtomicU64::new(0);
static ACTIVATED: AtomicU64 = AtomicU64::new(0);

/// How many buffers, textures and bind groups the crate has created so far in this process.
pub fn created() -> u64 {
    CREATED.load(Ordering::Relaxed)
}

/// Bytes of scenes uploaded so far in this process.
pub fn uploaded() -> u64 {
    UPLOADED.load(Ordering::Relaxed)
}

/// How many lists of active Gaussians have been recorded so far in this process.
pub fn activated() -> u64 {
    ACTIVATED.load(Ordering::Relaxed)
}

/// Counts something that is being created on a GPU.
pub(crate) fn note_created() {
    CREATED.fetch_add(1, Ordering::Relaxed);
}

/// Counts a list of active Gaussians that is being recorded.
pub(super) fn note_activated() {
    ACTIVATED.fetch_add(1, Ordering::Relaxed);
}

/// Counts bytes of a scene that go to a GPU.
pub(crate) fn note_uploaded(bytes: u64) {
    UPLOADED.fetch_add(bytes, Ordering::Relaxed);
}

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
