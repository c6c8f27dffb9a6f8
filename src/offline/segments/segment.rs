//! A segment of a long capture.
//!
//! In: a capture, and the path that it was read from. Out: [`Segment`], whose path names it in errors.

use super::error::{SegmentsError, Shared};
use crate::offline::work::FileError;
use crate::scene::{Form, GaussianScene, SceneForm};
use std::error::Error;
use std::path::PathBuf;

/// A capture of a stretch of time, or a chunk of a capture.
#[derive(Debug, Clone)]
pub struct Segment {
    /// The file or the folder that it was read from.
    pub path: PathBuf,
    /// The capture.
    pub scene: GaussianScene,
}

impl Segment {
    /// Returns an error about the segment.
    pub(super) fn at(&self, reason: impl Error + Send + Sync + 'static) -> SegmentsError {
        FileError::at(&self.path, reason).into()
    }

    /// Returns the error that something is not that of the first segment.
    pub(super) fn differs(&self, first: &Self, what: Shared) -> SegmentsError {
        SegmentsError::Differs { path: self.path.clone(), first: first.path.clone(), what }
    }

    /// Returns whether it is packed in the order of chunk files.
    pub fn has_runs(&self) -> bool {
        matches!(&self.scene.form, SceneForm::Ready(Form::Packed(packed)) if packed.runs.is_some())
    }

    /// Checks that Gaussians can be cut and joined without rounding them again.
    pub(super) fn require_unpacked(&self) -> Result<(), SegmentsError> {
        match &self.scene.form {
            SceneForm::Ready(Form::Packed(_)) => Err(SegmentsError::Packed { path: self.path.clone() }),
            SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_)) => Ok(()),
        }
    }
}
