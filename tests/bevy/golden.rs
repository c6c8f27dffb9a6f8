//! Trained captures through a headless Bevy app, against pictures of the original implementation.
//!
//! In: the folder named by `GS4D_DATA`, with checkpoints, golden cameras (`.json`) and golden pictures (`.npz`). Out:
//! proof that the PSNR of every view is at the level of rounding to 8 bits, and that few pixels differ by more than
//! 1 / 255. Skipped without the folder or without a GPU.

use crate::support::cpu_reference::differences;
use crate::support::offscreen_app::{app, picture, spawn_camera};
use crate::support::{data, npz};
use bevy::camera::RenderTarget;
use bevy::prelude::*;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::codec::ReadOptions;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::view::Picture;
use bevy_gs4d::{GaussianCapture3d, codec};
use image::RgbaImage;
use std::fs::File;

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
#[ignore = "takes minutes; `.ci/full` runs it"]
fn toybox_matches_the_original() {
    check("toybox/toybox_chkpnt.pth", "toybox/golden_vanilla");
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it"]
fn pruned_toybox_matches_the_original() {
    check("toybox/toybox_4dgs1k.pth", "toybox/golden_4dgs1k");
}

#[test]
fn small_toybox_matches_the_original() {
    check("toybox/toybox_45k.pth", "toybox/golden_45k");
}

#[test]
fn standup_matches_the_original() {
    check("standup/standup_chkpnt.pth", "standup/standup_golden");
}

fn check(checkpoint: &str, golden: &str) {
    let Some(folder) = data::data() else { return };
    let json = File::open(folder.join(golden).with_extension("json")).expect("the golden cameras are there");
    let Golden { background, views } = serde_json::from_reader(json).expect("golden cameras");
    let expected = npz::pictures(&folder.join(golden).with_extension("npz"), "images");
    let size = UVec2::new(views[0].width, views[0].height);
    let Some(mut app) = app(size) else { return };
    let [r, g, b] = background;
    app.insert_resource(ClearColor(Color::srgb(r, g, b)));
    let scene = codec::load(&folder.join(checkpoint), &ReadOptions::default()).expect("a readable checkpoint");
    let capture = GaussianCapture::new(scene.into_runtime().expect("a drawable capture"));
    let seconds: Vec<f32> = views.iter().map(|view| capture.seconds_at(view.time)).collect();
    let handle = app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(capture);
    let entity = app.world_mut().spawn(GaussianCapture3d(handle)).id();
    let camera = spawn_camera(&mut app, Msaa::Off, Transform::default());
    assert!(app.world().get::<RenderTarget>(camera).is_some(), "the camera has an offscreen target");
    for (index, view) in views.iter().enumerate() {
        let fov = 2.0 * (view.height as f32 / (2.0 * view.fl_y)).atan();
        let lens = Projection::Perspective(PerspectiveProjection { fov, ..default() });
        app.world_mut().entity_mut(camera).insert((pose(view), lens));
        app.world_mut().entity_mut(entity).insert(Playback::paused_at(seconds[index]));
        let picture = picture(&mut app, 0.0);
        let (psnr, apart) = (psnr(&picture, &expected[index]), differences(&picture, &expected[index]));
        let worst = apart.iter().copied().fold(0.0, f32::max);
        let beyond = apart.iter().filter(|apart| **apart > 1.0).count();
        let found = format!("{checkpoint}, view {index}: {psnr:.2} dB, worst {worst:.2} / 255, {beyond} pixels");
        println!("{found}");
        // The original's pictures rounded to 8 bits have at least 60.7 dB, with errors of half a step.
        assert!(psnr >= 57.5, "{found}: less than 57.5 dB");
        // A splat's alpha may be close to 1/255, so that only one renderer draws the splat.
        assert!(worst <= 3.0 && beyond <= 16, "{found} differ by more than 1 / 255");
    }
}

fn pose(view: &GoldenView) -> Transform {
    let world_to_camera = Mat4::from_cols_array_2d(&view.world_to_camera_opencv).transpose();
    let flip = Mat4::from_diagonal(Vec4::new(1.0, -1.0, -1.0, 1.0));
    Transform::from_matrix((flip * world_to_camera).inverse())
}

/// Returns the PSNR in dB of 8-bit RGB against floats clamped to 0..1.
fn psnr(picture: &RgbaImage, expected: &Picture) -> f64 {
    let error = |(pixel, expected): (&image::Rgba<u8>, &Vec3)| -> f64 {
        let channel = |c: usize| f64::from(pixel.0[c]) / 255.0 - f64::from(expected[c].clamp(0.0, 1.0));
        (0..3).map(|c| channel(c).powi(2)).sum()
    };
    let sum: f64 = picture.pixels().zip(&expected.pixels).map(error).sum();
    -10.0 * (sum / (3 * expected.pixels.len()) as f64).log10()
}
