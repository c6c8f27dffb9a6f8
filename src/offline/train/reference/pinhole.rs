//! The projection of a view: from places to pixels and back.
//!
//! In: a view with a perspective lens. Out: [`Pinhole`]: the pixel that shows a place, the ray of a pixel, the size of a
//! pixel at a place. Pixels are counted from the upper left corner; pixel centers are at half-integers.

use crate::view::View;
use glam::{Mat4, Vec2, Vec3, Vec4};

/// The projection of a view with a perspective lens.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pinhole {
    /// The place of the camera, capture space.
    pub origin: Vec3,
    /// Picture size, pixels.
    pub size: Vec2,
    /// Rows x and y of clip space, and depth.
    rows: [Vec4; 3],
    projection: Vec4,
    camera_to_world: Mat4,
    near: f32,
    /// Pixels of a capture unit across the picture at depth 1.
    focal: f32,
}

impl Pinhole {
    /// Returns the projection of a view.
    pub(crate) fn of(view: &View) -> Self {
        let ([x, y], size) = (view.clip_rows(), view.size.as_vec2());
        let across = view.world_to_camera.row(0).truncate().length();
        Self {
            origin: view.camera_position,
            size,
            rows: [x, y, view.world_to_camera.row(2)],
            projection: view.projection,
            camera_to_world: view.world_to_camera.inverse(),
            near: view.near,
            focal: 0.5 * size.x * view.projection.x * across,
        }
    }

    /// Returns where a picture shows a place, pixels from its upper left corner; `None` if it does not.
    pub(crate) fn pixel_of(&self, position: Vec3) -> Option<Vec2> {
        let [x, y, depth] = self.rows.map(|row| row.dot(position.extend(1.0)));
        let at = (Vec2::new(x, y) / depth + 1.0) * 0.5 * self.size;
        let is_shown = depth > self.near && at.cmpge(Vec2::ZERO).all() && at.cmplt(self.size).all();
        is_shown.then_some(at)
    }

    /// Returns the size of a pixel at a place, capture units.
    pub(crate) fn pixel_size(&self, position: Vec3) -> f32 {
        self.rows[2].dot(position.extend(1.0)) / self.focal
    }

    /// Returns the unit direction, in capture space, of the ray through a place of the picture.
    pub(crate) fn ray(&self, at: Vec2) -> Vec3 {
        let (ndc, p) = (at / self.size * 2.0 - 1.0, self.projection);
        let camera = Vec3::new((ndc.x - p.z) / p.x, (ndc.y - p.w) / p.y, 1.0);
        self.camera_to_world.transform_vector3(camera).normalize_or(Vec3::Z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Camera, RasterFov};
    use glam::UVec2;

    #[test]
    fn the_ray_of_a_pixel_leads_to_what_the_pixel_shows() {
        let eye = Vec3::new(-3.0, 2.0, 1.9);
        let view = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.9, UVec2::new(320, 240)).view(0.0, RasterFov::Corrected);
        let (lens, place) = (Pinhole::of(&view), Vec3::new(0.3, -0.2, 0.5));
        let at = lens.pixel_of(place).expect("the camera shows the place");
        let direction = (place - lens.origin).normalize();
        assert!(lens.ray(at).distance(direction) < 1e-5, "{} and {direction}", lens.ray(at));
        // A pixel further across.
        let across = view.world_to_camera.row(0).truncate() * lens.pixel_size(place);
        let beside = lens.pixel_of(place + across).expect("the camera shows the place");
        assert!((beside - at).distance(Vec2::X) < 1e-2, "the size of a pixel: {}", beside - at);
    }
}
