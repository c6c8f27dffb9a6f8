//! `ZJU-MoCap`: `annots.npy`, a dictionary that NumPy has saved as a pickle.
//!
//! In: small folders made here, of cameras that look at the origin; pickles joined from fragments. Out: proof of poses,
//! lenses, units, times and sizes, and that other files and objects are refused by name.

use super::Folder;
use super::formats::{names, open, picture, refused, times};
use super::looking::Looking;
use crate::support::pth::{flag, float, int, text, tuple};
use bevy_gs4d::internal::offline::dataset::Summary;
use bevy_gs4d::offline::dataset::{CameraOptions, Split};
use glam::UVec2;

const FOCAL: [f64; 2] = [50.0, 52.0];
const CENTER: [f64; 2] = [19.0, 16.0];
/// The middle of the first pixel has the coordinates 0, 0 in the file.
const MIDDLE: f64 = 0.5;

/// Returns the fragment of a list.
fn list(items: impl IntoIterator<Item = Vec<u8>>) -> Vec<u8> {
    [&b"]("[..], &items.into_iter().collect::<Vec<_>>().concat(), b"e"].concat()
}

/// Returns the fragment of a dictionary.
fn dictionary(entries: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let entries: Vec<u8> = entries.iter().flat_map(|(key, value)| [text(key), value.clone()].concat()).collect();
    [&b"}("[..], &entries, b"u"].concat()
}

/// Returns the fragment of a matrix as nested lists.
fn matrix(columns: usize, numbers: &[f64]) -> Vec<u8> {
    list(numbers.chunks(columns).map(|row| list(row.iter().map(|number| float(*number)))))
}

/// Returns the file of an object.
fn file(object: Vec<u8>) -> Vec<u8> {
    let bytes = [&b"c_codecs\nencode\n"[..], &tuple(&[text("b"), text("latin1")]), b"R"].concat();
    let array = [b"cnumpy\nndarray\n".to_vec(), tuple(&[int(0)]), bytes];
    let array = [&b"cnumpy.core.multiarray\n_reconstruct\n"[..], &tuple(&array), b"R"].concat();
    let kind = [&b"cnumpy\ndtype\n"[..], &tuple(&[text("O8"), int(0), int(1)]), b"R"].concat();
    let state = tuple(&[int(3), text("|"), b"N".to_vec(), b"N".to_vec(), b"N".to_vec(), int(0), int(0), int(63)]);
    let kind = [kind, state, b"b".to_vec()].concat();
    let state = tuple(&[int(1), b")".to_vec(), kind, flag(false), list([object])]);
    let pickle = [&b"\x80\x02"[..], &array, &state, b"b."].concat();
    let header = "{'descr': '|O', 'fortran_order': False, 'shape': (), }\n";
    let length = (header.len() as u16).to_le_bytes();
    [&b"\x93NUMPY\x01\x00"[..], &length, header.as_bytes(), &pickle].concat()
}

/// Returns the dictionary of cameras whose places have this unit, a share of a meter.
fn cams(cameras: usize, unit: f64) -> Vec<(&'static str, Vec<u8>)> {
    let k = [FOCAL[0], 0.0, CENTER[0] - MIDDLE, 0.0, FOCAL[1], CENTER[1] - MIDDLE, 0.0, 0.0, 1.0];
    let looking = || (0..cameras).map(Looking::on_arc);
    vec![
        ("K", list((0..cameras).map(|_| matrix(3, &k)))),
        ("D", list((0..cameras).map(|_| matrix(1, &[0.0; 5])))),
        ("R", list(looking().map(|camera| matrix(3, camera.rotation().as_flattened())))),
        ("T", list(looking().map(|camera| matrix(1, &camera.translation().map(|value| value / unit))))),
    ]
}

/// Returns the list of the images of moments with these numbers.
fn ims(cameras: usize, numbers: &[usize]) -> Vec<u8> {
    let name = |camera: usize, number: usize| text(&format!("Camera_B{}/{number:06}.jpg", camera + 1));
    let moment = |number: &usize| dictionary(&[("ims", list((0..cameras).map(|camera| name(camera, *number))))]);
    list(numbers.iter().map(moment))
}

fn annotations(cams: &[(&str, Vec<u8>)], ims: Vec<u8>) -> Vec<u8> {
    file(dictionary(&[("cams", dictionary(cams)), ("ims", ims)]))
}

