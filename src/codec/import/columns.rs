//! Gaussians in columns, as most formats of other makes have them.
//!
//! In: the values that a reader decodes. Out: [`Columns`], converted to a [`GaussianScene`]: at rest in the trained
//! form, moving in the sliced form.

use super::error::ImportError;
use crate::codec::options::ReadOptions;
use crate::gaussian::{Gaussian, Harmonics, InvalidGaussian, Parameters, SMALLEST_CUTOFF, SliceSettings};
use crate::scene::near::Lengths;
use crate::scene::{
    Form, GaussianScene, PlaybackHints, SceneForm, Sliced, TemporalFilter, Trained, TrainedWith, UpAxis,
};
use crate::view::RasterFov;

/// Gaussians in columns, one entry for each; capture space.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Columns {
    /// Means, capture units; of moving Gaussians at the time `mean_t`.
    pub mean: Vec<[f32; 3]>,
    /// Logarithms of the scales, which are standard deviations, capture units.
    pub log_scale: Vec<[f32; 3]>,
    /// Rotations, quaternions w, x, y, z of any length but 0.
    pub rotation: Vec<[f32; 4]>,
    /// Logits of the opacities.
    pub opacity_logit: Vec<f32>,
    /// Colors, of time degree 0.
    pub harmonics: Harmonics,
    /// Motion and lifespans; empty if all are at rest and present at every time.
    pub motion: Vec<Motion>,
    /// Segments of time in which each Gaussian is active; all if `None`.
    pub filter: Option<TemporalFilter>,
    /// The place that means are relative to, in the coordinates of the files.
    pub origin: [f64; 3],
    /// Whether they were trained with the screen-space filter of Mip-Splatting.
    pub mip_filter: bool,
}

/// Motion and lifespan of a Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Motion {
    /// Velocity, capture units per timestamp unit.
    pub velocity: [f32; 3],
    /// Temporal mean, timestamp units.
    pub mean_t: f32,
    /// Temporal standard deviation, timestamp units; infinite if the Gaussian is present at every time.
    pub sigma_t: f32,
}

/// How the files of a format are played, as they state or imply it. [`ReadOptions`] replace each value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Played {
    /// The axis that points up.
    pub up: UpAxis,
    /// First and last timestamp.
    pub time_interval: [f32; 2],
    /// Seconds of one pass through the interval; 0 for a still.
    pub duration_seconds: f32,
    /// The marginal at and below which a Gaussian is not drawn; [`SMALLEST_CUTOFF`] if the format has none.
    pub marginal_cutoff: f32,
}

impl Played {
    /// Returns the values for Gaussians at rest.
    pub(crate) fn still(up: UpAxis) -> Self {
        Self { up, time_interval: [0.0, 1.0], duration_seconds: 0.0, marginal_cutoff: SMALLEST_CUTOFF }
    }

    /// Returns the scene of Gaussians that are played so; the options replace values.
    ///
    /// # Errors
    /// Parts that do not fit together.
    pub(crate) fn scene(
        self,
        form: SceneForm,
        filter: Option<TemporalFilter>,
        options: &ReadOptions,
    ) -> Result<GaussianScene, ImportError> {
        let Lengths { near, spatial_lr_scale } = Lengths::of(&form);
        let scene = GaussianScene {
            form,
            environment: None,
            filter,
            trained_with: TrainedWith {
                time_interval: options.time_interval.unwrap_or(self.time_interval),
                background: options.background.unwrap_or_default(),
                marginal_cutoff: options.marginal_cutoff.unwrap_or(self.marginal_cutoff),
                raster_fov: options.raster_fov.unwrap_or(RasterFov::Corrected),
                cameras: options.cameras.unwrap_or_default(),
                sh_direction: options.sh_direction.unwrap_or_default(),
                spatial_lr_scale,
                near,
                ..TrainedWith::default()
            },
            playback: PlaybackHints {
                up: options.up.unwrap_or(self.up),
                duration_seconds: options.duration_seconds.unwrap_or(self.duration_seconds),
            },
            levels: Vec::new(),
            sockets: Vec::new(),
            colliders: None,
            sound: None,
            chunks: None,
        };
        scene.check().map_err(ImportError::damaged)?;
        Ok(scene)
    }
}

impl Columns {
    /// Returns empty columns with space for `count` Gaussians of this degree of color.
    pub(crate) fn with_capacity(count: usize, degree: u32) -> Self {
        let coefficients = (degree as usize + 1).pow(2);
        Self {
            mean: Vec::with_capacity(count),
            log_scale: Vec::with_capacity(count),
            rotation: Vec::with_capacity(count),
            opacity_logit: Vec::with_capacity(count),
            harmonics: Harmonics {
                coefficients,
                degree,
                degree_t: 0,
                values: Vec::with_capacity(count * coefficients * 3),
            },
            motion: Vec::new(),
            filter: None,
            origin: [0.0; 3],
            mip_filter: false,
        }
    }

