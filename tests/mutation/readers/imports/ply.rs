//! PLY files.
//!
//! In: names of properties. Out: files of each layout, as text and in both orders of bytes.

use super::exported::exported;
use super::{packed, value};

/// Gaussians of a file.
const COUNT: usize = 4;

/// Returns names, and with a number behind each stem, counted from 0.
fn names(plain: &str, counted: &[(&str, usize)]) -> Vec<String> {
    let plain = plain.split_ascii_whitespace().map(str::to_owned);
    let counted = counted.iter().flat_map(|&(stem, count)| (0..count).map(move |at| format!("{stem}_{at}")));
    plain.chain(counted).collect()
}

/// Returns a file with these properties, all of a kind; `before` are the lines before those of the last element.
fn file(format: &str, before: &str, kind: &str, names: &[String], body: &[u8]) -> Vec<u8> {
    let mut header = format!("ply\nformat {format} 1.0\ncomment made for a test\n{before}element vertex {COUNT}\n");
    header.extend(names.iter().map(|name| format!("property {kind} {name}\n")));
    [header.as_bytes(), b"end_header\n", body].concat()
}

/// Returns a little-endian file of positive values.
fn little(before: &str, names: &[String]) -> Vec<u8> {
    let values = (0..names.len() * COUNT).flat_map(|at| value(at + 1).abs().to_le_bytes());
    file("binary_little_endian", before, "float", names, &values.collect::<Vec<u8>>())
}

/// Returns 3DGS as text and in the other order of bytes, each with an element of lists before it.
pub fn still() -> Vec<Vec<u8>> {
    const LISTS: &str = "element face 2\nproperty list uchar int vertex_indices\n";
    let names = names("x y z nx ny nz opacity", &[("f_dc", 3), ("f_rest", 9), ("scale", 3), ("rot", 4)]);
    let values: Vec<f32> = (0..names.len() * COUNT).map(|at| value(at + 1)).collect();
    let lines =
        values.chunks(names.len()).map(|row| row.iter().map(f32::to_string).collect::<Vec<_>>().join(" ") + "\n");
    let text = ["3 0 1 2\n0\n".to_owned()].into_iter().chain(lines).collect::<String>();
    let mut big = vec![2, 0, 0, 0, 1, 0, 0, 0, 2, 0];
    big.extend(values.iter().flat_map(|value| value.to_be_bytes()));
    vec![
        file("ascii", LISTS, "float", &names, text.as_bytes()),
        file("binary_big_endian", LISTS, "float", &names, &big),
        little("", &names),
    ]
}

/// Returns the sources of `.sogst`, on straight and on curved paths, and of `.sog4d`, and frames of motion as Brush
/// plays them.
pub fn moving() -> Vec<Vec<u8>> {
    let common = [("f_dc", 3), ("scale", 3), ("rot", 4)];
    let sogst = "comment sogst.time_min 0\ncomment sogst.time_max 2\ncomment sogst.cov2d_scale 1 1\n";
    let straight = "x y z opacity vx vy vz t_center t_sigma";
    let sog4d = "comment cfg_args start=0.5 duration=2\n";
    vec![
        little(sogst, &names(straight, &common)),
        little(sogst, &names(&format!("{straight} ax ay az"), &common)),
        little(sog4d, &names("x y z opacity trbf_center trbf_scale", &[&common[..], &[("motion", 3)]].concat())),
        animated(little("", &names("x y z opacity", &common))),
    ]
}

/// Returns a file with two frames of motion more.
fn animated(mut file: Vec<u8>) -> Vec<u8> {
    let axes = |kind: &str| ["x", "y", "z"].map(|axis| format!("property {kind} {axis}\n")).concat();
    let mut header = String::new();
    for frame in 0..2 {
        for (limit, value) in [("min", -0.5f32), ("max", 0.5)] {
            header += &format!("element meta_delta_{limit}_{frame:05} 1\n{}", axes("float"));
            file.extend([value; 3].iter().flat_map(|value| value.to_le_bytes()));
        }
        header += &format!("element delta_vertex_{frame:05} {COUNT}\n{}", axes("uchar"));
        file.extend((0..3 * COUNT).map(|at| (at as u8).wrapping_mul(37)));
    }
    let at = file.windows(11).position(|window| window == b"end_header\n").expect("a header");
    file.splice(at..at, header.bytes());
    file
}

/// Returns Spacetime Gaussians on cubic paths.
pub fn spacetime() -> Vec<u8> {
    let counted = [("motion", 9), ("f_dc", 3), ("scale", 3), ("rot", 4), ("omega", 4)];
    let names = names("x y z trbf_center trbf_scale nx ny nz opacity", &counted);
    let values: Vec<u8> = (0..names.len() * COUNT).flat_map(|at| value(at + 1).to_le_bytes()).collect();
    file("binary_little_endian", "", "float", &names, &values)
}

/// Returns a compressed PLY in one chunk, with this number of coefficients above degree 0.
pub fn compressed(rest: usize) -> Vec<u8> {
    let sides = |name: &str| ["x", "y", "z"].map(|axis| format!("property float {name}_{axis}\n")).concat();
    let chunk: String = ["min", "max", "min_scale", "max_scale"].map(sides).concat();
    let before = format!("element chunk 1\n{chunk}");
    let bounds = [[-1.0f32; 3], [1.0; 3], [-4.0; 3], [-2.0; 3]];
    let mut body: Vec<u8> = bounds.as_flattened().iter().flat_map(|bound| bound.to_le_bytes()).collect();
    body.extend((0..4 * COUNT as u32).flat_map(|at| at.wrapping_mul(0x9e37_79b9).to_le_bytes()));
    let packed = names("packed_position packed_rotation packed_scale packed_color", &[]);
    let mut file = file("binary_little_endian", &before, "uint", &packed, &body);
    if rest > 0 {
        let properties = names("", &[("property uchar f_rest", rest)]).join("\n");
        let text = format!("element sh {COUNT}\n{properties}\nend_header\n");
        let at = file.windows(11).position(|window| window == b"end_header\n").expect("a header");
        file.splice(at..at + 11, text.bytes());
        file.extend((0..rest * COUNT).map(|at| (at as u8).wrapping_mul(31)));
    }
    file
}

/// Returns native 4D Gaussians with so many coefficients.
pub fn native(coefficients: usize) -> Vec<u8> {
    let channels = ["feat_r", "feat_g", "feat_b"].map(|stem| (stem, coefficients));
    let rotations = "rot_x rot_y rot_z rot_w rot_r_x rot_r_y rot_r_z rot_r_w";
    little("", &names(&format!("x y z t sx sy sz st opacity {rotations}"), &channels))
}

/// Returns the archive of a sequence of three frames, two of them alike.
pub fn sequence() -> Vec<u8> {
    let frames = exported("ply", &[0, 1, 0]).into_iter().zip(0..);
    packed(frames.map(|(file, number)| (format!("frame_{number}.ply"), file)).collect())
}
