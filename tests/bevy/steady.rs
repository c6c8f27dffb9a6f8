//! Captures over many frames: no needless GPU work, and no leaked memory.
//!
//! In: synthetic captures in headless apps. Out: proof that GPU memory is constant while time advances, that the memory
//! of removed captures and cameras is released, that views release unused memory, that captures are replaced without a
//! gap and survive a restart of the renderer, and that insufficient GPU limits and invalid captures are reported.
//! Skipped without a GPU.

use crate::support::blob::blob;
use crate::support::cpu_reference::scene;
use crate::support::event_log::failures_of;
use crate::support::fixtures::{synthetic, synthetic_eye};
use crate::support::limited_app::{device_settings, limited_app};
use crate::support::no_gpu::no_gpu;
use crate::support::offscreen_app::{self, app, picture, spawn_camera};
use crate::support::pipelines::check_pipelines;
use bevy::asset::{AssetId, RenderAssetUsages};
use bevy::camera::Hdr;
use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy::render::error_handler::{ErrorType, RenderErrorHandler, RenderErrorPolicy};
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::render_resource::PollType;
use bevy::render::renderer::RenderDevice;
use bevy::render::settings::{RenderCreation, WgpuLimits};
use bevy::render::{RenderApp, RenderStartup};
use bevy::time::TimeUpdateStrategy;
use bevy_gs4d::asset::{CaptureFailed, CaptureFailure, CaptureReady, CaptureState, GaussianCapture};
use bevy_gs4d::gaussian::Gaussian;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::render::{CaptureSettings, CaptureStatistics, CaptureUploadBudget, CaptureViewSettings, DepthWrite};
use bevy_gs4d::renderer::{Design, WorkCounters};
use bevy_gs4d::scene::{Environment, RuntimeScene};
use bevy_gs4d::testing::{self, Offscreen};
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugins};
use std::collections::VecDeque;
use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Rows of this width have no padding when they are read back.
const SIZE: UVec2 = UVec2::new(64, 48);
const STEP: Duration = Duration::from_millis(10);

/// Returns `count` Gaussians of one color, at rest at the origin.
fn heap(count: usize, color: Vec3) -> RuntimeScene {
    let gaussian = Gaussian { covariance: [0.2, 0.0, 0.0, 0.2, 0.0, 0.2], ..blob(Vec3::ZERO, Vec3::ONE, 0.98) };
    scene(&vec![(gaussian, color); count])
}

fn spawn(app: &mut App, scene: RuntimeScene, playback: Playback) -> Entity {
    let handle = app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(GaussianCapture::new(scene));
    app.world_mut().spawn((GaussianCapture3d(handle), playback)).id()
}

/// Spawns two cameras with targets of one size, of which the second writes depth.
fn spawn_eyes(app: &mut App) {
    spawn_camera(app, Msaa::Off, synthetic_eye());
    let second = Offscreen::new(&mut app.world_mut().resource_mut::<Assets<Image>>(), SIZE);
    let camera = spawn_camera(app, Msaa::Off, synthetic_eye().with_translation(Vec3::new(-0.5, -3.0, 1.5)));
    let depth = CaptureViewSettings { depth: DepthWrite::Median, ..default() };
    app.world_mut().entity_mut(camera).insert((second.target(), depth));
}

/// Runs frames of [`STEP`] each.
fn run(app: &mut App, frames: usize) {
    run_in_steps(app, frames, STEP);
}

fn run_in_steps(app: &mut App, frames: usize, step: Duration) {
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    for _ in 0..frames {
        app.update();
        assert!(app.should_exit().is_none(), "rendering stopped; the log has the reason");
        finish_drawing(app);
    }
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
}

/// Waits until the GPU has finished and its counters have arrived, so that their delay in frames does not depend on the
/// load of the machine.
fn finish_drawing(app: &App) {
    let device = app.world().resource::<RenderDevice>().wgpu_device();
    device.poll(PollType::wait_indefinitely()).expect("the GPU finishes its work");
}

fn statistics(app: &App) -> CaptureStatistics {
    app.world().resource::<CaptureStatistics>().clone()
}

