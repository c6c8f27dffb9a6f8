//! Pictures of files of other makes.
//!
//! In: exports of synthetic scenes, and the files in `formats/` of the folder that `GS4D_DATA` names. Out: proof that a
//! file is drawn as its scene saved as a package, that an export is drawn as the scene it was made from, that a second
//! export is drawn as the first, and that files of one scene in several formats are drawn alike.

use crate::support::data::data;
use crate::support::other_makes::fixture;
use crate::support::psnr::psnr;
use bevy_gs4d::codec::{self, ReadOptions, package};
use bevy_gs4d::internal::codec::{EXPORTS, Exporter};
use bevy_gs4d::reference;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{GaussianScene, RuntimeScene, UpAxis};
use bevy_gs4d::view::{Background, Camera, Frame, RasterFov, View};
use glam::{Mat3, UVec2, Vec3};
use std::fs;
use std::io::Cursor;

const SIZE: UVec2 = UVec2::new(96, 72);
const FIELD_OF_VIEW: f32 = 0.9;
/// Half turns, by which files of y up and of y down differ.
const ABOUT_X: Mat3 = Mat3::from_cols(Vec3::X, Vec3::NEG_Y, Vec3::NEG_Z);
const ABOUT_Z: Mat3 = Mat3::from_cols(Vec3::NEG_X, Vec3::NEG_Y, Vec3::Z);
const UNTURNED: Mat3 = Mat3::IDENTITY;
/// The fraction of the clip at which pictures are drawn.
const TIME: f32 = 0.4;

/// A format, the rotation of its import relative to a scene with y down, and the least PSNR of its pictures in dB: of
/// the first export to the scene, and of the second export to the first; `None` if the two files are equal.
struct Loss {
    id: &'static str,
    turn: Mat3,
    first: f64,
    second: Option<f64>,
}

const LOSSES: [Loss; 8] = [
    Loss { id: "ply", turn: UNTURNED, first: 90.0, second: None },
    Loss { id: "gltf", turn: ABOUT_X, first: 90.0, second: Some(120.0) },
    Loss { id: "free-time", turn: UNTURNED, first: 120.0, second: Some(120.0) },
    Loss { id: "splat", turn: UNTURNED, first: 34.0, second: Some(60.0) },
    Loss { id: "spz", turn: ABOUT_X, first: 34.0, second: Some(60.0) },
    Loss { id: "sog", turn: UNTURNED, first: 50.0, second: Some(60.0) },
    Loss { id: "sogst", turn: UNTURNED, first: 50.0, second: Some(60.0) },
    Loss { id: "4dgs", turn: UNTURNED, first: 40.0, second: Some(50.0) },
];

/// Files of one scene, the first in single precision: each with its rotation relative to the first, and the least PSNR
/// of its picture in dB.
const ALIKE: [&[(&str, Mat3, f64)]; 5] = [
    &[
        ("splat-transform/cloud_sh3.ply", UNTURNED, 0.0),
        ("splat-transform/cloud_sh3.glb", ABOUT_Z, 60.0),
        ("splat-transform/cloud_sh3.spz", UNTURNED, 30.0),
        ("splat-transform/cloud_mip.spz", UNTURNED, 30.0),
        ("splat-transform/cloud_sh3.compressed.ply", UNTURNED, 30.0),
        ("splat-transform/cloud_sh3.sog", UNTURNED, 30.0),
    ],
    &[("playcanvas/biker.compressed.ply", UNTURNED, 0.0), ("playcanvas/biker.spz", ABOUT_X, 30.0)],
    &[("sogst/fountain_d1_sh2_seg.ply", UNTURNED, 0.0), ("sogst/fountain_d1_sh2_seg.sogst", UNTURNED, 30.0)],
    &[("sogst/arc_d2_sh0_mono.ply", UNTURNED, 0.0), ("sogst/arc_d2_sh0_mono.sogst", UNTURNED, 30.0)],
    &[
        ("sog4d/swarm.ply", UNTURNED, 0.0),
        ("sog4d/swarm_kmeans.sog4d", UNTURNED, 30.0),
        ("sog4d/swarm_q16.sog4d", UNTURNED, 30.0),
    ],
];

/// A camera without a time.
#[derive(Clone, Copy)]
struct Eye {
    at: Vec3,
    target: Vec3,
    up: Vec3,
}

