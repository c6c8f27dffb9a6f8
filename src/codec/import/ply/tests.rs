//! Tests of PLY files that the tests make.

use super::fixture::{File, read_bytes, refusal};
use crate::codec::import::Imported;
use crate::codec::import::columns::{SH_C0, logit};
use crate::codec::options::ReadOptions;
use crate::gaussian::{Gaussian, Harmonics, Model, Parameters, SMALLEST_CUTOFF, SliceSettings};
use crate::scene::{Form, RotationConvention, SceneForm, Trained, UpAxis};
use glam::Vec3;

fn read(bytes: &[u8]) -> Imported {
    read_bytes(bytes, &ReadOptions::default()).unwrap_or_else(|error| panic!("the file can be read: {error}"))
}

fn trained(imported: Imported) -> (Parameters, Harmonics) {
    match imported.scene.form {
        SceneForm::Trained(Trained { parameters, harmonics }) => (parameters, harmonics),
        SceneForm::Ready(_) => panic!("Gaussians at rest have the trained form"),
    }
}

fn sliced(imported: Imported) -> (Vec<Gaussian>, Harmonics) {
    match imported.scene.form {
        SceneForm::Ready(Form::Sliced(sliced)) => (sliced.gaussians, sliced.harmonics),
        _ => panic!("moving Gaussians have the sliced form"),
    }
}

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
    assert_eq!(lost(&free_time), [""; 0], "properties of the layout are read");
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
    let odd = File::splats(1, 10);
    assert!(refusal(&odd.little()).contains("10 properties f_rest"), "no degree of color");
    let degree_4 = read(&File::splats(1, 72).little());
    assert!(degree_4.lost[0].contains("degree 4"), "a higher degree is cut: {:?}", degree_4.lost);
    assert_eq!(trained(degree_4).1.degree, 3, "degree 3 is left");
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

fn free_time() -> File {
    let file = File::splats(3, 9).with("time", |row| row as f32 * 0.4).with("log_duration", |row| row as f32 - 5.0);
    let file = file.with("velocity_0", |_| 1.0).with("velocity_1", |_| 2.0).with("velocity_2", |row| row as f32);
    file.comment("ftgs_version 1").comment("time_units normalized").comment("min_duration 0.02").comment("n_frames 60")
}

#[test]
fn free_time_gaussians_move_and_fade() {
    let imported = read(&free_time().comment("opacity_floor 1e-4").little());
    assert!(imported.lost[0].contains("0.0001"), "the floor of the opacity is stated: {:?}", imported.lost);
    assert_eq!(imported.scene.trained_with.time_interval, [0.0, 1.0], "normalized times");
    assert_eq!(imported.scene.playback.duration_seconds, 2.0, "60 frames at 30 a second");
    let (gaussians, _) = sliced(imported);
    for (row, gaussian) in gaussians.iter().enumerate() {
        assert_eq!(gaussian.mean_t, row as f32 * 0.4, "the time of {row}");
        assert_eq!(gaussian.sigma_t, (row as f32 - 5.0).exp().max(0.02), "the lifespan of {row}");
        assert_eq!(gaussian.velocity, [1.0, 2.0, row as f32], "the velocity of {row}");
    }
    let faster = ReadOptions { fps: Some(15.0), ..ReadOptions::default() };
    let imported = read_bytes(&free_time().little(), &faster).expect("it can be read");
    assert_eq!(imported.scene.playback.duration_seconds, 4.0, "60 frames at 15 a second");
    let resting = read(&free_time().comment("use_velocity false").little());
    assert_eq!(sliced(resting).0[2].velocity, [0.0; 3], "velocities are not used");
    assert!(refusal(&free_time().comment("ftgs_version 2").little()).contains("version 2"), "another version");
    assert!(refusal(&free_time().comment("n_frames many").little()).contains("n_frames"), "a comment without a number");
}

