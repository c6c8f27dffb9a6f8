//! Where the cameras of a take stand, and where they show a point.
//!
//! In: cameras. Out: [`center`]: the point that they look at; [`Projector`]: the pixel of a point.

use crate::offline::dataset::cameras::axes::closest;
use crate::view::{Camera, Lens};
use glam::{DVec3, Mat4, UVec2, Vec2, Vec3};

/// Below this determinant of the mean, axes are nearly parallel and have no closest point.
const PARALLEL: f64 = 1e-3;
/// Distance of the center from the middle of parallel cameras, in distances of the farthest camera from that middle.
const AHEAD: f64 = 3.0;

/// Returns the place of a camera, world space.
pub(super) fn place(camera: &Camera) -> DVec3 {
    camera.world_to_camera.inverse().w_axis.truncate().as_dvec3()
}

/// Returns the direction in which a camera looks, world space, of length 1.
fn axis(camera: &Camera) -> DVec3 {
    camera.world_to_camera.row(2).truncate().as_dvec3().normalize_or(DVec3::Z)
}

/// Returns the point that is closest to the axes of all cameras, world space. Of cameras whose axes are parallel, or
/// cross behind most of them, it is a point ahead of their middle.
pub(super) fn center<'a>(cameras: impl Iterator<Item = &'a Camera>) -> DVec3 {
    let rays: Vec<(DVec3, DVec3)> = cameras.map(|camera| (place(camera), axis(camera))).collect();
    let count = rays.len().max(1) as f64;
    let is_ahead = |point: DVec3| {
        let ahead = rays.iter().filter(|(origin, direction)| direction.dot(point - *origin) > 0.0).count();
        2 * ahead > rays.len()
    };
    if let Some(point) = closest(rays.iter().copied(), PARALLEL).filter(|&point| is_ahead(point)) {
        return point;
    }
    let middle = rays.iter().map(|(origin, _)| *origin).sum::<DVec3>() / count;
    let spread = rays.iter().map(|(origin, _)| origin.distance(middle)).fold(0.0, f64::max);
    let direction = rays.iter().map(|(_, direction)| *direction).sum::<DVec3>().normalize_or(DVec3::Z);
    middle + direction * AHEAD * spread
}

/// The projection of a camera without distortion.
#[derive(Debug, Clone, Copy)]
pub(super) struct Projector {
    world_to_camera: Mat4,
    /// Focal lengths, pixels.
    pub focal: Vec2,
    center: Vec2,
    /// Size of the picture, pixels.
    pub size: UVec2,
}

impl Projector {
    /// The projection of a camera.
    pub(super) fn of(camera: &Camera) -> Self {
        let size = camera.size.as_vec2();
        let (focal, center) = match camera.lens {
            Lens::Intrinsics { focal, center } => (focal, center),
            Lens::Fov { tan } => (size / 2.0 / tan, size / 2.0),
        };
        Self { world_to_camera: camera.world_to_camera, focal, center, size: camera.size }
    }

    /// Returns the distance of a point of world space from the camera, along its axis.
    pub(super) fn distance(&self, point: Vec3) -> f32 {
        self.world_to_camera.transform_point3(point).z
    }

    /// Returns the pixel that shows a point of world space, as an index row by row; `None` if the picture does not.
    pub(super) fn pixel(&self, point: Vec3) -> Option<usize> {
        let seen = self.world_to_camera.transform_point3(point);
        let at = self.focal * seen.truncate() / seen.z + self.center;
        let size = self.size.as_vec2();
        let is_shown = seen.z > 0.0 && at.cmpge(Vec2::ZERO).all() && at.cmplt(size).all();
        is_shown.then(|| at.y as usize * self.size.x as usize + at.x as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(eye: Vec3, target: Vec3) -> Camera {
        Camera::look_at(eye, target, Vec3::Z, 0.7, UVec2::new(80, 40))
    }

    #[test]
    fn the_center_is_what_the_cameras_look_at() {
        let at = Vec3::new(0.3, 0.2, 0.1);
        let ring = [0.0f32, 1.5, 3.0].map(|angle| camera(at + 3.0 * Vec3::new(angle.cos(), angle.sin(), 0.4), at));
        let found = center(ring.iter());
        assert!(found.distance(at.as_dvec3()) < 1e-3, "the center is at {found}");
        let row = [0.0f32, 1.0].map(|y| camera(Vec3::new(5.0, y, 0.0), Vec3::new(0.0, y, 0.0)));
        let found = center(row.iter());
        assert!(found.distance(DVec3::new(3.5, 0.5, 0.0)) < 1e-3, "ahead of parallel cameras: {found}");
    }

    #[test]
    fn the_target_of_a_camera_is_in_the_middle_of_its_picture() {
        let projector = Projector::of(&camera(Vec3::X, Vec3::ZERO));
        let pixel = projector.pixel(Vec3::new(0.0, 1e-4, -1e-4)).expect("it is seen");
        assert!((39..=40).contains(&(pixel % 80)) && (19..=20).contains(&(pixel / 80)), "pixel {pixel}");
        assert_eq!(projector.pixel(Vec3::X * 2.0), None, "behind the camera");
    }
}
