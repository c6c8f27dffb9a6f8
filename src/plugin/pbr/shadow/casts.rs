//! Which captures cast shadows.
//!
//! In: a component on a capture. Out: how its shadows are drawn.

use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// Makes a capture cast shadows: an optional component beside [`GaussianCapture3d`](crate::GaussianCapture3d).
///
/// It casts those of every light with shadow maps, whether a camera sees the capture or not, at the capture's current time, with its
/// opacity, crop and temporal filter. Hidden captures cast none, and those of other `RenderLayers` than the light's neither.
///
/// Captures cast no shadows without it, since each shadow costs up to one more view of the capture, as large as the shadow map at its
/// [`resolution`](Self::resolution): for a directional light one for each cascade and camera (four by default), for a point light six, for
/// a spot light one. Views whose part of the world the capture does not reach cost nothing.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
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
pub struct CastsShadows {
    /// How finely the capture is drawn for shadows. Captures in the same view of a light are all drawn as the finest of them. Default:
    /// [`ShadowResolution::Half`].
    pub resolution: ShadowResolution,
    /// How far the shadow begins behind the capture's surface, seen from the light, as a share of the diagonal of its bounds; one that is
    /// negative or not finite counts as 0. With too little, captures that receive shadows darken their own lit side; with too much, light
    /// leaks between a capture and the ground that it stands on. Default: 0.02.
    pub bias: f32,
}

impl Default for CastsShadows {
    fn default() -> Self {
        Self { resolution: ShadowResolution::default(), bias: 0.02 }
    }
}

/// The share of a shadow map's width and height at which captures are drawn into it. Default: [`Half`](Self::Half).
///
/// # Examples
///
/// ```
/// use bevy_gs4d::prelude::*;
///
/// let sharp = CastsShadows { resolution: ShadowResolution::Full, ..CastsShadows::default() };
/// # assert_ne!(sharp, CastsShadows::default(), "another resolution");
/// ```
#[derive(Reflect, Debug, Default, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[reflect(Default, Debug, Clone, PartialEq, Hash)]
pub enum ShadowResolution {
    /// All of it.
    Full,
    /// One half, with a quarter of the pixels.
    #[default]
    Half,
    /// One quarter, with a sixteenth of the pixels.
    Quarter,
}

impl ShadowResolution {
    /// Returns the number of texels along one side of a pixel.
    pub(super) fn scale(self) -> u32 {
        match self {
            Self::Full => 1,
            Self::Half => 2,
            Self::Quarter => 4,
        }
    }
}
