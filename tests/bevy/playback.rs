//! Playback in Bevy apps: events, shared clocks, the game's time, and entities in components.
//!
//! In: captures of two seconds with key-frames every half second. Out: proof that times are right and that every change
//! sends its event. Needs neither a GPU nor a window.

use crate::support::event_log::{debug, take_events};
use crate::support::playback_app::{app, capture, change, get, pass};
use bevy::prelude::*;
use bevy_gs4d::playback::{ClockSource, FollowsClock, MarkerReached, Markers, Repeat, SegmentBoundCrossed};
use bevy_gs4d::prelude::*;
use std::any::TypeId;

/// Spawns a capture of two seconds with five key-frames.
fn spawn(app: &mut App, bundle: impl Bundle) -> Entity {
    let handle = capture(app, 2.0, 4);
    app.world_mut().spawn((GaussianCapture3d(handle), bundle)).id()
}

fn time(app: &App, entity: Entity) -> f32 {
    get::<Playback>(app, entity).time
}

fn crossed(entity: Entity, indices: &[u32]) -> Vec<String> {
    indices.iter().map(|&index| debug(&SegmentBoundCrossed { entity, index, time: index as f32 / 2.0 })).collect()
}

#[test]
fn every_change_of_playback_sends_one_event() {
    let mut app = app("assets");
    let entity = spawn(&mut app, Playback { repeat: Repeat::Once, ..default() });
    pass(&mut app, 0.0);
    assert_eq!(take_events(&mut app), [debug(&PlaybackStarted { entity })], "playback starts");
    pass(&mut app, 0.75);
    assert_eq!(take_events(&mut app), crossed(entity, &[0, 1]), "the key-frames at the start and on the way");
    change(&mut app, entity, Playback::pause);
    pass(&mut app, 0.75);
    assert_eq!(take_events(&mut app), [debug(&PlaybackPaused { entity })], "playback pauses");
    change(&mut app, entity, |playback: &mut Playback| playback.seek(1.25));
    pass(&mut app, 0.75);
    assert_eq!(
        take_events(&mut app),
        [debug(&PlaybackSeeked { entity, from: 0.75, to: 1.25 })],
        "a seek sends no key-frames between"
    );
    change(&mut app, entity, Playback::play);
    pass(&mut app, 0.5);
    let started = debug(&PlaybackStarted { entity });
    assert_eq!(
        take_events(&mut app),
        [vec![started], crossed(entity, &[3])].concat(),
        "playback continues from the new time"
    );
    pass(&mut app, 9.0);
    let ended = debug(&PlaybackEnded { entity });
    assert_eq!(take_events(&mut app), [crossed(entity, &[4]), vec![ended]].concat(), "playback reaches the end");
    pass(&mut app, 9.0);
    assert_eq!(take_events(&mut app), [""; 0], "no event after the end");
    change(&mut app, entity, Playback::play);
    pass(&mut app, 0.25);
    let again = [debug(&PlaybackSeeked { entity, from: 2.0, to: 0.0 }), debug(&PlaybackStarted { entity })].to_vec();
    assert_eq!(take_events(&mut app), [again, crossed(entity, &[0])].concat(), "playing at the end starts over");
    change(&mut app, entity, |playback: &mut Playback| playback.seek(99.0));
    pass(&mut app, 0.0);
    let seeked = debug(&PlaybackSeeked { entity, from: 0.25, to: 2.0 });
    assert_eq!(take_events(&mut app), [seeked], "the seek event has the clamped time");
    assert_eq!(time(&app, entity), 2.0, "the seek is clamped to the end");
}

