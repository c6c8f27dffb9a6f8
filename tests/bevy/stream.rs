//! Captures in chunk files: what is loaded, drawn and given up while a capture is played.
//!
//! In: a synthetic capture that `gs4d split` has cut, from an asset source whose reads the tests let through, fail and
//! count. Out: proof that a capture is ready with its coarse picture and then becomes whole, that its settings decide
//! what is drawn while files are missing, that budgets are kept, that files are loaded again after failures and
//! reloads, that faults are reported, and that a whole stream has the picture of the joined capture: on several
//! entities, with any settings, in pages that other files were in before, after the loss of a device. Only the tests of
//! pictures need a GPU.

use crate::support::event_log::{Observed, debug, record, take_events};
use crate::support::fixtures::synthetic_eye;
use crate::support::gated_files::GatedFiles;
use crate::support::offscreen_app::{self, picture, run_frames, spawn_camera};
use crate::support::playback_app::{self, change, get, pass};
use crate::support::split::{PACKED, SPLIT, Split};
use crate::support::waiting::wait_until;
use bevy::camera::visibility::RenderLayers;
use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy::render::renderer::RenderDevice;
use bevy::time::TimeUpdateStrategy;
use bevy_gs4d::codec::stream::StreamSchedule;
use bevy_gs4d::playback::{
    Clip, ClipFade, FollowsClock, PlaybackClock, Timeline, TimelinePlayer, TimelineTrack, Track,
};
use bevy_gs4d::prelude::*;
use bevy_gs4d::render::CaptureSettings;
use bevy_gs4d::scene::ChunkTable;
use bevy_gs4d::stream::{
    CaptureBuffered, CaptureBuffering, CaptureStalled, CaptureStreamSettings, CaptureStreamState, OnUnderrun,
    StreamBudget,
};
use bevy_gs4d::testing;
use image::{Rgba, RgbaImage};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::sync::Arc;
use std::time::Duration;
use tempfile::TempDir;

/// Duration of the capture.
const SECONDS: f32 = 4.0;
/// A time in the last stretch of the capture, half a second long.
const LATE: f32 = 3.6;
/// The path of the index in apps without a renderer.
const INDEX: &str = "gated://index.gs4d";
/// The name of the file of the joined capture.
const JOINED: &str = "joined.gs4d";
/// The name of the file of the index and all chunk files.
const ONE: &str = "one.gs4d";

/// Returns the numbers of all chunk files.
fn all_files() -> BTreeSet<usize> {
    (0..SPLIT.table.files.len()).collect()
}

/// Returns the numbers of the files that have Gaussians of a time.
fn needed(seconds: f32) -> BTreeSet<usize> {
    StreamSchedule::new(SPLIT.table.clone(), SECONDS.into()).needed_at(seconds.into()).collect()
}

/// Returns those of them that have the most important Gaussians.
fn coarse(seconds: f32) -> BTreeSet<usize> {
    needed(seconds).into_iter().filter(|file| SPLIT.table.files[*file].layer == 0).collect()
}

/// Returns the bytes of the pages of files on the GPU.
fn gpu_bytes(files: &BTreeSet<usize>) -> u64 {
    files.iter().map(|file| SPLIT.table.page_bytes(*file)).sum()
}

fn name(file: usize) -> String {
    ChunkTable::file_name(file, SPLIT.table.files.len())
}

fn names(files: BTreeSet<usize>) -> impl Iterator<Item = String> {
    files.into_iter().map(name)
}

/// An app without a renderer, and the files that it loads. At first only the index is let through.
struct Stage {
    app: App,
    gate: GatedFiles,
}

impl Stage {
    fn new() -> Self {
        Self::of(&SPLIT.files)
    }

    /// Returns a stage with other files.
    fn of(files: &BTreeMap<String, Vec<u8>>) -> Self {
        let gate = GatedFiles::new(files);
        gate.let_through([ChunkTable::INDEX.to_owned()]);
        let mut app = App::new();
        gate.add_to(&mut app);
        app.add_plugins((MinimalPlugins, AssetPlugin::default(), GaussianCapturePlugins));
        // Tests also make steps longer than Bevy's limit of a quarter of a second.
        app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(Duration::MAX);
        record::<CaptureReady>(&mut app, Last);
        record::<CaptureFailed>(&mut app, Last);
        record::<CaptureBuffering>(&mut app, Last);
        record::<CaptureBuffered>(&mut app, Last);
        record::<CaptureStalled>(&mut app, Last);
        record::<PlaybackStarted>(&mut app, Last);
        record::<PlaybackSeeked>(&mut app, Last);
        record::<PlaybackLooped>(&mut app, Last);
        // No time passes in the first update, with any strategy.
        pass(&mut app, 0.0);
        Self { app, gate }
    }

    /// Spawns an entity with the capture.
    fn spawn(&mut self, bundle: impl Bundle) -> Entity {
        let capture = self.app.world().resource::<AssetServer>().load(INDEX);
        self.app.world_mut().spawn((GaussianCapture3d(capture), bundle)).id()
    }

    /// Spawns a playing entity with the capture, and waits until it has all Gaussians of its first moment.
    fn whole(&mut self) -> Entity {
        self.gate.open();
        let entity = self.spawn(Playback::default());
        until(&mut self.app, "a whole picture", |app| stream(app, entity).is_whole());
        entity
    }
}

/// Updates until a condition holds, without time passing.
fn until(app: &mut App, what: &str, so: impl Fn(&App) -> bool) {
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    wait_until(app, what, so, App::update);
}

/// Returns the state of a stream; the default if the entity has none.
fn stream(app: &App, entity: Entity) -> CaptureStreamState {
    app.world().get::<CaptureStreamState>(entity).cloned().unwrap_or_default()
}

fn time(app: &App, entity: Entity) -> f32 {
    get::<Playback>(app, entity).time
}

fn seek(app: &mut App, entity: Entity, seconds: f32) {
    change::<Playback>(app, entity, |playback| playback.seek(seconds));
}

fn captures(app: &App) -> &Assets<GaussianCapture> {
    app.world().resource()
}

