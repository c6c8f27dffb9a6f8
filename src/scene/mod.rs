//! What a capture is: Gaussians in one of two forms, colour, environment map, and how it was trained and is played.
//!
//! In: a codec's result. Out: a [`GaussianScene`] that can be stored, or taken apart with
//! [`into_runtime`](GaussianScene::into_runtime) for drawing.

mod bounds;
mod environment;
mod filter;
pub mod packed;
pub mod pick;
mod provenance;
pub mod synth;

pub use bounds::{Bounds, BoundsOverTime};
pub use environment::Environment;
pub use filter::{ActiveSets, FilterKind, MAX_SEGMENTS, TemporalFilter, segment_of};
pub use packed::{CodedColors, PackedScene};
pub use pick::{Pick, PickSettings};
pub use provenance::{PlaybackHints, RotationConvention, TrainedCameras, TrainedWith, UpAxis};

use crate::gaussian::{Gaussian, Harmonics, InvalidGaussian, Model, Parameters, SliceSettings};
use crate::view::Background;
use glam::Vec3;

/// A capture in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct GaussianScene {
    /// The Gaussians, colour aside.
    pub form: Form,
    /// Their colour; empty where the packed form holds it.
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
    /// Sliced and quantized: smallest, drawn as it is.
    Packed(PackedScene),
}

/// A scene ready to draw: the runtime form and what drawing needs beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct RuntimeScene {
    /// The Gaussians, sliced; empty where they are packed.
    pub gaussians: Vec<Gaussian>,
    /// The Gaussians, packed.
    pub packed: Option<PackedScene>,
    /// Their colour; empty where the packed form holds it.
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
            Form::Packed(packed) => packed.len(),
        }
    }

    /// Whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The model of the trained form; the others no longer tell.
    pub fn model(&self) -> Option<Model> {
        match &self.form {
            Form::Trained(parameters) => Some(parameters.model()),
            Form::Runtime(_) | Form::Packed(_) => None,
        }
    }

    /// The scene with its Gaussians in the runtime form if they were packed; as it is otherwise. What packing lost stays lost.
    pub fn unpacked(mut self) -> Self {
        if let Form::Packed(packed) = &self.form {
            let (gaussians, harmonics) = packed.unpack();
            self.harmonics = harmonics.unwrap_or(self.harmonics);
            self.form = Form::Runtime(gaussians);
        }
        self
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
        let mut packed = None;
        let gaussians = match self.form {
            Form::Trained(parameters) => parameters.slice(settings)?,
            Form::Packed(scene) => {
                scene.check().map_err(|reason| InvalidGaussian { index: 0, reason })?;
                packed = Some(scene);
                Vec::new()
            }
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
            packed,
            harmonics: self.harmonics,
            environment: self.environment,
            filter: self.filter,
            trained_with: self.trained_with,
            playback: self.playback,
        })
    }
}

impl RuntimeScene {
    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.packed.as_ref().map_or(self.gaussians.len(), PackedScene::len)
    }

    /// Whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One Gaussian, decoded if need be; panics beyond the end, as a slice does.
    pub fn gaussian(&self, index: usize) -> Gaussian {
        self.packed.as_ref().map_or_else(|| self.gaussians[index], |packed| packed.gaussian(index))
    }

    /// All Gaussians in order.
    pub fn iter(&self) -> impl Iterator<Item = Gaussian> + '_ {
        (0..self.len()).map(|index| self.gaussian(index))
    }

    /// Colours by codebook, if it has them.
    pub fn coded_colors(&self) -> Option<&CodedColors> {
        self.packed.as_ref().and_then(|packed| packed.colors.as_ref())
    }

    /// Colour of one Gaussian in the unit vector `direction` from the camera, with `tau = mean_t − time`; see [`Harmonics::color`].
    pub fn color(&self, index: usize, direction: Vec3, tau: f32) -> Vec3 {
        let span = self.trained_with.time_span();
        match &self.packed {
            Some(packed) if packed.colors.is_some() => packed.color(index, direction, tau, span),
            _ => self.harmonics.color(index, direction, tau, span),
        }
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
        if self.coded_colors().is_none() && !self.harmonics.is_consistent(self.len()) {
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

    /// The background that the capture was trained with: its environment map if it has one, else its colour.
    pub fn trained_background(&self) -> Background {
        match self.environment {
            Some(_) => Background::Environment,
            None => Background::Color(self.trained_with.background),
        }
    }

    /// Bytes of Gaussians and colours in memory.
    pub fn size(&self) -> usize {
        let packed = self.packed.as_ref().map_or(0, PackedScene::size);
        size_of_val(self.gaussians.as_slice()) + size_of_val(self.harmonics.values.as_slice()) + packed
    }
}

impl From<RuntimeScene> for GaussianScene {
    fn from(scene: RuntimeScene) -> Self {
        Self {
            form: scene.packed.map_or(Form::Runtime(scene.gaussians), Form::Packed),
            harmonics: scene.harmonics,
            environment: scene.environment,
            filter: scene.filter,
            trained_with: scene.trained_with,
            playback: scene.playback,
        }
    }
}
