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
        // A single Gaussian has no radius.
        let radius = |core: Bounds| if core.radius() > 0.0 { core.radius() } else { 0.1 };
        let (center, radius) = core.map_or((Vec3::ZERO, 1.0), |core| (core.center(), radius(core)));
        Self { center: capture.upright() * center, distance: 2.2 * radius, yaw: 0.6, pitch: 0.3 }
    }

    /// Moves a camera to its position on the orbit. Bevy's near plane would hide captures of some centimeters: it is
    /// closer there.
    pub fn place(&self, transform: &mut Transform, projection: &mut Projection) {
        *transform = self.transform();
        if let Projection::Perspective(lens) = projection {
            lens.near = (0.1 * self.distance).min(0.1);
        }
    }

    fn transform(&self) -> Transform {
        let turn = Quat::from_euler(EulerRot::YXZ, self.yaw, -self.pitch, 0.0);
        Transform::from_translation(self.center + turn * Vec3::Z * self.distance).looking_at(self.center, Vec3::Y)
    }
}
