//! How the gradient of a splat is summed over the tiles that it covers.
//!
//! In: a choice, a renderer. Out: the shader definitions of `blend_backward` and `project_backward`; an error if the device cannot do it.

use super::trainer_error::TrainerError;
use crate::offline::shaders::ATOMIC_SUMS;
use crate::renderer::Headless;

/// How the gradient of a splat is summed over the tiles that it covers. Default: [`Deterministic`](Self::Deterministic).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum GradientSums {
    /// In a fixed order, from a place for each tile: every run gives the same result, to the bit.
    #[default]
    Deterministic,
    /// By atomic additions in whatever order: results differ by rounding from run to run. Needs the feature `SHADER_FLOAT32_ATOMIC`.
    Atomic,
}

impl GradientSums {
    /// Both with their names.
    pub const NAMES: [(&'static str, Self); 2] = [("deterministic", Self::Deterministic), ("atomic", Self::Atomic)];

    /// Checks that a device can sum in this way.
    ///
    /// # Errors
    /// [`TrainerError::NoAtomics`].
    pub fn check(self, headless: &Headless) -> Result<(), TrainerError> {
        let context = headless.context();
        self.check_features(context.device.features(), &context.info.name)
    }

    fn check_features(self, features: wgpu::Features, adapter: &str) -> Result<(), TrainerError> {
        if self == Self::Atomic && !features.contains(wgpu::Features::SHADER_FLOAT32_ATOMIC) {
            return Err(TrainerError::NoAtomics { adapter: adapter.to_owned() });
        }
        Ok(())
    }

    /// Returns the shader definitions.
    pub(super) fn definitions(self) -> &'static [&'static str] {
        match self {
            Self::Deterministic => &[],
            Self::Atomic => ATOMIC_SUMS,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn atomic_sums_need_float_atomics() {
        let without = wgpu::Features::empty();
        GradientSums::Deterministic.check_features(without, "Card").expect("every adapter can do it");
        let refused = GradientSums::Atomic.check_features(without, "Card").expect_err("it has none").to_string();
        assert!(refused.contains("Card") && refused.contains("--sums deterministic"), "adapter and remedy: {refused}");
        let with = wgpu::Features::SHADER_FLOAT32_ATOMIC;
        GradientSums::Atomic.check_features(with, "Card").expect("it has them");
    }
}