#[test]
fn loops_and_turns_send_events() {
    let mut app = app("assets");
    let looped = spawn(&mut app, Playback { time: 1.75, ..default() });
    pass(&mut app, 0.5);
    let turn = |entity, turns| vec![debug(&PlaybackLooped { entity, turns })];
    let begun = |entity| vec![debug(&PlaybackStarted { entity })];
    let expected = [begun(looped), crossed(looped, &[4, 0]), turn(looped, 1)].concat();
    assert_eq!(take_events(&mut app), expected, "a loop crosses the key-frames at its end and start");
    pass(&mut app, 6.0);
    assert_eq!(take_events(&mut app).last(), turn(looped, 3).last(), "three loops in one update are one event");
    app.world_mut().despawn(looped);

    let to_and_fro = spawn(&mut app, Playback { time: 1.75, repeat: Repeat::PingPong, ..default() });
    pass(&mut app, 0.75);
    let expected = [begun(to_and_fro), crossed(to_and_fro, &[4, 3]), turn(to_and_fro, 1)].concat();
    assert_eq!(take_events(&mut app), expected, "a turn crosses the key-frame at the end once");
    app.world_mut().despawn(to_and_fro);

    let back = spawn(&mut app, Playback { time: 0.25, speed: -1.0, ..default() });
    pass(&mut app, 0.75);
    let expected = [begun(back), crossed(back, &[0, 4, 3]), turn(back, 1)].concat();
    assert_eq!(take_events(&mut app), expected, "events of reverse playback are in order of play");
}

#[test]
fn one_entity_can_be_observed() {
    #[derive(Resource, Default)]
    struct Ends(u32);

    let mut app = app("assets");
    app.init_resource::<Ends>();
    let [first, second] = [1.0, 1.5].map(|time| spawn(&mut app, Playback { time, repeat: Repeat::Once, ..default() }));
    app.world_mut().entity_mut(first).observe(|_: On<PlaybackEnded>, mut ends: ResMut<Ends>| ends.0 += 1);
    pass(&mut app, 0.75);
    assert!(!get::<Playback>(&app, second).playing, "the second capture has ended");
    assert_eq!(app.world().resource::<Ends>().0, 0, "the observer of the first capture is not called");
    pass(&mut app, 0.75);
    assert_eq!(app.world().resource::<Ends>().0, 1, "the observer is called at the first capture's end");
}

#[test]
fn the_virtual_clock_pauses_and_scales_playback() {
    let mut app = app("assets");
    let entity = spawn(&mut app, Playback::default());
    app.world_mut().resource_mut::<Time<Virtual>>().set_relative_speed(0.5);
    pass(&mut app, 1.0);
    assert_eq!(time(&app, entity), 0.5, "the virtual clock halves the speed");
    app.world_mut().resource_mut::<Time<Virtual>>().pause();
    pass(&mut app, 1.0);
    assert_eq!(time(&app, entity), 0.5, "playback stands still while the virtual clock is paused");
    app.world_mut().resource_mut::<Time<Virtual>>().unpause();
    pass(&mut app, 1.0);
    assert_eq!(time(&app, entity), 1.0, "playback continues");
    assert!(get::<Playback>(&app, entity).playing, "the component itself is not paused");
}

#[test]
fn a_capture_that_is_not_loaded_waits() {
    let mut app = app("assets");
    let entity = app.world_mut().spawn(GaussianCapture3d(Handle::default())).id();
    pass(&mut app, 1.0);
    assert_eq!((time(&app, entity), take_events(&mut app)), (0.0, Vec::new()), "an unloaded capture does not start");
    let handle = capture(&mut app, 2.0, 4);
    app.world_mut().entity_mut(entity).insert(GaussianCapture3d(handle));
    pass(&mut app, 0.25);
    assert_eq!(time(&app, entity), 0.25, "playback starts once the capture is loaded");
}

#[test]
fn paused_playback_is_not_marked_as_changed() {
    #[derive(Resource, Default)]
    struct Changes(usize);

    let mut app = app("assets");
    let entity = spawn(&mut app, Playback::paused_at(0.5));
    let stopped = PlaybackClock { running: false, ..default() };
    app.world_mut().spawn(stopped);
    app.init_resource::<Changes>();
    app.add_systems(
        Last,
        |playbacks: Query<&Playback, Changed<Playback>>,
         clocks: Query<&PlaybackClock, Changed<PlaybackClock>>,
         mut changes: ResMut<Changes>| {
            changes.0 = playbacks.iter().count() + clocks.iter().count();
        },
    );
    pass(&mut app, 0.25);
    pass(&mut app, 0.25);
    assert_eq!(app.world().resource::<Changes>().0, 0, "no component is marked as changed");
    change(&mut app, entity, Playback::play);
    pass(&mut app, 0.25);
    assert_eq!(app.world().resource::<Changes>().0, 1, "a playing capture is marked as changed");
}

