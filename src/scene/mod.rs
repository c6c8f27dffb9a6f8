//! What a capture is: its Gaussians and their color, an environment map, and how it was trained and is played.
//!
//! In: a codec's result. Out: a [`GaussianScene`] that can be stored, or a [`RuntimeScene`] that can be drawn, which
//! [`into_runtime`](GaussianScene::into_runtime) makes of it. They differ in the [forms](SceneForm) that their Gaussians may have.

mod bounds;
mod environment;
mod filter;
mod form;
pub mod packed;
pub mod pick;
mod provenance;
pub mod synth;

pub use bounds::{Bounds, BoundsOverTime};
pub use environment::Environment;
pub use filter::{ActiveSets, FilterKind, MAX_SEGMENTS, TemporalFilter, segment_of};
pub use form::{ColorDegrees, Form, SceneForm, Sliced, Trained};
pub use packed::{CodedColors, PackedColors, PackedScene};
pub use pick::{Pick, PickSettings};
pub use provenance::{PlaybackHints, RotationConvention, TrainedCameras, TrainedWith, UpAxis};

use crate::gaussian::{Gaussian, Harmonics, InvalidGaussian, Model, SliceSettings};
use crate::view::Background;
use glam::Vec3;

/// A capture in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct GaussianScene {
    /// The Gaussians and their color.
    pub form: SceneForm,
    /// The environment map, if the capture has one.
    pub environment: Option<Environment>,
    /// Which Gaussians are active when; without one, all are.
    pub filter: Option<TemporalFilter>,
    /// The switches it was trained with, which drawing must repeat.
    pub trained_with: TrainedWith,
    /// How it is meant to be played.
    pub playback: PlaybackHints,
}

/// A scene ready to draw.
#[derive(Debug, Clone, PartialEq)]
pub struct RuntimeScene {
    /// The Gaussians and their color.
    pub form: Form,
    /// The environment map, if the capture has one.
    pub environment: Option<Environment>,
    /// Which Gaussians are active when; without one, all are.
    pub filter: Option<TemporalFilter>,
    /// The switches it was trained with.
    pub trained_with: TrainedWith,
    /// How it is meant to be played.
    pub playback: PlaybackHints,
}

impl GaussianScene {
    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.form.len()
    }

    /// Whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.form.is_empty()
    }

    /// The model of the trained form; `None` for the others, which no longer show it.
    pub fn model(&self) -> Option<Model> {
        self.form.model()
    }

    /// The scene with its Gaussians sliced if they were packed; as it is otherwise. What packing lost stays lost.
    pub fn unpacked(self) -> Self {
        let form = match self.form {
            SceneForm::Ready(Form::Packed(packed)) => SceneForm::Ready(Form::Sliced(packed.unpack())),
            form @ (SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_))) => form,
        };
        Self { form, ..self }
    }

    /// Slices the Gaussians (if they are not yet) and hands everything over for drawing. Color is moved, not copied.
    ///
    /// # Errors
    /// The first Gaussian that cannot be drawn.
    pub fn into_runtime(self) -> Result<RuntimeScene, InvalidGaussian> {
        let prefilter_var = self.trained_with.prefilter_var;
        self.into_runtime_with(&SliceSettings { prefilter_var, ..SliceSettings::default() })
    }

    /// As [`into_runtime`](Self::into_runtime), with slice settings other than the scene's own.
    ///
    /// # Errors
    /// The first Gaussian that cannot be drawn.
    pub fn into_runtime_with(self, settings: &SliceSettings) -> Result<RuntimeScene, InvalidGaussian> {
        Ok(RuntimeScene {
            form: self.form.into_ready(settings)?,
            environment: self.environment,
            filter: self.filter,
            trained_with: self.trained_with,
            playback: self.playback,
        })
    }
}

impl RuntimeScene {
    /// A scene of sliced Gaussians and their color, without an environment map and a filter, trained and played by default.
    pub fn sliced(gaussians: Vec<Gaussian>, harmonics: Harmonics) -> Self {
        Self {
            form: Form::Sliced(Sliced { gaussians, harmonics }),
            environment: None,
            filter: None,
            trained_with: TrainedWith::default(),
            playback: PlaybackHints::default(),
        }
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.form.len()
    }

    /// Whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.form.is_empty()
    }

    /// One Gaussian, decoded if need be; panics beyond the end, as a slice does.
    pub fn gaussian(&self, index: usize) -> Gaussian {
        self.form.gaussian(index)
    }

    /// All Gaussians in order.
    pub fn iter(&self) -> impl Iterator<Item = Gaussian> + '_ {
        self.form.iter()
    }

    /// Color of one Gaussian in the unit vector `direction` from the camera, with `tau = mean_t − time`; see [`Harmonics::color`].
    pub fn color(&self, index: usize, direction: Vec3, tau: f32) -> Vec3 {
        self.form.color(index, direction, tau, self.trained_with.time_span())
    }

    /// Whether its parts fit together, as those of every scene that was loaded do.
    ///
    /// # Errors
    /// What does not fit.
    pub fn check(&self) -> Result<(), &'static str> {
        let fits = |filter: &TemporalFilter| {
            filter.count == self.len()
                && (1..=MAX_SEGMENTS).contains(&filter.segments)
                && match &filter.sets {
                    ActiveSets::Bits(bits) => {
                        bits.len() == TemporalFilter::words(filter.count) * filter.segments as usize
                    }
                    ActiveSets::Intervals(intervals) => intervals.len() == filter.count,
                }
        };
        if !self.filter.as_ref().is_none_or(fits) {
            return Err("its temporal filter is that of another number of Gaussians");
        }
        if !self.form.harmonics().is_none_or(|harmonics| harmonics.is_consistent(self.len())) {
            return Err("its colours are those of another number of Gaussians");
        }
        let covers = |map: &Environment| {
            let texels = (map.width as usize).checked_mul(map.height as usize).and_then(|texels| texels.checked_mul(3));
            map.width > 0 && map.height > 0 && texels == Some(map.texels.len())
        };
        if !self.environment.as_ref().is_none_or(covers) {
            return Err("its environment map has another number of texels");
        }
        Ok(())
    }

    /// The background that the capture was trained with: its environment map if it has one, else its color.
    pub fn trained_background(&self) -> Background {
        match self.environment {
            Some(_) => Background::Environment,
            None => Background::Color(self.trained_with.background),
        }
    }

    /// Bytes of Gaussians and colors in memory.
    pub fn size(&self) -> usize {
        self.form.size()
    }
}

impl From<RuntimeScene> for GaussianScene {
    fn from(scene: RuntimeScene) -> Self {
        Self {
            form: SceneForm::Ready(scene.form),
            environment: scene.environment,
            filter: scene.filter,
            trained_with: scene.trained_with,
            playback: scene.playback,
        }
    }
}
