//! The section "warnings": reasons why captures are not visible.
//!
//! In: the state of every capture and camera. Out: a list of texts, each with the capture or camera and the remedy.

use crate::plugin::asset::CaptureState;
use crate::plugin::component::GaussianCapture;
use crate::plugin::render::CameraFault;
use crate::scene::RuntimeScene;
use bevy::asset::AssetId;
use bevy_egui::egui;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Weak};

/// The state of a capture that warnings depend on.
pub(super) struct PlacedCapture<'a> {
    pub(super) label: String,
    pub(super) state: &'a CaptureState,
    /// Whether its [`Visibility`](bevy::camera::visibility::Visibility) is on.
    pub(super) shows: bool,
    /// Whether an active camera has the capture in view.
    pub(super) is_seen: bool,
    /// The times at which the temporal filter, if on, leaves no Gaussian active, in seconds since the capture's start.
    pub(super) idle: &'a [Range<f32>],
}

/// The state of a camera that warnings depend on.
pub(super) struct PlacedCamera {
    pub(super) label: String,
    pub(super) fault: Option<CameraFault>,
    pub(super) is_multisampled: bool,
    pub(super) writes_depth: bool,
}

/// Returns the warnings about all captures, then about all active cameras, in the given order.
pub(super) fn list(captures: &[PlacedCapture], cameras: &[PlacedCamera]) -> Vec<String> {
    let mut warnings = Vec::new();
    for capture in captures {
        about_capture(capture, cameras.is_empty(), &mut warnings);
    }
    for PlacedCamera { label, fault, is_multisampled, writes_depth } in cameras {
        if let Some(fault) = fault {
            warnings.push(format!("{label}: {fault}"));
        }
        if *is_multisampled && *writes_depth {
            warnings.push(format!(
                "{label}: with multisampling, the written depth of captures is the same for all samples of a pixel; \
                 switch multisampling or the written depth off if this is visible"
            ));
        }
    }
    warnings
}

fn about_capture(capture: &PlacedCapture, without_cameras: bool, warnings: &mut Vec<String>) {
    let label = &capture.label;
    match capture.state {
        // The failure names the file.
        CaptureState::Failed(failure) => warnings.push(failure.to_string()),
        CaptureState::Loading => {}
        CaptureState::Ready => {
            if without_cameras {
                warnings.push(format!("{label}: there is no active Camera3d"));
            } else if capture.shows && !capture.is_seen {
                warnings.push(format!(
                    "{label}: no camera sees it; move it into the view of a camera, or onto RenderLayers of a camera"
                ));
            }
            if let Some((first, more)) = capture.idle.split_first() {
                let others = if more.is_empty() { "" } else { ", and at other times" };
                warnings.push(format!(
                    "{label}: no Gaussian is active from {:.2} s to {:.2} s{others}; switch its temporal filter off, \
                     or create the filter again with gs4d mask",
                    first.start, first.end
                ));
            }
        }
    }
}

/// Draws the list and a separator; draws nothing if the list is empty.
pub(super) fn show(ui: &mut egui::Ui, warnings: &[String]) {
    for warning in warnings {
        ui.colored_label(ui.visuals().warn_fg_color, warning.as_str());
    }
    if !warnings.is_empty() {
        ui.separator();
    }
}

/// The times at which captures have no active Gaussians, computed once for each scene.
#[derive(Default)]
pub(super) struct IdleTimes(HashMap<AssetId<GaussianCapture>, (Weak<RuntimeScene>, Vec<Range<f32>>)>);

impl IdleTimes {
    /// Computes the times of a capture, unless they are known for its current scene.
    pub(super) fn find(&mut self, id: AssetId<GaussianCapture>, capture: &GaussianCapture) {
        let is_known = |(scene, _): &(Weak<RuntimeScene>, _)| std::ptr::eq(scene.as_ptr(), capture.scene());
        if !self.0.get(&id).is_some_and(is_known) {
            self.0.retain(|_, (scene, _)| scene.strong_count() > 0);
            self.0.insert(id, (Arc::downgrade(&capture.shared_scene()), idle_times(capture)));
        }
    }

    /// Returns the times of a capture for which [`find`](Self::find) was called.
    pub(super) fn of(&self, id: AssetId<GaussianCapture>) -> &[Range<f32>] {
        self.0.get(&id).map(|(_, idle)| idle.as_slice()).unwrap_or_default()
    }
}

