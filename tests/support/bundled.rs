//! The bundled captures on the CPU.
//!
//! In: the name of a bundled capture. Out: its scene, a view of it, and the picture of any scene in that view.

use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::reference::{Layer, render_layers};
use bevy_gs4d::scene::{Bounds, GaussianScene, RuntimeScene};
use bevy_gs4d::view::{Appearance, Background, BlendSpace, Camera, Frame, RasterFov, Thinning, View};
use glam::{UVec2, Vec3};
use std::path::Path;

/// The bundled captures, and the direction that is up in each.
pub const BUNDLED: [(&str, Vec3); 2] = [("island.gs4d", Vec3::Y), ("toybox.gs4d", Vec3::Z)];

/// Returns a bundled capture.
pub fn bundled(name: &str) -> GaussianScene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets").join(name);
    codec::load(&path, &ReadOptions::default()).expect("a bundled capture")
}

/// Returns a view of a bundled capture at half of its time.
pub fn view_of(scene: &RuntimeScene, up: Vec3) -> View {
    let center = Bounds::core(scene.iter()).expect("it has Gaussians").center();
    let eye = center + (Vec3::new(0.7, 0.6, 0.6) + 0.5 * up).normalize() * 3.9;
    let camera = Camera::look_at(eye, center, up, 0.85, UVec2::new(320, 320));
    camera.view(0.5, RasterFov::Corrected)
}

/// Returns the picture of a thinned scene, over black.
pub fn drawn(scene: &RuntimeScene, view: View, thinning: Thinning) -> Frame {
    let layer = Layer { scene, view, appearance: Appearance { thinning, ..Appearance::default() } };
    render_layers(&[layer], Background::Color([0.0; 3]), BlendSpace::Encoded)
}
