//! Temporal filters of a scene, of any kind.
//!
//! In: a scene, a kind, a number of key-frames, training views. Out: a [`TemporalFilter`].

use crate::engine::Engine;
use crate::failure::Failure;
use crate::report::progress;
use bevy_gs4d::compress::masks::{interval_filter, key_frame_filter, key_frame_masks, key_times};
use bevy_gs4d::compress::sliced;
use bevy_gs4d::compress::views::{distinct_cameras, to_draw};
use bevy_gs4d::dataset::TrainingView;
use bevy_gs4d::frame::Background;
use bevy_gs4d::scene::{FilterKind, GaussianScene, TemporalFilter};

/// Names of the kinds.
pub const FILTERS: [(&str, FilterKind); 3] =
    [("support", FilterKind::Support), ("interval", FilterKind::Interval), ("key-frame", FilterKind::KeyFrame)];

/// The name of a kind.
pub fn filter_name(kind: FilterKind) -> &'static str {
    FILTERS.iter().find(|(_, other)| *other == kind).map_or("support", |(name, _)| name)
}

/// Makes a filter with `keys` key-frames, two at least.
///
/// # Errors
/// A scene that cannot be drawn, views that show nothing of it, a failure of the engine.
pub fn filter(
    engine: &mut Engine,
    scene: &GaussianScene,
    kind: FilterKind,
    keys: u32,
    views: &[TrainingView],
) -> Result<TemporalFilter, Failure> {
    let (interval, raster_fov) = (scene.trained_with.time_interval, scene.trained_with.raster_fov);
    let count = scene.len();
    if kind == FilterKind::Support {
        let gaussians = sliced(scene)?;
        return Ok(TemporalFilter::support(gaussians.iter().copied(), interval, keys.max(2) - 1));
    }
    let runtime = GaussianScene { filter: None, ..scene.clone() }.into_runtime()?;
    let (times, cameras) = (key_times(interval, keys), distinct_cameras(views));
    let inside = if kind == FilterKind::Interval { views.len() } else { 0 };
    let bar = progress(times.len() * cameras.len() + inside, "looking");
    let mut scorer = engine.scorer(&runtime, Background::trained(&runtime))?;
    let masks = key_frame_masks(scorer.as_mut(), &cameras, raster_fov, &times, count, || bar.inc(1))?;
    let filter = match kind {
        FilterKind::Interval => {
            let views = to_draw(views, raster_fov);
            interval_filter(scorer.as_mut(), &masks, &views, interval, count, || bar.inc(1))?
        }
        _ => key_frame_filter(&masks, count),
    };
    bar.finish_and_clear();
    Ok(filter)
}
