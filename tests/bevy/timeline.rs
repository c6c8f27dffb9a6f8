//! Timelines in Bevy apps: clips, markers, scrubbing, files that change and files that are broken.
//!
//! In: timelines made in code and written to a folder. Out: proof that every track shows the clip of the current time,
//! however that time was reached. Needs neither a GPU nor a window.

use crate::support::event_log::{debug, take_events};
use crate::support::playback_app::{self, app, app_with, capture, change, get, pass};
use crate::support::waiting::wait_until;
use bevy::asset::{AssetLoadFailedEvent, LoadState};
use bevy::prelude::*;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::offline;
use bevy_gs4d::playback::{Clip, ClipFade, Marker, Track};
use bevy_gs4d::prelude::*;
use std::path::Path;

/// Returns two tracks and three markers in six seconds, and their captures of two and four seconds.
fn timeline(app: &mut App) -> (Timeline, [Handle<GaussianCapture>; 2]) {
    let captures = [capture(app, 2.0, 4), capture(app, 4.0, 8)];
    let clip = |capture: usize, start, range, speed, fade| {
        let capture = captures[capture].clone();
        Clip { capture, start, range, speed, fade }
    };
    let left = vec![clip(0, 0.0, [0.5, 1.5], 0.5, [0.5, 0.0]), clip(1, 2.0, [0.0, 4.0], -2.0, [0.0, 0.0])];
    let right = vec![clip(0, 1.0, [0.0, 2.0], 1.0, [1.0, 1.0])];
    let tracks = [("left", left), ("right", right)].map(|(name, clips)| Track { name: name.into(), clips });
    let markers = [(0.0, "begin"), (2.0, "cut"), (6.0, "end")].map(|(time, name)| Marker { time, name: name.into() });
    let timeline = Timeline::new(tracks.to_vec(), markers.to_vec(), None).expect("makes sense");
    (timeline, captures)
}

fn spawn(app: &mut App, timeline: Timeline, playback: Playback) -> Entity {
    let handle = app.world_mut().resource_mut::<Assets<Timeline>>().add(timeline);
    app.world_mut().spawn((TimelinePlayer(handle), playback)).id()
}

/// Returns the entity of a track.
fn track(app: &mut App, name: &str) -> Entity {
    let mut tracks = app.world_mut().query::<(Entity, &TimelineTrack)>();
    let mut found = tracks.iter(app.world()).filter(|(_, track)| track.0 == name).map(|(entity, _)| entity);
    let entity = found.next().expect("every track has an entity");
    assert_eq!(found.next(), None, "and only one");
    entity
}

/// Returns whether a track is visible, the time of its capture, and its fade.
fn shown(app: &mut App, name: &str) -> (bool, f32, f32) {
    let entity = track(app, name);
    let visible = get::<Visibility>(app, entity) != Visibility::Hidden;
    (visible, get::<Playback>(app, entity).time, get::<ClipFade>(app, entity).0)
}

/// Returns the messages of one entity among all.
fn said_by(app: &mut App, entity: Entity) -> Vec<String> {
    let mark = format!("entity: {entity:?}");
    take_events(app).into_iter().filter(|message| message.contains(&mark)).collect()
}

fn marker(entity: Entity, time: f32, name: &str) -> String {
    debug(&MarkerReached { entity, name: name.into(), time })
}

#[test]
fn every_track_shows_what_the_timeline_says() {
    let mut app = app("assets");
    let (timeline, captures) = timeline(&mut app);
    spawn(&mut app, timeline, Playback { repeat: Repeat::Once, ..default() });
    pass(&mut app, 0.0);
    assert_eq!(shown(&mut app, "left"), (true, 0.5, 0.0), "the first clip begins at its in point, fading in");
    assert!(!shown(&mut app, "right").0, "the other track waits");
    pass(&mut app, 0.25);
    assert_eq!(shown(&mut app, "left"), (true, 0.625, 0.5), "half faded in, at half speed");
    pass(&mut app, 1.25);
    assert_eq!(shown(&mut app, "left"), (true, 1.25, 1.0), "all there");
    assert_eq!(shown(&mut app, "right"), (true, 0.5, 0.5), "the other track has begun");
    let left = track(&mut app, "left");
    assert_eq!(get::<GaussianCapture3d>(&app, left).0, captures[0], "the first capture");
    pass(&mut app, 0.75);
    assert_eq!(shown(&mut app, "left"), (true, 3.5, 1.0), "the second clip plays backwards from its out point");
    assert_eq!(get::<GaussianCapture3d>(&app, left).0, captures[1], "another capture");
    assert_eq!(shown(&mut app, "right"), (true, 1.25, 0.75), "fading out");
    pass(&mut app, 1.0);
    assert!(!shown(&mut app, "right").0, "over");
    pass(&mut app, 9.0);
    assert!(!shown(&mut app, "left").0, "and so is this one before the timeline ends with a marker");
}

