//! Gaussians at rest: of 3DGS and compressed, and the comments on them.
//!
//! In: files that the tests write. Out: proof of what is read of them, and of what is said.

use super::{compressed, free_time, read, trained};
use crate::codec::import::Imported;
use crate::codec::import::columns::{SH_C0, logit};
use crate::codec::import::ply::fixture::{File, read_bytes, refusal};
use crate::codec::options::ReadOptions;
use crate::gaussian::{Model, SMALLEST_CUTOFF};
use crate::scene::UpAxis;

#[test]
fn values_of_3dgs_are_read_unchanged() {
    for (rest, degree) in [(0, 0), (9, 1), (24, 2), (45, 3)] {
        let file = File::splats(5, rest);
        let imported = read(&file.little());
        assert_eq!(imported.lost, [""; 0], "nothing is lost at degree {degree}");
        let (trained_with, playback) = (&imported.scene.trained_with, imported.scene.playback);
        assert_eq!((playback.up, playback.duration_seconds), (UpAxis::NegY, 0.0), "a still with -y up");
        assert_eq!(trained_with.marginal_cutoff, SMALLEST_CUTOFF, "no cut-off");
        let (parameters, harmonics) = trained(imported);
        assert_eq!(parameters.model(), Model::Static3d, "Gaussians at rest");
        assert_eq!((harmonics.degree, harmonics.degree_t), (degree, 0), "the degree of {rest} coefficients");
        for row in 0..5 {
            let value = |name: &str| file.value(name, row);
            assert_eq!(parameters.mean[row], ["x", "y", "z"].map(value), "mean {row}");
            assert_eq!(parameters.log_scale[row], ["scale_0", "scale_1", "scale_2"].map(value), "scales {row}");
            assert_eq!(parameters.rotation_l[row], ["rot_0", "rot_1", "rot_2", "rot_3"].map(value), "rotation {row}");
            assert_eq!(parameters.opacity_logit[row], value("opacity"), "opacity {row}");
            let colors = harmonics.of(row);
            assert_eq!(colors[..3], ["f_dc_0", "f_dc_1", "f_dc_2"].map(value), "first coefficient {row}");
            for (k, rgb) in colors[3..].chunks_exact(3).enumerate() {
                let names = [0, 1, 2].map(|channel| format!("f_rest_{}", channel * rest / 3 + k));
                assert_eq!(rgb, names.map(|name| value(&name)), "coefficient {} of {row}", k + 1);
            }
        }
    }
}

#[test]
fn encodings_types_and_orders_give_the_same_scene() {
    let file = File::splats(7, 9);
    let expected = read(&file.little());
    assert_eq!(read(&file.big()), expected, "big-endian");
    assert_eq!(read(&file.ascii()), expected, "ASCII");
    assert_eq!(read(&file.doubles()), expected, "doubles");
    let lines = String::from_utf8(file.ascii()).expect("text").replace('\n', "\r\n");
    assert_eq!(read(lines.as_bytes()), expected, "lines that end as on Windows");
    let mut shuffled = file;
    shuffled.names.reverse();
    shuffled.rows.iter_mut().for_each(|row| row.reverse());
    assert_eq!(read(&shuffled.little()), expected, "another order");
}

#[test]
fn other_elements_are_skipped_and_named() {
    let file = File::splats(3, 0);
    let (expected, little, ascii) = (read(&file.little()), file.little(), file.ascii());
    let face = "element face 2\nproperty uchar kind\nproperty list uchar int vertex_indices\nelement vertex";
    let with = |bytes: &[u8], faces: &[u8]| {
        let end = bytes.windows(11).position(|window| window == b"end_header\n").expect("a header") + 11;
        let header = String::from_utf8(bytes[..end].to_owned()).expect("text").replacen("element vertex", face, 1);
        [header.as_bytes(), faces, &bytes[end..]].concat()
    };
    let faces = [&[9u8, 3][..], &[1u8; 12], &[9, 0]].concat();
    let named = vec!["Elements of the file that are not read (1): face (2 rows).".to_owned()];
    let expected = Imported { lost: named, ..expected };
    assert_eq!(read(&with(&little, &faces)), expected, "binary lists before the vertices");
    assert_eq!(read(&with(&ascii, b"9 3 0 1 2\n9 0\n")), expected, "lists of numbers before the vertices");
}

