//! Cameras that are switched off: a view is kept for some time, so that a camera that is active again draws at once.
//!
//! In: a synthetic capture, cameras and lights in headless apps. Out: proof that a short pause frees nothing and a long
//! one frees the GPU memory. Skipped without a GPU.

use crate::support::fixtures::{spawn, synthetic, synthetic_eye};
use crate::support::offscreen_app::{picture, run_frames, spawn_camera, unpipelined_app};
use bevy::light::DirectionalLightShadowMap;
use bevy::prelude::*;
use bevy_gs4d::pbr::CastsShadows;
use bevy_gs4d::render::CaptureStatistics;

const SIZE: UVec2 = UVec2::new(64, 48);

fn switch(app: &mut App, camera: Entity, on: bool) {
    app.world_mut().get_mut::<Camera>(camera).expect("a camera").is_active = on;
}

fn created(app: &App) -> u64 {
    app.world().resource::<CaptureStatistics>().work().created()
}

fn bytes(app: &App, camera: Entity) -> u64 {
    app.world().resource::<CaptureStatistics>().view(camera).map_or(0, |view| view.bytes)
}

#[test]
fn a_camera_that_is_switched_off_for_a_frame_keeps_its_view() {
    let Some(mut app) = unpipelined_app(SIZE) else { return };
    app.insert_resource(DirectionalLightShadowMap { size: 256 });
    let capture = spawn(&mut app, &synthetic(2000, 1, true), CastsShadows::default());
    let light = DirectionalLight { shadow_maps_enabled: true, ..default() };
    app.world_mut().spawn((light, Transform::from_xyz(1.0, 1.0, 2.0).looking_at(Vec3::ZERO, Vec3::Z)));
    let camera = spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    let before = picture(&mut app, 0.0);
    assert!(before.pixels().any(|pixel| pixel.0[..3] != [0, 0, 0]), "the capture is drawn");
    run_frames(&mut app, 10);
    let (made, memory) = (created(&app), bytes(&app, camera));
    assert!(memory > 0, "the view has memory");
    switch(&mut app, camera, false);
    run_frames(&mut app, 1);
    assert_eq!(bytes(&app, camera), memory, "the memory is kept while the camera is off");
    switch(&mut app, camera, true);
    run_frames(&mut app, 3);
    assert_eq!(created(&app), made, "no object of the camera or of its shadow cascades is created again");
    assert!(picture(&mut app, 0.0) == before, "the picture is as before");
    app.world_mut().despawn(capture);
}

#[test]
fn a_camera_that_is_switched_off_for_long_releases_its_memory() {
    let Some(mut app) = unpipelined_app(SIZE) else { return };
    spawn(&mut app, &synthetic(2000, 1, true), Transform::default());
    let camera = spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    let before = picture(&mut app, 0.0);
    switch(&mut app, camera, false);
    run_frames(&mut app, 130);
    assert_eq!(bytes(&app, camera), 0, "the memory is released");
    switch(&mut app, camera, true);
    assert!(picture(&mut app, 0.0) == before, "the picture is as before");
    assert!(bytes(&app, camera) > 0, "the view has memory again");
    switch(&mut app, camera, false);
    run_frames(&mut app, 2);
    app.world_mut().despawn(camera);
    run_frames(&mut app, 2);
    let views = app.world().resource::<CaptureStatistics>().views();
    assert!(views.is_empty(), "a camera that is despawned while it is off has no view: {views:?}");
}
