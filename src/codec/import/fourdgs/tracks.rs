//! The tracks of objects in a `.4dgs` file: rigid motions of some of its Gaussians.
//!
//! In: the object layer of a file. Out: [`Tracks`]: the path and the rotation of a Gaussian of an object.

use fourdgs::{ObjectLayer, ObjectTrack, Pose, pose_at};
use glam::{DQuat, DVec3};
use std::collections::HashMap;

/// The tracks of a file by the numbers of their objects.
pub(super) struct Tracks<'a>(HashMap<u32, &'a ObjectTrack>);

impl<'a> Tracks<'a> {
    /// Returns the tracks of an object layer.
    pub(super) fn of(layer: &'a ObjectLayer) -> Self {
        Self(layer.tracks.iter().map(|track| (track.object_id, track)).collect())
    }

    /// Returns the track of an object; `None` if it has none. The background has the number 0, and no track.
    pub(super) fn of_object(&self, object: u32) -> Option<&'a ObjectTrack> {
        if object == 0 { None } else { self.0.get(&object).copied() }
    }
}

/// Returns the rotation and the translation of a track at a time.
pub(super) fn pose(track: &ObjectTrack, time: f64) -> (DQuat, DVec3) {
    // A track without samples has no pose. An error is impossible, since the time is finite.
    match pose_at(track, time) {
        Ok(Some(Pose { rotation, translation })) => (DQuat::from_array(rotation), DVec3::from(translation)),
        Ok(None) | Err(_) => (DQuat::IDENTITY, DVec3::ZERO),
    }
}
