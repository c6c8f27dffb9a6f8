//! Captures in Bevy's scene notation and in scene files.
//!
//! In: a small package in the folder of a game's assets, scenes in `bsn!`, a world that is saved. Out: proof that
//! captures of a scene load and play, and that a scene file keeps their components. Needs neither a GPU nor a window.

use crate::support::playback_app::{self, get, pass};
use crate::support::waiting::wait_until;
use bevy::camera::visibility::VisibilityClass;
use bevy::prelude::*;
use bevy::scene::ScenePlugin;
use bevy::world_serialization::WorldSerializationPlugin;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::offline;
use bevy_gs4d::pbr::CastsShadows;
use bevy_gs4d::playback::{FollowsClock, Markers, Repeat, TimelinePlayer, TimelineTrack};
use bevy_gs4d::prelude::*;
use bevy_gs4d::stereo::{Eye, SideBySide, StereoRig};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Returns a folder with `capture.gs4d`, of two seconds.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("capture.gs4d");
    offline::work::save(&path, &playback_app::scene(2.0, 4), &WriteSettings { level: 1 })
        .expect("the folder can be written to");
    folder
}

/// Returns an app with both kinds of scenes, whose assets are in `folder`.
fn app(folder: &Path) -> App {
    let mut app = playback_app::app(folder.to_str().expect("temporary folders have plain names"));
    app.add_plugins((ScenePlugin, WorldSerializationPlugin));
    app
}

/// Updates, without time, until `count` captures are ready.
fn wait_for_captures(app: &mut App, count: usize) {
    let are_ready = |app: &App| {
        let states = app.world().try_query::<&CaptureState>();
        let ready = |state: &&CaptureState| **state == CaptureState::Ready;
        states.is_some_and(|mut states| states.iter(app.world()).filter(ready).count() == count)
    };
    wait_until(app, "loading", are_ready, |app| pass(app, 0.0));
}

fn children(app: &App, parent: Entity) -> Vec<Entity> {
    app.world().get::<Children>(parent).expect("the entity has children").to_vec()
}

