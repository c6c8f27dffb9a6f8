//! Failures of the GPU in running apps: limits, refused objects and refused pipelines.
//!
//! In: devices with lowered limits or without a feature, and captures that they cannot draw. Out: proof that the app
//! goes on, that the failure is reported with its entity, and that captures drawn before are still drawn. Skipped
//! without a GPU; a software driver is enough.

use crate::support::blob::blob;
use crate::support::cpu_reference::scene;
use crate::support::event_log::failures_of;
use crate::support::fixtures::{front, synthetic};
use crate::support::limited_app::limited_app;
use crate::support::offscreen_app::{app, run_frames, spawn_camera};
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_resource::{
    BlendState, ColorTargetState, ColorWrites, FragmentState, PipelineCache, RenderPipelineDescriptor,
    SpecializedRenderPipeline, TextureFormat,
};
use bevy::render::renderer::RenderDevice;
use bevy::render::settings::{WgpuLimits, WgpuSettings};
use bevy_gs4d::GaussianCapture3d;
use bevy_gs4d::asset::{CaptureFailed, CaptureFailure, CaptureState, GaussianCapture};
use bevy_gs4d::internal::plugin::CheckedPipelines;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::render::CaptureStatistics;
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::testing::{self, Offscreen};
use image::RgbaImage;
use std::sync::{Mutex, PoisonError};

const SIZE: UVec2 = UVec2::new(64, 48);
/// Largest storage buffer binding of a limited device, bytes: the splats of less than 44,000 Gaussians.
const BINDING: u64 = 1 << 21;

/// Returns an app with a limited device, and a camera in front of the origin.
fn limited(adjust: impl FnOnce(&mut WgpuSettings, WgpuLimits)) -> Option<(App, Entity)> {
    let mut app = limited_app(SIZE, adjust)?;
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    testing::settle(&mut app).expect("an app without captures draws without an error");
    Some((app, camera))
}

/// Returns an app with storage buffer bindings of at most [`BINDING`] bytes.
fn app_with_small_bindings() -> Option<(App, Entity)> {
    limited(|settings, limits| {
        let limits = WgpuLimits { max_storage_buffer_binding_size: BINDING, ..limits };
        settings.constrained_limits = Some(limits);
    })
}

fn spawn(app: &mut App, scene: RuntimeScene) -> Entity {
    let handle = app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(GaussianCapture::new(scene));
    app.world_mut().spawn((GaussianCapture3d(handle), Playback::paused_at(0.0))).id()
}

/// Returns one Gaussian in the middle.
fn red() -> RuntimeScene {
    scene(&[(blob(Vec3::ZERO, Vec3::splat(0.4), 0.98), Vec3::X)])
}

/// Returns the failures of an entity.
fn about(failures: &Mutex<Vec<CaptureFailed>>, entity: Entity) -> Vec<String> {
    let failures = failures.lock().unwrap_or_else(PoisonError::into_inner);
    failures.iter().filter(|failure| failure.entity == entity).map(|failure| failure.error.to_string()).collect()
}

fn read(app: &mut App) -> RgbaImage {
    let offscreen = app.world().resource::<Offscreen>().clone();
    testing::read(app, &offscreen).expect("the app draws without an error")
}

fn is_red_in_the_middle(picture: &RgbaImage) -> bool {
    let [r, g, b, _] = picture.get_pixel(SIZE.x / 2, SIZE.y / 2).0;
    r > 200 && g < 60 && b < 60
}

#[test]
fn a_capture_too_large_for_any_view_fails_and_the_old_capture_is_drawn() {
    let Some((mut app, _)) = app_with_small_bindings() else { return };
    let failures = failures_of(&mut app);
    let old = spawn(&mut app, red());
    testing::settle(&mut app).expect("the app draws without an error");
    assert!(is_red_in_the_middle(&read(&mut app)), "the first capture is drawn");
    let large = spawn(&mut app, synthetic(60_000, 1, false));
    run_frames(&mut app, 10);
    let said = about(&failures, large);
    assert!(
        matches!(&said[..], [one] if one.contains("the splats") && one.contains("draw fewer Gaussians")),
        "one failure with its remedy is sent: {said:?}"
    );
    let state = app.world().get::<CaptureState>(large).expect("a required component");
    let typed = matches!(state, CaptureState::Failed(CaptureFailure::TooLarge { .. }));
    assert!(typed, "the large capture has failed for its size: {state:?}");
    assert!(is_red_in_the_middle(&read(&mut app)), "the first capture is still drawn");
    // A changed asset is rejected in the same way.
    let id = app.world().get::<GaussianCapture3d>(old).expect("still there").0.id();
    let changed = GaussianCapture::new(synthetic(60_000, 2, false));
    app.world_mut().resource_mut::<Assets<GaussianCapture>>().insert(id, changed).expect("a used identifier");
    run_frames(&mut app, 10);
    assert_eq!(about(&failures, old).len(), 1, "one failure of the changed capture is sent");
    assert!(is_red_in_the_middle(&read(&mut app)), "its old version is still drawn");
}

