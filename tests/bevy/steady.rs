//! Captures over many frames: nothing is created without need, and nothing is kept that is no longer needed.
//!
//! In: synthetic captures in headless apps. Out: proof that GPU memory is constant while time advances, that removed
//! captures and cameras leave nothing behind, that views release memory that they no longer need, that captures are
//! replaced without a gap and survive a restart of the renderer, and that a GPU that is too small and an invalid
//! capture are reported. Skipped where there is no GPU.

use crate::support::blob::blob;
use crate::support::cpu_reference::scene;
use crate::support::fixtures::synthetic;
use crate::support::no_gpu::no_gpu;
use crate::support::offscreen_app::{self, app, picture, spawn_camera};
use bevy::asset::AssetId;
use bevy::camera::Hdr;
use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy::render::error_handler::{ErrorType, RenderErrorHandler, RenderErrorPolicy};
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::render_resource::{CachedPipelineState, PipelineCache, PollType};
use bevy::render::renderer::RenderDevice;
use bevy::render::settings::{Backends, RenderCreation, WgpuLimits, WgpuSettings};
use bevy::render::{RenderApp, RenderPlugin, RenderStartup};
use bevy::time::TimeUpdateStrategy;
use bevy_gs4d::asset::{CaptureFailed, CaptureReady, CaptureState, GaussianCapture};
use bevy_gs4d::gaussian::Gaussian;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::render::{CaptureSettings, CaptureStatistics, CaptureUploadBudget, CaptureViewSettings, DepthWrite};
use bevy_gs4d::renderer::{Design, WorkCounters};
use bevy_gs4d::scene::{Environment, RuntimeScene};
use bevy_gs4d::testing::{self, Offscreen};
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugin};
use std::collections::VecDeque;
use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Rows of this width need no padding when they are read back.
const SIZE: UVec2 = UVec2::new(64, 48);
const STEP: Duration = Duration::from_millis(10);

fn settings() -> WgpuSettings {
    let backends = if cfg!(target_os = "linux") { Backends::VULKAN } else { Backends::PRIMARY };
    WgpuSettings { backends: Some(backends), ..default() }
}

/// Returns Gaussians of one color at rest at the origin.
fn heap(count: usize, color: Vec3) -> RuntimeScene {
    let gaussian = Gaussian { covariance: [0.2, 0.0, 0.0, 0.2, 0.0, 0.2], ..blob(Vec3::ZERO, Vec3::ONE, 0.98) };
    scene(&vec![(gaussian, color); count])
}

/// Returns the pose of a camera that sees a synthetic scene.
fn eye() -> Transform {
    Transform::from_xyz(0.5, -3.0, 1.5).looking_at(Vec3::ZERO, Vec3::Z)
}

fn spawn(app: &mut App, scene: RuntimeScene, playback: Playback) -> Entity {
    let handle = app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(GaussianCapture::new(scene));
    app.world_mut().spawn((GaussianCapture3d(handle), playback)).id()
}

/// Spawns two cameras with targets of one size, of which the second writes depth.
fn spawn_eyes(app: &mut App) {
    spawn_camera(app, Msaa::Off, eye());
    let second = Offscreen::new(&mut app.world_mut().resource_mut::<Assets<Image>>(), SIZE);
    let camera = spawn_camera(app, Msaa::Off, eye().with_translation(Vec3::new(-0.5, -3.0, 1.5)));
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
        assert!(app.should_exit().is_none(), "rendering stopped; the log says why");
        finish_drawing(app);
    }
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
}

/// Waits until the GPU has drawn everything and its counters have arrived, so that the number of frames by which they
/// are late does not depend on the load of the machine.
fn finish_drawing(app: &App) {
    let device = app.world().resource::<RenderDevice>().wgpu_device();
    device.poll(PollType::wait_indefinitely()).expect("the GPU finishes its work");
}