impl Eye {
    /// Returns a camera that looks at the median of a scene, from a distance at which all but outliers are in the
    /// picture.
    fn of(scene: &RuntimeScene) -> Self {
        let means: Vec<Vec3> = scene.iter().map(|gaussian| Vec3::from(gaussian.mean)).collect();
        let median = |value: &dyn Fn(&Vec3) -> f32| {
            let mut values: Vec<f32> = means.iter().map(value).collect();
            values.sort_by(f32::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or_default()
        };
        let middle = Vec3::from([0, 1, 2].map(|axis| median(&|mean| mean[axis])));
        let distance = 3.0 * median(&|mean| mean.distance(middle)).max(1e-3);
        Self { at: middle + Vec3::new(0.8, -0.5, 0.3).normalize() * distance, target: middle, up: Vec3::Z }
    }

    fn turned(self, turn: Mat3) -> Self {
        Self { at: turn * self.at, target: turn * self.target, up: turn * self.up }
    }

    fn view(self, time: f32) -> View {
        Camera::look_at(self.at, self.target, self.up, FIELD_OF_VIEW, SIZE).view(time, RasterFov::Corrected)
    }
}

fn draw(scene: &RuntimeScene, view: &View) -> Frame {
    reference::render(scene, view, Background::Color([0.0; 3]))
}

fn runtime(scene: GaussianScene) -> RuntimeScene {
    scene.into_runtime().expect("it can be drawn")
}

/// Checks that a picture is not empty.
fn assert_visible(frame: &Frame, what: &str) {
    let covered = frame.transmittance.iter().filter(|transmittance| **transmittance < 0.9).count();
    assert!(covered > 100, "{what}: {covered} pixels show something");
}

/// Writes a scene as a package, and reads it again.
fn saved(scene: &GaussianScene) -> GaussianScene {
    let mut file = Vec::new();
    package::write(&mut file, scene, &package::WriteSettings { level: 1 }).expect("it can be saved");
    package::read(Cursor::new(file)).expect("it can be read again")
}

/// Checks that a scene and its package are drawn alike, at several times.
fn check_saved(scene: &GaussianScene, what: &str) {
    let (own, package) = (runtime(scene.clone()), runtime(saved(scene)));
    let (eye, [first, last]) = (Eye::of(&own), own.trained_with.time_interval);
    for part in [0.1, 0.5, 0.9] {
        let view = eye.view(first + (last - first) * part);
        let [a, b] = [&own, &package].map(|scene| draw(scene, &view));
        assert!(a.picture.pixels == b.picture.pixels, "{what} at {part}: the package is drawn with the same bits");
    }
}

/// Returns the time at which a scene is drawn.
fn time_of(scene: &GaussianScene) -> f32 {
    let [first, last] = scene.trained_with.time_interval;
    first + TIME * (last - first)
}

#[test]
fn exports_and_second_exports_are_drawn_as_their_scene() {
    let mut scene = synthesize(&SynthSettings { count: 600, ..SynthSettings::default() });
    scene.playback.up = UpAxis::NegY;
    scene.form.truncate_colors(3, 0);
    let (drawn, time) = (runtime(scene.clone()), time_of(&scene));
    let eye = Eye::of(&drawn);
    let expected = draw(&drawn, &eye.view(time));
    assert_visible(&expected, "the scene");
    let folder = tempfile::tempdir().expect("a temporary folder");
    // Formats of moving Gaussians do not have the cut-off.
    let marginal_cutoff = Some(scene.trained_with.marginal_cutoff);
    let options = ReadOptions { marginal_cutoff, ..ReadOptions::default() };
    for format in EXPORTS.iter().filter(|export| !export.id.starts_with("usd")) {
        let id = format.id;
        if id == "4dgs" && cfg!(not(feature = "fourdgs")) {
            continue;
        }
        let loss = LOSSES.iter().find(|loss| loss.id == id).unwrap_or_else(|| panic!("{id} has a row of LOSSES"));
        let path = folder.path().join(format!("a.{}", format.extension));
        let export = |scene: &GaussianScene, time: f32| {
            let mut file = Vec::new();
            let exporter = Exporter::new(scene.clone(), format, 30.0).expect("the scene can be exported");
            exporter.write(time, &mut file).expect("memory can be written to");
            fs::write(&path, &file).expect("the folder can be written to");
            let imported = codec::load(&path, &options).unwrap_or_else(|error| panic!("{error}"));
            (file, imported)
        };
        let (first_file, once) = export(&scene, time);
        check_saved(&once, id);
        // Formats with motion have their own unit of time.
        let own_time = time_of(&once);
        let (second_file, twice) = export(&once, own_time);
        assert!(loss.second.is_some() || first_file == second_file, "{id}: the second file is the first");
        let view = eye.turned(loss.turn).view(own_time);
        let [once, twice] = [once, twice].map(|scene| draw(&runtime(scene), &view));
        let found = [psnr(&once, &expected), psnr(&twice, &once)];
        eprintln!("{id}: {found:.1?} dB");
        let due = [loss.first, loss.second.unwrap_or(f64::INFINITY)];
        assert!(found[0] >= due[0] && (loss.second.is_none() || found[1] >= due[1]), "{id}: {found:.1?} dB of {due:?}");
    }
}

#[test]
fn files_of_other_makes_are_drawn_as_their_packages_and_alike_in_every_format() {
    if data().is_none() {
        return;
    }
    for files in ALIKE {
        let mut expected = None;
        for &(name, turn, due) in files {
            let Some(path) = fixture(name) else { continue };
            let scene = codec::load(&path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
            check_saved(&scene, name);
            let (time, drawn) = (time_of(&scene), runtime(scene));
            let (eye, picture) = expected.get_or_insert_with(|| {
                let eye = Eye::of(&drawn);
                (eye, draw(&drawn, &eye.view(time)))
            });
            assert_visible(picture, name);
            let found = psnr(&draw(&drawn, &eye.turned(turn).view(time)), picture);
            eprintln!("{name}: {found:.1} dB");
            assert!(found >= due, "{name}: {found:.1} dB, at least {due} expected");
        }
    }
}
