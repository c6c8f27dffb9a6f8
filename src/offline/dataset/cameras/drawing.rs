//! A picture of the cameras of a dataset.
//!
//! In: cameras. Out: a picture of two parts: the cameras seen from above, and from the side. A camera is a dot, with a
//! line in its viewing direction and two lines at the edges of its field of view; a cross is the origin. The axis of
//! the world that is closest to the cameras' mean upward direction points up.

use crate::view::{Camera, Lens, Picture};
use glam::{UVec2, Vec2, Vec3};

/// Side of each part, pixels.
const SIDE: u32 = 512;
/// Empty border of each part, pixels.
const BORDER: f32 = 40.0;
/// Length of the lines, fraction of the part.
const LENGTH: f32 = 0.09;
const BACKGROUND: Vec3 = Vec3::splat(1.0);
const CROSS: Vec3 = Vec3::splat(0.6);
const DIRECTION: Vec3 = Vec3::new(0.1, 0.3, 0.8);
const EDGE: Vec3 = Vec3::new(0.6, 0.7, 0.95);
const DOT: Vec3 = Vec3::new(0.8, 0.15, 0.1);

/// Draws the cameras. Without any, the picture has the cross alone.
pub fn draw(cameras: &[Camera]) -> Picture {
    let size = UVec2::new(2 * SIDE, SIDE);
    let mut picture = Picture { size, pixels: vec![BACKGROUND; (size.x * size.y) as usize] };
    let up = up_axis(cameras);
    let others = [0, 1, 2].into_iter().filter(|&axis| axis != up.0).collect::<Vec<_>>();
    let across = |point: Vec3| point[others[0]];
    let away = |point: Vec3| point[others[1]];
    let high = |point: Vec3| point[up.0] * up.1;
    let places: Vec<Vec3> = cameras.iter().map(place).filter(|place| place.is_finite()).collect();
    let least = places.iter().copied().fold(Vec3::ZERO, Vec3::min);
    let most = places.iter().copied().fold(Vec3::ZERO, Vec3::max);
    let scale = (SIDE as f32 - 2.0 * BORDER) / (most - least).max_element().max(f32::MIN_POSITIVE);
    let middle = 0.5 * (least + most);
    for part in 0..2 {
        let to_pixel = |point: Vec3| {
            let from_middle = point - middle;
            let vertical = if part == 0 { away(from_middle) } else { high(from_middle) };
            let corner = Vec2::new((part * SIDE) as f32, 0.0);
            corner + Vec2::splat(SIDE as f32 / 2.0) + Vec2::new(across(from_middle), -vertical) * scale
        };
        let origin = to_pixel(Vec3::ZERO);
        for arm in [Vec2::new(6.0, 0.0), Vec2::new(0.0, 6.0)] {
            line(&mut picture, part, origin - arm, origin + arm, CROSS);
        }
        let length = LENGTH * SIDE as f32 / scale;
        for camera in cameras.iter().filter(|camera| place(camera).is_finite()) {
            let at = place(camera);
            let tan = match camera.lens {
                Lens::Fov { tan } => tan.x,
                Lens::Intrinsics { focal, .. } => camera.size.x as f32 / (2.0 * focal.x),
            };
            for (side, color) in [(-tan, EDGE), (tan, EDGE), (0.0, DIRECTION)] {
                let ray = camera.world_to_camera.inverse().transform_vector3(Vec3::new(side, 0.0, 1.0));
                line(&mut picture, part, to_pixel(at), to_pixel(at + ray.normalize_or_zero() * length), color);
            }
            let pixel = to_pixel(at);
            for offset in -2..=2 {
                let row = Vec2::new(0.0, offset as f32);
                line(&mut picture, part, pixel + row - Vec2::X * 2.0, pixel + row + Vec2::X * 2.0, DOT);
            }
        }
    }
    picture
}

fn place(camera: &Camera) -> Vec3 {
    camera.world_to_camera.inverse().w_axis.truncate()
}

/// Returns the axis closest to the mean upward direction of the cameras, and its sign.
fn up_axis(cameras: &[Camera]) -> (usize, f32) {
    let up = |camera: &Camera| -camera.world_to_camera.row(1).truncate();
    let sum: Vec3 = cameras.iter().map(up).filter(|up| up.is_finite()).sum();
    let axis = if cameras.is_empty() { 2 } else { sum.abs().max_position() };
    (axis, if sum[axis] < 0.0 { -1.0 } else { 1.0 })
}

/// Draws a line inside a part of the picture.
fn line(picture: &mut Picture, part: u32, from: Vec2, to: Vec2, color: Vec3) {
    let steps = (to - from).abs().max_element().ceil();
    if !(0.0..=(4 * SIDE) as f32).contains(&steps) {
        return;
    }
    for step in 0..=steps as u32 {
        let at = from.lerp(to, step as f32 / steps.max(1.0)).round();
        let inside =
            at.x >= (part * SIDE) as f32 && at.x < ((part + 1) * SIDE) as f32 && at.y >= 0.0 && at.y < SIDE as f32;
        if inside {
            picture.pixels[(at.y as u32 * picture.size.x + at.x as u32) as usize] = color;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_dots_with_lines_where_they_look() {
        let size = UVec2::splat(8);
        let look = |eye| Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.7, size);
        let cameras = [look(Vec3::new(4.0, 0.0, 1.0)), look(Vec3::new(-4.0, 0.0, 1.0)), look(Vec3::new(0.0, 4.0, 1.0))];
        let picture = draw(&cameras);
        assert_eq!(up_axis(&cameras), (2, 1.0), "z points up");
        let dots = |from: u32, to: u32| {
            (from..to).flat_map(|x| (0..SIDE).map(move |y| (x, y))).filter(|&(x, y)| picture.pixel(x, y) == DOT).count()
        };
        assert_eq!(dots(0, SIDE), 75, "three dots of 25 pixels, from above");
        assert_eq!(dots(SIDE, 2 * SIDE), 75, "three dots of 25 pixels, from the side");
        // From above, the camera at x = 4 is at the right and looks to the left.
        let (right, row) = (SIDE - BORDER as u32, SIDE / 2 + ((SIDE as f32 - 2.0 * BORDER) / 8.0 * 2.0) as u32);
        assert_eq!(picture.pixel(right, row), DOT, "the camera at x = 4");
        assert_eq!(picture.pixel(right - 10, row), DIRECTION, "its viewing direction");
        assert_eq!(draw(&[]).size, UVec2::new(2 * SIDE, SIDE), "no camera is no fault");
    }
}
