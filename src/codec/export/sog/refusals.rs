//! Tests of the SOG family: damaged files are refused; other versions and formats are read from the same textures.
//!
//! In: files of the writers with another `meta.json`, or with other bytes. Out: proof that each fault has its message.

use super::archive;
use super::round_trip::{columns, read, unpacked, written};
use super::texture;
use crate::codec::import::source::{InMemory, Source};
use crate::codec::import::{Imported, sog};
use crate::codec::options::ReadOptions;
use crate::gaussian::{Harmonics, Parameters};
use crate::scene::random::Random;
use crate::scene::{GaussianScene, SceneForm, UpAxis};
use serde_json::{Value, json};

/// Returns an archive after a change of its `meta.json`.
fn changed(bytes: &[u8], change: impl Fn(&mut Value)) -> Vec<u8> {
    let (mut meta, mut entries) = unpacked(bytes);
    change(&mut meta);
    for entry in &mut entries {
        if entry.name == "meta.json" {
            entry.bytes = serde_json::to_vec(&meta).expect("JSON");
        }
    }
    let mut bytes = Vec::new();
    archive::write(&entries, &mut bytes).expect("memory can be written");
    bytes
}

#[test]
fn a_wrong_meta_json_is_refused_with_the_fault() {
    let moving = written("sogst", &columns(600, 1));
    let still = still(600);
    let set = |path: &'static [&str], value: Value| {
        move |meta: &mut Value| {
            let part = path.iter().fold(meta, |part, &key| &mut part[key]);
            *part = value.clone();
        }
    };
    assert!(read(&changed(&still, |_| {})).is_ok() && read(&changed(&moving, |_| {})).is_ok(), "intact");
    let cases: &[(&[u8], &'static [&str], Value, &str)] = &[
        (&still, &["count"], json!(673), "does not fit 673 Gaussians"),
        (&still, &["count"], json!(1_u64 << 50), "meta.json states"),
        (&still, &["count"], json!(-1), "meta.json cannot be read"),
        (&still, &["version"], json!(3), "version 3"),
        (&still, &["means", "files"], json!(["means_l.webp", "gone.webp"]), "gone.webp is missing"),
        (&still, &["means", "files"], json!(["means_l.webp"]), "meta.json cannot be read"),
        (&still, &["means", "mins"], json!([1e300, 0, 0]), "not finite"),
        (&still, &["scales", "codebook"], json!([]), "scales without entries"),
        (&still, &["scales", "codebook"], json!([1.0]), "beyond the end of the codebook of scales"),
        (&still, &["quats", "files"], json!(["sh0.webp"]), "no rotation"),
        (&still, &["shN", "count"], json!(3), "a centroid that is not there"),
        (&still, &["shN", "count"], json!(70_000), "does not fit 70000 centroids"),
        (&still, &["shN", "bands"], json!(2), "of degree 2"),
        (&still, &["shN", "files"], json!(["scales.webp", "shN_labels.webp"]), "does not have 64 centroids"),
        (&still, &["model"], json!("2dgs"), "model \"2dgs\""),
        (&still, &["format"], json!("sog\u{1b}9"), "type \"sog\\u{1b}9\""),
        (&still, &["type"], json!("sog4d_multi"), "several captures"),
        (&moving, &["version"], json!(2), "version 2"),
        (&moving, &["motion", "degree"], json!(2), "without accel"),
        (&moving, &["motion", "degree"], json!(3), "degree 3"),
        (&moving, &["time", "max"], json!(0), "no interval"),
        (&moving, &["segments", "persistent"], json!([0, 1]), "groups"),
        (&moving, &["streams", "segments"], json!([]), "groups"),
        (&moving, &["segments"], Value::Null, "groups"),
        (&moving, &["trbf", "sigma", "codebook"], json!([0.1]), "beyond the end of the codebook of trbf"),
        (&moving, &["trbf", "sigma", "codebook"], json!(vec![0.0; 256]), "zero"),
    ];
    for (bytes, path, value, expected) in cases {
        let message = read(&changed(bytes, set(path, value.clone()))).map(|imported| imported.scene.into_runtime());
        let message = match message {
            Err(message) => message,
            Ok(Err(invalid)) => invalid.to_string(),
            Ok(Ok(_)) => String::new(),
        };
        assert!(message.contains(expected), "{path:?} = {value}: the message says \"{expected}\": {message}");
    }
}

#[test]
fn a_cut_or_changed_file_never_panics() {
    for bytes in [still(300), written("sogst", &columns(300, 1))] {
        let mut random = Random::new(11);
        let mut at = |length: usize| random.below(length);
        let entries = unpacked(&bytes).1;
        for trial in 0..400 {
            let mut other = bytes.clone();
            match trial % 4 {
                0 => other.truncate(at(bytes.len())),
                1 => other[at(bytes.len())] ^= 1 << at(8),
                // With the right checksum.
                _ => {
                    let mut entries = entries.clone();
                    let entry = at(entries.len());
                    let entry = &mut entries[entry].bytes;
                    for _ in 0..trial % 3 + 1 {
                        let place = at(entry.len());
                        entry[place] = at(256) as u8;
                    }
                    other.clear();
                    archive::write(&entries, &mut other).expect("memory can be written");
                }
            }
            let found = read(&other).map(|imported| imported.scene.into_runtime().map(|scene| scene.check()));
            assert!(!matches!(found, Ok(Ok(Err(_)))), "a scene that is read is consistent: {found:?}");
        }
    }
}