#[test]
fn captures_of_a_bsn_scene_load_and_play() {
    let folder = folder();
    let mut app = app(folder.path());
    let scene = bsn! {
        #Clock
        PlaybackClock
        Children [
            (GaussianCapture3d("capture.gs4d") Upright Playback { speed: 0.5, repeat: { Repeat::Once } }),
            (GaussianCapture3d("capture.gs4d") FollowsClock(#Clock)),
        ]
    };
    let stage = app.world_mut().spawn_scene(scene).expect("a scene without other scenes").id();
    wait_for_captures(&mut app, 2);
    let captures = children(&app, stage);
    assert_eq!(get::<FollowsClock>(&app, captures[1]), FollowsClock(stage), "the name is the entity of the clock");
    pass(&mut app, 0.5);
    let times = [captures[0], captures[1]].map(|capture| get::<Playback>(&app, capture).time);
    assert_eq!(times, [0.25, 0.5], "one plays at half speed, the other at that of the clock");
    assert_eq!(get::<Playback>(&app, captures[0]).repeat, Repeat::Once, "fields of enums can be set");
}

#[test]
fn timelines_and_eyes_can_be_written_in_a_bsn_scene() {
    let folder = folder();
    let clip = "(tracks: [(name: \"left\", clips: [(capture: \"capture.gs4d\", start: 0.0, in: 0.0, out: 2.0)])])";
    fs::write(folder.path().join("demo.timeline.ron"), clip).expect("the folder can be written to");
    let mut app = app(folder.path());
    let timeline = bsn! { TimelinePlayer("demo.timeline.ron") Children [ TimelineTrack("left") ] };
    let player = app.world_mut().spawn_scene(timeline).expect("a scene without other scenes").id();
    wait_for_captures(&mut app, 1);
    let track = children(&app, player)[0];
    assert_eq!(get::<FollowsClock>(&app, track), FollowsClock(player), "the track of the scene plays the timeline");

    let head = bsn! { StereoRig Children [ (Eye::Left SideBySide), (Eye::Right SideBySide) ] };
    let head = app.world_mut().spawn_scene(head).expect("a scene without other scenes").id();
    let eyes: Vec<Eye> = children(&app, head).into_iter().map(|eye| get(&app, eye)).collect();
    assert_eq!(eyes, Eye::BOTH, "both eyes");
}

/// Returns the text of a scene file with these entities.
fn saved(app: &App, entities: impl IntoIterator<Item = Entity>) -> String {
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let world = DynamicWorldBuilder::from_world(app.world(), &registry)
        // It has identifiers of types, which differ from program to program.
        .deny_component::<VisibilityClass>()
        .extract_entities(entities.into_iter())
        .build();
    world.serialize(&registry).expect("all other components can be written")
}

#[test]
fn a_scene_file_keeps_the_components_of_captures() {
    let folder = folder();
    let mut app = app(folder.path());
    let handle = app.world().resource::<AssetServer>().load("capture.gs4d");
    let clock = app.world_mut().spawn(PlaybackClock { seconds: 0.5, ..PlaybackClock::manual() }).id();
    let playback = Playback { speed: -0.5, end: 1.5, ..Playback::paused_at(0.75) };
    let settings = CaptureSettings { opacity: 0.25, finest_level: 2, ..CaptureSettings::default() };
    let steps = Markers::new([(0.4, "left foot"), (0.9, "right foot")]);
    let shadows = CastsShadows { bias: 3.0, ..CastsShadows::default() };
    let parts = (GaussianCapture3d(handle.clone()), Upright, playback, settings, steps.clone(), shadows);
    let dancer = app.world_mut().spawn(parts).id();
    let follower = app.world_mut().spawn((GaussianCapture3d(handle), FollowsClock(clock))).id();
    wait_for_captures(&mut app, 2);
    let text = saved(&app, [clock, dancer, follower]);
    for path in ["bevy_gs4d::GaussianCapture3d", "bevy_gs4d::playback::Playback", "bevy_gs4d::render::CaptureSettings"]
    {
        assert!(text.contains(&format!("{path:?}")), "the file names {path} by its public path: {text}");
    }
    let turned = get::<Transform>(&app, dancer);

    fs::write(folder.path().join("saved.scn.ron"), &text).expect("the folder can be written to");
    let mut other = self::app(folder.path());
    let world = other.world().resource::<AssetServer>().load("saved.scn.ron");
    other.world_mut().spawn(DynamicWorldRoot(world));
    // The file says that its captures are ready, which they are once they have been loaded here, too.
    let is_loaded = |app: &App| !app.world().resource::<Assets<GaussianCapture>>().is_empty();
    wait_until(&mut other, "the capture of the scene", is_loaded, |app| pass(app, 0.0));
    pass(&mut other, 0.0);
    wait_for_captures(&mut other, 2);
    let mut dancers = other.world_mut().query_filtered::<Entity, With<Upright>>();
    let dancer = dancers.single(other.world()).expect("one capture stands upright");
    assert_eq!(get::<Playback>(&other, dancer), playback, "the playback");
    assert_eq!(get::<CaptureSettings>(&other, dancer), settings, "the settings");
    assert_eq!(get::<Markers>(&other, dancer), steps, "the markers");
    assert_eq!(get::<CastsShadows>(&other, dancer), shadows, "the shadows");
    assert_eq!(get::<Transform>(&other, dancer), turned, "the capture is not turned upright a second time");
    let path = get::<GaussianCapture3d>(&other, dancer).0.path().map(ToString::to_string);
    assert_eq!(path.as_deref(), Some("capture.gs4d"), "the file of the capture");
    let mut followers = other.world_mut().query::<&FollowsClock>();
    let FollowsClock(clock) = *followers.single(other.world()).expect("one capture follows a clock");
    assert_eq!(get::<PlaybackClock>(&other, clock).seconds, 0.5, "the clock of the loaded world");
}
