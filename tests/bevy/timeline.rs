//! Timelines in Bevy apps: clips, markers, scrubbing, files that change and files that are broken.
//!
//! In: timelines made in code and written to a folder. Out: proof that every track shows the clip of the current time,
//! whether the time was reached by playing or by seeking. Needs neither a GPU nor a window.

use crate::support::event_log::{debug, take_events};
use crate::support::playback_app::{self, app, app_with, capture, change, get, pass};
use crate::support::waiting::wait_until;
use bevy::asset::{AssetLoadFailedEvent, LoadState};
use bevy::prelude::*;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::offline;
use bevy_gs4d::playback::{
    Clip, ClipFade, FollowsClock, Marker, MarkerReached, Repeat, SegmentBoundCrossed, Timeline, TimelinePlayer,
    TimelineTrack, Track,
};
use bevy_gs4d::prelude::*;
use std::path::Path;

/// Returns a timeline of six seconds with two tracks and three markers, and its captures of two and four seconds.
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
    let timeline = Timeline::new(tracks.to_vec(), markers.to_vec(), None).expect("a valid timeline");
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
    assert_eq!(found.next(), None, "every track has only one entity");
    entity
}

/// Returns whether a track is visible, the time of its capture, and its fade.
fn shown(app: &mut App, name: &str) -> (bool, f32, f32) {
    let entity = track(app, name);
    let visible = get::<Visibility>(app, entity) != Visibility::Hidden;
    (visible, get::<Playback>(app, entity).time, get::<ClipFade>(app, entity).0)
}

/// Returns the events of one entity.
fn said_by(app: &mut App, entity: Entity) -> Vec<String> {
    let mark = format!("entity: {entity:?}");
    take_events(app).into_iter().filter(|message| message.contains(&mark)).collect()
}

fn marker(entity: Entity, time: f32, name: &str) -> String {
    debug(&MarkerReached { entity, name: name.into(), time })
}

#[test]
fn every_track_shows_its_clip_at_the_current_time() {
    let mut app = app("assets");
    let (timeline, captures) = timeline(&mut app);
    spawn(&mut app, timeline, Playback { repeat: Repeat::Once, ..default() });
    pass(&mut app, 0.0);
    assert_eq!(shown(&mut app, "left"), (true, 0.5, 0.0), "the first clip starts at its in point, fading in");
    assert!(!shown(&mut app, "right").0, "the right track is hidden before its clip");
    pass(&mut app, 0.25);
    assert_eq!(shown(&mut app, "left"), (true, 0.625, 0.5), "the clip plays at half speed and is half faded in");
    pass(&mut app, 1.25);
    assert_eq!(shown(&mut app, "left"), (true, 1.25, 1.0), "the clip is fully faded in");
    assert_eq!(shown(&mut app, "right"), (true, 0.5, 0.5), "the clip of the right track has started");
    let left = track(&mut app, "left");
    assert_eq!(get::<GaussianCapture3d>(&app, left).0, captures[0], "the left track shows the first capture");
    pass(&mut app, 0.75);
    assert_eq!(shown(&mut app, "left"), (true, 3.5, 1.0), "the second clip plays backwards from its out point");
    assert_eq!(get::<GaussianCapture3d>(&app, left).0, captures[1], "the left track shows the second capture");
    assert_eq!(shown(&mut app, "right"), (true, 1.25, 0.75), "the clip of the right track fades out");
    pass(&mut app, 1.0);
    assert!(!shown(&mut app, "right").0, "the right track is hidden after its clip");
    pass(&mut app, 9.0);
    assert!(!shown(&mut app, "left").0, "the left track is hidden after its clip, before the last marker");
}

#[test]
fn playing_reversing_and_seeking_show_the_same() {
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
    assert_eq!(appearance(&mut app), played[0], "a loop shows the start again");
    change(&mut app, player, Playback::reverse);
    for expected in played.iter().rev() {
        pass(&mut app, 0.25);
        assert_eq!(&appearance(&mut app), expected, "reverse playback shows the same as forward playback");
    }
    change(&mut app, player, Playback::pause);
    for index in [7, 23, 0, 8, 16, 4, 5] {
        change(&mut app, player, |playback: &mut Playback| playback.seek(index as f32 / 4.0));
        pass(&mut app, 0.25);
        assert_eq!(appearance(&mut app), played[index], "a seek to frame {index} while paused shows the same");
    }
}