/// Returns the counters of the work done so far for this app.
fn work(app: &App) -> WorkCounters {
    statistics(app).work()
}

/// Returns the number of resources created and of bytes uploaded so far for this app.
fn made(app: &App) -> (u64, u64) {
    let work = work(app);
    (work.created(), work.uploaded())
}

/// Returns the size of a view's buffers and targets in bytes.
fn view_bytes(app: &App, camera: Entity) -> u64 {
    statistics(app).view(camera).map_or(0, |view| view.bytes)
}

fn show(app: &mut App, entity: Entity, visibility: Visibility) {
    app.world_mut().entity_mut(entity).insert(visibility);
}

#[test]
fn no_resource_is_created_or_uploaded_inside_a_segment() {
    let Some(mut app) = app(SIZE) else { return };
    let entity = spawn(&mut app, synthetic(2000, 1, true), Playback::default());
    spawn_eyes(&mut app);
    testing::settle(&mut app).expect("the app draws without an error");
    run(&mut app, 10);
    let before = made(&app);
    assert!(before.0 > 0 && before.1 > 0, "resources have been created and uploaded: {before:?}");
    run(&mut app, 30);
    let time = app.world().get::<Playback>(entity).expect("still there").time;
    assert!((0.39..0.5).contains(&time), "the time is still inside the first segment, at {time}");
    assert_eq!(made(&app), before, "no resource is created or uploaded");
    assert_eq!(statistics(&app).views().len(), 2, "both cameras draw");
    run(&mut app, 60);
    assert_eq!(work(&app).uploaded(), before.1, "another segment needs no upload");
}

#[test]
fn only_active_lists_are_written_from_segment_to_segment() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, synthetic(2000, 1, true), Playback::default());
    spawn_eyes(&mut app);
    testing::settle(&mut app).expect("the app draws without an error");
    // Twice through all four segments, and to the middle of the first.
    let step = Duration::from_millis(50);
    run_in_steps(&mut app, 2 * 40 + 3, step);
    let (before, lists) = (made(&app), work(&app).activated());
    run_in_steps(&mut app, 2 * 40, step);
    assert_eq!(made(&app), before, "no resource is created or uploaded in two loops through all segments");
    assert_eq!(work(&app).activated() - lists, 2 * 4, "one list per segment for both cameras");
}

#[test]
fn a_view_without_captures_releases_its_memory() {
    let Some(mut app) = app(SIZE) else { return };
    let entity = spawn(&mut app, synthetic(2000, 4, true), Playback::paused_at(0.7));
    let camera = spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    let before = picture(&mut app, 0.0);
    assert!(before.pixels().any(|pixel| pixel.0[..3] != [0, 0, 0]), "the capture is drawn");
    assert!(view_bytes(&app, camera) > 0, "the view has memory");
    let created = work(&app).created();
    show(&mut app, entity, Visibility::Hidden);
    run(&mut app, 30);
    show(&mut app, entity, Visibility::Inherited);
    run(&mut app, 5);
    assert_eq!(work(&app).created(), created, "a short time without captures keeps the memory");
    show(&mut app, entity, Visibility::Hidden);
    run(&mut app, 130);
    assert_eq!(view_bytes(&app, camera), 0, "a longer time without captures releases the memory");
    let created = work(&app).created();
    run(&mut app, 130);
    assert_eq!(
        (view_bytes(&app, camera), work(&app).created()),
        (0, created),
        "no resource is created while captures are hidden"
    );
    show(&mut app, entity, Visibility::Inherited);
    assert!(picture(&mut app, 0.0) == before, "the picture is as before");
    assert!(work(&app).created() > created, "the buffers are created again");
}

#[test]
fn a_camera_that_cannot_draw_captures_releases_its_memory() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, synthetic(2000, 4, true), Playback::paused_at(0.7));
    let camera = spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    testing::settle(&mut app).expect("the app draws without an error");
    assert!(view_bytes(&app, camera) > 0, "the view has memory");
    app.world_mut().entity_mut(camera).insert((Hdr, CompositingSpace::Oklab));
    run(&mut app, 130);
    assert_eq!(view_bytes(&app, camera), 0, "a camera with an unsupported compositing space releases its memory");
}

