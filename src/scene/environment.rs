//! The environment map: the background of a capture, on a sphere of radius 60 around its origin.
//!
//! In: a lat-long texture from slot 17 of a checkpoint, a camera position and a ray. Out: the color behind that pixel,
//! as the original computes it.

use crate::gaussian::harmonics::BRIGHTEST;
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::{PI, TAU};

/// Radius of the sphere, capture units.
pub(super) const RADIUS: f32 = 60.0;

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
    /// Returns the color where the ray from `origin` along the unit vector `direction` (capture space) leaves the
    /// sphere. Bilinear, black outside the texture: the seam at the ends of `u` fades, as in the original.
    ///
    /// # Panics
    /// If there are fewer than 3 × height × width values.
    pub fn sample(&self, origin: Vec3, direction: Vec3) -> Vec3 {
        let along = origin.dot(direction);
        // Rays from outside may miss the sphere: then the point of the ray nearest to it is used.
        let reach = -along + (along * along - (origin.length_squared() - RADIUS * RADIUS)).max(0.0).sqrt();
        let hit = origin + direction * reach;
        let u = hit.y.atan2(hit.x) / TAU + 0.5;
        let v = (hit.z / RADIUS).clamp(-1.0, 1.0).acos() / PI;
        let (x, y) = (u * self.width as f32 - 0.5, v * self.height as f32 - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let mut color = Vec3::ZERO;
        for (i, j) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let weight = (1.0 - (x - (x0 + i)).abs()) * (1.0 - (y - (y0 + j)).abs());
            color += weight * self.texel(x0 + i, y0 + j);
        }
        color
    }

    /// Checks that there is a finite value for each channel of each texel.
    ///
    /// # Errors
    /// A description of the problem.
    pub fn check(&self) -> Result<(), &'static str> {
        let texels = self.width.checked_mul(self.height).filter(|&texels| texels > 0);
        if texels.and_then(|texels| (texels as usize).checked_mul(3)) != Some(self.texels.len()) {
            return Err("its environment map has another number of texels");
        }
        if !self.texels.par_iter().all(|value| value.is_finite()) {
            return Err("its environment map has a value that is not finite");
        }
        Ok(())
    }

    fn texel(&self, x: f32, y: f32) -> Vec3 {
        if x < 0.0 || y < 0.0 || x >= self.width as f32 || y >= self.height as f32 {
            return Vec3::ZERO;
        }
        let plane = (self.width * self.height) as usize;
        let at = y as usize * self.width as usize + x as usize;
        let color = Vec3::new(self.texels[at], self.texels[plane + at], self.texels[2 * plane + at]);
        color.clamp(Vec3::splat(-BRIGHTEST), Vec3::splat(BRIGHTEST))
    }
}