#[test]
fn properties_that_are_not_read_are_named() {
    let lost = |file: &File| read(&file.little()).lost;
    let marked = File::splats(2, 0).with("label", |_| 1.0).with("red", |_| 0.5).with("rot_x", |_| 0.0);
    let sentence = "Properties of its vertices that are not read (3): label, red, rot_x.";
    assert_eq!(lost(&marked), [sentence], "beside those of 3DGS");
    let many = (0..11).fold(File::splats(1, 0), |file, number| file.with(&format!("f_language_{number}"), |_| 0.0));
    let lost_of_many = lost(&many);
    assert!(lost_of_many[0].contains("(11): f_language_0, "), "they are counted: {lost_of_many:?}");
    assert!(lost_of_many[0].ends_with("f_language_7 and 3 more."), "eight are named: {lost_of_many:?}");
    let free_time = free_time();
    let speed = lost(&free_time);
    assert!(speed.len() == 1 && speed[0].contains("speed"), "properties of the layout are read: {speed:?}");
    let other = free_time.with("trbf_scale", |_| 0.0);
    assert!(lost(&other)[0].ends_with("(1): trbf_scale."), "those of another layout are not: {:?}", lost(&other));
    let hidden = File::splats(1, 0).with("a\u{1b}[2J", |_| 0.0);
    assert!(lost(&hidden)[0].contains(r"a\u{1b}[2J"), "a name does not control the terminal: {:?}", lost(&hidden));
}

#[test]
fn colors_without_coefficients_are_of_degree_0() {
    let mut file = File::splats(2, 0);
    for number in 0..3 {
        let column = file.names.iter().position(|name| *name == format!("f_dc_{number}")).expect("a color");
        file.names.remove(column);
        for row in &mut file.rows {
            row.remove(column);
        }
    }
    assert!(refusal(&file.little()).contains("no property f_dc_0"), "no colors");
    let file = ["red", "green", "blue"].iter().fold(file, |file, name| file.with(name, |row| 0.25 + 0.5 * row as f32));
    let imported = read(&file.little());
    assert_eq!(imported.lost, [""; 0], "nothing is lost");
    let (_, harmonics) = trained(imported);
    assert_eq!((harmonics.degree, harmonics.coefficients), (0, 1), "without view-dependent color");
    assert_eq!(harmonics.of(1), [0.25 / SH_C0; 3], "shares of 1");
    let bytes = String::from_utf8(file.ascii()).expect("text").replace("0.25 0.25 0.25 ", "0 128 255 ");
    let bytes = bytes.replace("0.75 0.75 0.75 ", "255 0 51 ");
    let bytes = ["red", "green", "blue"]
        .iter()
        .fold(bytes, |text, name| text.replace(&format!("property float {name}"), &format!("property uchar {name}")));
    let (_, harmonics) = trained(read(bytes.as_bytes()));
    let expected = [-0.5, 128.0 / 255.0 - 0.5, 0.5].map(|share| share / SH_C0);
    assert_eq!(harmonics.of(0), expected, "shares of 255");
}

#[test]
fn comments_state_the_axis_that_points_up() {
    let up = |comments: &[&str]| {
        let comments = comments.iter().map(|comment| (*comment).to_owned()).collect();
        read(&File { comments, ..File::splats(1, 0) }.little()).scene.playback.up
    };
    for (comment, expected) in [
        ("Vertical Axis: z", UpAxis::PosZ),
        ("Vertical axis: y", UpAxis::NegY),
        ("vertical axis: x", UpAxis::PosX),
        ("Vertical axis: 0 0 1", UpAxis::PosZ),
        ("Vertical axis: [0.1, -0.98, 0.05]", UpAxis::NegY),
        ("Vertical axis: -1 0 0.2", UpAxis::NegX),
        ("Vertical axis: 0 0 0", UpAxis::NegY),
        ("Vertical axis: 1 NaN 0", UpAxis::NegY),
        ("Vertical axis: sideways", UpAxis::NegY),
        ("gs4d.up +y", UpAxis::PosY),
        ("gs4d.up -x", UpAxis::NegX),
    ] {
        assert_eq!(up(&[comment]), expected, "{comment}");
    }
    assert_eq!(up(&["gs4d.up -z", "Vertical Axis: z"]), UpAxis::NegZ, "the own comment has a sign");
    let moving = free_time().comment("gs4d.up +z");
    assert_eq!(read(&moving.little()).scene.playback.up, UpAxis::PosZ, "of moving Gaussians, too");
    let options = ReadOptions { up: Some(UpAxis::NegX), ..ReadOptions::default() };
    let found = read_bytes(&moving.little(), &options).expect("it can be read");
    assert_eq!(found.scene.playback.up, UpAxis::NegX, "an option overrides the comment");
}

