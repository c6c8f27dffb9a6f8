//! Adam; CPU reference of `shaders/offline/adam.wgsl`.
//!
//! In: a value, its gradient, its moments, a rate. Out: the value and the moments after a step (section 6 of the 4DGS model; torch's
//! equations).

/// Decay of the first moment and of the second.
pub const DECAY: [f64; 2] = [0.9, 0.999];
const EPSILON: f64 = 1e-15;

/// The moments of one value.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Moments {
    /// Of the gradient.
    pub first: f64,
    /// Of its square.
    pub second: f64,
}

/// Returns `1 / (1 − decay^step)` of the first moment, and the root of it of the second; the first step is 1.
pub fn correction(step: usize) -> [f32; 2] {
    let bias = DECAY.map(|decay| 1.0 - decay.powf(step as f64));
    [bias[0].recip() as f32, bias[1].sqrt().recip() as f32]
}

/// Makes one step. Returns the value after it.
pub fn adam(value: f64, gradient: f64, moments: &mut Moments, rate: f64, step: usize) -> f64 {
    moments.first = DECAY[0] * moments.first + (1.0 - DECAY[0]) * gradient;
    moments.second = DECAY[1] * moments.second + (1.0 - DECAY[1]) * gradient * gradient;
    let [first, second] = DECAY.map(|decay| 1.0 - decay.powf(step as f64));
    value - rate * (moments.first / first) / ((moments.second / second).sqrt() + EPSILON)
}

/// A step for values that are trained on the CPU, in the precision and by the expressions of the shader.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Step {
    correction: [f32; 2],
}

impl Step {
    /// Returns step number `step`, from 1.
    pub(crate) fn new(step: usize) -> Self {
        Self { correction: correction(step) }
    }

    /// Returns the change of a value for a rate of 1, and updates its moments.
    pub(crate) fn change(self, [first, second]: [&mut f32; 2], gradient: f32) -> f32 {
        let [of_first, of_second] = DECAY.map(|decay| decay as f32);
        *first = of_first * *first + (1.0 - of_first) * gradient;
        *second = of_second * *second + (1.0 - of_second) * gradient * gradient;
        -self.correction[0] * *first / (second.sqrt() * self.correction[1] + EPSILON as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_step_has_the_length_of_the_rate() {
        let mut moments = Moments::default();
        assert!((adam(1.0, 1e-5, &mut moments, 0.1, 1) - 0.9).abs() < 1e-9, "whatever the gradient");
        assert!((moments.first - 1e-6).abs() < 1e-18 && (moments.second - 1e-13).abs() < 1e-22, "{moments:?}");
        let still = adam(0.5, 0.0, &mut Moments::default(), 0.1, 1);
        assert_eq!(still, 0.5, "without a gradient nothing moves");
    }

    #[test]
    fn steps_in_the_precision_of_the_shader_are_the_same() {
        let (mut moments, mut own) = (Moments::default(), [0.0f32; 2]);
        let (mut wanted, mut found) = (1.0, 1.0f32);
        for step in 1..=200u16 {
            let gradient = (0.3 * f64::from(step)).sin();
            wanted = adam(wanted, gradient, &mut moments, 0.01, step.into());
            let [first, second] = &mut own;
            found += 0.01 * Step::new(step.into()).change([first, second], gradient as f32);
            assert!((f64::from(found) - wanted).abs() < 1e-4, "step {step}: {found} for {wanted}");
        }
    }
}