/// Returns the table of the index of an entity as it is loaded now.
fn table(app: &App, entity: Entity) -> Option<Arc<ChunkTable>> {
    captures(app).get(&get::<GaussianCapture3d>(app, entity).0)?.scene().chunks.clone()
}

/// Returns the time that is drawn of a stream, and the number of files of the playback's time that are there.
fn shown(app: &App, entity: Entity) -> (Option<f32>, usize) {
    let state = stream(app, entity);
    (state.seconds, state.resident)
}

/// Returns what [`shown`] returns of a stream with all files of a time, which is drawn.
fn all_of(seconds: f32) -> (Option<f32>, usize) {
    (Some(seconds), needed(seconds).len())
}

/// Returns the events since the last call whose names begin in this way.
fn events(app: &mut App, name: &str) -> Vec<String> {
    take_events(app).into_iter().filter(|event| event.starts_with(name)).collect()
}

/// Returns the messages about streaming since the last call.
fn said(app: &mut App) -> Vec<String> {
    take_events(app)
        .into_iter()
        .filter(|event| ["CaptureBuffer", "CaptureStalled"].iter().any(|name| event.starts_with(name)))
        .collect()
}

#[test]
fn the_next_clip_of_a_timeline_is_loaded_before_it_begins() {
    let mut stage = Stage::new();
    stage.gate.open();
    let capture: Handle<GaussianCapture> = stage.app.world().resource::<AssetServer>().load(INDEX);
    let clip = |start, range| Clip { capture: capture.clone(), start, range, speed: 1.0, fade: [0.0; 2] };
    let clips = vec![clip(0.0, [0.0, 0.4]), clip(2.0, [LATE, SECONDS])];
    let timeline = Timeline::new(vec![Track { name: "one".into(), clips }], Vec::new(), None).expect("a timeline");
    let timeline = stage.app.world_mut().resource_mut::<Assets<Timeline>>().add(timeline);
    let player = stage.app.world_mut().spawn((TimelinePlayer(timeline), Playback::once())).id();
    let gate = stage.gate.clone();
    let are_read = |files: BTreeSet<usize>| names(files).all(|name| gate.reads().contains_key(&name));
    until(&mut stage.app, "the files of the clip to come", |_| are_read(needed(LATE)));
    assert_eq!(time(&stage.app, player), 0.0, "two seconds before");
    let of_clips: BTreeSet<usize> = needed(0.2).union(&needed(LATE)).copied().collect();
    let between: BTreeSet<usize> = needed(2.2).difference(&of_clips).copied().collect();
    assert!(!between.is_empty(), "the capture has files that no clip plays");
    assert!(names(between).all(|name| !gate.reads().contains_key(&name)), "what no clip plays is not loaded");
}

#[test]
fn a_timeline_waits_for_a_track_that_shows_a_clip_and_stalls() {
    for (on_underrun, is_shown) in [(OnUnderrun::Stall, true), (OnUnderrun::Stall, false), (OnUnderrun::Coarse, true)] {
        let mut stage = Stage::new();
        stage.gate.let_through(names(coarse(0.0)));
        let app = &mut stage.app;
        let capture: Handle<GaussianCapture> = app.world().resource::<AssetServer>().load(INDEX);
        let end = if is_shown { SECONDS } else { 1.0 };
        let streamed = Clip { capture, start: 0.0, range: [0.0, end], speed: 1.0, fade: [0.0; 2] };
        let capture = playback_app::capture(app, SECONDS, 4);
        let whole = Clip { capture, range: [0.0, SECONDS], ..streamed.clone() };
        let tracks = [("streamed", streamed), ("whole", whole)]
            .map(|(name, clip)| Track { name: name.into(), clips: vec![clip] });
        let timeline = Timeline::new(tracks.into(), Vec::new(), None).expect("a timeline");
        let timeline = app.world_mut().resource_mut::<Assets<Timeline>>().add(timeline);
        let settings = CaptureStreamSettings { on_underrun, ..default() };
        let track = (TimelineTrack("streamed".into()), settings);
        let player = app.world_mut().spawn((TimelinePlayer(timeline), children![track])).id();
        let case = format!("{on_underrun:?}, shown: {is_shown}");
        let track = app.world().get::<Children>(player).expect("the track")[0];
        until(app, "the first picture", |app| stream(app, track).is_coarse);
        pass(app, 0.25);
        assert_eq!(time(app, player), 0.25, "{case}: the timeline plays");

        seek(app, player, LATE);
        pass(app, 0.02);
        pass(app, 0.02);
        let then = time(app, player);
        pass(app, 0.1);
        let waits = on_underrun == OnUnderrun::Stall && is_shown;
        assert!(!is_shown || !stream(app, track).is_coarse, "{case}: the files of {LATE} s are missing");
        assert_eq!(time(app, player) == then, waits, "{case}: at {then} s, then {} s", time(app, player));
        stage.gate.open();
        until(app, "a coarse picture", |app| stream(app, track).is_coarse);
        let then = time(app, player);
        pass(app, 0.1);
        assert!(time(app, player) > then, "{case}: time passes");
    }
}

