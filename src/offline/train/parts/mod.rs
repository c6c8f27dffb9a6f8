//! The optional parts of training, each of which adds its own passes to a step.
//!
//! In: a [`Request`] and the [`Workspace`] of a training. Out: [`Parts`], each a [`Part`]: commands before, between and
//! after the passes that every training has, and what each part adds to the state and to the scene.
//!
//! | file | part | asked for by |
//! |---|---|---|
//! | `environment` | an environment map behind the scene | a scene that has one |
//! | `exposure` | an exposure for each camera | [`exposure`](super::FineTuneSettings::exposure) |
//! | `codebooks` | colors as sums of entries of codebooks | the phase that trains codebooks |
//! | `rounding` | pictures of rounded geometry | the same phase, with [`rounding`](super::FineTuneSettings::rounding) |
//! | `mask` | the term of the loss against opacity outside the images | a weight of [`Terms`](super::Terms) |
//! | `regularizer` | the terms of the loss that depend on Gaussians alone | a weight of [`Terms`](super::Terms) |
//! | `dropout` | views without a random share of the Gaussians | [`Growth`](super::Growth) |
//! | `noise` | random motion of faint Gaussians | [`Growth`](super::Growth) |
//! | `standing` | Gaussians of a long life kept at rest | [`standing`](super::FineTuneSettings::standing) |
//! | `relocation` | the relocation of faded Gaussians | [`Growth`](super::Growth) |
//! | `cloning` | the densification of the original | [`Growth::cloning`](super::Growth::cloning) |
//!
//! A new part is its own file, its shader, and and here its `mod` and its lines in [`PARTS`] and [`PART_SHADERS`].

pub(crate) mod cloning;
pub(crate) mod codebooks;
mod dropout;
mod environment;
pub(crate) mod exposure;
mod mask;
mod moves;
mod noise;
mod part;
pub(crate) mod regularizer;
mod relocation;
pub(crate) mod request;
pub(crate) mod rounding;
pub(crate) mod standing;

pub(crate) use request::{Request, RoundingSettings};

use crate::offline::train::gpu::Workspace;
use crate::offline::train::trainer_error::TrainerError;
use crate::renderer::shaders::ShaderSet;
use part::Part;
use std::any::Any;

/// Makes a part; `None` if it is not asked for.
type Make = fn(&Workspace<'_>, &Request<'_>) -> Result<Option<Box<dyn Part>>, TrainerError>;

/// Every optional part, in the order of the passes of a step and of the buffers of a state.
const PARTS: [Make; 11] = [
    environment::TrainedEnvironment::make,
    exposure::TrainedExposures::make,
    codebooks::TrainedCodebooks::make,
    rounding::RoundedGeometry::make,
    mask::MaskTerm::make,
    regularizer::Regularizer::make,
    dropout::Dropout::make,
    noise::Noise::make,
    // After the noise, which moves Gaussians in time.
    standing::StandingGaussians::make,
    relocation::Relocation::make,
    cloning::Densifier::make,
];

/// The passes of the parts.
pub static PART_SHADERS: [&ShaderSet; 10] = [
    &environment::SHADERS,
    &exposure::SHADERS,
    &codebooks::SHADERS,
    &rounding::SHADERS,
    &regularizer::SHADERS,
    &dropout::SHADERS,
    &noise::SHADERS,
    &standing::SHADERS,
    &moves::SHADERS,
    &cloning::SHADERS,
];

/// The optional parts of a training, in the order of [`PARTS`].
#[derive(Debug)]
pub(crate) struct Parts([Option<Box<dyn Part>>; PARTS.len()]);

impl Default for Parts {
    fn default() -> Self {
        Self(PARTS.map(|_| None))
    }
}

impl Parts {
    /// Makes the parts that are asked for and that there are not yet.
    ///
    /// # Errors
    /// Those of a part: settings that contradict the scene, a shader that does not compile.
    pub(crate) fn add(&mut self, work: &Workspace<'_>, request: &Request<'_>) -> Result<(), TrainerError> {
        for (part, make) in self.0.iter_mut().zip(PARTS) {
            if part.is_none() {
                *part = make(work, request)?;
            }
        }
        Ok(())
    }

    /// Returns the parts.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &(dyn Part + 'static)> {
        self.0.iter().flatten().map(|part| &**part)
    }

    /// Returns the parts.
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut (dyn Part + 'static)> {
        self.0.iter_mut().flatten().map(|part| &mut **part)
    }

    /// Returns the part of this type.
    pub(crate) fn get<P: Part>(&self) -> Option<&P> {
        self.iter().find_map(|part| (part as &dyn Any).downcast_ref())
    }
}
