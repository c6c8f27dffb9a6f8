//! The sums of one Gaussian over views, from which every score derives.
//!
//! In: the contribution of the Gaussian to the views of one time, to each view, or the sums of another shard. Out: the
//! sums, a score, their bytes.

use super::Variant;
use super::total::Total;

/// The sums of one Gaussian. Default: of no views.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Sums {
    pub(super) spatial: Total,
    temporal: Total,
    full: Total,
    first_derivative: Total,
    sigma: Total,
    squares: Total,
    peak: f64,
    full_squares: Total,
    full_peak: f64,
    energy: Total,
    removal: Total,
}

/// Number of values of [`Sums::to_bytes`].
const VALUES: usize = 20;
/// Bytes of the sums of a Gaussian.
pub(super) const BYTES: usize = VALUES * size_of::<f64>();

impl Sums {
    /// Adds the views of one time: their number, and the sum of the contributions of the Gaussian to these views.
    pub(super) fn add_time(
        &mut self,
        time: f64,
        views: f64,
        [mean, variance]: [f64; 2],
        volume: f64,
        contribution: f64,
    ) {
        let distance = time - mean;
        let marginal = (-0.5 * distance * distance / variance).exp();
        let first = -distance / variance * marginal;
        let second = (distance / variance * (distance / variance) - variance.recip()) * marginal;
        let steadiness = |derivative: f64| (0.5 * derivative.abs().tanh() + 0.5).recip();
        let weight = steadiness(second) * volume;
        let full = weight * contribution;
        self.spatial.add(contribution);
        self.temporal.add(views * weight);
        self.full.add(full);
        self.first_derivative.add(steadiness(first) * volume * contribution);
        self.sigma.add(variance * volume * contribution);
        self.squares.add(contribution * contribution);
        self.peak = self.peak.max(contribution);
        self.full_squares.add(full * full);
        self.full_peak = self.full_peak.max(full);
    }

    /// Adds a view: the squared contributions, and the squared change of the picture if the Gaussian were removed.
    pub(super) fn add_view(&mut self, energy: f64, removal: f64) {
        self.energy.add(energy);
        self.removal.add(removal);
    }

    /// Adds the sums over other views. The views of one time must all be in one of both.
    pub(super) fn merge(&mut self, other: &Self) {
        self.spatial.merge(other.spatial);
        self.temporal.merge(other.temporal);
        self.full.merge(other.full);
        self.first_derivative.merge(other.first_derivative);
        self.sigma.merge(other.sigma);
        self.squares.merge(other.squares);
        self.peak = self.peak.max(other.peak);
        self.full_squares.merge(other.full_squares);
        self.full_peak = self.full_peak.max(other.full_peak);
        self.energy.merge(other.energy);
        self.removal.merge(other.removal);
    }

    /// Returns a score.
    pub(super) fn value(&self, variant: Variant) -> f64 {
        match variant {
            Variant::Spatial => self.spatial.value(),
            Variant::Temporal => self.temporal.value(),
            Variant::Full => self.full.value(),
            Variant::FirstDerivative => self.first_derivative.value(),
            Variant::Sigma => self.sigma.value(),
            Variant::Norm2 => self.squares.value().sqrt(),
            Variant::Peak => self.peak,
            Variant::FullNorm2 => self.full_squares.value().sqrt(),
            Variant::FullPeak => self.full_peak,
            Variant::Energy => self.energy.value().sqrt(),
            Variant::Removal => self.removal.value().sqrt(),
            Variant::EnergyRemoval => (self.energy.value().sqrt() * self.removal.value().sqrt()).sqrt(),
        }
    }

    /// Returns the little-endian bytes of all values.
    pub(super) fn to_bytes(self) -> [u8; BYTES] {
        let Self { spatial, temporal, full, first_derivative, sigma, squares, peak, full_squares, full_peak, .. } =
            self;
        let totals =
            [spatial, temporal, full, first_derivative, sigma, squares, full_squares, self.energy, self.removal];
        let values = totals.into_iter().flat_map(Total::parts).chain([peak, full_peak]);
        let mut bytes = [0; BYTES];
        for (place, value) in bytes.as_chunks_mut::<8>().0.iter_mut().zip(values) {
            *place = value.to_le_bytes();
        }
        bytes
    }

    /// Returns the sums of [`to_bytes`](Self::to_bytes).
    pub(super) fn of_bytes(bytes: &[u8; BYTES]) -> Self {
        let mut values = bytes.as_chunks::<8>().0.iter().map(|&eight| f64::from_le_bytes(eight));
        let mut next = || values.next().unwrap_or_default();
        let mut total = || Total::of_parts([next(), next()]);
        let (spatial, temporal, full, first_derivative) = (total(), total(), total(), total());
        let (sigma, squares, full_squares, energy, removal) = (total(), total(), total(), total(), total());
        let (peak, full_peak) = (next(), next());
        Self {
            spatial,
            temporal,
            full,
            first_derivative,
            sigma,
            squares,
            peak,
            full_squares,
            full_peak,
            energy,
            removal,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the sums over the views of these times.
    fn over(times: &[u32]) -> Sums {
        let mut sums = Sums::default();
        for &time in times {
            let value = f64::from(time);
            sums.add_view(value.sin().abs(), value.cos().abs() * 1e-3);
            sums.add_time(value, 3.0, [0.3, 0.7], 1.1, (value * 7.3).sin().abs() * 1e5);
        }
        sums
    }

    #[test]
    fn merged_sums_are_those_of_all_views() {
        let (whole, mut merged) = (over(&[0, 1, 2, 3, 4, 5]), over(&[0, 1]));
        merged.merge(&over(&[]));
        merged.merge(&over(&[2, 3, 4, 5]));
        for variant in Variant::ALL {
            assert_eq!(merged.value(variant).to_bits(), whole.value(variant).to_bits(), "{variant}");
            assert!(whole.value(variant) > 0.0, "{variant} is not trivial");
        }
    }

    #[test]
    fn sums_are_read_as_they_were_written() {
        let sums = over(&[1, 2, 3]);
        assert_eq!(Sums::of_bytes(&sums.to_bytes()), sums, "every value");
    }
}
