//! The settings of a capture that follow from its views.
//!
//! In: training views, what their times mean, optionally an interval of time and a duration. Out: [`TrainedWith`] and
//! [`PlaybackHints`].

use super::error::StartError;
use super::region::Region;
use crate::offline::dataset::selection::to_draw;
use crate::offline::dataset::{Clock, TrainingView};
use crate::scene::near::near_limit;
use crate::scene::{Origin, PlaybackHints, TrainedCameras, TrainedWith, UpAxis};
use crate::view::{Lens, RasterFov};
use glam::{DVec3, Vec3};

/// The extent of the cameras is the largest distance from their center times this.
const EXTENT: f64 = 1.1;
/// Largest distance of the cameras from their common target, in extents; larger ones count as this.
const FARTHEST: f32 = 5.0;
/// Times that are closer together than this are seconds, not shares of the interval.
const LEAST_SHARE: f32 = 0.1;
/// Cameras closer together than this share of their distance from the origin stand in one place.
const ONE_PLACE: f64 = 1e-6;

const AXES: [UpAxis; 6] = [UpAxis::PosX, UpAxis::NegX, UpAxis::PosY, UpAxis::NegY, UpAxis::PosZ, UpAxis::NegZ];

/// Settings of a capture that its views do not contain. Default: the interval of the views, a black background, the
/// coordinates of the dataset.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CaptureSettings {
    /// First and last time, as the dataset counts times; `None`: 0 to 1 if no view is outside, frames are not numbered,
    /// times have no origin of their own, and they span at least a tenth or are all the same; else from the first to the
    /// last time of the views.
    pub time_interval: Option<[f64; 2]>,
    /// Background color, in the space of the images.
    pub background: [f32; 3],
    /// Seconds of one pass through the interval at speed 1, 0 for a still; `None`: as the dataset says, else one second
    /// for each unit of time.
    pub duration_seconds: Option<f32>,
    /// The origin of the views in the coordinates of the dataset.
    pub origin: Origin,
}

/// Returns the settings of a capture of these views. `clock` says what their times mean.
///
/// # Errors
/// Views from one place, a time that is not finite, an interval without length.
pub fn capture_of(
    views: &[TrainingView],
    settings: &CaptureSettings,
    clock: Clock,
) -> Result<(TrainedWith, PlaybackHints), StartError> {
    if let Some(view) = views.iter().find(|view| !view.time.is_finite()) {
        return Err(StartError::Time { view: view.name.clone() });
    }
    let spatial_lr_scale = extent(views).ok_or(StartError::OnePlace { views: views.len() })?;
    let origin = settings.origin;
    let given = settings.time_interval.map(|interval| counted_from(origin.time, interval)).transpose()?;
    let time_interval = given.unwrap_or_else(|| interval(views, clock.is_numbered || origin.time != 0.0));
    let is_intrinsic = |view: &TrainingView| matches!(view.camera.lens, Lens::Intrinsics { .. });
    let cameras = if views.iter().any(is_intrinsic) { TrainedCameras::Intrinsics } else { TrainedCameras::Fov };
    let trained_with = TrainedWith {
        time_interval,
        background: settings.background,
        raster_fov: RasterFov::Corrected,
        cameras,
        spatial_lr_scale,
        near: near_limit(size(views, spatial_lr_scale)),
        origin,
        ..TrainedWith::default()
    };
    let of_dataset = Some(trained_with.time_span() * clock.unit_seconds).filter(|seconds| seconds.is_finite());
    let duration_seconds = settings.duration_seconds.or(of_dataset).unwrap_or(trained_with.time_span());
    let playback = PlaybackHints { up: up(views), duration_seconds };
    Ok((trained_with, playback))
}

/// Returns the extent of the cameras (section 5.2 of the 4DGS model); `None` if all stand in one place.
fn extent(views: &[TrainingView]) -> Option<f64> {
    let centers: Vec<DVec3> = views.iter().map(|view| center(view).as_dvec3()).collect();
    let middle = centers.iter().sum::<DVec3>() / centers.len().max(1) as f64;
    let farthest = centers.iter().map(|center| center.distance(middle)).fold(0.0, f64::max);
    (farthest > ONE_PLACE * middle.length().max(f64::MIN_POSITIVE)).then_some(EXTENT * farthest)
}

