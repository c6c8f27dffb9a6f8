//! Captures that are small on the screen, in headless apps: levels of detail and anti-aliasing.
//!
//! In: a capture with levels made by hand, and the bundled capture, far away and near. Out: proof that the level
//! follows the size on the screen without flicker, that settings limit the level, that the bundled capture's levels
//! reach 45 dB, that captures without levels are drawn whole, and that anti-aliasing matches the CPU reference. Skipped
//! without a GPU.

use crate::support::blob::blob;
use crate::support::cpu_reference::{SIZE, add, scene, view};
use crate::support::fixtures::{check, insert, reference_picture, spawn, synthetic};
use crate::support::offscreen_app::{FOV_Y, app, picture, spawn_camera};
use bevy::prelude::*;
use bevy_gs4d::GaussianCapture3d;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::render::{CaptureDetail, CaptureSettings, CaptureStatistics};
use bevy_gs4d::scene::{Level, RuntimeScene, TrainedWith};
use bevy_gs4d::view::Appearance;
use image::RgbaImage;
use std::sync::Arc;

/// Returns `count` equal Gaussians.
fn heap(count: usize) -> RuntimeScene {
    scene(&vec![(blob(Vec3::ZERO, Vec3::splat(0.3), 0.5), Vec3::new(0.9, 0.3, 0.1)); count])
}

/// Returns 100 Gaussians with a level of 10 up to 60 pixels and a level of 2 up to 12 pixels.
fn detailed() -> RuntimeScene {
    let level = |pixels, count| Level { pixels, scene: Arc::new(heap(count)) };
    RuntimeScene { levels: vec![level(60.0, 10), level(12.0, 2)], ..heap(100) }
}

/// An app with one capture and one camera.
struct Stage {
    app: App,
    camera: Entity,
    capture: Entity,
}

impl Stage {
    fn of(scene: &RuntimeScene) -> Option<Self> {
        let mut app = app(SIZE)?;
        let handle = add(&mut app, scene);
        let capture = app.world_mut().spawn((GaussianCapture3d(handle), Playback::paused_at(0.0))).id();
        let camera = spawn_camera(&mut app, Msaa::Off, Transform::default());
        Some(Self { app, camera, capture })
    }

    /// Returns the number of Gaussians drawn from a distance.
    fn drawn_from(&mut self, distance: f32) -> u32 {
        let pose = Transform::from_xyz(0.0, 0.0, distance).looking_at(Vec3::ZERO, Vec3::Y);
        self.app.world_mut().entity_mut(self.camera).insert(pose);
        picture(&mut self.app, 0.0);
        let statistics = self.app.world().resource::<CaptureStatistics>();
        statistics.view(self.camera).expect("it is seen").total
    }

    fn set(&mut self, settings: CaptureSettings) {
        self.app.world_mut().entity_mut(self.capture).insert(settings);
    }
}

/// Returns the distance at which a heap has this size in pixels: a box of three standard deviations of 0.3 has a sphere
/// of radius 1.56, and the height of 150 pixels is 0.8 radians.
fn distance_of(pixels: f32) -> f32 {
    let (radius, focal) = (0.9 * 3f32.sqrt(), 75.0 / 0.4f32.tan());
    radius * (1.0 + (2.0 * focal / pixels).powi(2)).sqrt()
}

#[test]
fn a_capture_far_away_is_drawn_with_few_gaussians() {
    let Some(mut stage) = Stage::of(&detailed()) else { return };
    assert_eq!(stage.drawn_from(distance_of(100.0)), 100, "all Gaussians near the camera");
    assert_eq!(stage.drawn_from(distance_of(40.0)), 10, "level 1 farther away");
    assert_eq!(stage.drawn_from(distance_of(8.0)), 2, "the coarsest level far away");
    assert_eq!(stage.drawn_from(distance_of(100.0)), 100, "all Gaussians again near the camera");
}

#[test]
fn a_level_does_not_flicker_at_its_limit() {
    let Some(mut stage) = Stage::of(&detailed()) else { return };
    let mut seen = Vec::new();
    for turn in 0..8 {
        let pixels = 60.0 * if turn % 2 == 0 { 1.05 } else { 0.95 };
        seen.push(stage.drawn_from(distance_of(pixels)));
    }
    assert_eq!(seen, [100; 8], "the finer level is kept just below the limit");
    assert_eq!(stage.drawn_from(distance_of(45.0)), 10, "the coarser level is drawn well below the limit");
    assert_eq!(stage.drawn_from(distance_of(57.0)), 10, "the coarser level is kept up to the limit");
}

#[test]
fn settings_limit_the_level() {
    let Some(mut stage) = Stage::of(&detailed()) else { return };
    for (finest_level, expected) in [(1, 10), (2, 2), (200, 2), (0, 100)] {
        stage.set(CaptureSettings { finest_level, ..default() });
        assert_eq!(stage.drawn_from(distance_of(100.0)), expected, "with the finest level {finest_level}");
    }
    stage.app.insert_resource(CaptureDetail { bias: -1.5 });
    assert_eq!(stage.drawn_from(distance_of(100.0)), 10, "with a bias of -1.5, 100 pixels count as 35");
    stage.app.insert_resource(CaptureDetail::default());
    assert_eq!(stage.drawn_from(distance_of(100.0)), 100, "without a bias, 100 pixels count as 100");
}

