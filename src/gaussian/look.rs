//! How a placed capture looks: opacity, light, crop.
//!
//! In: the colour and the place of a Gaussian. Out: what is drawn of it. Laid beside `shaders/shared/look.wgsl`.

use crate::frame::BlendSpace;
use glam::{Affine3A, Vec3};

/// What is changed in a capture where it is placed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Factor on every opacity, from 0 to 1.
    pub opacity: f32,
    /// Factor on linear light, one for each channel.
    pub light: Vec3,
    /// From capture space to a box from −1 to 1: Gaussians with means outside are not drawn.
    pub crop: Option<Affine3A>,
}

impl Default for Look {
    fn default() -> Self {
        Self { opacity: 1.0, light: Vec3::ONE, crop: None }
    }
}

/// What is done to the colours of Gaussians.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lighting {
    /// Nothing: blended as trained.
    AsTrained,
    /// Light changes; the result is encoded again.
    Encoded,
    /// Light changes and stays linear.
    Linear,
}

impl Look {
    /// What it does to colours that are blended in `space`.
    pub fn lighting(&self, space: BlendSpace) -> Lighting {
        match space {
            BlendSpace::Linear => Lighting::Linear,
            BlendSpace::Encoded if self.light == Vec3::ONE => Lighting::AsTrained,
            BlendSpace::Encoded => Lighting::Encoded,
        }
    }

    /// A trained colour (sRGB-encoded) in the blend space.
    pub fn color(&self, color: Vec3, space: BlendSpace) -> Vec3 {
        match self.lighting(space) {
            Lighting::AsTrained => color,
            Lighting::Encoded => encode(decode(color.max(Vec3::ZERO)) * self.light),
            Lighting::Linear => decode(color.max(Vec3::ZERO)) * self.light,
        }
    }

    /// Whether a Gaussian with this mean, in capture space, is drawn.
    pub fn shows(&self, mean: Vec3) -> bool {
        self.crop.is_none_or(|crop| crop.transform_point3(mean).abs().max_element() <= 1.0)
    }
}

/// Linear light to the sRGB-encoded value; the power curve goes on above 1.
pub fn encode(linear: Vec3) -> Vec3 {
    linear.map(|x| if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 })
}

/// The reverse of [`encode`].
pub fn decode(encoded: Vec3) -> Vec3 {
    encoded.map(|x| if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_look_changes_no_bit() {
        let color = Vec3::new(0.1, 0.7, 1.3);
        assert_eq!(Look::default().color(color, BlendSpace::Encoded), color, "as trained");
        assert!(Look::default().shows(Vec3::splat(1e9)), "nothing is cropped");
    }

    #[test]
    fn light_is_a_factor_on_linear_light() {
        let look = Look { light: Vec3::new(2.0, 1.0, 0.0), ..Look::default() };
        let color = Vec3::splat(0.5);
        let linear = look.color(color, BlendSpace::Linear);
        assert!(linear.abs_diff_eq(decode(color) * look.light, 1e-6), "in linear light");
        assert!(decode(look.color(color, BlendSpace::Encoded)).abs_diff_eq(linear, 1e-5), "and encoded, the same");
        assert!(decode(encode(Vec3::new(0.001, 0.3, 4.0))).abs_diff_eq(Vec3::new(0.001, 0.3, 4.0), 1e-5), "to and fro");
    }

    #[test]
    fn a_crop_box_keeps_the_means_inside() {
        // Half a unit about (1, 0, 0).
        let crop = Affine3A::from_scale(Vec3::splat(2.0)) * Affine3A::from_translation(-Vec3::X);
        let look = Look { crop: Some(crop), ..Look::default() };
        assert!(look.shows(Vec3::new(1.4, 0.4, -0.4)), "inside");
        assert!(!look.shows(Vec3::new(1.6, 0.0, 0.0)), "outside");
        assert!(!look.shows(Vec3::NAN), "nowhere");
    }
}