#[test]
fn the_envelope_of_sog4d_is_narrower_by_the_root_of_two() {
    let mut file = File::splats(2, 0).with("trbf_center", |_| 1.5).with("trbf_scale", |_| -1.0);
    for axis in 0..3 {
        file = file.with(&format!("motion_{axis}"), |_| axis as f32);
    }
    let imported = read(&file.clone().comment("cfg_args: start=1 duration=2 fps=30.0 sh_degree=0").little());
    assert_eq!(imported.scene.trained_with.time_interval, [1.0, 3.0], "the interval of cfg_args");
    assert_eq!(imported.scene.playback.duration_seconds, 2.0, "in seconds");
    let gaussian = sliced(imported).0[1];
    assert_eq!((gaussian.mean_t, gaussian.velocity), (1.5, [0.0, 1.0, 2.0]), "time and velocity");
    assert!((gaussian.marginal(2.0) - (-(0.5f32 / (-1.0f32).exp()).powi(2)).exp()).abs() < 1e-6, "exp(-(dt/s)^2)");
    let bad = file.clone().comment("cfg_args: start=1 duration=-2");
    assert!(refusal(&bad.little()).contains("duration"), "a clip that ends before it begins");
    let curved = (3..9).fold(file, |file, axis| file.with(&format!("motion_{axis}"), |_| 0.0));
    assert!(!refusal(&curved.little()).is_empty(), "cubic paths are another layout");
}

#[test]
fn a_sogst_ply_needs_the_times_of_its_clip() {
    let mut file = File::splats(2, 0).with("t_center", |_| 0.5).with("t_sigma", |_| 0.1);
    for (name, velocity) in [("vx", 1.0), ("vy", 2.0), ("vz", 3.0)] {
        file = file.with(name, move |_| velocity);
    }
    assert!(refusal(&file.little()).contains("sogst.time_min"), "no times");
    let given = ReadOptions { time_interval: Some([0.0, 4.0]), ..ReadOptions::default() };
    let imported = read_bytes(&file.little(), &given).expect("the times are given");
    assert_eq!(imported.scene.trained_with.time_interval, [0.0, 4.0], "the times that are given");
    let imported = read(&file.comment("sogst.time_min 0.5").comment("sogst.time_max 2").little());
    assert_eq!(imported.scene.trained_with.time_interval, [0.5, 2.0], "the times of the comments");
    let gaussian = sliced(imported).0[0];
    assert_eq!((gaussian.velocity, gaussian.sigma_t), ([1.0, 2.0, 3.0], 0.1), "velocity and lifespan");
}

#[test]
fn gaussians_of_ply4d_are_those_of_the_trainer() {
    let mut names: Vec<String> = ["x", "y", "z", "t", "sx", "sy", "sz", "st", "opacity"].map(str::to_owned).into();
    for stem in ["rot", "rot_r"] {
        names.extend(["x", "y", "z", "w"].map(|axis| format!("{stem}_{axis}")));
    }
    names.extend((0..48).flat_map(|k| ["r", "g", "b"].map(|channel| format!("feat_{channel}_{k}"))));
    let rows = vec![(0..names.len()).map(|column| (column as f32 + 1.0) / 200.0).collect()];
    let file = File { comments: Vec::new(), names, rows };
    let imported = read(&file.little());
    assert_eq!(imported.scene.trained_with.marginal_cutoff, 0.05, "the cut-off of the trainer");
    let (parameters, harmonics) = trained(imported);
    assert_eq!(parameters.model(), Model::Rotated4d, "native 4D Gaussians");
    assert_eq!(parameters.log_scale[0][1], (6.0f32 / 200.0).ln(), "scales are logarithms");
    assert_eq!(parameters.log_scale_t[0], (8.0f32 / 200.0).ln(), "the temporal scale too");
    assert_eq!(parameters.opacity_logit[0], logit(9.0 / 200.0), "the opacity is a logit");
    assert_eq!(parameters.rotation_l[0], [10.0, 11.0, 12.0, 13.0].map(|v| v / 200.0), "x is the first component");
    assert_eq!(parameters.rotation_r[0], [14.0, 15.0, 16.0, 17.0].map(|v| v / 200.0), "of the right rotation too");
    assert_eq!((harmonics.degree, harmonics.degree_t), (3, 2), "48 coefficients");
    assert_eq!(harmonics.of(0)[4], file.value("feat_g_1", 0), "coefficients with RGB innermost");
    let unflipped = ReadOptions { rotation_convention: Some(RotationConvention::Unflipped), ..ReadOptions::default() };
    let flipped = trained(read_bytes(&file.little(), &unflipped).expect("it can be read")).0;
    assert_eq!(flipped.rotation_l[0][1], -11.0 / 200.0, "rotations of the other convention are flipped");
}

