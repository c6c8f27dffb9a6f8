//! Pictures of files whose splats move, against static files of the same splats at one time.
//!
//! In: splats on curved paths, written as Spacetime Gaussians, as a capture of splaTV and as parameters of Dynamic 3D
//! Gaussians; the same splats as a static PLY, moved, turned and faded by the formulas of these formats. Out: proof
//! that the import of each is drawn like the static file of that time.

use crate::support::psnr::psnr;
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::reference;
use bevy_gs4d::view::{Background, Camera, Frame, RasterFov};
use glam::{DQuat, DVec3, UVec2, Vec3};
use half::f16;
use std::fs;
use std::io::Write;
use std::path::Path;
use zip::write::SimpleFileOptions;

const COUNT: usize = 80;
/// Frames of the parameters of Dynamic 3D Gaussians; each of [`TIMES`] is the time of a frame.
const FRAMES: usize = 11;
const TIMES: [f32; 3] = [0.2, 0.5, 0.9];
const SH_C0: f64 = 0.282_094_791_773_878_14;

/// A splat; `d` is the time since `center`.
#[derive(Clone)]
struct Splat {
    mean: [f32; 3],
    /// Factors of d, d² and d³ of the mean.
    motion: [f32; 9],
    rotation: [f32; 4],
    /// Factor of d of the quaternion.
    omega: [f32; 4],
    scale: [f32; 3],
    /// From 0 to 255.
    color: [u8; 3],
    alpha: u8,
    center: f32,
    width: f32,
}

/// Returns a pseudorandom number from -1 to 1 that a half float represents exactly.
fn spread(splat: usize, lane: usize) -> f32 {
    let word = (splat as u32 * 64 + lane as u32 + 1).wrapping_mul(0x9e37_79b9);
    let word = (word ^ (word >> 15)).wrapping_mul(0x85eb_ca6b);
    f16::from_f32(((word ^ (word >> 13)) >> 8) as f32 / (1 << 23) as f32 - 1.0).to_f32()
}

fn splats(bends: bool) -> Vec<Splat> {
    let rounded = |value: f32| f16::from_f32(value).to_f32();
    let splat = |index| {
        let at = |lane| spread(index, lane);
        let bend = if bends { 1.0 } else { 0.0 };
        Splat {
            mean: [0, 1, 2].map(at),
            motion: std::array::from_fn(|lane| rounded(at(3 + lane) * if lane < 3 { 0.6 } else { 0.5 * bend })),
            rotation: [1.0, at(12), at(13), at(14)],
            omega: [15, 16, 17, 18].map(|lane| rounded(0.05 * bend * at(lane))),
            scale: [19, 20, 21].map(|lane| rounded(0.1 + 0.04 * at(lane))),
            color: [22, 23, 24].map(|lane| (127.0 + 120.0 * at(lane)) as u8),
            alpha: (170.0 + 80.0 * at(25)) as u8,
            center: rounded(0.5 + 0.5 * at(26)),
            width: rounded(0.7 + 0.3 * at(27)),
        }
    };
    (0..COUNT).map(splat).collect()
}

impl Splat {
    fn mean_at(&self, time: f32) -> DVec3 {
        let d = f64::from(time) - f64::from(self.center);
        let three = |values: &[f32]| DVec3::new(values[0].into(), values[1].into(), values[2].into());
        let [first, second, third] = [0, 3, 6].map(|lane| three(&self.motion[lane..]));
        three(&self.mean) + first * d + second * d * d + third * d * d * d
    }

    fn rotation_at(&self, time: f32) -> [f64; 4] {
        let d = f64::from(time) - f64::from(self.center);
        let [w, x, y, z] = [0, 1, 2, 3].map(|lane| f64::from(self.rotation[lane]) + d * f64::from(self.omega[lane]));
        let turn = DQuat::from_xyzw(x, y, z, w).normalize();
        [turn.w, turn.x, turn.y, turn.z]
    }

    fn alpha_at(&self, time: f32) -> f64 {
        let d = (f64::from(time) - f64::from(self.center)) / f64::from(self.width);
        f64::from(self.alpha) / 255.0 * (-d * d).exp()
    }
}

fn logit(alpha: f64) -> f64 {
    (alpha / (1.0 - alpha)).ln()
}

