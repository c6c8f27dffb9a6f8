//! Whether packed means are precise enough for the size of their Gaussians.
//!
//! In: a packed scene. Out: the share of its Gaussians whose mean may have a visible error.

use super::lanes::{self, BlockRanges, LANE_MAX};
use super::scene::PackedScene;
use glam::Vec3;
use rayon::prelude::*;

/// Error of a mean from which on it is visible, as a fraction of the size of the Gaussian.
const SEEN: f32 = 0.5;

impl PackedScene {
    /// Returns the share of the Gaussians, weighted by opacity, whose mean may have an error of more than half of their
    /// size, because other Gaussians of their block are far away. 0 if no Gaussian is visible.
    pub fn coarse_share(&self) -> f64 {
        let of_one = |index| {
            let opacity = f64::from(self.gaussian(index).opacity);
            [if self.is_coarse(index) { opacity } else { 0.0 }, opacity]
        };
        let each: Vec<[f64; 2]> = (0..self.len()).into_par_iter().map(of_one).collect();
        let sum = |[coarse, all]: [f64; 2], [own, opacity]: [f64; 2]| [coarse + own, all + opacity];
        let [coarse, all] = each.into_iter().fold([0.0; 2], sum);
        if all > 0.0 { coarse / all } else { 0.0 }
    }

    fn is_coarse(&self, index: usize) -> bool {
        // The low bits of lanes with fewer bits are 0. In one record with all bits they may be 0 by chance, but rarely
        // in two. A mean whose lanes are all 0 is the corner of the box, which is exact.
        let bits = self.bits_of_mean(index) | self.bits_of_mean(index ^ 1);
        let step = if bits == 0 { 0.0 } else { f32::from(1u16 << bits.trailing_zeros()) / LANE_MAX };
        let error = 0.5 * step * Vec3::from(BlockRanges::read(&self.ranges, index).mean_size).length();
        error > SEEN * self.shape(index).0.length()
    }

    /// Returns the bits that are 1 in any lane of a mean; 0 beyond the last Gaussian.
    fn bits_of_mean(&self, index: usize) -> u16 {
        let Some(&record) = self.records.get(index) else { return 0 };
        let own = lanes::unpack(record);
        own[lanes::MEAN] | own[lanes::MEAN + 1] | own[lanes::MEAN + 2]
    }
}

#[cfg(test)]
mod tests {
    use super::super::encode::Bits;
    use super::super::scene::PackedColors;
    use super::*;
    use crate::gaussian::{Gaussian, Harmonics};
    use bytemuck::Zeroable;

    /// Returns the coarse share of 256 Gaussians of the size 0.02 √3 in a box of this length, packed with `mean` bits
    /// per mean.
    fn coarse_share(length: f32, mean: u32) -> f64 {
        let gaussian = |index: u16| {
            let place = |factor: u16| f32::from(index * factor % 257) / 256.0 * length;
            let covariance = [4e-4, 0.0, 0.0, 4e-4, 0.0, 4e-4];
            let sigma_t = f32::INFINITY;
            let [x, y, z] = [1, 37, 91].map(place);
            Gaussian { mean: [x, y, z], covariance, opacity: 0.9, sigma_t, ..Zeroable::zeroed() }
        };
        let gaussians: Vec<Gaussian> = (0..256).map(gaussian).collect();
        let bits = Bits { mean, ..Bits::default() };
        PackedScene::encode(&gaussians, &bits, PackedColors::Whole(Harmonics::default()), [0.0; 2], 1.0).coarse_share()
    }

    #[test]
    fn steps_larger_than_gaussians_are_found() {
        for (length, bits, is_coarse, steps) in [
            (2.0, 11, false, "0.001"),
            (2.0, 5, true, "0.06"),
            (500.0, 11, false, "0.008: a block that is too large for the usual bits has 16"),
            (1e5, 11, true, "1.5"),
        ] {
            let share = coarse_share(length, bits);
            let is_right = if is_coarse { share > 0.9 } else { share < 0.01 };
            assert!(is_right, "steps of {steps} in a box of {length}: a share of {share}");
        }
    }
}