#[test]
fn a_transparent_capture_is_neither_prepared_nor_drawn() {
    let Some(mut app) = app(SIZE) else { return };
    let entity = spawn(&mut app, synthetic(2000, 4, true), Playback::default());
    let camera = spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    let before = picture(&mut app, 0.0);
    let gaussians = |app: &App| statistics(app).view(camera).map_or(0, |view| view.total);
    assert_eq!(gaussians(&app), 2000, "the camera draws all Gaussians");
    let set = |app: &mut App, opacity| {
        let settings = CaptureSettings { opacity, ..default() };
        app.world_mut().entity_mut(entity).insert(settings);
    };
    set(&mut app, 0.0);
    run(&mut app, 2);
    assert_eq!(gaussians(&app), 0, "a transparent capture is not drawn");
    let lists = work(&app).activated();
    // Through all segments of the filter.
    run_in_steps(&mut app, 20, Duration::from_millis(100));
    assert_eq!(work(&app).activated(), lists, "no active lists are written for a transparent capture");
    run(&mut app, 130);
    assert_eq!(view_bytes(&app, camera), 0, "the view releases its memory");
    app.world_mut().entity_mut(entity).insert(Playback::paused_at(0.0));
    set(&mut app, 1.0);
    assert!(picture(&mut app, 0.0) == before, "the opaque capture is drawn as before");
}

#[test]
fn a_view_shrinks_after_a_large_capture_is_despawned() {
    let Some(mut app) = app(SIZE) else { return };
    let large = spawn(&mut app, synthetic(100_000, 5, false), Playback::paused_at(0.7));
    spawn(&mut app, heap(1, Vec3::X), Playback::paused_at(0.7));
    let camera = spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    testing::settle(&mut app).expect("the app draws without an error");
    // The counters of the first frames, for which buffers grow, arrive some frames later.
    for _ in 0..3 {
        finish_drawing(&app);
        run(&mut app, 4);
    }
    let bytes = |app: &App| statistics(app).view(camera).map_or(0, |view| view.bytes + view.shared_bytes);
    let (before, created) = (bytes(&app), work(&app).created());
    assert!(app.world_mut().despawn(large), "the large capture existed");
    run(&mut app, 60);
    assert_eq!(bytes(&app), before, "the memory is kept for a while");
    assert_eq!(work(&app).created(), created, "no resource is created for the remaining capture");
    run(&mut app, 140);
    let after = bytes(&app);
    assert!(0 < after && 4 * after < before, "the view shrinks from {before} to {after} bytes");
    let created = work(&app).created();
    let picture = picture(&mut app, 0.0);
    let [r, g, b, _] = picture.get_pixel(SIZE.x / 2, SIZE.y / 2).0;
    assert!(r > 200 && g < 60 && b < 60, "the small capture is drawn: {r}, {g}, {b}");
    assert_eq!(work(&app).created(), created, "no resource is created after shrinking");
}

#[test]
fn despawned_cameras_release_their_state() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, synthetic(500, 6, true), Playback::paused_at(0.7));
    let camera = spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    let before = picture(&mut app, 0.0);
    let other = Offscreen::new(&mut app.world_mut().resource_mut::<Assets<Image>>(), SIZE);
    let seeing = |app: &App| statistics(app).views().iter().map(|(camera, _)| *camera).collect::<Vec<_>>();
    for round in 0..20 {
        let msaa = if round % 2 == 0 { Msaa::Off } else { Msaa::Sample4 };
        let passing = spawn_camera(&mut app, msaa, synthetic_eye());
        app.world_mut().entity_mut(passing).insert(other.target());
        run(&mut app, 2);
        let both = seeing(&app);
        assert!(both.len() == 2 && both.contains(&passing), "round {round}: both cameras draw, not {both:?}");
        assert!(app.world_mut().despawn(passing), "the second camera existed");
        run(&mut app, 2);
        assert_eq!(seeing(&app), [camera], "round {round}: only the first camera draws");
    }
    assert!(picture(&mut app, 0.0) == before, "the picture of the first camera is as before");
    check_pipelines(&app).expect("every pipeline compiles");
}

