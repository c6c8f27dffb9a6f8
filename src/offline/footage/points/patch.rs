//! The correlation of two pictures where a plane shows in both.
//!
//! In: gray pictures with their projections, a pixel of one and a depth. Out: the zero-mean normalized correlation (-1
//! to 1) of the pixels around it with those of the other picture, as a plane at this depth that faces the first camera
//! shows them.

use super::projection::Projection;
use crate::view::Camera;
use glam::{UVec2, Vec2};
use image::{Rgb, RgbImage};

/// Pixels on each side of the middle of a patch.
const HALF: i32 = 3;
/// Number of pixels of a patch.
const PIXELS: usize = 49;
/// Standard deviation below which a patch has no structure, 0 to 255.
const FLAT: f32 = 2.0;

/// A gray picture.
pub(crate) struct GrayView {
    /// Its camera.
    pub projection: Projection,
    /// 0 to 255.
    values: Vec<f32>,
}

/// A patch of mean 0 and standard deviation 1.
pub(crate) struct Patch([f32; PIXELS]);

impl GrayView {
    /// Returns the gray picture; `None` if it does not have the size of the camera's pictures.
    pub(crate) fn new(camera: &Camera, picture: &RgbImage) -> Option<Self> {
        let has_size = [picture.width(), picture.height()] == camera.size.to_array();
        let gray = |pixel: &Rgb<u8>| pixel.0.map(f32::from).iter().sum::<f32>() / 3.0;
        has_size.then(|| Self { projection: Projection::of(camera), values: picture.pixels().map(gray).collect() })
    }

    /// Returns the value at a place of the picture, bilinear; `None` at its border and outside.
    fn value(&self, at: Vec2) -> Option<f32> {
        let size = self.projection.size;
        let at = at - 0.5;
        if !(at.cmpge(Vec2::ZERO).all() && at.cmplt(size.saturating_sub(UVec2::ONE).as_vec2()).all()) {
            return None;
        }
        let pixel = at.as_uvec2();
        let share = at - pixel.as_vec2();
        let first = pixel.y as usize * size.x as usize + pixel.x as usize;
        let second = first + size.x as usize;
        let row = |index: usize| self.values[index] + (self.values[index + 1] - self.values[index]) * share.x;
        let (above, below) = (row(first), row(second));
        Some(above + (below - above) * share.y)
    }

    /// Returns the patch whose middle is `at`, with these steps between pixels across and down; `None` if a part is
    /// outside the picture, or it has no structure.
    fn sampled(&self, at: Vec2, [across, down]: [Vec2; 2]) -> Option<Patch> {
        let mut values = [0.0; PIXELS];
        let offsets = (-HALF..=HALF).flat_map(|y| (-HALF..=HALF).map(move |x| (x as f32, y as f32)));
        for (value, (x, y)) in values.iter_mut().zip(offsets) {
            *value = self.value(at + across * x + down * y)?;
        }
        let mean = values.iter().sum::<f32>() / PIXELS as f32;
        values.iter_mut().for_each(|value| *value -= mean);
        let deviation = (values.iter().map(|value| value * value).sum::<f32>() / PIXELS as f32).sqrt();
        (deviation >= FLAT).then(|| Patch(values.map(|value| value / deviation)))
    }

    /// Returns the patch around a place of the picture; `None` if a part is outside, or it has no structure.
    pub(crate) fn patch(&self, at: Vec2) -> Option<Patch> {
        self.sampled(at, [Vec2::X, Vec2::Y])
    }

    /// Returns the correlation of a patch around `at` with what `other` shows of it at a depth (camera units); `None`
    /// if `other` does not show all of it, or it has no structure there.
    pub(crate) fn correlation(&self, patch: &Patch, at: Vec2, depth: f32, other: &Self) -> Option<f32> {
        let reach = HALF as f32;
        let shown = |offset: Vec2| Some(other.projection.pixel(self.projection.place(at + offset, depth))?.0);
        let middle = shown(Vec2::ZERO)?;
        let steps = [(shown(Vec2::X * reach)? - middle) / reach, (shown(Vec2::Y * reach)? - middle) / reach];
        let found = other.sampled(middle, steps)?;
        Some(patch.0.iter().zip(&found.0).map(|(a, b)| a * b).sum::<f32>() / PIXELS as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::RasterFov;
    use glam::Vec3;

    /// Returns what a camera shows of a patterned plane at z = 0.
    fn view(eye: Vec3) -> GrayView {
        let camera = Camera::look_at(eye, Vec3::ZERO, Vec3::Y, 0.8, UVec2::splat(100));
        let view = camera.view(0.0, RasterFov::Corrected);
        let picture = RgbImage::from_fn(100, 100, |x, y| {
            let ray = view.ray(x, y);
            let at = eye - ray * (eye.z / ray.z);
            Rgb([(128.0 + 60.0 * (at.x * 22.0).sin() + 50.0 * (at.y * 18.0 + at.x * 7.0).sin()) as u8; 3])
        });
        GrayView::new(&camera, &picture).expect("the size of the camera's pictures")
    }

    #[test]
    fn a_plane_correlates_at_its_depth() {
        let (first, second) = (view(Vec3::new(0.0, 0.0, 4.0)), view(Vec3::new(0.8, 0.2, 4.0)));
        let at = Vec2::new(45.5, 55.5);
        let patch = first.patch(at).expect("the plane has a pattern");
        let right = first.correlation(&patch, at, 4.0, &second).expect("both show it");
        let wrong = first.correlation(&patch, at, 3.3, &second).expect("both show it");
        assert!(right > 0.95 && wrong < 0.8, "at its depth {right}, elsewhere {wrong}");
        assert!(first.patch(Vec2::new(2.0, 50.0)).is_none(), "a part is outside the picture");
    }
}
