//! Selecting training views.
//!
//! In: the training views of a dataset. Out: an even subset of the views, their distinct cameras, the camera of each
//! view, the number of their distinct times and of their moments.

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

/// Returns the median distance of two times of a camera that follow each other; of all views, if no camera has two; the
/// whole unit of time if all views are of one moment.
pub fn distance_of_moments(views: &[TrainingView], cameras: &[u32]) -> f32 {
    let gaps = |mut times: Vec<(u32, f32)>| -> Vec<f32> {
        times.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let of_one = times.windows(2).filter(|pair| pair[0].0 == pair[1].0);
        of_one.map(|pair| pair[1].1 - pair[0].1).filter(|gap| *gap > 0.0).collect()
    };
    let mut found = gaps(cameras.iter().zip(views).map(|(&camera, view)| (camera, view.time)).collect());
    if found.is_empty() {
        found = gaps(views.iter().map(|view| (0, view.time)).collect());
    }
    found.sort_by(f32::total_cmp);
    found.get(found.len() / 2).copied().unwrap_or(1.0)
}

/// Returns the number of moments of the views: times of one frame of several cameras, whose clocks may differ by a part of
/// it, are one moment.
pub fn moments(views: &[TrainingView]) -> usize {
    let times = || views.iter().map(|view| view.time);
    let (Some(first), Some(last)) = (times().reduce(f32::min), times().reduce(f32::max)) else { return 0 };
    let distances = (last - first) / distance_of_moments(views, &camera_numbers(views));
    distinct_times(views).min(distances.round() as usize + 1)
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
    fn clocks_that_differ_by_parts_of_a_frame_make_no_more_moments() {
        let mut views = views();
        assert_eq!(moments(&views), 30, "one clock");
        views.iter_mut().enumerate().for_each(|(index, view)| view.time += 0.02 / 29.0 * (index / 30) as f32);
        assert_eq!(distinct_times(&views), 600, "each camera has times of its own");
        assert_eq!(moments(&views), 30, "twenty clocks");
        assert_eq!(moments(&views[..1]), 1, "one picture");
        assert_eq!(moments(&[]), 0, "none");
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
