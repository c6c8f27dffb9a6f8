//! A capture in memory: its Gaussians and their color, an environment map, and how it was trained and is played.
//!
//! In: the result of a codec. Out: a [`GaussianScene`] that can be stored, or a [`RuntimeScene`] that can be drawn,
//! which [`into_runtime`](GaussianScene::into_runtime) returns. They differ in the [forms](SceneForm) that their
//! Gaussians may have.

mod bounds;
pub(crate) mod detail;
mod environment;
mod filter;
mod form;
pub mod grow;
pub mod packed;
pub mod pick;
mod provenance;
pub(crate) mod random;
pub mod synth;

pub use bounds::{Bounds, BoundsOverTime};
pub use detail::{Level, MAX_LEVELS, pixels_across};
pub use environment::Environment;
pub use filter::{ActiveSets, FilterKind, MAX_SEGMENTS, TemporalFilter, segment_of};
pub use form::{ColorDegrees, Form, SceneForm, Sliced, Trained};
pub use packed::{CodedColors, PackedColors, PackedScene};
pub use pick::{Pick, PickSettings};
pub use provenance::{PlaybackHints, RotationConvention, TrainedCameras, TrainedWith, UpAxis};

use crate::gaussian::{Gaussian, Harmonics, InvalidGaussian, Model, SliceSettings};
use crate::view::Background;
use detail::check_levels;
use glam::Vec3;

/// A capture in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct GaussianScene {
    /// The Gaussians and their color.
    pub form: SceneForm,
    /// The environment map, if the capture has one.
    pub environment: Option<Environment>,
    /// Which Gaussians are active in each segment of time; if `None`, all are.
    pub filter: Option<TemporalFilter>,
    /// The switches it was trained with, which drawing must repeat.
    pub trained_with: TrainedWith,
    /// How it is meant to be played.
    pub playback: PlaybackHints,
    /// The same capture of fewer Gaussians each, finest first; usually none.
    pub levels: Vec<Level>,
}

/// A scene ready to draw.
#[derive(Debug, Clone, PartialEq)]
pub struct RuntimeScene {
    /// The Gaussians and their color.
    pub form: Form,
    /// The environment map, if the capture has one.
    pub environment: Option<Environment>,
    /// Which Gaussians are active in each segment of time; if `None`, all are.
    pub filter: Option<TemporalFilter>,
    /// The switches it was trained with.
    pub trained_with: TrainedWith,
    /// How it is meant to be played.
    pub playback: PlaybackHints,
    /// The same capture of fewer Gaussians each, finest first; usually none.
    pub levels: Vec<Level>,
}

impl GaussianScene {
    /// Returns the number of Gaussians.
    pub fn len(&self) -> usize {
        self.form.len()
    }

    /// Returns whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.form.is_empty()
    }

    /// Returns the model of the trained form; `None` for the other forms, which do not contain it.
    pub fn model(&self) -> Option<Model> {
        self.form.model()
    }

    /// Returns the scene with packed Gaussians decoded to the sliced form; other forms are returned unchanged.
    /// Quantization errors remain.
    pub fn unpacked(self) -> Self {
        let form = match self.form {
            SceneForm::Ready(Form::Packed(packed)) => SceneForm::Ready(Form::Sliced(packed.unpack())),
            form @ (SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_))) => form,
        };
        Self { form, ..self }
    }

    /// Checks that its parts fit together, as [`RuntimeScene::check`] does.
    ///
    /// # Errors
    /// A description of what does not fit.
    pub fn check(&self) -> Result<(), &'static str> {
        self.form.check_parts()?;
        check_around(self.len(), self.filter.as_ref(), self.environment.as_ref())?;
        check_levels(&self.levels, &self.trained_with, self.environment.is_some())
    }

    /// Converts the scene for drawing: slices the Gaussians if they are in the trained form. Colors are moved, not
    /// copied.
    ///
    /// # Errors
    /// The first Gaussian that cannot be drawn, or has a color coefficient that is not finite.
    pub fn into_runtime(self) -> Result<RuntimeScene, InvalidGaussian> {
        let prefilter_var = self.trained_with.prefilter_var;
        self.into_runtime_with(&SliceSettings { prefilter_var, ..SliceSettings::default() })
    }

    /// Converts as [`into_runtime`](Self::into_runtime) does, with slice settings other than the scene's own. They
    /// apply to the trained form only.
    ///
    /// # Errors
    /// The first Gaussian that cannot be drawn, or has a color coefficient that is not finite.
    pub fn into_runtime_with(self, settings: &SliceSettings) -> Result<RuntimeScene, InvalidGaussian> {
        Ok(RuntimeScene {
            form: self.form.into_ready(settings)?,
            environment: self.environment,
            filter: self.filter,
            trained_with: self.trained_with,
            playback: self.playback,
            levels: self.levels.into_iter().map(Level::into_runtime).collect::<Result<_, _>>()?,
        })
    }
}

