//! Cameras that are not synchronized.
//!
//! In: offsets and residuals that were measured. Out: findings about cameras that are off.

use super::evidence::Evidence;
use super::finding::{Finding, Severity, Subject};

/// Offsets by motion, in frames, from which they are a warning and grave. Synchronized cameras have up to 0.6. Of two
/// cameras each has half of the difference, and half of this counts.
const OFF: f32 = 1.5;
const GRAVE: f32 = 2.0;
/// Residual of the sound, in frames.
const RESIDUAL: f32 = 0.5;

/// Returns the findings about synchrony.
pub(super) fn sync(evidence: &Evidence) -> Vec<Finding> {
    let Some(synchrony) = evidence.synchrony.as_ref().filter(|synchrony| synchrony.frame > 0.0) else {
        return Vec::new();
    };
    let compared = synchrony.cameras.iter().filter(|camera| camera.offset.is_some()).count();
    let [off, grave] = if compared > 2 { [OFF, GRAVE] } else { [OFF / 2.0, GRAVE / 2.0] };
    let mut findings = Vec::new();
    for camera in &synchrony.cameras {
        let Some(seen) = evidence.cameras.get(camera.camera) else { continue };
        let name = seen.name.as_str();
        let offset = camera.offset.map(|offset| offset / synchrony.frame);
        if let Some(frames) = offset.filter(|frames| frames.abs() >= off) {
            let severity = if frames.abs() >= grave { Severity::Grave } else { Severity::Warning };
            let side = if frames > 0.0 { "late" } else { "early" };
            let (count, milliseconds) = (frames.abs(), frames.abs() * synchrony.frame * 1000.0);
            let what = format!(
                "{name} is not synchronized: what moves in its pictures is {count:.1} frames ({milliseconds:.0} ms) \
                 {side}."
            );
            let remedy = "Give its offset, or film a clap that all cameras hear and see.";
            findings.push(Finding::new(severity, Subject::Synchrony, what, remedy).about([name]));
        }
        let residual = camera.residual.map(|residual| (residual / synchrony.frame).abs());
        if let Some(frames) = residual.filter(|frames| *frames > RESIDUAL) {
            let what = format!("The sound of {name} disagrees with that of the other cameras by {frames:.1} frames.");
            let remedy = "Place a sound source in the middle, or give the offsets: sound needs 2.9 ms for a meter.";
            findings.push(Finding::new(Severity::Warning, Subject::Synchrony, what, remedy).about([name]));
        }
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::super::evidence::tests::{evidence, seen};
    use super::super::evidence::{CameraSync, Synchrony};
    use super::*;

    /// Returns the findings on cameras with these offsets, in frames of a sixtieth of a second.
    fn found(frames: &[Option<f32>]) -> Vec<Finding> {
        let mut all = evidence((0..frames.len()).map(|index| seen(index, 4, Vec::new())).collect());
        let of = |(camera, frames): (usize, &Option<f32>)| {
            let offset = frames.map(|frames| frames / 60.0);
            CameraSync { camera, offset, residual: None }
        };
        all.synchrony = Some(Synchrony { frame: 1.0 / 60.0, cameras: frames.iter().enumerate().map(of).collect() });
        sync(&all)
    }

    #[test]
    fn a_camera_that_is_three_frames_late_is_grave() {
        let found = found(&[Some(0.06), Some(3.0), None, Some(-0.12)]);
        assert_eq!((found.len(), found[0].severity), (1, Severity::Grave), "one camera: {found:?}");
        assert!(found[0].what.starts_with("cam1") && found[0].what.contains("3.0 frames (50 ms) late"), "{}", found[0]);
    }

    #[test]
    fn the_error_of_a_comparison_by_motion_is_no_offset() {
        assert_eq!(found(&[Some(0.6), Some(-0.6), Some(0.0)]), [], "synchronized cameras have up to 0.6 frames");
        let several = found(&[Some(0.0), Some(1.6), Some(0.0)]);
        assert_eq!((several.len(), several[0].severity), (1, Severity::Warning), "one of three: {several:?}");
        assert_eq!(found(&[Some(0.3), Some(-0.3), None]), [], "two that differ by 0.6 frames");
        assert_eq!(found(&[Some(0.8), Some(-0.8), None]).len(), 2, "two that differ by 1.6 frames");
    }
}
