//! The contact shadow of a capture: strength, softness and height of the ground.
//!
//! In: fields that any system or animation may set. Out: the ellipse beneath the bounds of a capture.

use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use glam::{Affine3A, Vec3};

/// Darkens the ground beneath a capture: an optional component next to [`GaussianCapture3d`](crate::GaussianCapture3d).
///
/// The ellipse is inscribed in the capture's bounds seen from above and follows them over time. It fades with the
/// capture's opacity, with the height above the ground, and in fog. It needs no light, and costs as much as one small
/// quad. It is drawn over opaque and alpha-masked meshes and behind captures, by every camera whose layers intersect
/// the capture's and that is within its `VisibilityRange`, while the capture is visible.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     let shadow = CaptureContactShadow { ground: 0.1, ..default() };
///     commands.spawn((GaussianCapture3d(assets.load("toybox.gs4d")), shadow));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::pbr"]
pub struct CaptureContactShadow {
    /// Fraction of the light that the shadow removes at its center, from 0 to 1. Default: 0.6.
    pub strength: f32,
    /// Width of the edge as a fraction of the radius, 0 (hard) to 1; half of it is outside the bounds. Default: 0.8.
    pub softness: f32,
    /// Height of the ground, y in world space. Default: 0.
    pub ground: f32,
}

impl Default for CaptureContactShadow {
    fn default() -> Self {
        Self { strength: 0.6, softness: 0.8, ground: 0.0 }
    }
}

/// An ellipse on the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ellipse {
    /// Transform from the unit disk in the plane y = 0.
    pub(super) world_from_disk: Affine3A,
    /// Fraction of the light that the ellipse removes at its center, from 0 to 1.
    pub(super) strength: f32,
}

impl CaptureContactShadow {
    /// Returns the softness, from 0 to 1.
    pub(super) fn softness(&self) -> f32 {
        unit(self.softness)
    }

    /// Returns the ellipse beneath a box in world space; `None` if the box is below the ground or too high above it.
    pub(super) fn beneath(&self, center: Vec3, half_size: Vec3) -> Option<Ellipse> {
        let above = center.y - half_size.y - self.ground;
        let reach = half_size.x.max(half_size.z);
        // The strength is 0 at a height equal to the width of the box.
        let fade = 1.0 - above.max(0.0) / (2.0 * reach);
        let strength = unit(self.strength) * unit(fade);
        // Half of the edge is outside the bounds.
        let radius = half_size / (1.0 - 0.5 * self.softness());
        // Far enough above the ground to pass the depth test.
        let place = Vec3::new(center.x, self.ground + 0.005 * reach, center.z);
        let scale = Vec3::new(radius.x, 1.0, radius.z);
        let is_buried = center.y + half_size.y < self.ground;
        let is_flat = half_size.x <= 0.0 || half_size.z <= 0.0;
        let shows = strength > 0.0 && !is_buried && !is_flat && place.is_finite() && scale.is_finite();
        let world_from_disk = Affine3A::from_translation(place) * Affine3A::from_scale(scale);
        shows.then_some(Ellipse { world_from_disk, strength })
    }
}

/// Returns a value clamped to 0 and 1; 0 for NaN.
fn unit(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHADOW: CaptureContactShadow = CaptureContactShadow { strength: 0.8, softness: 0.0, ground: 1.0 };

    #[test]
    fn the_ellipse_is_inscribed_in_the_bounds() {
        let ellipse = SHADOW.beneath(Vec3::new(3.0, 2.0, -1.0), Vec3::new(0.5, 1.0, 0.25)).expect("a visible ellipse");
        let edge = ellipse.world_from_disk.transform_point3(Vec3::X);
        assert!(edge.abs_diff_eq(Vec3::new(3.5, 1.0, -1.0), 0.01), "the edge is at the side of the box, not at {edge}");
        assert!(edge.y > 1.0, "the ellipse is just above the ground");
        assert_eq!(ellipse.strength, 0.8, "a capture on the ground has the full strength");
        let soft = CaptureContactShadow { softness: 1.0, ..SHADOW };
        let soft = soft.beneath(Vec3::new(3.0, 2.0, -1.0), Vec3::new(0.5, 1.0, 0.25)).expect("a visible ellipse");
        let edge = soft.world_from_disk.transform_point3(Vec3::X);
        assert!((edge.x - 4.0).abs() < 1e-5, "half of a soft edge is outside the bounds: {edge}");
    }

    #[test]
    fn the_strength_falls_with_height() {
        let at =
            |height: f32| SHADOW.beneath(Vec3::Y * (2.0 + height), Vec3::ONE).map_or(0.0, |ellipse| ellipse.strength);
        assert!((at(1.0) - 0.4).abs() < 1e-6, "at half of the fading height the strength is halved");
        assert_eq!([at(2.0), at(9.0)], [0.0; 2], "no shadow at a height of twice the radius and above");
        assert_eq!(at(-0.5), 0.8, "a capture partly in the ground has the full strength");
        assert_eq!(at(-2.5), 0.0, "a capture below the ground has no shadow");
    }

    #[test]
    fn invalid_values_have_no_ellipse() {
        for broken in
            [CaptureContactShadow { strength: f32::NAN, ..SHADOW }, CaptureContactShadow { ground: f32::NAN, ..SHADOW }]
        {
            assert_eq!(broken.beneath(Vec3::Y * 2.0, Vec3::ONE), None, "{broken:?} has no ellipse");
        }
        assert_eq!(SHADOW.beneath(Vec3::Y * 2.0, Vec3::new(0.0, 1.0, 1.0)), None, "a flat box has no ellipse");
        assert_eq!(SHADOW.beneath(Vec3::NAN, Vec3::ONE), None, "a box at NaN has no ellipse");
    }
}