/// Returns a SOG of Gaussians at rest with color of degree 1.
fn still(count: usize) -> Vec<u8> {
    let mut still = columns(count, 1);
    still.motion.clear();
    written("sog", &still)
}

fn at_rest(scene: GaussianScene) -> (Parameters, Harmonics) {
    match scene.form {
        SceneForm::Trained(trained) => (trained.parameters, trained.harmonics),
        form @ SceneForm::Ready(_) => panic!("Gaussians at rest are in the trained form: {form:?}"),
    }
}

#[test]
fn version_1_has_limits_in_place_of_codebooks() {
    let bytes = still(600);
    let book: Vec<f64> = (0..256).map(|code| f64::from(code) / 255.0 - 0.5).collect();
    let second = changed(&bytes, |meta| {
        for name in ["scales", "sh0", "shN"] {
            meta[name]["codebook"] = json!(book);
        }
    });
    let first = changed(&bytes, as_version_1);
    let [(first, first_color), (second, second_color)] =
        [first, second].map(|bytes| at_rest(read(&bytes).expect("intact").scene));
    assert_eq!((first.mean, first.rotation_l), (second.mean, second.rotation_l), "means and rotations are coded alike");
    let scales = first.log_scale.as_flattened().iter().zip(second.log_scale.as_flattened());
    let colors = first_color.values.iter().zip(&second_color.values);
    assert!(scales.chain(colors).all(|(a, b)| (a - b).abs() < 1e-6), "limits are the ends of an even codebook");
    for (logit, other) in first.opacity_logit.into_iter().zip(second.opacity_logit) {
        let code = 255.0 / (1.0 + (-other).exp());
        assert!((logit - (-6.0 + 12.0 * code / 255.0)).abs() < 1e-3, "opacities are coded as logits");
    }
}

#[test]
fn the_least_opacity_of_version_1_is_not_0() {
    let mut entries = unpacked(&still(600)).1;
    let codes: Vec<[u8; 4]> = (0..600).map(|index| [9, 8, 7, if index < 5 { 0 } else { 255 }]).collect();
    let colors = entries.iter_mut().find(|entry| entry.name == "sh0.webp").expect("is there");
    colors.bytes = texture::encode(&codes).expect("memory");
    let mut second = Vec::new();
    archive::write(&entries, &mut second).expect("memory can be written");
    let first = read(&changed(&second, as_version_1)).expect("intact");
    assert_eq!(first.lost, [""; 0], "nothing is lost");
    let (parameters, _) = at_rest(first.scene);
    assert_eq!(parameters.opacity_logit[4..6], [-6.0, 6.0], "the ends of the limits, of all Gaussians");
    let second = read(&second).expect("intact");
    assert_eq!(second.scene.len(), 595, "the code 0 of version 2 is the opacity 0");
    assert!(second.lost[0].starts_with("5 of 600"), "it is said: {:?}", second.lost);
}

/// Changes a `meta.json` of version 2 to one of version 1, with limits from -0.5 to 0.5 and opacities from -6 to 6.
fn as_version_1(meta: &mut Value) {
    let (narrow, wide) = (json!([-0.5, -0.5, -0.5]), json!([0.5, 0.5, 0.5]));
    let [means, scales, sh0, rest] = ["means", "scales", "sh0", "shN"].map(|name| meta[name].clone());
    *meta = json!({
        "means": { "shape": [600, 3], "mins": means["mins"], "maxs": means["maxs"], "files": means["files"] },
        "scales": { "mins": narrow, "maxs": wide, "files": scales["files"] },
        "quats": meta["quats"],
        "sh0": { "mins": [-0.5, -0.5, -0.5, -6.0], "maxs": [0.5, 0.5, 0.5, 6.0], "files": sh0["files"] },
        "shN": { "mins": -0.5, "maxs": 0.5, "files": rest["files"] },
    });
}

