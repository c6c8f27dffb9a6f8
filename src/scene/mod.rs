//! What a capture is: Gaussians in one of two forms, colour, environment map, and how it was trained and is played.
//!
//! In: a codec's result. Out: a [`GaussianScene`] that can be stored, or taken apart with
//! [`into_runtime`](GaussianScene::into_runtime) for drawing.

mod bounds;
mod environment;
mod filter;
mod provenance;
pub mod synth;

pub use bounds::Bounds;
pub use environment::Environment;
pub use filter::{ActiveSets, FilterKind, MAX_SEGMENTS, TemporalFilter, segment_of};
pub use provenance::{PlaybackHints, RotationConvention, TrainedCameras, TrainedWith, UpAxis};

use crate::gaussian::{Gaussian, Harmonics, InvalidGaussian, Model, Parameters, SliceSettings};

/// A capture in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct GaussianScene {
    /// The Gaussians, colour aside.
    pub form: Form,
    /// Their colour.
    pub harmonics: Harmonics,
    /// The environment map, if the capture has one.
    pub environment: Option<Environment>,
    /// Which Gaussians are active when; without one, all are.
    pub filter: Option<TemporalFilter>,
    /// The switches it was trained with, which drawing must repeat.
    pub trained_with: TrainedWith,
    /// How it is meant to be played.
    pub playback: PlaybackHints,
}

/// The two forms of the Gaussians of a scene.
#[derive(Debug, Clone, PartialEq)]
pub enum Form {
    /// As an optimiser stores them: can be scored, pruned and fine-tuned. Raw, capture space.
    Trained(Parameters),
    /// Sliced: smaller, ready to draw. Activated, capture space.
    Runtime(Vec<Gaussian>),
}

/// A scene ready to draw: the runtime form and what drawing needs beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct RuntimeScene {
    /// The Gaussians, sliced.
    pub gaussians: Vec<Gaussian>,
    /// Their colour.
    pub harmonics: Harmonics,
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
        match &self.form {
            Form::Trained(parameters) => parameters.len(),
            Form::Runtime(gaussians) => gaussians.len(),
        }
    }

    /// Whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The model of the trained form; a runtime form no longer tells.
    pub fn model(&self) -> Option<Model> {
        match &self.form {
            Form::Trained(parameters) => Some(parameters.model()),
            Form::Runtime(_) => None,
        }
    }

    /// Slices the Gaussians (if they are not yet) and hands everything over for drawing. Colour is moved, not copied.
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
        let gaussians = match self.form {
            Form::Trained(parameters) => parameters.slice(settings)?,
            Form::Runtime(gaussians) => {
                for (index, gaussian) in gaussians.iter().enumerate() {
                    gaussian.check().map_err(|reason| InvalidGaussian { index, reason })?;
                }
                gaussians
            }
        };
        if let Some(bad) = self.harmonics.values.iter().position(|v| !v.is_finite()) {
            let index = bad / (self.harmonics.coefficients * 3);
            return Err(InvalidGaussian { index, reason: "a colour coefficient that is not finite" });
        }
        Ok(RuntimeScene {
            gaussians,
            harmonics: self.harmonics,
            environment: self.environment,
            filter: self.filter,
            trained_with: self.trained_with,
            playback: self.playback,
        })
    }
}

impl From<RuntimeScene> for GaussianScene {
    fn from(scene: RuntimeScene) -> Self {
        Self {
            form: Form::Runtime(scene.gaussians),
            harmonics: scene.harmonics,
            environment: scene.environment,
            filter: scene.filter,
            trained_with: scene.trained_with,
            playback: scene.playback,
        }
    }
}
