//! Waiting for what other threads do, such as loading files.
//!
//! In: an app, how it is updated, what is waited for. Out: an app in which it has happened.

use bevy::prelude::*;
use std::time::{Duration, Instant};

/// How long files may take to load.
pub const LOAD_TIMEOUT: Duration = Duration::from_secs(60);

/// Updates the app until `so` returns true.
pub fn wait_until(app: &mut App, what: &str, so: impl Fn(&App) -> bool, update: impl Fn(&mut App)) {
    let start = Instant::now();
    while !so(app) {
        assert!(start.elapsed() < LOAD_TIMEOUT, "{what}: waited in vain");
        std::thread::sleep(Duration::from_millis(2));
        update(app);
    }
}
