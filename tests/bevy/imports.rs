//! Captures of other makes as assets in Bevy apps.
//!
//! In: files of every format that is exported, and files of other makes. Out: proof that `assets.load` shows what
//! `codec::load` reads, with the settings given; that other files of a folder are found; that failures have a message;
//! that the example `play` shows captures that are dropped on its window. Needs neither a GPU nor a window.

#[path = "../../examples/play/drop.rs"]
mod drop;

use crate::support::asset_app::{app, scene, wait};
use crate::support::data::data;
use crate::support::waiting::wait_until;
use bevy::asset::UnapprovedPathMode;
use bevy::prelude::*;
use bevy::window::FileDragAndDrop;
use bevy_gs4d::asset::{CaptureLoaderSettings, CaptureState, GaussianCapture};
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::internal::codec::{EXPORTS, Export, Exporter};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{FilterKind, UpAxis};
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugins};
use drop::drop_file;
use std::fs;
use std::path::{Path, PathBuf};

/// Loads a capture with these settings and waits until it is ready or has failed.
fn loaded(app: &mut App, name: &str, options: &ReadOptions) -> (Handle<GaussianCapture>, CaptureState) {
    let options = options.clone();
    let settings = move |settings: &mut CaptureLoaderSettings| settings.read.clone_from(&options);
    let capture = app.world().resource::<AssetServer>().load_builder().with_settings(settings).load(name.to_owned());
    let state = wait(app, name, &capture);
    (capture, state)
}

/// Writes a file of the format for each time, and returns the name of each.
fn export(folder: &Path, id: &str, times: &[f32]) -> Vec<String> {
    let synthetic = synthesize(&SynthSettings { count: 60, ..SynthSettings::default() });
    let format = Export::of_id(id).expect("a format");
    let exporter = Exporter::new(synthetic, format, 30.0).expect("the scene can be exported");
    let name = |frame: usize| format!("{id}_{frame:02}.{}", format.extension);
    for (frame, time) in times.iter().enumerate() {
        let mut bytes = Vec::new();
        exporter.write(*time, &mut bytes).expect("memory can be written to");
        fs::write(folder.join(name(frame)), bytes).expect("the folder can be written to");
    }
    (0..times.len()).map(name).collect()
}

#[test]
fn every_exported_format_that_is_read_loads_as_an_asset() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut app = app(folder.path());
    let options = ReadOptions { up: Some(UpAxis::PosX), marginal_cutoff: Some(0.25), ..ReadOptions::default() };
    let mut tried = Vec::new();
    for format in EXPORTS {
        let name = export(folder.path(), format.id, &[0.4]).remove(0);
        let Ok(expected) = codec::load(&folder.path().join(&name), &options) else { continue };
        let (capture, state) = loaded(&mut app, &name, &options);
        assert_eq!(state, CaptureState::Ready, "{name} is loaded");
        let found = scene(&app, &capture);
        assert_eq!(*found, expected.into_runtime().expect("it can be drawn"), "{name}: the scene of the file");
        assert_eq!(
            (found.playback.up, found.trained_with.marginal_cutoff),
            (UpAxis::PosX, 0.25),
            "{name}: the settings"
        );
        tried.push(format.id);
    }
    assert!(tried.contains(&"ply") && tried.len() > 3, "several formats are written and read: {tried:?}");
}

#[test]
fn the_contents_of_a_file_decide_its_format() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let name = export(folder.path(), "ply", &[0.5]).remove(0);
    fs::rename(folder.path().join(name), folder.path().join("scan.capture")).expect("the folder can be written to");
    let mut app = app(folder.path());
    let (capture, state) = loaded(&mut app, "scan.capture", &ReadOptions::default());
    assert_eq!(state, CaptureState::Ready, "it is loaded");
    assert!(!scene(&app, &capture).is_empty(), "the PLY is read in spite of its name");
}

