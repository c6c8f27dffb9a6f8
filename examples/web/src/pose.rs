//! Cameras, as a page gives them.
//!
//! In: sixteen numbers of a pose, and the numbers of a lens. Out: a [`View`].

use bevy_gs4d::view::{Camera, Lens, Optics, View};
use glam::{Mat4, UVec2, Vec2};

/// Returns the view of a camera. `pose` is the matrix from the space of the capture to that of the camera (x right, y
/// down, z forward), column by column; `lens` the tangents of half the field of view across and down, or the focal
/// lengths and the principal point in pixels.
///
/// # Errors
/// A message about other counts of numbers, or numbers that are not finite.
pub fn view(pose: &[f32], lens: &[f32], size: UVec2, time: f32, optics: Optics) -> Result<View, String> {
    let pose: &[f32; 16] = pose.try_into().map_err(|_| "a pose has sixteen numbers".to_owned())?;
    let lens = match *lens {
        [x, y] => Lens::Fov { tan: Vec2::new(x, y) },
        [fl_x, fl_y, cx, cy] => Lens::Intrinsics { focal: Vec2::new(fl_x, fl_y), center: Vec2::new(cx, cy) },
        _ => return Err("a lens has two numbers or four".to_owned()),
    };
    let view = Camera { world_to_camera: Mat4::from_cols_array(pose), size, lens }.view(time, optics);
    if view.is_finite() { Ok(view) } else { Err("the camera has numbers that are not finite".to_owned()) }
}