    /// Appends Gaussians at rest. The lower degree of color is raised to the other.
    pub(crate) fn append(&mut self, mut other: Self) {
        let degree = self.harmonics.degree.max(other.harmonics.degree);
        raise(&mut self.harmonics, degree);
        raise(&mut other.harmonics, degree);
        self.mean.append(&mut other.mean);
        self.log_scale.append(&mut other.log_scale);
        self.rotation.append(&mut other.rotation);
        self.opacity_logit.append(&mut other.opacity_logit);
        self.harmonics.values.append(&mut other.harmonics.values);
    }

    /// Returns the number of Gaussians.
    pub(crate) fn len(&self) -> usize {
        self.mean.len()
    }

    /// Converts to a scene. Gaussians at rest without a filter get the trained form, others the sliced form.
    ///
    /// # Errors
    /// Invalid options; a moving Gaussian that cannot be drawn; columns of different lengths.
    pub(crate) fn into_scene(self, played: Played, options: &ReadOptions) -> Result<GaussianScene, ImportError> {
        options.check()?;
        let count = self.len();
        let lengths = [self.log_scale.len(), self.rotation.len(), self.opacity_logit.len()];
        let has_motion = !self.motion.is_empty();
        if lengths.iter().any(|&length| length != count)
            || (has_motion && self.motion.len() != count)
            || !self.harmonics.is_consistent(count)
        {
            return Err(ImportError::damaged("its attributes have different numbers of Gaussians"));
        }
        let Self { mean, log_scale, rotation, opacity_logit, harmonics, motion, filter, origin, mip_filter } = self;
        let parameters = Parameters { mean, log_scale, rotation_l: rotation, opacity_logit, ..Parameters::default() };
        let form = if has_motion || filter.is_some() {
            let mut gaussians = parameters.slice(&SliceSettings::default())?;
            for (index, (gaussian, own)) in gaussians.iter_mut().zip(&motion).enumerate() {
                let Motion { velocity, mean_t, sigma_t } = *own;
                *gaussian = Gaussian { velocity, mean_t, sigma_t, ..*gaussian };
                gaussian.check().map_err(|reason| InvalidGaussian { index, reason })?;
            }
            SceneForm::Ready(Form::Sliced(Sliced { gaussians, harmonics }))
        } else {
            SceneForm::Trained(Trained { parameters, harmonics })
        };
        let mut scene = played.scene(form, filter, options)?;
        (scene.trained_with.origin.place, scene.trained_with.mip_filter) = (origin, mip_filter);
        Ok(scene)
    }
}

/// Returns whether a scene is drawn with the filter of Mip-Splatting: if all of its parts were trained with it, of
/// which `filtered` of `all` were. If only some were, also returns a sentence that calls them `parts`.
pub(crate) fn mip_filter_of(filtered: usize, all: usize, parts: &str) -> (bool, Option<String>) {
    let is_mixed = filtered > 0 && filtered < all;
    let sentence = format!(
        "{filtered} of {all} {parts} were trained with the filter of Mip-Splatting, which is drawn only if all were: their fine detail is \
         slightly thicker."
    );
    (filtered > 0 && filtered == all, is_mixed.then_some(sentence))
}

/// Raises a degree of color; the new coefficients are 0.
fn raise(harmonics: &mut Harmonics, degree: u32) {
    if harmonics.degree == degree {
        return;
    }
    let (from, to) = (harmonics.coefficients * 3, (degree as usize + 1).pow(2) * 3);
    let mut values = vec![0.0; harmonics.values.len() / from * to];
    for (to, from) in values.chunks_exact_mut(to).zip(harmonics.values.chunks_exact(from)) {
        to[..from.len()].copy_from_slice(from);
    }
    *harmonics = Harmonics { coefficients: to / 3, degree, degree_t: 0, values };
}

/// Returns the logit of an opacity. 0 and 1 become the nearest values with a finite logit, which are drawn alike.
pub(crate) fn logit(opacity: f32) -> f32 {
    let opacity = f64::from(opacity).clamp(1e-7, 1.0 - 1e-7);
    (opacity / (1.0 - opacity)).ln() as f32
}

/// Returns the opacity of a logit.
pub(crate) fn sigmoid(logit: f32) -> f32 {
    1.0 / (1.0 + (-logit).exp())
}

/// The factor of the coefficient of degree 0: 1 / (2 √π).
pub(crate) const SH_C0: f32 = 0.282_094_8;

/// Returns the coefficient of degree 0 of a color channel from 0 to 1.
pub(crate) fn coefficient(channel: f32) -> f32 {
    (channel - 0.5) / SH_C0
}
