//! Captures in one file of an index and its chunk files, of which Bevy reads parts.
//!
//! In: a file that `gs4d split` has written, on a disk and on servers that send parts, over TLS or not, fail now and
//! then, or send none. Out: proof that the parts that are played are read, and no others, through few connections; that
//! failures are made good; that without parts all of the file is played; that servers are trusted as the system says.
//! `stream.rs` has the pictures.

use crate::support::range_server::{Answers, RangeServer};
use crate::support::split::SPLIT;
use crate::support::waiting::wait_until;
use bevy::asset::LoadState;
use bevy::prelude::*;
use bevy_gs4d::codec::package::Following;
use bevy_gs4d::codec::stream::StreamSchedule;
use bevy_gs4d::prelude::*;
use bevy_gs4d::stream::{CaptureStreamState, HttpRangesPlugin, StreamBudget};
use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;
use std::process::Command;
use std::{env, fs};

/// Returns an app without a renderer that loads nothing ahead.
fn app(folder: &str) -> App {
    let mut app = App::new();
    let assets = AssetPlugin { file_path: folder.to_owned(), ..default() };
    app.add_plugins((HttpRangesPlugin, MinimalPlugins, assets, GaussianCapturePlugins));
    app.insert_resource(StreamBudget { ahead_seconds: 0.0, ..default() });
    app
}

/// Spawns the capture of a path, at rest at a time.
fn spawn(app: &mut App, path: String, seconds: f32) -> Entity {
    let capture = app.world().resource::<AssetServer>().load(path);
    app.world_mut().spawn((GaussianCapture3d(capture), Playback::paused_at(seconds))).id()
}

fn state(app: &App, entity: Entity) -> CaptureStreamState {
    app.world().get(entity).cloned().unwrap_or_default()
}

fn until_whole(app: &mut App, entity: Entity) {
    wait_until(app, "all Gaussians", |app| state(app, entity).is_whole(), App::update);
}

/// Returns where the files of a time are in the one file.
fn parts(seconds: f64) -> BTreeSet<(usize, usize)> {
    let Following::From(first) = Following::of(&SPLIT.one) else { panic!("chunk files follow the index") };
    let mut table = (*SPLIT.table).clone();
    table.first_byte = Some(first);
    let range = |file| table.range(file).map(|Range { start, end }| (start as usize, end as usize));
    let schedule = StreamSchedule::new(SPLIT.table.clone(), 4.0);
    schedule.needed_at(seconds).filter_map(range).collect()
}

#[test]
fn parts_of_a_file_of_a_disk_are_streamed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("take.gs4d"), &SPLIT.one).expect("the folder can be written to");
    let mut app = app(&folder.path().to_string_lossy());
    let entity = spawn(&mut app, "take.gs4d".to_owned(), 0.0);
    until_whole(&mut app, entity);
    let whole = state(&app, entity);
    assert_eq!((whole.needed, whole.resident, whole.failures), (parts(0.0).len(), parts(0.0).len(), 0), "{whole:?}");
    assert_eq!(*app.world().get::<CaptureState>(entity).expect("a state"), CaptureState::Ready, "it is ready");

    // A part that is damaged: the file has been replaced by another in the meantime.
    let mut damaged = SPLIT.one.clone();
    let (start, end) = *parts(3.9).difference(&parts(0.0)).next().expect("a file of another time");
    damaged[start..end].fill(0);
    fs::write(folder.path().join("take.gs4d"), damaged).expect("the folder can be written to");
    app.world_mut().get_mut::<Playback>(entity).expect("a playback").seek(3.9);
    wait_until(&mut app, "a failure", |app| state(app, entity).failures > 0, App::update);
    fs::write(folder.path().join("take.gs4d"), &SPLIT.one).expect("the folder can be written to");
    until_whole(&mut app, entity);
}

#[test]
fn a_server_is_asked_for_the_parts_that_are_played() {
    for fail_every in [0, 3] {
        let server = RangeServer::new(SPLIT.one.clone(), Answers { fail_every, ..Answers::default() });
        let mut app = app("assets");
        let entity = spawn(&mut app, format!("http://{}", server.address), 2.2);
        until_whole(&mut app, entity);
        let asked: Vec<(usize, usize)> = server.asked().into_iter().map(|asked| asked.expect("a part")).collect();
        let (beginning, files): (Vec<_>, Vec<_>) = asked.iter().partition(|(first, _)| *first == 0);
        assert!(!beginning.is_empty(), "the beginning of the file has the index: {asked:?}");
        assert_eq!(files.iter().copied().collect::<BTreeSet<_>>(), parts(2.2), "the parts of the time, and no others");
        assert_eq!(state(&app, entity).failures > 0, fail_every > 0, "requests that failed were made again: {asked:?}");
        assert!(fail_every > 0 || files.len() == parts(2.2).len(), "each part once: {asked:?}");
        let connections = server.connections();
        assert!(connections <= MOST_CONNECTIONS, "{connections} connections for {} requests", asked.len());
    }
}

