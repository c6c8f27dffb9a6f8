//! Files of the 4dgs format.
//!
//! In: the files of its conformance suite in the folder that `GS4D_DATA` names, each with its expected values; exports.
//! Out: proof that these values are read, that exports are drawn as their scenes, and that a small file of many
//! Gaussians is refused.

use crate::support::data::data;
use crate::support::psnr::psnr;
use crate::support::skip::skip;
use crate::support::trained::trained_mut;
use bevy_gs4d::codec::{ReadOptions, load};
use bevy_gs4d::internal::codec::{Export, Exporter};
use bevy_gs4d::reference;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{GaussianScene, RuntimeScene};
use bevy_gs4d::view::{Background, Camera, Frame, RasterFov};
use glam::{UVec2, Vec3};
use serde_json::Value;
use std::fs;

#[test]
fn files_of_the_conformance_suite_are_read_as_their_descriptions_say() {
    let Some(folder) = data() else { return };
    let folder = folder.join("formats/4dgs");
    let Ok(files) = fs::read_dir(&folder) else { return skip(format!("no {}", folder.display())) };
    let mut count = 0;
    for path in files.map(|file| file.expect("a file").path()) {
        if path.extension().is_none_or(|extension| extension != "4dgs") {
            continue;
        }
        count += 1;
        let name = path.display();
        let text = fs::read_to_string(path.with_extension("json")).expect("a description");
        let said: Value = serde_json::from_str(&text).expect("JSON");
        let found = load(&path, &ReadOptions::default());
        if said.get("refused").is_some() || said["temporalModel"] == "keyframe-delta" {
            let error = found.expect_err("a file that is refused").to_string();
            assert!(error.len() > 40, "{name}: {error}");
            continue;
        }
        let scene = found.unwrap_or_else(|error| panic!("{name}: {error}"));
        let number = |value: &Value| value.as_f64().expect("a number");
        let gaussians: usize = said["gaussianCount"].as_str().and_then(|text| text.parse().ok()).expect("a number");
        assert_eq!(f64::from(scene.playback.duration_seconds), number(&said["durationSec"]), "{name}: its duration");
        if said["objects"]["tracks"].as_array().is_some_and(|tracks| !tracks.is_empty()) {
            assert!(scene.len() > gaussians, "{name}: objects move along curved paths in {} pieces", scene.len());
            continue;
        }
        assert!(
            scene.len() <= gaussians && scene.len() * 10 >= gaussians * 9,
            "{name}: {} of {gaussians}",
            scene.len()
        );
        let runtime = scene.into_runtime().expect("a scene that can be drawn");
        if runtime.len() == gaussians {
            let sum = runtime
                .iter()
                .fold([0.0; 3], |sum, gaussian| [0, 1, 2].map(|axis| sum[axis] + f64::from(gaussian.mean[axis])));
            for (axis, sum) in sum.iter().enumerate() {
                let expected = number(&said["aggregate"]["positionSum"][axis]);
                assert!((sum - expected).abs() < 1e-3, "{name}: {sum} is {expected}");
            }
            let opacity: f64 = runtime.iter().map(|gaussian| f64::from(gaussian.opacity)).sum();
            let expected = number(&said["aggregate"]["opacitySum"]);
            assert!((opacity - expected).abs() < 1e-3 * expected.max(1.0), "{name}: {opacity} is {expected}");
        }
    }
    assert!(count >= 13, "{count} files");
}

/// Size of the pictures that are compared.
const SIZE: UVec2 = UVec2::new(80, 60);

/// Exports a scene; returns the imported file, whose unit of time is the second, and the losses.
fn again(scene: &GaussianScene, id: &str) -> (RuntimeScene, Vec<String>) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let format = Export::of_id(id).expect("a format");
    let exporter = Exporter::new(scene.clone(), format, 30.0).expect("it can be exported");
    let path = folder.path().join(format!("a.{}", format.extension));
    let mut file = Vec::new();
    exporter.write(0.0, &mut file).expect("memory can be written to");
    fs::write(&path, file).expect("the folder can be written to");
    let marginal_cutoff = Some(scene.trained_with.marginal_cutoff);
    let options = ReadOptions { marginal_cutoff, ..ReadOptions::default() };
    let found = load(&path, &options).unwrap_or_else(|error| panic!("{error}"));
    (found.into_runtime().expect("it can be drawn"), exporter.lost().to_vec())
}

/// Draws a scene at a fraction of its clip, from the position `target + from` towards `target`.
fn drawn(scene: &RuntimeScene, from: Vec3, target: Vec3, part: f32) -> Frame {
    let [first, last] = scene.trained_with.time_interval;
    let camera = Camera::look_at(target + from, target, Vec3::Y, 0.7, SIZE);
    let view = camera.view(first + part * (last - first), RasterFov::Corrected);
    reference::render(scene, &view, Background::Color([0.0; 3]))
}

#[test]
fn large_opaque_splats_are_drawn_as_their_scene() {
    let mut scene = synthesize(&SynthSettings { count: 500, ..SynthSettings::default() });
    scene.form.truncate_colors(0, 0);
    let parameters = &mut trained_mut(&mut scene).parameters;
    for (index, scale) in parameters.log_scale.iter_mut().enumerate() {
        *scale = [1.5 + (index % 7) as f32 * 0.1, 1.0, 0.5 + (index % 5) as f32 * 0.1];
    }
    parameters.opacity_logit.fill(4.0);
    let expected = scene.clone().into_runtime().expect("it can be drawn");
    let (found, lost) = again(&scene, "4dgs");
    for part in [0.2, 0.7] {
        let [a, b] = [&found, &expected].map(|scene| drawn(scene, Vec3::new(2.0, 1.0, 3.0), Vec3::ZERO, part));
        let found = psnr(&a, &b);
        assert!(found > 80.0, "{found:.1} dB at {part}: splats cover each other in the same order");
    }
    assert!(lost.iter().any(|sentence| sentence.contains("read back")), "its precision is stated: {lost:?}");
}

#[test]
fn the_bundled_capture_is_drawn_as_well_as_from_a_format_of_single_precision() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/toybox.gs4d");
    let scene = load(path.as_ref(), &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let expected = scene.clone().into_runtime().expect("it can be drawn");
    let files = ["4dgs", "free-time"].map(|id| again(&scene, id).0);
    let picture = |scene: &RuntimeScene| drawn(scene, Vec3::new(3.0, -2.5, 2.0), Vec3::new(0.0, 0.0, 0.4), 0.4);
    let [found, due] = files.each_ref().map(|file| psnr(&picture(file), &picture(&expected)));
    assert!(found > due - 0.5 && due > 30.0, "{found:.1} dB, where single precision has {due:.1}");
}

#[test]
fn more_gaussians_than_a_file_of_its_length_may_have_are_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.4dgs");
    // A record of a chunk: its times, its level, its number of Gaussians, no compression, no streams.
    let contents = [&[0_u8; 20][..], &u32::MAX.to_le_bytes(), &[0; 4], &[0; 16]].concat();
    let record = [&[5_u8][..], &(contents.len() as u64).to_le_bytes(), &contents].concat();
    fs::write(&path, [&b"\x894DGS1\r\n"[..], &record].concat()).expect("the folder can be written to");
    let error = load(&path, &ReadOptions::default()).expect_err("4 billion Gaussians").to_string();
    assert!(error.contains("a.4dgs") && error.contains("may take"), "file, claim and limit: {error}");
}
