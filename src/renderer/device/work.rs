//! Counters of resources created, bytes uploaded and lists recorded for a renderer.
//!
//! In: calls from the code that creates, uploads and records. Out: [`WorkCounters`], with which a test can check that no work is repeated.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Numbers of resources created, bytes uploaded and lists recorded for a renderer so far. Clones refer to the same counters.
#[derive(Debug, Clone, Default)]
pub struct WorkCounters(Arc<Counts>);

#[derive(Debug, Default)]
struct Counts {
    created: AtomicU64,
    uploaded: AtomicU64,
    activated: AtomicU64,
}

impl WorkCounters {
    /// Returns the number of buffers, textures and bind groups created.
    pub fn created(&self) -> u64 {
        self.0.created.load(Ordering::Relaxed)
    }

    /// Returns the bytes of captures uploaded.
    pub fn uploaded(&self) -> u64 {
        self.0.uploaded.load(Ordering::Relaxed)
    }

    /// Returns the number of lists of active Gaussians recorded: the number of runs of `activate`.
    pub fn activated(&self) -> u64 {
        self.0.activated.load(Ordering::Relaxed)
    }

    pub(crate) fn add_created(&self) {
        self.0.created.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn add_uploaded(&self, bytes: u64) {
        self.0.uploaded.fetch_add(bytes, Ordering::Relaxed);
    }

    pub(crate) fn add_activated(&self) {
        self.0.activated.fetch_add(1, Ordering::Relaxed);
    }
}
