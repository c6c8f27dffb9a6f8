//! The components by which a capture takes shadows and light from the scene.
//!
//! In: fields that any system or animation may set. Out: the same, for [`extract`](super::extract).

use bevy::camera::Exposure;
use bevy::color::LinearRgba;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::light::GlobalAmbientLight;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// Lets the shadows of meshes fall on a capture: an optional component beside [`GaussianCapture3d`](crate::GaussianCapture3d).
///
/// A capture was filmed in its own light, which cannot be taken away: where a light of the scene with `shadow_maps_enabled` does not reach
/// it, it is multiplied by [`tint`](Self::tint), once for each such light, in linear light. Point and spot lights count less towards the
/// end of their range and of their cone. A capture has no normals: lights are taken to meet it head-on, so that the side that is turned
/// away from a light is not dark, and their strength does not matter. A shadow falls at the depth of a pixel (the mean depth of its splats,
/// or the median with an environment map around).
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
pub struct ReceivesShadows {
    /// Factor on the linear light of each channel in full shadow; alpha is not used, and a channel that is negative or not finite counts as
    /// 0. Default: 0.35 in each channel.
    pub tint: LinearRgba,
    /// How far a point is moved towards a light before its shadow is looked up, in world units, beside the light's own biases: as far as
    /// the capture's depth is uncertain. One that is not finite counts as 0. Default: 0.02.
    pub bias: f32,
}

/// Lets a capture take the light of its surroundings, so that it does not glow in a dark room: an optional component beside
/// [`GaussianCapture3d`](crate::GaussianCapture3d).
///
/// The linear light of the capture is multiplied by that of the surroundings: the mean of the camera's `EnvironmentMapLight`, in six
/// directions, times its intensity, plus the ambient light, both at the camera's exposure. Light probes, irradiance volumes and lamps do not
/// count.
///
/// By default a capture looks as trained under Bevy's own ambient light, brighter in a brighter room, and darker in a darker one. In a scene
/// that an `EnvironmentMapLight` of full intensity lights, so that a white surface is white, set `reference: 1.0`.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::pbr::CaptureLight;
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     // Half of the way from the trained light to that of the room.
///     let light = CaptureLight { amount: 0.5, ..default() };
///     commands.spawn((GaussianCapture3d(assets.load("toybox.gs4d")), light));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct CaptureLight {
    /// The light of the surroundings under which the capture looks as trained: that of the ambient light, or mean radiance times
    /// `EnvironmentMapLight::intensity` (cd/m²), times the camera's exposure. At Bevy's default exposure 1 is about 1000 cd/m². Without a finite
    /// value above 0 the capture is not changed. Default: Bevy's default ambient light of 80 cd/m² at its default exposure, about 0.08.
    pub reference: f32,
    /// How much of the surroundings' light the capture takes, from 0 (none: it looks as trained) to 1. Default: 1.
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
    fn the_default_light_is_that_of_an_app_that_sets_none() {
        // 80 cd/m² at an exposure value of 9.7.
        let expected = 80.0 * (-9.7f32).exp2() / 1.2;
        let CaptureLight { reference, amount } = CaptureLight::default();
        assert!((reference - expected).abs() < 1e-4, "a capture looks as trained under {expected}, not {reference}");
        assert_eq!(amount, 1.0, "and takes all of the light");
    }
}