#[test]
fn despawned_captures_release_their_memory() {
    let Some(mut app) = app(SIZE) else { return };
    spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    testing::settle(&mut app).expect("the app draws without an error");
    let statistics = statistics(&app);
    let mut living = VecDeque::new();
    for frame in 0..300 {
        if frame < 100 && frame % 10 == 0 {
            let scene = synthetic(10_000, frame, frame % 20 == 0);
            living.push_back(spawn(&mut app, scene, Playback::default()));
        }
        // Each capture is visible for some frames; later all captures are visible.
        let show = match frame % 10 {
            _ if frame == 105 => Some(Visibility::Inherited),
            4 | 7 => Some(Visibility::Hidden),
            _ => None,
        };
        if let Some(show) = show {
            for &entity in &living {
                app.world_mut().entity_mut(entity).insert(show);
            }
        }
        if (120..270).contains(&frame) && frame % 15 == 0 {
            let oldest = living.pop_front().expect("ten have been spawned");
            assert!(app.world_mut().despawn(oldest), "the capture existed");
        }
        run(&mut app, 1);
        if frame == 2 || frame == 106 {
            // A capture appears once its passes are compiled.
            testing::settle(&mut app).expect("the app draws without an error");
            let count = if frame == 2 { 1 } else { 10 };
            assert_eq!(statistics.uploaded_captures(), count, "captures on the GPU in frame {frame}");
            let bytes = statistics.capture_bytes();
            assert!(
                bytes >= count as u64 * 10_000 * 64,
                "{count} captures have at least 64 bytes per Gaussian, not {bytes}"
            );
            let total: u32 = statistics.views().iter().map(|(_, view)| view.total).sum();
            assert_eq!(total, count as u32 * 10_000, "Gaussians drawn in frame {frame}");
        }
    }
    assert!(living.is_empty(), "all captures are despawned");
    run(&mut app, 5);
    assert_eq!(
        (statistics.uploaded_captures(), statistics.capture_bytes()),
        (0, 0),
        "the memory of all captures is released"
    );
    assert!(statistics.views().is_empty(), "no view draws captures");
    assert_eq!(app.world().resource::<Assets<GaussianCapture>>().len(), 0, "all assets are dropped");
    check_pipelines(&app).expect("every pipeline compiles");
}

/// Replaces the scene of an entity's capture.
fn replace(app: &mut App, entity: Entity, scene: RuntimeScene) {
    let id: AssetId<GaussianCapture> = app.world().get::<GaussianCapture3d>(entity).expect("still there").into();
    let mut captures = app.world_mut().resource_mut::<Assets<GaussianCapture>>();
    captures.insert(id, GaussianCapture::new(scene)).expect("its handle is alive");
}

/// Collects the events of one type from now on, as text.
fn messages_of<E: EntityEvent + Debug>(app: &mut App) -> Arc<Mutex<Vec<String>>> {
    let messages = Arc::new(Mutex::new(Vec::new()));
    let sink = messages.clone();
    app.add_observer(move |event: On<E>| {
        sink.lock().unwrap_or_else(PoisonError::into_inner).push(format!("{:?}", event.event()));
    });
    messages
}

/// Returns the number of events about an entity.
fn count_about(messages: &Mutex<Vec<String>>, entity: Entity) -> usize {
    let messages = messages.lock().unwrap_or_else(PoisonError::into_inner);
    messages.iter().filter(|message| message.contains(&format!("entity: {entity:?},"))).count()
}

fn state(app: &App, entity: Entity) -> CaptureState {
    app.world().get::<CaptureState>(entity).expect("a required component").clone()
}