/// Collects the failures of captures from now on.
fn failures_of(app: &mut App) -> Arc<Mutex<Vec<CaptureFailed>>> {
    let failures = Arc::new(Mutex::new(Vec::new()));
    let sink = failures.clone();
    app.add_observer(move |failure: On<CaptureFailed>| {
        sink.lock().unwrap_or_else(PoisonError::into_inner).push(failure.event().clone());
    });
    failures
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

/// Returns the bytes of a view's buffers and targets.
fn view_bytes(app: &App, camera: Entity) -> u64 {
    statistics(app).view(camera).map_or(0, |view| view.bytes)
}

fn show(app: &mut App, entity: Entity, visibility: Visibility) {
    app.world_mut().entity_mut(entity).insert(visibility);
}

fn check_pipelines(app: &App) {
    for pipeline in app.sub_app(RenderApp).world().resource::<PipelineCache>().pipelines() {
        if let CachedPipelineState::Err(failure) = &pipeline.state {
            panic!("a pipeline failed: {failure}");
        }
    }
}

#[test]
fn nothing_is_made_while_time_advances_inside_a_segment() {
    let Some(mut app) = app(SIZE) else { return };
    let entity = spawn(&mut app, synthetic(2000, 1, true), Playback::default());
    spawn_eyes(&mut app);
    testing::settle(&mut app).expect("the app draws without an error");
    run(&mut app, 10);
    let before = made(&app);
    assert!(before.0 > 0 && before.1 > 0, "something has been made and uploaded: {before:?}");
    run(&mut app, 30);
    let time = app.world().get::<Playback>(entity).expect("still there").time;
    assert!((0.39..0.5).contains(&time), "time has advanced inside the first segment, to {time}");
    assert_eq!(made(&app), before, "made and uploaded since");
    assert_eq!(statistics(&app).views().len(), 2, "both cameras draw");
    run(&mut app, 60);
    assert_eq!(work(&app).uploaded(), before.1, "another segment needs no upload, either");
}

#[test]
fn nothing_but_lists_is_made_anew_from_segment_to_segment() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, synthetic(2000, 1, true), Playback::default());
    spawn_eyes(&mut app);
    testing::settle(&mut app).expect("the app draws without an error");
    // Twice through all four segments, and into the middle of the first.
    let step = Duration::from_millis(50);
    run_in_steps(&mut app, 2 * 40 + 3, step);
    let (before, lists) = (made(&app), work(&app).activated());
    run_in_steps(&mut app, 2 * 40, step);
    assert_eq!(made(&app), before, "made and uploaded on the way through all segments, twice");
    assert_eq!(work(&app).activated() - lists, 2 * 4, "one list for both eyes in each segment");
}

#[test]
fn a_view_that_sees_nothing_gives_its_memory_back() {
    let Some(mut app) = app(SIZE) else { return };
    let entity = spawn(&mut app, synthetic(2000, 4, true), Playback::paused_at(0.7));
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    let before = picture(&mut app, 0.0);
    assert!(before.pixels().any(|pixel| pixel.0[..3] != [0, 0, 0]), "something shows");
    assert!(view_bytes(&app, camera) > 0, "and takes memory");
    let created = work(&app).created();
    show(&mut app, entity, Visibility::Hidden);
    run(&mut app, 30);
    show(&mut app, entity, Visibility::Inherited);
    run(&mut app, 5);
    assert_eq!(work(&app).created(), created, "what is hidden for a moment keeps what it has");
    show(&mut app, entity, Visibility::Hidden);
    run(&mut app, 130);
    assert_eq!(view_bytes(&app, camera), 0, "what is hidden for longer needs nothing");
    let created = work(&app).created();
    run(&mut app, 130);
    assert_eq!((view_bytes(&app, camera), work(&app).created()), (0, created), "and stays so");
    show(&mut app, entity, Visibility::Inherited);
    assert!(picture(&mut app, 0.0) == before, "it shows again as it was");
    assert!(work(&app).created() > created, "in buffers made anew, for the old ones have gone");
}

