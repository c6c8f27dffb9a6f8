//! What the examples share: where to look at a capture from, and writing pictures without a window.
//!
//! In: a capture and, without a window, an app. Out: camera poses, PNG files.

pub mod offscreen;

use bevy::prelude::*;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::scene::Bounds;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A camera that circles a point.
#[derive(Component, Debug, Clone, Copy)]
pub struct Orbit {
    pub center: Vec3,
    pub distance: f32,
    /// Angles in radians: around, and up.
    pub yaw: f32,
    pub pitch: f32,
}

impl Orbit {
    /// Shows the whole of a capture that stands upright at the origin.
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

/// A path from the command line as an asset: what is not found from the current folder is looked for in `assets/`.
pub fn asset_path(argument: &str) -> PathBuf {
    let path = Path::new(argument);
    if path.exists() { std::path::absolute(path).unwrap_or_else(|_| path.into()) } else { path.into() }
}

/// Renders `count` pictures, `step` apart, into `folder` and says where they are.
pub fn save_pictures(app: &mut App, count: u32, step: Duration, folder: &Path) -> Result {
    std::fs::create_dir_all(folder)?;
    offscreen::settle(app)?;
    for index in 0..count {
        let step = if index == 0 { Duration::ZERO } else { step };
        offscreen::picture(app, step)?.save(folder.join(format!("{index:04}.png")))?;
    }
    println!("{count} pictures in {}", folder.display());
    Ok(())
}
