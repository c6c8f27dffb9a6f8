//! A rig for tests.
//!
//! In: numbers of cameras, balls. Out: cameras around the origin, masks of balls.

use crate::view::{Camera, RasterFov};
use glam::{UVec2, Vec3};
use image::{GrayImage, Luma};

/// Width of a pixel at the origin, the mean over the cameras.
pub(crate) const PIXEL: f32 = 0.0157;

/// Returns cameras of 200 by 150 pixels around the origin.
pub(crate) fn cameras(count: usize) -> Vec<Camera> {
    let eye = |index: usize| {
        let angle = index as f32 * 2.4;
        Vec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 0.5 + (index % 3) as f32)
    };
    let at = |index: usize| Camera::look_at(eye(index), Vec3::ZERO, Vec3::Z, 0.7, UVec2::new(200, 150));
    (0..count).map(at).collect()
}

/// Returns the mask of balls, each with its center and radius.
pub(crate) fn mask(camera: &Camera, balls: &[(Vec3, f32)]) -> GrayImage {
    let view = camera.view(0.0, RasterFov::Corrected);
    GrayImage::from_fn(camera.size.x, camera.size.y, |x, y| {
        let ray = view.ray(x, y);
        let distance = |center: Vec3| (center - view.camera_position).reject_from_normalized(ray).length();
        Luma([if balls.iter().any(|&(center, radius)| distance(center) < radius) { 255 } else { 0 }])
    })
}