/// Returns a compressed file of Gaussians in one chunk, at the corners of its box, with colors of degree 1.
fn compressed(count: usize) -> Vec<u8> {
    let names =
        ["min", "max"].map(|end| ["x", "y", "z", "scale_x", "scale_y", "scale_z"].map(|axis| format!("{end}_{axis}")));
    let [low, high] = names.map(|names| names.map(|name| format!("property float {name}\n")));
    let packed = ["position", "rotation", "scale", "color"].map(|name| format!("property uint packed_{name}\n"));
    let sh: String = (0..9).map(|i| format!("property uchar f_rest_{i}\n")).collect();
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement chunk 1\n{}{}element vertex {count}\n{}element sh {count}\n{sh}end_header\n",
        low.concat(),
        high.concat(),
        packed.concat()
    );
    let mut bytes = header.into_bytes();
    for value in [-1.0f32, -2.0, -3.0, -4.0, -5.0, -6.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0] {
        bytes.extend(value.to_le_bytes());
    }
    for row in 0..count {
        let corner = if row % 2 == 0 { 0 } else { u32::MAX };
        // The first component is the largest; the others are 0, up to half a step.
        for word in [corner, 512 | 512 << 10 | 512 << 20, corner, 0xff00_80ff] {
            bytes.extend(u32::to_le_bytes(word));
        }
    }
    bytes.extend((0..count * 9).map(|i| [0, 255, 128][i % 3]));
    bytes
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

/// Reads a file and returns the active mean of its only path at some times, and the red coefficient.
fn path(bytes: &[u8], interval: [f32; 2]) -> (Vec<(f32, Vec3)>, f32) {
    let found = read(bytes);
    let SceneForm::Ready(Form::Sliced(sliced)) = &found.scene.form else { panic!("moving Gaussians are sliced") };
    let filter = found.scene.filter.as_ref().expect("pieces have a filter");
    let at = |step: u32| {
        let time = interval[0] + (interval[1] - interval[0]) * step as f32 / 20.0;
        let segment = filter.segment_of(time, interval);
        let active: Vec<usize> =
            (0..sliced.gaussians.len()).filter(|&index| filter.is_active(segment, index)).collect();
        let [index] = active[..] else { panic!("one piece at {time}: {active:?}") };
        (time, sliced.gaussians[index].mean_at(time))
    };
    ((0..=20).map(at).collect(), sliced.harmonics.values[0])
}

#[test]
fn spacetime_gaussians_follow_their_cubic_paths_and_have_plain_colors() {
    let mut file = File::splats(1, 0).with("trbf_center", |_| 0.25).with("trbf_scale", |_| 3.0);
    let factors: Vec<f32> = (0..9).map(|number| (number as f32 - 3.0) * 0.7).collect();
    for (number, &factor) in factors.iter().enumerate() {
        file = file.with(&format!("motion_{number}"), |_| factor);
    }
    for number in 0..4 {
        file = file.with(&format!("omega_{number}"), |_| 0.1);
    }
    let mean = Vec3::new(file.value("x", 0), file.value("y", 0), file.value("z", 0));
    let (found, red) = path(&file.little(), [0.0, 1.0]);
    let largest = (0..3).map(|axis| file.value(&format!("scale_{axis}"), 0).exp()).fold(0.0, f32::max);
    for (time, at) in found {
        let d = time - 0.25;
        let power = |first: usize| Vec3::from_slice(&factors[first..]);
        let expected = mean + power(0) * d + power(3) * d * d + power(6) * d * d * d;
        assert!(at.distance(expected) < 0.25 * largest + 1e-3, "at {time}: {at} is {expected}");
    }
    assert_eq!(red, (file.value("f_dc_0", 0) - 0.5) / SH_C0, "f_dc is the color itself");
}

