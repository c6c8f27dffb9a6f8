//! What a game sets: how a capture is drawn, and how a camera draws captures.
//!
//! In: fields that any system or animation may write. Out: an [`Appearance`] for the renderer, and a camera's choices.

use crate::view::{Appearance, BlendSpace, DebugView};
use bevy::color::LinearRgba;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use glam::{Affine3A, Mat3, Quat, Vec3};

/// How a capture is drawn. On every [`GaussianCapture3d`](super::GaussianCapture3d).
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct CaptureSettings {
    /// Whether the capture's temporal filter is used, if it has one: what is not active at a time is then not even looked at.
    pub filter: bool,
    /// Factor on every Gaussian's opacity, 0 (nothing shows) to 1. A timeline's fade is a further factor.
    pub opacity: f32,
    /// Factor on the linear light of each channel; alpha is not used.
    pub tint: LinearRgba,
    /// Stops: each doubles the linear light.
    pub exposure: f32,
    /// What shows of the capture; all of it without one.
    pub crop: Option<CropBox>,
}

/// A box in capture space: Gaussians whose means are outside at the moment are not drawn.
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Default, Debug, Clone, PartialEq)]
pub struct CropBox {
    /// Its centre.
    pub center: Vec3,
    /// Half its sides; an infinite one does not crop.
    pub half_size: Vec3,
    /// How it is turned about its centre.
    pub rotation: Quat,
}

/// How a camera draws captures. Optional, beside `Camera3d`.
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct CaptureViewSettings {
    /// The space in which Gaussians are blended with each other and with what is behind them.
    pub blend_space: BlendSpace,
    /// Whether captures are written to the camera's depth buffer, for what is drawn after them.
    pub depth: DepthWrite,
    /// What is shown of captures in place of their colour.
    pub debug: DebugView,
    /// Whether captures are drawn after transparent meshes without multisampling, too. Needed where something is drawn between
    /// opaque and transparent meshes that cannot be ordered against captures: Bevy's atmosphere.
    pub late: bool,
}

/// Which depth of a capture is written to the camera's depth buffer, at pixels where captures hide more than half of what is behind.
///
/// Post-processing that reads the depth buffer (depth of field, volumetric fog) then takes captures for surfaces, and so do
/// transparent meshes, which captures cut pixel by pixel. See [the order of a frame](crate::plugin::render#the-order-of-a-frame).
#[derive(Reflect, Debug, Default, Clone, Copy, PartialEq, Eq, Hash)]
#[reflect(Default, Debug, Clone, PartialEq, Hash)]
pub enum DepthWrite {
    /// None.
    #[default]
    None,
    /// The mean of the depths that a pixel's colour comes from: smooth, but between surfaces where several show. Of captures with an
    /// environment map it is the median all the same.
    Expected,
    /// The depth at which half of the light has been held back: on a surface, but with steps.
    Median,
}

impl Default for CaptureSettings {
    fn default() -> Self {
        Self { filter: true, opacity: 1.0, tint: LinearRgba::WHITE, exposure: 0.0, crop: None }
    }
}

impl Default for CropBox {
    /// One unit about the origin to all sides.
    fn default() -> Self {
        Self { center: Vec3::ZERO, half_size: Vec3::ONE, rotation: Quat::IDENTITY }
    }
}

impl CaptureSettings {
    /// For the renderer, with a further factor on opacity. What is not a number counts as 0.
    pub(crate) fn appearance(&self, fade: f32) -> Appearance {
        let stops = self.exposure.exp2();
        let light = [self.tint.red, self.tint.green, self.tint.blue].map(|channel| number(channel * stops));
        Appearance {
            opacity: number(self.opacity * fade),
            light: Vec3::from(light),
            crop: self.crop.and_then(|crop| crop.cube_from_capture()),
        }
    }
}

impl CropBox {
    /// Whether a point of capture space is inside. A box that is not made of numbers holds everything.
    pub fn contains(&self, point: Vec3) -> bool {
        self.cube_from_capture().is_none_or(|cube| cube.transform_point3(point).abs().max_element() <= 1.0)
    }

    /// Capture space to the cube from −1 to 1; nothing for a box that is not made of numbers.
    fn cube_from_capture(&self) -> Option<Affine3A> {
        // A side of nothing holds nothing, but must not divide by zero.
        let scale = self.half_size.max(Vec3::splat(1e-12)).recip();
        let matrix = Mat3::from_diagonal(scale) * Mat3::from_quat(self.rotation.normalize()).transpose();
        let cube = Affine3A::from_mat3_translation(matrix, matrix * -self.center);
        cube.is_finite().then_some(cube)
    }
}

/// Not negative, and a number.
fn number(value: f32) -> f32 {
    if value.is_finite() { value.max(0.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_PI_4;

    #[test]
    fn the_default_changes_nothing() {
        assert_eq!(CaptureSettings::default().appearance(1.0), Appearance::default(), "as trained");
    }

    #[test]
    fn light_is_tint_times_two_to_the_stops() {
        let settings =
            CaptureSettings { tint: LinearRgba::rgb(1.0, 0.5, 0.0), exposure: 1.0, ..CaptureSettings::default() };
        assert_eq!(settings.appearance(1.0).light, Vec3::new(2.0, 1.0, 0.0), "one stop doubles");
    }

    #[test]
    fn fades_multiply_and_nonsense_is_nothing() {
        let half = CaptureSettings { opacity: 0.5, ..CaptureSettings::default() };
        assert_eq!(half.appearance(0.5).opacity, 0.25, "half of a half");
        let broken = CaptureSettings { opacity: f32::NAN, exposure: f32::INFINITY, ..CaptureSettings::default() };
        let appearance = broken.appearance(1.0);
        assert_eq!((appearance.opacity, appearance.light), (0.0, Vec3::ZERO), "no number counts as 0");
        assert_eq!(
            CaptureSettings { opacity: -1.0, ..half }.appearance(1.0).opacity,
            0.0,
            "nothing is less than nothing"
        );
    }

    #[test]
    fn a_turned_box_holds_what_is_inside() {
        let turned = CropBox {
            center: Vec3::X,
            half_size: Vec3::new(2.0, 0.5, f32::INFINITY),
            rotation: Quat::from_rotation_z(FRAC_PI_4),
        };
        assert!(turned.contains(Vec3::new(2.0, 1.0, 0.0)), "along its long side");
        assert!(!turned.contains(Vec3::new(2.0, -1.0, 0.0)), "across it");
        assert!(turned.contains(Vec3::new(1.0, 0.0, -1e6)), "an infinite side does not crop");
        assert!(!turned.contains(Vec3::new(3.0, 2.0, 0.0)), "beyond its end");
    }

    #[test]
    fn degenerate_boxes_do_not_break() {
        let empty = CropBox { half_size: Vec3::new(1.0, -1.0, 1.0), ..CropBox::default() };
        assert!(!empty.contains(Vec3::Y * 0.1), "a negative side holds nothing");
        let broken = CropBox { center: Vec3::NAN, ..CropBox::default() };
        assert!(broken.contains(Vec3::ONE * 9.0), "what is no box crops nothing");
        let unturned = CropBox { rotation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), ..CropBox::default() };
        assert!(unturned.contains(Vec3::ONE * 9.0), "nor does one without a rotation");
    }
}
