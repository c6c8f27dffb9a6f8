//! Packages of which only the beginning is there.
//!
//! In: synthetic packages, and the bundled captures, packed in layers. Out: proof that the beginning of a package is a
//! package of its first layers, that the bundled island can be drawn early, that each further layer is closer to the
//! whole capture on the CPU, and that larger and more opaque Gaussians make up for those that are missing.

use crate::support::bundled::{BUNDLED, bundled, drawn, view_of};
use crate::support::psnr::psnr;
use bevy_gs4d::codec::package::{self, Beginning, PackageError, WriteSettings};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{Form, GaussianScene, PackedColors, PackedScene, Packing, SceneForm};
use bevy_gs4d::view::{Frame, Thinning, View};
use glam::Vec3;
use std::fs;
use std::io::Cursor;
use std::path::Path;

/// Returns the package of a bundled capture in layers, and a view of it.
fn layered(name: &str, up: Vec3) -> (Vec<u8>, View) {
    let scene = bundled(name).unpacked().into_runtime().expect("it can be drawn");
    let view = view_of(&scene, up);
    let packed = scene.pack(&Packing { progressive: true, ..Packing::default() }).expect("the scene fits");
    let mut bytes = Vec::new();
    package::write(&mut bytes, &GaussianScene::from(packed), &WriteSettings { level: 1 }).expect("it can be written");
    (bytes, view)
}

fn drawn_package(package: &[u8], view: View, thinning: Thinning) -> Frame {
    let scene = package::read(Cursor::new(package)).expect("a package");
    drawn(&scene.into_runtime().expect("it can be drawn"), view, thinning)
}

#[test]
fn each_layer_is_closer_to_the_capture() {
    for (name, up) in BUNDLED {
        let (bytes, view) = layered(name, up);
        let whole = drawn_package(&bytes, view, Thinning::default());
        let beginning = Beginning::of(&bytes).expect("a package").expect("the header is there");
        let mut before = 0.0;
        for (layer, &end) in beginning.layers().iter().enumerate() {
            let part = beginning.package(&bytes[..end], layer).expect("the layer is there");
            let share = beginning.share(layer);
            let bare = psnr(&drawn_package(&part, view, Thinning::default()), &whole);
            let filled = psnr(&drawn_package(&part, view, Thinning::new(1e-30, share)), &whole);
            println!("{name}, {share:.2} of the Gaussians: {bare:.2} dB unchanged, {filled:.2} dB filled");
            assert!(filled > 16.0 && filled > before, "{name}, {share}: {filled:.2} dB, more than {before:.2}");
            assert!(filled > bare + 0.3 || share == 1.0, "{name}, {share}: {filled:.2} dB filled, {bare:.2} unchanged");
            before = filled;
        }
        assert_eq!(beginning.layers().len(), 3, "{name}: a quarter, a half, all in plain color");
    }
}

/// Returns a synthetic package, and its Gaussians.
fn synthetic(progressive: bool) -> (Vec<u8>, PackedScene) {
    let scene = synthesize(&SynthSettings { count: 5_000, degree: 2, ..SynthSettings::default() });
    let runtime = scene.into_runtime().expect("a synthetic scene can be drawn");
    let packed = runtime.pack(&Packing { progressive, ..Packing::default() }).expect("the scene fits");
    let (mut bytes, scene) = (Vec::new(), GaussianScene::from(packed));
    package::write(&mut bytes, &scene, &WriteSettings::default()).expect("it can be written");
    let read = package::read(Cursor::new(&bytes)).expect("it can be read");
    assert_eq!(read, scene, "a package in layers is an ordinary one");
    (bytes, packed_of(scene))
}

fn packed_of(scene: GaussianScene) -> PackedScene {
    match scene.form {
        SceneForm::Ready(Form::Packed(packed)) => packed,
        SceneForm::Ready(Form::Sliced(_)) | SceneForm::Trained(_) => panic!("the scene is packed"),
    }
}

fn beginning(bytes: &[u8]) -> Beginning {
    Beginning::of(bytes).expect("the header is intact").expect("the header is whole")
}

