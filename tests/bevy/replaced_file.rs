//! The example `play` shows a capture whose file is replaced, as `gs4d train` replaces its output.
//!
//! In: a package outside the folder of assets, replaced while it is shown. Out: proof that the new contents are loaded,
//! once, and that a file which does not change is not loaded again. Needs neither a GPU nor a window.

#[path = "../../examples/play/live.rs"]
mod live;
#[path = "../../examples/play/stamp.rs"]
pub(crate) mod stamp;

use crate::support::event_log::{record, take_events};
use crate::support::waiting::wait_until;
use bevy::asset::UnapprovedPathMode;
use bevy::prelude::*;
use bevy_gs4d::asset::{CaptureReady, GaussianCapture};
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::offline;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugins};
use std::path::Path;

fn write(path: &Path, count: usize) {
    let scene = synthesize(&SynthSettings { count, ..SynthSettings::default() });
    offline::work::save(path, &scene, &WriteSettings::default()).expect("the folder can be written to");
}

#[test]
fn play_loads_a_capture_again_whose_file_is_replaced() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("training.gs4d");
    let mut app = App::new();
    // As in the example: captures may be anywhere.
    let assets = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
    app.add_plugins((MinimalPlugins, assets, GaussianCapturePlugins)).add_systems(Update, live::reload_changed);
    record::<CaptureReady>(&mut app, Update);
    let capture: Handle<GaussianCapture> = app.world().resource::<AssetServer>().load(file.clone());
    app.world_mut().spawn(GaussianCapture3d(capture.clone()));
    let count = |app: &App| {
        app.world().resource::<Assets<GaussianCapture>>().get(&capture).map(|capture| capture.scene().len())
    };
    let state = |app: &App| app.world().resource::<AssetServer>().load_state(&capture);
    wait_until(&mut app, "failing", |app| state(app).is_failed(), App::update);
    write(&file, 50);
    wait_until(&mut app, "the first package of a training", |app| count(app) == Some(50), App::update);
    for _ in 0..20 {
        app.update();
    }
    assert_eq!(take_events(&mut app).len(), 1, "a file that does not change is loaded once");
    for more in [60, 70] {
        write(&file, more);
        wait_until(&mut app, "loading again", |app| count(app) == Some(more), App::update);
        for _ in 0..20 {
            app.update();
        }
        assert_eq!(take_events(&mut app).len(), 1, "a file that is replaced is loaded once more");
    }
    std::fs::remove_file(&file).expect("the folder can be written to");
    for _ in 0..20 {
        app.update();
    }
    assert_eq!((take_events(&mut app).len(), count(&app)), (0, Some(70)), "without its file the capture stays");
}
