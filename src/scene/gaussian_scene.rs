//! A capture in memory, as it is stored.
//!
//! In: the result of a codec. Out: a [`GaussianScene`], checked.

use super::chunk_table::ChunkTable;
use super::collider::Colliders;
use super::environment::Environment;
use super::filter::TemporalFilter;
use super::form::{Form, SceneForm};
use super::provenance::{PlaybackHints, TrainedWith};
use super::runtime_scene::{Level, RuntimeScene, check_around, check_levels};
use super::socket::{Socket, check_sockets};
use super::sound_file::SoundFile;
use crate::gaussian::Model;
use std::sync::Arc;

/// A capture in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct GaussianScene {
    /// The Gaussians and their color.
    pub form: SceneForm,
    /// The environment map, if the capture has one.
    pub environment: Option<Environment>,
    /// The Gaussians that are active in each segment of time; all if `None`.
    pub filter: Option<TemporalFilter>,
    /// The settings it was trained with, which drawing must repeat.
    pub trained_with: TrainedWith,
    /// How it is meant to be played.
    pub playback: PlaybackHints,
    /// Levels of detail, which have fewer Gaussians, finest first; usually none.
    pub levels: Vec<Level>,
    /// Named points that follow a part of the capture; usually none. Levels of detail have none.
    pub sockets: Vec<Socket>,
    /// Meshes of the solid parts; usually none. Levels of detail have none. Shared, because they do not change.
    pub colliders: Option<Arc<Colliders>>,
    /// The sound that is played beside the picture; usually none. Levels of detail have none. Shared, likewise.
    pub sound: Option<Arc<SoundFile>>,
    /// The chunk files that have its Gaussians; `None` for every capture but the index of one in chunk files.
    pub chunks: Option<Arc<ChunkTable>>,
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

    /// Returns the scene in the form that `ready` makes of its own; all other parts stay.
    ///
    /// # Errors
    /// Those of `ready`.
    pub(crate) fn into_ready<E>(self, ready: impl FnOnce(SceneForm) -> Result<Form, E>) -> Result<RuntimeScene, E> {
        Ok(RuntimeScene {
            form: ready(self.form)?,
            environment: self.environment,
            filter: self.filter,
            trained_with: self.trained_with,
            playback: self.playback,
            levels: self.levels,
            sockets: self.sockets,
            colliders: self.colliders,
            sound: self.sound,
            chunks: self.chunks,
        })
    }

    /// Checks that its parts fit together, as [`RuntimeScene::check`] does.
    ///
    /// # Errors
    /// A description of the first part that does not fit.
    pub fn check(&self) -> Result<(), &'static str> {
        self.form.check_parts()?;
        check_around(self.len(), self.filter.as_ref(), self.environment.as_ref())?;
        check_sockets(&self.sockets)?;
        self.colliders.as_deref().map_or(Ok(()), Colliders::check)?;
        self.sound.as_deref().map_or(Ok(()), SoundFile::check)?;
        self.chunks.as_deref().map_or(Ok(()), ChunkTable::check)?;
        check_levels(&self.levels, &self.trained_with, self.environment.is_some())
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
            levels: scene.levels,
            sockets: scene.sockets,
            colliders: scene.colliders,
            sound: scene.sound,
            chunks: scene.chunks,
        }
    }
}
