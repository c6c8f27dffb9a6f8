//! A dataset of pictures of a scene.
//!
//! In: a scene and a folder. Out: `transforms_train.json` and `transforms_test.json` in the folder, and the images that
//! they name, drawn by the CPU reference and rounded to 8 bits.

use bevy_gs4d::reference;
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::view::Camera;
use glam::{UVec2, Vec3, Vec4};
use serde_json::{Value, json};
use std::f32::consts::TAU;
use std::fs;
use std::path::Path;

/// Horizontal field of view, radians.
const FOV: f32 = 0.7;

/// Writes both splits: `cameras` cameras on a circle around `center`, each at `times` times from 0 to 1; the test split
/// has two cameras at other angles. The images are drawn if `images` is true.
pub fn write(
    folder: &Path,
    scene: &RuntimeScene,
    center: Vec3,
    cameras: usize,
    times: usize,
    size: UVec2,
    images: bool,
) {
    for (split, cameras, phase) in [("train", cameras, 0.0), ("test", 2, 0.37)] {
        let mut frames = Vec::new();
        for camera in 0..cameras {
            let angle = TAU * (camera as f32 + phase) / cameras as f32;
            let eye = center + Vec3::new(3.5 * angle.cos(), 3.5 * angle.sin(), 1.8);
            let camera_at = Camera::look_at(eye, center, Vec3::Z, FOV, size);
            for time in 0..times {
                let name = format!("{split}/c{camera:02}_{time:02}");
                let time = time as f32 / (times - 1) as f32;
                frames.push(frame(&camera_at, &name, time));
                let path = folder.join(format!("{name}.png"));
                fs::create_dir_all(path.parent().expect("the path has a folder"))
                    .expect("the folder can be written to");
                if images {
                    let view = camera_at.view(time, scene.trained_with.raster_fov);
                    let picture = reference::render(scene, &view, scene.trained_background()).picture;
                    picture.to_rgb8().save(&path).expect("the folder can be written to");
                }
            }
        }
        let json = json!({ "camera_angle_x": FOV, "w": size.x, "h": size.y, "frames": frames });
        let path = folder.join(format!("transforms_{split}.json"));
        fs::write(path, json.to_string()).expect("the folder can be written to");
    }
}

/// Returns one frame in the Blender format, with OpenGL axes.
fn frame(camera: &Camera, name: &str, time: f32) -> Value {
    let to_world = camera.world_to_camera.inverse() * glam::Mat4::from_diagonal(Vec4::new(1.0, -1.0, -1.0, 1.0));
    let rows: Vec<[f32; 4]> = (0..4).map(|row| to_world.row(row).to_array()).collect();
    json!({ "file_path": format!("./{name}"), "time": time, "transform_matrix": rows })
}
