//! Temporal filters of a scene, of any kind.
//!
//! In: a scene, a kind, a number of key-frames, training views. Out: a [`TemporalFilter`].

use super::engine::Engine;
use super::failure::Failure;
use super::report::progress;
use crate::offline::dataset::TrainingView;
use crate::offline::dataset::selection::{distinct_cameras, to_draw};
use crate::offline::sliced;
use crate::offline::temporal_filter::{interval_filter, key_frame_filter, key_frame_masks, key_times};
use crate::scene::{FilterKind, GaussianScene, TemporalFilter};

/// Names of the kinds.
pub const FILTERS: [(&str, FilterKind); 3] =
    [("support", FilterKind::Support), ("interval", FilterKind::Interval), ("key-frame", FilterKind::KeyFrame)];

/// The name of a kind.
pub fn filter_name(kind: FilterKind) -> &'static str {
    FILTERS.iter().find(|(_, other)| *other == kind).map_or("support", |(name, _)| name)
}

/// Key-frames unless said otherwise.
pub const KEYS: u32 = 11;

/// Makes a filter of any kind with `keys` key-frames, two at least.
///
/// # Errors
/// As [`support`] and [`by_views`].
pub fn filter(
    engine: &mut Engine,
    scene: &GaussianScene,
    kind: FilterKind,
    keys: u32,
    views: &[TrainingView],
) -> Result<TemporalFilter, Failure> {
    if kind == FilterKind::Support { support(scene, keys) } else { by_views(engine, scene, kind, keys, views) }
}

/// The filter that needs no views.
///
/// # Errors
/// A scene that cannot be drawn.
pub fn support(scene: &GaussianScene, keys: u32) -> Result<TemporalFilter, Failure> {
    let gaussians = sliced(scene)?;
    Ok(TemporalFilter::support(gaussians.iter().copied(), scene.trained_with.time_interval, keys.max(2) - 1))
}

/// The filters that look at what training cameras see.
///
/// # Errors
/// A scene that cannot be drawn, views that show nothing of it, a failure of the engine.
pub fn by_views(
    engine: &mut Engine,
    scene: &GaussianScene,
    kind: FilterKind,
    keys: u32,
    views: &[TrainingView],
) -> Result<TemporalFilter, Failure> {
    let (interval, raster_fov) = (scene.trained_with.time_interval, scene.trained_with.raster_fov);
    let runtime = GaussianScene { filter: None, ..scene.clone() }.into_runtime()?;
    let (times, cameras, count) = (key_times(interval, keys), distinct_cameras(views), scene.len());
    let inside = if kind == FilterKind::Interval { views.len() } else { 0 };
    let mut scorer = engine.scorer(&runtime, runtime.trained_background())?;
    let bar = progress(times.len() * cameras.len() + inside, "looking");
    let masks = key_frame_masks(scorer.as_mut(), &cameras, raster_fov, &times, count, || bar.inc(1))?;
    let filter = if kind == FilterKind::Interval {
        let views = to_draw(views, raster_fov);
        interval_filter(scorer.as_mut(), &masks, &views, interval, count, || bar.inc(1))?
    } else {
        key_frame_filter(&masks, count)
    };
    bar.finish_and_clear();
    Ok(filter)
}
