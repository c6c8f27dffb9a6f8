//! The component that makes a capture cast shadows.
//!
//! In: fields that any system or animation may set. Out: resolution and bias of the capture's shadows.

use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use glam::{Affine3A, Vec3A};

/// Makes a capture cast shadows: an optional component next to [`GaussianCapture3d`](crate::GaussianCapture3d).
///
/// The capture casts a shadow for every light with shadow maps, whether a camera sees the capture or not, at its
/// current time, with its opacity, crop and temporal filter. Hidden captures, captures on `RenderLayers` that the light
/// does not have, and captures with Bevy's `NotShadowCaster` cast no shadows. A `VisibilityRange` holds for shadows as for
/// those of meshes.
///
/// Without this component captures cast no shadows, since each shadow costs up to one more view of the capture, as
/// large as the shadow map at its [`resolution`](Self::resolution): for a directional light one for each cascade and
/// camera (four by default), for a point light six, for a spot light one. Views without the capture cost nothing.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::pbr::CastsShadows;
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     commands.spawn((GaussianCapture3d(assets.load("toybox.gs4d")), CastsShadows::default()));
///     commands.spawn(DirectionalLight { shadow_maps_enabled: true, ..default() });
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::pbr"]
pub struct CastsShadows {
    /// Resolution at which the capture is drawn for shadows. All captures in one view of a light are drawn at the
    /// finest of their resolutions. Default: [`ShadowResolution::Half`].
    pub resolution: ShadowResolution,
    /// Distance of the shadow behind the capture's surface, seen from the light, in extents of the capture's Gaussians:
    /// a splat has one depth, so the depth of a surface is known up to about an extent (the standard deviation along an
    /// axis that three quarters of the Gaussians, weighted by opacity, do not exceed). A value that is negative or not
    /// finite counts as 0. If the capture also receives shadows, these set in gradually: its own from this distance to
    /// three times this distance. If the bias is too small, the capture darkens its own lit side; if it is too large,
    /// light leaks between the capture and the ground below it. Default: 2.
    pub bias: f32,
}

impl CastsShadows {
    /// Returns the distance of the shadow of a capture behind its surface, world units, given the typical extent of its
    /// Gaussians.
    pub(in crate::plugin::pbr) fn distance(&self, extent: f32, world_from_capture: &Affine3A) -> f32 {
        let matrix = world_from_capture.matrix3;
        let scale = Vec3A::from([matrix.x_axis, matrix.y_axis, matrix.z_axis].map(Vec3A::length)).max_element();
        let distance = self.bias * extent * scale;
        if distance.is_finite() { distance.max(0.0) } else { 0.0 }
    }
}

impl Default for CastsShadows {
    fn default() -> Self {
        Self { resolution: ShadowResolution::default(), bias: 2.0 }
    }
}

/// The fraction of a shadow map's width and height at which captures are drawn into it. Default: [`Half`](Self::Half).
///
/// # Examples
///
/// ```
/// use bevy_gs4d::pbr::{CastsShadows, ShadowResolution};
/// use bevy_gs4d::prelude::*;
///
/// let sharp = CastsShadows { resolution: ShadowResolution::Full, ..CastsShadows::default() };
/// # assert_ne!(sharp, CastsShadows::default(), "another resolution");
/// ```
#[derive(Reflect, Debug, Default, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[reflect(Default, Debug, Clone, PartialEq, Hash)]
#[type_path = "bevy_gs4d::pbr"]
#[non_exhaustive]
pub enum ShadowResolution {
    /// The full width and height.
    Full,
    /// One half: a quarter of the pixels.
    #[default]
    Half,
    /// One quarter: a sixteenth of the pixels.
    Quarter,
}

impl ShadowResolution {
    /// Returns the side of a pixel in texels of the map.
    pub(super) fn scale(self) -> u32 {
        match self {
            Self::Full => 1,
            Self::Half => 2,
            Self::Quarter => 4,
        }
    }
}