#[test]
fn a_large_capture_is_uploaded_over_several_frames() {
    const BUDGET: u64 = 64 << 10;
    let Some(mut app) = app(SIZE) else { return };
    let camera = spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    testing::settle(&mut app).expect("the app draws without an error");
    app.insert_resource(CaptureUploadBudget { bytes_per_frame: BUDGET });
    let ready = messages_of::<CaptureReady>(&mut app);
    let entity = spawn(&mut app, synthetic(5000, 9, true), Playback::paused_at(0.7));
    let mut frames = 0;
    while statistics(&app).uploaded_captures() == 0 {
        assert_eq!(statistics(&app).view(camera), None, "a partly uploaded capture is not drawn");
        assert_eq!(statistics(&app).uploading_captures(), usize::from(frames > 0), "the capture counts as uploading");
        assert_eq!(
            (state(&app, entity), count_about(&ready, entity)),
            (CaptureState::Loading, 0),
            "a partly uploaded capture is not ready"
        );
        let before = work(&app).uploaded();
        run(&mut app, 1);
        let bytes = work(&app).uploaded() - before;
        assert!(bytes <= BUDGET, "{bytes} bytes in frame {frames} exceed the budget");
        frames += 1;
        assert!(frames < 100, "the upload is completed");
    }
    let bytes = statistics(&app).capture_bytes();
    assert_eq!(work(&app).uploaded(), bytes, "every byte is uploaded once");
    assert!(bytes.div_ceil(BUDGET) <= frames, "{bytes} bytes cannot be uploaded in {frames} frames");
    run(&mut app, 2);
    assert_eq!(
        (state(&app, entity), count_about(&ready, entity)),
        (CaptureState::Ready, 1),
        "the capture is ready, with one event"
    );
    let pieces = picture(&mut app, 0.0);
    app.insert_resource(CaptureUploadBudget::default());
    app.sub_app_mut(RenderApp).world_mut().run_schedule(RenderStartup);
    assert!(picture(&mut app, 0.0) == pieces, "an upload in one frame gives the same picture");
}

#[test]
fn a_capture_plays_from_its_first_picture_on() {
    let Some(mut app) = app(SIZE) else { return };
    spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    testing::settle(&mut app).expect("the app draws without an error");
    app.insert_resource(CaptureUploadBudget { bytes_per_frame: 64 << 10 });
    let entity = spawn(&mut app, synthetic(5000, 9, true), Playback::default());
    let time = |app: &App| app.world().get::<Playback>(entity).expect("still there").time;
    let mut frames = 0;
    while statistics(&app).uploaded_captures() == 0 {
        assert_eq!(time(&app), 0.0, "playback waits in frame {frames} until the capture is drawn");
        run(&mut app, 1);
        frames += 1;
        assert!(frames < 100, "the upload is completed");
    }
    assert!(frames > 2, "the upload takes more than two frames, not {frames}");
    // With pipelined rendering, the next update has started.
    assert!(time(&app) <= STEP.as_secs_f32(), "the first picture is at the start, not at {} s", time(&app));
    run(&mut app, 10);
    let played = time(&app) / STEP.as_secs_f32();
    assert!((9.5..11.5).contains(&played), "playback advances by ten steps, not {played}");
}

#[test]
fn a_rejected_replacement_keeps_the_previous_capture() {
    let Some(mut app) = app(SIZE) else { return };
    let entity = spawn(&mut app, heap(1, Vec3::X), Playback::paused_at(0.0));
    let camera = spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    let before = picture(&mut app, 0.0);
    let messages = (messages_of::<CaptureReady>(&mut app), messages_of::<CaptureFailed>(&mut app));
    let said = || (count_about(&messages.0, entity), count_about(&messages.1, entity));
    let map = Environment { width: 8, height: 4, texels: vec![0.5; 10] };
    replace(&mut app, entity, RuntimeScene { environment: Some(map), ..heap(1, Vec3::Z) });
    assert!(picture(&mut app, 0.0) == before, "the previous capture is still drawn");
    assert_eq!((state(&app, entity), said()), (CaptureState::Ready, (0, 1)), "one failure event is sent");
    assert_eq!(statistics(&app).view(camera).map(|view| view.total), Some(1), "one Gaussian is drawn");
    replace(&mut app, entity, heap(1, Vec3::Z));
    let after = picture(&mut app, 0.0);
    let [r, _, b, _] = after.get_pixel(SIZE.x / 2, SIZE.y / 2).0;
    assert!(b > 200 && r < 60, "a valid scene replaces the capture: {r}, {b}");
    assert_eq!((state(&app, entity), said()), (CaptureState::Ready, (1, 1)), "one ready event is sent");
}