#[test]
fn a_capture_is_ready_once_its_coarse_picture_is_there_and_then_becomes_whole() {
    let mut stage = Stage::new();
    let entity = stage.spawn(Playback::default());
    let mut files = coarse(0.0);
    let count = files.len();
    let last = files.pop_last().expect("every moment has Gaussians");
    stage.gate.let_through(names(files));
    until(&mut stage.app, "all files but one", |app| {
        stream(app, entity).resident == count - 1 && stage.gate.reads().contains_key(&name(last))
    });
    for _ in 0..3 {
        pass(&mut stage.app, 0.0);
        let state = stream(&stage.app, entity);
        assert_eq!(get::<CaptureState>(&stage.app, entity), CaptureState::Loading, "without one file: {state:?}");
        assert_eq!((state.seconds, state.is_coarse), (None, false), "nothing is drawn");
    }
    assert_eq!(events(&mut stage.app, "CaptureReady"), [""; 0], "nothing is ready");

    stage.gate.let_through([name(last)]);
    until(&mut stage.app, "a coarse picture", |app| get::<CaptureState>(app, entity) == CaptureState::Ready);
    let state = stream(&stage.app, entity);
    assert_eq!((state.seconds, state.is_coarse, state.is_whole()), (Some(0.0), true, false), "coarse: {state:?}");
    assert_eq!((state.needed, state.resident), (needed(0.0).len(), count), "the files of layer 0: {state:?}");
    assert!(state.share > 0.0 && state.share < 1.0, "a share of the Gaussians: {state:?}");
    let ready = debug(&CaptureReady { entity, capture: get::<GaussianCapture3d>(&stage.app, entity).0.id() });
    let said = events(&mut stage.app, "CaptureReady").into_iter().filter(|event| *event == ready).count();
    assert_eq!(said, 1, "one message names the entity of the game");

    stage.gate.open();
    until(&mut stage.app, "a whole picture", |app| stream(app, entity).is_whole());
    assert_eq!(shown(&stage.app, entity), all_of(0.0), "each file of the first moment");
    assert_eq!(stream(&stage.app, entity).share, 1.0, "all Gaussians");
    assert_eq!(events(&mut stage.app, &ready), [""; 0], "the capture is ready once");
}

#[test]
fn a_playing_stream_has_the_files_of_its_time_and_draws_that_time() {
    let mut stage = Stage::new();
    let entity = stage.whole();
    let count = SPLIT.table.files.len() + 1;
    until(&mut stage.app, "all files", |app| captures(app).len() == count);
    let mut turns = 0;
    for _ in 0..14 {
        let before = time(&stage.app, entity);
        pass(&mut stage.app, 0.31);
        let now = time(&stage.app, entity);
        turns += usize::from(now < before);
        let state = stream(&stage.app, entity);
        assert!(state.is_whole() && state.seconds == Some(now), "everything is there at {now} s: {state:?}");
        assert_eq!(shown(&stage.app, entity), all_of(now), "the files of {now} s");
    }
    assert_eq!(turns, 1, "the capture loops");
    seek(&mut stage.app, entity, LATE);
    pass(&mut stage.app, 0.0);
    assert_eq!(shown(&stage.app, entity), all_of(LATE), "the files after a jump, in the same frame");
    let played = events(&mut stage.app, "Playback");
    let of_entity = |event: &String| event.contains(&format!("entity: {entity:?}"));
    assert!(played.len() >= 3 && played.iter().all(of_entity), "no other entity plays: {played:?}");
    assert!(stage.app.world().get::<Children>(entity).is_none(), "the entity itself is drawn: it has no children");
}

#[test]
fn the_files_that_are_read_are_those_of_the_time() {
    let mut stage = Stage::new();
    stage.gate.open();
    stage.app.insert_resource(StreamBudget { ahead_seconds: 0.0, ..default() });
    let entity = stage.spawn(Playback::paused_at(LATE));
    until(&mut stage.app, "a whole picture", |app| stream(app, entity).is_whole());
    rest(&mut stage.app);
    assert_eq!(shown(&stage.app, entity), all_of(LATE), "the files of {LATE} s");
    let once: BTreeMap<String, usize> =
        names(needed(LATE)).chain([ChunkTable::INDEX.to_owned()]).map(|name| (name, 1)).collect();
    assert_eq!(stage.gate.reads(), once, "the index and these files, by their names, and no others");
}

#[test]
fn no_time_passes_before_the_first_picture() {
    let mut stage = Stage::new();
    let entity = stage.spawn(Playback::default());
    // Time passes from the beginning, also in the frame in which the index arrives.
    let is_there = |app: &App| stream(app, entity).needed > 0;
    wait_until(&mut stage.app, "the index", is_there, |app| pass(app, 0.25));
    for _ in 0..4 {
        pass(&mut stage.app, 0.25);
    }
    assert_eq!(time(&stage.app, entity), 0.0, "playback waits at its beginning");
    assert_eq!(stream(&stage.app, entity).seconds, None, "nothing is drawn");
    let buffering = debug(&CaptureBuffering { entity, seconds: 0.0 });
    assert_eq!(said(&mut stage.app), [buffering], "it buffers, and has nothing to stall");
    stage.gate.open();
    until(&mut stage.app, "a picture", |app| stream(app, entity).is_coarse);
    assert_eq!(said(&mut stage.app), [debug(&CaptureBuffered { entity, seconds: 0.0 })], "the picture is there");
    pass(&mut stage.app, 0.25);
    assert_eq!(time(&stage.app, entity), 0.25, "time passes with the first picture");
}

#[test]
fn settings_decide_what_is_drawn_while_the_most_important_gaussians_are_missing() {
    assert!(!coarse(LATE).is_subset(&coarse(0.0)), "other files are needed later");
    for on_underrun in [OnUnderrun::Stall, OnUnderrun::Hold, OnUnderrun::Coarse] {
        let mut stage = Stage::new();
        let app = &mut stage.app;
        let capture = app.world().resource::<AssetServer>().load(INDEX);
        let settings = CaptureStreamSettings { on_underrun, ..default() };
        let entity = app.world_mut().spawn((GaussianCapture3d(capture), settings)).id();
        until(app, "the stream", |app| stream(app, entity).needed > 0);
        stage.gate.let_through(names(coarse(0.0)));
        until(app, "the first picture", |app| stream(app, entity).is_coarse);
        let [buffering, buffered] =
            [debug(&CaptureBuffering { entity, seconds: 0.0 }), debug(&CaptureBuffered { entity, seconds: 0.0 })];
        assert_eq!(said(app), [buffering, buffered], "{on_underrun:?}: the first picture");

        seek(app, entity, LATE);
        pass(app, 0.02);
        let then = time(app, entity);
        for _ in 0..5 {
            pass(app, 0.02);
        }
        let (now, state) = (time(app, entity), stream(app, entity));
        let stalls = on_underrun == OnUnderrun::Stall;
        let mut expected = vec![debug(&CaptureBuffering { entity, seconds: then })];
        expected.extend(stalls.then(|| debug(&CaptureStalled { entity, seconds: then })));
        assert_eq!(said(app), expected, "{on_underrun:?}: each message once");
        assert_eq!((state.is_coarse, now > then), (false, !stalls), "{on_underrun:?}: {then} s to {now} s, {state:?}");
        let seconds = if on_underrun == OnUnderrun::Coarse { now } else { 0.0 };
        assert_eq!(state.seconds, Some(seconds), "{on_underrun:?}: the time that is drawn");
        let there = (&coarse(0.0) & &needed(now)).len();
        assert!(there > 0, "{on_underrun:?}: files of both times are there");
        assert_eq!(state.resident, there, "{on_underrun:?}: the files of the playback's time that are there");

        stage.gate.open();
        until(app, "a coarse picture", |app| stream(app, entity).is_coarse);
        assert_eq!(said(app), [debug(&CaptureBuffered { entity, seconds: now })], "{on_underrun:?}: it has arrived");
        assert_eq!(stream(app, entity).seconds, Some(now), "{on_underrun:?}: the time of the playback is drawn");
        pass(app, 0.02);
        let later = time(app, entity);
        assert!(later > now, "{on_underrun:?}: time passes");
        assert_eq!(stream(app, entity).seconds, Some(later), "{on_underrun:?}: the picture has that time");
    }
}

