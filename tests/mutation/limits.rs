//! The limits of the values that a picture of a scene can have, whatever draws it.
//!
//! In: a scene. Out: the first value of a frame that is not finite, or beyond what the coefficients, the background and
//! the positions of the scene allow.

use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::scene::{Form, RuntimeScene, Sliced};
use bevy_gs4d::view::{Background, Frame, View};
use std::borrow::Cow;

/// The largest value of a spherical harmonic up to degree 3: the root of 7 / 4π.
const HARMONIC: f32 = 0.7464;
/// The brightest color that is drawn.
const BRIGHTEST: f32 = 65504.0;
/// What rounding adds to a limit, relative and absolute.
const ROUNDING: f32 = 1e-3;

/// The limits of a scene.
pub struct Limits {
    /// The brightest color of a Gaussian.
    color: f32,
    /// The largest absolute value of the environment map.
    environment: f32,
    gaussians: Vec<Gaussian>,
}

/// Returns the Gaussians and colors of a scene in single precision.
pub fn sliced(scene: &RuntimeScene) -> Cow<'_, Sliced> {
    match &scene.form {
        Form::Sliced(sliced) => Cow::Borrowed(sliced),
        Form::Packed(packed) => Cow::Owned(packed.clone().unpack()),
    }
}

impl Limits {
    /// Returns the limits of a scene.
    pub fn of(scene: &RuntimeScene) -> Self {
        let Sliced { gaussians, harmonics } = sliced(scene).into_owned();
        let Harmonics { coefficients, values, .. } = harmonics;
        let brightest = |coefficients: &[f32]| {
            let channel = |channel: usize| coefficients.iter().skip(channel).step_by(3).map(|c| c.abs()).sum::<f32>();
            [0, 1, 2].map(channel).into_iter().fold(0.0, f32::max)
        };
        let color = values.chunks(3 * coefficients.max(1)).map(brightest).fold(0.0, f32::max);
        let texels = scene.environment.iter().flat_map(|map| &map.texels);
        let environment = texels.map(|texel| texel.abs()).fold(0.0, f32::max);
        // Brighter colors are drawn with the largest half-precision number.
        let [color, environment] = [0.5 + HARMONIC * color, environment].map(|value| value.min(BRIGHTEST));
        Self { color, environment, gaussians }
    }

    /// Returns the brightest color that a picture can have over a background.
    pub fn brightest(&self, background: Background) -> f32 {
        self.color.max(self.behind(background))
    }

    /// Checks the values of a frame.
    pub fn check(&self, frame: &Frame, view: &View, background: Background) -> Result<(), String> {
        let (behind, bright) = (self.behind(background), self.brightest(background));
        let depth = |gaussian: &Gaussian| view.world_to_camera.transform_point3(gaussian.mean_at(view.time)).z;
        // A depth that is not a number has no limit.
        let depths = self.gaussians.iter().map(depth).map(|depth| if depth.is_nan() { f32::INFINITY } else { depth });
        let deepest = depths.fold(0.0, f32::max);
        let color: Vec<f32> = frame.picture.pixels.iter().flat_map(|pixel| pixel.to_array()).collect();
        let planes = [
            ("color", &color, [-behind, bright]),
            ("transmittance", &frame.transmittance, [0.0, 1.0]),
            ("depth", &frame.depth, [0.0, deepest]),
            ("median depth", &frame.median_depth, [0.0, deepest]),
        ];
        for (name, values, [low, high]) in planes {
            let (low, high) = (low - ROUNDING * (1.0 + low.abs()), high + ROUNDING * (1.0 + high.abs()));
            // The comparison is false for NaN.
            if let Some(value) = values.iter().find(|value| !(value.is_finite() && (low..=high).contains(*value))) {
                return Err(format!("is drawn with a {name} of {value} at time {}, beyond {low} to {high}", view.time));
            }
        }
        Ok(())
    }

    /// Returns the largest absolute value of a background.
    fn behind(&self, background: Background) -> f32 {
        match background {
            Background::None => 0.0,
            Background::Color(color) => color.into_iter().map(f32::abs).fold(0.0, f32::max),
            Background::Environment => self.environment,
        }
    }
}
