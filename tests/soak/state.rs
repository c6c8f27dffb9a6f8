//! The state of an app, as plain data.
//!
//! In: nothing; [`changes`](crate::changes) makes one state from another. Out: a [`State`], which a
//! [`Stage`](crate::stage::Stage) applies to an app, and the scenes of its captures.

use crate::support::coded_scene::coded_scene;
use bevy::camera::ScalingMode;
use bevy::prelude::*;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::render::{CaptureSettings, CaptureViewSettings};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{RuntimeScene, TemporalFilter};

/// Captures and cameras, in the order in which they were added.
#[derive(Debug, Clone)]
pub struct State {
    /// Size of the first camera's target in pixels.
    pub size: UVec2,
    /// Version of the file: the number of times that it has been rewritten.
    pub version: u64,
    /// Whether captures are drawn at their coarsest level of detail instead of with all Gaussians. Levels in between
    /// are not tested: they depend on the level of the frame before, to avoid flicker, and may differ in a new app.
    pub coarse: bool,
    pub captures: Vec<Placed>,
    pub cameras: Vec<Viewer>,
}

/// A capture in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// The unique number of the capture.
    pub number: u64,
    pub source: Source,
    pub pose: Transform,
    /// The playback at its last change. The app has advanced it since.
    pub playback: Playback,
    pub settings: CaptureSettings,
}

/// The source of a capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// The capture of the examples, `assets/toybox.gs4d`.
    Bundled,
    /// The file that is rewritten and loaded again.
    File,
    /// A scene in memory, from a form and a seed.
    Made(Form, u64),
}

/// The form of a scene in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    Single,
    Filtered,
    /// Packed, with a filter and codebooks.
    Packed,
}

/// A camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Viewer {
    pub pose: Transform,
    pub msaa: Msaa,
    pub settings: CaptureViewSettings,
    pub lens: Lens,
}

/// The projection of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lens {
    Perspective,
    Orthographic,
    /// A projection with which captures cannot be drawn: its depth is not reversed.
    Unusable,
}

impl Default for State {
    /// Returns a state with one camera and no capture.
    fn default() -> Self {
        Self {
            size: UVec2::splat(96),
            version: 0,
            coarse: false,
            captures: Vec::new(),
            cameras: vec![Viewer::default()],
        }
    }
}

impl State {
    /// Returns whether a capture comes from the file.
    pub fn shows_file(&self) -> bool {
        self.captures.iter().any(|capture| capture.source == Source::File)
    }

    /// Returns the scene in the file.
    pub fn file_scene(&self) -> RuntimeScene {
        scene(Form::Filtered, 1000 + self.version)
    }
}

impl Default for Viewer {
    fn default() -> Self {
        let pose = Transform::from_xyz(0.5, 1.5, 3.0).looking_at(Vec3::ZERO, Vec3::Y);
        Self { pose, msaa: Msaa::Off, settings: CaptureViewSettings::default(), lens: Lens::Perspective }
    }
}

impl Lens {
    pub fn projection(self) -> Projection {
        let scaling_mode = ScalingMode::FixedVertical { viewport_height: 3.0 };
        let parallel = OrthographicProjection { scaling_mode, ..OrthographicProjection::default_3d() };
        match self {
            Self::Perspective => Projection::Perspective(PerspectiveProjection { fov: 0.8, ..default() }),
            Self::Orthographic => Projection::Orthographic(parallel),
            Self::Unusable => Projection::Orthographic(OrthographicProjection { near: 10.0, far: 0.1, ..parallel }),
        }
    }
}

/// Returns a scene of two seconds from a form and a seed.
pub fn scene(form: Form, seed: u64) -> RuntimeScene {
    let count = 400 + (seed % 7 * 200) as usize;
    if form == Form::Packed {
        return coded_scene(count, 3, 2);
    }
    let settings = SynthSettings { count, seed, degree: 1, degree_t: 0, duration_seconds: 2.0 };
    let mut scene = synthesize(&settings).into_runtime().expect("synthetic scenes can be drawn");
    if form == Form::Filtered {
        scene.filter = Some(TemporalFilter::support(
            scene.iter(),
            scene.trained_with.time_interval,
            scene.trained_with.marginal_cutoff,
            4,
        ));
    }
    scene
}