/// Checks that a single stream is within its budget.
fn check_budget(app: &App, entity: Entity) {
    let (state, budget) = (stream(app, entity), app.world().resource::<StreamBudget>());
    assert!(state.gpu_bytes <= budget.gpu_bytes, "the memory on the GPU is kept: {state:?}, {budget:?}");
    assert!(state.requests <= budget.requests as usize, "the number of requests is kept: {state:?}, {budget:?}");
    let loaded: usize = captures(app).iter().map(|(_, capture)| capture.scene().len()).sum();
    let bytes = loaded as u64 * u64::from(SPLIT.table.gaussian_bytes);
    assert!(bytes <= budget.gpu_bytes, "{loaded} Gaussians are in memory, of {bytes} bytes: {budget:?}");
}

#[test]
fn a_stream_stays_within_its_budget_and_is_coarse_after_every_jump() {
    let all = gpu_bytes(&all_files());
    let middle = |stretch: u32| (stretch as f32 + 0.5) * SECONDS / SPLIT.table.stretches as f32;
    let most_coarse = (0..SPLIT.table.stretches).map(|stretch| gpu_bytes(&coarse(middle(stretch)))).max();
    // About a third, and the most important Gaussians of every moment.
    let bytes = most_coarse.expect("stretches").max(all / 3);
    assert!(bytes * 2 < all, "{bytes} of {all} bytes are not even half");
    let mut stage = Stage::new();
    stage.gate.open();
    stage.app.insert_resource(StreamBudget { gpu_bytes: bytes, requests: 2, ..default() });
    let entity = stage.spawn(Playback::default());
    // The last is just before the end of the loop: what is played next is all there.
    let jumps = (0..18).map(|jump| jump as f32 * 2.472 % SECONDS).chain([0.1, 3.7]);
    for seconds in jumps {
        seek(&mut stage.app, entity, seconds);
        for _ in 0..10 {
            pass(&mut stage.app, 0.02);
            check_budget(&stage.app, entity);
        }
        let rests = |app: &App| stream(app, entity).is_coarse && stream(app, entity).requests == 0;
        wait_until(&mut stage.app, &format!("a coarse picture after a jump to {seconds} s"), rests, |app| {
            pass(app, 0.0);
            check_budget(app, entity);
        });
    }
}

#[test]
fn a_budget_for_one_moment_is_enough_to_jump() {
    let [before, after] = [coarse(0.0), coarse(LATE)];
    let most = gpu_bytes(&before).max(gpu_bytes(&after));
    assert!(gpu_bytes(&(&before | &after)) > most, "there is no room for both");
    let mut stage = Stage::new();
    stage.gate.open();
    stage.app.insert_resource(StreamBudget { gpu_bytes: most, ..default() });
    let settings = CaptureStreamSettings { on_underrun: OnUnderrun::Stall, preload: vec![0.0] };
    let entity = stage.spawn((Playback::default(), settings));
    until(&mut stage.app, "the first picture", |app| stream(app, entity).is_coarse);
    seek(&mut stage.app, entity, LATE);
    until(&mut stage.app, "the picture after the jump", |app| {
        let state = stream(app, entity);
        state.is_coarse && state.seconds == Some(LATE)
    });
}

/// Updates a few times, without time passing.
fn rest(app: &mut App) {
    for _ in 0..5 {
        pass(app, 0.0);
    }
}

#[test]
fn a_capture_that_does_not_fit_the_budget_says_so_once() {
    let mut stage = Stage::new();
    let app = &mut stage.app;
    stage.gate.open();
    let needed = gpu_bytes(&coarse(0.0));
    app.insert_resource(StreamBudget { gpu_bytes: needed - 1, ..default() });
    let capture = app.world().resource::<AssetServer>().load(INDEX);
    let entity = app.world_mut().spawn(GaussianCapture3d(capture)).id();
    until(app, "the index", |app| stream(app, entity).needed > 0);
    rest(app);
    let error = CaptureFailure::OverBudget { path: INDEX.to_owned(), needed, limit: needed - 1 };
    assert_eq!(events(app, "CaptureFailed"), [debug(&CaptureFailed { entity, error })], "one message");
    assert_eq!(get::<CaptureState>(app, entity), CaptureState::Loading, "there is no picture");
    app.insert_resource(StreamBudget::default());
    until(app, "a picture", |app| get::<CaptureState>(app, entity) == CaptureState::Ready);
    assert_eq!(events(app, "CaptureFailed"), [""; 0], "no further message");
}

