//! Computing temporal filters of any kind.
//!
//! In: a scene, a kind of filter, key-frames, training cameras and views, an [`Engine`]. Out: a [`TemporalFilter`]; for
//! one shard of the views, or put together from the parts of all shards, the [`VisibilityMasks`].

use super::FilterError;
use super::visibility_masks::{VisibilityMasks, mask_views};
use crate::offline::dataset::TrainingView;
use crate::offline::dataset::selection::{distinct_cameras, moments, to_draw};
use crate::offline::engine::Engine;
use crate::offline::engine::Purpose;
use crate::offline::engine::memory::Pictures;
use crate::offline::score::{ScoreEngine, ScoreError, scorer};
use crate::offline::store::results::Key;
use crate::offline::store::shard::{Label, Shard, part, parts};
use crate::offline::store::stored::Stored;
use crate::offline::work::{FileError, Progress};
use crate::scene::{FilterKind, GaussianScene, RuntimeScene, TemporalFilter};
use std::path::{Path, PathBuf};

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

/// The number of key-frames of a filter, evenly spaced over the time interval, both ends included. Default:
/// `Count(11)`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeyFrames {
    /// This number of key-frames.
    Count(u32),
    /// One key-frame for each group of this number of moments of the training views.
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
            Self::Every(frames) => keys_every(moments(views), frames),
        }
    }
}

/// Computes a filter of any kind with `keys` key-frames; fewer than two count as two. Kinds that need views begin the
/// task "looking".
///
/// # Errors
/// A scene that cannot be drawn; for kinds that need views also views that do not fit the memory or the GPU or show
/// nothing of the scene, and a failure of the engine.
pub fn filter(
    engine: &mut Engine,
    scene: &GaussianScene,
    kind: FilterKind,
    keys: u32,
    views: &[TrainingView],
    progress: &mut dyn Progress,
) -> Result<TemporalFilter, FilterError> {
    if !needs_views(kind) {
        let (interval, cutoff) = (scene.trained_with.time_interval, scene.trained_with.marginal_cutoff);
        let gaussians = scene.gaussians()?;
        return Ok(TemporalFilter::support(gaussians.iter().copied(), interval, cutoff, keys.max(2) - 1));
    }
    let runtime = unfiltered(engine, scene, views)?;
    let mut scorer = scorer(engine, &runtime, runtime.trained_background())?;
    Ok(filter_of_views(scorer.as_mut(), &runtime, kind, keys, views, progress)?)
}

/// Returns the label of a filter of a kind that needs views. `input` is the file of the scene.
///
/// # Errors
/// The file cannot be read.
pub(crate) fn label(
    input: &Path,
    scene: &GaussianScene,
    kind: FilterKind,
    keys: u32,
    views: &[TrainingView],
    engine: &Engine,
    shard: Shard,
) -> Result<Label, FilterError> {
    let read = format!("{:?} {:?}", scene.trained_with, scene.playback);
    Ok(Label::new("mask", shard)
        .with("scene", Key::of_scene(input)?)
        .with("reading of the scene", Key::of(read.as_bytes()))
        .with("filter", filter_name(kind))
        .with("number of key-frames", keys)
        .with("set of training views", Key::of_views(views))
        .with("engine", engine.kind()))
}

/// Computes the masks of the shard of the label, and writes the part; returns false if the same part is there already.
///
/// # Errors
/// As [`filter`], and a part that cannot be written.
pub(crate) fn write_part(
    out: &Path,
    label: &Label,
    engine: &mut Engine,
    scene: &GaussianScene,
    kind: FilterKind,
    keys: u32,
    views: &[TrainingView],
    progress: &mut dyn Progress,
) -> Result<bool, FilterError> {
    if part::is_there(out, label) {
        return Ok(false);
    }
    let runtime = unfiltered(engine, scene, views)?;
    let mut scorer = scorer(engine, &runtime, runtime.trained_background())?;
    let masks = masks_of_shard(scorer.as_mut(), &runtime, kind, keys, views, label.shard(), progress)?;
    part::write(out, label, &masks.to_words().encode()?)?;
    Ok(true)
}

/// Returns the filter of the parts of all shards, which must have the inputs of the label. `count` is the number of
/// Gaussians.
///
/// # Errors
/// As `parts::in_order`, files that cannot be read, views that show nothing of the scene.
pub fn merge(
    paths: &[PathBuf],
    label: &Label,
    kind: FilterKind,
    keys: u32,
    count: usize,
) -> Result<TemporalFilter, FilterError> {
    let (paths, _) = parts::in_order(paths, Some(label))?;
    let (keys, mut merged) = (keys.max(2) as usize, None::<VisibilityMasks>);
    for path in &paths {
        let bytes = part::result(path, VisibilityMasks::words(keys, count).saturating_mul(4))?;
        let masks = Vec::<u32>::decode(&bytes).and_then(|words| VisibilityMasks::of_words(&words, keys, count));
        let message = "does not hold masks of the Gaussians of this scene: make it again";
        let masks = masks.ok_or_else(|| FileError::at(path, message))?;
        match &mut merged {
            Some(merged) => merged.merge(&masks),
            None => merged = Some(masks),
        }
    }
    Ok(merged.ok_or(ScoreError::NoViews)?.filter(kind)?)
}

/// Returns a scene in the runtime form without its filter, after checking that the engine can draw the views.
fn unfiltered(engine: &Engine, scene: &GaussianScene, views: &[TrainingView]) -> Result<RuntimeScene, FilterError> {
    let runtime = GaussianScene { filter: None, ..scene.clone() }.into_runtime()?;
    Pictures::looked_at(views).require(engine.headless(), Purpose::Dataset)?;
    Ok(runtime)
}

/// Computes the [`filter`] of a kind that needs views, with an engine that holds the scene. Begins the task "looking".
///
/// # Errors
/// Views that show nothing of the scene, a failure of the engine.
pub fn filter_of_views(
    scorer: &mut dyn ScoreEngine,
    scene: &RuntimeScene,
    kind: FilterKind,
    keys: u32,
    views: &[TrainingView],
    progress: &mut dyn Progress,
) -> Result<TemporalFilter, ScoreError> {
    masks_of_shard(scorer, scene, kind, keys, views, Shard::WHOLE, progress)?.filter(kind)
}

/// Computes the masks of the views of a shard, for a filter of a kind that needs views. Begins the task "looking".
///
/// # Errors
/// No views at all, a failure of the engine.
fn masks_of_shard(
    scorer: &mut dyn ScoreEngine,
    scene: &RuntimeScene,
    kind: FilterKind,
    keys: u32,
    views: &[TrainingView],
    shard: Shard,
    progress: &mut dyn Progress,
) -> Result<VisibilityMasks, ScoreError> {
    let (interval, optics) = (scene.trained_with.time_interval, scene.trained_with.optics());
    let (times, cameras) = (key_times(interval, keys), distinct_cameras(views));
    let between = if kind == FilterKind::Interval { to_draw(views, optics) } else { Vec::new() };
    let views = mask_views(&times, &cameras, &between, optics, interval);
    VisibilityMasks::of_shard(scorer, &views, times.len(), scene.len(), shard, progress)
}

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
    fn the_overlap_of_neighbors_is_the_shared_fraction_of_both() {
        let filter = TemporalFilter::from_bits(FilterKind::KeyFrame, 3, 4, vec![0b0111, 0b0110, 0]);
        assert_eq!(
            neighbor_overlap(&filter),
            [2.0 / 3.0, 0.0],
            "two of three Gaussians are in both segments, and none"
        );
    }
}
