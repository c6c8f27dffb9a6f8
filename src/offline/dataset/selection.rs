//! Selecting training views.
//!
//! In: the training views of a dataset. Out: an even subset of the views, their distinct cameras, the camera of each
//! view, the number of their distinct times.

use super::TrainingView;
use crate::view::{Camera, Lens, Optics, View};
use std::collections::{HashMap, HashSet};

/// The fraction of the golden ratio: the fractions of its multiples are evenly distributed between 0 and 1.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Returns the indices of an even subset of the views, ascending: one from each of `wanted` intervals of time, at a
/// different place within each interval, so that the subset is even in time and among cameras. Returns all indices if
/// there are no more than `wanted`.
pub fn even_subset(views: &[TrainingView], wanted: usize) -> Vec<usize> {
    let count = views.len();
    let mut by_time: Vec<usize> = (0..count).collect();
    if wanted >= count {
        return by_time;
    }
    by_time.sort_by(|&a, &b| views[a].time.total_cmp(&views[b].time));
    let mut subset: Vec<usize> = (0..wanted)
        .map(|k| {
            let (first, end) = (k * count / wanted, (k + 1) * count / wanted);
            let place = ((k as f64 + 0.5) * GOLDEN).fract() * (end - first) as f64;
            by_time[first + (place as usize).min(end - first - 1)]
        })
        .collect();
    subset.sort_unstable();
    subset
}

/// Returns the indices of all views of evenly chosen moments, ascending: at most `wanted` views. If a moment has more,
/// returns an even subset of all views.
pub fn even_moments(views: &[TrainingView], wanted: usize) -> Vec<usize> {
    if wanted >= views.len() {
        return (0..views.len()).collect();
    }
    let mut seen = HashSet::new();
    let moments: Vec<TrainingView> = views.iter().filter(|view| seen.insert(view.time.to_bits())).cloned().collect();
    let chosen = even_subset(&moments, (wanted * moments.len() / views.len()).max(1));
    let times: HashSet<u32> = chosen.into_iter().map(|index| moments[index].time.to_bits()).collect();
    let all: Vec<usize> = (0..views.len()).filter(|&index| times.contains(&views[index].time.to_bits())).collect();
    if all.len() > wanted { even_subset(views, wanted) } else { all }
}

/// Returns the distinct cameras in the order of the views. Cameras with the same pose, size and lens are the same.
pub fn distinct_cameras(views: &[TrainingView]) -> Vec<Camera> {
    let mut seen = HashSet::new();
    views.iter().map(|view| view.camera).filter(|camera| seen.insert(identity(camera))).collect()
}

/// Returns the number of each view's camera among the [`distinct_cameras`].
pub fn camera_numbers(views: &[TrainingView]) -> Vec<u32> {
    let mut numbers = HashMap::new();
    let mut number = |view: &TrainingView| {
        let next = numbers.len() as u32;
        *numbers.entry(identity(&view.camera)).or_insert(next)
    };
    views.iter().map(&mut number).collect()
}

pub(super) fn identity(camera: &Camera) -> ([u32; 16], [u32; 2], [u32; 5]) {
    let (kind, a, b) = match camera.lens {
        Lens::Fov { tan } => (0.0, tan, glam::Vec2::ZERO),
        Lens::Intrinsics { focal, center } => (1.0, focal, center),
    };
    let pose = camera.world_to_camera.to_cols_array().map(f32::to_bits);
    (pose, camera.size.to_array(), [kind, a.x, a.y, b.x, b.y].map(f32::to_bits))
}

/// Returns the number of distinct times of the views.
pub fn distinct_times(views: &[TrainingView]) -> usize {
    views.iter().map(|view| view.time.to_bits()).collect::<HashSet<_>>().len()
}

/// Returns the renderer's view for each training view of a capture with these optics.
pub fn to_draw(views: &[TrainingView], optics: impl Into<Optics>) -> Vec<View> {
    let optics = optics.into();
    views.iter().map(|view| view.camera.view(view.time, optics)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Mat4, UVec2, Vec3};

    /// Returns the views of twenty cameras with thirty frames each, camera by camera.
    fn views() -> Vec<TrainingView> {
        let camera = |index: usize| Camera {
            world_to_camera: Mat4::from_translation(Vec3::X * index as f32),
            size: UVec2::splat(8),
            lens: Camera::fov_lens(0.7, UVec2::splat(8)),
        };
        let view = |index: usize| TrainingView {
            name: index.to_string(),
            camera: camera(index / 30),
            time: (index % 30) as f32 / 29.0,
            original: UVec2::splat(8),
            image: "none.png".into(),
            mask: None,
            correction: Default::default(),
        };
        (0..600).map(view).collect()
    }

    #[test]
    fn views_of_one_camera_have_its_number() {
        let views = views();
        let mixed: Vec<_> = [40, 3, 59, 0, 599].map(|index| views[index].clone()).into();
        assert_eq!(camera_numbers(&mixed), [0, 1, 0, 1, 2], "in the order of the views");
        let numbers: Vec<u32> = (0..600).map(|index| index / 30).collect();
        assert_eq!(camera_numbers(&views), numbers, "twenty cameras");
        assert_eq!(distinct_cameras(&views).len(), 20, "the same cameras");
    }

    #[test]
    fn views_of_even_moments_are_all_of_their_moments() {
        let views = views();
        let chosen = even_moments(&views, 130);
        let times: HashSet<u32> = chosen.iter().map(|&index| views[index].time.to_bits()).collect();
        assert_eq!((chosen.len(), times.len()), (120, 6), "six of thirty moments, each with all twenty cameras");
        assert!(chosen.is_sorted_by(|a, b| a < b), "indices are ascending and distinct");
        assert_eq!(even_moments(&views, 7).len(), 7, "fewer than a moment has");
        assert_eq!(even_moments(&views, 600), Vec::from_iter(0..600), "all");
        assert!(even_moments(&[], 5).is_empty(), "none of none");
    }

    #[test]
    fn a_subset_is_even_in_time_and_among_cameras() {
        let views = views();
        for wanted in [15, 24, 30, 40, 60, 100] {
            let subset = even_subset(&views, wanted);
            assert_eq!(subset.len(), wanted, "the subset has the wanted number of views");
            assert!(subset.is_sorted_by(|a, b| a < b), "indices are ascending and distinct");
            let times: HashSet<u32> = subset.iter().map(|&i| views[i].time.to_bits()).collect();
            let cameras: HashSet<usize> = subset.iter().map(|i| i / 30).collect();
            assert!(times.len() >= wanted.min(30) * 4 / 5, "{wanted} views have {} times", times.len());
            assert!(cameras.len() >= wanted.min(20) / 2, "{wanted} views have {} cameras", cameras.len());
        }
        assert_eq!(even_subset(&views, 600).len(), 600, "all");
        assert_eq!(even_subset(&views, 9000).len(), 600, "all views if more are wanted");
    }

    #[test]
    fn a_camera_of_many_views_counts_once() {
        let views = views();
        assert_eq!(distinct_cameras(&views).len(), 20, "cameras");
        assert_eq!(distinct_times(&views), 30, "times");
    }
}
