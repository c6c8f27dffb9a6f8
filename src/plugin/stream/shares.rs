//! Shares: how several streamed captures divide the memory on the GPU, and the requests.
//!
//! In: whether cameras see each capture, and how near they are. Out: the share of each, which sum to 1; in their order,
//! the turns in which captures ask for files.

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

/// Files on their way.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct OnTheWay {
    pub(super) requests: usize,
    /// Their bytes in memory.
    pub(super) host_bytes: u64,
}

/// Lets captures ask for files, in two turns: in the first, each may have one on its way, so that none waits for all of
/// another; in the second, all that is left. `on_the_way` are the files of each capture, the largest share first; `ask`
/// makes one ask, within what it may have on its way, and returns what it then has.
pub(super) fn ask_in_turns(
    most: OnTheWay,
    on_the_way: &mut [OnTheWay],
    mut ask: impl FnMut(usize, OnTheWay) -> OnTheWay,
) {
    for each in [1, usize::MAX] {
        for capture in 0..on_the_way.len() {
            let others = on_the_way.iter().enumerate().filter(|(other, _)| *other != capture).map(|(_, files)| files);
            let left = others.fold(most, |left, files| OnTheWay {
                requests: left.requests.saturating_sub(files.requests),
                host_bytes: left.host_bytes.saturating_sub(files.host_bytes),
            });
            on_the_way[capture] = ask(capture, OnTheWay { requests: left.requests.min(each), ..left });
        }
    }
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

    /// Returns the requests of captures after they have asked: each would have as many as in `wanted`, of ten bytes.
    fn asked(requests: usize, before: &[usize], wanted: &[usize]) -> Vec<usize> {
        let files = |requests: usize| OnTheWay { requests, host_bytes: 10 * requests as u64 };
        let mut on_the_way: Vec<OnTheWay> = before.iter().map(|requests| files(*requests)).collect();
        let mut has = before.to_vec();
        ask_in_turns(files(requests), &mut on_the_way, |capture, limit| {
            assert_eq!(limit.host_bytes / 10, (requests - sum_without(&has, capture)) as u64, "bytes that are left");
            has[capture] = has[capture].max(wanted[capture].min(limit.requests));
            files(has[capture])
        });
        assert_eq!(on_the_way, has.iter().map(|requests| files(*requests)).collect::<Vec<_>>(), "the files are noted");
        has
    }

    fn sum_without(requests: &[usize], capture: usize) -> usize {
        requests.iter().sum::<usize>() - requests[capture]
    }

    #[test]
    fn each_capture_has_a_request_before_the_largest_has_the_rest() {
        assert_eq!(asked(4, &[0, 0, 0], &[9, 9, 9]), [2, 1, 1], "one each, and the rest");
        assert_eq!(asked(4, &[0, 0, 0], &[9, 0, 9]), [3, 0, 1], "one that needs nothing has none");
        assert_eq!(asked(4, &[0, 0, 0], &[1, 2, 9]), [1, 2, 1], "the second takes what the first leaves");
        assert_eq!(asked(2, &[0, 0, 0], &[9, 9, 9]), [1, 1, 0], "as far as requests go");
        assert_eq!(asked(4, &[3, 0], &[9, 9]), [3, 1], "the next free request is for one that has none");
        assert_eq!(asked(4, &[4, 0], &[9, 9]), [4, 0], "requests are not taken away");
        assert_eq!((asked(0, &[0], &[9]), asked(4, &[0], &[9])), (vec![0], vec![4]), "a capture alone has all");
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