#[test]
fn an_index_without_a_folder_says_so_once() {
    let mut stage = Stage::new();
    let loaded = stage.spawn(Playback::default());
    until(&mut stage.app, "the index", |app| table(app, loaded).is_some());
    let app = &mut stage.app;
    let index = captures(app).get(&get::<GaussianCapture3d>(app, loaded).0).expect("the index is loaded").clone();
    let capture = app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(index);
    let entity = app.world_mut().spawn(GaussianCapture3d(capture)).id();
    rest(app);
    let failed = events(app, "CaptureFailed");
    let says = [format!("entity: {entity:?}"), "NotDrawable".to_owned(), "AssetServer::load".to_owned()];
    let is_said = |text: &String| says.iter().all(|words| text.contains(words));
    assert!(matches!(&failed[..], [text] if is_said(text)), "one message: {failed:?}");
}

#[test]
fn a_capture_whose_files_cannot_be_read_says_so_once() {
    let mut stage = Stage::new();
    stage.gate.open();
    stage.gate.fail(names(coarse(0.0)));
    let entity = stage.spawn(Playback::default());
    // After five tries, which take about four seconds.
    until(&mut stage.app, "a message", |app| {
        app.world().resource::<Observed>().0.iter().any(|event| event.starts_with("CaptureFailed"))
    });
    rest(&mut stage.app);
    let failed = events(&mut stage.app, "CaptureFailed");
    let says = [format!("entity: {entity:?}"), "Unreadable".to_owned(), INDEX.to_owned(), "chunk-0".to_owned()];
    let is_said = |text: &String| says.iter().all(|words| text.contains(words));
    assert!(matches!(&failed[..], [text] if is_said(text)), "one message: {failed:?}");
    let state = stream(&stage.app, entity);
    assert!(state.retries > 0 && !state.is_coarse, "files are asked for again: {state:?}");
}

#[test]
fn a_file_with_more_gaussians_than_its_index_says_is_not_drawn() {
    let bad = *coarse(0.0).first().expect("every moment has Gaussians");
    let mut files = SPLIT.files.clone();
    files.insert(name(bad), SPLIT.joined.clone());
    let mut stage = Stage::of(&files);
    stage.gate.open();
    let entity = stage.spawn(Playback::default());
    until(&mut stage.app, "a refused file", |app| stream(app, entity).failures > 0);
    let others = coarse(0.0).len() - 1;
    until(&mut stage.app, "the other files", |app| stream(app, entity).resident >= others);
    rest(&mut stage.app);
    let state = stream(&stage.app, entity);
    assert!(!state.is_coarse, "the file does not count as there: {state:?}");
    assert_eq!(state.seconds, None, "nothing is drawn: {state:?}");
}

#[test]
fn a_file_that_lands_after_its_capture_was_removed_is_ignored() {
    let mut stage = Stage::new();
    let entity = stage.spawn(Playback::default());
    until(&mut stage.app, "requests", |app| stream(app, entity).requests > 0 && stage.gate.reads().len() > 1);
    stage.app.world_mut().despawn(entity);
    for _ in 0..3 {
        pass(&mut stage.app, 0.0);
    }
    assert!(captures(&stage.app).is_empty(), "the index has been dropped");
    stage.gate.open();
    for _ in 0..50 {
        std::thread::sleep(Duration::from_millis(2));
        pass(&mut stage.app, 0.0);
        assert_eq!(captures(&stage.app).len(), 0, "nothing is loaded");
    }
    let again = stage.whole();
    assert_eq!(shown(&stage.app, again), all_of(0.0), "another entity has all files of its time");
    pass(&mut stage.app, 0.25);
    assert_eq!(time(&stage.app, again), 0.25, "it plays");
    stage.app.world_mut().despawn(again);
    until(&mut stage.app, "all files are dropped", |app| captures(app).is_empty());
}

#[test]
fn two_entities_of_one_capture_share_its_files() {
    let mut stage = Stage::new();
    stage.gate.open();
    let times = [0.2, LATE];
    let entities = times.map(|seconds| stage.spawn(Playback::paused_at(seconds)));
    let count = SPLIT.table.files.len() + 1;
    until(&mut stage.app, "both", |app| {
        entities.iter().all(|entity| stream(app, *entity).is_whole()) && captures(app).len() == count
    });
    for (entity, seconds) in entities.into_iter().zip(times) {
        assert_eq!(shown(&stage.app, entity), all_of(seconds), "its own time, {seconds} s");
    }
    seek(&mut stage.app, entities[1], 1.7);
    pass(&mut stage.app, 0.0);
    assert_eq!(shown(&stage.app, entities[0]), all_of(0.2), "the first stays");
    assert_eq!(shown(&stage.app, entities[1]), all_of(1.7), "the second has jumped");
    stage.app.world_mut().despawn(entities[0]);
    pass(&mut stage.app, 0.0);
    assert_eq!(shown(&stage.app, entities[1]), all_of(1.7), "the second stays");
    let once: BTreeMap<String, usize> = SPLIT.files.keys().map(|name| (name.clone(), 1)).collect();
    assert_eq!(stage.gate.reads(), once, "each file is read once");
}

#[test]
fn each_entity_has_a_message_about_its_first_picture() {
    let mut stage = Stage::new();
    stage.whole();
    said(&mut stage.app);
    let second = stage.spawn(Playback::paused_at(0.0));
    until(&mut stage.app, "the picture of the second", |app| stream(app, second).is_whole());
    rest(&mut stage.app);
    let buffered = debug(&CaptureBuffered { entity: second, seconds: 0.0 });
    assert_eq!(said(&mut stage.app), [buffered], "its Gaussians were there before it");
}

#[test]
fn a_file_that_cannot_be_read_is_tried_again() {
    let mut stage = Stage::new();
    stage.gate.fail_once(names(all_files()));
    let entity = stage.whole();
    let failures = stream(&stage.app, entity).failures;
    assert!(failures >= needed(0.0).len() as u64, "every failure is counted: {failures}");
    let reads = stage.gate.reads();
    for file in needed(0.0) {
        assert_eq!(reads.get(&name(file)), Some(&2), "file {file} is read again");
    }
    pass(&mut stage.app, 0.0);
    assert_eq!(get::<CaptureState>(&stage.app, entity), CaptureState::Ready, "the capture is ready");
    assert_eq!(events(&mut stage.app, "CaptureFailed"), [""; 0], "and has not failed");
    assert_eq!(shown(&stage.app, entity), all_of(0.0), "all files of its time are there");
}

