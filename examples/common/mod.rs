//! Shared by the examples with one camera: a camera that orbits, and the command line.
//!
//! In: a capture. Out: camera poses.

pub mod arguments;

pub use arguments::{asset_path, save_pictures};

use bevy::prelude::*;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::scene::Bounds;

/// A camera that orbits a point.
#[derive(Component, Debug, Clone, Copy)]
pub struct Orbit {
    pub center: Vec3,
    pub distance: f32,
    /// Angle around the vertical, in radians.
    pub yaw: f32,
    /// Angle upwards, in radians.
    pub pitch: f32,
}

impl Orbit {
    /// Returns an orbit that shows the core of a capture standing upright at the origin.
    pub fn around(capture: &GaussianCapture) -> Self {
        let core = Bounds::core(capture.scene().iter());
        let (center, radius) = core.map_or((Vec3::ZERO, 1.0), |core| (core.center(), core.radius().max(0.1)));
        Self { center: capture.upright() * center, distance: 2.2 * radius, yaw: 0.6, pitch: 0.3 }
    }

    pub fn transform(&self) -> Transform {
        let turn = Quat::from_euler(EulerRot::YXZ, self.yaw, -self.pitch, 0.0);
        Transform::from_translation(self.center + turn * Vec3::Z * self.distance).looking_at(self.center, Vec3::Y)
    }
}