#[test]
fn the_end_of_a_looping_timeline_can_be_sought() {
    let mut app = app("assets");
    let capture = capture(&mut app, 2.0, 4);
    let clip = Clip { capture, start: 0.0, range: [0.0, 2.0], speed: 1.0, fade: [0.0; 2] };
    let tracks = vec![Track { name: "left".into(), clips: vec![clip] }];
    let timeline = Timeline::new(tracks, Vec::new(), None).expect("a valid timeline");
    let player = spawn(&mut app, timeline, Playback::paused_at(0.5));
    pass(&mut app, 0.25);
    for sought in [2.0f32, 0.5, 9.0] {
        change(&mut app, player, |playback: &mut Playback| playback.seek(sought));
        pass(&mut app, 0.25);
        assert_eq!(
            shown(&mut app, "left"),
            (true, sought.min(2.0), 1.0),
            "a seek to {sought} s shows the clamped time"
        );
    }
    take_events(&mut app);
    change(&mut app, player, Playback::play);
    pass(&mut app, 0.25);
    assert_eq!(shown(&mut app, "left"), (true, 0.25, 1.0), "playing at the end starts over");
    let left = track(&mut app, "left");
    let seeked = debug(&PlaybackSeeked { entity: left, from: 2.0, to: 0.25 });
    assert_eq!(said_by(&mut app, left), [seeked], "the track seeks to the start and does not play backwards");
}

#[test]
fn a_clip_beyond_its_capture_shows_the_end_of_the_capture() {
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
    let timeline = Timeline::new(tracks.to_vec(), Vec::new(), None).expect("a valid timeline");
    spawn(&mut app, timeline, Playback { repeat: Repeat::Once, ..default() });
    pass(&mut app, 0.5);
    let beyond = shown(&mut app, "beyond").1;
    assert!(beyond >= 4.0, "a clip beyond its capture shows the end at 4 s, not {beyond} s");
    // The capture of the other track is loaded only now.
    let scene = playback_app::scene(4.0, 4).into_runtime().expect("a synthetic scene can be drawn");
    let mut captures = app.world_mut().resource_mut::<Assets<GaussianCapture>>();
    captures.insert(&loading, GaussianCapture::new(scene)).expect("a reserved place");
    for (step, expected) in [(0.25, 4.0), (0.25, 4.0), (1.0, 3.0), (3.0, 0.0)] {
        pass(&mut app, step);
        let expected = (true, expected, 1.0);
        assert_eq!(
            shown(&mut app, "back"),
            expected,
            "a reverse clip shows the end until its range is inside the capture"
        );
    }
}

#[test]
fn marker_events_are_sent_in_order_of_play() {
    let mut app = app("assets");
    let (timeline, _) = timeline(&mut app);
    let player = spawn(&mut app, timeline, Playback { repeat: Repeat::PingPong, ..default() });
    let started = debug(&PlaybackStarted { entity: player });
    let looped = debug(&PlaybackLooped { entity: player, turns: 1 });
    pass(&mut app, 1.0);
    assert_eq!(said_by(&mut app, player), [started, marker(player, 0.0, "begin")], "the marker at the start");
    pass(&mut app, 1.0);
    assert_eq!(said_by(&mut app, player), [marker(player, 2.0, "cut")], "the marker at the current time");
    pass(&mut app, 1.0);
    assert_eq!(said_by(&mut app, player), [""; 0], "a marker is not sent again when playback continues");
    pass(&mut app, 8.0);
    let expected = [marker(player, 6.0, "end"), marker(player, 2.0, "cut"), looped];
    assert_eq!(said_by(&mut app, player), expected, "the markers up to the end and back");
    change(&mut app, player, |playback: &mut Playback| playback.seek(4.0));
    pass(&mut app, 0.0);
    let seeked = debug(&PlaybackSeeked { entity: player, from: 1.0, to: 4.0 });
    assert_eq!(said_by(&mut app, player), [seeked], "a seek sends no markers");
}

#[test]
fn tracks_send_events_of_the_key_frames_of_their_captures() {
    let mut app = app("assets");
    let (timeline, _) = timeline(&mut app);
    spawn(&mut app, timeline, Playback::default());
    pass(&mut app, 0.0);
    let left = track(&mut app, "left");
    assert_eq!(said_by(&mut app, left), [debug(&PlaybackStarted { entity: left })], "the first clip starts");
    pass(&mut app, 1.25);
    let crossed = |index, time| debug(&SegmentBoundCrossed { entity: left, index, time });
    assert_eq!(said_by(&mut app, left), [crossed(1, 0.5), crossed(2, 1.0)], "key-frames from the in point on");
    pass(&mut app, 1.0);
    assert_eq!(said_by(&mut app, left), [debug(&PlaybackStarted { entity: left })], "the second clip starts");
    pass(&mut app, 0.25);
    assert_eq!(
        said_by(&mut app, left),
        [crossed(7, 3.5), crossed(6, 3.0)],
        "key-frames in reverse order from the out point"
    );
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
    assert_eq!(track(&mut app, "right"), mine, "no second entity is spawned for the track");
    assert_eq!(
        (shown(&mut app, "right"), get::<Transform>(&app, mine)),
        ((true, 0.5, 0.5), place),
        "the child plays the track and keeps its transform"
    );
    let left = track(&mut app, "left");
    assert_eq!(get::<ChildOf>(&app, left).parent(), player, "an entity is spawned for the track without a child");
    assert_eq!(get::<Visibility>(&app, stray), Visibility::Hidden, "a child without a track is hidden");
    app.world_mut().despawn(player);
    pass(&mut app, 0.5);
    assert!(app.world().get_entity(mine).is_err(), "children are despawned with the player");
}

