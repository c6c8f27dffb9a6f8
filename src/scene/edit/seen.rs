//! What the training cameras see of each Gaussian.
//!
//! In: counts and distances, from the views of a dataset. Out: [`Seen`], which tells floaters from what stands there.

/// What the training cameras see of each Gaussian of a capture, in the order of the capture.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Seen {
    /// Number of cameras in whose pictures it is large enough to be trained by them.
    pub cameras: Vec<u32>,
    /// Distance of the nearest camera whose pictures show its mean, capture units; infinite if there is none.
    pub nearest: Vec<f32>,
}

impl Seen {
    /// Returns whether a Gaussian is seen by fewer than `cameras_below` cameras, and by one at less than
    /// `distance_below`; false for an index out of range.
    pub(super) fn is_floater(&self, index: usize, cameras_below: u32, distance_below: f32) -> bool {
        let is_seen_by_few = self.cameras.get(index).is_some_and(|&cameras| cameras < cameras_below);
        is_seen_by_few && self.nearest.get(index).is_some_and(|&nearest| nearest < distance_below)
    }
}