#[test]
fn a_camera_that_cannot_draw_captures_gives_its_memory_back() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, synthetic(2000, 4, true), Playback::paused_at(0.7));
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    testing::settle(&mut app).expect("the app draws without an error");
    assert!(view_bytes(&app, camera) > 0, "it draws one, which takes memory");
    app.world_mut().entity_mut(camera).insert((Hdr, CompositingSpace::Oklab));
    run(&mut app, 130);
    assert_eq!(view_bytes(&app, camera), 0, "in a space without captures it needs none");
}

#[test]
fn what_is_faded_out_is_not_drawn() {
    let Some(mut app) = app(SIZE) else { return };
    let entity = spawn(&mut app, synthetic(2000, 4, true), Playback::default());
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    let before = picture(&mut app, 0.0);
    let gaussians = |app: &App| statistics(app).view(camera).map_or(0, |view| view.total);
    assert_eq!(gaussians(&app), 2000, "the camera draws it");
    let set = |app: &mut App, opacity| {
        let settings = CaptureSettings { opacity, ..default() };
        app.world_mut().entity_mut(entity).insert(settings);
    };
    set(&mut app, 0.0);
    run(&mut app, 2);
    assert_eq!(gaussians(&app), 0, "nothing of it would show");
    let lists = work(&app).activated();
    // Through all segments of its filter.
    run_in_steps(&mut app, 20, Duration::from_millis(100));
    assert_eq!(work(&app).activated(), lists, "nor is it prepared to be drawn");
    run(&mut app, 130);
    assert_eq!(view_bytes(&app, camera), 0, "and in the end the camera needs no memory");
    app.world_mut().entity_mut(entity).insert(Playback::paused_at(0.0));
    set(&mut app, 1.0);
    assert!(picture(&mut app, 0.0) == before, "faded in it shows as before");
}

#[test]
fn a_view_shrinks_when_a_large_capture_has_gone() {
    let Some(mut app) = app(SIZE) else { return };
    let large = spawn(&mut app, synthetic(100_000, 5, false), Playback::paused_at(0.7));
    spawn(&mut app, heap(1, Vec3::X), Playback::paused_at(0.7));
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    testing::settle(&mut app).expect("the app draws without an error");
    let (before, created) = (view_bytes(&app, camera), work(&app).created());
    assert!(app.world_mut().despawn(large), "it was there");
    run(&mut app, 60);
    assert_eq!(view_bytes(&app, camera), before, "it might come back soon");
    assert_eq!(work(&app).created(), created, "so nothing is made for what is left");
    run(&mut app, 140);
    let after = view_bytes(&app, camera);
    assert!(0 < after && 4 * after < before, "then {after} bytes are enough, not {before}");
    let created = work(&app).created();
    let picture = picture(&mut app, 0.0);
    let [r, g, b, _] = picture.get_pixel(SIZE.x / 2, SIZE.y / 2).0;
    assert!(r > 200 && g < 60 && b < 60, "the small one shows all the while: {r}, {g}, {b}");
    assert_eq!(work(&app).created(), created, "and all stands still again");
}

#[test]
fn cameras_come_and_go_without_a_trace() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, synthetic(500, 6, true), Playback::paused_at(0.7));
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    let before = picture(&mut app, 0.0);
    let other = Offscreen::new(&mut app.world_mut().resource_mut::<Assets<Image>>(), SIZE);
    let seeing = |app: &App| statistics(app).views().iter().map(|(camera, _)| *camera).collect::<Vec<_>>();
    for round in 0..20 {
        let msaa = if round % 2 == 0 { Msaa::Off } else { Msaa::Sample4 };
        let passing = spawn_camera(&mut app, msaa, eye());
        app.world_mut().entity_mut(passing).insert(other.target());
        run(&mut app, 2);
        let both = seeing(&app);
        assert!(both.len() == 2 && both.contains(&passing), "round {round}: both cameras draw, not {both:?}");
        assert!(app.world_mut().despawn(passing), "it is still there");
        run(&mut app, 2);
        assert_eq!(seeing(&app), [camera], "round {round}: one is left");
    }
    assert!(picture(&mut app, 0.0) == before, "which sees what it saw");
    check_pipelines(&app);
}