/// Returns a binary PLY of rows with these float properties.
fn ply(properties: &[String], values: &[f64]) -> Vec<u8> {
    let count = values.len() / properties.len();
    let lines: String = properties.iter().map(|name| format!("property float {name}\n")).collect();
    let header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{lines}end_header\n");
    let body = values.iter().flat_map(|&value| (value as f32).to_le_bytes());
    header.into_bytes().into_iter().chain(body).collect()
}

fn numbered(stem: &str, count: usize) -> impl Iterator<Item = String> {
    (0..count).map(move |number| format!("{stem}_{number}"))
}

/// Returns the splats at a time as a static PLY.
fn still(splats: &[Splat], time: f32, fades: bool) -> Vec<u8> {
    let names = ["x", "y", "z"].map(str::to_owned).into_iter().chain(numbered("f_dc", 3));
    let names = names.chain(["opacity".to_owned()]).chain(numbered("scale", 3)).chain(numbered("rot", 4));
    let names: Vec<String> = names.collect();
    let row = |splat: &Splat| {
        let alpha = if fades { splat.alpha_at(time) } else { f64::from(splat.alpha) / 255.0 };
        let mut row = splat.mean_at(time).to_array().to_vec();
        row.extend(splat.color.map(|byte| (f64::from(byte) / 255.0 - 0.5) / SH_C0));
        row.push(logit(alpha));
        row.extend(splat.scale.map(|scale| f64::from(scale).ln()));
        row.extend(splat.rotation_at(time));
        row
    };
    ply(&names, &splats.iter().flat_map(row).collect::<Vec<_>>())
}

/// Returns the splats as Spacetime Gaussians without a decoder.
fn spacetime(splats: &[Splat]) -> Vec<u8> {
    let names = ["x", "y", "z", "trbf_center", "trbf_scale"].map(str::to_owned).into_iter();
    let names = names.chain(numbered("motion", 9)).chain(numbered("f_dc", 3)).chain(["opacity".to_owned()]);
    let names: Vec<String> =
        names.chain(numbered("scale", 3)).chain(numbered("rot", 4)).chain(numbered("omega", 4)).collect();
    let row = |splat: &Splat| {
        let mut row: Vec<f64> = splat.mean.map(f64::from).to_vec();
        row.extend([f64::from(splat.center), f64::from(splat.width).ln()]);
        row.extend(splat.motion.map(f64::from));
        row.extend(splat.color.map(|byte| f64::from(byte) / 255.0));
        row.push(logit(f64::from(splat.alpha) / 255.0));
        row.extend(splat.scale.map(|scale| f64::from(scale).ln()));
        row.extend(splat.rotation.iter().chain(&splat.omega).map(|&value| f64::from(value)));
        row
    };
    ply(&names, &splats.iter().flat_map(row).collect::<Vec<_>>())
}