#[test]
fn a_tsog_of_another_profile_or_timeline_is_refused() {
    let bytes = still(600);
    let profile = json!({ "id": "org.opsiclear.tsog-playback", "version": 1 });
    let tsog = |fields: Value| {
        changed(&bytes, |meta| {
            meta["version"] = json!(4);
            for (name, field) in fields.as_object().expect("fields") {
                meta[name] = field.clone();
            }
        })
    };
    let scene = read(&tsog(json!({ "profile": profile }))).expect("intact").scene;
    assert_eq!((scene.len(), scene.playback.up), (600, UpAxis::PosY), "without a timeline it is at rest, y up");
    let files = json!(["scales.webp", "sh0.webp"]);
    let timeline = json!({ "type": 1, "mins": [0, 0.1], "maxs": [1, 0.2], "files": files });
    let scene = read(&tsog(json!({ "timeline": timeline }))).expect("intact, without a profile").scene;
    assert_eq!(scene.playback.duration_seconds, 299.0 / 30.0, "300 frames, unless it states a duration");
    for (fields, expected) in [
        (json!({ "profile": { "id": "other", "version": 1 } }), "profile other"),
        (json!({ "profile": { "id": "org.opsiclear.tsog-playback", "version": 2 } }), "version 2"),
        (json!({ "timeline": { "type": 2, "files": files } }), "type 2"),
        (json!({ "timeline": { "type": 0, "N": 0, "delta": 1, "files": files } }), "number of frames"),
        (json!({ "timeline": { "type": 0, "N": 65536, "delta": 1, "files": files } }), "65536 frames"),
        (json!({ "timeline": { "type": 0, "N": 5, "delta": 5, "files": files } }), "delta"),
        (json!({ "timeline": { "type": 1, "files": files } }), "without mins and maxs"),
        (json!({ "timeline": timeline, "playback": { "duration": -1 } }), "--duration sets another"),
        (json!({ "timeline": timeline, "temporal": { "scales": {} } }), "scales"),
        (json!({ "temporal": { "means": { "mins": [[0, 0, 0]], "maxs": [[1, 1, 1]], "files": [] } } }), "timeline"),
    ] {
        let message = read(&tsog(fields.clone())).expect_err("refused");
        assert!(message.contains(expected), "{fields}: the message says \"{expected}\": {message}");
    }
    let bytes = tsog(json!({ "timeline": timeline, "playback": { "duration": -1 } }));
    let options = ReadOptions { duration_seconds: Some(2.5), ..ReadOptions::default() };
    let found = sog::read(&Source { bytes: &bytes, beside: &InMemory::default() }, &options).expect("with a duration");
    assert_eq!(found.scene.playback.duration_seconds, 2.5, "the remedy works");
}

#[test]
fn a_streamed_sog_is_read_in_the_ranges_of_its_finest_level() {
    let (mut meta, entries) = unpacked(&still(600));
    let mut files = InMemory::default();
    for folder in ["0_0", "1_0"] {
        files.0.extend(entries.iter().map(|entry| (format!("{folder}/{}", entry.name), entry.bytes.clone())));
    }
    let read = |files: &InMemory, chunks: Value| -> Result<Imported, String> {
        let bytes = json!({
            "lodLevels": 2, "filenames": ["0_0/meta.json", "1_0/meta.json"], "environment": null,
            "tree": { "children": chunks },
        });
        let bytes = serde_json::to_vec(&bytes).expect("JSON");
        let source = Source { bytes: &bytes, beside: files };
        sog::read(&source, &ReadOptions::default()).map_err(|error| error.to_string())
    };
    let chunk = |file, offset, count| json!({ "file": file, "offset": offset, "count": count });
    let both = json!([
        { "lods": { "0": chunk(0, 0, 200), "1": chunk(1, 0, 10) } },
        { "lods": { "0": chunk(0, 200, 300), "1": chunk(1, 10, 20) } },
    ]);
    let fine = read(&files, both.clone()).expect("intact");
    assert_eq!((fine.scene.len(), fine.lost.len()), (500, 0), "the ranges of level 0");
    let coarser = json!([{ "lods": { "0": chunk(0, 0, 200) } }, { "lods": { "1": chunk(1, 0, 10) } }]);
    assert_eq!(read(&files, coarser).expect("intact").scene.len(), 210, "a part without level 0 has its level 1");
    for (chunks, expected) in [
        (json!([{ "lods": { "0": chunk(0, 0, 601) } }]), "600 Gaussians, fewer than"),
        (json!([{ "lods": { "0": chunk(0, 0, 9) } }, { "lods": { "0": chunk(0, 8, 9) } }]), "twice"),
        (json!([{ "lods": { "0": chunk(7, 0, 9) } }]), "not in its list"),
        (json!([{ "lods": { "0": chunk(0, u64::MAX, 9) } }]), "beyond every file"),
        (json!([]), "no Gaussians"),
    ] {
        let message = read(&files, chunks.clone()).expect_err("refused");
        assert!(message.contains(expected), "{chunks}: the message says \"{expected}\": {message}");
    }
    files.0.remove("0_0/sh0.webp");
    let coarse = read(&files, both.clone()).expect("level 1 is there");
    assert_eq!(coarse.scene.len(), 30, "the ranges of level 1");
    assert!(coarse.lost[0].contains("level 1") && coarse.lost[0].contains("0_0/sh0.webp"), "{:?}", coarse.lost);
    meta["count"] = json!("many");
    files.0.insert("1_0/meta.json".to_owned(), serde_json::to_vec(&meta).expect("JSON"));
    let message = read(&files, both).expect_err("damaged");
    assert!(message.contains("meta.json cannot be read"), "damage is not absence: {message}");
}
