//! Waiting for the work of other threads, such as loading files.
//!
//! In: an app, a function that updates it, a condition. Out: the app once the condition holds.

use bevy::prelude::*;
use std::time::{Duration, Instant};

/// Longest time for files to load.
pub const LOAD_TIMEOUT: Duration = Duration::from_secs(60);

/// Updates the app until `so` returns true. Panics with `what` after [`LOAD_TIMEOUT`].
pub fn wait_until(app: &mut App, what: &str, so: impl Fn(&App) -> bool, update: impl Fn(&mut App)) {
    let start = Instant::now();
    while !so(app) {
        assert!(start.elapsed() < LOAD_TIMEOUT, "{what}: the condition holds before the time limit");
        std::thread::sleep(Duration::from_millis(2));
        update(app);
    }
}