#[test]
fn two_eyes_draw_the_same_level() {
    let Some(mut stage) = Stage::of(&detailed()) else { return };
    let second = spawn_camera(&mut stage.app, Msaa::Off, Transform::default());
    insert(&mut stage.app, second, Camera { order: 1, ..default() });
    let mut drawn = |first: f32, other: f32| {
        let pose = Transform::from_xyz(0.1, 0.0, distance_of(other)).looking_at(Vec3::ZERO, Vec3::Y);
        insert(&mut stage.app, second, pose);
        let first = stage.drawn_from(distance_of(first));
        let statistics = stage.app.world().resource::<CaptureStatistics>();
        [first, statistics.view(second).expect("it is seen").total]
    };
    assert_eq!(drawn(61.0, 59.0), [100; 2], "with the limit between the eyes, both draw the finer level");
    assert_eq!(drawn(59.0, 46.0), [100, 10], "a camera farther away has its own level");
    assert_eq!(drawn(59.0, 57.0), [100; 2], "the level does not change when the camera comes near");
    assert_eq!(drawn(46.0, 45.0), [10; 2], "both cameras are well below the limit");
}

#[test]
fn a_capture_without_levels_is_drawn_whole() {
    let Some(mut stage) = Stage::of(&heap(100)) else { return };
    stage.set(CaptureSettings { finest_level: 2, ..default() });
    stage.app.insert_resource(CaptureDetail { bias: -4.0 });
    assert_eq!(stage.drawn_from(distance_of(8.0)), 100, "all Gaussians are drawn");
}

/// Returns the PSNR of two pictures in dB.
pub fn psnr(a: &RgbaImage, b: &RgbaImage) -> f64 {
    let (mut squares, mut count) = (0.0, 0u32);
    for (a, b) in a.pixels().zip(b.pixels()) {
        squares += a.0[..3].iter().zip(&b.0[..3]).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum::<f64>();
        count += 3;
    }
    -10.0 * (squares / f64::from(count) / 255.0f64.powi(2)).log10()
}

#[test]
fn levels_of_the_bundled_capture_reach_45_db() {
    let size = UVec2::new(1280, 720);
    let Some(mut app) = app(size) else { return };
    let camera = spawn_camera(&mut app, Msaa::Off, Transform::default());
    let handle = app.world().resource::<AssetServer>().load("toybox.gs4d");
    app.world_mut().spawn((GaussianCapture3d(handle.clone()), Playback::paused_at(1.3)));
    picture(&mut app, 0.0);
    let (bounds, sizes) = {
        let capture = app.world().resource::<Assets<GaussianCapture>>().get(&handle).expect("it has been loaded");
        let sizes: Vec<f32> = capture.scene().levels.iter().map(|level| level.pixels).collect();
        (capture.bounds().expect("it has Gaussians"), sizes)
    };
    assert_eq!(sizes.len(), 3, "the levels of the bundled capture");
    let focal = size.y as f32 / (2.0 * (FOV_Y / 2.0).tan());
    let drawn = |app: &App| app.world().resource::<CaptureStatistics>().view(camera).expect("it is seen").total;
    let mut before = u32::MAX;
    for pixels in sizes {
        // Just below the limit.
        let distance = 2.0 * focal * bounds.radius() / (0.99 * pixels);
        let eye = bounds.center() + Vec3::new(0.5, -0.7, 0.4).normalize() * distance;
        insert(&mut app, camera, Transform::from_translation(eye).looking_at(bounds.center(), Vec3::Z));
        app.insert_resource(CaptureDetail { bias: 16.0 });
        let all = picture(&mut app, 0.0);
        app.insert_resource(CaptureDetail { bias: -0.4 });
        let level = picture(&mut app, 0.0);
        assert!(drawn(&app) < before, "a coarser level has fewer Gaussians: {}, the finer level {before}", drawn(&app));
        before = drawn(&app);
        let found = psnr(&all, &level);
        assert!(found >= 45.0, "the level has {found} dB at {pixels} pixels, less than 45 dB");
    }
}

#[test]
fn captures_smaller_than_in_training_are_anti_aliased() {
    let Some(mut app) = app(SIZE) else { return };
    let trained_with = TrainedWith { pixel: Some(0.004), ..TrainedWith::default() };
    let scene = RuntimeScene { trained_with, ..synthetic(500, 3, false) };
    let pose = Transform::from_xyz(3.0, -5.0, 2.0).looking_at(Vec3::ZERO, Vec3::Y);
    spawn_camera(&mut app, Msaa::Off, pose);
    let capture = spawn(&mut app, &scene, ());
    let plain = view(&pose, SIZE, 0.0);
    let [smooth, fat] = [plain.antialiased(scene.trained_with.pixel), plain]
        .map(|view| reference_picture(&scene, view, Appearance::default()));
    let apart = smooth.pixels.iter().zip(&fat.pixels).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max);
    assert!(apart > 0.05, "anti-aliasing changes the picture: {apart}");
    check(&mut app, &smooth, "anti-aliased");
    insert(&mut app, capture, CaptureSettings { antialias: false, ..default() });
    check(&mut app, &fat, "without anti-aliasing");
}
