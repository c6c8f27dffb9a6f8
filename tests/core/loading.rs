//! The memory used by loading.
//!
//! In: a synthetic package, and with `GS4D_DATA` set a real checkpoint and the package made from it. Out: proof that
//! loading a capture until it can be drawn never allocates more than three times the size of its file. The allocator
//! counts for all threads of the process, so that each of these tests runs in its own process.

use crate::support::allocations::{ALLOCATED, PEAK};
use crate::support::data::data;
use crate::support::own_process::run_alone;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::offline;
use bevy_gs4d::scene::GaussianScene;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use std::path::Path;
use std::sync::atomic::Ordering;

/// Loads until the scene could be drawn, and compares the peak with the size of the file.
fn check(path: &Path) {
    let size = path.metadata().expect("the file is there").len() as usize;
    let before = ALLOCATED.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let scene = codec::load(path, &ReadOptions::default()).expect("the file can be read");
    let scene = scene.into_runtime().expect("the scene can be drawn");
    let peak = PEAK.load(Ordering::Relaxed) - before;
    let factor = peak as f64 / size as f64;
    assert!(factor < 3.0, "{}: {factor:.2} times {size} bytes are allocated at the peak", path.display());
    // The count includes at least the scene itself.
    let held = scene.size();
    assert!(held > 0 && peak >= held, "{}: the peak of {peak} bytes includes the {held} of the scene", path.display());
}

fn check_package(scene: &GaussianScene) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("scene.gs4d");
    offline::work::save(&path, scene, &WriteSettings::default()).expect("the folder can be written to");
    check(&path);
}

#[test]
fn a_synthetic_package_loads_in_three_times_its_size() {
    run_alone("loading::a_synthetic_package_loads_in_three_times_its_size", || {
        check_package(&synthesize(&SynthSettings { count: 50_000, ..SynthSettings::default() }));
    });
}

#[test]
fn real_captures_load_in_three_times_their_size() {
    let Some(data) = data() else { return };
    run_alone("loading::real_captures_load_in_three_times_their_size", || {
        for file in ["toybox/toybox_chkpnt.pth", "standup/standup_chkpnt.pth"] {
            let path = data.join(file);
            check(&path);
            check_package(&codec::load(&path, &ReadOptions::default()).expect("the file can be read"));
        }
    });
}
