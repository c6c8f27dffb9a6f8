//! Settings of drawing, per capture and per camera.
//!
//! In: fields that any system or animation may set. Out: an [`Appearance`] for the renderer, the settings of a camera.

use crate::renderer::Design;
use crate::view::{Appearance, BlendSpace, DebugView, Thinning};
use bevy::color::LinearRgba;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use glam::{Affine3A, Mat3, Quat, Vec3};

/// How a capture is drawn: a required component of every [`GaussianCapture3d`](crate::GaussianCapture3d).
///
/// An opacity, or a factor on light, that is negative or not finite counts as 0.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     // Half transparent, bluish, and with twice the light.
///     let tint = LinearRgba::rgb(0.6, 0.8, 1.0);
///     let ghost = CaptureSettings { opacity: 0.5, tint, exposure: 1.0, ..default() };
///     commands.spawn((GaussianCapture3d(assets.load("toybox.gs4d")), ghost));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::render"]
pub struct CaptureSettings {
    /// Whether the capture's temporal filter is used, if it has one: Gaussians that are not active in the current
    /// segment are then skipped. Default: true.
    pub filter: bool,
    /// Factor on every Gaussian's opacity, from 0 (invisible) to 1. A timeline's fade is a further factor. Default: 1.
    pub opacity: f32,
    /// Factor on the linear light of each channel; alpha is not used. Default: white, a factor of 1.
    pub tint: LinearRgba,
    /// Exposure in stops: each doubles the linear light. Default: 0.
    pub exposure: f32,
    /// The part of the capture that is drawn. Default: `None`, all of it.
    pub crop: Option<CropBox>,
    /// The finest level of detail that is drawn, if the capture has levels: 0 is all Gaussians, 1 the first level with
    /// fewer Gaussians; a number above the coarsest level selects the coarsest. Default: 0.
    pub finest_level: u8,
    /// Factor on the size of its Gaussians where a [`CaptureBudget`](super::CaptureBudget) leaves out the smallest: at 2
    /// its detail is that of a capture at half the distance; at infinity all of its Gaussians are drawn. Less than a
    /// thousandth counts as a thousandth. Default: 1.
    pub priority: f32,
    /// Whether Gaussians are anti-aliased: where they are smaller on the screen than in training, they are drawn
    /// fainter, so that they cover no more than in training. Without anti-aliasing, distant Gaussians appear too large.
    /// Needs the size of training pixels, which `gs4d bake` and `gs4d detail --data` write into the package; captures
    /// without this size, and shadows, are drawn without anti-aliasing. Default: true.
    pub antialias: bool,
}

/// A box in capture space, in capture units: Gaussians whose means are outside at the current time are not drawn.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
/// use bevy_gs4d::render::CropBox;
///
/// // A column of 2 x 2 units about the z axis, infinitely high.
/// let column = CropBox { half_size: Vec3::new(1.0, 1.0, f32::INFINITY), ..default() };
/// assert!(column.contains(Vec3::new(0.5, -0.5, 100.0)), "inside");
/// assert!(!column.contains(Vec3::new(1.5, 0.0, 0.0)), "outside");
/// let settings = CaptureSettings { crop: Some(column), ..default() };
/// # assert_ne!(settings, CaptureSettings::default(), "cropped");
/// ```
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::render"]
pub struct CropBox {
    /// Center of the box. Default: the origin.
    pub center: Vec3,
    /// Half the lengths of the sides. An infinite length does not crop; a negative length counts as 0. Default: 1.
    pub half_size: Vec3,
    /// Rotation of the box about its center. Default: none.
    pub rotation: Quat,
}

/// How a camera draws captures: an optional component next to `Camera3d`. Without it the defaults apply.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
/// use bevy_gs4d::view::BlendSpace;
///
/// fn setup(mut commands: Commands) {
///     let settings = CaptureViewSettings { blend_space: BlendSpace::Linear, ..default() };
///     commands.spawn((Camera3d::default(), settings));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::render"]
pub struct CaptureViewSettings {
    /// The space in which Gaussians are blended with each other and with the background. Default:
    /// [`BlendSpace::Encoded`], as trained.
    pub blend_space: BlendSpace,
    /// The depth of captures in the camera's depth buffer. Default: [`DepthWrite::Auto`], only if an effect reads it.
    pub depth: DepthWrite,
    /// The quantity that is shown. Default: [`DebugView::Color`].
    pub debug: DebugView,
    /// The renderer's design; every design draws the same picture. Default: [`Design::Auto`], the fastest on this GPU.
    pub design: Design,
}

/// The depth of captures in the camera's depth buffer, at pixels where they hide more than half of the background.
///
/// Post-processing that reads the depth buffer (depth of field, volumetric fog) then treats captures as surfaces. With
/// [`Expected`](Self::Expected) and [`Median`](Self::Median), transparent meshes are drawn after captures and
/// depth-tested against them per pixel. See [the order of a frame](crate::render#the-order-of-a-frame). Default:
/// [`Auto`](Self::Auto).
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
/// use bevy_gs4d::render::DepthWrite;
///
/// fn setup(mut commands: Commands) {
///     let settings = CaptureViewSettings { depth: DepthWrite::Median, ..default() };
///     commands.spawn((Camera3d::default(), settings));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Reflect, Debug, Default, Clone, Copy, PartialEq, Eq, Hash)]
#[reflect(Default, Debug, Clone, PartialEq, Hash)]
#[type_path = "bevy_gs4d::render"]
#[non_exhaustive]
pub enum DepthWrite {
    /// [`Expected`](Self::Expected) for cameras with one of Bevy's effects that read depths after the main pass,
    /// [`None`](Self::None) for others. These effects are `DepthOfField`, `VolumetricFog`,
    /// `OrderIndependentTransparencySettings`, and all effects with a `MotionVectorPrepass`: `TemporalAntiAliasing`,
    /// `MotionBlur`. A game with its own depth effect must set the depth.
    #[default]
    Auto,
    /// No depth is written.
    None,
    /// The mean depth of the splats at a pixel, with the weights of their colors: smooth, but between surfaces where
    /// several surfaces are visible. For captures with an environment map, and with [`DebugView::Overdraw`], the median
    /// is written instead.
    Expected,
    /// The depth at which half of the light is absorbed: always on a surface, but with discontinuities.
    Median,
}

