//! Reading checkpoints of the original trainer.
//!
//! In: the checkpoints in `tests/golden/`, crafted checkpoints and, with `GS4D_DATA` set, checkpoints of trained
//! captures. Out: proof that each is read as the scene that was written.

use crate::support::data;
use crate::support::golden;
use crate::support::pth::{self, Pth};
use crate::support::trained::trained;
use bevy_gs4d::codec::checkpoint::{self, CheckpointError};
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::gaussian::{Harmonics, Model, Parameters};
use bevy_gs4d::internal::codec::describe;
use bevy_gs4d::scene::{GaussianScene, RotationConvention, TrainedCameras, UpAxis};
use serde_json::Value;
use std::io::Cursor;

fn read_with(pth: &Pth, options: &ReadOptions) -> Result<GaussianScene, CheckpointError> {
    checkpoint::read(Cursor::new(pth.bytes()), options, None)
}

fn read(pth: &Pth) -> GaussianScene {
    read_with(pth, &ReadOptions::default()).expect("a valid checkpoint")
}

fn parameters(scene: &GaussianScene) -> &Parameters {
    &trained(scene).parameters
}

fn harmonics(scene: &GaussianScene) -> &Harmonics {
    &trained(scene).harmonics
}

fn numbers(value: &Value, out: &mut Vec<f32>) {
    match value {
        Value::Array(items) => items.iter().for_each(|item| numbers(item, out)),
        number => out.push(number.as_f64().expect("a number") as f32),
    }
}

/// Returns one attribute of `raw` in a golden scene; empty if the scene does not have it.
fn raw(scene: &Value, name: &str) -> Vec<f32> {
    let mut out = Vec::new();
    if let Some(values) = scene["raw"].get(name) {
        numbers(values, &mut out);
    }
    out
}

#[test]
fn golden_checkpoints_are_read_as_the_golden_scenes() {
    let scenes = [
        ("rot4d_sh3_t2", Model::Rotated4d, 3, 2),
        ("nonrot4d_sh3_t1", Model::Unrotated4d, 3, 1),
        ("static_as_3d", Model::Static3d, 2, 0),
        ("intrinsics_env", Model::Rotated4d, 3, 2),
    ];
    for (name, model, degree, degree_t) in scenes {
        let json = std::fs::read(golden::folder().join(name).join("scene.json")).expect("the golden scene");
        let json: Value = serde_json::from_slice(&json).expect("valid JSON");
        for dialect in ["torch1.12", "torch2"] {
            let path = golden::folder().join("checkpoints").join(format!("{name}_{dialect}.pth"));
            let scene = codec::load(&path, &ReadOptions::default()).expect("a golden checkpoint");
            let found = parameters(&scene);
            let context = format!("{name}, {dialect}");
            assert_eq!(found.model(), model, "{context}: model");
            let attributes = [
                ("xyz", found.mean.as_flattened()),
                ("t", found.mean_t.as_slice()),
                ("scaling", found.log_scale.as_flattened()),
                ("scaling_t", found.log_scale_t.as_slice()),
                ("rotation", found.rotation_l.as_flattened()),
                ("rotation_r", found.rotation_r.as_flattened()),
                ("opacity", found.opacity_logit.as_slice()),
            ];
            for (attribute, values) in attributes {
                assert_eq!(values, raw(&json, attribute), "{context}: {attribute}");
            }

            let (dc, rest) = (raw(&json, "features_dc"), raw(&json, "features_rest"));
            let stretch = rest.len() / found.len();
            let sh: Vec<f32> =
                dc.chunks(3).zip(rest.chunks(stretch)).flat_map(|(dc, rest)| [dc, rest].concat()).collect();
            assert_eq!(harmonics(&scene).values, sh, "{context}: first coefficient, then the rest");
            assert_eq!(harmonics(&scene).coefficients, stretch / 3 + 1, "{context}: coefficients");
            assert_eq!(
                (harmonics(&scene).degree, harmonics(&scene).degree_t),
                (degree, degree_t),
                "{context}: degrees"
            );

            let trained = &scene.trained_with;
            assert_eq!(trained.iteration, 30_000, "{context}: iteration");
            assert!((trained.spatial_lr_scale - 4.433_99).abs() < 1e-4, "{context}: {}", trained.spatial_lr_scale);
            assert_eq!(trained.rotation_convention, RotationConvention::Flipped, "{context}: convention");
            let texels = std::fs::read(golden::folder().join(name).join("env.f32")).unwrap_or_default();
            let texels: Vec<f32> =
                texels.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
            let environment = scene.environment.as_ref();
            assert_eq!(environment.map_or(&[][..], |e| e.texels.as_slice()), texels, "{context}: environment map");
            assert_eq!(environment.map(|e| (e.width, e.height)), (!texels.is_empty()).then_some((16, 16)), "{context}");
            let cameras = if texels.is_empty() { TrainedCameras::Fov } else { TrainedCameras::Intrinsics };
            assert_eq!(trained.cameras, cameras, "{context}: cameras");
        }
    }
}

