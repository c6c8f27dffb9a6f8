//! Where a capture is: a box about its Gaussians over a stretch of time.
//!
//! In: runtime Gaussians. Out: [`Bounds`] in capture space.

use crate::gaussian::Gaussian;
use glam::Vec3;

/// An axis-aligned box in capture space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
}

impl Bounds {
    /// The box that holds three standard deviations of every Gaussian wherever it is drawn within `interval`; nothing for an
    /// empty scene.
    pub fn of(gaussians: impl Iterator<Item = Gaussian>, interval: [f32; 2]) -> Option<Self> {
        // The marginal falls to its cut-off of 0.05 at sqrt(−2 ln 0.05) = 2.4477 σ_t.
        const LIFESPAN: f32 = 2.4478;
        let mut bounds: Option<Self> = None;
        for gaussian in gaussians {
            let lifespan = LIFESPAN * gaussian.sigma_t;
            let first = interval[0].max(gaussian.mean_t - lifespan);
            let last = interval[1].min(gaussian.mean_t + lifespan);
            if first > last {
                continue;
            }
            let [xx, _, _, yy, _, zz] = gaussian.covariance;
            let reach = 3.0 * Vec3::new(xx, yy, zz).max(Vec3::ZERO).map(f32::sqrt);
            for end in [gaussian.mean_at(first), gaussian.mean_at(last)] {
                let grown = Self { min: end - reach, max: end + reach };
                bounds = Some(bounds.map_or(grown, |b| b.union(grown)));
            }
        }
        bounds
    }

    /// The box about the middle nine tenths of the means, each at its own temporal mean, along each axis: where to look, without
    /// stray Gaussians.
    pub fn core(gaussians: impl Iterator<Item = Gaussian>) -> Option<Self> {
        let means: Vec<[f32; 3]> = gaussians.map(|gaussian| gaussian.mean).collect();
        if means.is_empty() {
            return None;
        }
        let (mut min, mut max) = (Vec3::ZERO, Vec3::ZERO);
        for axis in 0..3 {
            let mut values: Vec<f32> = means.iter().map(|mean| mean[axis]).collect();
            values.sort_unstable_by(f32::total_cmp);
            min[axis] = values[values.len() / 20];
            max[axis] = values[values.len() - 1 - values.len() / 20];
        }
        Some(Self { min, max })
    }

    /// The box about both.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Its centre.
    pub fn center(self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Half its diagonal.
    pub fn radius(self) -> f32 {
        (self.max - self.min).length() * 0.5
    }
}