#[test]
fn captures_come_and_go_without_a_trace() {
    let Some(mut app) = app(SIZE) else { return };
    spawn_camera(&mut app, Msaa::Off, eye());
    testing::settle(&mut app).expect("the app draws without an error");
    let statistics = statistics(&app);
    let mut living = VecDeque::new();
    for frame in 0..300 {
        if frame < 100 && frame % 10 == 0 {
            let scene = synthetic(50_000, frame, frame % 20 == 0);
            living.push_back(spawn(&mut app, scene, Playback::default()));
        }
        // Each is visible for some frames, then all are.
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
            assert!(app.world_mut().despawn(oldest), "it is still there");
        }
        run(&mut app, 1);
        if frame == 2 || frame == 106 {
            let count = if frame == 2 { 1 } else { 10 };
            assert_eq!(statistics.uploaded_captures(), count, "captures on the GPU in frame {frame}");
            let bytes = statistics.capture_bytes();
            assert!(bytes >= count as u64 * 50_000 * 64, "{count} captures of 64 bytes a Gaussian, not {bytes}");
            let total: u32 = statistics.views().iter().map(|(_, view)| view.total).sum();
            assert_eq!(total, count as u32 * 50_000, "Gaussians drawn in frame {frame}");
        }
    }
    assert!(living.is_empty(), "all have gone");
    run(&mut app, 5);
    assert_eq!((statistics.uploaded_captures(), statistics.capture_bytes()), (0, 0), "and their memory, too");
    assert!(statistics.views().is_empty(), "nothing is drawn");
    assert_eq!(app.world().resource::<Assets<GaussianCapture>>().len(), 0, "no asset is left");
    check_pipelines(&app);
}

/// Puts another scene in the place of an entity's.
fn replace(app: &mut App, entity: Entity, scene: RuntimeScene) {
    let id: AssetId<GaussianCapture> = app.world().get::<GaussianCapture3d>(entity).expect("still there").into();
    let mut captures = app.world_mut().resource_mut::<Assets<GaussianCapture>>();
    captures.insert(id, GaussianCapture::new(scene)).expect("its handle is alive");
}

/// Returns the messages of one kind about captures from now on, as texts.
fn messages_of<E: EntityEvent + Debug>(app: &mut App) -> Arc<Mutex<Vec<String>>> {
    let messages = Arc::new(Mutex::new(Vec::new()));
    let sink = messages.clone();
    app.add_observer(move |event: On<E>| {
        sink.lock().unwrap_or_else(PoisonError::into_inner).push(format!("{:?}", event.event()));
    });
    messages
}

/// Returns the number of those messages about an entity.
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
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    testing::settle(&mut app).expect("the app draws without an error");
    app.insert_resource(CaptureUploadBudget { bytes_per_frame: BUDGET });
    let ready = messages_of::<CaptureReady>(&mut app);
    let entity = spawn(&mut app, synthetic(5000, 9, true), Playback::paused_at(0.7));
    let mut frames = 0;
    while statistics(&app).uploaded_captures() == 0 {
        assert_eq!(statistics(&app).view(camera), None, "nothing is drawn of a part");
        assert_eq!(statistics(&app).uploading_captures(), usize::from(frames > 0), "it is on its way");
        assert_eq!((state(&app, entity), count_about(&ready, entity)), (CaptureState::Loading, 0), "nor is it ready");
        let before = work(&app).uploaded();
        run(&mut app, 1);
        let bytes = work(&app).uploaded() - before;
        assert!(bytes <= BUDGET, "{bytes} bytes in frame {frames}");
        frames += 1;
        assert!(frames < 100, "it is whole at last");
    }
    let bytes = statistics(&app).capture_bytes();
    assert_eq!(work(&app).uploaded(), bytes, "all of it, once");
    assert!(bytes.div_ceil(BUDGET) <= frames, "{bytes} bytes take more than {frames} frames");
    run(&mut app, 2);
    assert_eq!((state(&app, entity), count_about(&ready, entity)), (CaptureState::Ready, 1), "now it is, said once");
    let pieces = picture(&mut app, 0.0);
    app.insert_resource(CaptureUploadBudget::default());
    app.sub_app_mut(RenderApp).world_mut().run_schedule(RenderStartup);
    assert!(picture(&mut app, 0.0) == pieces, "uploaded at once it is the same");
}

