//! Trained captures through a headless Bevy app, against pictures of the original implementation.
//!
//! In: the folder named by `GS4D_DATA`, with checkpoints, golden cameras (`.json`) and golden pictures (`.npz`). Out: the PSNR of
//! every view, which must reach 50 dB. Skipped without the folder, or without a GPU.

#[path = "common/app.rs"]
mod common;
#[path = "common/data.rs"]
mod data;
#[path = "common/skip.rs"]
mod skip;

use bevy::camera::RenderTarget;
use bevy::prelude::*;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::codec::checkpoint::CheckpointOptions;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::{GaussianCapture3d, codec};
use image::RgbaImage;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// A camera of a golden file.
#[derive(serde::Deserialize)]
struct GoldenView {
    time: f32,
    width: u32,
    height: u32,
    fl_y: f32,
    world_to_camera_opencv: [[f32; 4]; 4],
}

#[derive(serde::Deserialize)]
struct Golden {
    background: [f32; 3],
    views: Vec<GoldenView>,
}

#[test]
fn the_whole_toybox_looks_as_the_original_renders_it() {
    check("toybox/toybox_chkpnt.pth", "toybox/golden_vanilla");
}

#[test]
fn the_pruned_toybox_looks_as_the_original_renders_it() {
    check("toybox/toybox_4dgs1k.pth", "toybox/golden_4dgs1k");
}

#[test]
fn the_small_toybox_looks_as_the_original_renders_it() {
    check("toybox/toybox_45k.pth", "toybox/golden_45k");
}

#[test]
fn standup_looks_as_the_original_renders_it() {
    check("standup/standup_chkpnt.pth", "standup/standup_golden");
}

fn check(checkpoint: &str, golden: &str) {
    let Some(folder) = data::data() else { return };
    let json = File::open(folder.join(golden).with_extension("json")).expect("the golden cameras are there");
    let Golden { background, views } = serde_json::from_reader(json).expect("golden cameras");
    let expected = pictures(&folder.join(golden).with_extension("npz"));
    let size = UVec2::new(views[0].width, views[0].height);
    let Some(mut app) = common::app(size) else { return };
    let [r, g, b] = background;
    app.insert_resource(ClearColor(Color::srgb(r, g, b)));
    let scene = codec::load(&folder.join(checkpoint), &CheckpointOptions::default()).expect("a readable checkpoint");
    let capture = GaussianCapture::new(scene.into_runtime().expect("a drawable capture"));
    let seconds: Vec<f32> = views.iter().map(|view| capture.seconds_at(view.time)).collect();
    let handle = app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(capture);
    let entity = app.world_mut().spawn(GaussianCapture3d(handle)).id();
    let camera = common::spawn_camera(&mut app, Msaa::Off, Transform::default());
    assert!(app.world().get::<RenderTarget>(camera).is_some(), "the camera draws into a picture");
    for (index, view) in views.iter().enumerate() {
        let fov = 2.0 * (view.height as f32 / (2.0 * view.fl_y)).atan();
        let lens = Projection::Perspective(PerspectiveProjection { fov, ..default() });
        app.world_mut().entity_mut(camera).insert((pose(view), lens));
        app.world_mut().entity_mut(entity).insert(Playback::paused_at(seconds[index]));
        let plane = (3 * size.x * size.y) as usize;
        let psnr = psnr(&common::picture(&mut app, 0.0), &expected[index * plane..][..plane]);
        println!("{checkpoint} view {index}: {psnr:.2} dB");
        assert!(psnr >= 50.0, "{checkpoint}, view {index}: {psnr:.2} dB is less than 50");
    }
}

fn pose(view: &GoldenView) -> Transform {
    let world_to_camera = Mat4::from_cols_array_2d(&view.world_to_camera_opencv).transpose();
    let flip = Mat4::from_diagonal(Vec4::new(1.0, -1.0, -1.0, 1.0));
    Transform::from_matrix((flip * world_to_camera).inverse())
}

/// Of 8-bit RGB against planar floats, both clamped to 0..1.
fn psnr(picture: &RgbaImage, expected: &[f32]) -> f64 {
    let plane = (picture.width() * picture.height()) as usize;
    let error = |(i, pixel): (usize, &image::Rgba<u8>)| -> f64 {
        let channel = |c: usize| f64::from(pixel.0[c]) / 255.0 - f64::from(expected[c * plane + i].clamp(0.0, 1.0));
        (0..3).map(|c| channel(c).powi(2)).sum()
    };
    let mean = picture.pixels().enumerate().map(error).sum::<f64>() / (3 * plane) as f64;
    -10.0 * mean.log10()
}

/// The array `images` of an `.npz`: little-endian floats of 4 or 2 bytes, views × 3 × height × width.
fn pictures(path: &Path) -> Vec<f32> {
    let mut archive = zip::ZipArchive::new(File::open(path).expect("the golden pictures are there")).expect("an npz");
    let mut bytes = Vec::new();
    archive.by_name("images.npy").expect("the array `images`").read_to_end(&mut bytes).expect("whole");
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00", "an npy of version 1");
    let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let text = String::from_utf8_lossy(&bytes[10..header]).into_owned();
    let values = &bytes[header..];
    if text.contains("'<f4'") {
        values.chunks_exact(4).map(|v| f32::from_le_bytes([v[0], v[1], v[2], v[3]])).collect()
    } else {
        assert!(text.contains("'<f2'"), "single or half precision, not {text}");
        values.chunks_exact(2).map(|v| half(u16::from_le_bytes([v[0], v[1]]))).collect()
    }
}

/// A half-precision number.
fn half(bits: u16) -> f32 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f32::from(bits & 1023));
    let magnitude =
        if exponent == 0 { fraction * 2f32.powi(-24) } else { (1024.0 + fraction) * 2f32.powi(exponent - 25) };
    if bits >> 15 == 1 { -magnitude } else { magnitude }
}
