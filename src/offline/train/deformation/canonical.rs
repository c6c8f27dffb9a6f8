//! The Gaussians in canonical space, and their optimizer.
//!
//! In: raw parameters, gradients. Out: [`Canonical`]: the raw parameters after steps of Adam and relocations. Colors are trained on the GPU, by the pass
//! `adam`, since the deformation does not change them.

use crate::offline::fine_tune::adam::Step;
use crate::offline::fine_tune::relocation::relocate;
use crate::offline::layout::TrainedRecord;
use rayon::prelude::*;

/// Values of the raw parameters of a Gaussian.
const VALUES: usize = size_of::<TrainedRecord>() / 4;
/// Weights, in the loss, of the mean opacity and of the mean spatial scale.
const OPACITY_WEIGHT: f32 = 0.01;
const SCALE_WEIGHT: f32 = 0.01;

/// Raw parameters in canonical space with their moments.
#[derive(Debug)]
pub(super) struct Canonical {
    pub records: Vec<TrainedRecord>,
    moments: Vec<[[f32; VALUES]; 2]>,
}

impl Canonical {
    pub(super) fn new(records: Vec<TrainedRecord>) -> Self {
        Self { moments: vec![[[0.0; VALUES]; 2]; records.len()], records }
    }

    /// Makes step number `step`, from 1, with these rates, as [`Rates::of_parameters`](crate::offline::fine_tune::Rates) has them. Mean opacity
    /// and mean scale are terms of the loss; gradients that are not finite are left out.
    pub(super) fn step(&mut self, gradients: &[TrainedRecord], rates: [[f32; 4]; 5], step: usize) {
        let rates: [f32; VALUES] = bytemuck::cast(rates);
        let (count, step) = (self.records.len() as f32, Step::new(step));
        let each = |((record, moments), gradient): ((&mut TrainedRecord, &mut [[f32; VALUES]; 2]), &TrainedRecord)| {
            let mut gradient = *gradient;
            let opacity = 1.0 / (1.0 + (-record.opacity_logit[0]).exp());
            gradient.opacity_logit[0] += OPACITY_WEIGHT * opacity * (1.0 - opacity) / count;
            for (gradient, log_scale) in gradient.log_scale.iter_mut().zip(record.log_scale) {
                *gradient += SCALE_WEIGHT * log_scale.exp() / (3.0 * count);
            }
            let gradient: [f32; VALUES] = bytemuck::cast(gradient);
            let values: &mut [f32; VALUES] = bytemuck::cast_mut(record);
            let [first, second] = moments;
            for (at, value) in values.iter_mut().enumerate() {
                if rates[at] > 0.0 && gradient[at].is_finite() {
                    *value += rates[at] * step.change([&mut first[at], &mut second[at]], gradient[at]);
                }
            }
        };
        self.records.par_iter_mut().zip(&mut self.moments).zip(gradients).for_each(each);
    }

    /// Relocates the Gaussians that have faded. Returns the moves: where to, where from.
    pub(super) fn relocate(&mut self, seed: u64) -> Vec<[u32; 2]> {
        let moves = relocate(&mut self.records, seed);
        for index in moves.iter().flatten() {
            self.moments[*index as usize] = [[0.0; VALUES]; 2];
        }
        moves
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_follows_the_gradient_and_the_rates() {
        let start = TrainedRecord { opacity_logit: [2.0, 0.0, 0.0, 0.0], ..TrainedRecord::default() };
        let mut canonical = Canonical::new(vec![start; 3]);
        let mut gradients = vec![TrainedRecord::default(); 3];
        gradients[0].mean = [3.0, -0.5, 0.0];
        gradients[1].mean = [f32::NAN, 1.0, 1.0];
        canonical.step(&gradients, [[0.1; 4], [0.0; 4], [0.0; 4], [0.0; 4], [0.2, 0.0, 0.0, 0.0]], 1);
        let close = |found: [f32; 3], wanted: [f32; 3]| found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-5);
        let [first, second, third] = [0, 1, 2].map(|at| canonical.records[at]);
        assert!(close(first.mean, [-0.1, 0.1, 0.0]), "the first step is as long as the rate: {:?}", first.mean);
        assert!(close(second.mean, [0.0, -0.1, -0.1]), "what is not finite is left out: {:?}", second.mean);
        assert_eq!((third.mean, third.log_scale), ([0.0; 3], [0.0; 3]), "no gradient, or no rate: no change");
        assert!((third.opacity_logit[0] - 1.8).abs() < 1e-5, "opacity falls: {}", third.opacity_logit[0]);
    }
}