#[test]
fn a_capture_plays_from_its_first_picture_on() {
    let Some(mut app) = app(SIZE) else { return };
    spawn_camera(&mut app, Msaa::Off, eye());
    testing::settle(&mut app).expect("the app draws without an error");
    app.insert_resource(CaptureUploadBudget { bytes_per_frame: 64 << 10 });
    let entity = spawn(&mut app, synthetic(5000, 9, true), Playback::default());
    let time = |app: &App| app.world().get::<Playback>(entity).expect("still there").time;
    let mut frames = 0;
    while statistics(&app).uploaded_captures() == 0 {
        assert_eq!(time(&app), 0.0, "in frame {frames} it is not drawn yet");
        run(&mut app, 1);
        frames += 1;
        assert!(frames < 100, "it is whole at last");
    }
    assert!(frames > 2, "{frames} frames are too few to prove anything");
    // With pipelined rendering, the next update has begun.
    assert!(time(&app) <= STEP.as_secs_f32(), "its first picture is that of its start, not of {}", time(&app));
    run(&mut app, 10);
    let played = time(&app) / STEP.as_secs_f32();
    assert!((9.5..11.5).contains(&played), "then it plays: {played} steps");
}

#[test]
fn what_the_gpu_refuses_leaves_what_was_drawn_before() {
    let Some(mut app) = app(SIZE) else { return };
    let entity = spawn(&mut app, heap(1, Vec3::X), Playback::paused_at(0.0));
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    let before = picture(&mut app, 0.0);
    let messages = (messages_of::<CaptureReady>(&mut app), messages_of::<CaptureFailed>(&mut app));
    let said = || (count_about(&messages.0, entity), count_about(&messages.1, entity));
    let map = Environment { width: 8, height: 4, texels: vec![0.5; 10] };
    replace(&mut app, entity, RuntimeScene { environment: Some(map), ..heap(1, Vec3::Z) });
    assert!(picture(&mut app, 0.0) == before, "the old one is still drawn");
    assert_eq!((state(&app, entity), said()), (CaptureState::Ready, (0, 1)), "and the failure is said, once");
    assert_eq!(statistics(&app).view(camera).map(|view| view.total), Some(1), "one Gaussian is drawn");
    replace(&mut app, entity, heap(1, Vec3::Z));
    let after = picture(&mut app, 0.0);
    let [r, _, b, _] = after.get_pixel(SIZE.x / 2, SIZE.y / 2).0;
    assert!(b > 200 && r < 60, "what is right replaces it: {r}, {b}");
    assert_eq!((state(&app, entity), said()), (CaptureState::Ready, (1, 1)), "which is said, too");
}

#[test]
fn another_scene_under_the_same_name_shows_without_a_gap() {
    let Some(mut app) = app(SIZE) else { return };
    let entity = spawn(&mut app, heap(1, Vec3::X), Playback::paused_at(0.0));
    spawn_camera(&mut app, Msaa::Off, eye());
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
    // Some eight frames for the other scene.
    app.insert_resource(CaptureUploadBudget { bytes_per_frame: 8 << 10 });
    replace(&mut app, entity, heap(700, Vec3::Z));
    run(&mut app, 24);
    let seen = seen.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let [red, blue]: [fn(&[u8; 3]) -> bool; 2] = [|p| p[0] > 200 && p[2] < 60, |p| p[2] > 200 && p[0] < 60];
    let changed = seen.iter().position(blue).expect("the other scene shows in the end");
    assert!(changed > 7 && seen[..changed].iter().all(red), "the first one until it is whole: {seen:?}");
    assert!(seen[changed..].iter().all(blue), "the other one from then on: {seen:?}");
}