impl RuntimeScene {
    /// Creates a scene of sliced Gaussians and their color, without environment map and filter, with default
    /// [`TrainedWith`] and [`PlaybackHints`].
    pub fn sliced(gaussians: Vec<Gaussian>, harmonics: Harmonics) -> Self {
        Self {
            form: Form::Sliced(Sliced { gaussians, harmonics }),
            environment: None,
            filter: None,
            trained_with: TrainedWith::default(),
            playback: PlaybackHints::default(),
            levels: Vec::new(),
        }
    }

    /// Returns the number of Gaussians.
    pub fn len(&self) -> usize {
        self.form.len()
    }

    /// Returns whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.form.is_empty()
    }

    /// Returns one Gaussian, decoded if it is packed.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn gaussian(&self, index: usize) -> Gaussian {
        self.form.gaussian(index)
    }

    /// Returns all Gaussians in order.
    pub fn iter(&self) -> impl Iterator<Item = Gaussian> + '_ {
        self.form.iter()
    }

    /// Returns the color of one Gaussian seen along the unit vector `direction` from the camera, with
    /// `tau = mean_t − time`; see [`Harmonics::color`].
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn color(&self, index: usize, direction: Vec3, tau: f32) -> Vec3 {
        self.form.color(index, direction, tau, self.trained_with.time_span())
    }

    /// Checks that its parts fit together, as those of every loaded scene do: lengths, codes, the temporal filter, the
    /// levels of detail, and that the environment map is finite. Then nothing is read beyond them, here or on a GPU.
    ///
    /// # Errors
    /// A description of what does not fit.
    pub fn check(&self) -> Result<(), &'static str> {
        self.form.check_parts()?;
        check_around(self.len(), self.filter.as_ref(), self.environment.as_ref())?;
        check_levels(&self.levels, &self.trained_with, self.environment.is_some())
    }

    /// Returns the background that the capture was trained with: its environment map if it has one, else its color.
    pub fn trained_background(&self) -> Background {
        match self.environment {
            Some(_) => Background::Environment,
            None => Background::Color(self.trained_with.background),
        }
    }

    /// Returns the bytes of Gaussians and colors in memory.
    pub fn size(&self) -> usize {
        self.form.size()
    }
}

/// Checks the parts of a scene of `count` Gaussians beside its form.
fn check_around(
    count: usize,
    filter: Option<&TemporalFilter>,
    environment: Option<&Environment>,
) -> Result<(), &'static str> {
    filter.map_or(Ok(()), |filter| filter.check(count))?;
    environment.map_or(Ok(()), Environment::check)
}

impl From<RuntimeScene> for GaussianScene {
    fn from(scene: RuntimeScene) -> Self {
        Self {
            form: SceneForm::Ready(scene.form),
            environment: scene.environment,
            filter: scene.filter,
            trained_with: scene.trained_with,
            playback: scene.playback,
            levels: scene.levels,
        }
    }
}
