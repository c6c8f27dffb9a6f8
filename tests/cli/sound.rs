//! `gs4d sound` and `gs4d bake --audio`, run as a user runs them.
//!
//! In: a small capture, a tone as Ogg Vorbis. Out: proof that a sound is put into a package, listed, taken out byte for
//! byte, replaced and removed, and that files that are no sounds are refused by one sentence and write nothing.

use crate::support::capture::Capture;
use crate::support::command::{arguments, folder, gs4d, scene};
use crate::support::folders::contents;
use crate::support::wave::wave;
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use glam::{UVec2, Vec3};
use std::fs;
use std::path::Path;

const TONE: &[u8] = include_bytes!("../core/sounds/tone.ogg");

/// Returns the bytes of the sound file that a package carries.
fn carried(path: &Path) -> Option<Vec<u8>> {
    let scene = codec::load(path, &ReadOptions::default()).expect("the package can be read");
    scene.sound.map(|sound| sound.bytes().to_vec())
}

#[test]
fn a_sound_is_put_into_a_package_and_comes_out_again() {
    let folder = folder();
    let (capture, path) = (scene(&folder, "50"), |name: &str| folder.path().join(name));
    let (tone, song, loud) = (path("tone.ogg"), path("song.wav"), path("loud.gs4d"));
    fs::write(&tone, TONE).expect("the folder can be written to");
    fs::write(&song, wave(1, 8000, &[0; 8000])).expect("the folder can be written to");
    let put = gs4d(&arguments!["sound", &capture, &tone, "-o", &loud]);
    assert!(put.err.contains("note: the sound lasts 0.50 s and the capture"), "lengths that differ: {}", put.err);
    let text = put.text();
    assert!(text.contains("0.50 s, 22050 Hz, two channels"), "the kind of the sound: {text}");
    assert_eq!(carried(&loud).as_deref(), Some(TONE), "the bytes of the file");
    let info = gs4d(&arguments!["info", &loud, "--json"]).json();
    assert_eq!(info["sound"]["bytes"], TONE.len(), "info lists the sound: {info}");
    assert!(gs4d(&arguments!["info", &loud]).text().contains("a file of"), "info names the sound");
    let again = path("again.ogg");
    let taken = gs4d(&arguments!["sound", &loud, "--extract", &again, "--json"]).json();
    assert_eq!(taken["bytes_sound"], TONE.len(), "the report has the size: {taken}");
    assert_eq!(fs::read(&again).expect("the file is written"), TONE, "the same bytes");
    gs4d(&arguments!["sound", &loud, "--extract", path("again.wav")]).must_fail("name it .ogg");
    // Other verbs keep it.
    let packed = path("packed.gs4d");
    gs4d(&arguments!["convert", &loud, &packed, "--form", "runtime"]).text();
    assert_eq!(carried(&packed).as_deref(), Some(TONE), "convert keeps the sound");
    let other = path("other.gs4d");
    gs4d(&arguments!["sound", &loud, &song, "-o", &other]).text();
    assert_eq!(carried(&other), fs::read(&song).ok(), "another sound takes its place");
    let silent = path("silent.gs4d");
    let removed = gs4d(&arguments!["sound", &loud, "--remove", "-o", &silent, "--json"]).json();
    assert_eq!((&removed["removed"], carried(&silent)), (&true.into(), None), "the sound is removed: {removed}");
    let plain = path("plain.gs4d");
    gs4d(&arguments!["convert", &capture, &plain]).text();
    assert_eq!(fs::read(&silent).ok(), fs::read(&plain).ok(), "without its sound it is the package of before");
}