#[test]
fn followers_of_a_clock_never_drift_apart() {
    let mut app = app("assets");
    let clock = app.world_mut().spawn(PlaybackClock::default()).id();
    let follow =
        |app: &mut App, speed, offset| spawn(app, (Playback { speed, offset, ..default() }, FollowsClock(clock)));
    let first = follow(&mut app, 1.0, 0.0);
    let ahead = follow(&mut app, 1.0, 0.5);
    let back = follow(&mut app, -1.0, 0.0);
    for step in 0..200 {
        pass(&mut app, 0.001 * f64::from(step % 37));
    }
    let late = follow(&mut app, 1.0, 0.0);
    pass(&mut app, 0.1);
    let shown = get::<PlaybackClock>(&app, clock).seconds;
    let expected = |seconds: f64| seconds.rem_euclid(2.0) as f32;
    assert_eq!(time(&app, first), time(&app, late), "followers have the same time, whenever they were spawned");
    assert!((time(&app, first) - expected(shown)).abs() < 1e-6, "the first follower has the clock's time");
    assert!(
        (time(&app, ahead) - expected(shown + 0.5)).abs() < 1e-6,
        "a follower with an offset is half a second ahead"
    );
    assert!(
        (time(&app, back) - expected(-shown)).abs() < 1e-6,
        "a follower with a negative speed plays backwards from the end"
    );
}

#[test]
fn a_manual_clock_moves_its_followers() {
    let mut app = app("assets");
    let clock = app.world_mut().spawn(PlaybackClock::manual()).id();
    let entity = spawn(&mut app, FollowsClock(clock));
    pass(&mut app, 5.0);
    assert_eq!(time(&app, entity), 0.0, "the game's time does not move a manual clock");
    take_events(&mut app);
    change(&mut app, clock, |clock: &mut PlaybackClock| clock.set(1.25));
    pass(&mut app, 5.0);
    assert_eq!(
        (time(&app, entity), take_events(&mut app)),
        (1.25, crossed(entity, &[0, 1, 2])),
        "setting the clock plays the interval"
    );
    change(&mut app, clock, |clock: &mut PlaybackClock| clock.set(0.75));
    pass(&mut app, 0.0);
    assert_eq!(
        (time(&app, entity), take_events(&mut app)),
        (0.75, crossed(entity, &[2])),
        "setting the clock back plays backwards"
    );
    change(&mut app, clock, |clock: &mut PlaybackClock| clock.seek(1.75));
    pass(&mut app, 0.0);
    let seeked = vec![debug(&PlaybackSeeked { entity, from: 0.75, to: 1.75 })];
    assert_eq!(
        (time(&app, entity), take_events(&mut app)),
        (1.75, seeked),
        "a seek of the clock is a seek of the follower"
    );
    app.world_mut().despawn(clock);
    pass(&mut app, 5.0);
    assert_eq!(
        (time(&app, entity), take_events(&mut app)),
        (1.75, Vec::new()),
        "a follower stands still without its clock"
    );
    app.world_mut().entity_mut(entity).remove::<FollowsClock>();
    pass(&mut app, 0.125);
    assert_eq!(time(&app, entity), 1.875, "playback continues without FollowsClock");
}

#[test]
fn a_clock_of_the_game_can_be_stopped_and_reversed() {
    let mut app = app("assets");
    let clock = app.world_mut().spawn(PlaybackClock { speed: 2.0, ..default() }).id();
    let entity = spawn(&mut app, FollowsClock(clock));
    pass(&mut app, 0.5);
    assert_eq!(time(&app, entity), 1.0, "the clock runs at twice the speed");
    change(&mut app, clock, |clock: &mut PlaybackClock| clock.running = false);
    pass(&mut app, 0.5);
    assert_eq!(time(&app, entity), 1.0, "a stopped clock stands still");
    change(&mut app, clock, |clock: &mut PlaybackClock| (clock.running, clock.speed) = (true, -1.0));
    pass(&mut app, 0.25);
    assert_eq!(time(&app, entity), 0.75, "a clock with a negative speed runs backwards");
    assert_eq!(get::<PlaybackClock>(&app, clock).source, ClockSource::Game, "the source is the game's time");
}