#[test]
fn a_capture_whose_index_is_loaded_again_becomes_whole_again() {
    let mut stage = Stage::new();
    stage.gate.let_through(names(coarse(0.0)));
    let entity = stage.spawn(Playback::default());
    until(&mut stage.app, "a coarse picture", |app| stream(app, entity).is_coarse);
    let before = table(&stage.app, entity).expect("the index is loaded");
    stage.app.world().resource::<AssetServer>().reload(INDEX);
    until(&mut stage.app, "the index", |app| table(app, entity).is_some_and(|table| !Arc::ptr_eq(&table, &before)));
    stage.gate.open();
    until(&mut stage.app, "a whole picture", |app| stream(app, entity).is_whole());
    assert_eq!(shown(&stage.app, entity), all_of(0.0), "all files of its time are there");
    let reads = stage.gate.reads();
    for file in coarse(0.0) {
        assert_eq!(reads.get(&name(file)), Some(&2), "file {file} is read again: it may have changed with the index");
    }
    pass(&mut stage.app, 0.0);
    assert_eq!(get::<CaptureState>(&stage.app, entity), CaptureState::Ready, "the capture is ready");
    pass(&mut stage.app, 0.25);
    assert_eq!(time(&stage.app, entity), 0.25, "it plays");
}

#[test]
fn a_stream_ends_with_its_component() {
    let mut stage = Stage::new();
    let entity = stage.whole();
    stage.app.world_mut().entity_mut(entity).remove::<GaussianCapture3d>();
    pass(&mut stage.app, 0.0);
    assert!(stage.app.world().get::<CaptureStreamState>(entity).is_none(), "no state");
    until(&mut stage.app, "all files are dropped", |app| captures(app).is_empty());
}

#[test]
fn a_stream_ends_with_another_capture() {
    let mut stage = Stage::new();
    let app = &mut stage.app;
    stage.gate.let_through(names(coarse(0.0)));
    let index: Handle<GaussianCapture> = app.world().resource::<AssetServer>().load(INDEX);
    let settings = CaptureStreamSettings { on_underrun: OnUnderrun::Stall, ..default() };
    let entity = app.world_mut().spawn((GaussianCapture3d(index.clone()), settings)).id();
    until(app, "a coarse picture", |app| stream(app, entity).is_coarse);
    seek(app, entity, LATE);
    for _ in 0..3 {
        pass(app, 0.02);
    }
    let stalled = time(app, entity);
    let state = stream(app, entity);
    assert_eq!((state.seconds, state.is_coarse), (Some(0.0), false), "it stalls at {stalled} s: {state:?}");

    let other = playback_app::capture(app, 8.0, 4);
    app.world_mut().entity_mut(entity).insert(GaussianCapture3d(other));
    pass(app, 0.0);
    assert!(app.world().get::<CaptureStreamState>(entity).is_none(), "no state");
    until(app, "the files are dropped", |app| captures(app).len() == 2);
    assert_eq!(get::<CaptureState>(app, entity), CaptureState::Ready, "the other capture is ready");
    pass(app, 0.25);
    assert!(time(app, entity) > stalled, "its time passes: {stalled} s to {} s", time(app, entity));

    stage.gate.open();
    app.world_mut().entity_mut(entity).insert(GaussianCapture3d(index));
    until(app, "the stream again", |app| stream(app, entity).is_whole());
    let now = time(app, entity);
    assert_eq!(shown(app, entity), all_of(now), "all files of {now} s");
}

#[test]
fn rays_do_not_hit_a_capture_in_chunk_files() {
    let mut files = SPLIT.files.clone();
    files.insert(JOINED.to_owned(), SPLIT.joined.clone());
    let mut stage = Stage::of(&files);
    let streamed = stage.whole();
    let app = &mut stage.app;
    let joined: Handle<GaussianCapture> = app.world().resource::<AssetServer>().load(format!("gated://{JOINED}"));
    let whole = app.world_mut().spawn((GaussianCapture3d(joined.clone()), Playback::paused_at(0.0))).id();
    until(app, "the joined capture", |app| captures(app).contains(&joined));
    let capture = captures(app).get(&joined).expect("the joined capture is loaded");
    let means = capture.scene().iter().map(|gaussian| gaussian.mean_at(capture.time_at(0.0)));
    // Along -z through each Gaussian.
    let rays: Vec<Ray3d> = means.map(|mean| Ray3d::new(mean + Vec3::Z, Dir3::NEG_Z)).collect();
    let are_hit = move |picker: CapturePicker| {
        [streamed, whole].map(|entity| rays.iter().any(|ray| picker.cast_on(entity, *ray).is_some()))
    };
    let found = app.world_mut().run_system_once(are_hit).expect("the system runs");
    assert_eq!(found, [false, true], "the streamed entity is not hit, and the joined capture is");
}

#[test]
fn a_stream_follows_a_clock() {
    let mut stage = Stage::new();
    stage.gate.open();
    let mut clock = PlaybackClock::manual();
    clock.set(1.25);
    let clock = stage.app.world_mut().spawn(clock).id();
    let entity = stage.spawn(FollowsClock(clock));
    let is_at = |app: &App, seconds: f32| {
        let state = stream(app, entity);
        state.is_whole() && state.seconds == Some(seconds)
    };
    until(&mut stage.app, "the time of the clock", |app| is_at(app, 1.25));
    assert_eq!(shown(&stage.app, entity), all_of(1.25), "all files of that time");
    change::<PlaybackClock>(&mut stage.app, clock, |clock| clock.seek(3.125));
    pass(&mut stage.app, 0.25);
    assert_eq!(time(&stage.app, entity), 3.125, "it follows the jump at once");
    until(&mut stage.app, "the jump of the clock", |app| is_at(app, 3.125));
    assert_eq!(shown(&stage.app, entity), all_of(3.125), "all files after the jump");
}

