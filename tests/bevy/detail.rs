//! Levels of detail in headless apps.
//!
//! In: a capture with levels made by hand, far away and near. Out: proof that the level follows the size on the screen without flicker, that
//! settings limit it, and that captures without levels are drawn as they are. Skipped where there is no GPU.

use crate::support::blob::blob;
use crate::support::cpu_reference::{SIZE, add, scene};
use crate::support::offscreen_app::{app, picture, spawn_camera};
use bevy::prelude::*;
use bevy_gs4d::GaussianCapture3d;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::render::{CaptureDetail, CaptureSettings, CaptureStatistics};
use bevy_gs4d::scene::{Level, RuntimeScene};
use std::sync::Arc;

/// Returns as many equal Gaussians.
fn heap(count: usize) -> RuntimeScene {
    scene(&vec![(blob(Vec3::ZERO, Vec3::splat(0.3), 0.5), Vec3::new(0.9, 0.3, 0.1)); count])
}

/// Returns 100 Gaussians with levels of 10, up to 60 pixels, and of 2, up to 12 pixels.
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

    /// Returns the number of Gaussians that are drawn from a distance.
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

/// Returns the distance from which a heap is so many pixels across: three deviations of 0.3 in each direction are a sphere of radius 1.56,
/// and 150 pixels are 0.8 radians high.
fn distance_of(pixels: f32) -> f32 {
    let (radius, focal) = (0.9 * 3f32.sqrt(), 75.0 / 0.4f32.tan());
    radius * (1.0 + (2.0 * focal / pixels).powi(2)).sqrt()
}

#[test]
fn a_capture_far_away_is_drawn_with_few_gaussians() {
    let Some(mut stage) = Stage::of(&detailed()) else { return };
    assert_eq!(stage.drawn_from(distance_of(100.0)), 100, "near by all of them");
    assert_eq!(stage.drawn_from(distance_of(40.0)), 10, "farther away a level");
    assert_eq!(stage.drawn_from(distance_of(8.0)), 2, "far away the coarsest");
    assert_eq!(stage.drawn_from(distance_of(100.0)), 100, "and back");
}

#[test]
fn a_level_does_not_flicker_at_its_limit() {
    let Some(mut stage) = Stage::of(&detailed()) else { return };
    let mut seen = Vec::new();
    for turn in 0..8 {
        let pixels = 60.0 * if turn % 2 == 0 { 1.05 } else { 0.95 };
        seen.push(stage.drawn_from(distance_of(pixels)));
    }
    assert_eq!(seen, [100; 8], "it stays fine until it is well below the limit");
    assert_eq!(stage.drawn_from(distance_of(45.0)), 10, "where it is");
    assert_eq!(stage.drawn_from(distance_of(57.0)), 10, "and stays coarse up to the limit");
}

#[test]
fn settings_limit_the_level() {
    let Some(mut stage) = Stage::of(&detailed()) else { return };
    for (finest_level, expected) in [(1, 10), (2, 2), (200, 2), (0, 100)] {
        stage.set(CaptureSettings { finest_level, ..default() });
        assert_eq!(stage.drawn_from(distance_of(100.0)), expected, "no finer than level {finest_level}");
    }
    stage.app.insert_resource(CaptureDetail { bias: -1.5, ..default() });
    assert_eq!(stage.drawn_from(distance_of(100.0)), 10, "100 pixels count as 35");
    stage.app.insert_resource(CaptureDetail::default());
    assert_eq!(stage.drawn_from(distance_of(100.0)), 100, "and as 100 again");
}

#[test]
fn a_capture_without_levels_is_drawn_as_it_is() {
    let Some(mut stage) = Stage::of(&heap(100)) else { return };
    stage.set(CaptureSettings { finest_level: 2, ..default() });
    stage.app.insert_resource(CaptureDetail { bias: -4.0, ..default() });
    assert_eq!(stage.drawn_from(distance_of(8.0)), 100, "all Gaussians");
}