#[test]
fn steps_land_on_whole_frames() {
    let mut app = app("assets");
    let entity = spawn(&mut app, Playback::default());
    pass(&mut app, 0.51);
    let mut shown = Vec::new();
    for steps in [1, 1, -1, -1] {
        change(&mut app, entity, |playback: &mut Playback| playback.step(steps, 30.0, 2.0));
        pass(&mut app, 0.25);
        shown.push(time(&app, entity));
    }
    assert_eq!(shown, [16.0, 17.0, 16.0, 15.0].map(|frame: f32| frame / 30.0), "steps go from the nearest whole frame");
}

#[test]
fn an_observer_of_an_end_may_despawn_the_entity() {
    let mut app = app("assets");
    let [first, second] = [1.5, 0.0].map(|time| spawn(&mut app, Playback { time, repeat: Repeat::Once, ..default() }));
    app.add_observer(|ended: On<PlaybackEnded>, mut commands: Commands| commands.entity(ended.entity).despawn());
    pass(&mut app, 1.0);
    assert!(app.world().get_entity(first).is_err(), "the ended capture is despawned");
    assert_eq!(time(&app, second), 1.0, "the other capture continues");
    let ended = |entity| debug(&PlaybackEnded { entity });
    assert!(take_events(&mut app).contains(&ended(first)), "the first end sends an event");
    pass(&mut app, 1.0);
    assert!(app.world().get_entity(second).is_err(), "the second capture is despawned at its end");
    assert!(take_events(&mut app).contains(&ended(second)), "the second end sends an event");
}

fn reached(entity: Entity, markers: &[(f32, &str)]) -> Vec<String> {
    markers.iter().map(|&(time, name)| debug(&MarkerReached { entity, name: name.into(), time })).collect()
}

/// Returns the marker events since the last call.
fn markers_said(app: &mut App) -> Vec<String> {
    take_events(app).into_iter().filter(|said| said.starts_with("MarkerReached")).collect()
}

#[test]
fn markers_of_a_capture_are_reached_in_order_of_play() {
    const A: (f32, &str) = (0.5, "a");
    const B: (f32, &str) = (1.5, "b");
    for (playback, seconds, expected) in [
        (Playback::once(), 9.0, vec![A, B]),
        (Playback { speed: -1.0, time: 2.0, ..Playback::once() }, 9.0, vec![B, A]),
        (Playback::default(), 2.75, vec![A, B, A]),
        (Playback { speed: -1.0, time: 1.0, ..default() }, 2.0, vec![A, B]),
        (Playback::ping_pong(), 3.75, vec![A, B, B, A]),
        (Playback { start: 1.0, ..Playback::once() }, 9.0, vec![B]),
    ] {
        let mut app = app("assets");
        let entity = spawn(&mut app, (playback, Markers::new([B, A])));
        pass(&mut app, seconds);
        assert_eq!(markers_said(&mut app), reached(entity, &expected), "markers in order of play: {playback:?}");
    }
    let mut app = app("assets");
    let entity = spawn(&mut app, (Playback::default(), Markers::new([A, B])));
    pass(&mut app, 0.25);
    change(&mut app, entity, |playback: &mut Playback| playback.seek(1.5));
    pass(&mut app, 0.0);
    assert_eq!(
        markers_said(&mut app),
        [""; 0],
        "a seek reaches neither the skipped marker nor the marker at its target"
    );
    pass(&mut app, 0.25);
    assert_eq!(markers_said(&mut app), reached(entity, &[B]), "the marker at the target is reached by playing");
}

#[test]
fn a_marker_at_an_end_of_a_loop_is_reached_after_a_seek_there() {
    const START: (f32, &str) = (0.0, "start");
    const END: (f32, &str) = (2.0, "end");
    for (speed, sought, expected) in
        [(1.0, 2.0, vec![END, START]), (1.0, 0.0, vec![START]), (-1.0, 0.0, vec![START, END]), (-1.0, 2.0, vec![END])]
    {
        let mut app = app("assets");
        let playback = Playback { time: 1.0, speed, ..default() };
        let entity = spawn(&mut app, (playback, Markers::new([START, END])));
        pass(&mut app, 0.25);
        change(&mut app, entity, |playback: &mut Playback| playback.seek(sought));
        pass(&mut app, 0.25);
        assert_eq!(
            markers_said(&mut app),
            reached(entity, &expected),
            "markers after a seek to {sought} s at speed {speed}"
        );
    }
}