#[test]
fn a_replaced_scene_is_shown_without_a_gap() {
    let Some(mut app) = app(SIZE) else { return };
    let entity = spawn(&mut app, heap(1, Vec3::X), Playback::paused_at(0.0));
    spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    testing::settle(&mut app).expect("the app draws without an error");
    // The pixel in the middle, frame by frame.
    let seen = Arc::new(Mutex::new(Vec::new()));
    let sink = seen.clone();
    let middle = (SIZE.y / 2 * SIZE.x + SIZE.x / 2) as usize * 4;
    let watch = move |event: On<ReadbackComplete>| {
        let pixel = [0, 1, 2].map(|channel| event.data[middle + channel]);
        sink.lock().unwrap_or_else(PoisonError::into_inner).push(pixel);
    };
    let image = app.world().resource::<Offscreen>().image.clone();
    app.world_mut().spawn(Readback::texture(image)).observe(watch);
    run(&mut app, 5);
    // About eight frames for the other scene.
    app.insert_resource(CaptureUploadBudget { bytes_per_frame: 8 << 10 });
    replace(&mut app, entity, heap(700, Vec3::Z));
    run(&mut app, 24);
    let seen = seen.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let [red, blue]: [fn(&[u8; 3]) -> bool; 2] = [|p| p[0] > 200 && p[2] < 60, |p| p[2] > 200 && p[0] < 60];
    let changed = seen.iter().position(blue).expect("the other scene is shown");
    assert!(
        changed > 7 && seen[..changed].iter().all(red),
        "the first scene is shown until the other one is uploaded: {seen:?}"
    );
    assert!(seen[changed..].iter().all(blue), "afterwards only the other scene is shown: {seen:?}");
}

/// Collects the app's pictures from now on, one per frame.
fn frames_of(app: &mut App) -> Arc<Mutex<Vec<Vec<u8>>>> {
    let frames = Arc::new(Mutex::new(Vec::new()));
    let sink = frames.clone();
    let image = app.world().resource::<Offscreen>().image.clone();
    app.world_mut().spawn(Readback::texture(image)).observe(move |event: On<ReadbackComplete>| {
        sink.lock().unwrap_or_else(PoisonError::into_inner).push(event.data.clone());
    });
    frames
}

#[test]
fn every_frame_after_a_camera_cut_has_all_splats() {
    for design in [Design::GlobalSort, Design::TileBins] {
        // Rows of this width have no padding.
        let Some(mut app) = app(UVec2::new(384, 288)) else { return };
        let mut scene = synthetic(1500, 2, false);
        // Large and faint, so that even the farthest splat is visible.
        for gaussian in &mut scene.form.as_sliced_mut().expect("synthetic scenes are sliced").gaussians {
            gaussian.covariance = gaussian.covariance.map(|entry| 100.0 * entry);
            (gaussian.opacity, gaussian.sigma_t, gaussian.velocity) = (0.006, f32::INFINITY, [0.0; 3]);
        }
        spawn(&mut app, scene, Playback::paused_at(1.0));
        let close = Vec3::new(2.2, 1.1, 1.4);
        let look_from = |place: Vec3| Transform::from_translation(place).looking_at(Vec3::ZERO, Vec3::Z);
        let camera = spawn_camera(&mut app, Msaa::Off, look_from(20.0 * close));
        app.world_mut().entity_mut(camera).insert(CaptureViewSettings { design, ..default() });
        testing::settle(&mut app).expect("the app draws without an error");
        let frames = frames_of(&mut app);
        run(&mut app, 4);
        app.world_mut().entity_mut(camera).insert(look_from(close));
        run(&mut app, 12);
        let pairs = statistics(&app).view(camera).map_or(0, |view| view.pairs);
        assert!(pairs > 1 << 16, "{design:?}: {pairs} pairs do not exceed the initial capacity");
        let frames = frames.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let (before, after) = (frames.first().expect("a frame"), frames.last().expect("a frame"));
        let cut = frames.iter().position(|frame| frame != before).expect("the cut is seen");
        assert!(frames.len() - cut > 4, "{design:?}: more than four frames after the cut, of {}", frames.len());
        for (number, frame) in frames[cut..].iter().enumerate() {
            let apart = frame.iter().zip(after).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(
                apart <= Some(1),
                "{design:?}: frame {number} after the cut differs from the last frame by {apart:?} / 255"
            );
        }
    }
}