/// Returns the size of the scene, estimated from its cameras: the median distance of the cameras from their common
/// target, clamped to one to five times their extent. If cameras that are close together look in nearly the same
/// direction, the target is not known well.
fn size(views: &[TrainingView], extent: f64) -> f32 {
    let drawn = to_draw(views, RasterFov::Corrected);
    let distance = Region::of(drawn.iter()).ok().and_then(|region| {
        let mut distances: Vec<f32> = drawn.iter().map(|view| view.camera_position.distance(region.center)).collect();
        distances.sort_unstable_by(f32::total_cmp);
        distances.get(distances.len() / 2).copied()
    });
    let extent = extent as f32;
    distance.unwrap_or(extent).min(FARTHEST * extent).max(extent)
}

fn center(view: &TrainingView) -> Vec3 {
    view.camera.world_to_camera.inverse().w_axis.truncate()
}

/// Returns an interval of the dataset in the times of the capture.
fn counted_from(origin: f64, interval: [f64; 2]) -> Result<[f32; 2], StartError> {
    let [first, last] = interval.map(|time| (time - origin) as f32);
    let is_whole = first < last && (last - first).is_finite();
    if is_whole { Ok([first, last]) } else { Err(StartError::Interval { interval }) }
}

/// Returns 0 to 1 if all times are between 0 and 1, frames are not numbered, and the times span at least a tenth or are all
/// the same; else the first and the last time, or one unit from the only time.
fn interval(views: &[TrainingView], is_numbered: bool) -> [f32; 2] {
    let times = || views.iter().map(|view| view.time);
    let [first, last] = [times().fold(f32::INFINITY, f32::min), times().fold(f32::NEG_INFINITY, f32::max)];
    let is_short = first < last && last - first < LEAST_SHARE;
    let are_shares = !is_numbered && !is_short && (0.0..=1.0).contains(&first) && (0.0..=1.0).contains(&last);
    match are_shares {
        true => [0.0, 1.0],
        false if first < last => [first, last],
        false => [first, first + 1.0],
    }
}