/// Returns the splats as a capture of splaTV.
fn splatv(splats: &[Splat]) -> Vec<u8> {
    let parts = format!(r#"[{{"type":"splat","size":{},"texwidth":4096,"texheight":1,"cameras":[]}}]"#, 64 * COUNT);
    let mut file = 0x674b_u32.to_le_bytes().to_vec();
    file.extend((parts.len() as u32).to_le_bytes());
    file.extend(parts.bytes());
    for splat in splats {
        let halves = |values: &[f32]| -> Vec<u8> {
            values.iter().flat_map(|&value| f16::from_f32(value).to_le_bytes()).collect()
        };
        file.extend(splat.mean.iter().flat_map(|value| value.to_le_bytes()));
        file.extend(halves(&splat.rotation));
        file.extend(halves(&splat.scale));
        file.extend(halves(&[0.0]));
        file.extend(splat.color);
        file.push(splat.alpha);
        file.extend(halves(&splat.motion));
        file.extend(halves(&[0.0]));
        file.extend(halves(&splat.omega));
        file.extend(halves(&[splat.center, splat.width]));
    }
    file
}

/// Returns the splats as parameters of Dynamic 3D Gaussians: they are tracked in every frame and do not fade.
fn tracked(splats: &[Splat]) -> Vec<u8> {
    let times = (0..FRAMES).map(|frame| frame as f32 / (FRAMES - 1) as f32);
    let of_frames = |values: &dyn Fn(&Splat, f32) -> Vec<f64>| -> Vec<f64> {
        times.clone().flat_map(|time| splats.iter().flat_map(move |splat| values(splat, time))).collect()
    };
    let of_splats = |values: &dyn Fn(&Splat) -> Vec<f64>| splats.iter().flat_map(values).collect::<Vec<f64>>();
    let (all, each) = (format!("{FRAMES}, {COUNT}"), COUNT);
    let arrays = [
        ("means3D", format!("{all}, 3"), of_frames(&|splat, time| splat.mean_at(time).to_array().to_vec())),
        ("unnorm_rotations", format!("{all}, 4"), of_frames(&|splat, time| splat.rotation_at(time).to_vec())),
        (
            "rgb_colors",
            format!("{all}, 3"),
            of_frames(&|splat, _| splat.color.map(|byte| f64::from(byte) / 255.0).to_vec()),
        ),
        ("logit_opacities", format!("{each}, 1"), of_splats(&|splat| vec![logit(f64::from(splat.alpha) / 255.0)])),
        (
            "log_scales",
            format!("{each}, 3"),
            of_splats(&|splat| splat.scale.map(|scale| f64::from(scale).ln()).to_vec()),
        ),
    ];
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, shape, values) in arrays {
        let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}");
        // Magic, version and header together are a multiple of 64 bytes.
        let padded = format!("{header:<width$}\n", width = (header.len() + 11).next_multiple_of(64) - 11);
        zip.start_file(format!("{name}.npy"), SimpleFileOptions::default()).expect("an entry");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((padded.len() as u16).to_le_bytes());
        bytes.extend(padded.bytes());
        bytes.extend(values.iter().flat_map(|&value| (value as f32).to_le_bytes()));
        zip.write_all(&bytes).expect("its bytes");
    }
    zip.finish().expect("an archive").into_inner()
}

/// Draws a file at a time.
fn draw(path: &Path, time: f32) -> Frame {
    // Small pieces: paths and rotations are nearly those of the file.
    let options = ReadOptions { tolerance: Some(0.01), ..ReadOptions::default() };
    let scene = codec::load(path, &options).unwrap_or_else(|error| panic!("{error}"));
    let scene = scene.into_runtime().expect("it can be drawn");
    let camera = Camera::look_at(Vec3::new(1.5, -1.0, -3.0), Vec3::ZERO, Vec3::NEG_Y, 0.9, UVec2::new(96, 80));
    reference::render(&scene, &camera.view(time, RasterFov::Corrected), Background::Color([0.0; 3]))
}

/// Checks the pictures of a file against those of static files: the PSNR is at least `due` dB.
fn check(name: &str, file: &[u8], splats: &[Splat], fades: bool, due: f64) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (moving, static_ply) = (folder.path().join(name), folder.path().join("still.ply"));
    fs::write(&moving, file).expect("the folder can be written to");
    for time in TIMES {
        fs::write(&static_ply, still(splats, time, fades)).expect("the folder can be written to");
        let [found, expected] = [&moving, &static_ply].map(|path| draw(path, time));
        let lit = expected.picture.pixels.iter().filter(|pixel| pixel.max_element() > 0.1).count();
        assert!(lit > 500, "{name} at {time}: {lit} pixels show something");
        let decibels = psnr(&found, &expected);
        eprintln!("{name} at {time}: {decibels:.1} dB");
        assert!(decibels >= due, "{name} at {time}: {decibels:.1} dB, at least {due} expected");
    }
}

#[test]
fn spacetime_gaussians_are_drawn_as_static_gaussians_of_each_time() {
    let splats = splats(true);
    check("capture.ply", &spacetime(&splats), &splats, true, 60.0);
}

#[test]
fn captures_of_splatv_are_drawn_as_static_gaussians_of_each_time() {
    let splats = splats(true);
    check("capture.splatv", &splatv(&splats), &splats, true, 60.0);
}

#[test]
fn tracked_gaussians_are_drawn_as_static_gaussians_of_each_frame() {
    let splats = splats(false);
    check("params.npz", &tracked(&splats), &splats, false, 120.0);
}