#[test]
fn numbered_files_load_as_a_sequence() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let names = export(folder.path(), "ply", &[0.2, 0.5, 0.8]);
    let mut app = app(folder.path());
    let options = ReadOptions { sequence: true, fps: Some(2.0), ..ReadOptions::default() };
    let (capture, state) = loaded(&mut app, &names[0], &options);
    assert_eq!(state, CaptureState::Ready, "it is loaded");
    let found = scene(&app, &capture);
    let filter = found.filter.as_ref().expect("each frame has a window");
    assert_eq!((filter.kind, filter.segments), (FilterKind::Window, 3), "three frames");
    assert_eq!(found.playback.duration_seconds, 1.5, "at two frames a second");
    let expected = codec::load(folder.path(), &options).expect("the folder is a sequence");
    assert_eq!(*found, expected.into_runtime().expect("it can be drawn"), "the same as the folder");
}

#[test]
fn files_that_a_capture_names_are_found_beside_it() {
    let Some(data) = data() else { return };
    let folder = data.join("formats/playcanvas/playbot/6_0");
    let mut app = app(&folder);
    let (capture, state) = loaded(&mut app, "meta.json", &ReadOptions::default());
    assert_eq!(state, CaptureState::Ready, "it is loaded");
    let expected = codec::load(&folder.join("meta.json"), &ReadOptions::default()).expect("a readable SOG");
    assert_eq!(*scene(&app, &capture), expected.into_runtime().expect("it can be drawn"), "the scene of the folder");
}

#[test]
fn a_file_that_is_no_capture_fails_with_the_reason() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let points = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                  end_header\n0 0 0\n";
    fs::write(folder.path().join("points.ply"), points).expect("the folder can be written to");
    fs::write(folder.path().join("text.spz"), "no capture").expect("the folder can be written to");
    let mut app = app(folder.path());
    for (name, part) in [("points.ply", "points"), ("text.spz", "neither")] {
        let (_, state) = loaded(&mut app, name, &ReadOptions::default());
        let CaptureState::Failed(failure) = state else { panic!("{name} is no capture") };
        let message = failure.to_string();
        assert!(message.contains(name) && message.contains(part), "the message says why: {message}");
    }
}

/// Files of other makes with a layout of their own, in the folder that `GS4D_DATA` names.
const OF_OTHER_MAKES: [&str; 9] = [
    "formats/playcanvas/biker.compressed.ply",
    "formats/playcanvas/playbot/6_0",
    "formats/splat-transform/minimal-v3.spz",
    "formats/splat-transform/cloud_sh3.glb",
    "formats/sogst/arc_d2_sh0_mono.ply",
    "formats/sog4d/swarm.ply",
    "formats/sog4d/swarm_q16.sog4d",
    "formats/tsog/made_here_discrete5.tsog",
    "splatv/coffeeshort2.splatv",
];

#[test]
fn captures_of_every_format_are_shown_when_they_are_dropped_on_the_window() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let frames = folder.path().join("frames");
    fs::create_dir(&frames).expect("the folder can be written to");
    export(&frames, "ply", &[0.2, 0.8]);
    let exported = EXPORTS.iter().filter(|format| !format.id.starts_with("usd") && format.id != "4dgs");
    let exported = exported.map(|format| folder.path().join(export(folder.path(), format.id, &[0.4]).remove(0)));
    let mut files: Vec<PathBuf> = exported.chain([frames]).collect();
    files.extend(data().into_iter().flat_map(|data| OF_OTHER_MAKES.map(|name| data.join(name))));

    let mut app = App::new();
    let assets = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
    app.add_plugins((MinimalPlugins, assets, GaussianCapturePlugins)).add_message::<FileDragAndDrop>();
    app.add_systems(Update, drop_file);
    let player = app.world_mut().spawn(GaussianCapture3d(Handle::default())).id();
    for path in files {
        let file = path.display().to_string();
        let window = Entity::PLACEHOLDER;
        app.world_mut().write_message(FileDragAndDrop::DroppedFile { window, path_buf: path });
        app.update();
        let dropped = app.world().get::<GaussianCapture3d>(player).expect("the player").0.clone();
        let state = |app: &App| app.world().get::<CaptureState>(player).expect("every capture has a state").clone();
        let is_known = |app: &App| {
            let is_loaded = app.world().resource::<Assets<GaussianCapture>>().contains(&dropped);
            is_loaded && state(app) == CaptureState::Ready || matches!(state(app), CaptureState::Failed(_))
        };
        wait_until(&mut app, &file, is_known, App::update);
        assert_eq!(state(&app), CaptureState::Ready, "{file} is shown");
        assert!(!scene(&app, &dropped).is_empty(), "{file}: it has Gaussians");
    }
}
