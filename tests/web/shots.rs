//! The pictures that a browser is asked for.
//!
//! In: the golden scenes, a capture in chunk files and the bundled capture. Out: [`Shot`]s, each with the file of its capture, a camera in the
//! numbers of the page, and the picture of the CPU reference.

use crate::support::golden::all_views;
use crate::take::Take;
use bevy_gs4d::codec::package::{self, WriteSettings};
use bevy_gs4d::reference;
use bevy_gs4d::scene::{Bounds, GaussianScene, RuntimeScene};
use bevy_gs4d::view::{Camera, RasterFov, View};
use glam::{UVec2, Vec2, Vec3, Vec4Swizzles};
use serde_json::json;
use std::io::Cursor;

/// A picture that a browser is asked for.
pub struct Shot {
    /// Name, for messages.
    pub name: String,
    /// Path of the capture on the server, and its bytes unless the page has it.
    pub file: String,
    pub package: Option<Vec<u8>>,
    view: View,
    /// Expected colors, 8 bits a channel.
    pub expected: Vec<u8>,
    /// Those of an app, which anti-aliases, for the bundled capture.
    pub of_app: Option<Vec<u8>>,
}

/// Returns all pictures.
pub fn all(take: &Take) -> Vec<Shot> {
    let goldens = all_views().into_iter().map(|golden| {
        let mut scene = golden.scene;
        // The field of view belongs to the capture in a package.
        let is_sentinel = golden.view.tan_fov.x < 0.0;
        scene.trained_with.raster_fov = if is_sentinel { RasterFov::Reference } else { RasterFov::Corrected };
        let mut package = Vec::new();
        let stored = GaussianScene::from(scene.clone());
        package::write(&mut package, &stored, &WriteSettings::default()).expect("golden scenes can be written");
        let file = format!("/golden/{}.gs4d", golden.name);
        shot(golden.name, file, Some(package), &scene, golden.view)
    });
    let bytes = include_bytes!("../../assets/toybox.gs4d");
    let toybox =
        package::read(Cursor::new(bytes)).expect("the bundled capture is intact").into_runtime().expect("drawable");
    let core = Bounds::core(toybox.iter()).expect("it has Gaussians");
    let bundled = [(0.0, 0.0f32), (0.4, 2.0), (0.95, 4.0)].map(|(time, angle)| {
        let outward = Vec3::new(angle.cos(), angle.sin(), 0.4) * 3.0 * core.radius();
        let size = UVec2::new(320, 180);
        let camera = Camera::look_at(core.center() + outward, core.center(), Vec3::Z, 0.9, size);
        let view = camera.view(time, toybox.trained_with.raster_fov);
        let of_app = Some(picture(&toybox, &view.antialiased(toybox.trained_with.pixel)));
        let shot = shot(format!("toybox at {time}"), "/page/toybox.gs4d".into(), None, &toybox, view);
        Shot { of_app, ..shot }
    });
    let in_files = [
        ("/take/index.gs4d", 0.1),
        ("/take/index.gs4d", 0.6),
        ("/take/index.gs4d", 0.95),
        ("/parts.gs4d", 0.6),
        ("/whole.gs4d", 0.6),
    ];
    let in_files = in_files.map(|(file, time)| {
        let camera = Camera::look_at(Vec3::new(2.0, -1.5, 1.2), Vec3::ZERO, Vec3::Z, 0.9, UVec2::new(320, 180));
        let view = camera.view(time, take.scene.trained_with.raster_fov);
        shot(format!("{file} at {time}"), file.into(), None, &take.scene, view)
    });
    goldens.chain(in_files).chain(bundled).collect()
}

fn shot(name: String, file: String, package: Option<Vec<u8>>, scene: &RuntimeScene, view: View) -> Shot {
    let expected = picture(scene, &view);
    Shot { name, file, package, view, expected, of_app: None }
}

fn picture(scene: &RuntimeScene, view: &View) -> Vec<u8> {
    reference::render(scene, view, scene.trained_background()).picture.to_rgb8().into_raw()
}

/// Returns the pictures as JSON, for the page.
pub fn listed(shots: &[Shot]) -> String {
    let entry = |shot: &Shot| {
        let (view, size) = (&shot.view, shot.view.size.as_vec2());
        let (scale, offset) = (view.projection.xy(), view.projection.zw());
        let lens = if view.tan_fov.x > 0.0 && offset == Vec2::ZERO {
            view.tan_fov.to_array().to_vec()
        } else {
            let (focal, center) = (scale * size / 2.0, (offset * size + size) / 2.0);
            [focal.to_array(), center.to_array()].concat()
        };
        json!({
            "name": shot.name, "file": shot.file, "width": view.size.x, "height": view.size.y, "time": view.time,
            "pose": view.world_to_camera.to_cols_array().to_vec(), "lens": lens,
        })
    };
    serde_json::Value::from(shots.iter().map(entry).collect::<Vec<_>>()).to_string()
}