/// An app with a renderer and a camera, and the folder of a capture in chunk files, with the joined capture beside
/// them.
struct Studio {
    app: App,
    folder: TempDir,
}

impl Studio {
    /// Returns a studio whose pictures are small; without a GPU, reports the skipped test and returns `None`.
    fn of(split: &Split) -> Option<Self> {
        let mut app = offscreen_app::app(UVec2::new(96, 72))?;
        let folder = tempfile::tempdir().expect("a temporary folder");
        let files = split.files.iter().map(|(name, bytes)| (name.as_str(), bytes));
        for (name, bytes) in files.chain([(JOINED, &split.joined), (ONE, &split.one)]) {
            fs::write(folder.path().join(name), bytes).expect("the folder can be written to");
        }
        spawn_camera(&mut app, Msaa::Off, synthetic_eye());
        Some(Self { app, folder })
    }

    /// Spawns an entity with the capture of a file of the folder, paused at a time, and waits for its picture.
    fn spawn(&mut self, file: &str, seconds: f32, bundle: impl Bundle) -> Entity {
        let capture = self.app.world().resource::<AssetServer>().load(self.folder.path().join(file));
        let player = (GaussianCapture3d(capture), Playback::paused_at(seconds), bundle);
        let entity = self.app.world_mut().spawn(player).id();
        testing::settle(&mut self.app).expect("the app draws without an error");
        let is_streamed = self.app.world().get::<CaptureStreamState>(entity).is_some();
        assert_eq!(is_streamed, file != JOINED, "the capture of {file} is streamed, or is not");
        entity
    }

    /// Seeks with these entities to these times, waits until each is drawn at its time with all Gaussians, and returns
    /// the picture.
    fn shot(&mut self, players: &[(Entity, f32)]) -> RgbaImage {
        for (entity, seconds) in players {
            seek(&mut self.app, *entity, *seconds);
        }
        run_frames(&mut self.app, 1);
        let is_there = |app: &App| players.iter().all(|(entity, seconds)| is_drawn_at(app, *entity, *seconds));
        wait_until(&mut self.app, &format!("all of {players:?}"), is_there, |app| run_frames(app, 1));
        picture(&mut self.app, 0.0)
    }

    /// Returns the pictures of a capture of the folder, paused at each of these times, and removes it.
    fn pictures(&mut self, file: &str, times: &[f32]) -> Vec<RgbaImage> {
        let entity = self.spawn(file, 0.0, ());
        let pictures = times.iter().map(|seconds| self.shot(&[(entity, *seconds)])).collect();
        self.app.world_mut().despawn(entity);
        pictures
    }
}

/// Returns whether an entity is drawn at a time with all Gaussians. A capture that is not streamed is.
fn is_drawn_at(app: &App, entity: Entity, seconds: f32) -> bool {
    let state = app.world().get::<CaptureStreamState>(entity);
    state.is_none_or(|state| state.is_whole() && state.seconds == Some(seconds))
}

/// Checks that a picture of a stream is that of the joined capture, bit for bit.
fn check_picture(streamed: &RgbaImage, whole: &RgbaImage, what: &str) {
    let bright = whole.pixels().filter(|pixel| pixel.0[..3].iter().any(|channel| *channel > 64)).count();
    assert!(bright > 100, "{what}: the capture is visible: {bright} bright pixels");
    let apart = |(a, b): (&Rgba<u8>, &Rgba<u8>)| a.0.iter().zip(b.0).map(|(a, b)| a.abs_diff(b)).max();
    let apart: Vec<u8> = streamed.pixels().zip(whole.pixels()).filter_map(apart).filter(|by| *by > 0).collect();
    let (count, most) = (apart.len(), apart.iter().max().copied().unwrap_or_default());
    assert_eq!(count, 0, "{what}: {count} pixels differ, by at most {most} / 255");
}