#[test]
fn the_capture_of_a_server_without_parts_is_played_whole() {
    let server = RangeServer::new(SPLIT.one.clone(), Answers { no_parts: true, ..Answers::default() });
    let mut app = app("assets");
    let entity = spawn(&mut app, format!("http://{}", server.address), 0.0);
    let is_ready = |app: &App| app.world().get::<CaptureState>(entity) == Some(&CaptureState::Ready);
    wait_until(&mut app, "the capture", is_ready, App::update);
    let handle = app.world().get::<GaussianCapture3d>(entity).expect("a capture").0.clone();
    let capture = app.world().resource::<Assets<GaussianCapture>>().get(&handle).expect("it is loaded");
    let all: u64 = SPLIT.table.files.iter().map(|file| file.gaussians).sum();
    assert_eq!((capture.scene().len() as u64, &capture.scene().chunks), (all, &None), "the whole capture");
    assert_eq!(server.asked().len(), 1, "the file is sent once: {:?}", server.asked());
    assert!(app.world().get::<CaptureStreamState>(entity).is_none(), "nothing is streamed");
}

/// Those of all requests at a time, and one that may not have ended before the next begins.
const MOST_CONNECTIONS: usize = 5;
/// The address of the server of [`a_client_of_tls`], which runs it in a process of its own.
const TLS_SERVER: &str = "GS4D_TEST_TLS_SERVER";
const LOADED: &str = "loaded in parts";

#[test]
#[cfg(target_os = "linux")]
fn servers_of_https_are_trusted_by_the_certificates_of_the_system() {
    let (server, certificate) = RangeServer::over_tls(SPLIT.one.clone(), Answers::default());
    let (_, other) = RangeServer::over_tls(Vec::new(), Answers::default());
    let folder = tempfile::tempdir().expect("a temporary folder");
    let client = |certificates: &Path| {
        let output = Command::new(env::current_exe().expect("the path of the tests"))
            .args(["--exact", "one_file::a_client_of_tls", "--ignored", "--nocapture"])
            .env(TLS_SERVER, &server.address)
            // Where the certificates of the system are.
            .env("SSL_CERT_FILE", certificates)
            .env_remove("SSL_CERT_DIR")
            .output()
            .expect("a client");
        assert!(output.status.success(), "the client failed: {output:?}");
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let trusted = |name: &str, pem: &str| {
        let path = folder.path().join(name);
        fs::write(&path, pem).expect("the folder can be written to");
        client(&path)
    };
    let refused = trusted("other.pem", &other);
    assert!(
        refused.contains("invalid peer certificate") && refused.contains("certificates of the system"),
        "a server without trust: {refused}"
    );
    assert!(!refused.contains(LOADED), "it is not loaded from: {refused}");
    assert_eq!(server.asked(), [], "which is not asked for anything");
    let loaded = trusted("own.pem", &certificate);
    assert!(loaded.contains(LOADED), "a server that is trusted: {loaded}");
    assert!(server.asked().iter().all(Option::is_some), "which is asked for parts: {:?}", server.asked());
    assert!(server.connections() <= MOST_CONNECTIONS, "{} connections", server.connections());
}

#[test]
#[ignore = "run by servers_of_https_are_trusted_by_the_certificates_of_the_system"]
fn a_client_of_tls() {
    let Ok(address) = env::var(TLS_SERVER) else {
        println!("skipped: {TLS_SERVER} is not set");
        return;
    };
    let mut app = app("assets");
    let entity = spawn(&mut app, format!("https://{address}"), 2.2);
    let handle = app.world().get::<GaussianCapture3d>(entity).expect("a capture").0.clone();
    let load_state = |app: &App| app.world().resource::<AssetServer>().load_state(&handle);
    let has_ended = |app: &App| state(app, entity).is_whole() || load_state(app).is_failed();
    wait_until(&mut app, "the file", has_ended, App::update);
    match load_state(&app) {
        LoadState::Failed(error) => println!("{error}"),
        _ => println!("{LOADED}: {} files", state(&app, entity).resident),
    }
}
