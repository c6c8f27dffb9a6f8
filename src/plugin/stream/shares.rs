//! Shares: how several streamed captures divide the memory on the GPU.
//!
//! In: whether cameras see each capture, and how near they are. Out: the share of each, which sum to 1.

use glam::Vec3;

/// A capture that no camera sees weighs as much as a seen one at this many times the distance.
const UNSEEN: f32 = 16.0;

/// How cameras see a capture, the entity that they see best.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Sight {
    /// The reciprocal of the distance to the nearest camera, in world units.
    nearness: f32,
}

impl Sight {
    /// Adds an entity at `place`, and where the cameras are, in world space.
    pub(super) fn add(&mut self, is_seen: bool, place: Vec3, eyes: &[Vec3]) {
        let nearest = eyes.iter().map(|eye| eye.distance(place)).fold(f32::INFINITY, f32::min);
        let nearest = if nearest.is_finite() { nearest.max(1e-3) } else { 1.0 };
        self.nearness = self.nearness.max(1.0 / if is_seen { nearest } else { UNSEEN * nearest });
    }

    /// Returns its weight: a power of two, so that small movements change nothing.
    fn weight(self) -> f64 {
        f64::from(self.nearness.clamp(1e-6, 1e6).log2().round()).exp2()
    }
}

/// Returns the share of each capture.
pub(super) fn shares<'a>(sights: impl Iterator<Item = &'a Sight>) -> Vec<f64> {
    let weights: Vec<f64> = sights.map(|sight| sight.weight()).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sight(is_seen: bool, distance: f32) -> Sight {
        let mut sight = Sight::default();
        sight.add(is_seen, Vec3::X * distance, &[Vec3::ZERO, Vec3::splat(1e9)]);
        sight
    }

    #[test]
    fn seen_and_near_captures_have_larger_shares() {
        let one = shares([sight(true, 2.0)].iter());
        assert_eq!(one, [1.0], "one capture has all");
        let several = shares([sight(true, 2.0), sight(true, 4.1), sight(false, 2.0)].iter());
        assert!((several.iter().sum::<f64>() - 1.0).abs() < 1e-12, "all memory: {several:?}");
        assert_eq!((several[0] / several[1], several[0] / several[2]), (2.0, 16.0), "nearness, and whether it is seen");
        let moved = shares([sight(true, 2.2), sight(true, 3.9), sight(false, 2.1)].iter());
        assert_eq!(moved, several, "small movements change nothing");
    }

    #[test]
    fn captures_without_cameras_or_at_the_camera_have_shares() {
        let mut alone = Sight::default();
        alone.add(false, Vec3::ZERO, &[]);
        let mut wild = Sight::default();
        wild.add(true, Vec3::NAN, &[Vec3::ZERO]);
        let all = shares([alone, wild, sight(true, 0.0), Sight::default()].iter());
        assert!(all.iter().all(|share| share.is_finite() && *share > 0.0), "{all:?}");
    }
}