#[test]
fn captures_without_room_in_a_view_leave_the_earlier_captures_drawn() {
    let Some((mut app, camera)) = app_with_small_bindings() else { return };
    let drawn = |app: &App| app.world().resource::<CaptureStatistics>().view(camera).map(|view| view.total);
    spawn(&mut app, synthetic(24_000, 1, false));
    testing::settle(&mut app).expect("the app draws without an error");
    let before = read(&mut app);
    assert!(before.pixels().any(|pixel| pixel.0[..3] != [0, 0, 0]), "the first capture is drawn");
    // Each fits alone.
    let second = spawn(&mut app, synthetic(24_000, 2, false));
    run_frames(&mut app, 20);
    assert_eq!(app.world().get::<CaptureState>(second), Some(&CaptureState::Ready), "the second capture is uploaded");
    assert!(read(&mut app) == before, "the first capture is drawn as before");
    run_frames(&mut app, 70);
    assert_eq!(drawn(&app), Some(24_000), "the first capture is drawn after further attempts");
    assert!(read(&mut app) == before, "the picture is unchanged after further attempts");
    // Once the first capture is gone, there is room for the second.
    let mut captures = app.world_mut().query_filtered::<Entity, With<GaussianCapture3d>>();
    let first = captures.iter(app.world()).find(|entity| *entity != second).expect("the first capture");
    app.world_mut().despawn(first);
    run_frames(&mut app, 5);
    assert_eq!(drawn(&app), Some(24_000), "the second capture is drawn");
    assert!(read(&mut app) != before, "the picture shows the second capture");
}

#[test]
fn a_device_that_refuses_a_layout_is_reported_and_the_app_goes_on() {
    let lowered = limited(|settings, limits| {
        // The pass that writes color and depth needs two. No limit is checked before.
        settings.constrained_limits = Some(WgpuLimits { max_storage_textures_per_shader_stage: 1, ..limits });
    });
    let Some((mut app, _)) = lowered else { return };
    let failures = failures_of(&mut app);
    let entity = spawn(&mut app, red());
    run_frames(&mut app, 10);
    let why = app.world().resource::<CaptureStatistics>().renderer_missing().expect("the renderer is missing");
    assert!(why.contains("refused"), "the reason says that the GPU refused an object: {why}");
    let said = about(&failures, entity);
    assert!(matches!(&said[..], [one] if one.contains(&why)), "one failure with the reason is sent: {said:?}");
    let state = app.world().get::<CaptureState>(entity).expect("a required component");
    let typed = matches!(state, CaptureState::Failed(CaptureFailure::NoRenderer { .. }));
    assert!(typed, "the capture has failed for want of a renderer: {state:?}");
}

/// Blends into a target of this format.
struct Blending;

impl SpecializedRenderPipeline for Blending {
    type Key = TextureFormat;

    fn specialize(&self, format: TextureFormat) -> RenderPipelineDescriptor {
        let blend = Some(BlendState::PREMULTIPLIED_ALPHA_BLENDING);
        let targets = vec![Some(ColorTargetState { format, blend, write_mask: ColorWrites::ALL })];
        RenderPipelineDescriptor { fragment: Some(FragmentState { targets, ..default() }), ..default() }
    }
}

#[test]
fn a_pipeline_that_the_gpu_refuses_is_left_out_and_the_app_goes_on() {
    let Some(mut app) = app(SIZE) else { return };
    testing::settle(&mut app).expect("the app draws without an error");
    let mut pipelines = CheckedPipelines::<Blending>::default();
    let world = app.sub_app(RenderApp).world();
    let (device, cache) = (world.resource::<RenderDevice>(), world.resource::<PipelineCache>());
    let refused = pipelines.specialize(device, cache, &Blending, TextureFormat::Rgba32Uint);
    assert_eq!(refused, None, "integers cannot be blended");
    run_frames(&mut app, 3);
}