#[test]
fn a_restart_of_the_renderer_recreates_all_resources() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, synthetic(2000, 3, true), Playback::paused_at(0.7));
    let camera = spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    let depth = CaptureViewSettings { depth: DepthWrite::Expected, ..default() };
    app.world_mut().entity_mut(camera).insert(depth);
    let before = picture(&mut app, 0.0);
    assert!(before.pixels().any(|pixel| pixel.0[..3] != [0, 0, 0]), "the capture is drawn");
    let (created, uploaded) = made(&app);
    // Bevy runs this schedule with a new device.
    app.sub_app_mut(RenderApp).world_mut().run_schedule(RenderStartup);
    let after = picture(&mut app, 0.0);
    assert!(work(&app).uploaded() > uploaded, "the capture is uploaded again");
    assert!(work(&app).created() > created, "working buffers are created again");
    assert!(before == after, "the picture is as before");
    assert_eq!(statistics(&app).renderer_missing(), None, "the renderer is available");
    assert_eq!(statistics(&app).uploaded_captures(), 1, "the capture is uploaded only once");
    check_pipelines(&app).expect("every pipeline compiles");
}

#[test]
fn captures_are_drawn_again_after_a_lost_device() {
    if !testing::has_gpu() {
        return no_gpu();
    }
    // Bevy's PbrPlugin reads back a buffer of the lost device and panics.
    let mut app = testing::app_with(SIZE, |plugins| plugins.disable::<PbrPlugin>());
    app.add_plugins(GaussianCapturePlugins).insert_resource(ClearColor(Color::BLACK));
    app.insert_resource(RenderErrorHandler(|error, _, _| match error.ty {
        ErrorType::DeviceLost => RenderErrorPolicy::Recover(RenderCreation::Automatic(Box::new(device_settings()))),
        // Errors of work that was in progress when the device was lost.
        _ => RenderErrorPolicy::Ignore,
    }));
    let kept = spawn(&mut app, synthetic(2000, 3, true), Playback::paused_at(0.7));
    let on_gpu_only = GaussianCapture::new(heap(1, Vec3::X)).with_usages(RenderAssetUsages::RENDER_WORLD);
    let on_gpu_only = app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(on_gpu_only);
    let on_gpu_only = app.world_mut().spawn((GaussianCapture3d(on_gpu_only), Visibility::Hidden)).id();
    spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    let before = picture(&mut app, 0.0);
    assert!(before.pixels().any(|pixel| pixel.0[..3] != [0, 0, 0]), "the capture is drawn");
    assert_eq!(state(&app, on_gpu_only), CaptureState::Ready, "a capture without a copy in memory is ready");
    // Until Bevy's own read-backs have ended, since they fail with a lost device.
    for _ in 0..10 {
        app.update();
    }
    // wgpu tells of a mapping that it has succeeded although its buffer was destroyed, and panics when it is read.
    finish_drawing(&app);
    let lost = app.sub_app(RenderApp).world().resource::<RenderDevice>().wgpu_device().clone();
    let uploaded = work(&app).uploaded();
    lost.destroy();
    // Lets Bevy detect the loss.
    lost.poll(PollType::wait_indefinitely()).expect("the lost device can be polled");
    let start = Instant::now();
    while work(&app).uploaded() == uploaded {
        assert!(start.elapsed() < Duration::from_secs(60), "the capture is uploaded to a new device within 60 s");
        app.update();
    }
    let after = picture(&mut app, 0.0);
    assert!(before == after, "the picture is as before");
    assert_eq!(state(&app, kept), CaptureState::Ready, "it is ready again");
    let state = state(&app, on_gpu_only);
    assert!(
        matches!(&state, CaptureState::Failed(CaptureFailure::Device { reason, .. }) if reason.contains("load")),
        "the capture without a copy in memory has failed, with the remedy: {state:?}"
    );
    check_pipelines(&app).expect("every pipeline compiles");
}

