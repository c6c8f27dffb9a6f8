//! Anti-aliasing: views with larger pixels than training had.
//!
//! In: a disk of many small Gaussians, drawn by the CPU reference in a small picture, and in a large picture that is
//! averaged down. Out: proof that small pictures are much closer to the averages with anti-aliasing, that views with
//! pixels of training size do not change, and that the filter of Mip-Splatting is that of its paper.

use crate::support::blob::blob;
use bevy_gs4d::gaussian::Harmonics;
use bevy_gs4d::internal::gaussian::project;
use bevy_gs4d::reference::render;
use bevy_gs4d::scene::{RuntimeScene, TrainedWith};
use bevy_gs4d::view::{Background, Camera, Frame, RasterFov, View};
use glam::{UVec2, Vec3};

const BLACK: Background = Background::Color([0.0; 3]);
/// Ratio of the side of the near picture to that of the far picture.
const TIMES: u32 = 8;
/// Distance of the camera, units; a near picture of 256 pixels is 0.1 of it wide.
const DISTANCE: f32 = 40.0;
/// Size of a pixel of the near picture, units.
const PIXEL: f32 = 0.1 * DISTANCE / 256.0;

/// Returns a disk of a radius of one unit, in rings, with gaps between its Gaussians; each is about a pixel of the near
/// picture.
fn disk() -> RuntimeScene {
    let mut gaussians = Vec::new();
    for ring in 0..16 {
        let radius = ring as f32 / 16.0;
        let count = 1 + ring * 6;
        for place in 0..count {
            let angle = std::f32::consts::TAU * place as f32 / count as f32;
            let mean = Vec3::new(radius * angle.cos(), radius * angle.sin(), 0.0);
            gaussians.push(blob(mean, Vec3::splat(0.02), 0.8));
        }
    }
    let values = vec![0.5; gaussians.len() * 3];
    RuntimeScene::sliced(gaussians, Harmonics { coefficients: 1, degree: 0, degree_t: 0, values })
}

fn camera(side: u32) -> Camera {
    let eye = Vec3::new(0.0, 0.0, DISTANCE);
    Camera::look_at(eye, Vec3::ZERO, Vec3::Y, 2.0 * 0.05f32.atan(), UVec2::splat(side))
}

fn view(side: u32) -> View {
    camera(side).view(0.5, RasterFov::Corrected)
}

/// Returns the mean square difference of a far picture from the means of the pixels of a near picture.
fn error(far: &Frame, near: &Frame) -> f32 {
    let (side, wide) = (far.picture.size.x, near.picture.size.x);
    let mut sum = 0.0;
    for at in 0..side * side {
        let corner = UVec2::new(at % side, at / side) * TIMES;
        let within = (0..TIMES * TIMES).map(|k| (corner.y + k / TIMES) * wide + corner.x + k % TIMES);
        let mean: Vec3 = within.map(|pixel| near.picture.pixels[pixel as usize]).sum::<Vec3>() / (TIMES * TIMES) as f32;
        sum += (far.picture.pixels[at as usize] - mean).length_squared();
    }
    sum / (side * side) as f32
}

#[test]
fn antialiasing_brings_far_pictures_closer_to_the_mean_of_near_ones() {
    let disk = disk();
    let near = render(&disk, &view(256), BLACK);
    let far = view(256 / TIMES);
    let [plain, smooth] = [far, far.antialiased(Some(PIXEL))].map(|view| error(&render(&disk, &view, BLACK), &near));
    // 10 dB.
    assert!(smooth < 0.1 * plain, "mean square error {smooth} with, {plain} without anti-aliasing");
}

#[test]
fn the_filter_of_mip_splatting_is_the_ratio_of_the_areas_without_and_with_the_low_pass() {
    let mip = TrainedWith { mip_filter: true, ..TrainedWith::default() };
    for side in [8, 32, 256] {
        let filtered = camera(side).view(0.5, mip.optics());
        let per_unit = side as f32 / (2.0 * 0.05 * DISTANCE);
        for [x, y] in [[0.02, 0.05], [0.5, 0.4], [0.003, 0.9]] {
            let blob = blob(Vec3::ZERO, Vec3::new(x, y, 0.03), 0.8);
            let [plain, found] =
                [view(side), filtered].map(|view| project(&blob, &view).expect("it is in the picture"));
            let variance = |deviation: f32| (deviation * per_unit).powi(2);
            let areas = (variance(x) * variance(y)) / ((variance(x) + 0.3) * (variance(y) + 0.3));
            let expected = 0.8 * areas.sqrt();
            let opacity = found.opacity;
            assert!((opacity - expected).abs() < 1e-3, "{x} by {y} in {side} pixels: {opacity}, expected {expected}");
            assert_eq!(
                (plain.opacity, plain.conic),
                (0.8, found.conic),
                "without the filter the conic is the same and the opacity is not reduced"
            );
        }
        for size in [None, Some(PIXEL), Some(100.0 * PIXEL)] {
            assert_eq!(filtered.antialiased(size), filtered, "anti-aliasing does not undo the filter");
        }
    }
}

#[test]
fn antialiasing_does_not_change_views_with_pixels_of_training_size() {
    let disk = disk();
    for side in [256, 512] {
        let view = view(side);
        let [plain, smooth] =
            [view, view.antialiased(Some(1.01 * PIXEL))].map(|view| render(&disk, &view, BLACK).picture);
        assert_eq!(plain, smooth, "a view of {side} pixels, whose pixels are no larger than in training");
    }
    assert_eq!(view(9).antialiased(None), view(9), "a view is unchanged if the size of training pixels is unknown");
}
