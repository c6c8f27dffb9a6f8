//! Decoding: from records and ranges back to Gaussians and colors.
//!
//! In: a [`PackedScene`]. Out: any one Gaussian or color, or all of them as [`Sliced`].

use super::lanes::{self, ALWAYS, AT_REST, BlockRanges, FARTHEST, LANE_MAX, LANES, SharedRanges};
use super::scene::{PackedColors, PackedScene};
use super::shape;
use crate::gaussian::{Gaussian, Lifespan};
use crate::scene::sliced::Sliced;
use glam::{Quat, Vec3};
use std::f32::consts::FRAC_1_SQRT_2;

impl PackedScene {
    /// Decodes one Gaussian.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn gaussian(&self, index: usize) -> Gaussian {
        let record = lanes::unpack(self.records[index]);
        let part = |lane: usize| part(&record, lane);
        let shared = SharedRanges::read(&self.ranges);
        let block = BlockRanges::read(&self.ranges, index);
        let mean = Vec3::from(block.mean_low) + parts(&record, lanes::MEAN) * Vec3::from(block.mean_size);
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
        let (scale, rotation) = self.shape(index);
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

    /// Decodes the opacity envelope of one Gaussian in time, and no other attribute.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn lifespan(&self, index: usize) -> Lifespan {
        lifespan(&lanes::unpack(self.records[index]), &SharedRanges::read(&self.ranges))
    }

    /// Decodes the scales of one Gaussian, and the rotation of its axes.
    pub(super) fn shape(&self, index: usize) -> (Vec3, Quat) {
        let record = lanes::unpack(self.records[index]);
        let shared = SharedRanges::read(&self.ranges);
        let [low, size] = shared.log_scale;
        let scale = (parts(&record, lanes::SCALE) * size + low).map(f32::exp);
        let three = (parts(&record, lanes::ROTATION) * shared.rotation_stretch * 2.0 - 1.0) * FRAC_1_SQRT_2;
        (scale, shape::with_largest(three, record[lanes::LEFT_OUT]))
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

/// Returns the position of a lane in its range, 0 to 1.
fn part(record: &[u16; LANES], lane: usize) -> f32 {
    f32::from(record[lane]) / LANE_MAX
}

/// Returns the positions of three lanes.
fn parts(record: &[u16; LANES], first: usize) -> Vec3 {
    Vec3::from([0, 1, 2].map(|axis| part(record, first + axis)))
}

/// Decodes the lanes of time.
fn lifespan(record: &[u16; LANES], shared: &SharedRanges) -> Lifespan {
    let ([t_low, t_size], [sigma_low, sigma_size]) = (shared.mean_t, shared.log_sigma_t);
    let sigma_t = match record[lanes::SIGMA_T] {
        ALWAYS => f32::INFINITY,
        _ => (sigma_low + part(record, lanes::SIGMA_T) * sigma_size).exp(),
    };
    Lifespan { mean_t: t_low + part(record, lanes::MEAN_T) * t_size, sigma_t }
}
