//! Decoding: from records and ranges back to Gaussians and colors.
//!
//! In: a [`PackedScene`]. Out: any one Gaussian or color, or all of them as [`Sliced`].

use super::lanes::{self, ALWAYS, AT_REST, BlockRanges, FARTHEST, LANE_MAX, LANES, SharedRanges};
use super::{PackedColors, PackedScene, shape};
use crate::gaussian::{Gaussian, Lifespan};
use crate::scene::Sliced;
use glam::Vec3;
use std::f32::consts::FRAC_1_SQRT_2;

impl PackedScene {
    /// Decodes one Gaussian.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn gaussian(&self, index: usize) -> Gaussian {
        let record = lanes::unpack(self.records[index]);
        let part = |lane: usize| f32::from(record[lane]) / LANE_MAX;
        let parts = |lane| Vec3::new(part(lane), part(lane + 1), part(lane + 2));
        let shared = SharedRanges::read(&self.ranges);
        let block = BlockRanges::read(&self.ranges, index);
        let mean = Vec3::from(block.mean_low) + parts(lanes::MEAN) * Vec3::from(block.mean_size);
        let Lifespan { mean_t, sigma_t } = lifespan(&record, &shared);
        let velocity = match record[lanes::SIGMA_T] {
            ALWAYS => Vec3::ZERO,
            _ => {
                let signed = Vec3::from([0, 1, 2].map(|axis| {
                    let place = f32::from(record[lanes::DISPLACEMENT + axis]);
                    (place - AT_REST) / FARTHEST
                }));
                signed * signed.abs() * block.displacement * sigma_t.recip().max(block.rate)
            }
        };
        let [scale_low, scale_size] = shared.log_scale;
        let scale = (parts(lanes::SCALE) * scale_size + scale_low).map(f32::exp);
        let three = (parts(lanes::ROTATION) * shared.rotation_stretch * 2.0 - 1.0) * FRAC_1_SQRT_2;
        let rotation = shape::with_largest(three, record[lanes::LEFT_OUT]);
        Gaussian {
            mean: mean.to_array(),
            mean_t,
            velocity: velocity.to_array(),
            sigma_t,
            covariance: shape::covariance(scale, rotation),
            opacity: (part(lanes::OPACITY) * shared.opacity_stretch).clamp(0.0, 1.0),
            padding: 0.0,
        }
    }

    /// Decodes when one Gaussian is there, and nothing else of it.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn lifespan(&self, index: usize) -> Lifespan {
        lifespan(&lanes::unpack(self.records[index]), &SharedRanges::read(&self.ranges))
    }

    /// Returns the color of one Gaussian; see [`Harmonics::color`](crate::gaussian::Harmonics::color).
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn color(&self, index: usize, direction: Vec3, tau: f32, time_span: f32) -> Vec3 {
        match &self.colors {
            PackedColors::Whole(harmonics) => harmonics.color(index, direction, tau, time_span),
            PackedColors::Coded(colors) => {
                let base = SharedRanges::read(&self.ranges).base;
                colors.color(index, base, direction, tau, time_span)
            }
        }
    }

    /// Decodes every Gaussian and every coefficient.
    pub fn unpack(self) -> Sliced {
        let gaussians = (0..self.len()).map(|index| self.gaussian(index)).collect();
        let harmonics = match self.colors {
            PackedColors::Whole(harmonics) => harmonics,
            PackedColors::Coded(colors) => colors.harmonics(SharedRanges::read(&self.ranges).base),
        };
        Sliced { gaussians, harmonics }
    }
}

/// Decodes the lanes of time.
fn lifespan(record: &[u16; LANES], shared: &SharedRanges) -> Lifespan {
    let part = |lane: usize| f32::from(record[lane]) / LANE_MAX;
    let ([t_low, t_size], [sigma_low, sigma_size]) = (shared.mean_t, shared.log_sigma_t);
    let sigma_t = match record[lanes::SIGMA_T] {
        ALWAYS => f32::INFINITY,
        _ => (sigma_low + part(lanes::SIGMA_T) * sigma_size).exp(),
    };
    Lifespan { mean_t: t_low + part(lanes::MEAN_T) * t_size, sigma_t }
}