#[test]
fn an_acceleration_bends_the_paths_of_sogst() {
    let mut file = File::splats(1, 9).comment("sogst.time_min 2").comment("sogst.time_max 4").with("t_center", |_| 3.0);
    file = file.with("t_sigma", |_| 50.0);
    for (name, value) in [("vx", 1.0), ("vy", 0.0), ("vz", 0.5), ("ax", 0.0), ("ay", -9.0), ("az", 0.0)] {
        file = file.with(name, |_| value);
    }
    let mean = Vec3::new(file.value("x", 0), file.value("y", 0), file.value("z", 0));
    let largest = (0..3).map(|axis| file.value(&format!("scale_{axis}"), 0).exp()).fold(0.0, f32::max);
    for (time, at) in path(&file.little(), [2.0, 4.0]).0 {
        let d = time - 3.0;
        let expected = mean + Vec3::new(d, -9.0 * d * d, 0.5 * d);
        assert!(at.distance(expected) < 0.25 * largest + 1e-3, "at {time}: {at} is {expected}");
    }
}

/// Returns a file with frames of motion: for each the range of its values, and their parts of 254, row by row.
fn animated(file: &File, names: &[&str], frames: &[([f32; 2], Vec<Vec<u8>>)]) -> Vec<u8> {
    let bytes = file.little();
    let end = bytes.windows(11).position(|window| window == b"end_header\n").expect("a header");
    let mut header = String::from_utf8(bytes[..end].to_owned()).expect("text");
    let mut body = bytes[end + 11..].to_owned();
    for (number, ([low, high], rows)) in frames.iter().enumerate() {
        for (limit, value) in [("min", low), ("max", high)] {
            header += &format!("element meta_delta_{limit}_{number:05} 1\n");
            for name in names {
                header += &format!("property float {name}\n");
                body.extend(value.to_le_bytes());
            }
        }
        header += &format!("element delta_vertex_{number:05} {}\n", rows.len());
        names.iter().for_each(|name| header += &format!("property uchar {name}\n"));
        body.extend(rows.iter().flatten());
    }
    [header.as_bytes(), &b"end_header\n"[..], &body[..]].concat()
}

#[test]
fn frames_of_motion_are_read_as_moving_pieces() {
    let file = File::splats(2, 0).comment("Exported from Brush").comment("Vertical axis: y");
    let still = vec![127, 127, 127];
    let range = [-0.3, 0.3];
    let frames = [
        (range, vec![still.clone(), still.clone()]),
        (range, vec![vec![254, 127, 0], still.clone()]),
        (range, vec![still.clone(), still.clone()]),
    ];
    let bytes = animated(&file, &["x", "y", "z"], &frames);
    let options = ReadOptions { fps: Some(10.0), tolerance: Some(1e-3), ..ReadOptions::default() };
    let imported = read_bytes(&bytes, &options).expect("it can be read");
    assert_eq!(imported.scene.playback.duration_seconds, 0.2, "two steps at ten frames a second");
    assert_eq!(imported.scene.trained_with.time_interval, [0.0, 0.2], "in seconds");
    assert_eq!(imported.lost.len(), 1, "all is read: {:?}", imported.lost);
    assert!(imported.lost[0].contains("2 Gaussians are 3 straight pieces"), "paths in pieces: {:?}", imported.lost);
    let filter = imported.scene.filter.clone().expect("pieces have a filter");
    let (gaussians, _) = sliced(imported);
    for (time, change) in [(0.0, 0.0), (0.05, 0.5), (0.099, 0.99), (0.15, 0.5), (0.2, 0.0)] {
        let segment = filter.segment_of(time, [0.0, 0.2]);
        let active = (0..gaussians.len()).filter(|&index| filter.is_active(segment, index));
        let at: Vec<Vec3> = active.map(|index| gaussians[index].mean_at(time)).collect();
        let rest = [0, 1].map(|row| Vec3::from(["x", "y", "z"].map(|name| file.value(name, row))));
        let expected = [rest[0] + change * Vec3::new(0.3, 0.0, -0.3), rest[1]];
        let is_near = at.len() == 2 && at.iter().zip(expected).all(|(at, expected)| at.distance(expected) < 1e-5);
        assert!(is_near, "at {time}: {at:?}, not {expected:?}");
    }
    let assumed = read(&bytes);
    assert_eq!(assumed.scene.playback.duration_seconds, 2.0 / 30.0, "30 frames a second");
    assert!(assumed.lost[0].contains("3 frames are played at 30 a second"), "it is stated: {:?}", assumed.lost);
}