#[test]
fn each_layer_is_a_package_of_the_first_gaussians_in_plain_color() {
    let (bytes, all) = synthetic(true);
    let found = beginning(&bytes[..8192]);
    assert_eq!((found.layers().len(), found.share(9)), (3, 1.0), "{:?} of {} bytes", found.layers(), bytes.len());
    let info = package::inspect(Cursor::new(&bytes)).expect("the package can be inspected");
    assert_eq!(info.layers, found.layers(), "`inspect` lists them");
    for (layer, (&end, count)) in found.layers().iter().zip([1_280, 2_560, 5_000]).enumerate() {
        assert!(found.package(&bytes[..end - 1], layer).is_err(), "a byte of layer {layer} is missing");
        let part = found.package(&bytes[..end], layer).expect("the layer is there");
        let part = packed_of(package::read(Cursor::new(part)).expect("the layers are a package"));
        assert_eq!(part.records[..], all.records[..count], "the first Gaussians");
        assert_eq!(part.ranges[..], all.ranges[..PackedScene::range_count(count)], "and their ranges");
        assert!((found.share(layer) - count as f32 / 5_000.0).abs() < 1e-6, "their share: {}", found.share(layer));
        let (PackedColors::Whole(plain), PackedColors::Whole(whole)) = (part.colors, &all.colors) else {
            panic!("colors are whole");
        };
        assert_eq!((plain.degree, plain.values.len()), (0, 3 * count), "plain color");
        assert_eq!(plain.values[..3], whole.values[..3], "the first coefficients");
    }
    assert!(found.package(&bytes, 3).is_err(), "there is no fourth layer");
}

#[test]
fn a_package_of_one_layer_is_drawn_once_all_gaussians_are_there() {
    let (bytes, _) = synthetic(false);
    let found = beginning(&bytes);
    assert_eq!((found.layers().len(), found.share(0)), (1, 1.0), "{:?}", found.layers());
    assert!(found.layers()[0] < bytes.len() * 9 / 10, "the other coefficients come later: {:?}", found.layers());
}

#[test]
fn fewer_bytes_than_the_header_are_nothing_yet() {
    let (bytes, _) = synthetic(true);
    for length in [0, 3, 12, 20, 100] {
        assert!(matches!(Beginning::of(&bytes[..length]), Ok(None)), "{length} bytes");
    }
}

#[test]
fn other_files_and_damaged_headers_are_refused() {
    assert!(matches!(Beginning::of(b"ply\nformat"), Err(PackageError::NotAPackage)), "another format");
    let (mut bytes, _) = synthetic(true);
    bytes[30] ^= 1;
    assert!(matches!(Beginning::of(&bytes), Err(PackageError::HeaderChecksum)), "a damaged header");
    bytes[15] = 0xff;
    assert!(matches!(Beginning::of(&bytes), Err(PackageError::HeaderTooLong { .. })), "too long a header");
}

#[test]
fn a_damaged_layer_is_found_when_it_is_read() {
    let (mut bytes, _) = synthetic(true);
    let found = beginning(&bytes);
    let end = found.layers()[0];
    bytes[end - 1] ^= 1;
    let part = found.package(&bytes[..end], 0).expect("its bytes are there");
    let read = package::read(Cursor::new(part));
    assert!(matches!(read, Err(PackageError::SectionChecksum { .. })), "found {read:?}");
}

#[test]
fn scenes_in_other_forms_are_drawn_whole() {
    let scene = synthesize(&SynthSettings { count: 300, ..SynthSettings::default() });
    let mut bytes = Vec::new();
    package::write(&mut bytes, &scene, &WriteSettings::default()).expect("it can be written");
    assert_eq!(beginning(&bytes).layers(), [0; 0], "a scene in the trained form");
}

#[test]
fn layers_that_contradict_the_gaussians_are_refused() {
    let (bytes, all) = synthetic(true);
    let scene = package::read(Cursor::new(&bytes)).expect("it can be read");
    for layers in
        [vec![0], vec![100], vec![512, 512], vec![512, 256], vec![5_120], (1..17).map(|block| 256 * block).collect()]
    {
        let packed = PackedScene { layers: layers.clone(), ..all.clone() };
        let wrong = GaussianScene { form: SceneForm::Ready(Form::Packed(packed)), ..scene.clone() };
        let written = package::write(&mut Vec::new(), &wrong, &WriteSettings::default());
        assert!(matches!(written, Err(PackageError::Inconsistent(_))), "{layers:?}: {written:?}");
    }
}

#[test]
fn the_bundled_island_can_be_drawn_after_two_fifths_of_its_bytes() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/island.gs4d");
    let bytes = fs::read(path).expect("a bundled file");
    let beginning = beginning(&bytes);
    let (first, share) = (beginning.layers()[0], beginning.share(0));
    assert!(5 * first <= 2 * bytes.len(), "after {first} of {} bytes", bytes.len());
    assert!((0.2..0.3).contains(&share), "{share} of its Gaussians");
    let coarse = beginning.package(&bytes[..first], 0).expect("the first layer is there");
    assert!(package::read(Cursor::new(coarse)).is_ok(), "a package as any other");
}
