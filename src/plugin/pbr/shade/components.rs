//! The components that let a capture receive shadows and light from the scene.
//!
//! In: fields that any system or animation may set. Out: the components for [`extract`](super::extract).

use bevy::camera::Exposure;
use bevy::color::LinearRgba;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::light::GlobalAmbientLight;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// Lets the shadows of meshes fall on a capture: an optional component next to
/// [`GaussianCapture3d`](crate::GaussianCapture3d).
///
/// A capture contains the light in which it was filmed, which cannot be removed. Where a light of the scene with
/// `shadow_maps_enabled` does not reach the capture, its linear light is multiplied by [`tint`](Self::tint), once for
/// each such light. The effect of point and spot lights falls off towards the end of their range and of their cone. A
/// capture has no normals: lights count as perpendicular to its surface, so the side away from a light is not dark. The
/// strength of lights has no effect. A shadow is looked up at the depth of a pixel (the mean depth of its splats, or
/// the median with an environment map). With [`CastsShadows`](crate::pbr::CastsShadows) the capture also shadows
/// itself, gradually behind its surface; see [its bias](crate::pbr::CastsShadows::bias). Bevy's `NotShadowReceiver` on
/// the same entity switches all these shadows off.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::pbr::ReceivesShadows;
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     // Bluish shadows, as under a clear sky.
///     let shadows = ReceivesShadows { tint: LinearRgba::rgb(0.25, 0.3, 0.45), ..default() };
///     commands.spawn((GaussianCapture3d(assets.load("toybox.gs4d")), shadows));
///     commands.spawn(DirectionalLight { shadow_maps_enabled: true, ..default() });
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::pbr"]
pub struct ReceivesShadows {
    /// Factor on the linear light of each channel in full shadow; alpha is not used, a channel that is negative or not
    /// finite counts as 0. Default: 0.35 in each channel.
    pub tint: LinearRgba,
    /// Distance by which a point is moved towards a light before its shadow is looked up, in world units, in addition
    /// to the light's own biases; it should be the uncertainty of the capture's depth. A capture with
    /// [`CastsShadows`](crate::pbr::CastsShadows) adds the width of a pixel. A value that is not finite counts as 0.
    /// Default: 0.02.
    pub bias: f32,
}

/// Lights a capture by its surroundings, so that it does not glow in a dark room: an optional component next to
/// [`GaussianCapture3d`](crate::GaussianCapture3d).
///
/// The linear light of the capture is multiplied by the light of the surroundings: the mean of the camera's
/// `EnvironmentMapLight`, in six directions, times its intensity, plus the ambient light, both at the camera's
/// exposure. Light probes, irradiance volumes and lamps have no effect.
///
/// By default a capture looks as trained under Bevy's own ambient light, brighter in a brighter room, and darker in a
/// darker one. In a scene that an `EnvironmentMapLight` of full intensity lights, so that a white surface is white, set
/// `reference: 1.0`.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::pbr::CaptureLight;
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     // Halfway between the trained light and the light of the room.
///     let light = CaptureLight { amount: 0.5, ..default() };
///     commands.spawn((GaussianCapture3d(assets.load("toybox.gs4d")), light));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::pbr"]
pub struct CaptureLight {
    /// The light of the surroundings under which the capture looks as trained: the brightness of the ambient light, or
    /// mean radiance times `EnvironmentMapLight::intensity` (cd/m²), times the camera's exposure. At Bevy's default
    /// exposure 1 is about 1000 cd/m². If the value is not finite or not above 0, the capture is not changed. Default:
    /// Bevy's default ambient light of 80 cd/m² at its default exposure, about 0.08.
    pub reference: f32,
    /// Weight of the surroundings' light, from 0 (the capture looks as trained) to 1. Default: 1.
    pub amount: f32,
}

impl Default for ReceivesShadows {
    fn default() -> Self {
        Self { tint: LinearRgba::rgb(0.35, 0.35, 0.35), bias: 0.02 }
    }
}

impl Default for CaptureLight {
    fn default() -> Self {
        Self { reference: GlobalAmbientLight::default().brightness * Exposure::default().exposure(), amount: 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_reference_is_the_default_ambient_light_of_bevy() {
        // 80 cd/m² at an exposure value of 9.7.
        let expected = 80.0 * (-9.7f32).exp2() / 1.2;
        let CaptureLight { reference, amount } = CaptureLight::default();
        assert!((reference - expected).abs() < 1e-4, "the default reference is {expected}, not {reference}");
        assert_eq!(amount, 1.0, "the default weight is 1");
    }
}
