//! Computing temporal filters of any kind, and the paper's visibility masks at key-frames.
//!
//! In: a scene, a kind of filter, key-frames, training cameras and views, an [`Engine`]. Out: a [`TemporalFilter`]. A
//! mask is the set of Gaussians that are visible at a key-frame, 32 to a word.

use super::dataset::TrainingView;
use super::dataset::selection::{distinct_cameras, distinct_times, to_draw};
use super::engine::Engine;
use super::memory_check::{BY_RESOLUTION, Pictures};
use super::score::{ScoreEngine, ScoreError, Want};
use super::{OfflineError, Progress, sliced};
use crate::scene::{FilterKind, GaussianScene, RuntimeScene, TemporalFilter};
use crate::view::{Camera, RasterFov, View};

/// Every kind of filter that can be computed, with its name.
pub const FILTER_NAMES: [(&str, FilterKind); 3] =
    [("support", FilterKind::Support), ("interval", FilterKind::Interval), ("key-frame", FilterKind::KeyFrame)];

/// Returns the name of a kind.
pub fn filter_name(kind: FilterKind) -> &'static str {
    FILTER_NAMES.iter().find(|(_, other)| *other == kind).map_or("window", |(name, _)| name)
}

/// Returns whether a kind of filter is computed from training views; the other kinds need only the Gaussians.
pub fn needs_views(kind: FilterKind) -> bool {
    matches!(kind, FilterKind::KeyFrame | FilterKind::Interval)
}

/// The number of key-frames of a filter, evenly spaced over the time interval, both ends included. Default: `Count(11)`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeyFrames {
    /// This number of key-frames.
    Count(u32),
    /// One key-frame for this number of timestamps of the training views.
    Every(usize),
}

impl Default for KeyFrames {
    fn default() -> Self {
        Self::Count(11)
    }
}

impl KeyFrames {
    /// Returns the number of key-frames, given the training views. It may exceed the limit of a filter,
    /// [`MAX_SEGMENTS`](crate::scene::MAX_SEGMENTS) + 1.
    pub fn count(self, views: &[TrainingView]) -> usize {
        match self {
            Self::Count(count) => count as usize,
            Self::Every(frames) => keys_every(distinct_times(views), frames),
        }
    }
}

/// Computes a filter of any kind with `keys` key-frames; fewer than two count as two. Kinds that need views begin the
/// task "looking".
///
/// # Errors
/// A scene that cannot be drawn; for kinds that need views also views that do not fit the memory or the GPU or show nothing of it, a
/// failure of the engine.
pub fn filter(
    engine: &mut Engine,
    scene: &GaussianScene,
    kind: FilterKind,
    keys: u32,
    views: &[TrainingView],
    progress: &mut dyn Progress,
) -> Result<TemporalFilter, OfflineError> {
    if !needs_views(kind) {
        let (interval, cutoff) = (scene.trained_with.time_interval, scene.trained_with.marginal_cutoff);
        let gaussians = sliced(scene)?;
        return Ok(TemporalFilter::support(gaussians.iter().copied(), interval, cutoff, keys.max(2) - 1));
    }
    let runtime = GaussianScene { filter: None, ..scene.clone() }.into_runtime()?;
    Pictures::looked_at(views).require(engine.headless(), BY_RESOLUTION)?;
    let mut scorer = engine.scorer(&runtime, runtime.trained_background())?;
    Ok(seen_filter(scorer.as_mut(), &runtime, kind, keys, views, progress)?)
}

/// Computes the [`filter`] of a kind that needs views, with an engine that holds the scene. Begins the task "looking".
///
/// # Errors
/// Views that show nothing of the scene, a failure of the engine.
pub fn seen_filter(
    scorer: &mut dyn ScoreEngine,
    scene: &RuntimeScene,
    kind: FilterKind,
    keys: u32,
    views: &[TrainingView],
    progress: &mut dyn Progress,
) -> Result<TemporalFilter, ScoreError> {
    let (interval, raster_fov) = (scene.trained_with.time_interval, scene.trained_with.raster_fov);
    let (times, cameras, count) = (key_times(interval, keys), distinct_cameras(views), scene.len());
    let inside = if kind == FilterKind::Interval { views.len() } else { 0 };
    progress.begin("looking", times.len() * cameras.len() + inside);
    let masks = key_frame_masks(scorer, &cameras, raster_fov, &times, count, progress)?;
    let filter = if kind == FilterKind::Interval {
        interval_filter(scorer, &masks, &to_draw(views, raster_fov), interval, count, progress)?
    } else {
        key_frame_filter(&masks, count)
    };
    progress.finish();
    Ok(filter)
}

/// A set of Gaussians: Gaussian `i` at bit `i % 32` of word `i / 32`.
pub type Mask = Vec<u32>;

/// Returns `keys` evenly spaced times over the interval, both ends included; at least two.
pub fn key_times(interval: [f32; 2], keys: u32) -> Vec<f32> {
    let [first, last] = interval.map(f64::from);
    let segments = keys.max(2) - 1;
    (0..=segments).map(|j| (first + (last - first) * f64::from(j) / f64::from(segments)) as f32).collect()
}

/// Returns the number of key-frames, both ends included, if there is one for every `frames` of `times` timestamps; at
/// least two.
pub fn keys_every(times: usize, frames: usize) -> usize {
    times.saturating_sub(1).div_ceil(frames.max(1)).max(1) + 1
}