#[test]
fn a_moment_looks_the_same_however_it_is_reached() {
    let mut app = app("assets");
    let (timeline, _) = timeline(&mut app);
    let player = spawn(&mut app, timeline, Playback::default());
    let appearance = |app: &mut App| [shown(app, "left"), shown(app, "right")];
    let mut played = Vec::new();
    pass(&mut app, 0.0);
    for _ in 0..24 {
        played.push(appearance(&mut app));
        pass(&mut app, 0.25);
    }
    assert_eq!(appearance(&mut app), played[0], "a loop shows its beginning again");
    change(&mut app, player, Playback::reverse);
    for expected in played.iter().rev() {
        pass(&mut app, 0.25);
        assert_eq!(&appearance(&mut app), expected, "backwards");
    }
    change(&mut app, player, Playback::pause);
    for index in [7, 23, 0, 8, 16, 4, 5] {
        change(&mut app, player, |playback: &mut Playback| playback.seek(index as f32 / 4.0));
        pass(&mut app, 0.25);
        assert_eq!(appearance(&mut app), played[index], "scrubbed to frame {index}, while paused");
    }
}

#[test]
fn the_end_of_a_looping_timeline_can_be_sought() {
    let mut app = app("assets");
    let capture = capture(&mut app, 2.0, 4);
    let clip = Clip { capture, start: 0.0, range: [0.0, 2.0], speed: 1.0, fade: [0.0; 2] };
    let tracks = vec![Track { name: "left".into(), clips: vec![clip] }];
    let timeline = Timeline::new(tracks, Vec::new(), None).expect("makes sense");
    let player = spawn(&mut app, timeline, Playback::paused_at(0.5));
    pass(&mut app, 0.25);
    for sought in [2.0f32, 0.5, 9.0] {
        change(&mut app, player, |playback: &mut Playback| playback.seek(sought));
        pass(&mut app, 0.25);
        assert_eq!(shown(&mut app, "left"), (true, sought.min(2.0), 1.0), "scrubbed to {sought} s");
    }
    take_events(&mut app);
    change(&mut app, player, Playback::play);
    pass(&mut app, 0.25);
    assert_eq!(shown(&mut app, "left"), (true, 0.25, 1.0), "played on, it starts over");
    let left = track(&mut app, "left");
    let seeked = debug(&PlaybackSeeked { entity: left, from: 2.0, to: 0.25 });
    assert_eq!(said_by(&mut app, left), [seeked], "and nothing is played backwards to get there");
}

#[test]
fn a_clip_that_reaches_beyond_its_capture_stands_at_its_end() {
    let mut app = app("assets");
    let late = capture(&mut app, 4.0, 4);
    let loading = app.world().resource::<Assets<GaussianCapture>>().reserve_handle();
    let clip = |capture: &Handle<GaussianCapture>, range, speed| Clip {
        capture: capture.clone(),
        start: 0.0,
        range,
        speed,
        fade: [0.0; 2],
    };
    let tracks = [("beyond", clip(&late, [5.0, 6.0], 1.0)), ("back", clip(&loading, [0.0, 5.0], -1.0))];
    let tracks = tracks.map(|(name, clip)| Track { name: name.into(), clips: vec![clip] });
    let timeline = Timeline::new(tracks.to_vec(), Vec::new(), None).expect("makes sense");
    spawn(&mut app, timeline, Playback { repeat: Repeat::Once, ..default() });
    pass(&mut app, 0.5);
    let beyond = shown(&mut app, "beyond").1;
    assert!(beyond >= 4.0, "all beyond its capture, a clip stands at the end of it, not at {beyond} s");
    // The other track's capture arrives only now.
    let scene = playback_app::scene(4.0, 4).into_runtime().expect("a synthetic scene can be drawn");
    let mut captures = app.world_mut().resource_mut::<Assets<GaussianCapture>>();
    captures.insert(&loading, GaussianCapture::new(scene)).expect("a reserved place");
    for (step, expected) in [(0.25, 4.0), (0.25, 4.0), (1.0, 3.0), (3.0, 0.0)] {
        pass(&mut app, step);
        let expected = (true, expected, 1.0);
        assert_eq!(shown(&mut app, "back"), expected, "backwards it waits at the end, and then plays all there is");
    }
}