#[test]
fn unflipped_rotations_are_converted_on_request() {
    let pth = Pth::rotating(3, 48);
    let unflipped = ReadOptions { rotation_convention: Some(RotationConvention::Unflipped), ..ReadOptions::default() };
    let (before, after) = (read(&pth), read_with(&pth, &unflipped).expect("valid"));
    let mut expected = parameters(&before).clone();
    expected.flip_rotations();
    assert_ne!(expected, *parameters(&before), "the conversion changes the rotations");
    assert_eq!(*parameters(&after), expected, "both quaternions are converted");
    assert_eq!(
        after.trained_with.rotation_convention,
        RotationConvention::Unflipped,
        "the convention of the file is kept"
    );
}

#[test]
fn coefficients_of_time_that_are_all_zero_mean_unflipped_rotations() {
    let mut pth = Pth::rotating(3, 48);
    for sh in pth.storages[2].chunks_exact_mut(47 * 3) {
        sh[45..].fill(0.0);
    }
    let flipped = ReadOptions { rotation_convention: Some(RotationConvention::Flipped), ..ReadOptions::default() };
    let given = read_with(&pth, &flipped).expect("valid");
    assert_eq!(
        given.trained_with.rotation_convention,
        RotationConvention::Flipped,
        "an option overrides the detected convention"
    );
    let guessed = read(&pth);
    assert_eq!(
        guessed.trained_with.rotation_convention,
        RotationConvention::Unflipped,
        "zeros mean unflipped rotations"
    );
    let mut expected = parameters(&given).clone();
    expected.flip_rotations();
    assert_eq!(*parameters(&guessed), expected, "the rotations are converted");

    pth.storages[2][140] = 1e-9;
    assert_eq!(read(&pth).trained_with.rotation_convention, RotationConvention::Flipped, "one value is not zero");
    pth.storages[2][140] = 0.0;
    pth.slots[18] = pth::int(1);
    assert_eq!(
        read(&pth).trained_with.rotation_convention,
        RotationConvention::Flipped,
        "zeros at a low degree do not mean unflipped rotations"
    );
}

#[test]
fn additional_entries_are_ignored() {
    let mut pth = Pth::rotating(2, 48);
    let plain = read(&pth);
    pth.slots.push(pth::text("a mask"));
    pth.slots.push(pth::tensor(998, 7, 0, &[7], &[1]));
    assert_eq!(read(&pth), plain, "21 entries");

    let mut still = Pth::rotating(2, 16);
    still.slots.drain(8..10);
    still.slots.truncate(11);
    still.slots.push(pth::NONE.to_vec());
    assert!(read_with(&still, &ReadOptions::default()).is_err(), "slot 11 must be the learning-rate scale");
    still.slots[11] = pth::float(2.5);
    let scene = read(&still);
    assert_eq!(scene.model(), Some(Model::Static3d), "12 entries");
    assert_eq!(scene.trained_with.spatial_lr_scale, 2.5, "slot 11");
    still.slots.push(pth::text("a mask"));
    assert_eq!(read(&still), scene, "13 entries");
}

#[test]
fn strides_and_offsets_are_respected() {
    let mut pth = Pth::rotating(2, 48);
    let mean = parameters(&read(&pth)).mean.clone();
    // Column-major, after five other values and before two.
    let mut storage = vec![f32::NAN; 5];
    storage.extend((0..6).map(|i| mean[i % 2][i / 2]));
    storage.extend([9.0; 2]);
    pth.slots[1] = pth::tensor(pth.storages.len(), 13, 5, &[2, 3], &[1, 2]);
    pth.storages.push(storage);
    assert_eq!(parameters(&read(&pth)).mean, mean, "transposed");
    let mut storage = vec![f32::NAN; 5];
    storage.extend(mean.as_flattened());
    pth.slots[1] = pth::tensor(pth.storages.len(), 11, 5, &[2, 3], &[3, 1]);
    pth.storages.push(storage);
    assert_eq!(parameters(&read(&pth)).mean, mean, "contiguous with an offset");
}

#[test]
fn an_empty_capture_is_valid() {
    let scene = read(&Pth::rotating(0, 48));
    assert!(scene.is_empty() && harmonics(&scene).is_consistent(0), "no Gaussian, no color");
}

#[test]
fn degrees_and_coefficients_fit_together() {
    let mut legacy = Pth::rotating(2, 33);
    assert!(read_with(&legacy, &ReadOptions::default()).is_err(), "time degree 2 needs 48 coefficients");
    legacy.slots[18] = pth::int(0);
    let scene = read(&legacy);
    assert_eq!((harmonics(&scene).coefficients, harmonics(&scene).evaluated()), (33, 16), "the legacy table");

    let forced = ReadOptions { force_sh_3d: Some(true), ..ReadOptions::default() };
    let scene = read_with(&Pth::rotating(2, 48), &forced).expect("valid");
    assert_eq!((harmonics(&scene).degree_t, harmonics(&scene).coefficients), (0, 48), "stored, but not evaluated");
    let scene = read_with(&Pth::rotating(2, 16), &forced).expect("16 coefficients suffice without time blocks");
    assert_eq!(harmonics(&scene).evaluated(), 16, "only spatial coefficients");

    let mut young = Pth::rotating(2, 1);
    young.slots[0] = pth::int(0);
    let scene = read(&young);
    assert_eq!((harmonics(&scene).coefficients, harmonics(&scene).degree_t), (1, 0), "degree 0 has no time blocks");
}

