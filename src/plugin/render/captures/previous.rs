//! Previous: the poses and times of captures and cameras in the previous frame.
//!
//! In: the captures of each frame, kept for the next frame; the pose of a camera. Out: the view of a capture in the
//! previous frame, from which the renderer computes the motion on the screen.
//!
//! Splats move with the time of their capture. A jump in time (a seek, the start of a loop, a cut) is no visible
//! motion, so only the transform of the capture and the camera contribute.

use super::extract::{ExtractedCapture, ExtractedCaptures};
use super::view::CameraLens;
use crate::plugin::component::GaussianCapture;
use crate::view::{Optics, View};
use bevy::asset::AssetId;
use bevy::ecs::resource::Resource;
use bevy::render::sync_world::{MainEntity, MainEntityHashMap};
use glam::Affine3A;

/// A longer step of the capture's time in one frame, in seconds, is a jump: Bevy's longest time step at normal speed.
const LONGEST_STEP: f32 = 0.25;
/// A step is also a jump if it is longer than this many times the previous step, as at the end of a short loop.
const STEPS: f32 = 8.0;

/// The captures of the previous frame. The memory is kept from frame to frame.
#[derive(Resource, Default)]
pub(in crate::plugin::render) struct PreviousCaptures(MainEntityHashMap<PreviousCapture>);

struct PreviousCapture {
    asset: AssetId<GaussianCapture>,
    world_from_capture: Affine3A,
    /// Seconds since the capture's start.
    seconds: f32,
    /// Change of `seconds` in that frame.
    step: f32,
}

/// Pose and lens of a camera, without the jitter of temporal anti-aliasing.
#[derive(Clone, Copy)]
pub(in crate::plugin::render) struct CameraPose {
    pub(in crate::plugin::render) lens: CameraLens,
    pub(in crate::plugin::render) world_from_camera: Affine3A,
}

impl PreviousCaptures {
    /// Keeps the captures of this frame for the next frame. Called after all views of this frame are prepared.
    pub(in crate::plugin::render) fn keep(&mut self, extracted: &ExtractedCaptures) {
        self.0.retain(|entity, _| extracted.0.contains_key(entity));
        for (entity, placed) in &extracted.0 {
            let ExtractedCapture { asset, world_from_capture, seconds, .. } = *placed;
            let before = self.0.get(entity).filter(|before| before.asset == asset);
            let step = before.map_or(0.0, |before| seconds - before.seconds);
            self.0.insert(*entity, PreviousCapture { asset, world_from_capture, seconds, step });
        }
    }

    /// Returns the view of a capture in the previous frame. `now` is its view in this frame, `pose` the camera's pose
    /// in the previous frame, `optics` are those of the capture, and `time_at` converts seconds to the capture's
    /// timestamp. A capture that did not exist in the previous frame counts as unmoved.
    pub(in crate::plugin::render) fn view(
        &self,
        entity: &MainEntity,
        placed: &ExtractedCapture,
        now: &View,
        pose: &CameraPose,
        optics: Optics,
        time_at: impl Fn(f32) -> Option<f32>,
    ) -> View {
        let before = self.0.get(entity).filter(|before| before.asset == placed.asset);
        let world_from_capture = before.map_or(placed.world_from_capture, |before| before.world_from_capture);
        let steady = before.filter(|before| !is_jump(placed.seconds - before.seconds, before.step));
        let time = steady.and_then(|before| time_at(before.seconds)).unwrap_or(now.time);
        let view = pose.lens.view(now.size, time, pose.world_from_camera, world_from_capture);
        view.map_or(*now, |view| view.with_optics(optics))
    }
}

/// Returns whether a step of so many seconds, after a step of `before`, is a jump.
fn is_jump(step: f32, before: f32) -> bool {
    let most = if before == 0.0 { LONGEST_STEP } else { LONGEST_STEP.min(STEPS * before.abs()) };
    step.is_nan() || step.abs() > most
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_steps_of_time_are_jumps() {
        for (step, before, jump) in [
            (0.016, 0.016, false),
            (0.0, 0.016, false),
            (0.016, 0.0, false),
            (0.1, 0.016, false),
            (-0.016, 0.016, false),
            (-0.184, 0.016, true),
            (0.3, 0.0, true),
            (0.3, 0.3, true),
            (f32::NAN, 0.016, true),
        ] {
            assert_eq!(is_jump(step, before), jump, "whether a step of {step} s after {before} s is a jump");
        }
    }
}