/// Adds the Gaussians that the view blends into at least one pixel to a set.
///
/// # Errors
/// A failure of the engine.
pub fn add_blended(engine: &mut dyn ScoreEngine, view: &View, mask: &mut [u32]) -> Result<(), ScoreError> {
    let score = engine.score(view, Want::Contribution)?;
    for (word, values) in mask.iter_mut().zip(score.contribution.chunks(32)) {
        for (bit, &contribution) in values.iter().enumerate() {
            *word |= u32::from(contribution > 0.0) << bit;
        }
    }
    Ok(())
}

/// Returns one mask for each key-frame: the Gaussians that any of the cameras blends at that time. `count` is the
/// number of Gaussians. Advances the caller's task once for each view.
///
/// # Errors
/// No cameras, cameras that show nothing of the scene at any of the times, a failure of the engine.
pub fn key_frame_masks(
    engine: &mut dyn ScoreEngine,
    cameras: &[Camera],
    raster_fov: RasterFov,
    times: &[f32],
    count: usize,
    progress: &mut dyn Progress,
) -> Result<Vec<Mask>, ScoreError> {
    if cameras.is_empty() {
        return Err(ScoreError::NoViews);
    }
    let mut masks = vec![vec![0; TemporalFilter::words(count)]; times.len()];
    for (mask, &time) in masks.iter_mut().zip(times) {
        for camera in cameras {
            if progress.is_interrupted() {
                return Err(ScoreError::Interrupted);
            }
            add_blended(engine, &camera.view(time, raster_fov), mask)?;
            progress.advance();
        }
    }
    if masks.iter().flatten().all(|&word| word == 0) {
        return Err(ScoreError::NothingContributes);
    }
    Ok(masks)
}

/// Returns the filter of the paper: in each segment, the union of the masks at its two ends. Pass at least two
/// masks of `count` Gaussians.
///
/// # Panics
/// If a mask does not have `count` Gaussians.
pub fn key_frame_filter(masks: &[Mask], count: usize) -> TemporalFilter {
    from_segments(FilterKind::KeyFrame, &unions(masks), count)
}

/// Returns the key-frame filter with, in each segment, also the Gaussians that any of the views whose time lies in it
/// blends. Pass at least two masks of `count` Gaussians. Advances the caller's task once for each view.
///
/// # Errors
/// A failure of the engine.
///
/// # Panics
/// If a mask does not have `count` Gaussians, or if there are views but fewer than two masks.
pub fn interval_filter(
    engine: &mut dyn ScoreEngine,
    masks: &[Mask],
    views: &[View],
    interval: [f32; 2],
    count: usize,
    progress: &mut dyn Progress,
) -> Result<TemporalFilter, ScoreError> {
    let mut segments = unions(masks);
    let ends = from_segments(FilterKind::Interval, &segments, count);
    for view in views {
        if progress.is_interrupted() {
            return Err(ScoreError::Interrupted);
        }
        let segment = ends.segment_of(view.time, interval) as usize;
        add_blended(engine, view, &mut segments[segment])?;
        progress.advance();
    }
    Ok(from_segments(FilterKind::Interval, &segments, count))
}

/// Returns the intersection over union of the sets of each pair of neighboring segments; 1 if both are empty.
pub fn neighbor_overlap(filter: &TemporalFilter) -> Vec<f64> {
    let bits = filter.to_bits();
    let sets: Vec<&[u32]> = bits.chunks(TemporalFilter::words(filter.count).max(1)).collect();
    let overlap = |pair: &[&[u32]]| {
        let words = || pair[0].iter().zip(pair[1]);
        let both: u32 = words().map(|(a, b)| (a & b).count_ones()).sum();
        let any: u32 = words().map(|(a, b)| (a | b).count_ones()).sum();
        if any == 0 { 1.0 } else { f64::from(both) / f64::from(any) }
    };
    sets.windows(2).map(overlap).collect()
}

fn unions(masks: &[Mask]) -> Vec<Mask> {
    masks.windows(2).map(|pair| pair[0].iter().zip(&pair[1]).map(|(a, b)| a | b).collect()).collect()
}

fn from_segments(kind: FilterKind, segments: &[Mask], count: usize) -> TemporalFilter {
    TemporalFilter::from_bits(kind, segments.len() as u32, count, segments.concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn key_frames_are_even_and_include_both_ends() {
        assert_eq!(key_times([0.0, 1.0], 6), [0.0, 0.2, 0.4, 0.6, 0.8, 1.0], "the key-frames of the paper on D-NeRF");
        assert_eq!(key_times([2.0, 10.0], 3), [2.0, 6.0, 10.0], "another interval");
        assert_eq!(key_times([0.0, 1.0], 0), [0.0, 1.0], "at least two key-frames");
        assert_eq!(keys_every(300, 20), 16, "the key-frames of the paper on N3V");
        assert_eq!(keys_every(31, 10), 4, "a whole number of steps");
        assert_eq!((keys_every(1, 20), keys_every(0, 0)), (2, 2), "at least two key-frames");
    }

    #[test]
    fn a_segment_has_the_union_of_the_masks_at_its_ends() {
        let filter = key_frame_filter(&[vec![0b0001], vec![0b0110], vec![0b0100]], 4);
        assert_eq!(filter.segments, 2, "one segment less than masks");
        assert_eq!(filter.to_bits(), [0b0111, 0b0110], "unions of neighboring masks");
        assert_eq!(neighbor_overlap(&filter), [2.0 / 3.0], "two of three Gaussians are in both segments");
    }
}
