//! Adam; CPU reference of `shaders/offline/adam.wgsl`.
//!
//! In: a value, its gradient, its moments, a learning rate. Out: the value and the moments after a step (section 6 of
//! the 4DGS model; torch's equations).

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
}
