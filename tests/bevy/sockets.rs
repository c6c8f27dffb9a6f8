//! Sockets in Bevy apps: entities that follow named points of captures.
//!
//! In: captures of two seconds with a socket whose track covers the first half. Out: proof that children of a capture
//! have the transform of the socket at the time that is drawn, in the world too, and that their state and the log tell
//! where they do not. Needs neither a GPU nor a window.

use crate::support::logged::warnings_of;
use crate::support::playback_app::{app, change, get, pass, scene};
use bevy::app::AnimationSystems;
use bevy::ecs::schedule::SingleThreadedExecutor;
use bevy::prelude::*;
use bevy_gs4d::playback::SocketState;
use bevy_gs4d::prelude::*;
use bevy_gs4d::scene::{GaussianScene, Socket, SocketSample};
use std::f32::consts::FRAC_PI_2;

/// Adds a capture of two seconds, with the interval 0 to 1 and a socket `hand`: from x = 0 to x = 1 in the first second,
/// with a quarter of a turn about z.
fn capture(app: &mut App) -> Handle<GaussianCapture> {
    let sample = |time: f32, x: f32, angle: f32| {
        let rotation = Quat::from_rotation_z(angle).to_array();
        SocketSample { time, position: [x, 0.0, 0.5], rotation, error: 0.25 }
    };
    let samples = vec![sample(0.0, 0.0, 0.0), sample(0.5, 1.0, FRAC_PI_2)];
    let sockets = vec![Socket { name: "hand".into(), samples }];
    let scene = GaussianScene { sockets, ..scene(2.0, 4) }.into_runtime().expect("a synthetic scene can be drawn");
    app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(GaussianCapture::new(scene))
}

/// Spawns a paused capture, and a child of it with a socket. Returns both.
fn spawn(app: &mut App, bundle: impl Bundle, socket: impl Bundle) -> [Entity; 2] {
    let handle = capture(app);
    let player = app.world_mut().spawn((GaussianCapture3d(handle), Playback::paused_at(0.0), bundle)).id();
    let child = app.world_mut().spawn((socket, ChildOf(player))).id();
    [player, child]
}

fn seek(app: &mut App, player: Entity, seconds: f32) {
    change(app, player, |playback: &mut Playback| playback.seek(seconds));
    pass(app, 0.0);
}

#[test]
fn a_child_has_the_transform_of_the_socket_at_the_time_that_is_drawn() {
    let mut app = app("assets");
    app.add_plugins(TransformPlugin);
    let scaled = Transform::from_scale(Vec3::splat(3.0));
    let [player, hand] =
        spawn(&mut app, (Upright, Transform::from_xyz(0.0, 0.0, -2.0)), (CaptureSocket::new("hand"), scaled));
    pass(&mut app, 0.0);
    let placed = get::<Transform>(&app, hand);
    assert_eq!((placed.translation, placed.scale), (Vec3::Z * 0.5, Vec3::splat(3.0)), "the start, with its own scale");
    assert_eq!(get::<SocketState>(&app, hand), SocketState::Tracked { error: 0.25 }, "followed");
    seek(&mut app, player, 0.5);
    let placed = get::<Transform>(&app, hand);
    assert!(placed.translation.abs_diff_eq(Vec3::new(0.5, 0.0, 0.5), 1e-5), "half way: {placed:?}");
    let turned = placed.rotation.angle_between(Quat::from_rotation_z(FRAC_PI_2 / 2.0));
    assert!(turned < 5e-3, "half of the turn: {placed:?}");
    let world = get::<GlobalTransform>(&app, hand).translation();
    assert!(world.abs_diff_eq(Vec3::new(0.5, 0.5, -2.0), 1e-5), "+z of the capture is up in the world: {world}");
}

#[test]
fn a_time_that_an_animation_sets_is_followed_in_the_same_frame() {
    let mut app = app("assets");
    let [_, hand] = spawn(&mut app, (), CaptureSocket::new("hand"));
    let animate = |mut playback: Single<&mut Playback>| playback.time = 0.75;
    app.add_systems(PostUpdate, animate.in_set(AnimationSystems));
    pass(&mut app, 0.0);
    let x = get::<Transform>(&app, hand).translation.x;
    assert!((x - 0.75).abs() < 1e-5, "the time that is drawn: {x}");
}

#[test]
fn a_lost_socket_keeps_the_last_transform_until_it_is_found_again() {
    let mut app = app("assets");
    let [player, hand] = spawn(&mut app, (), CaptureSocket::new("hand"));
    seek(&mut app, player, 0.5);
    let last = get::<Transform>(&app, hand);
    seek(&mut app, player, 1.5);
    assert_eq!(get::<SocketState>(&app, hand), SocketState::Lost, "the track ends at a second");
    assert_eq!(get::<Transform>(&app, hand), last, "the last transform");
    seek(&mut app, player, 1.0);
    assert_eq!(get::<SocketState>(&app, hand), SocketState::Tracked { error: 0.25 }, "found at the end of the track");
    assert!((get::<Transform>(&app, hand).translation.x - 1.0).abs() < 1e-5, "at its end");
}

#[test]
fn a_socket_that_does_not_exist_is_missing_and_named_once() {
    let mut app = app("assets");
    let own = Transform::from_xyz(1.0, 2.0, 3.0);
    let [player, foot] = spawn(&mut app, (), (CaptureSocket::new("foot"), own));
    let stray = app.world_mut().spawn(CaptureSocket::new("stray")).id();
    // On this thread, of which the log is read.
    app.edit_schedule(PostUpdate, |schedule| {
        schedule.set_executor(SingleThreadedExecutor::new());
    });
    let said = warnings_of(|| (0..3).for_each(|_| pass(&mut app, 0.0)));
    for entity in [foot, stray] {
        assert_eq!(get::<SocketState>(&app, entity), SocketState::Missing, "{entity} follows nothing");
    }
    assert_eq!(get::<Transform>(&app, foot), own, "it stays where it is");
    for name in ["foot", "stray"] {
        let naming: Vec<_> = said.iter().filter(|text| text.contains(&format!("{name:?}"))).collect();
        assert_eq!(naming.len(), 1, "one warning names {name}: {said:?}");
    }
    app.world_mut().entity_mut(stray).insert(ChildOf(player));
    let said = warnings_of(|| (0..3).for_each(|_| pass(&mut app, 0.0)));
    let naming: Vec<_> = said.iter().filter(|text| text.contains("\"stray\"")).collect();
    assert!(matches!(naming[..], [text] if text.contains("`gs4d info`")), "the capture has no such socket: {said:?}");
    app.world_mut().entity_mut(foot).insert(CaptureSocket::new("hand"));
    pass(&mut app, 0.0);
    assert_eq!(get::<SocketState>(&app, foot), SocketState::Tracked { error: 0.25 }, "a name that exists is followed");
}

#[test]
fn a_socket_of_a_capture_that_is_not_loaded_waits() {
    let mut app = app("assets");
    let reserved = app.world().resource::<Assets<GaussianCapture>>().reserve_handle();
    let player = app.world_mut().spawn(GaussianCapture3d(reserved)).id();
    let hand = app.world_mut().spawn((CaptureSocket::new("hand"), ChildOf(player))).id();
    app.edit_schedule(PostUpdate, |schedule| {
        schedule.set_executor(SingleThreadedExecutor::new());
    });
    let said = warnings_of(|| pass(&mut app, 0.0));
    assert_eq!(get::<SocketState>(&app, hand), SocketState::Waiting, "it waits");
    assert!(!said.iter().any(|text| text.contains("CaptureSocket")), "without a warning: {said:?}");
}
