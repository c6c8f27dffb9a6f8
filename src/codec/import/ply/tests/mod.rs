//! Tests of PLY files that the tests make, by what the files have.
//!
//! In: files that the tests write. Out: proof of what is read of them, and of what is said.

mod at_rest;
mod frames;
mod moving;
mod origin;
mod refused;

use crate::codec::import::Imported;
use crate::codec::import::ply::fixture::{File, read_bytes};
use crate::codec::options::ReadOptions;
use crate::gaussian::{Gaussian, Harmonics, Parameters};
use crate::scene::{Form, SceneForm, Trained};

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

fn free_time() -> File {
    let file = File::splats(3, 9).with("time", |row| row as f32 * 0.4).with("log_duration", |row| row as f32 - 5.0);
    let file = file.with("velocity_0", |_| 1.0).with("velocity_1", |_| 2.0).with("velocity_2", |row| row as f32);
    file.comment("ftgs_version 1").comment("time_units normalized").comment("min_duration 0.02").comment("n_frames 60")
}