#[test]
fn markers_are_said_in_the_order_of_play() {
    let mut app = app("assets");
    let (timeline, _) = timeline(&mut app);
    let player = spawn(&mut app, timeline, Playback { repeat: Repeat::PingPong, ..default() });
    let started = debug(&PlaybackStarted { entity: player });
    let looped = debug(&PlaybackLooped { entity: player, turns: 1 });
    pass(&mut app, 1.0);
    assert_eq!(said_by(&mut app, player), [started, marker(player, 0.0, "begin")], "the one it begins at");
    pass(&mut app, 1.0);
    assert_eq!(said_by(&mut app, player), [marker(player, 2.0, "cut")], "the one it arrives at");
    pass(&mut app, 1.0);
    assert_eq!(said_by(&mut app, player), [""; 0], "not again when it leaves");
    pass(&mut app, 8.0);
    let expected = [marker(player, 6.0, "end"), marker(player, 2.0, "cut"), looped];
    assert_eq!(said_by(&mut app, player), expected, "up to the end, and back");
    change(&mut app, player, |playback: &mut Playback| playback.seek(4.0));
    pass(&mut app, 0.0);
    let seeked = debug(&PlaybackSeeked { entity: player, from: 1.0, to: 4.0 });
    assert_eq!(said_by(&mut app, player), [seeked], "what a seek skips is not said");
}

#[test]
fn captures_hear_of_their_own_key_frames() {
    let mut app = app("assets");
    let (timeline, _) = timeline(&mut app);
    spawn(&mut app, timeline, Playback::default());
    pass(&mut app, 0.0);
    let left = track(&mut app, "left");
    assert_eq!(said_by(&mut app, left), [debug(&PlaybackStarted { entity: left })], "the first clip");
    pass(&mut app, 1.25);
    let crossed = |index, time| debug(&SegmentBoundCrossed { entity: left, index, time });
    assert_eq!(said_by(&mut app, left), [crossed(1, 0.5), crossed(2, 1.0)], "from its in point on");
    pass(&mut app, 1.0);
    assert_eq!(said_by(&mut app, left), [debug(&PlaybackStarted { entity: left })], "the second clip");
    pass(&mut app, 0.25);
    assert_eq!(said_by(&mut app, left), [crossed(7, 3.5), crossed(6, 3.0)], "backwards from where it began");
}

#[test]
fn a_child_with_the_name_of_a_track_plays_it() {
    let mut app = app("assets");
    let (timeline, _) = timeline(&mut app);
    let player = spawn(&mut app, timeline, Playback::default());
    let place = Transform::from_xyz(1.0, 2.0, 3.0);
    let mine = app.world_mut().spawn((TimelineTrack("right".into()), place, ChildOf(player))).id();
    let stray = app.world_mut().spawn((TimelineTrack("center".into()), ChildOf(player))).id();
    pass(&mut app, 1.5);
    assert_eq!(track(&mut app, "right"), mine, "none is spawned beside it");
    assert_eq!((shown(&mut app, "right"), get::<Transform>(&app, mine)), ((true, 0.5, 0.5), place), "in its place");
    let left = track(&mut app, "left");
    assert_eq!(get::<ChildOf>(&app, left).parent(), player, "one is spawned for the other");
    assert_eq!(get::<Visibility>(&app, stray), Visibility::Hidden, "what has no track shows nothing");
    app.world_mut().despawn(player);
    pass(&mut app, 0.5);
    assert!(app.world().get_entity(mine).is_err(), "they go with the player");
}