#[test]
fn options_override_cfg_args_and_cfg_args_override_defaults() {
    let bytes = Pth::rotating(1, 48).bytes();
    let read =
        |options: &ReadOptions, cfg: Option<&str>| checkpoint::read(Cursor::new(&bytes), options, cfg).expect("valid");
    let none = ReadOptions::default();
    let cfg = Some("Namespace(sh_degree=3, white_background=True, prefilter_var=0.5)");
    let plain = read(&none, None);
    assert_eq!(plain.trained_with.background, [0.0; 3], "default background");
    assert_eq!(plain.trained_with.prefilter_var, -1.0, "default prefilter variance");
    assert_eq!(plain.playback.duration_seconds, 1.0, "default duration");
    let from_cfg = read(&none, cfg);
    assert_eq!(from_cfg.trained_with.background, [1.0; 3], "cfg_args over the default");
    assert_eq!(from_cfg.trained_with.prefilter_var, 0.5, "cfg_args over the default");
    let given = ReadOptions {
        background: Some([0.25; 3]),
        prefilter_var: Some(-1.0),
        time_interval: Some([-1.0, 9.0]),
        up: Some(UpAxis::NegY),
        ..none
    };
    let scene = read(&given, cfg);
    assert_eq!(scene.trained_with.background, [0.25; 3], "an option over cfg_args");
    assert_eq!(scene.trained_with.prefilter_var, -1.0, "an option over cfg_args");
    assert_eq!((scene.playback.up, scene.playback.duration_seconds), (UpAxis::NegY, 10.0), "ten seconds long");
    let lines = describe(&scene.trained_with, &scene.playback);
    assert!(
        lines.contains(&("background", "0.25, 0.25, 0.25".to_owned())),
        "the chosen background is described: {lines:?}"
    );
}

#[test]
fn a_duration_of_zero_is_read() {
    let options = ReadOptions { duration_seconds: Some(0.0), ..ReadOptions::default() };
    let scene = read_with(&Pth::rotating(1, 48), &options).expect("a duration of zero is valid");
    assert_eq!(scene.playback.duration_seconds, 0.0, "the given duration");
}

#[test]
fn invalid_options_are_refused() {
    let pth = Pth::rotating(1, 48);
    let none = ReadOptions::default();
    for (name, options) in [
        ("time_interval", ReadOptions { time_interval: Some([1.0, 1.0]), ..none.clone() }),
        ("time_interval", ReadOptions { time_interval: Some([0.0, f32::NAN]), ..none.clone() }),
        ("background", ReadOptions { background: Some([0.0, f32::INFINITY, 0.0]), ..none.clone() }),
        ("duration", ReadOptions { duration_seconds: Some(-1.0), ..none.clone() }),
    ] {
        let message = read_with(&pth, &options).expect_err("must be refused").to_string();
        assert!(message.contains(name), "{message}");
    }
}

#[test]
fn cfg_args_in_the_folder_of_the_checkpoint_is_read() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    #[cfg(unix)]
    let name = <std::ffi::OsStr as std::os::unix::ffi::OsStrExt>::from_bytes(b"chkpnt\xff30000.pth");
    #[cfg(not(unix))]
    let name = "chkpnt30000.pth";
    let path = folder.path().join(name);
    std::fs::write(&path, Pth::rotating(1, 48).bytes()).expect("the folder can be written to");
    let background = || codec::load(&path, &ReadOptions::default()).expect("valid").trained_with.background;
    assert_eq!(background(), [0.0; 3], "no cfg_args in the folder");
    std::fs::write(folder.path().join("cfg_args"), "Namespace(white_background=True)").expect("can be written to");
    assert_eq!(background(), [1.0; 3], "cfg_args in the folder");
}

#[test]
fn trained_captures_load() {
    let Some(data) = data::data() else { return };
    for file in ["toybox/toybox_chkpnt.pth", "standup/standup_chkpnt.pth"] {
        let scene = codec::load(&data.join(file), &ReadOptions::default()).expect("a trained capture");
        assert_eq!((scene.len(), harmonics(&scene).coefficients), (90_000, 48), "{file}");
        assert_eq!(scene.model(), Some(Model::Rotated4d), "{file}");
        assert_eq!((harmonics(&scene).degree, harmonics(&scene).degree_t), (3, 2), "{file}");
        assert!(harmonics(&scene).is_consistent(90_000), "{file}: every Gaussian has all coefficients");
        assert_eq!(scene.into_runtime().expect("every Gaussian can be drawn").len(), 90_000, "{file}");
    }
}
