//! Scenes and cameras that both a Bevy app and the CPU reference draw.
//!
//! In: Gaussians, a camera's transform. Out: a scene for both, the same view for [`bevy_gs4d::reference`], and the
//! difference between two pictures.

use crate::support::offscreen_app::FOV_Y;
use bevy::prelude::*;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::scene::{PlaybackHints, RuntimeScene};
use bevy_gs4d::view::{Camera as PinholeCamera, Lens, Picture, RasterFov, View};
use image::RgbaImage;

/// Size of the pictures in pixels. Rows of this width are padded when they are read back.
pub const SIZE: UVec2 = UVec2::new(200, 150);
/// Duration of the scenes of [`scene`] in seconds.
pub const DURATION: f32 = 2.0;

/// Adds a capture of a scene to the assets.
pub fn add(app: &mut App, scene: &RuntimeScene) -> Handle<GaussianCapture> {
    app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(GaussianCapture::new(scene.clone()))
}

/// Returns a scene of Gaussians and their colors, which do not depend on the view direction.
pub fn scene(gaussians: &[(Gaussian, Vec3)]) -> RuntimeScene {
    // The first harmonic is 0.282; the evaluation adds one half to colors.
    let values = gaussians.iter().flat_map(|(_, color)| ((*color - 0.5) / 0.282_094_79).to_array()).collect();
    let harmonics = Harmonics { coefficients: 1, degree: 0, degree_t: 0, values };
    RuntimeScene {
        playback: PlaybackHints { duration_seconds: DURATION, ..PlaybackHints::default() },
        ..RuntimeScene::sliced(gaussians.iter().map(|(gaussian, _)| *gaussian).collect(), harmonics)
    }
}

/// Returns the pose of the camera of most tests.
pub fn eye() -> Transform {
    Transform::from_xyz(0.6, 0.9, 3.5).looking_at(Vec3::ZERO, Vec3::Y)
}

/// Returns the view of `offscreen_app::spawn_camera` with a target of `size` pixels, for the CPU reference. `time` is
/// in the capture's unit of time.
pub fn view(camera: &Transform, size: UVec2, time: f32) -> View {
    let tan_y = (FOV_Y / 2.0).tan();
    let lens = Lens::Fov { tan: Vec2::new(tan_y * size.x as f32 / size.y as f32, tan_y) };
    // Bevy's cameras look along -z with y up, the cameras of the CPU reference along +z with y down.
    let flip = Mat4::from_diagonal(Vec4::new(1.0, -1.0, -1.0, 1.0));
    let world_to_camera = flip * camera.to_matrix().inverse();
    PinholeCamera { world_to_camera, size, lens }.view(time, RasterFov::Corrected)
}

/// Returns the view of [`view`] for an entity with a transform.
pub fn view_of(camera: &Transform, entity: &Transform, size: UVec2, time: f32) -> View {
    let plain = view(camera, size, time);
    View::new(size, time, plain.world_to_camera * entity.to_matrix(), plain.projection, plain.tan_fov)
}

/// Returns for each pixel the largest difference of a channel from the expected pixel, in 255ths.
pub fn differences(picture: &RgbaImage, expected: &Picture) -> Vec<f32> {
    assert_eq!(UVec2::from(picture.dimensions()), expected.size, "the pictures have the same size");
    let expected = expected.clamped();
    let apart = |(pixel, expected): (&image::Rgba<u8>, &Vec3)| {
        let [r, g, b, _] = pixel.0.map(f32::from);
        (Vec3::new(r, g, b) - *expected * 255.0).abs().max_element()
    };
    picture.pixels().zip(&expected.pixels).map(apart).collect()
}

/// Returns the largest difference between a picture and the expected picture in any channel, in 255ths.
pub fn difference(picture: &RgbaImage, expected: &Picture) -> f32 {
    differences(picture, expected).into_iter().fold(0.0, f32::max)
}

/// Returns the largest difference between two pictures in any channel, in 255ths.
pub fn difference_between(a: &RgbaImage, b: &RgbaImage) -> u8 {
    assert_eq!(a.dimensions(), b.dimensions(), "the pictures have the same size");
    a.iter().zip(b.iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or_default()
}

/// Returns red, green and blue of a pixel.
pub fn rgb(picture: &RgbaImage, x: u32, y: u32) -> [u8; 3] {
    let [r, g, b, _] = picture.get_pixel(x, y).0;
    [r, g, b]
}

/// Returns the color of a pixel, in 255ths.
pub fn color(picture: &RgbaImage, x: u32, y: u32) -> Vec3 {
    Vec3::from(rgb(picture, x, y).map(f32::from))
}
