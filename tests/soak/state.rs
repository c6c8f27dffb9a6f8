//! What an app should show, as plain data.
//!
//! In: nothing; [`changes`](crate::changes) make one state from another. Out: a [`State`], which a [`Stage`](crate::stage::Stage) brings
//! into an app, and the scenes of its captures.

use crate::support::coded_scene::coded_scene;
use bevy::camera::ScalingMode;
use bevy::prelude::*;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::render::{CaptureSettings, CaptureViewSettings};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{RuntimeScene, TemporalFilter};

/// Captures and cameras, in the order in which they came.
#[derive(Debug, Clone)]
pub struct State {
    /// Size of the first camera's target, pixels.
    pub size: UVec2,
    /// How often the file has been written anew.
    pub version: u64,
    /// Whether captures are drawn at their coarsest level of detail, not with all Gaussians. In between, the level depends on the one before,
    /// so that nothing flickers, and a new app may show another.
    pub coarse: bool,
    pub captures: Vec<Placed>,
    pub cameras: Vec<Viewer>,
}

/// A capture in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// Its number, which no other gets.
    pub number: u64,
    pub source: Source,
    pub pose: Transform,
    /// As it was when it was last changed: the app lets time pass.
    pub playback: Playback,
    pub settings: CaptureSettings,
}

/// Where a capture comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// The capture of the examples.
    Bundled,
    /// The file that is written anew and loaded again.
    File,
    /// Memory: a form, and a seed.
    Made(Form, u64),
}

/// The form of a scene that is made here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    Single,
    Filtered,
    /// With a filter and codebooks.
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
    /// One that captures cannot be drawn for: its depth is not reversed.
    Unusable,
}

impl Default for State {
    /// One camera, and nothing to see.
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

    /// Returns what the file holds.
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

/// Returns a scene of two seconds; another seed is another scene.
pub fn scene(form: Form, seed: u64) -> RuntimeScene {
    let count = 400 + (seed % 7 * 200) as usize;
    if form == Form::Packed {
        return coded_scene(count, 3, 2);
    }
    let settings = SynthSettings { count, seed, degree: 1, degree_t: 0, duration_seconds: 2.0 };
    let mut scene = synthesize(&settings).into_runtime().expect("synthetic scenes can be drawn");
    if form == Form::Filtered {
        scene.filter = Some(TemporalFilter::support(scene.iter(), scene.trained_with.time_interval, 4));
    }
    scene
}
