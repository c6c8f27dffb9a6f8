//! Warnings: why less is seen than was meant.
//!
//! In: what is known of every capture and every camera. Out: a list of texts, each naming what it is about, and the remedy.

use crate::plugin::asset::CaptureState;
use crate::plugin::component::GaussianCapture;
use crate::plugin::render::CameraFault;
use crate::scene::RuntimeScene;
use bevy::asset::AssetId;
use bevy_egui::egui;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Weak};

/// A capture, as far as it can be the reason of a warning.
pub(super) struct PlacedCapture<'a> {
    pub(super) label: String,
    pub(super) state: &'a CaptureState,
    /// Whether its [`Visibility`](bevy::camera::visibility::Visibility) lets it show.
    pub(super) shows: bool,
    /// Whether an active camera sees it.
    pub(super) is_seen: bool,
    /// The times at which its temporal filter, if it is used, leaves no Gaussian active, in seconds since its start.
    pub(super) idle: &'a [Range<f32>],
}

/// A camera, likewise.
pub(super) struct PlacedCamera {
    pub(super) label: String,
    pub(super) fault: Option<CameraFault>,
    pub(super) is_multisampled: bool,
    pub(super) writes_depth: bool,
}

/// Returns the warnings about all captures and all active cameras, in their order.
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
                "{label}: with multisampling, the written depth of captures is the same for all samples of a pixel; switch one of the two off if this shows"
            ));
        }
    }
    warnings
}

fn about_capture(capture: &PlacedCapture, without_cameras: bool, warnings: &mut Vec<String>) {
    let label = &capture.label;
    match capture.state {
        // The failure names the file.
        CaptureState::Failed(failure) => warnings.push(failure.clone()),
        CaptureState::Loading => {}
        CaptureState::Ready => {
            if without_cameras {
                warnings.push(format!("{label}: there is no active Camera3d"));
            } else if capture.shows && !capture.is_seen {
                warnings.push(format!(
                    "{label}: no camera sees it: it is outside their views, or on other render layers than they are"
                ));
            }
            if let Some((first, more)) = capture.idle.split_first() {
                let others = if more.is_empty() { "" } else { ", and at other times" };
                warnings.push(format!(
                    "{label}: no Gaussian is active from {:.2} s to {:.2} s{others}; switch its temporal filter off, or make it anew \
                     with gs4d mask",
                    first.start, first.end
                ));
            }
        }
    }
}

/// Draws the list; nothing if it is empty.
pub(super) fn show(ui: &mut egui::Ui, warnings: &[String]) {
    for warning in warnings {
        ui.colored_label(ui.visuals().warn_fg_color, warning.as_str());
    }
    if !warnings.is_empty() {
        ui.separator();
    }
}

/// The times at which captures have no active Gaussians, found once for each scene.
#[derive(Default)]
pub(super) struct IdleTimes(HashMap<AssetId<GaussianCapture>, (Weak<RuntimeScene>, Vec<Range<f32>>)>);

impl IdleTimes {
    /// Finds those of a capture, unless they are known.
    pub(super) fn find(&mut self, id: AssetId<GaussianCapture>, capture: &GaussianCapture) {
        let is_known = |(scene, _): &(Weak<RuntimeScene>, _)| std::ptr::eq(scene.as_ptr(), capture.scene());
        if !self.0.get(&id).is_some_and(is_known) {
            self.0.retain(|_, (scene, _)| scene.strong_count() > 0);
            self.0.insert(id, (Arc::downgrade(&capture.shared_scene()), idle_times(capture)));
        }
    }

    /// Returns those that have been found.
    pub(super) fn of(&self, id: AssetId<GaussianCapture>) -> &[Range<f32>] {
        self.0.get(&id).map(|(_, idle)| idle.as_slice()).unwrap_or_default()
    }
}

/// Returns the longest stretches of segments without an active Gaussian, in seconds since the start. A still has none.
fn idle_times(capture: &GaussianCapture) -> Vec<Range<f32>> {
    let scene = capture.scene();
    let filter = scene.filter.as_ref().filter(|filter| filter.check(scene.len()).is_ok());
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
    fn of_what_is_right_there_is_nothing_to_say() {
        let loading = CaptureState::Loading;
        let captures = [seen(&READY), PlacedCapture { is_seen: false, ..seen(&loading) }];
        assert_eq!(list(&captures, &[plain()]), [""; 0], "one that is seen, one that is still loading");
        let hidden = PlacedCapture { shows: false, is_seen: false, ..seen(&READY) };
        assert_eq!(list(&[hidden], &[plain()]), [""; 0], "one that is hidden on purpose");
        let multisampled = PlacedCamera { is_multisampled: true, ..plain() };
        let written = PlacedCamera { writes_depth: true, ..plain() };
        assert_eq!(list(&[], &[multisampled, written]), [""; 0], "cameras with one of the two");
    }

    #[test]
    fn everything_that_is_wrong_is_named() {
        let failed = CaptureState::Failed("broken.gs4d: copy it again".into());
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
        let said = list(&captures, &cameras);
        let expected = [
            "broken.gs4d: copy it again",
            "dancer.gs4d: no camera sees it",
            "dancer.gs4d: no Gaussian is active from 0.50 s to 1.00 s;",
            "dancer.gs4d: no Gaussian is active from 0.50 s to 1.00 s, and at other times;",
            "eye: captures are not drawn",
            "eye: with multisampling",
        ];
        assert_eq!(said.len(), expected.len(), "one for each fault: {said:?}");
        for (said, expected) in said.iter().zip(expected) {
            assert!(said.starts_with(expected), "{said:?} begins with {expected:?}");
        }
        let lonely = list(&[PlacedCapture { is_seen: false, ..seen(&READY) }], &[]);
        assert!(matches!(&lonely[..], [said] if said.contains("Camera3d")), "without a camera: {lonely:?}");
    }

    #[test]
    fn idle_times_are_found_once_and_again_for_another_scene() {
        let id = AssetId::default();
        let mut idle = IdleTimes::default();
        assert!(idle.of(id).is_empty(), "before anybody has looked");
        let gaps = capture(&[1, 0, 0, 3, 0]);
        idle.find(id, &gaps);
        let [first, last] = idle.of(id) else { panic!("two stretches, not {:?}", idle.of(id)) };
        let apart = |range: &Range<f32>, from: f32, to: f32| (range.start - from).abs().max((range.end - to).abs());
        assert!(apart(first, 0.4, 1.2) < 1e-6, "segments that touch are one stretch: {first:?}");
        assert!(apart(last, 1.6, 2.0) < 1e-6, "up to the end: {last:?}");
        idle.find(id, &gaps);
        assert_eq!(idle.of(id).len(), 2, "and so they stay");
        idle.find(id, &capture(&[1, 1]));
        assert!(idle.of(id).is_empty(), "the file has changed, and all is well");
    }
}
