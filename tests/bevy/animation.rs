//! Playback animated by Bevy's animations.
//!
//! In: an `AnimationClip` with curves over fields of a `Playback`. Out: proof that playback follows the curves. Needs
//! neither a GPU nor a window.

use crate::support::event_log::{debug, take_events};
use crate::support::playback_app::{app, capture, change, get, pass};
use bevy::animation::{AnimatedBy, AnimationTargetId, animated_field};
use bevy::prelude::*;
use bevy_gs4d::playback::{Clip, Timeline, TimelinePlayer, TimelineTrack, Track};
use bevy_gs4d::prelude::*;

/// Spawns a capture of four seconds, with its playback animated for two seconds.
fn spawn(app: &mut App, playback: Playback, curve: impl AnimationCurve) -> Entity {
    let capture = capture(app, 4.0, 4);
    animate(app, (GaussianCapture3d(capture), playback), curve)
}

/// Spawns an entity with an animation of two seconds.
fn animate(app: &mut App, bundle: impl Bundle, curve: impl AnimationCurve) -> Entity {
    let target = AnimationTargetId::from_name(&Name::new("capture"));
    let mut clip = AnimationClip::default();
    clip.add_curve_to_target(target, curve);
    let clip = app.world_mut().resource_mut::<Assets<AnimationClip>>().add(clip);
    let (graph, node) = AnimationGraph::from_clip(clip);
    let graph = app.world_mut().resource_mut::<Assets<AnimationGraph>>().add(graph);
    let mut player = AnimationPlayer::default();
    player.play(node);
    let entity = app.world_mut().spawn((bundle, target)).id();
    app.world_mut().entity_mut(entity).insert((AnimatedBy(entity), player, AnimationGraphHandle(graph)));
    // Bevy prepares the animation graph in these updates.
    pass(app, 0.0);
    pass(app, 0.0);
    entity
}

fn ramp(from: f32, to: f32) -> AnimatableKeyframeCurve<f32> {
    AnimatableKeyframeCurve::new([(0.0, from), (2.0, to)]).expect("two samples")
}

#[test]
fn an_animation_can_scrub_a_capture() {
    let mut app = app("assets");
    app.add_plugins(AnimationPlugin);
    let curve = AnimatableCurve::new(animated_field!(Playback::time), ramp(3.0, 1.0));
    let entity = spawn(&mut app, Playback::paused_at(0.0), curve);
    for expected in [2.75, 2.5, 2.25, 2.0] {
        pass(&mut app, 0.25);
        assert_eq!(get::<Playback>(&app, entity).time, expected, "the curve's value, in the same frame");
    }
    change(&mut app, entity, |player: &mut AnimationPlayer| {
        player.pause_all();
    });
    pass(&mut app, 0.25);
    pass(&mut app, 0.25);
    assert_eq!(get::<Playback>(&app, entity).time, 2.0, "playback stands still while the animation is paused");
    let said = take_events(&mut app);
    assert_eq!(said.len(), 5, "one event for the start at 3 s and four for the steps: {said:?}");
    assert!(said.iter().all(|message| message.starts_with("PlaybackSeeked")), "every event is a seek: {said:?}");
}

#[test]
fn an_animation_can_slow_a_capture_down() {
    let mut app = app("assets");
    app.add_plugins(AnimationPlugin);
    let curve = AnimatableCurve::new(animated_field!(Playback::speed), ramp(1.0, 0.0));
    let entity = spawn(&mut app, Playback::default(), curve);
    for _ in 0..64 {
        pass(&mut app, 1.0 / 32.0);
    }
    let playback = get::<Playback>(&app, entity);
    assert!(
        (playback.time - 1.0).abs() < 0.05,
        "a speed from 1 to 0 in two seconds plays one second, not {}",
        playback.time
    );
    assert!(playback.speed < 0.05, "the speed ends near 0, not at {}", playback.speed);
}

#[test]
fn an_animation_can_pause_a_capture() {
    let mut app = app("assets");
    app.add_plugins(AnimationPlugin);
    let keys = [(0.0, true), (1.0, false), (2.0, false)];
    let keys = AnimatableKeyframeCurve::new(keys).expect("three samples");
    let curve = AnimatableCurve::new(animated_field!(Playback::playing), keys);
    let entity = spawn(&mut app, Playback::default(), curve);
    take_events(&mut app);
    for _ in 0..7 {
        pass(&mut app, 0.25);
    }
    assert_eq!(get::<Playback>(&app, entity).time, 1.0, "the capture plays for one second");
    let paused = debug(&PlaybackPaused { entity });
    assert_eq!(take_events(&mut app).iter().filter(|said| **said == paused).count(), 1, "one pause event is sent");
}

#[test]
fn an_animation_can_move_the_out_point() {
    let mut app = app("assets");
    app.add_plugins(AnimationPlugin);
    let curve = AnimatableCurve::new(animated_field!(Playback::end), ramp(3.0, 1.0));
    let entity = spawn(&mut app, Playback::default(), curve);
    for _ in 0..6 {
        pass(&mut app, 0.25);
    }
    assert_eq!(get::<Playback>(&app, entity).time, 1.5, "playback has not reached the moving out point");
    pass(&mut app, 0.25);
    assert_eq!(get::<Playback>(&app, entity).time, 0.25, "playback loops to the start after the out point");
}

#[test]
fn an_animation_can_scrub_a_timeline() {
    let mut app = app("assets");
    app.add_plugins(AnimationPlugin);
    let clip = Clip { capture: capture(&mut app, 4.0, 4), start: 0.0, range: [0.0, 4.0], speed: 1.0, fade: [0.0; 2] };
    let track = Track { name: "left".into(), clips: vec![clip] };
    let timeline = Timeline::new(vec![track], Vec::new(), None).expect("a valid timeline");
    let timeline = app.world_mut().resource_mut::<Assets<Timeline>>().add(timeline);
    let curve = AnimatableCurve::new(animated_field!(Playback::time), ramp(3.0, 1.0));
    let player = animate(&mut app, (TimelinePlayer(timeline), Playback::paused_at(0.0)), curve);
    let mut tracks = app.world_mut().query_filtered::<&Playback, With<TimelineTrack>>();
    let mut before = 3.0;
    for expected in [2.75, 2.5, 2.25, 2.0] {
        pass(&mut app, 0.25);
        assert_eq!(get::<Playback>(&app, player).time, expected, "the curve's value, in the same frame");
        let shown = tracks.single(app.world()).expect("one track").time;
        assert_eq!(shown, before, "the track follows one frame later");
        before = expected;
    }
}
