//! The size of a Gaussian on a GPU.
//!
//! In: a scene of any form, also one without Gaussians. Out: the bytes of each of its Gaussians in the buffers of the
//! renderer, which does not need to be there. The buffers are made in `src/renderer/capture/buffers.rs`; a test of
//! `tests/gpu/render.rs` uploads scenes of each form and compares.

use super::filter::{ActiveSets, TemporalFilter};
use super::form::{Form, SceneForm};
use super::gaussian_scene::GaussianScene;
use super::packed::{BLOCK, BLOCK_RANGES, COLOR_WORDS, PackedColors, RECORD_WORDS};
use crate::gaussian::harmonics::evaluated;
use crate::gaussian::{Gaussian, Harmonics};

/// Bytes of a number or a word.
const NUMBER: usize = 4;
/// Bytes of two numbers.
const PAIR: usize = 2 * NUMBER;
/// Bytes of four numbers.
const VECTOR: usize = 4 * NUMBER;

impl GaussianScene {
    /// Returns the bytes of each of its Gaussians on a GPU, rounded up: geometry, color, part of the temporal filter and
    /// place in the list of active Gaussians. Without what all Gaussians share: codebooks, environment map. A scene in
    /// the trained form is drawn sliced.
    pub fn gaussian_bytes(&self) -> u32 {
        let geometry = match &self.form {
            // A copy of the lifespan is beside each Gaussian.
            SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_)) => size_of::<Gaussian>() + PAIR,
            SceneForm::Ready(Form::Packed(_)) => NUMBER * RECORD_WORDS + (VECTOR * BLOCK_RANGES).div_ceil(BLOCK),
        };
        let color = match &self.form {
            SceneForm::Trained(trained) => whole(&trained.harmonics),
            SceneForm::Ready(Form::Sliced(sliced)) => whole(&sliced.harmonics),
            SceneForm::Ready(Form::Packed(packed)) => match &packed.colors {
                PackedColors::Whole(harmonics) => whole(harmonics),
                PackedColors::Coded(_) => NUMBER * COLOR_WORDS,
            },
        };
        (geometry + color + self.filter.as_ref().map_or(0, active)) as u32
    }
}

/// Returns the bytes of the coefficients of a Gaussian that are evaluated, in whole four-vectors.
fn whole(harmonics: &Harmonics) -> usize {
    (evaluated(harmonics.degree, harmonics.degree_t) * 3).div_ceil(4) * VECTOR
}

/// Returns the bytes of a Gaussian in a filter and in the list of active Gaussians.
fn active(filter: &TemporalFilter) -> usize {
    let sets = match filter.sets {
        ActiveSets::Bits(_) => (filter.segments as usize).div_ceil(8),
        ActiveSets::Intervals(_) => NUMBER,
    };
    sets + NUMBER
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::FilterKind;
    use crate::scene::synth::{SynthSettings, synthesize};

    #[test]
    fn the_size_does_not_depend_on_the_number_of_gaussians() {
        let scene = |count, degree| synthesize(&SynthSettings { count, degree, ..SynthSettings::default() });
        assert_eq!(scene(0, 0).gaussian_bytes(), 64 + 8 + 16, "three values of color are one four-vector");
        assert_eq!(scene(100, 0).gaussian_bytes(), scene(0, 0).gaussian_bytes(), "of a hundred as of none");
        assert_eq!(scene(0, 2).gaussian_bytes(), 64 + 8 + 7 * 16, "27 values of color are seven four-vectors");
        let sliced = GaussianScene::from(scene(9, 2).into_runtime().expect("it can be drawn"));
        assert_eq!(sliced.gaussian_bytes(), scene(0, 2).gaussian_bytes(), "the trained form is drawn sliced");
        let filtered = |segments, sets| GaussianScene {
            filter: Some(TemporalFilter { kind: FilterKind::Support, segments, count: 0, sets }),
            ..scene(0, 0)
        };
        let intervals = filtered(40, ActiveSets::Intervals(Vec::new())).gaussian_bytes();
        assert_eq!(intervals, 88 + 4 + 4, "an interval, and a place in the list");
        assert_eq!(filtered(9, ActiveSets::Bits(Vec::new())).gaussian_bytes(), 88 + 2 + 4, "nine bits, rounded up");
    }
}