#[test]
fn captures_follow_captures_in_chains() {
    let mut app = app("assets");
    let handle = capture(&mut app, 2.0, 4);
    // Followers are spawned before the entities that they follow.
    let [last, middle, first] = [(); 3].map(|()| app.world_mut().spawn(GaussianCapture3d(handle.clone())).id());
    app.world_mut().entity_mut(last).insert((FollowsClock(middle), Playback { offset: 0.25, ..default() }));
    app.world_mut().entity_mut(middle).insert((FollowsClock(first), Playback { speed: 0.5, ..default() }));
    pass(&mut app, 1.0);
    let times = |app: &App| [first, middle, last].map(|entity| time(app, entity));
    assert_eq!(times(&app), [1.0, 0.5, 0.75], "the whole chain is updated in one frame");
    take_events(&mut app);
    change(&mut app, first, |playback: &mut Playback| playback.seek(0.5));
    pass(&mut app, 0.0);
    assert_eq!(times(&app), [0.5, 0.25, 0.5], "followers follow a seek");
    let seeks = take_events(&mut app).into_iter().filter(|said| said.starts_with("PlaybackSeeked")).count();
    assert_eq!(seeks, 3, "each entity sends one seek event");
    change(&mut app, first, Playback::pause);
    pass(&mut app, 1.0);
    assert_eq!(times(&app), [0.5, 0.25, 0.5], "followers follow a pause");
}

#[test]
fn a_follower_in_a_cycle_or_without_a_clock_stands_still() {
    let mut app = app("assets");
    let [one, other, lost] = [(); 3].map(|()| spawn(&mut app, Playback::default()));
    let timeless = app.world_mut().spawn_empty().id();
    app.world_mut().entity_mut(one).insert(FollowsClock(other));
    app.world_mut().entity_mut(other).insert(FollowsClock(one));
    app.world_mut().entity_mut(lost).insert(FollowsClock(timeless));
    let times = |app: &App| [one, other, lost].map(|entity| time(app, entity));
    pass(&mut app, 0.5);
    assert_eq!(times(&app), [0.0; 3], "followers in a cycle or without a clock stand still");
    app.world_mut().entity_mut(other).remove::<FollowsClock>();
    app.world_mut().entity_mut(timeless).insert(Playback { time: 1.25, ..default() });
    pass(&mut app, 0.5);
    assert_eq!(times(&app), [0.5, 0.5, 1.25], "followers move once the cycle is broken or the target has a time");
}

#[test]
fn another_capture_on_the_same_entity_starts_at_the_current_time() {
    let mut app = app("assets");
    let entity = spawn(&mut app, (Playback::default(), Markers::new([(0.5, "half")])));
    let follower = spawn(&mut app, FollowsClock(entity));
    pass(&mut app, 0.5);
    take_events(&mut app);
    let other = capture(&mut app, 2.0, 4);
    app.world_mut().entity_mut(entity).insert(GaussianCapture3d(other));
    pass(&mut app, 0.25);
    assert_eq!(time(&app, entity), 0.75, "the other capture plays from the current time");
    let started = vec![debug(&PlaybackStarted { entity })];
    let jump = vec![debug(&PlaybackSeeked { entity: follower, from: 0.5, to: 0.75 })];
    let expected = [started, crossed(entity, &[1]), reached(entity, &[(0.5, "half")]), jump].concat();
    assert_eq!(
        take_events(&mut app),
        expected,
        "start, key-frame and marker events of the other capture, and a seek of the follower"
    );
    pass(&mut app, 0.25);
    let on = [crossed(entity, &[2]), crossed(follower, &[2])].concat();
    assert_eq!(take_events(&mut app), on, "the start events are sent once");
}

#[test]
fn follows_clock_maps_its_entity() {
    let mut app = app("assets");
    let clocks = [(); 2].map(|()| app.world_mut().spawn(PlaybackClock::manual()).id());
    let mut follows = FollowsClock(clocks[0]);
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let component = registry.get_type_data::<ReflectComponent>(TypeId::of::<FollowsClock>()).expect("registered");
    // As a scene does with every component that it spawns.
    component.map_entities(&mut follows, &mut (clocks[0], clocks[1]));
    assert_eq!(follows, FollowsClock(clocks[1]), "the entity is mapped to the clock of the new world");
}
