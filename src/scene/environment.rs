//! The environment map: the background of a capture, on a sphere of radius 60 around its origin.
//!
//! In: a lat-long texture from slot 17 of a checkpoint, a camera position and a ray. Out: the color behind that pixel,
//! as the original computes it.

use crate::gaussian::harmonics::BRIGHTEST;
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::{PI, TAU};

/// A lat-long texture of raw, unclamped RGB in the capture's blend space.
#[derive(Debug, Clone, PartialEq)]
pub struct Environment {
    /// Texels across.
    pub width: u32,
    /// Texels down.
    pub height: u32,
    /// Values, planar: 3 × height × width.
    pub texels: Vec<f32>,
}

impl Environment {
    /// Radius of the sphere that the texture is on, capture units.
    pub(crate) const RADIUS: f32 = 60.0;

    /// Returns the color where the ray from `origin` along the unit vector `direction` (capture space) leaves the
    /// sphere. Bilinear, black outside the texture: the seam at the ends of `u` fades, as in the original.
    ///
    /// # Panics
    /// If there are fewer than 3 × height × width values.
    pub fn sample(&self, origin: Vec3, direction: Vec3) -> Vec3 {
        self.weights(origin, direction).map(|(texel, weight)| weight * self.texel(texel)).sum()
    }

    /// Returns the texels that [`sample`](Self::sample) combines, by index in a plane, and their weights.
    pub(crate) fn weights(&self, origin: Vec3, direction: Vec3) -> impl Iterator<Item = (usize, f32)> {
        let along = origin.dot(direction);
        // Rays from outside may miss the sphere: then the point of the ray nearest to it is used.
        let reach = -along + (along * along - (origin.length_squared() - Self::RADIUS.powi(2))).max(0.0).sqrt();
        let hit = origin + direction * reach;
        let u = hit.y.atan2(hit.x) / TAU + 0.5;
        let v = (hit.z / Self::RADIUS).clamp(-1.0, 1.0).acos() / PI;
        let [width, height] = [self.width, self.height].map(|side| side as f32);
        let across = self.width as usize;
        let (x, y) = (u * width - 0.5, v * height - 0.5);
        let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
        let texels = corners.map(|(i, j)| (x.floor() + i, y.floor() + j)).into_iter();
        let inside = texels.filter(move |&(i, j)| i >= 0.0 && j >= 0.0 && i < width && j < height);
        inside.map(move |(i, j)| {
            let weight = (1.0 - (x - i).abs()) * (1.0 - (y - j).abs());
            (j as usize * across + i as usize, weight)
        })
    }

    /// Checks that there is a finite value for each channel of each texel.
    ///
    /// # Errors
    /// A description of the problem.
    pub fn check(&self) -> Result<(), &'static str> {
        let texels = self.width.checked_mul(self.height).filter(|&texels| texels > 0);
        if texels.and_then(|texels| (texels as usize).checked_mul(3)) != Some(self.texels.len()) {
            return Err("its environment map has no texels, or not three values for each");
        }
        if !self.texels.par_iter().all(|value| value.is_finite()) {
            return Err("its environment map has a value that is not finite");
        }
        Ok(())
    }

    fn texel(&self, index: usize) -> Vec3 {
        let plane = (self.width * self.height) as usize;
        let color = Vec3::from([0, 1, 2].map(|channel| self.texels[channel * plane + index]));
        color.clamp(Vec3::splat(-BRIGHTEST), Vec3::splat(BRIGHTEST))
    }
}
