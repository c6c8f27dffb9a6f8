//! Rests: views for which the GPU has refused an object are prepared again some frames later, not in every frame.
//!
//! In: the views that have failed. Out: whether a view rests in this frame.

use bevy::ecs::resource::Resource;
use bevy::platform::collections::HashMap;
use std::hash::Hash;

/// Number of frames for which a view rests: about a second.
const FRAMES: u32 = 60;

/// The views that rest, with the number of remaining frames. Dropped with the device.
#[derive(Resource, Debug)]
pub(crate) struct Rests<K: Send + Sync + 'static>(HashMap<K, u32>);

impl<K: Send + Sync + 'static> Default for Rests<K> {
    fn default() -> Self {
        Self(HashMap::default())
    }
}

impl<K: Eq + Hash + Send + Sync + 'static> Rests<K> {
    /// Counts a frame. Views whose rest is over are dropped, also if they no longer exist.
    pub(crate) fn count_frame(&mut self) {
        self.0.retain(|_, left| {
            *left -= 1;
            *left > 0
        });
    }

    /// Begins the rest of a view.
    pub(crate) fn begin(&mut self, view: K) {
        self.0.insert(view, FRAMES);
    }

    /// Returns whether a view rests in this frame.
    pub(crate) fn contains(&self, view: &K) -> bool {
        self.0.contains_key(view)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_rests_for_some_frames() {
        let mut rests = Rests::default();
        rests.begin("camera");
        let mut frames = 0;
        while rests.contains(&"camera") {
            rests.count_frame();
            frames += 1;
        }
        assert_eq!(frames, FRAMES, "the view rests for this number of frames");
        assert!(!rests.contains(&"light"), "a view that has not failed does not rest");
    }
}
