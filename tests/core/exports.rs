//! Exports.
//!
//! In: synthetic scenes. Out: proof that the files show the scene at their time, or with its motion, when they are read
//! again.

use crate::support::trained::trained_mut;
use bevy_gs4d::codec::{ReadOptions, load};
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::internal::codec::{EXPORTS, Export, Exporter};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{
    ActiveSets, FilterKind, Form, GaussianScene, Origin, RuntimeScene, SceneForm, Sliced, TemporalFilter, TrainedWith,
    UpAxis,
};
use bevy_gs4d::view::RasterFov;
use glam::Vec3;
use std::fs;
use std::path::Path;

fn exporter(scene: &GaussianScene, id: &str) -> Exporter {
    Exporter::new(scene.clone(), Export::of_id(id).expect("a format"), 30.0).expect("the scene can be exported")
}

/// Returns the bytes of a file.
fn bytes(exporter: &Exporter, time: f32) -> Vec<u8> {
    let mut bytes = Vec::new();
    exporter.write(time, &mut bytes).expect("memory can be written to");
    bytes
}

/// Exports a scene and returns the imported file.
fn again(scene: &GaussianScene, id: &str, time: f32) -> GaussianScene {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let export = Export::of_id(id).expect("a format");
    let path = folder.path().join(format!("again.{}", export.extension));
    fs::write(&path, bytes(&exporter(scene, id), time)).expect("the folder can be written to");
    load(&path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// Returns a scene of native 4D Gaussians, with color that changes in time.
fn moving() -> GaussianScene {
    let mut scene = synthesize(&SynthSettings { count: 400, ..SynthSettings::default() });
    scene.playback.up = UpAxis::NegY;
    scene
}

/// Returns a scene at rest with color of this degree.
fn resting(degree: u32) -> GaussianScene {
    let mut scene = moving();
    scene.form.truncate_colors(degree, 0);
    let parameters = &mut trained_mut(&mut scene).parameters;
    (parameters.mean_t, parameters.log_scale_t, parameters.rotation_r) = Default::default();
    scene
}

fn sliced(scene: &GaussianScene) -> (Vec<Gaussian>, Harmonics) {
    let RuntimeScene { form: Form::Sliced(Sliced { gaussians, harmonics }), .. } =
        scene.clone().into_runtime().expect("it can be drawn")
    else {
        panic!("the sliced form")
    };
    (gaussians, harmonics)
}

fn assert_same_shape(found: &Gaussian, expected: &Gaussian, what: &str) {
    let largest = expected.covariance.iter().fold(0.0f32, |most, value| most.max(value.abs()));
    for (found, expected) in found.covariance.iter().zip(expected.covariance) {
        assert!((found - expected).abs() <= largest * 1e-5 + 1e-12, "{what}: covariance {found} is {expected}");
    }
}

#[test]
fn parameters_at_rest_come_back_bit_for_bit() {
    for degree in 0..=3 {
        let scene = resting(degree);
        let found = again(&scene, "ply", 0.0);
        assert!(found.form == scene.form, "degree {degree}: every parameter and every coefficient");
    }
}

#[test]
fn a_file_of_one_time_has_the_gaussians_drawn_at_that_time() {
    let scene = moving();
    let (all, colors) = sliced(&scene);
    let span = scene.trained_with.time_span();
    for time in [0.0, 0.37, 0.9] {
        let (found, found_colors) = sliced(&again(&scene, "ply", time));
        let drawn: Vec<usize> = (0..all.len()).filter(|&i| all[i].marginal(time) > 0.05).collect();
        assert!(drawn.len() < all.len() && !drawn.is_empty(), "some Gaussians, but not all, are drawn at {time}");
        assert_eq!(found.len(), drawn.len(), "at {time}, the Gaussians that are drawn");
        assert_eq!((found_colors.degree, found_colors.degree_t), (3, 0), "color without time");
        for (at, &index) in drawn.iter().enumerate() {
            let (found, expected) = (&found[at], &all[index]);
            let what = format!("Gaussian {index} at {time}");
            assert_eq!(Vec3::from(found.mean), expected.mean_at(time), "{what}: the position");
            assert_same_shape(found, expected, &what);
            let opacity = expected.opacity * expected.marginal(time);
            assert!((found.opacity - opacity).abs() < 1e-6, "{what}: {} is {opacity}", found.opacity);
            let direction = Vec3::new(0.3, -0.5, 0.8).normalize();
            let expected = colors.color(index, direction, expected.mean_t - time, span);
            let color = found_colors.color(at, direction, 0.0, 1.0);
            assert!(color.abs_diff_eq(expected, 1e-5), "{what}: {color} is {expected}");
        }
    }
}

#[test]
fn a_filter_and_packed_gaussians_are_exported_as_they_are_drawn() {
    let mut scene = moving();
    let (all, _) = sliced(&scene);
    let intervals = (0..all.len() as u32).map(|i| (i % 2) | (i % 2) << 16).collect();
    let sets = ActiveSets::Intervals(intervals);
    scene.filter = Some(TemporalFilter { kind: FilterKind::KeyFrame, segments: 2, count: all.len(), sets });
    let found = sliced(&again(&scene, "ply", 0.25)).0;
    let drawn = (0..all.len()).filter(|&i| i % 2 == 0 && all[i].marginal(0.25) > 0.05).count();
    assert_eq!(found.len(), drawn, "half of the Gaussians are active in the first segment");
}

#[test]
fn linear_motion_and_lifespans_come_back_from_free_time() {
    let mut scene = moving();
    scene.form.truncate_colors(3, 0);
    scene.trained_with.time_interval = [-0.5, 1.5];
    scene.playback.duration_seconds = 2.0;
    let found = again(&scene, "free-time", 0.0);
    assert_eq!(found.playback.duration_seconds, 2.0, "the length of the clip");
    let ((found, found_colors), (all, colors)) = (sliced(&found), sliced(&scene));
    assert_eq!(found.len(), all.len(), "all Gaussians");
    assert!(found_colors.values == colors.values, "colors are not changed");
    for (index, (found, expected)) in found.iter().zip(&all).enumerate() {
        let what = format!("Gaussian {index}");
        assert_same_shape(found, expected, &what);
        assert!((found.opacity - expected.opacity).abs() < 1e-6, "{what}: opacity");
        for time in [-0.5f32, 0.2, 1.1] {
            let place = (time + 0.5) / 2.0;
            let mean = found.mean_at(place);
            let far = expected.velocity.iter().fold(1.0f32, |most, v| most.max(v.abs()));
            assert!(mean.abs_diff_eq(expected.mean_at(time), far * 1e-5), "{what} at {time}: {mean}");
            let (marginal, expected) = (found.marginal(place), expected.marginal(time));
            assert!((marginal - expected).abs() < 1e-4, "{what} at {time}: marginal {marginal} is {expected}");
        }
    }
}

#[test]
fn color_in_time_is_exported_as_its_mean_over_the_lifespan() {
    let scene = moving();
    let exporter = exporter(&scene, "free-time");
    assert!(exporter.lost().iter().any(|sentence| sentence.contains("mean")), "it is stated: {:?}", exporter.lost());
    let ((_, found), (all, colors)) = (sliced(&again(&scene, "free-time", 0.0)), sliced(&scene));
    let direction = Vec3::new(0.6, 0.0, 0.8);
    let (mut by_mean, mut without) = (0.0, 0.0);
    for (index, gaussian) in all.iter().enumerate() {
        for step in 0..=50 {
            let time = step as f32 / 50.0;
            let weight = gaussian.marginal(time);
            let exact = colors.color(index, direction, gaussian.mean_t - time, 1.0);
            let mut plain = colors.clone();
            plain.truncate(3, 0);
            by_mean += weight * found.color(index, direction, 0.0, 1.0).distance_squared(exact);
            if step % 10 == 0 {
                without += 10.0 * weight * plain.color(index, direction, 0.0, 1.0).distance_squared(exact);
            }
        }
        if index > 20 {
            break;
        }
    }
    assert!(by_mean < without, "the mean ({by_mean}) is nearer than the color without time ({without})");
}

#[test]
fn a_sequence_comes_back_frame_by_frame() {
    let (scene, folder) = (moving(), tempfile::tempdir().expect("a temporary folder"));
    let (exporter, times) = (exporter(&scene, "ply"), [0.125, 0.375, 0.625, 0.875]);
    let mut counts = Vec::new();
    for (frame, &time) in times.iter().enumerate() {
        let mut bytes = Vec::new();
        counts.push(exporter.write(time, &mut bytes).expect("memory can be written to") as u32);
        fs::write(folder.path().join(format!("frame_{frame}.ply")), bytes).expect("the folder can be written to");
    }
    fs::write(folder.path().join("notes.txt"), "no frame").expect("the folder can be written to");
    let options = ReadOptions { fps: Some(4.0), ..ReadOptions::default() };
    let sequence = load(folder.path(), &options).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(sequence.trained_with.time_interval, [0.0, 1.0], "four frames at four a second");
    let filter = sequence.filter.as_ref().expect("a filter");
    assert_eq!(filter.active_counts(0..sequence.len()), counts, "each frame has its own Gaussians");
    for time in times {
        let (expected, found) = (sliced(&again(&scene, "ply", time)).0, sliced(&again(&sequence, "ply", time)).0);
        let means = |gaussians: &[Gaussian]| gaussians.iter().map(|gaussian| gaussian.mean).collect::<Vec<_>>();
        assert!(means(&found) == means(&expected), "the frame at {time} is that of the capture");
    }
    let refused =
        Exporter::new(sequence, Export::of_id("free-time").expect("a format"), 4.0).expect_err("no lifespans");
    assert!(refused.to_string().contains("--sequence"), "frames have no lifespans: {refused}");
}

#[test]
fn folders_without_a_sequence_are_refused_with_the_rule_for_names() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let message = |path: &Path| load(path, &ReadOptions::default()).expect_err("no capture").to_string();
    assert!(message(folder.path()).contains("frame_0001.ply"), "an empty folder: the names are described");
    fs::write(folder.path().join("frame_1.ply"), "ply\n").expect("the folder can be written to");
    assert!(message(folder.path()).contains("two or more files"), "one file is no sequence");
    fs::write(folder.path().join("frame_2.ply"), "ply\n").expect("the folder can be written to");
    assert!(message(folder.path()).contains("frame_1.ply"), "a damaged frame is named");
}

#[test]
fn splat_files_come_back_within_their_quantization_steps() {
    let scene = resting(0);
    let (found, expected) = (again(&scene, "splat", 0.0), scene);
    let (SceneForm::Trained(found), SceneForm::Trained(expected)) = (&found.form, &expected.form) else {
        panic!("the trained form")
    };
    let opacity = |logit: f32| 1.0 / (1.0 + (-logit).exp());
    assert_eq!(found.parameters.mean, expected.parameters.mean, "means are floats");
    for index in 0..expected.parameters.len() {
        let (a, b) = (&found.parameters, &expected.parameters);
        for axis in 0..3 {
            assert!((a.log_scale[index][axis] - b.log_scale[index][axis]).abs() < 1e-5, "scale {axis} of {index}");
            let (a, b) = (found.harmonics.of(index)[axis], expected.harmonics.of(index)[axis]);
            let [a, b] = [a, b].map(|value| (0.5 + 0.282_094_8 * value).clamp(0.0, 1.0));
            assert!((a - b).abs() <= 0.5 / 255.0 + 1e-5, "channel {axis} of {index}: {a} is {b}");
        }
        let (a, b) = (opacity(a.opacity_logit[index]), opacity(b.opacity_logit[index]));
        assert!((a - b).abs() <= 0.5 / 255.0 + 1e-5, "opacity of {index}: {a} is {b}");
    }
    let cut = tempfile::tempdir().expect("a temporary folder");
    for (length, reason) in [(33, "no multiple of the 32 bytes"), (0, "neither a checkpoint")] {
        let path = cut.path().join("cut.splat");
        fs::write(&path, vec![0; length]).expect("the folder can be written to");
        let message = load(&path, &ReadOptions::default()).expect_err("no .splat file").to_string();
        assert!(message.contains(reason), "{length} bytes: {message}");
    }
}

#[test]
fn imports_of_every_format_have_the_true_field_of_view() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut scene = moving();
    scene.trained_with.raster_fov = RasterFov::Reference;
    let mut read = Vec::new();
    for format in EXPORTS {
        let path = folder.path().join(format!("it.{}", format.extension));
        let mut bytes = Vec::new();
        // The feature of a format may be disabled.
        if exporter(&scene, format.id).write(0.4, &mut bytes).is_err() {
            continue;
        }
        fs::write(&path, bytes).expect("the folder can be written to");
        let Ok(found) = load(&path, &ReadOptions::default()) else { continue };
        assert_eq!(found.trained_with.raster_fov, RasterFov::Corrected, "{}: the true field of view", format.name);
        let options = ReadOptions { raster_fov: Some(RasterFov::Reference), ..ReadOptions::default() };
        let found = load(&path, &options).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(found.trained_with.raster_fov, RasterFov::Reference, "{}: the option", format.name);
        read.push(format.id);
    }
    assert!(["ply", "gltf", "spz", "sog"].iter().all(|id| read.contains(id)), "these are read: {read:?}");
}

