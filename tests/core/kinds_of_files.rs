//! Recognizing files: by their contents, inside gzip and zip archives, and in folders; and files that are not captures.
//!
//! In: small captures made here, under right and wrong names, packed, beside others, and files that are something else.
//! Out: proof that each is read as its contents say, or named with a remedy.

use crate::support::gzip::gzip;
use crate::support::pth::archive;
use crate::support::trained::trained_mut;
use bevy_gs4d::codec::package::{self, WriteSettings};
use bevy_gs4d::codec::{ReadOptions, inspect, load};
use bevy_gs4d::internal::codec::read_bytes;
use bevy_gs4d::internal::codec::{Export, Exporter};
use bevy_gs4d::scene::GaussianScene;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use std::fs;
use std::io::{Cursor, Read};
use std::path::Path;
use tempfile::TempDir;
use zip::ZipArchive;

/// A PLY of one Gaussian at rest.
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
    property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\nproperty float opacity\n\
    property float scale_0\nproperty float scale_1\nproperty float scale_2\nproperty float rot_0\n\
    property float rot_1\nproperty float rot_2\nproperty float rot_3\nend_header\n\
    1 2 3 0.5 0.25 -0.5 1 -2 -3 -4 1 0 0 0\n";

fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn write(folder: &TempDir, name: &str, bytes: &[u8]) {
    let path = folder.path().join(name);
    fs::create_dir_all(path.parent().expect("a folder")).expect("the folder can be written to");
    fs::write(path, bytes).expect("the folder can be written to");
}

