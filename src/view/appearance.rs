//! How captures are shown: background, blend space, debug views, and the opacity, light and crop of one placed capture.
//!
//! In: the settings of a view and of a placed capture; the trained color (sRGB-encoded) and the mean (capture space) of
//! a Gaussian. Out: whether the Gaussian is drawn, and its color in the blend space, as
//! `shaders/shared/appearance.wgsl` computes it.

use super::srgb::{decode, encode};
use super::thinning::Thinning;
use glam::{Affine3A, Vec3};

/// The space in which splats are blended. Default: [`Encoded`](Self::Encoded).
///
/// # Examples
///
/// ```
/// use bevy_gs4d::view::{Appearance, BlendSpace};
/// use glam::Vec3;
///
/// let (trained, appearance) = (Vec3::splat(0.5), Appearance::default());
/// assert_eq!(appearance.color(trained, BlendSpace::Encoded), trained, "blended as trained");
/// assert!(appearance.color(trained, BlendSpace::Linear).x < 0.25, "half of the encoded range is 21 % of the light");
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum BlendSpace {
    /// sRGB-encoded values: the space captures are trained in.
    #[default]
    Encoded,
    /// Linear light. Edges and haze are lighter than in training.
    Linear,
}

/// The quantity that a view shows of its captures. Default: [`Color`](Self::Color).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum DebugView {
    /// The colors of the captures.
    #[default]
    Color,
    /// Expected depth, near is bright: full brightness at depth 0, half of it at two units of the first capture.
    Depth,
    /// Number of splats blended at each pixel, from black (0) through blue, green and yellow to red (64 or more).
    Overdraw,
    /// Every Gaussian that is active in the temporal filter's current segment: green if it is visible at this time,
    /// else red.
    Active,
    /// The standard deviation in time `σ_t`: blue for an instant, red for the whole duration.
    Lifespan,
    /// The direction and speed of motion: gray for rest; red, green and blue for x, y and z of the capture.
    Velocity,
}

/// The background behind all Gaussians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Background {
    /// No background: the picture is premultiplied, for a compositor.
    None,
    /// One color, in the blend space.
    Color([f32; 3]),
    /// The capture's environment map.
    Environment,
}

/// How one placed capture is shown: opacity, light, crop, and which Gaussians are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Appearance {
    /// Factor on every opacity, from 0 to 1. Default: 1.
    pub opacity: f32,
    /// Factor on linear light, one for each channel. Default: 1.
    pub light: Vec3,
    /// Transforms capture space to a box from −1 to 1; Gaussians with means outside are not drawn. Default: `None`, no
    /// crop.
    pub crop: Option<Affine3A>,
    /// The Gaussians that are drawn. Default: all.
    pub thinning: Thinning,
}

impl Default for Appearance {
    fn default() -> Self {
        Self { opacity: 1.0, light: Vec3::ONE, crop: None, thinning: Thinning::default() }
    }
}

/// How the colors of Gaussians are changed before they are blended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lighting {
    /// Not changed: blended as trained.
    AsTrained,
    /// Multiplied by a factor on linear light, then sRGB-encoded again.
    Encoded,
    /// Multiplied by a factor on linear light and left linear.
    Linear,
}

impl Appearance {
    /// Returns how colors that are blended in `space` are changed.
    pub fn lighting(&self, space: BlendSpace) -> Lighting {
        match space {
            BlendSpace::Linear => Lighting::Linear,
            BlendSpace::Encoded if self.light == Vec3::ONE => Lighting::AsTrained,
            BlendSpace::Encoded => Lighting::Encoded,
        }
    }

    /// Returns a trained color (sRGB-encoded) with the light applied, in the blend space.
    pub fn color(&self, color: Vec3, space: BlendSpace) -> Vec3 {
        match self.lighting(space) {
            Lighting::AsTrained => color,
            Lighting::Encoded => encode(decode(color.max(Vec3::ZERO)) * self.light),
            Lighting::Linear => decode(color.max(Vec3::ZERO)) * self.light,
        }
    }

    /// Returns whether a Gaussian with this mean, in capture space, is inside the crop box, if there is one.
    pub fn shows(&self, mean: Vec3) -> bool {
        self.crop.is_none_or(|crop| crop.transform_point3(mean).abs().max_element() <= 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_appearance_keeps_colors_unchanged() {
        let color = Vec3::new(0.1, 0.7, 1.3);
        assert_eq!(Appearance::default().color(color, BlendSpace::Encoded), color, "the color is as trained");
        assert!(Appearance::default().shows(Vec3::splat(1e9)), "nothing is cropped");
    }

    #[test]
    fn light_is_a_factor_on_linear_light() {
        let appearance = Appearance { light: Vec3::new(2.0, 1.0, 0.0), ..Appearance::default() };
        let color = Vec3::splat(0.5);
        let linear = appearance.color(color, BlendSpace::Linear);
        assert!(linear.abs_diff_eq(decode(color) * appearance.light, 1e-6), "linear light is multiplied");
        assert!(
            decode(appearance.color(color, BlendSpace::Encoded)).abs_diff_eq(linear, 1e-5),
            "the encoded color decodes to the same light"
        );
        assert!(
            decode(encode(Vec3::new(0.001, 0.3, 4.0))).abs_diff_eq(Vec3::new(0.001, 0.3, 4.0), 1e-5),
            "decoding is the inverse of encoding"
        );
    }

    #[test]
    fn a_crop_box_keeps_the_means_inside() {
        // A box of half a unit in each direction around (1, 0, 0).
        let crop = Affine3A::from_scale(Vec3::splat(2.0)) * Affine3A::from_translation(-Vec3::X);
        let appearance = Appearance { crop: Some(crop), ..Appearance::default() };
        assert!(appearance.shows(Vec3::new(1.4, 0.4, -0.4)), "a mean inside the box is shown");
        assert!(!appearance.shows(Vec3::new(1.6, 0.0, 0.0)), "a mean outside the box is not shown");
        assert!(!appearance.shows(Vec3::NAN), "a mean that is not a number is not shown");
    }
}