/// Collects the app's picture, frame by frame, from now on.
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
fn no_frame_after_a_cut_lacks_splats() {
    for design in [Design::Reference, Design::Fast] {
        // Rows of this width need no padding.
        let Some(mut app) = app(UVec2::new(384, 288)) else { return };
        let mut scene = synthetic(3000, 2, false);
        // Large and so faint that the farthest shows, too.
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
        assert!(pairs > 1 << 16, "{design:?}: {pairs} pairs are more than there is room for at first");
        let frames = frames.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let (before, after) = (frames.first().expect("a frame"), frames.last().expect("a frame"));
        let cut = frames.iter().position(|frame| frame != before).expect("the cut is seen");
        assert!(frames.len() - cut > 4, "{design:?}: frames after the cut, of {}", frames.len());
        for (number, frame) in frames[cut..].iter().enumerate() {
            let apart = frame.iter().zip(after).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(
                apart <= Some(1),
                "{design:?}: frame {number} after the cut is {apart:?} of 255 apart from the last"
            );
        }
    }
}

#[test]
fn a_new_start_of_the_renderer_makes_everything_again() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, synthetic(2000, 3, true), Playback::paused_at(0.7));
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    let depth = CaptureViewSettings { depth: DepthWrite::Expected, ..default() };
    app.world_mut().entity_mut(camera).insert(depth);
    let before = picture(&mut app, 0.0);
    assert!(before.pixels().any(|pixel| pixel.0[..3] != [0, 0, 0]), "something shows");
    let (created, uploaded) = made(&app);
    // Bevy does this once it has another device.
    app.sub_app_mut(RenderApp).world_mut().run_schedule(RenderStartup);
    let after = picture(&mut app, 0.0);
    assert!(work(&app).uploaded() > uploaded, "the capture has been uploaded again");
    assert!(work(&app).created() > created, "and working buffers made");
    assert!(before == after, "to the same picture");
    assert_eq!(statistics(&app).renderer_missing(), None, "nothing is missing");
    assert_eq!(statistics(&app).uploaded_captures(), 1, "nor is anything there twice");
    check_pipelines(&app);
}

#[test]
fn captures_come_back_after_a_lost_device() {
    if !testing::has_gpu() {
        return no_gpu();
    }
    // Bevy's lit meshes read a buffer of the lost device back and panic.
    let mut app = testing::app_with(SIZE, |plugins| plugins.disable::<PbrPlugin>());
    app.add_plugins(GaussianCapturePlugin).insert_resource(ClearColor(Color::BLACK));
    app.insert_resource(RenderErrorHandler(|error, _, _| match error.ty {
        ErrorType::DeviceLost => RenderErrorPolicy::Recover(RenderCreation::Automatic(Box::new(settings()))),
        // Errors of work that was under way when it was lost.
        _ => RenderErrorPolicy::Ignore,
    }));
    spawn(&mut app, synthetic(2000, 3, true), Playback::paused_at(0.7));
    spawn_camera(&mut app, Msaa::Off, eye());
    let before = picture(&mut app, 0.0);
    assert!(before.pixels().any(|pixel| pixel.0[..3] != [0, 0, 0]), "something shows");
    // Until Bevy's own read-backs have ended: they do not outlive a device.
    for _ in 0..10 {
        app.update();
    }
    let lost = app.sub_app(RenderApp).world().resource::<RenderDevice>().wgpu_device().clone();
    let uploaded = work(&app).uploaded();
    lost.destroy();
    // Lets Bevy notice it.
    lost.poll(PollType::wait_indefinitely()).expect("all work has been done");
    let start = Instant::now();
    while work(&app).uploaded() == uploaded {
        assert!(start.elapsed() < Duration::from_secs(60), "the capture is uploaded to another device in time");
        app.update();
    }
    let after = picture(&mut app, 0.0);
    assert!(before == after, "it shows as before");
    check_pipelines(&app);
}

