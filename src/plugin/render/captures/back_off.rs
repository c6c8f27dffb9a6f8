//! Back-off: views for which the GPU has refused an object are prepared again only some frames later.
//!
//! In: the views that have failed. Out: whether a view waits in this frame.

use bevy::ecs::resource::Resource;
use bevy::platform::collections::HashMap;
use std::hash::Hash;

/// Number of frames for which a view waits: about a second.
const FRAMES: u32 = 60;

/// The views that wait, with the number of remaining frames. Dropped with the device.
#[derive(Resource, Debug)]
pub(crate) struct BackOff<K: Send + Sync + 'static>(HashMap<K, u32>);

impl<K: Send + Sync + 'static> Default for BackOff<K> {
    fn default() -> Self {
        Self(HashMap::default())
    }
}

impl<K: Eq + Hash + Send + Sync + 'static> BackOff<K> {
    /// Counts a frame. Views that have waited long enough are removed from the list, also if they no longer exist.
    pub(crate) fn count_frame(&mut self) {
        self.0.retain(|_, left| {
            *left -= 1;
            *left > 0
        });
    }

    /// Lets a view wait.
    pub(crate) fn begin(&mut self, view: K) {
        self.0.insert(view, FRAMES);
    }

    /// Returns whether a view waits in this frame.
    pub(crate) fn contains(&self, view: &K) -> bool {
        self.0.contains_key(view)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_rests_for_some_frames() {
        let mut back_off = BackOff::default();
        back_off.begin("camera");
        let mut frames = 0;
        while back_off.contains(&"camera") {
            back_off.count_frame();
            frames += 1;
        }
        assert_eq!(frames, FRAMES, "the view waits for this number of frames");
        assert!(!back_off.contains(&"light"), "a view that has not failed does not wait");
    }
}