/// Returns the axis closest to the mean direction that points up in the images.
fn up(views: &[TrainingView]) -> UpAxis {
    let mean: Vec3 = views.iter().map(|view| -view.camera.world_to_camera.row(1).truncate()).sum();
    let along = |axis: &&UpAxis| axis.vector().dot(mean);
    // If the directions cancel out, no axis is closest: +z, the default.
    let best = AXES.iter().max_by(|a, b| along(a).total_cmp(&along(b)));
    best.copied().filter(|axis| axis.vector().dot(mean) > 0.0).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Camera, NEAR};
    use glam::UVec2;

    fn view(eye: Vec3, up: Vec3, time: f32) -> TrainingView {
        let camera = Camera::look_at(eye, Vec3::ZERO, up, 0.7, UVec2::splat(8));
        let (name, image) = ("a".to_owned(), "none.png".into());
        let correction = Default::default();
        TrainingView { name, camera, time, original: camera.size, image, mask: None, correction }
    }

    fn of(times: [f32; 2]) -> TrainedWith {
        let views = [view(Vec3::X * 4.0, Vec3::Z, times[0]), view(Vec3::Y * 4.0, Vec3::Z, times[1])];
        capture_of(&views, &CaptureSettings::default(), Clock::default()).expect("two places").0
    }

    #[test]
    fn the_interval_is_that_of_the_views() {
        assert_eq!(of([0.0, 0.5]).time_interval, [0.0, 1.0], "times of a share of the interval");
        assert_eq!(of([0.0, 9.5]).time_interval, [0.0, 9.5], "seconds");
        assert_eq!(of([7.0, 7.0]).time_interval, [7.0, 8.0], "a still has an interval too");
        let views = [view(Vec3::X, Vec3::Z, 0.0), view(Vec3::Y, Vec3::Z, 0.5)];
        let numbered = Clock { is_numbered: true, ..Clock::default() };
        let found = capture_of(&views, &CaptureSettings::default(), numbered).expect("two places").0.time_interval;
        assert_eq!(found, [0.0, 0.5], "numbered frames end at the last");
        let given = CaptureSettings { time_interval: Some([0.0, 10.0]), ..CaptureSettings::default() };
        let views = [view(Vec3::X, Vec3::Z, 0.0), view(Vec3::Y, Vec3::Z, 9.5)];
        assert_eq!(
            capture_of(&views, &given, Clock::default()).expect("two places").0.time_interval,
            [0.0, 10.0],
            "as given"
        );
    }

    #[test]
    fn times_of_an_origin_are_no_shares() {
        let views = [view(Vec3::X, Vec3::Z, 0.25), view(Vec3::Y, Vec3::Z, 0.75)];
        let origin = Origin { place: [0.0; 3], time: 1_700_000_000.0 };
        let of = |time_interval| {
            let settings = CaptureSettings { time_interval, origin, ..CaptureSettings::default() };
            capture_of(&views, &settings, Clock::default()).map(|(trained_with, _)| trained_with)
        };
        let found = of(None).expect("two places");
        assert_eq!((found.time_interval, found.origin), ([0.25, 0.75], origin), "from the first view to the last");
        let found = of(Some([1_700_000_000.0, 1_700_000_000.5])).expect("two places").time_interval;
        assert_eq!(found, [0.0, 0.5], "an interval of the dataset is counted from the origin");
        let empty = [1_700_000_000.0, 1_700_000_000.0 + 1e-7];
        assert_eq!(of(Some(empty)), Err(StartError::Interval { interval: empty }), "an interval without length");
    }

    #[test]
    fn the_duration_is_given_or_that_of_the_dataset() {
        let views = [view(Vec3::X, Vec3::Z, 0.0), view(Vec3::Y, Vec3::Z, 2.0)];
        let seconds = |duration_seconds, unit| {
            let settings = CaptureSettings { duration_seconds, ..CaptureSettings::default() };
            let clock = Clock { unit_seconds: unit, is_numbered: false };
            capture_of(&views, &settings, clock).expect("two places").1.duration_seconds
        };
        assert_eq!(seconds(None, 1.0), 2.0, "times are seconds unless the dataset says otherwise");
        assert_eq!(seconds(None, 4.0), 8.0, "two units of four seconds");
        assert_eq!(seconds(Some(3.0), 4.0), 3.0, "as given");
    }

    #[test]
    fn the_extent_and_the_axis_are_those_of_the_cameras() {
        let views = [view(Vec3::X * 4.0, Vec3::Y, 0.0), view(Vec3::NEG_X * 4.0, Vec3::Y, 1.0)];
        let (trained_with, playback) =
            capture_of(&views, &CaptureSettings::default(), Clock::default()).expect("two places");
        assert!((trained_with.spatial_lr_scale - 4.4).abs() < 1e-5, "1.1 times 4: {}", trained_with.spatial_lr_scale);
        assert_eq!((playback.up, playback.duration_seconds), (UpAxis::PosY, 1.0), "up and duration");
    }

    #[test]
    fn the_near_limit_is_that_of_the_original_unless_the_cameras_are_close_together() {
        let near = |scale: f32| {
            let views = [view(Vec3::X * scale, Vec3::Z, 0.0), view(Vec3::Y * scale, Vec3::Z, 1.0)];
            capture_of(&views, &CaptureSettings::default(), Clock::default()).expect("two places").0.near
        };
        for scale in [1e4, 4.0, 2.1] {
            assert_eq!(near(scale), NEAR, "cameras {scale} units from what they look at");
        }
        for scale in [1.0, 0.05, 0.003] {
            assert!((near(scale) / (0.1 * scale) - 1.0).abs() < 1e-4, "a tenth of {scale}: {}", near(scale));
        }
    }

    #[test]
    fn views_that_no_capture_can_be_trained_on_are_refused() {
        let one = [view(Vec3::X * 4.0, Vec3::Z, 0.0), view(Vec3::X * 4.0, Vec3::Z, 1.0)];
        let refused = capture_of(&one, &CaptureSettings::default(), Clock::default());
        assert_eq!(refused, Err(StartError::OnePlace { views: 2 }), "one place has no depth");
        let timeless = [view(Vec3::X, Vec3::Z, f32::NAN), view(Vec3::Y, Vec3::Z, 0.0)];
        let refused = capture_of(&timeless, &CaptureSettings::default(), Clock::default());
        assert_eq!(refused, Err(StartError::Time { view: "a".to_owned() }), "a time that is no number");
    }
}