#[test]
fn a_bake_adds_a_sound_and_colliders_and_writes_chunk_files() {
    let scene = synthesize(&SynthSettings { count: 2000, duration_seconds: 4.0, ..SynthSettings::default() });
    let capture = Capture::new(scene, Vec3::ZERO, 4, 4, UVec2::splat(48), true);
    let (out, tone) = (capture.path("out.gs4d"), capture.path("tone.ogg"));
    fs::write(&tone, TONE).expect("the folder can be written to");
    let fixed = arguments!["bake", &capture.scene, "--data", &capture.data, "-o", &out, "--engine", "cpu", "--json"];
    let with = |more: &[&str]| {
        let more = more.iter().map(Into::into).collect();
        gs4d(&[fixed.to_vec(), arguments!["--keep", "1500"].to_vec(), more].concat()).json()
    };
    let plain = with(&["--keep-work"]);
    assert_eq!((plain.get("chunks"), carried(&out)), (None, None), "a small package has neither: {plain}");
    let tone = tone.to_str().expect("a path of text");
    let all = with(&["--keep-work", "--audio", tone, "--colliders", "1", "--stream"]);
    assert_eq!(carried(&out).as_deref(), Some(TONE), "the sound is in the package, also after an earlier bake");
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    assert!(info["colliders"]["triangles"].as_u64() > Some(10), "the package has colliders: {info}");
    let index = capture.path("out.stream/index.gs4d");
    assert_eq!(all["chunks"]["index"], index.display().to_string(), "the report names the index: {all}");
    let files = all["chunks"]["files"].as_u64().expect("a number of files");
    assert!(files > 2, "several chunk files, not {files}");
    let joined = capture.path("joined.gs4d");
    gs4d(&arguments!["join", capture.path("out.stream"), "-o", &joined]).text();
    let count = |path: &Path| gs4d(&arguments!["info", path, "--json"]).json()["gaussians"].as_u64();
    assert!(count(&joined) >= Some(1500), "every Gaussian is in the chunk files: {:?}", count(&joined));
    assert_eq!(carried(&joined).as_deref(), Some(TONE), "the sound is beside them");
    assert_eq!(
        fs::read(capture.path("out.stream/index.ogg")).ok().as_deref(),
        Some(TONE),
        "under the name of the index"
    );
    // Chunk files of an earlier package are replaced by --stream alone, and never if the input is among them.
    let chunks = || contents(&capture.path("out.stream"));
    let before = chunks();
    let quiet = gs4d(&[fixed.to_vec(), arguments!["--keep", "1000", "--keep-work"].to_vec()].concat());
    assert!(quiet.err.contains("is that of an earlier package: --stream replaces"), "a note: {}", quiet.err);
    assert_eq!(chunks(), before, "they stay");
    with(&["--keep-work", "--stream"]);
    assert_ne!(chunks(), before, "--stream replaces them");
    let first = capture.path("out.stream").join(format!("chunk-00001-of-{files:05}.gs4d"));
    assert!(!capture.path("out.stream/index.ogg").exists(), "the sound of the earlier package is gone");
    let inside = arguments!["bake", &first, "--data", &capture.data, "-o", &out, "--engine", "cpu", "--stream"];
    gs4d(&inside).must_fail("would be replaced by the chunk files: name another OUT");
}

#[test]
fn what_is_no_sound_is_refused_and_nothing_is_written() {
    let folder = folder();
    let (capture, path) = (scene(&folder, "50"), |name: &str| folder.path().join(name));
    let (noise, six) = (path("noise.ogg"), path("six.wav"));
    fs::write(&noise, b"no sound at all").expect("the folder can be written to");
    fs::write(&six, wave(6, 8000, &[0; 600])).expect("the folder can be written to");
    let (before, out) = (contents(folder.path()), path("out.gs4d"));
    let refused = |command: &[std::ffi::OsString], reason: &str| {
        gs4d(command).must_fail(reason);
        assert_eq!(contents(folder.path()), before, "nothing is written: {reason}");
    };
    refused(&arguments!["sound", &capture, &noise, "-o", &out], "noise.ogg: is not a sound in Ogg Vorbis or WAV");
    refused(&arguments!["sound", &capture, &six, "-o", &out], "six.wav: has 6 channels");
    refused(&arguments!["sound", &capture, path("none.ogg"), "-o", &out], "none.ogg");
    refused(&arguments!["sound", &capture, "--remove", "-o", &out], "carries no sound");
    refused(&arguments!["sound", &capture, "--extract", path("a.ogg")], "carries no sound");
    refused(&arguments!["bake", &capture, "--data", folder.path(), "--audio", &noise, "-o", &out], "noise.ogg: is not");
}