#[test]
fn insufficient_gpu_limits_are_reported_and_captures_play() {
    let limited = limited_app(SIZE, |settings, limits| {
        // Enough for Bevy, but not for the renderer.
        settings.constrained_limits = Some(WgpuLimits { max_compute_workgroup_storage_size: 8192, ..limits });
    });
    let Some(mut app) = limited else { return };
    let entity = spawn(&mut app, heap(1, Vec3::X), Playback::default());
    spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    let failures = failures_of(&mut app);
    let picture = picture(&mut app, 0.25);
    assert!(picture.pixels().all(|pixel| pixel.0[..3] == [0, 0, 0]), "captures are not drawn");
    let why = statistics(&app).renderer_missing().expect("a reason");
    assert!(why.contains("max_compute_workgroup_storage_size"), "the reason names the limit: {why}");
    assert_eq!(statistics(&app).uploaded_captures(), 0, "no capture is uploaded");
    let time = app.world().get::<Playback>(entity).expect("still there").time;
    assert_eq!(time, 0.25, "captures play");
    let state = app.world().get::<CaptureState>(entity).expect("a required component");
    assert!(
        matches!(state, CaptureState::Failed(said) if said.to_string().contains(&why)),
        "the state is Failed with the reason: {state:?}"
    );
    let failures = failures.lock().unwrap_or_else(PoisonError::into_inner);
    assert!(matches!(&failures[..], [said] if said.entity == entity), "one failure event is sent: {failures:?}");
}

#[test]
fn inconsistent_captures_fail_and_valid_ones_are_drawn() {
    let Some(mut app) = app(SIZE) else { return };
    let failures = failures_of(&mut app);
    let ready = messages_of::<CaptureReady>(&mut app);
    // One with the filter of a smaller scene, one with a map with too few texels.
    let filtered = RuntimeScene { filter: synthetic(90, 7, true).filter, ..synthetic(100, 7, false) };
    let map = Environment { width: 8, height: 4, texels: vec![0.5; 10] };
    let mapped = RuntimeScene { environment: Some(map), ..heap(1, Vec3::Z) };
    let wrong = [filtered.clone(), mapped].map(|scene| spawn(&mut app, scene, Playback::paused_at(0.0)));
    spawn(&mut app, heap(1, Vec3::X), Playback::paused_at(0.0));
    spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    let picture = picture(&mut app, 0.0);
    let [r, g, b, _] = picture.get_pixel(SIZE.x / 2, SIZE.y / 2).0;
    assert!(r > 200 && g < 60 && b < 60, "the valid capture is drawn: {r}, {g}, {b}");
    assert_eq!(statistics(&app).uploaded_captures(), 1, "only the valid capture is uploaded");
    let said =
        |entity| failures.lock().unwrap_or_else(PoisonError::into_inner).iter().filter(|f| f.entity == entity).count();
    for entity in wrong {
        let state = app.world().get::<CaptureState>(entity).expect("a required component");
        assert!(matches!(state, CaptureState::Failed(_)), "an inconsistent capture has failed: {state:?}");
        assert_eq!(said(entity), 1, "one failure event is sent");
        assert_eq!(count_about(&ready, entity), 0, "no ready event is sent");
    }
    replace(&mut app, wrong[0], filtered);
    offscreen_app::picture(&mut app, 0.0);
    assert_eq!(said(wrong[0]), 2, "a second failed attempt sends another failure event");
    replace(&mut app, wrong[0], heap(1, Vec3::Z));
    offscreen_app::picture(&mut app, 0.0);
    assert_eq!(state(&app, wrong[0]), CaptureState::Ready, "a valid scene makes the capture ready");
    assert_eq!(
        (said(wrong[0]), count_about(&ready, wrong[0])),
        (2, 1),
        "one ready event and no further failure event are sent"
    );
}