#[test]
fn cameras_stand_where_their_matrices_say_in_meters() {
    for (unit, part) in [(0.001, "millimeters: places"), (1.0, "taken as meters")] {
        let folder = Folder::new();
        folder.write("annots.npy", annotations(&cams(9, unit), ims(9, &[4, 7])));
        for camera in 1..=9 {
            for number in [4, 7] {
                picture(&folder, &format!("Camera_B{camera}/{number:06}.jpg"), [9, 9, 9]);
            }
        }
        picture(&folder, "mask_cihp/Camera_B1/000004.png", [1, 1, 1]);
        let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
        let expected = ["Camera_B1_000004", "Camera_B9_000004", "Camera_B1_000007", "Camera_B9_000007"];
        assert_eq!(names(&test.views), expected, "every eighth camera is for the test");
        assert_eq!(train.views.len(), 14, "seven cameras, two moments");
        for (index, view) in train.views.iter().enumerate() {
            Looking::on_arc(1 + index % 7).check(view, FOCAL, CENTER);
            assert_eq!(view.original, UVec2::new(40, 30), "{}: the size of its picture", view.name);
        }
        assert_eq!(times(&test.views), [0.0, 0.0, 0.1, 0.1], "gaps keep their time, 30 frames a second");
        train.require_images().expect("every image is on disk");
        let notes = train.notes.join("; ");
        for part in [part, "30 a second", "mask_cihp/ has the numbers"] {
            assert!(notes.contains(part), "{part:?} is not in: {notes}");
        }
        let summary = Summary::of(folder.path(), &CameraOptions::default()).expect("a dataset");
        assert!(summary.format.starts_with("ZJU-MoCap"), "the format is named: {}", summary.format);
    }
}

#[test]
fn files_that_do_not_fit_are_refused_by_name() {
    let folder = Folder::new();
    picture(&folder, "Camera_B1/000000.jpg", [9, 9, 9]);
    let with = |name: &'static str, value: Vec<u8>| {
        let mut changed = cams(2, 0.001);
        changed.retain(|(key, _)| *key != name);
        changed.push((name, value));
        annotations(&changed, ims(2, &[0, 1]))
    };
    let uneven = list([ims(2, &[0]), ims(1, &[1])].map(|moment| moment[2..moment.len() - 1].to_vec()));
    let outside = list([dictionary(&[("ims", list([text("../a/0.jpg"), text("Camera_B1/000000.jpg")]))])]);
    let unknown = [&b"cos\nsystem\n"[..], &tuple(&[text("ls")]), b"R"].concat();
    let folded = list([matrix(1, &[-9.0, 0.0, 0.0, 0.0, 0.0]), matrix(1, &[0.0; 5])]);
    for (bytes, part) in [
        (with("K", matrix(3, &[1.0; 9])), "its cams has 9 numbers in K, not 9 for each of the 2 images"),
        (with("R", list([text("a")])), "a text in place of a number in R"),
        (with("T", matrix(1, &[1.0; 9])), "more than 6 numbers in T"),
        (with("D", matrix(1, &[0.0; 5])), "5 numbers in D, not as many"),
        (with("D", folded), "the distortion"),
        (with("K", unknown), "the Python object `os system`"),
        (annotations(&cams(2, 0.001)[..3], ims(2, &[0])), "its cams has no T"),
        (annotations(&cams(2, 0.001), uneven), "moment 1 of ims has 1 images, and moment 0 has 2"),
        (annotations(&cams(2, 0.001), outside), "names no file"),
        (annotations(&cams(2, 0.001), list([])), "no images"),
        (annotations(&cams(2, 0.001), list([int(7)])), "moment 0 of ims has no list ims"),
        (file(dictionary(&[("ims", ims(2, &[0]))])), "no dictionary cams"),
        (file(int(7)), "no list ims"),
        (b"\x93NUMPY".to_vec(), "not a whole .npy file"),
    ] {
        folder.write("annots.npy", bytes);
        refused(&folder, part);
        refused(&folder, "annots.npy");
    }
    let empty = Folder::new();
    empty.write("annots.npy", annotations(&cams(2, 0.001), ims(2, &[0, 1])));
    refused(&empty, "none of the first images is on disk");
}
