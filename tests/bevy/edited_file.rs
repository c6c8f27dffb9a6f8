//! The example `play` shows a capture with a list of edits while the list is written.
//!
//! In: a package and a list of edits outside the folder of assets. Out: proof that each list without an error is
//! applied in place of the one before, that nothing that is shown changes while the list has an error, which is told,
//! and that a capture that is loaded again is edited again. Needs neither a GPU nor a window.

#[path = "../../examples/play/edits.rs"]
mod edits;

use crate::replaced_file::stamp;
use crate::support::waiting::wait_until;
use bevy::asset::UnapprovedPathMode;
use bevy::prelude::*;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::inspector::Inspector;
use bevy_gs4d::offline;
use bevy_gs4d::scene::GaussianScene;
use bevy_gs4d::scene::edit::{EditList, apply};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugins};
use edits::{Edits, apply_edits, look_at_edits};
use std::fs;
use std::path::Path;

const NONE: &str = "[]";
const ONE: &str = "[\n    remove_box(min: (0, -9, -9), max: (9, 9, 9)),\n]";
const TWO: &str =
    "[\n    remove_box(min: (0, -9, -9), max: (9, 9, 9)),\n    remove_sphere(center: (-0.5, 0, 0), radius: 0.4),\n]";
const WRONG: &str = "[\n    remove_sphere(center: (-0.5, 0, 0), radius: -1),\n]";
const FLOATERS: &str = "[remove_floaters(cameras_below: 3, distance_below: 1)]";

fn scene(count: usize) -> GaussianScene {
    synthesize(&SynthSettings { count, ..SynthSettings::default() })
}

fn save(path: &Path, count: usize) {
    offline::work::save(path, &scene(count), &WriteSettings::default()).expect("the folder can be written to");
}

/// Returns how many Gaussians of a scene are left by a list.
fn left(count: usize, list: &str) -> usize {
    let list = EditList::parse(list.as_bytes()).expect("the text is a list");
    apply(scene(count), &list, None).expect("some are left").kept
}

/// Returns an app that shows a capture as the example does, with a list of edits.
fn app(capture: &Path, list: &Path) -> App {
    let mut app = App::new();
    // As in the example: captures may be anywhere.
    let assets = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
    app.add_plugins((MinimalPlugins, assets, GaussianCapturePlugins)).init_resource::<Inspector>();
    app.insert_resource(Edits::of(list.to_owned())).add_systems(Update, (look_at_edits, apply_edits).chain());
    let capture = app.world().resource::<AssetServer>().load(capture.to_owned());
    app.world_mut().spawn(GaussianCapture3d(capture));
    app
}

/// Returns the number of Gaussians that are shown; `None` until the capture is loaded.
fn count(app: &App) -> Option<usize> {
    let (_, capture) = app.world().resource::<Assets<GaussianCapture>>().iter().next()?;
    Some(capture.scene().len())
}

fn edits(app: &App) -> &Edits {
    app.world().resource::<Edits>()
}

/// Runs the app until its capture has a number of Gaussians by a list without an error, and checks that this is told.
fn wait_for(app: &mut App, expected: usize, total: usize) {
    let is_shown = |app: &App| count(app) == Some(expected) && !edits(app).is_waiting() && edits(app).fault().is_none();
    wait_until(app, "a list without an error", is_shown, App::update);
    let (note, removed) = (&app.world().resource::<Inspector>().note, total - expected);
    let sentence = format!("edits.ron: {removed} of {total} Gaussians are removed");
    assert!(note.ends_with(&sentence), "the panel has the numbers: {note} is not {sentence}");
}

/// Runs the app until an error of the list is told, and checks that the capture stays.
fn wait_for_fault(app: &mut App, expected: usize, part: &str) {
    let is_told = |app: &App| !edits(app).is_waiting() && edits(app).fault().is_some_and(|fault| fault.contains(part));
    wait_until(app, part, is_told, App::update);
    for _ in 0..20 {
        app.update();
    }
    assert_eq!(count(app), Some(expected), "{part}: the capture stays");
    let note = &app.world().resource::<Inspector>().note;
    assert_eq!(edits(app).fault(), Some(note.as_str()), "{part}: the panel has the error");
    assert!(note.contains("edits.ron: "), "{part}: the error names the file: {note}");
}

#[test]
fn play_shows_a_capture_with_its_edits_while_they_are_written() {
    let [one, two] = [ONE, TWO].map(|list| left(300, list));
    assert!(0 < two && two < one && one < 300, "each edit removes some: {two}, {one}");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [file, list] = ["capture.gs4d", "edits.ron"].map(|name| folder.path().join(name));
    let write = |text: &str| fs::write(&list, text).expect("the folder can be written to");
    save(&file, 300);
    let mut app = app(&file, &list);
    assert!(edits(&app).is_waiting(), "the capture is not loaded");
    wait_for_fault(&mut app, 300, "edits.ron: ");
    write(TWO);
    wait_for(&mut app, two, 300);
    write(WRONG);
    wait_for_fault(&mut app, two, "edits.ron: line 2, column ");
    write(ONE);
    wait_for(&mut app, one, 300);
    write(NONE);
    wait_for(&mut app, 300, 300);
    write(FLOATERS);
    wait_for_fault(&mut app, 300, "--data");
    write(TWO);
    wait_for(&mut app, two, 300);
    fs::remove_file(&list).expect("the folder can be written to");
    for _ in 0..20 {
        app.update();
    }
    assert_eq!((count(&app), edits(&app).fault()), (Some(two), None), "without its file the list stays");
}

#[test]
fn a_capture_that_is_loaded_again_is_edited_again_by_the_last_list_without_an_error() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [file, list] = ["capture.gs4d", "edits.ron"].map(|name| folder.path().join(name));
    let write = |text: &str| fs::write(&list, text).expect("the folder can be written to");
    save(&file, 300);
    write(ONE);
    let mut app = app(&file, &list);
    let replace = |app: &App, count: usize| {
        save(&file, count);
        app.world().resource::<AssetServer>().reload(file.clone());
    };
    wait_for(&mut app, left(300, ONE), 300);
    replace(&app, 400);
    wait_for(&mut app, left(400, ONE), 400);
    write(WRONG);
    wait_for_fault(&mut app, left(400, ONE), "line 2");
    replace(&app, 500);
    let expected = left(500, ONE);
    wait_until(&mut app, "the new capture", |app| count(app) == Some(expected), App::update);
    wait_for_fault(&mut app, expected, "line 2");
}