#[test]
fn the_up_axis_comes_back() {
    let mut scene = resting(1);
    for up in [UpAxis::PosZ, UpAxis::NegX, UpAxis::NegY] {
        scene.playback.up = up;
        for id in ["ply", "free-time"] {
            let found = again(&scene, id, 0.0);
            assert_eq!(found.playback.up, up, "{id}: the up axis is in a comment");
            let means = |scene: &GaussianScene| sliced(scene).0.iter().map(|one| one.mean).collect::<Vec<_>>();
            assert_eq!(means(&found), means(&scene), "{id}: the coordinates are unchanged");
            let said = exporter(&scene, id).lost().iter().any(|sentence| sentence.contains("points up"));
            assert_eq!(said, up != UpAxis::NegY, "{id}: an axis that other programs do not expect is stated");
        }
        // A .splat file has no comments: -y points up.
        let (found, expected) = (again(&scene, "splat", 0.0), sliced(&scene).0);
        assert_eq!(found.playback.up, UpAxis::NegY, "the axis of the format");
        let heights = sliced(&found).0.iter().map(|one| -one.mean[1]).collect::<Vec<_>>();
        let expected: Vec<f32> = expected.iter().map(|one| up.vector().dot(Vec3::from(one.mean))).collect();
        assert_eq!(heights, expected, "{up:?}: the height of each Gaussian is unchanged");
    }
}