#[test]
fn frames_of_motion_change_rotations_and_scales() {
    let file = File::splats(1, 0);
    let names = ["scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"];
    let last = [254, 127, 0, 127, 254, 0, 127];
    let frames = [([-1.0, 1.0], vec![vec![127; 7]]), ([-1.0, 1.0], vec![last.to_vec()])];
    let imported = read(&animated(&file, &names, &frames));
    assert!(imported.lost.iter().any(|lost| lost.contains("rotation and the scales")), "stated: {:?}", imported.lost);
    let found = sliced(imported).0[0];
    let mut middle = file;
    for (name, part) in names.iter().zip(last) {
        let column = middle.names.iter().position(|found| found == name).expect("it is there");
        middle.rows[0][column] += 0.5 * (f32::from(part) / 127.0 - 1.0);
    }
    let (parameters, _) = trained(read(&middle.little()));
    let expected = parameters.slice(&SliceSettings::default()).expect("it can be drawn")[0];
    for (found, expected) in found.covariance.iter().zip(expected.covariance) {
        assert!((found - expected).abs() < 1e-4, "halfway between the frames: {found} is {expected}");
    }
}

#[test]
fn frames_of_a_mesh_are_refused() {
    let bytes = animated(&File::splats(2, 0), &["x", "y", "z"], &[([0.0, 1.0], vec![vec![0, 0, 0]; 3])]);
    let message = refusal(&bytes);
    let is_clear =
        ["delta_vertex_00000", "3 points", "2 Gaussians", "3DGS PLY"].iter().all(|part| message.contains(part));
    assert!(is_clear, "the frame, both numbers and the way out: {message}");
}

/// Returns an ASCII file of small Gaussians of 3DGS at these places, which have the type `kind`.
fn placed(kind: &str, places: &[[f64; 3]]) -> String {
    let mut file = File::splats(places.len(), 0);
    let scales: Vec<usize> = (0..file.names.len()).filter(|&column| file.names[column].starts_with("scale")).collect();
    for row in &mut file.rows {
        scales.iter().for_each(|&column| row[column] = -6.0);
    }
    let mut text = String::from_utf8(file.ascii()).expect("text");
    for axis in ["x", "y", "z"] {
        text = text.replace(&format!("property float {axis}\n"), &format!("property {kind} {axis}\n"));
    }
    let (header, body) = text.split_once("end_header\n").expect("a header");
    let row = |(line, [x, y, z]): (&str, &[f64; 3])| {
        let others: Vec<&str> = line.split(' ').skip(3).collect();
        format!("{x} {y} {z} {}\n", others.join(" "))
    };
    let rows: String = body.lines().zip(places).map(row).collect();
    format!("{header}end_header\n{rows}")
}

/// Places on a map, and their middle.
const MAP: [[f64; 3]; 3] =
    [[500_001.05, 5_400_000.5, 310.4], [499_999.25, 5_400_000.7, 309.4], [500_000.45, 5_400_001.1, 309.8]];
const MIDDLE: [f64; 3] = [500_000.0, 5_400_001.0, 310.0];

/// Reads a file, and returns the origin, the means, and the sentences.
fn origin(text: &str) -> ([f64; 3], Vec<[f32; 3]>, Vec<String>) {
    let imported = read(text.as_bytes());
    let (place, lost) = (imported.scene.trained_with.origin.place, imported.lost.clone());
    (place, trained(imported).0.mean, lost)
}