#[test]
fn the_filter_of_mip_splatting_is_fused() {
    let file =
        File::splats(4, 0).with("filter_3D", |_| 0.3).comment("SplatRenderMode: default").comment("antialiased 1");
    let imported = read(&file.little());
    assert!(imported.scene.trained_with.mip_filter, "the filter of pixels is drawn");
    let (parameters, _) = trained(imported);
    for row in 0..4 {
        let scale = [0, 1, 2].map(|axis| file.value(&format!("scale_{axis}"), row).exp());
        let wider = scale.map(|scale| scale.hypot(0.3));
        let factor = scale.iter().product::<f32>() / wider.iter().product::<f32>();
        let opacity = 1.0 / (1.0 + (-file.value("opacity", row)).exp());
        for (axis, wider) in wider.into_iter().enumerate() {
            assert!((parameters.log_scale[row][axis] - wider.ln()).abs() < 1e-5, "scale {axis} of {row} is wider");
        }
        let found = 1.0 / (1.0 + (-parameters.opacity_logit[row]).exp());
        assert!((found - opacity * factor).abs() < 1e-5, "the opacity of {row} is {opacity} times {factor}");
    }
    for (comments, is_filtered) in
        [(["antialiased 1", "SplatRenderMode: default"], false), (["x", "SPLATRENDERMODE: Mip"], true)]
    {
        let file = File { comments: comments.map(str::to_owned).into(), ..File::splats(1, 0) };
        let Imported { scene, lost } = read(&file.little());
        assert_eq!(scene.trained_with.mip_filter, is_filtered, "the last of {comments:?} decides");
        assert!(lost.is_empty(), "nothing is lost: {lost:?}");
    }
}

#[test]
fn compressed_gaussians_lie_in_the_boxes_of_their_chunks() {
    let (parameters, harmonics) = trained(read(&compressed(2)));
    assert_eq!(parameters.mean, [[-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]], "the corners of the box");
    assert_eq!(parameters.log_scale, [[-4.0, -5.0, -6.0], [4.0, 5.0, 6.0]], "the smallest and the largest scales");
    assert!(parameters.rotation_l[0][0] > 0.999, "the component that is left out: {:?}", parameters.rotation_l[0]);
    assert_eq!(parameters.opacity_logit[0], logit(1.0), "the opacity");
    let colors = harmonics.of(1);
    assert_eq!(colors[..2], [0.5 / SH_C0, -0.5 / SH_C0], "red and green");
    assert_eq!(colors[3..6], [-4.0, -4.0, -4.0], "the first coefficient of each channel");
    assert_eq!(colors[6..9], [4.0, 4.0, 4.0], "the second");
    assert_eq!(colors[9], (128.5 / 256.0 - 0.5) * 8.0, "the third, in the middle of its step");
    let mut filtered = compressed(2);
    filtered.splice(4..4, *b"comment SplatRenderMode: mip\n");
    assert!(read(&filtered).scene.trained_with.mip_filter, "the comment on the filter of Mip-Splatting");
    let other = String::from_utf8_lossy(&compressed(0)).replace("element chunk 1", "element chunk 2");
    assert!(refusal(other.as_bytes()).contains("chunk"), "chunks of another number of Gaussians");
}

#[test]
fn gaussians_that_are_not_finite_are_left_out() {
    let mut file = File::splats(3, 0);
    file.rows[1][0] = f32::NAN;
    let imported = read(&file.little());
    assert!(imported.lost[0].starts_with("1 of 3"), "they are counted: {:?}", imported.lost);
    assert_eq!(imported.scene.len(), 2, "the others are kept");
    assert_eq!(read(&File::splats(0, 0).little()).scene.len(), 0, "a file without Gaussians");
}
