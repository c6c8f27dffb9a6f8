//! What a page is told about a capture.
//!
//! In: a scene. Out: [`About`], whose fields are properties of a JavaScript object.

use bevy_gs4d::scene::{Bounds, RuntimeScene};
use wasm_bindgen::prelude::wasm_bindgen;

/// Gaussians by which the place of a capture is estimated: a sample, so that no frame of the page waits.
const SAMPLE: usize = 20_000;

/// A capture as a page sees it.
#[wasm_bindgen(getter_with_clone)]
#[derive(Debug, Clone)]
pub struct About {
    /// Number of Gaussians.
    pub gaussians: u32,
    /// Seconds of one pass; 0 for a still.
    pub seconds: f32,
    /// First and last time, in the unit of the capture.
    pub interval: Vec<f32>,
    /// The middle of the core of the capture, and its radius.
    pub center: Vec<f32>,
    /// See `center`.
    pub radius: f32,
    /// The direction that points up.
    pub up: Vec<f32>,
}

impl About {
    /// Describes a scene.
    pub fn of(scene: &RuntimeScene) -> Self {
        let step = scene.len() / SAMPLE + 1;
        let core = Bounds::core((0..scene.len()).step_by(step).map(|index| scene.gaussian(index)));
        Self {
            gaussians: u32::try_from(scene.len()).unwrap_or(u32::MAX),
            seconds: scene.playback.duration_seconds,
            interval: scene.trained_with.time_interval.to_vec(),
            center: core.map_or([0.0; 3], |core| core.center().to_array()).to_vec(),
            radius: core.map_or(1.0, Bounds::radius),
            up: scene.playback.up.vector().to_array().to_vec(),
        }
    }

    /// Describes a capture in chunk files: the number of its Gaussians, and where the first of these are.
    pub fn place(&mut self, gaussians: u64, core: Option<Bounds>) {
        self.gaussians = u32::try_from(gaussians).unwrap_or(u32::MAX);
        if let Some(core) = core {
            (self.center, self.radius) = (core.center().to_array().to_vec(), core.radius());
        }
    }
}