#[test]
fn a_timeline_follows_a_shared_clock() {
    let mut app = app("assets");
    let (timeline, _) = timeline(&mut app);
    let player = spawn(&mut app, timeline, Playback { repeat: Repeat::Once, ..default() });
    let song = app.world_mut().spawn(PlaybackClock::manual()).id();
    app.world_mut().entity_mut(player).insert(FollowsClock(song));
    pass(&mut app, 1.0);
    assert_eq!(shown(&mut app, "left").1, 0.5, "the song has not begun");
    change(&mut app, song, |clock: &mut PlaybackClock| clock.set(1.0));
    pass(&mut app, 0.0);
    assert_eq!(shown(&mut app, "left").1, 1.0, "a second of the song is half a second of the capture");
    change(&mut app, song, |clock: &mut PlaybackClock| clock.set(2.5));
    pass(&mut app, 0.0);
    assert_eq!(shown(&mut app, "left").1, 3.0, "the second clip");
}

#[test]
fn another_timeline_on_the_same_player_begins_anew_at_the_time_that_is_set() {
    let mut app = app("assets");
    let (first, _) = timeline(&mut app);
    let player = spawn(&mut app, first, Playback::default());
    pass(&mut app, 1.0);
    take_events(&mut app);
    let (other, _) = timeline(&mut app);
    let other = app.world_mut().resource_mut::<Assets<Timeline>>().add(other);
    app.world_mut().entity_mut(player).insert(TimelinePlayer(other));
    pass(&mut app, 0.5);
    assert_eq!(said_by(&mut app, player), [debug(&PlaybackStarted { entity: player })], "it starts");
    assert_eq!(get::<Playback>(&app, player).time, 1.5, "from the time that the game has left");
}

/// Returns a folder with a capture `two.gs4d` of two seconds.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    offline::save(&folder.path().join("two.gs4d"), &playback_app::scene(2.0, 4), &WriteSettings::default())
        .expect("saved");
    folder
}

fn app_in(folder: &Path) -> App {
    app(folder.to_str().expect("temporary folders have plain names"))
}

/// Updates until `so` returns true; no time passes.
fn wait(app: &mut App, what: &str, so: impl Fn(&App) -> bool) {
    wait_until(app, what, so, |app| pass(app, 0.0));
}

fn load(app: &App, name: &'static str) -> Handle<Timeline> {
    app.world().resource::<AssetServer>().load(name)
}

/// Returns the text of a timeline of one clip.
fn text(range: &str) -> String {
    format!("(tracks: [(name: \"left\", clips: [(capture: \"two.gs4d\", start: 0, {range})])])")
}

/// Plays `show.timeline.ron`, one clip from 0.5 to 1.5, and stops a quarter of a second into it.
fn play_show(app: &mut App) -> Handle<Timeline> {
    let handle = load(app, "show.timeline.ron");
    app.world_mut().spawn((TimelinePlayer(handle.clone()), Playback::paused_at(0.25)));
    let loaded = handle.clone();
    wait(app, "timeline and capture", move |app| {
        app.world().resource::<AssetServer>().is_loaded_with_dependencies(loaded.id())
    });
    pass(app, 0.0);
    assert_eq!(shown(app, "left"), (true, 0.75, 1.0), "what the file says");
    handle
}

#[test]
fn a_file_that_bevy_watches_is_played_as_it_becomes() {
    let folder = folder();
    let file = folder.path().join("show.timeline.ron");
    std::fs::write(&file, text("in: 0.5, out: 1.5")).expect("a file");
    let file_path = folder.path().to_str().expect("temporary folders have plain names").into();
    let mut app = app_with(AssetPlugin { file_path, watch_for_changes_override: Some(true), ..default() });
    let handle = play_show(&mut app);
    std::fs::write(&file, text("in: 1.0, out: 2.0, speed: -1")).expect("the file");
    wait(&mut app, "the change, which nobody told of", move |app| {
        let timeline = app.world().resource::<Assets<Timeline>>().get(&handle);
        timeline.is_some_and(|timeline| timeline.tracks()[0].clips[0].speed < 0.0)
    });
    pass(&mut app, 0.0);
    assert_eq!(shown(&mut app, "left"), (true, 1.75, 1.0), "what it says now");
}

