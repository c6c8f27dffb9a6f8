//! Files that are cut, damaged or of other kinds.
//!
//! In: files that the tests write. Out: proof of what is read of them, and of what is said.

use super::{animated, compressed, read, trained};
use crate::codec::import::ply::fixture::{File, refusal};

#[test]
fn a_file_that_is_cut_anywhere_is_refused() {
    let moving = File::splats(2, 0).with("t_center", |_| 0.5).with("t_sigma", |_| 0.1).with("vx", |_| 1.0);
    let moving = moving.with("vy", |_| 0.0).with("vz", |_| 0.0).comment("sogst.time_min 0").comment("sogst.time_max 1");
    let frames = animated(&File::splats(2, 0), &["x", "y", "z"], &[([-1.0, 1.0], vec![vec![0, 1, 2]; 2])]);
    for file in [File::splats(3, 9).little(), compressed(3), moving.little(), frames] {
        read(&file);
        for length in 0..file.len() {
            let message = refusal(&file[..length]);
            assert!(!message.is_empty(), "cut after {length} bytes");
        }
    }
    let ascii = File::splats(2, 0).ascii();
    // The last digits of the last number may be missing without a trace.
    let numbers = ascii.trim_ascii_end().iter().rposition(|&byte| byte == b' ').expect("more than one number");
    (0..=numbers).for_each(|length| assert!(!refusal(&ascii[..length]).is_empty(), "cut after {length} bytes"));
}

#[test]
fn damaged_headers_are_refused_with_the_line() {
    let text = String::from_utf8(File::splats(1, 0).ascii()).expect("text");
    for (from, to, reason) in [
        ("format ascii 1.0\n", "", "no line \"format\""),
        ("format ascii", "format binary_middle_endian", "binary_middle_endian"),
        ("property float x", "property half x", "property half x"),
        ("element vertex 1", "element vertex many", "element vertex many"),
        ("element vertex 1\n", "", "property float x"),
        ("element vertex 1", "element vertex 18446744073709551615", "the file is cut"),
        ("element vertex 1", "element vertex 99999999999999999999", "element vertex 9"),
        ("property float x\n", "property float x\nsurprise\n", "surprise"),
        ("property float scale_1\n", "property list uchar float scale_1\n", "place of a number"),
        ("property float x\n", "", "no property x"),
    ] {
        assert!(text.contains(from), "the file has {from}");
        let message = refusal(text.replacen(from, to, 1).as_bytes());
        assert!(message.contains(reason), "{to:?} in place of {from:?}: {message}");
    }
    let huge = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000000\nproperty float x\nend_header\n";
    assert!(refusal(huge.as_bytes()).contains("cut"), "a number of rows that the file does not have");
}

#[test]
fn other_files_are_refused_with_the_way_out() {
    let without = |names: &[&str]| {
        let mut file = File::splats(1, 0);
        for name in names {
            let column = file.names.iter().position(|found| found == name).expect("the property is there");
            file.names.remove(column);
            file.rows[0].remove(column);
        }
        file
    };
    let cloud = without(&["opacity"]);
    assert!(refusal(&cloud.little()).contains("a point cloud or a mesh"), "a file without opacities");
    let surfels = without(&["scale_2"]);
    assert!(refusal(&surfels.little()).contains("surfels (2DGS"), "a file with two scales");
    let full = File::splats(1, 0).with("motion_0", |_| 0.0).with("f_t_0", |_| 0.0);
    assert!(refusal(&full.little()).contains("\"lite\""), "Spacetime Gaussians with a network");
    let text = String::from_utf8(File::splats(1, 0).ascii()).expect("text").replace("element vertex", "element point");
    assert!(refusal(text.as_bytes()).contains("without vertices"), "no vertices");
    let bare = "ply\nformat ascii 1.0\nelement vertex 0\nend_header\n";
    assert!(refusal(bare.as_bytes()).contains("its vertices have no properties"), "vertices that say nothing");
    let odd = File::splats(1, 10);
    assert!(refusal(&odd.little()).contains("10 properties f_rest"), "no degree of color");
    let degree_4 = read(&File::splats(1, 72).little());
    assert!(degree_4.lost[0].contains("degree 4"), "a higher degree is cut: {:?}", degree_4.lost);
    assert_eq!(trained(degree_4).1.degree, 3, "degree 3 is left");
}