#[test]
fn a_whole_stream_has_the_picture_of_the_joined_capture() {
    check_pictures(&SPLIT);
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it"]
fn a_whole_stream_of_packed_files_has_the_picture_of_the_package() {
    assert!(PACKED.table.files.len() >= 4, "several runs: {:?}", PACKED.table);
    check_pictures(&PACKED);
}

/// Checks that a whole stream has the pictures of the joined capture.
fn check_pictures(split: &Split) {
    let Some(mut studio) = Studio::of(split) else { return };
    // The beginning, the end, the boundary of two stretches, and two others.
    let times = [0.0, 1.3, 2.0, 2.77, SECONDS];
    let whole = studio.pictures(JOINED, &times);
    for file in [ChunkTable::INDEX, ONE] {
        let streamed = studio.pictures(file, &times);
        for ((seconds, streamed), whole) in times.into_iter().zip(&streamed).zip(&whole) {
            check_picture(streamed, whole, &format!("{file} at {seconds} s"));
        }
    }
    assert_ne!(whole[0], whole[1], "the capture moves");
}

#[test]
fn pages_are_used_again_within_a_small_budget() {
    let Some(mut studio) = Studio::of(&SPLIT) else { return };
    // In six stretches. At most of these times all Gaussians fill the budget.
    let times = [0.2, LATE, 1.3, 2.77, 0.7, 3.2, 0.2, LATE];
    let most = times.into_iter().map(|seconds| gpu_bytes(&needed(seconds))).max().expect("times");
    let files: BTreeSet<usize> = times.into_iter().flat_map(needed).collect();
    assert!(most < gpu_bytes(&files), "{most} bytes have no room for all files: {files:?}");
    // Nothing is loaded ahead.
    let budget = |gpu_bytes: u64| StreamBudget { gpu_bytes, ahead_seconds: 0.0, ..default() };
    studio.app.insert_resource(budget(most));
    let entity = studio.spawn(ChunkTable::INDEX, 0.0, ());
    let mut streamed = Vec::new();
    for (number, seconds) in times.into_iter().enumerate() {
        streamed.push(studio.shot(&[(entity, seconds)]));
        let state = stream(&studio.app, entity);
        assert!(state.gpu_bytes <= most, "{seconds} s: the budget of {most} bytes is kept: {state:?}");
        if number % 2 == 1 {
            // With less room for a moment, the least important files are given up, too: most pages are written again.
            let least = gpu_bytes(&coarse(seconds));
            studio.app.insert_resource(budget(least));
            run_frames(&mut studio.app, 1);
            let state = stream(&studio.app, entity);
            let is_coarse = state.is_coarse && !state.is_whole();
            assert!(is_coarse && state.gpu_bytes <= least, "{seconds} s: the first layer stays: {state:?}, {least}");
            studio.app.insert_resource(budget(most));
        }
    }
    studio.app.world_mut().despawn(entity);
    let whole = studio.pictures(JOINED, &times);
    for ((number, seconds), (streamed, whole)) in times.into_iter().enumerate().zip(streamed.iter().zip(&whole)) {
        check_picture(streamed, whole, &format!("jump {number}, to {seconds} s"));
    }
}

#[test]
fn files_that_the_game_has_loaded_itself_are_drawn() {
    let Some(mut studio) = Studio::of(&SPLIT) else { return };
    // The app is ready for updates.
    testing::settle(&mut studio.app).expect("the app draws without an error");
    let server = studio.app.world().resource::<AssetServer>().clone();
    // As load_folder does.
    let load = |file: usize| server.load(studio.folder.path().join(name(file)));
    let loaded: Vec<Handle<GaussianCapture>> = needed(1.3).into_iter().map(load).collect();
    let are_there = |app: &App| loaded.iter().all(|handle| captures(app).contains(handle));
    wait_until(&mut studio.app, "the files", are_there, |app| run_frames(app, 1));
    testing::settle(&mut studio.app).expect("the app draws without an error");
    let entity = studio.spawn(ChunkTable::INDEX, 1.3, ());
    let streamed = studio.shot(&[(entity, 1.3)]);
    studio.app.world_mut().despawn(entity);
    let whole = studio.pictures(JOINED, &[1.3]);
    check_picture(&streamed, &whole[0], "files that were loaded before");
}

#[test]
fn entities_of_one_stream_show_their_own_times() {
    let Some(mut studio) = Studio::of(&SPLIT) else { return };
    let times = [[0.3, LATE], [LATE, 0.3], [LATE, LATE]];
    let [streamed, whole] = [ChunkTable::INDEX, JOINED].map(|file| {
        let entities = [-0.8, 0.8].map(|x| {
            let place = Transform::from_xyz(x, 0.0, 0.0).with_scale(Vec3::splat(0.6));
            studio.spawn(file, 0.0, place)
        });
        let [left, right] = entities;
        let pictures = times.map(|[first, second]| studio.shot(&[(left, first), (right, second)]));
        for entity in entities {
            studio.app.world_mut().despawn(entity);
        }
        pictures
    });
    for ((times, streamed), whole) in times.iter().zip(&streamed).zip(&whole) {
        check_picture(streamed, whole, &format!("at {times:?} s"));
    }
    assert!(whole[0] != whole[1] && whole[1] != whole[2], "each time has another picture");
}

#[test]
fn a_streamed_capture_without_a_filter_setting_is_drawn_the_same() {
    let Some(mut studio) = Studio::of(&SPLIT) else { return };
    let entity = studio.spawn(ChunkTable::INDEX, 0.0, ());
    let filtered = studio.shot(&[(entity, 1.3)]);
    studio.app.world_mut().entity_mut(entity).insert(CaptureSettings { filter: false, ..default() });
    let unfiltered = studio.shot(&[(entity, 1.3)]);
    check_picture(&unfiltered, &filtered, "without the setting");
}

#[test]
fn a_streamed_capture_is_drawn_with_the_settings_of_its_entity() {
    let Some(mut studio) = Studio::of(&SPLIT) else { return };
    let tint = LinearRgba::rgb(1.0, 0.8, 0.6);
    let looks = (CaptureSettings { opacity: 0.6, tint, exposure: 0.5, ..default() }, ClipFade(0.9));
    let [streamed, whole] = [ChunkTable::INDEX, JOINED].map(|file| {
        let entity = studio.spawn(file, 0.0, ());
        let plain = studio.shot(&[(entity, 1.3)]);
        studio.app.world_mut().entity_mut(entity).insert(looks);
        let changed = studio.shot(&[(entity, 1.3)]);
        studio.app.world_mut().entity_mut(entity).insert(RenderLayers::layer(3));
        let hidden = studio.shot(&[(entity, 1.3)]);
        assert!(hidden.pixels().all(|pixel| pixel.0[..3] == [0; 3]), "{file}: the camera does not see its layer");
        studio.app.world_mut().despawn(entity);
        assert!(plain != changed, "{file}: the settings change the picture");
        changed
    });
    check_picture(&streamed, &whole, "with settings, and faded");
}

#[test]
fn a_stream_is_loaded_again_after_its_device_was_lost() {
    let Some(mut studio) = Studio::of(&SPLIT) else { return };
    let entity = studio.spawn(ChunkTable::INDEX, 1.3, ());
    let app = &mut studio.app;
    let index = get::<GaussianCapture3d>(app, entity).0.id();
    let files = |app: &App| -> BTreeSet<AssetId<GaussianCapture>> {
        captures(app).iter().map(|(id, _)| id).filter(|id| *id != index).collect()
    };
    let whole = picture(app, 0.0);
    let before = files(app);
    assert!(stream(app, entity).is_whole() && !before.is_empty(), "the picture is whole");
    // Bevy's recovery inserts a device, too.
    let device = app.world().resource::<RenderDevice>().clone();
    app.insert_resource(device);
    run_frames(app, 1);
    assert_eq!(stream(app, entity).seconds, None, "nothing is drawn of what was on the old device");
    let is_there = |app: &App| stream(app, entity).is_whole();
    wait_until(app, "all files again", is_there, |app| run_frames(app, 1));
    let after = files(app);
    assert!(!after.is_empty() && before.is_disjoint(&after), "they are other assets");
    assert!(picture(app, 0.0) == whole, "the same picture");
}