fn read(path: &Path) -> GaussianScene {
    load(path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// Reads a file of this name; returns the message if it is refused.
fn refusal(name: &str, bytes: &[u8]) -> String {
    let folder = folder();
    write(&folder, name, bytes);
    load(&folder.path().join(name), &ReadOptions::default()).expect_err("it is refused").to_string()
}

fn zip(entries: &[(&str, &[u8])]) -> Vec<u8> {
    archive(&entries.iter().map(|(name, bytes)| ((*name).to_owned(), bytes.to_vec())).collect::<Vec<_>>())
}

fn unzip(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut zip = ZipArchive::new(Cursor::new(bytes)).expect("an archive");
    let count = zip.len();
    let read = |index: usize| {
        let mut entry = zip.by_index(index).expect("an entry");
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).expect("a whole entry");
        (entry.name().expect("a name").into_owned(), bytes)
    };
    (0..count).map(read).collect()
}

/// Returns a file of this export, of a few Gaussians at rest.
fn exported(id: &str) -> Vec<u8> {
    let mut scene = synthesize(&SynthSettings { count: 40, ..SynthSettings::default() });
    let parameters = &mut trained_mut(&mut scene).parameters;
    (parameters.mean_t, parameters.log_scale_t, parameters.rotation_r) = Default::default();
    scene.form.truncate_colors(1, 0);
    let exporter = Exporter::new(scene, Export::of_id(id).expect("a format"), 30.0).expect("it can be exported");
    let mut bytes = Vec::new();
    exporter.write(0.0, &mut bytes).expect("memory can be written to");
    bytes
}

/// Writes the files of a SOG below a folder; returns its `meta.json`.
fn sog(folder: &TempDir, below: &str, archive: &[u8]) -> String {
    let mut meta = String::new();
    for (name, bytes) in unzip(archive) {
        write(folder, &format!("{below}{name}"), &bytes);
        if name == "meta.json" {
            meta = String::from_utf8(bytes).expect("text");
        }
    }
    meta
}

fn package() -> Vec<u8> {
    let mut bytes = Vec::new();
    let scene = synthesize(&SynthSettings { count: 30, ..SynthSettings::default() });
    package::write(&mut bytes, &scene, &WriteSettings::default()).expect("it can be written");
    bytes
}

#[test]
fn contents_decide_the_format_whatever_the_name() {
    let folder = folder();
    let files = [("ply", PLY.as_bytes().to_vec()), ("gs4d", package())];
    let exports =
        ["sog", "spz", "gltf", "splat"].map(|id| (Export::of_id(id).expect("a format").extension, exported(id)));
    for (extension, bytes) in files.into_iter().chain(exports) {
        write(&folder, &format!("right.{extension}"), &bytes);
        let expected = read(&folder.path().join(format!("right.{extension}")));
        let (upper, mixed) =
            (extension.to_uppercase(), format!("{}{}", extension[..1].to_uppercase(), &extension[1..]));
        for name in
            ["capture", "capture.bin", "capture.", "a.json", "a.pth", &format!("a.{upper}"), &format!("a.{mixed}")]
        {
            write(&folder, name, &bytes);
            assert!(read(&folder.path().join(name)) == expected, "a .{extension} as {name}");
        }
    }
    let meta = sog(&folder, "", &exported("sog"));
    write(&folder, "numbers.txt", meta.as_bytes());
    assert!(read(&folder.path().join("numbers.txt")) == read(&folder.path().join("meta.json")), "a meta.json");
}

#[test]
fn a_capture_in_gzip_is_unpacked() {
    let folder = folder();
    for (name, bytes) in [("a.ply", PLY.as_bytes().to_vec()), ("a.gs4d", package()), ("a.splat", exported("splat"))] {
        write(&folder, name, &bytes);
        let expected = read(&folder.path().join(name));
        for packed in [format!("{name}.gz"), format!("{name}.GZ"), "packed".to_owned()] {
            write(&folder, &packed, &gzip(&bytes));
            assert!(read(&folder.path().join(&packed)) == expected, "{packed}");
            let (format, _) = inspect(&folder.path().join(&packed)).expect("it is recognized");
            assert!(name.ends_with(format.extensions[0]), "{packed} is {}", format.name);
        }
    }
    let message = refusal("notes.txt.gz", &gzip(b"hello"));
    assert!(
        message.contains("unpacked from gzip, it is neither") && message.contains("text that begins with hello"),
        "{message}"
    );
    let mut cut = gzip(&PLY.as_bytes().repeat(20));
    cut.truncate(cut.len() / 2);
    let message = refusal("a.ply.gz", &cut);
    assert!(message.contains("what gzip has packed in it cannot be unpacked"), "{message}");
}

#[test]
fn the_only_capture_of_a_zip_archive_is_read() {
    let ply = PLY.as_bytes();
    let entries = [("x/readme.txt", &b"hello"[..]), ("x/scene.ply", ply), ("__MACOSX/x/._scene.ply", ply)];
    let (scene, lost) = read_bytes(Path::new("a.zip"), &zip(&entries)).expect("one capture");
    let (expected, _) = read_bytes(Path::new("a.ply"), ply).expect("a PLY");
    assert!(scene == expected, "the scene of the PLY");
    assert_eq!(lost, ["It is a zip archive, of which x/scene.ply is shown."], "the entry that is shown is stated");
    let bytes = exported("sog");
    let (inner, _) = read_bytes(Path::new("a.zip"), &zip(&[("b.sog", &bytes)])).expect("an archive in it");
    let (expected, _) = read_bytes(Path::new("b.sog"), &bytes).expect("a SOG");
    assert!(inner == expected, "an archive in the archive, by its name");
    let damaged = ply[..ply.len() - 10].to_vec();
    let message = refusal("a.zip", &zip(&[("scene.ply", &damaged)]));
    assert!(message.contains("a.zip: its file scene.ply: "), "the file in the archive is named: {message}");
}

#[test]
fn an_archive_of_no_capture_or_several_is_refused_with_their_names() {
    let ply = PLY.as_bytes();
    for (entries, parts) in [
        (
            &[("a/one.ply", ply), ("b/two.ply", ply)][..],
            &["2 captures", "a/one.ply, b/two.ply", "give one of them"][..],
        ),
        (&[("f1.ply", ply), ("f2.ply", ply)], &["2 captures", "unpack it, and give the folder of the frames"]),
        (&[("a.txt", b"hello"), ("b.png", b"\x89PNG\r\n\x1a\n")], &["without a capture", "a.txt, b.png"]),
    ] {
        let message = refusal("a.zip", &zip(entries));
        assert!(parts.iter().all(|part| message.contains(part)), "{parts:?}: {message}");
    }
    let many: Vec<(String, Vec<u8>)> = (0..9).map(|at| (format!("{at}x.txt"), b"hello".to_vec())).collect();
    let message = refusal("a.zip", &archive(&many));
    assert!(message.contains("5x.txt and 3 more"), "few names of many: {message}");
}

#[test]
fn an_entry_that_states_too_many_bytes_is_refused() {
    let ply = PLY.as_bytes();
    let mut bytes = zip(&[("scene.ply", ply)]);
    let stated = (ply.len() as u32).to_le_bytes();
    for at in 0..bytes.len() - 4 {
        // The size before packing, in both headers.
        let offset = if bytes[at..].starts_with(b"PK\x03\x04") { 22 } else { 24 };
        if bytes[at..].starts_with(b"PK\x03\x04") || bytes[at..].starts_with(b"PK\x01\x02") {
            assert_eq!(bytes[at + offset..at + offset + 4], stated, "the size");
            bytes[at + offset..at + offset + 4].copy_from_slice(&0x7000_0000_u32.to_le_bytes());
        }
    }
    let message = refusal("a.zip", &bytes);
    assert!(message.contains("scene.ply") && message.contains("1879048192 bytes"), "file and claim: {message}");
}

#[test]
fn files_in_place_of_a_capture_are_named_with_the_remedy_whatever_their_name() {
    let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 62000123\n";
    let page = b"<!DOCTYPE html>\n<html><head><title>Sign in</title></head></html>";
    for extension in ["ply", "splat", "ksplat", "sog", "spz", "pth", "gs4d", "glb", "json", "4dgs", "zip"] {
        let name = format!("a.{extension}");
        let message = refusal(&name, pointer);
        let parts = [&*name, "Git LFS", "62000123 bytes", "git lfs pull"];
        assert!(parts.iter().all(|part| message.contains(part)), "{name}: {message}");
        let message = refusal(&name, page);
        assert!(message.contains("page of HTML") && message.contains("download"), "{name}: {message}");
        for (bytes, looks) in [
            (&b""[..], "it is empty"),
            (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "it looks like a PNG picture"),
            (b"\0\0\0\x20ftypisom\0\0\x02\0", "it looks like a video"),
            (b"<?xml version=\"1.0\"?><Error/>", "it is XML"),
            (b"7z\xbc\xaf\x27\x1c\0\x04", "unpack it first"),
        ] {
            let message = refusal(&name, bytes);
            assert!(message.contains(looks) && message.contains("neither"), "{name}: {message}");
        }
    }
    let message = refusal("a.json", b"{\"frames\": [{\"file_path\": \"a\"}]}");
    assert!(message.contains("a dataset is the folder"), "views are no capture: {message}");
}

#[test]
fn the_folder_of_a_sog_is_its_meta_json() {
    let folder = folder();
    let bytes = exported("sog");
    sog(&folder, "capture/", &bytes);
    write(&folder, "capture/notes.txt", b"hello");
    let expected = read(&folder.path().join("capture/meta.json"));
    assert!(read(&folder.path().join("capture")) == expected, "the folder");
    let files: Vec<(String, Vec<u8>)> = unzip(&bytes);
    let below: Vec<(String, Vec<u8>)> =
        files.iter().map(|(name, bytes)| (format!("a/b/{name}"), bytes.clone())).collect();
    write(&folder, "below.sog", &archive(&below));
    assert!(read(&folder.path().join("below.sog")) == expected, "an archive with all files in a folder");
    assert!(read_bytes(Path::new("a.sog"), &bytes).expect("an archive").0 == expected, "an archive of the files");
    write(&folder, "other/meta.json", b"{\"fps\": 30}");
    let message = load(&folder.path().join("other"), &ReadOptions::default()).expect_err("another folder").to_string();
    assert!(message.contains("meta.json or lod-meta.json"), "{message}");
    for name in ["other/f1.ply", "other/f2.ply"] {
        write(&folder, name, PLY.as_bytes());
    }
    assert_eq!(read(&folder.path().join("other")).len(), 2, "a sequence beside a meta.json that is not of a SOG");
}

#[test]
fn the_folder_of_a_streamed_sog_is_its_lod_meta_json() {
    let folder = folder();
    let bytes = exported("sog");
    sog(&folder, "streamed/0_0/", &bytes);
    let count = read(&folder.path().join("streamed/0_0")).len();
    let stream = format!(
        "{{\"version\": 1, \"lodLevels\": 1, \"filenames\": [\"0_0/meta.json\"],
          \"tree\": {{\"lods\": {{\"0\": {{\"file\": 0, \"offset\": 0, \"count\": {count}}}}}}}}}"
    );
    write(&folder, "streamed/lod-meta.json", stream.as_bytes());
    let expected = read(&folder.path().join("streamed/lod-meta.json"));
    assert_eq!(expected.len(), count, "all Gaussians");
    assert!(read(&folder.path().join("streamed")) == expected, "the folder");
    let files = unzip(&bytes).into_iter().map(|(name, bytes)| (format!("x/0_0/{name}"), bytes));
    let all: Vec<_> = files.chain([("x/lod-meta.json".to_owned(), stream.into_bytes())]).collect();
    write(&folder, "streamed.zip", &archive(&all));
    assert!(read(&folder.path().join("streamed.zip")) == expected, "the folder in an archive");
}

#[test]
fn a_byte_order_mark_before_json_is_skipped() {
    let folder = folder();
    let meta = sog(&folder, "", &exported("sog"));
    let expected = read(&folder.path().join("meta.json"));
    write(&folder, "meta.json", format!("\u{feff}{meta}").as_bytes());
    assert!(read(&folder.path().join("meta.json")) == expected && read(folder.path()) == expected, "a meta.json");
    let glb = exported("gltf");
    let length = u32::from_le_bytes([glb[12], glb[13], glb[14], glb[15]]) as usize;
    let (json, binary) = glb[20..].split_at(length);
    let mut document: serde_json::Value = serde_json::from_slice(json).expect("JSON");
    document["buffers"][0]["uri"] = "a.bin".into();
    write(&folder, "a.bin", &binary[8..]);
    write(&folder, "a.glb", &glb);
    for text in [document.to_string(), format!("\u{feff}{document}")] {
        write(&folder, "a.gltf", text.as_bytes());
        assert!(read(&folder.path().join("a.gltf")) == read(&folder.path().join("a.glb")), "a glTF file as text");
    }
}

#[test]
fn numbers_that_json_does_not_have_are_named() {
    let folder = folder();
    let meta = sog(&folder, "", &exported("sog"));
    let broken = meta.replacen("\"mins\":[", "\"mins\":[NaN,", 1);
    assert_ne!(broken, meta, "a number is replaced");
    write(&folder, "meta.json", broken.as_bytes());
    let message = load(folder.path(), &ReadOptions::default()).expect_err("no JSON").to_string();
    assert!(message.contains("has NaN, which JSON does not have"), "{message}");
    let message =
        refusal("a.gltf", b"{\"asset\": {\"version\": \"2.0\"},\n \"nodes\": [{\"scale\": [1, -Infinity, 1]}]}");
    assert!(message.contains("line 2 has Infinity"), "{message}");
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_refused_without_waiting_for_them() {
    use std::os::unix::fs::symlink;
    use std::process::Command;
    let folder = folder();
    let meta = sog(&folder, "", &exported("sog"));
    let pipe = folder.path().join("pipe.ply");
    let made = Command::new("mkfifo").arg(&pipe).status();
    assert!(made.is_ok_and(|status| status.success()), "a named pipe can be made");
    let message = load(&pipe, &ReadOptions::default()).expect_err("the pipe has no writer").to_string();
    assert!(message.contains("pipe.ply: is a pipe or a device"), "{message}");
    let textures: Vec<&str> = meta.split('"').filter(|word| word.ends_with(".webp")).collect();
    let texture = folder.path().join(textures[0]);
    for target in [pipe.as_path(), Path::new("/dev/zero")] {
        fs::remove_file(&texture).expect("the texture is there");
        symlink(target, &texture).expect("a link can be made");
        let message = load(folder.path(), &ReadOptions::default()).expect_err("no texture").to_string();
        assert!(message.contains(textures[0]) && message.contains("is a pipe or a device"), "{message}");
    }
}
