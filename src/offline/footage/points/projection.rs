//! The pixel of a place and the place of a pixel.
//!
//! In: a camera without lens distortion. Out: [`Projection`]: pixels of places of the world space, and places at a
//! depth behind a pixel. The center of the first pixel is at 0.5.

use crate::view::{Camera, RasterFov};
use glam::{Mat3, UVec2, Vec2, Vec3, Vec4};

/// How a camera projects.
#[derive(Debug, Clone)]
pub(crate) struct Projection {
    /// Rows x and y of pixel space, and depth.
    rows: [Vec4; 3],
    /// Pixel and 1, times depth, to the offset from the camera, world space.
    to_world: Mat3,
    /// The place of the camera, world space.
    pub eye: Vec3,
    /// The larger focal length, pixels.
    pub focal: f32,
    /// Size of the picture, pixels.
    pub size: UVec2,
}

impl Projection {
    /// Returns the projection of a camera.
    pub(crate) fn of(camera: &Camera) -> Self {
        let view = camera.view(0.0, RasterFov::Corrected);
        let half = view.size.as_vec2() * 0.5;
        let [x, y] = view.clip_rows();
        let depth = view.world_to_camera.row(2);
        let rows = [(x + depth) * half.x, (y + depth) * half.y, depth];
        let [x, y, z] = rows.map(Vec4::truncate);
        Self {
            rows,
            to_world: Mat3::from_cols(x, y, z).transpose().inverse(),
            eye: view.camera_position,
            focal: view.focal().max_element(),
            size: view.size,
        }
    }

    /// Returns the pixel that shows a place, which may be outside the picture, and the depth of the place, camera
    /// units; `None` if the place is not in front of the camera.
    pub(crate) fn pixel(&self, place: Vec3) -> Option<(Vec2, f32)> {
        let [x, y, depth] = self.rows.map(|row| row.dot(place.extend(1.0)));
        (depth > 0.0).then(|| (Vec2::new(x, y) / depth, depth))
    }

    /// Returns the pixel of the picture that shows a place, and the depth of the place, camera units; `None` if the
    /// picture does not show it.
    pub(crate) fn shown(&self, place: Vec3) -> Option<(UVec2, f32)> {
        let (at, depth) = self.pixel(place)?;
        self.is_inside(at).then(|| (at.as_uvec2().min(self.size - 1), depth))
    }

    /// Returns whether a pixel is in the picture.
    pub(crate) fn is_inside(&self, at: Vec2) -> bool {
        at.cmpge(Vec2::ZERO).all() && at.cmplt(self.size.as_vec2()).all()
    }

    /// Returns the place at a depth (camera units) behind a pixel, world space.
    pub(crate) fn place(&self, at: Vec2, depth: f32) -> Vec3 {
        self.eye + self.to_world * at.extend(1.0) * depth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Lens;

    #[test]
    fn a_place_behind_a_pixel_is_shown_by_this_pixel() {
        let size = UVec2::new(640, 360);
        let looking = Camera::look_at(Vec3::new(3.0, 1.0, 2.0), Vec3::ZERO, Vec3::Z, 1.0, size);
        let lens = Lens::Intrinsics { focal: Vec2::new(465.0, 470.0), center: Vec2::new(318.0, 186.0) };
        for camera in [looking, Camera { lens, ..looking }] {
            let projection = Projection::of(&camera);
            let at = Vec2::new(100.25, 300.75);
            let (found, depth) = projection.pixel(projection.place(at, 2.5)).expect("in front of the camera");
            assert!(found.distance(at) < 1e-2 && (depth - 2.5).abs() < 1e-4, "the same pixel: {found}, {depth}");
            assert!(projection.eye.distance(Vec3::new(3.0, 1.0, 2.0)) < 1e-5, "the place of the camera");
        }
        let behind = Projection::of(&looking).pixel(Vec3::new(6.0, 2.0, 4.0));
        assert_eq!(behind, None, "a place behind the camera");
    }
}