/// Returns the ranges of consecutive segments without an active Gaussian, in seconds since the start. A still has none.
fn idle_times(capture: &GaussianCapture) -> Vec<Range<f32>> {
    let scene = capture.scene();
    // The sets of a released capture are not known.
    let filter = scene.filter.as_ref().filter(|filter| !capture.is_released() && filter.check(scene.len()).is_ok());
    let (Some(filter), Some(key_frames)) = (filter, capture.key_frames()) else { return Vec::new() };
    let mut idle: Vec<Range<f32>> = Vec::new();
    for (segment, active) in (0u32..).zip(filter.active_counts(0..filter.count)) {
        if active > 0 {
            continue;
        }
        let [start, end] = [segment, segment + 1].map(|index| key_frames.time(index));
        match idle.last_mut() {
            Some(before) if before.end == start => before.end = end,
            _ => idle.push(start..end),
        }
    }
    idle
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plugin::asset::CaptureFailure;
    use crate::scene::synth::{SynthSettings, synthesize};
    use crate::scene::{FilterKind, GaussianScene, TemporalFilter};

    static READY: CaptureState = CaptureState::Ready;

    fn seen(state: &CaptureState) -> PlacedCapture<'_> {
        PlacedCapture { label: "dancer.gs4d".into(), state, shows: true, is_seen: true, idle: &[] }
    }

    fn plain() -> PlacedCamera {
        PlacedCamera { label: "eye".into(), fault: None, is_multisampled: false, writes_depth: false }
    }

    /// Returns a capture of 20 Gaussians over two seconds, whose filter has these sets.
    fn capture(sets: &[u32]) -> GaussianCapture {
        let settings = SynthSettings { count: 20, degree: 0, duration_seconds: 2.0, ..SynthSettings::default() };
        let filter = TemporalFilter::from_bits(FilterKind::Support, sets.len() as u32, 20, sets.to_vec());
        let scene = GaussianScene { filter: Some(filter), ..synthesize(&settings) };
        GaussianCapture::new(scene.into_runtime().expect("a synthetic scene can be drawn"))
    }

    #[test]
    fn valid_captures_and_cameras_have_no_warnings() {
        let loading = CaptureState::Loading;
        let captures = [seen(&READY), PlacedCapture { is_seen: false, ..seen(&loading) }];
        assert_eq!(list(&captures, &[plain()]), [""; 0], "a visible capture and a loading capture have no warning");
        let hidden = PlacedCapture { shows: false, is_seen: false, ..seen(&READY) };
        assert_eq!(list(&[hidden], &[plain()]), [""; 0], "a hidden capture has no warning");
        let multisampled = PlacedCamera { is_multisampled: true, ..plain() };
        let written = PlacedCamera { writes_depth: true, ..plain() };
        assert_eq!(
            list(&[], &[multisampled, written]),
            [""; 0],
            "multisampling alone and written depth alone have no warning"
        );
    }

    #[test]
    fn each_fault_has_one_warning() {
        let failed = CaptureState::Failed(CaptureFailure::NotLoaded("broken.gs4d: copy it again".into()));
        let idle = [0.5..1.0, 1.5..2.0];
        let captures = [
            seen(&failed),
            PlacedCapture { is_seen: false, ..seen(&READY) },
            PlacedCapture { idle: &idle[..1], ..seen(&READY) },
            PlacedCapture { idle: &idle, ..seen(&READY) },
        ];
        let cameras = [
            PlacedCamera { fault: Some(CameraFault::Oklab), ..plain() },
            PlacedCamera { is_multisampled: true, writes_depth: true, ..plain() },
        ];
        let warnings = list(&captures, &cameras);
        let expected = [
            "broken.gs4d: copy it again",
            "dancer.gs4d: no camera sees it",
            "dancer.gs4d: no Gaussian is active from 0.50 s to 1.00 s;",
            "dancer.gs4d: no Gaussian is active from 0.50 s to 1.00 s, and at other times;",
            "eye: captures are not drawn",
            "eye: with multisampling",
        ];
        assert_eq!(warnings.len(), expected.len(), "each fault has one warning: {warnings:?}");
        for (warning, expected) in warnings.iter().zip(expected) {
            assert!(warning.starts_with(expected), "{warning:?} begins with {expected:?}");
        }
        let alone = list(&[PlacedCapture { is_seen: false, ..seen(&READY) }], &[]);
        assert!(matches!(&alone[..], [one] if one.contains("Camera3d")), "the missing camera is reported: {alone:?}");
    }

    #[test]
    fn idle_times_are_computed_once_for_each_scene() {
        let id = AssetId::default();
        let mut idle = IdleTimes::default();
        assert!(idle.of(id).is_empty(), "no times are known before the first computation");
        let gaps = capture(&[1, 0, 0, 3, 0]);
        idle.find(id, &gaps);
        let [first, last] = idle.of(id) else { panic!("two ranges expected, not {:?}", idle.of(id)) };
        let apart = |range: &Range<f32>, from: f32, to: f32| (range.start - from).abs().max((range.end - to).abs());
        assert!(apart(first, 0.4, 1.2) < 1e-6, "adjacent segments form one range: {first:?}");
        assert!(apart(last, 1.6, 2.0) < 1e-6, "the last range ends with the capture: {last:?}");
        idle.find(id, &gaps);
        assert_eq!(idle.of(id).len(), 2, "the times of a known scene do not change");
        idle.find(id, &capture(&[1, 1]));
        assert!(idle.of(id).is_empty(), "the times of a changed scene are computed again");
    }
}