impl Default for CaptureSettings {
    fn default() -> Self {
        let tint = LinearRgba::WHITE;
        Self {
            filter: true,
            opacity: 1.0,
            tint,
            exposure: 0.0,
            crop: None,
            finest_level: 0,
            priority: 1.0,
            antialias: true,
        }
    }
}

impl Default for CropBox {
    /// The cube from −1 to 1.
    fn default() -> Self {
        Self { center: Vec3::ZERO, half_size: Vec3::ONE, rotation: Quat::IDENTITY }
    }
}

impl CaptureSettings {
    /// Returns the settings for the renderer, without thinning. `fade` is a further factor on opacity.
    pub(crate) fn appearance(&self, fade: f32) -> Appearance {
        let stops = self.exposure.exp2();
        let light = [self.tint.red, self.tint.green, self.tint.blue].map(|channel| number(channel * stops));
        Appearance {
            opacity: number(self.opacity * fade),
            light: Vec3::from(light),
            crop: self.crop.and_then(|crop| crop.cube_from_capture()),
            thinning: Thinning::default(),
        }
    }
}

impl CropBox {
    /// Returns whether a point of capture space is inside. A box contains every point if its center is not finite or
    /// its rotation has the length 0.
    pub fn contains(&self, point: Vec3) -> bool {
        self.cube_from_capture().is_none_or(|cube| cube.transform_point3(point).abs().max_element() <= 1.0)
    }

    /// Returns the transform from capture space to the cube from −1 to 1; `None` without a finite center and rotation.
    fn cube_from_capture(&self) -> Option<Affine3A> {
        // A side of length 0 must not divide by zero.
        let scale = self.half_size.max(Vec3::splat(1e-12)).recip();
        let matrix = Mat3::from_diagonal(scale) * Mat3::from_quat(self.rotation.normalize()).transpose();
        let cube = Affine3A::from_mat3_translation(matrix, matrix * -self.center);
        cube.is_finite().then_some(cube)
    }
}

/// Returns a value if it is finite and positive, else 0.
fn number(value: f32) -> f32 {
    if value.is_finite() { value.max(0.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_PI_4;

    #[test]
    fn default_settings_draw_captures_as_trained() {
        assert_eq!(
            CaptureSettings::default().appearance(1.0),
            Appearance::default(),
            "the default appearance is that of the training"
        );
    }

    #[test]
    fn light_is_tint_times_two_to_the_power_of_exposure() {
        let settings =
            CaptureSettings { tint: LinearRgba::rgb(1.0, 0.5, 0.0), exposure: 1.0, ..CaptureSettings::default() };
        assert_eq!(settings.appearance(1.0).light, Vec3::new(2.0, 1.0, 0.0), "one stop doubles the light");
    }

    #[test]
    fn fades_multiply_and_invalid_values_count_as_zero() {
        let half = CaptureSettings { opacity: 0.5, ..CaptureSettings::default() };
        assert_eq!(half.appearance(0.5).opacity, 0.25, "the fade multiplies the opacity");
        let broken = CaptureSettings { opacity: f32::NAN, exposure: f32::INFINITY, ..CaptureSettings::default() };
        let appearance = broken.appearance(1.0);
        assert_eq!((appearance.opacity, appearance.light), (0.0, Vec3::ZERO), "NaN and infinity count as 0");
        assert_eq!(
            CaptureSettings { opacity: -1.0, ..half }.appearance(1.0).opacity,
            0.0,
            "a negative opacity counts as 0"
        );
    }

    #[test]
    fn a_rotated_box_contains_the_points_inside_it() {
        let turned = CropBox {
            center: Vec3::X,
            half_size: Vec3::new(2.0, 0.5, f32::INFINITY),
            rotation: Quat::from_rotation_z(FRAC_PI_4),
        };
        assert!(turned.contains(Vec3::new(2.0, 1.0, 0.0)), "a point along the long side is inside");
        assert!(!turned.contains(Vec3::new(2.0, -1.0, 0.0)), "a point across the long side is outside");
        assert!(turned.contains(Vec3::new(1.0, 0.0, -1e6)), "an infinite side does not crop");
        assert!(!turned.contains(Vec3::new(3.0, 2.0, 0.0)), "a point beyond the end is outside");
    }

    #[test]
    fn boxes_with_negative_sides_are_empty_and_invalid_boxes_crop_nothing() {
        let empty = CropBox { half_size: Vec3::new(1.0, -1.0, 1.0), ..CropBox::default() };
        assert!(!empty.contains(Vec3::Y * 0.1), "a box with a negative side contains no point");
        let broken = CropBox { center: Vec3::NAN, ..CropBox::default() };
        assert!(broken.contains(Vec3::ONE * 9.0), "a box with a NaN center crops nothing");
        let unturned = CropBox { rotation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), ..CropBox::default() };
        assert!(unturned.contains(Vec3::ONE * 9.0), "a box with a zero rotation crops nothing");
    }
}