#[test]
fn positions_far_from_0_come_back_with_their_digits() {
    let mut scene = moving();
    scene.form.truncate_colors(3, 0);
    scene.trained_with.origin = Origin { place: [500_000.0, 5_400_001.0, -310.5], time: 1.7e9 };
    let lost = |id: &str| exporter(&scene, id).lost().join("\n");
    for (id, time) in [("ply", 0.4), ("free-time", 0.0)] {
        let written = bytes(&exporter(&scene, id), time);
        assert!(written.windows(18).any(|window| window == b"property double x\n"), "{id}: double precision");
        let found = again(&scene, id, time);
        assert_eq!(found.trained_with.origin.place, scene.trained_with.origin.place, "{id}: the origin");
        let without = GaussianScene {
            trained_with: TrainedWith { origin: Origin::default(), ..scene.trained_with.clone() },
            ..scene.clone()
        };
        let expected = again(&without, id, time);
        for (found, expected) in sliced(&found).0.iter().zip(sliced(&expected).0) {
            let is_near = Vec3::from(found.mean).abs_diff_eq(Vec3::from(expected.mean), 1e-8);
            assert!(is_near, "{id}: {:?} is {:?}", found.mean, expected.mean);
        }
        assert!(!lost(id).contains("origin"), "{id}: no place is lost: {}", lost(id));
    }
    assert!(lost("free-time").contains("1700000000"), "a time that is left out is stated: {}", lost("free-time"));
    for id in ["gltf", "spz", "sog", "splat", "usd"] {
        assert!(lost(id).contains("(500000, 5400001, -310.5)"), "{id} has no origin: {}", lost(id));
    }
}

