//! The times of frames, by the clocks of the cameras.
//!
//! In: footage, and by how many seconds the times of each camera are too late. Out: the footage with the times of one
//! clock.

use super::source::Source;
use crate::offline::dataset::Clock;

/// Returns footage with the times of one clock, given the seconds by which those of each camera are too late. Times
/// that are the numbers of frames, and those that change, become shares of the time of all frames.
pub(super) fn timed(mut source: Source, offsets: &[f64]) -> Source {
    let is_shifted = offsets.iter().any(|offset| *offset != 0.0);
    if !source.clock.is_numbered && !is_shifted {
        return source;
    }
    let unit = f64::from(source.clock.unit_seconds);
    let late = |camera: usize| offsets.get(camera).copied().unwrap_or(0.0) / unit;
    let times: Vec<f64> = source.shots.iter().map(|shot| f64::from(shot.view.time) - late(shot.camera)).collect();
    let [first, last] =
        times.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[first, last], &time| [first.min(time), last.max(time)]);
    let span = if first < last { last - first } else { 0.0 };
    for (shot, time) in source.shots.iter_mut().zip(times) {
        shot.view.time = if span > 0.0 { ((time - first) / span) as f32 } else { 0.0 };
    }
    source.clock =
        if span > 0.0 { Clock { unit_seconds: (span * unit) as f32, is_numbered: false } } else { Clock::default() };
    source
}

#[cfg(test)]
mod tests {
    use super::super::source::Shot;
    use super::*;
    use crate::offline::dataset::{Split, TrainingView};
    use crate::view::Camera;
    use glam::{UVec2, Vec3};

    /// Returns footage of two cameras at the times 0, 1 and 2 of units of half a second.
    fn source(is_numbered: bool) -> Source {
        let camera = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 0.7, UVec2::splat(8));
        let shot = |index: usize| {
            let (name, original, correction) = (index.to_string(), camera.size, Default::default());
            let image = name.clone().into();
            let view = TrainingView { name, camera, time: (index % 3) as f32, original, image, mask: None, correction };
            Shot { view, split: Split::Train, camera: index / 3, name: index.to_string() }
        };
        let cameras = ["left", "right"].map(str::to_owned).into();
        let clock = Clock { unit_seconds: 0.5, is_numbered };
        Source { cameras, shots: (0..6).map(shot).collect(), clock, points: None }
    }

    fn times(source: &Source) -> Vec<f32> {
        source.shots.iter().map(|shot| shot.view.time).collect()
    }

    #[test]
    fn late_cameras_are_put_earlier() {
        let timed = timed(source(true), &[0.0, 0.25]);
        assert_eq!(times(&timed), [0.2, 0.6, 1.0, 0.0, 0.4, 0.8], "half a unit earlier, as shares of 2.5 units");
        assert_eq!(timed.clock, Clock { unit_seconds: 1.25, is_numbered: false }, "the seconds of all frames");
    }

    #[test]
    fn times_that_need_no_change_stay() {
        let (unchanged, expected) = (timed(source(false), &[0.0, 0.0]), source(false));
        assert_eq!((times(&unchanged), unchanged.clock), (times(&expected), expected.clock), "no clock is wrong");
        assert_eq!(times(&timed(source(true), &[])), [0.0, 0.5, 1.0, 0.0, 0.5, 1.0], "numbers become shares");
    }
}
