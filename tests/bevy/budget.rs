//! Captures within a budget of time, in headless apps.
//!
//! In: synthetic captures, budgets that a software driver cannot keep and budgets that every driver keeps. Out: proof
//! that the pictures become coarser step by step down to the smallest share, that all Gaussians return, that a priority
//! keeps those of a capture, and that two cameras share the budget. Skipped without a GPU; what needs timestamps also
//! without these.

use crate::detail::psnr;
use crate::support::fixtures::{insert, spawn, synthetic, synthetic_eye};
use crate::support::offscreen_app::{app, picture, run_frames, spawn_camera};
use crate::support::skip::skip;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::renderer::RenderDevice;
use bevy::render::settings::WgpuFeatures;
use bevy::time::TimeUpdateStrategy;
use bevy_gs4d::render::{CaptureBudget, CaptureSettings, CaptureStatistics};
use bevy_gs4d::testing::{self, Offscreen};
use std::time::Duration;

/// A budget of GPU time that no GPU keeps.
const IMPOSSIBLE: CaptureBudget =
    CaptureBudget { gpu_time: Some(Duration::from_nanos(1)), frame_time: None, least_share: 0.1 };
/// Frames after which such a budget has its full effect.
const MANY: usize = 260;
const SIZE: UVec2 = UVec2::new(64, 48);
const GAUSSIANS: usize = 2000;

/// Returns whether the GPU of an app that has drawn has timestamps.
fn has_timestamps(app: &App) -> bool {
    let features = app.sub_app(RenderApp).world().resource::<RenderDevice>().features();
    let has = features.contains(WgpuFeatures::TIMESTAMP_QUERY);
    if !has {
        skip("the GPU has no timestamps");
    }
    has
}

fn statistics(app: &App) -> CaptureStatistics {
    app.world().resource::<CaptureStatistics>().clone()
}

/// Returns the number of Gaussians that a camera draws.
fn visible(app: &App, camera: Entity) -> u32 {
    statistics(app).view(camera).expect("the camera sees a capture").visible
}

/// Runs frames until a condition holds, at most so many as an impossible budget needs for its full effect.
fn run_until(app: &mut App, holds: impl Fn(&App) -> bool) {
    for _ in 0..MANY {
        run_frames(app, 1);
        if holds(app) {
            return;
        }
    }
    panic!("{MANY} frames are enough: {} px", statistics(app).cut());
}

#[test]
fn without_time_left_pictures_become_coarser_in_small_steps_and_all_gaussians_return() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, &synthetic(GAUSSIANS, 1, false), ());
    let camera = spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    let whole = picture(&mut app, 0.0);
    if !has_timestamps(&app) {
        return;
    }
    let all = visible(&app, camera);
    app.insert_resource(CaptureBudget { gpu_time: Some(Duration::from_secs(60)), ..default() });
    run_frames(&mut app, 20);
    assert_eq!(picture(&mut app, 0.0), whole, "a budget that is kept changes no bit");
    assert_eq!(statistics(&app).cut(), 0.0, "nothing is left out");

    app.insert_resource(IMPOSSIBLE);
    let offscreen = app.world().resource::<Offscreen>().clone();
    let (mut before, mut nearest) = (whole.clone(), f64::INFINITY);
    for _ in 0..MANY {
        run_frames(&mut app, 1);
        let next = testing::read(&mut app, &offscreen).expect("the picture is read");
        nearest = nearest.min(psnr(&before, &next));
        before = next;
        if visible(&app, camera) * 2 < all {
            break;
        }
    }
    let left = visible(&app, camera);
    let coarse = psnr(&whole, &before);
    println!("{left} of {all} Gaussians, {coarse:.1} dB, two frames in turn have at least {nearest:.1} dB");
    // A tenth is drawn whole, others are fainter.
    assert!(left * 2 < all && left * 10 > all, "few of the {all} visible Gaussians are drawn: {left}");
    assert!(coarse > 12.0 && coarse < 35.0, "the picture is coarse: {coarse:.1} dB");
    assert!(nearest > 30.0, "two frames in turn have at least 30 dB: {nearest:.1}");
    assert!(statistics(&app).cut() > 0.0, "the statistics tell the size");

    app.insert_resource(CaptureBudget { gpu_time: Some(Duration::from_secs(60)), ..default() });
    run_until(&mut app, |app| statistics(app).cut() == 0.0);
    assert_eq!(picture(&mut app, 0.0), whole, "all Gaussians return when there is time");
    app.insert_resource(IMPOSSIBLE);
    run_until(&mut app, |app| visible(app, camera) * 5 < all * 4);
    assert_ne!(picture(&mut app, 0.0), whole, "coarser again");
    app.insert_resource(CaptureBudget::default());
    assert_eq!(picture(&mut app, 0.0), whole, "without a budget all Gaussians are drawn at once");
    assert!(!statistics(&app).views().is_empty(), "the camera still draws");
}

#[test]
fn a_priority_keeps_the_gaussians_of_a_capture() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = synthetic(GAUSSIANS, 2, false);
    let entity = spawn(&mut app, &scene, CaptureSettings { priority: f32::INFINITY, ..default() });
    let camera = spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    let whole = picture(&mut app, 0.0);
    if !has_timestamps(&app) {
        return;
    }
    let all = visible(&app, camera);
    app.insert_resource(IMPOSSIBLE);
    run_frames(&mut app, 50);
    assert_eq!(picture(&mut app, 0.0), whole, "an infinite priority keeps all Gaussians");
    assert_eq!(statistics(&app).cut(), 0.0, "the size does not rise where it would change nothing");
    insert(&mut app, entity, CaptureSettings::default());
    run_until(&mut app, |app| visible(app, camera) * 2 < all);
}

#[test]
fn the_time_of_frames_is_kept_without_timestamps_and_for_all_cameras() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, &synthetic(GAUSSIANS, 3, true), ());
    let first = spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    let farther = Transform::from_translation(synthetic_eye().translation * 3.0).looking_at(Vec3::ZERO, Vec3::Z);
    let second = spawn_camera(&mut app, Msaa::Off, farther);
    insert(&mut app, second, Camera { order: 1, ..default() });
    picture(&mut app, 0.0);
    let all = [first, second].map(|camera| visible(&app, camera));
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(30)));
    app.insert_resource(CaptureBudget { frame_time: Some(Duration::from_millis(10)), ..default() });
    // Playback is paused: the passing time changes nothing else.
    run_until(&mut app, |app| visible(app, first) * 4 < all[0] * 3);
    let left = [first, second].map(|camera| visible(&app, camera));
    assert!(left[0] * 4 < all[0] * 3 && left[1] < all[1], "both cameras draw less: {left:?} of {all:?}");
    let shares = [0, 1].map(|camera| f64::from(left[camera]) / f64::from(all[camera]));
    assert!(shares[1] < shares[0], "the farther one draws a smaller share: {shares:?}");
    app.insert_resource(CaptureBudget { frame_time: Some(Duration::from_millis(40)), ..default() });
    run_until(&mut app, |app| statistics(app).cut() == 0.0);
    // The counts of the GPU are some frames old.
    run_frames(&mut app, 10);
    let again = [first, second].map(|camera| visible(&app, camera));
    assert_eq!(again, all, "all Gaussians return when frames are short enough");
}