#[test]
fn a_gpu_that_is_too_small_says_so_and_the_game_goes_on() {
    let Some(mut large) = app(SIZE) else { return };
    testing::settle(&mut large).expect("the app draws without an error");
    let limits = large.sub_app(RenderApp).world().resource::<RenderDevice>().limits();
    drop(large);
    // Enough for Bevy.
    let limits = WgpuLimits { max_compute_workgroup_storage_size: 8192, ..limits };
    let settings = WgpuSettings { constrained_limits: Some(limits), ..settings() };
    let mut app = testing::app_with(SIZE, |plugins| {
        plugins.set(RenderPlugin {
            render_creation: RenderCreation::Automatic(Box::new(settings)),
            synchronous_pipeline_compilation: true,
            ..default()
        })
    });
    app.add_plugins(GaussianCapturePlugin).insert_resource(ClearColor(Color::BLACK));
    let entity = spawn(&mut app, heap(1, Vec3::X), Playback::default());
    spawn_camera(&mut app, Msaa::Off, eye());
    let failures = failures_of(&mut app);
    let picture = picture(&mut app, 0.25);
    assert!(picture.pixels().all(|pixel| pixel.0[..3] == [0, 0, 0]), "no capture is drawn");
    let why = statistics(&app).renderer_missing().expect("a reason");
    assert!(why.contains("max_compute_workgroup_storage_size"), "it names the limit: {why}");
    assert_eq!(statistics(&app).uploaded_captures(), 0, "and nothing is uploaded for nothing");
    let time = app.world().get::<Playback>(entity).expect("still there").time;
    assert_eq!(time, 0.25, "captures play all the same");
    let state = app.world().get::<CaptureState>(entity).expect("a required component");
    assert!(matches!(state, CaptureState::Failed(said) if said.contains(&why)), "its entity has failed: {state:?}");
    let failures = failures.lock().unwrap_or_else(PoisonError::into_inner);
    assert!(matches!(&failures[..], [said] if said.entity == entity), "which is said once: {failures:?}");
}

#[test]
fn a_capture_that_contradicts_itself_is_refused() {
    let Some(mut app) = app(SIZE) else { return };
    let failures = failures_of(&mut app);
    let ready = messages_of::<CaptureReady>(&mut app);
    // The filter of a smaller scene, and a map with too few texels.
    let filtered = RuntimeScene { filter: synthetic(90, 7, true).filter, ..synthetic(100, 7, false) };
    let map = Environment { width: 8, height: 4, texels: vec![0.5; 10] };
    let mapped = RuntimeScene { environment: Some(map), ..heap(1, Vec3::Z) };
    let wrong = [filtered.clone(), mapped].map(|scene| spawn(&mut app, scene, Playback::paused_at(0.0)));
    spawn(&mut app, heap(1, Vec3::X), Playback::paused_at(0.0));
    spawn_camera(&mut app, Msaa::Off, eye());
    let picture = picture(&mut app, 0.0);
    let [r, g, b, _] = picture.get_pixel(SIZE.x / 2, SIZE.y / 2).0;
    assert!(r > 200 && g < 60 && b < 60, "the one that is right shows: {r}, {g}, {b}");
    assert_eq!(statistics(&app).uploaded_captures(), 1, "and it alone is uploaded");
    let said =
        |entity| failures.lock().unwrap_or_else(PoisonError::into_inner).iter().filter(|f| f.entity == entity).count();
    for entity in wrong {
        let state = app.world().get::<CaptureState>(entity).expect("a required component");
        assert!(matches!(state, CaptureState::Failed(_)), "the wrong ones have failed: {state:?}");
        assert_eq!(said(entity), 1, "and that is said");
        assert_eq!(count_about(&ready, entity), 0, "but never that they are ready");
    }
    replace(&mut app, wrong[0], filtered);
    offscreen_app::picture(&mut app, 0.0);
    assert_eq!(said(wrong[0]), 2, "a second attempt that fails alike is said, too");
    replace(&mut app, wrong[0], heap(1, Vec3::Z));
    offscreen_app::picture(&mut app, 0.0);
    assert_eq!(state(&app, wrong[0]), CaptureState::Ready, "and one that succeeds makes it ready");
    assert_eq!((said(wrong[0]), count_about(&ready, wrong[0])), (2, 1), "without another word of failure");
}