#[test]
fn places_on_a_map_are_relative_to_their_middle() {
    let (place, means, lost) = origin(&placed("double", &MAP));
    assert_eq!(place, MIDDLE, "the middle in whole units");
    for (mean, place) in means.iter().zip(MAP) {
        let expected: [f32; 3] = std::array::from_fn(|axis| (place[axis] - MIDDLE[axis]) as f32);
        assert_eq!(*mean, expected, "no digit of {place:?} is lost");
    }
    assert_eq!(lost.len(), 1, "one sentence: {lost:?}");
    let is_stated = lost[0].contains("(500000, 5400001, 310)") && lost[0].contains("0.5 units");
    assert!(is_stated, "the origin, and the step of single precision: {lost:?}");

    let (place, means, lost) = origin(&placed("float", &MAP));
    assert_eq!(place, MIDDLE, "of single precision, too");
    let expected: [f32; 3] = std::array::from_fn(|axis| (f64::from(MAP[2][axis] as f32) - MIDDLE[axis]) as f32);
    assert_eq!(means[2], expected, "the digits that the file has");
    assert!(lost[0].contains("Digits were lost") && lost[0].contains("0.5 units"), "it is stated: {lost:?}");
}

#[test]
fn places_near_zero_have_no_origin() {
    let near = [[500.0, 0.25, 0.0], [501.0, 1.0, 0.5], [499.0, -1.0, 1.5]];
    let (place, means, lost) = origin(&placed("double", &near));
    assert_eq!((place, lost), ([0.0; 3], Vec::new()), "370 times the radius from 0");
    assert_eq!(means, near.map(|place| place.map(|value| value as f32)), "the places as they are");
    let farther = near.map(|[x, y, z]| [x + 1500.0, y, z]);
    assert_eq!(origin(&placed("double", &farther)).0, [2000.0, 0.0, 1.0], "1500 times the radius from 0");
    let around = |center: f64, other: f64| {
        let mut places: Vec<[f64; 3]> = (0..30).map(|index| [center, f64::from(index) * 0.1, 0.0]).collect();
        places.push([other, 0.0, 0.0]);
        placed("double", &places)
    };
    assert_eq!(origin(&around(0.0, 1e7)).0, [0.0; 3], "a Gaussian far from the others does not count");
    assert_eq!(origin(&around(1e7, 0.0)).0, [1e7, 1.0, 0.0], "nor one at 0");
    let wide: Vec<[f64; 3]> = (0..30).map(|index| [1e7, f64::from(index) * 1e4, 0.0]).collect();
    let (place, _, lost) = origin(&placed("double", &wide));
    assert_eq!(place, [0.0; 3], "a scene of 290,000 units");
    assert!(lost[0].contains("steps of 1 units at 10000000"), "rounded digits are stated: {lost:?}");
}

#[test]
fn a_comment_states_the_origin() {
    let text = placed("double", &MAP).replace("element", "comment gs4d.origin 499999 5400000 0.5\nelement");
    let (place, means, _) = origin(&text);
    assert_eq!(place, [499_999.0, 5_400_000.0, 0.5], "the origin of the comment");
    assert_eq!(
        means[1],
        [0.25, (5_400_000.7_f64 - 5_400_000.0) as f32, (309.4_f64 - 0.5) as f32],
        "means relative to it"
    );
    for bad in ["gs4d.origin 1 2", "gs4d.origin 1 2 x", "gs4d.origin 1 2 inf"] {
        let text = placed("double", &MAP).replace("element", &format!("comment {bad}\nelement"));
        assert!(refusal(text.as_bytes()).contains("gs4d.origin"), "{bad}: no origin");
    }
}

#[test]
fn compressed_places_on_a_map_are_relative_to_their_middle() {
    let mut bytes = compressed(2);
    let start = bytes.windows(11).position(|window| window == b"end_header\n").expect("a header") + 11;
    bytes[start..start + 4].copy_from_slice(&5e6_f32.to_le_bytes());
    bytes[start + 24..start + 28].copy_from_slice(&(5e6_f32 + 2.0).to_le_bytes());
    let imported = read(&bytes);
    assert_eq!(imported.scene.trained_with.origin.place, [5e6, -2.0, -3.0], "the first of two is the middle");
    assert!(imported.lost[0].contains("Digits were lost"), "boxes in single precision: {:?}", imported.lost);
    assert_eq!(trained(imported).0.mean, [[0.0; 3], [2.0, 4.0, 6.0]], "the corners of the box");
}
