//! Alpha: the opacity of a splat at a pixel, and the step that blends it.
//!
//! In: conic and opacity of a splat, the offset of a pixel from its center, the remaining transmittance of the pixel.
//! Out: its alpha, or the result of blending it ([`BlendStep`]), as the original rasterizer computes them. The CPU
//! reference of `shaders/shared/alpha.wgsl`; picking uses [`visible`] too.

use super::conic::exponent;
use glam::{Vec2, Vec3};

/// A splat whose alpha at a pixel is below this is skipped there.
pub const ALPHA_MIN: f32 = 1.0 / 255.0;
/// Alpha is clamped to this from above.
pub const ALPHA_MAX: f32 = 0.99;
/// Blending stops at a pixel before its transmittance would fall below this.
pub const TRANSMITTANCE_MIN: f32 = 1e-4;

/// The result of blending one splat over a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BlendStep {
    /// The splat is skipped: its alpha is too small.
    Skip,
    /// Blending stops: neither this splat nor a later one is blended.
    Stop,
    /// The splat is blended.
    Blend {
        /// Factor on the splat's color and depth: alpha times the transmittance before it.
        weight: f32,
        /// Transmittance after it.
        transmittance: f32,
    },
}

/// Blends one splat over a pixel with the remaining `transmittance`. The other arguments are those of [`alpha_at`].
pub fn blend_step(conic: Vec3, opacity: f32, offset: Vec2, transmittance: f32) -> BlendStep {
    let Some(alpha) = alpha_at(conic, opacity, offset) else { return BlendStep::Skip };
    let left = transmittance * (1.0 - alpha);
    if left < TRANSMITTANCE_MIN {
        return BlendStep::Stop;
    }
    BlendStep::Blend { weight: alpha * transmittance, transmittance: left }
}

/// Returns the alpha of a splat at a pixel; `None` if it is skipped. `conic` is the inverse covariance on the screen,
/// factored: `x (dx + y dy)² + z dy²`, `offset` the vector from the pixel to the splat's center, pixels.
pub fn alpha_at(conic: Vec3, opacity: f32, offset: Vec2) -> Option<f32> {
    visible(opacity * exponent(conic, offset).exp())
}

/// Returns alpha as it is blended, clamped from above to [`ALPHA_MAX`]; `None` below [`ALPHA_MIN`], where it is
/// skipped.
pub fn visible(alpha: f32) -> Option<f32> {
    let alpha = alpha.min(ALPHA_MAX);
    (alpha >= ALPHA_MIN).then_some(alpha)
}

/// Returns the largest squared Mahalanobis distance from its center at which a splat of this opacity is not skipped;
/// negative if the splat is always skipped.
///
/// `opacity · exp(−½ d²) ≥ 1/255` needs `d² ≤ 2 ln(255 opacity)`.
pub fn reach_squared(opacity: f32) -> f32 {
    2.0 * (opacity / ALPHA_MIN).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A round splat with a standard deviation of one pixel.
    const CONIC: Vec3 = Vec3::new(1.0, 0.0, 1.0);

    #[test]
    fn a_blend_step_skips_blends_or_stops() {
        let step = |opacity, offset, transmittance| blend_step(CONIC, opacity, offset, transmittance);
        assert_eq!(
            step(0.5, Vec2::ZERO, 0.5),
            BlendStep::Blend { weight: 0.25, transmittance: 0.25 },
            "half of the remaining transmittance is the weight"
        );
        assert_eq!(step(0.003, Vec2::ZERO, 1.0), BlendStep::Skip, "an alpha below 1/255 is skipped");
        assert_eq!(step(1.0, Vec2::new(0.0, 3.4), 1.0), BlendStep::Skip, "a splat too far away is skipped");
        assert_eq!(
            step(1.0, Vec2::ZERO, 0.005),
            BlendStep::Stop,
            "blending stops before the transmittance falls below 1e-4"
        );
    }

    #[test]
    fn a_splat_is_skipped_beyond_its_reach() {
        for opacity in [0.005, 0.1, 1.0] {
            let reach = reach_squared(opacity).sqrt();
            assert!(
                alpha_at(CONIC, opacity, Vec2::X * reach * 0.999).is_some(),
                "blended inside its reach, at opacity {opacity}"
            );
            assert_eq!(
                alpha_at(CONIC, opacity, Vec2::X * reach * 1.001),
                None,
                "skipped outside its reach, at opacity {opacity}"
            );
        }
        assert!(reach_squared(0.003) < 0.0, "a splat that is always skipped has a negative reach");
    }
}