#[test]
fn gaussians_too_far_for_spz_are_left_out_and_counted() {
    let mut scene = resting(0);
    (scene.playback.up, scene.playback.duration_seconds) = (UpAxis::PosY, 0.0);
    let parameters = &mut trained_mut(&mut scene).parameters;
    (parameters.mean[7], parameters.mean[8]) = ([0.0, 1e9, 0.0], [-1e6, 0.0, 0.0]);
    let exporter = exporter(&scene, "spz");
    let is_stated = exporter.lost().iter().any(|sentence| sentence.starts_with("2 of 400 Gaussians are left out"));
    assert!(is_stated, "their number is known before the file is written: {:?}", exporter.lost());
    assert_eq!(exporter.write(0.0, &mut Vec::new()).expect("memory can be written to"), 398, "the others are written");
    let (found, mut expected) = (sliced(&again(&scene, "spz", 0.0)).0, sliced(&scene).0);
    expected.drain(7..9);
    assert_eq!(found.len(), expected.len(), "the others are in the file");
    for (found, expected) in found.iter().zip(&expected) {
        let apart = Vec3::from(found.mean).distance(Vec3::from(expected.mean));
        assert!(apart < 2e-5, "the others keep their digits: {:?} is {:?}", found.mean, expected.mean);
    }
}

#[test]
fn the_filter_of_mip_splatting_comes_back_or_is_stated() {
    let mut scene = resting(0);
    for mip_filter in [false, true] {
        scene.trained_with.mip_filter = mip_filter;
        for (id, has_filter) in [
            ("spz", true),
            ("ply", true),
            ("free-time", true),
            ("sog", true),
            ("sogst", false),
            ("splat", false),
            ("gltf", false),
        ] {
            let is_stated = exporter(&scene, id).lost().iter().any(|sentence| sentence.contains("Mip-Splatting"));
            assert_eq!(is_stated, mip_filter && !has_filter, "{id}: whether it is lost");
            let found = again(&scene, id, 0.0).trained_with.mip_filter;
            assert_eq!(found, mip_filter && has_filter, "{id}: whether the file has it");
        }
    }
}