#[test]
fn a_file_loads_with_its_captures_and_reloads_when_it_changes() {
    let folder = folder();
    let file = folder.path().join("show.timeline.ron");
    std::fs::write(&file, text("in: 0.5, out: 1.5")).expect("a file");
    let mut app = app_in(folder.path());
    let handle = play_show(&mut app);

    std::fs::write(&file, text("in: 1.0, out: 2.0, speed: -1")).expect("the file");
    app.world().resource::<AssetServer>().reload("show.timeline.ron");
    let changed = handle.clone();
    wait(&mut app, "the reload", move |app| {
        let timeline = app.world().resource::<Assets<Timeline>>().get(&changed);
        timeline.is_some_and(|timeline| timeline.tracks()[0].clips[0].speed < 0.0)
    });
    pass(&mut app, 0.0);
    assert_eq!(shown(&mut app, "left"), (true, 1.75, 1.0), "what it says now, at once");

    std::fs::write(&file, "(tracks: [(name: \"left\"").expect("the file");
    app.world().resource::<AssetServer>().reload("show.timeline.ron");
    wait(&mut app, "the failure", |app| !app.world().resource::<Messages<AssetLoadFailedEvent<Timeline>>>().is_empty());
    pass(&mut app, 0.0);
    assert_eq!(shown(&mut app, "left"), (true, 1.75, 1.0), "half-saved files do not take the show off the air");
}

#[test]
fn broken_files_are_errors_that_name_file_and_fault() {
    let folder = folder();
    let clip = |clip: &str| format!("(tracks: [(name: \"left\", clips: [({clip})])])");
    let cases = [
        ("text.timeline.ron", "(tracks: [".into(), "line and column 1:"),
        ("field.timeline.ron", clip("capture: \"two.gs4d\", start: 0, out: 1, sped: 1"), "sped"),
        ("number.timeline.ron", clip("capture: \"two.gs4d\", start: 0, out: inf"), "out is inf"),
        ("outside.timeline.ron", clip("capture: \"../two.gs4d\", start: 0, out: 1"), "\"../two.gs4d\""),
        ("empty.timeline.ron", "()".into(), "at least one clip"),
    ];
    let mut app = app_in(folder.path());
    for (name, text, fault) in cases {
        std::fs::write(folder.path().join(name), text).expect("a file");
        let handle = load(&app, name);
        app.world_mut().spawn(TimelinePlayer(handle.clone()));
        let id = handle.id();
        wait(&mut app, name, move |app| {
            app.world().resource::<AssetServer>().get_load_state(id).is_some_and(|state| state.is_failed())
        });
        let state = app.world().resource::<AssetServer>().get_load_state(id);
        let Some(LoadState::Failed(failure)) = state else { panic!("{name} has failed, and is {state:?}") };
        let message = failure.to_string();
        assert!(message.contains(name) && message.contains(fault), "{message} names {name} and {fault}");
    }
    pass(&mut app, 1.0);
    assert_eq!(take_events(&mut app), [""; 0], "nothing plays");
}

#[test]
fn the_bundled_timeline_makes_sense() {
    let mut app = app("assets");
    let handle = load(&app, "demo.timeline.ron");
    let id = handle.id();
    wait(&mut app, "demo.timeline.ron", move |app| {
        let server = app.world().resource::<AssetServer>();
        if let Some(LoadState::Failed(failure)) = server.get_load_state(id) {
            panic!("{failure}");
        }
        server.is_loaded_with_dependencies(id)
    });
    let timeline = app.world().resource::<Assets<Timeline>>().get(&handle).expect("loaded").clone();
    let captures = app.world().resource::<Assets<GaussianCapture>>();
    for clip in timeline.tracks().iter().flat_map(|track| &track.clips) {
        let lasts = captures.get(&clip.capture).expect("loaded with it").duration_seconds();
        assert!(clip.range[1] <= lasts, "a clip plays up to {} s of a capture of {lasts} s", clip.range[1]);
    }
    assert_eq!(timeline.tracks().len(), 2, "two tracks");
}