#[test]
fn a_timeline_follows_a_shared_clock() {
    let mut app = app("assets");
    let (timeline, _) = timeline(&mut app);
    let player = spawn(&mut app, timeline, Playback { repeat: Repeat::Once, ..default() });
    let song = app.world_mut().spawn(PlaybackClock::manual()).id();
    app.world_mut().entity_mut(player).insert(FollowsClock(song));
    pass(&mut app, 1.0);
    assert_eq!(shown(&mut app, "left").1, 0.5, "a clock at 0 shows the start");
    change(&mut app, song, |clock: &mut PlaybackClock| clock.set(1.0));
    pass(&mut app, 0.0);
    assert_eq!(shown(&mut app, "left").1, 1.0, "a second of the clock is half a second of the capture");
    change(&mut app, song, |clock: &mut PlaybackClock| clock.set(2.5));
    pass(&mut app, 0.0);
    assert_eq!(shown(&mut app, "left").1, 3.0, "the clock moves the track to the second clip");
}

#[test]
fn another_timeline_on_the_same_player_starts_at_the_current_time() {
    let mut app = app("assets");
    let (first, _) = timeline(&mut app);
    let player = spawn(&mut app, first, Playback::default());
    pass(&mut app, 1.0);
    take_events(&mut app);
    let (other, _) = timeline(&mut app);
    let other = app.world_mut().resource_mut::<Assets<Timeline>>().add(other);
    app.world_mut().entity_mut(player).insert(TimelinePlayer(other));
    pass(&mut app, 0.5);
    assert_eq!(said_by(&mut app, player), [debug(&PlaybackStarted { entity: player })], "the other timeline starts");
    assert_eq!(get::<Playback>(&app, player).time, 1.5, "the other timeline plays from the current time");
}

/// Returns a folder with a capture `two.gs4d` of two seconds.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    offline::work::save(&folder.path().join("two.gs4d"), &playback_app::scene(2.0, 4), &WriteSettings::default())
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

/// Loads `show.timeline.ron` with one clip from 0.5 to 1.5, paused at 0.25.
fn play_show(app: &mut App) -> Handle<Timeline> {
    let handle = load(app, "show.timeline.ron");
    app.world_mut().spawn((TimelinePlayer(handle.clone()), Playback::paused_at(0.25)));
    let loaded = handle.clone();
    wait(app, "timeline and capture", move |app| {
        app.world().resource::<AssetServer>().is_loaded_with_dependencies(loaded.id())
    });
    pass(app, 0.0);
    assert_eq!(shown(app, "left"), (true, 0.75, 1.0), "the clip of the file is shown");
    handle
}

#[test]
fn a_watched_file_is_reloaded_when_it_changes() {
    let folder = folder();
    let file = folder.path().join("show.timeline.ron");
    std::fs::write(&file, text("in: 0.5, out: 1.5")).expect("a file");
    let file_path = folder.path().to_str().expect("temporary folders have plain names").into();
    let mut app = app_with(AssetPlugin { file_path, watch_for_changes_override: Some(true), ..default() });
    let handle = play_show(&mut app);
    std::fs::write(&file, text("in: 1.0, out: 2.0, speed: -1")).expect("the file");
    wait(&mut app, "the change of the watched file", move |app| {
        let timeline = app.world().resource::<Assets<Timeline>>().get(&handle);
        timeline.is_some_and(|timeline| timeline.tracks()[0].clips[0].speed < 0.0)
    });
    pass(&mut app, 0.0);
    assert_eq!(shown(&mut app, "left"), (true, 1.75, 1.0), "the clip of the changed file is shown");
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
    assert_eq!(shown(&mut app, "left"), (true, 1.75, 1.0), "the clip of the changed file is shown");

    std::fs::write(&file, "(tracks: [(name: \"left\"").expect("the file");
    app.world().resource::<AssetServer>().reload("show.timeline.ron");
    wait(&mut app, "the failure", |app| !app.world().resource::<Messages<AssetLoadFailedEvent<Timeline>>>().is_empty());
    pass(&mut app, 0.0);
    assert_eq!(shown(&mut app, "left"), (true, 1.75, 1.0), "a broken file does not replace the timeline");
}

#[test]
fn errors_of_broken_files_name_the_file_and_the_fault() {
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
        let Some(LoadState::Failed(failure)) = state else {
            panic!("the load state of {name} is Failed, not {state:?}")
        };
        let message = failure.to_string();
        assert!(message.contains(name) && message.contains(fault), "{message} names {name} and {fault}");
    }
    pass(&mut app, 1.0);
    assert_eq!(take_events(&mut app), [""; 0], "players with failed timelines send no events");
}

#[test]
fn the_bundled_timeline_is_valid() {
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
        let lasts = captures.get(&clip.capture).expect("loaded with the timeline").duration_seconds();
        assert!(clip.range[1] <= lasts, "a clip ends at {} s of a capture of {lasts} s", clip.range[1]);
    }
    assert_eq!(timeline.tracks().len(), 2, "two tracks");
}
