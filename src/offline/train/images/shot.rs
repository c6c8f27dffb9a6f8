//! A view that is trained on, with its image.
//!
//! In: a training view, the size that is trained on. Out: the image at that size, from memory or from its file.

use super::reduced::reduced;
use crate::offline::dataset::{CoveredImage, DatasetError, TrainingView};
use crate::view::View;
use glam::UVec2;
use std::sync::Arc;

/// A view with its image, if that is in memory.
#[derive(Debug, Clone)]
pub(crate) struct Shot {
    /// The view, at the size that is trained on.
    pub view: View,
    pub name: String,
    /// The image, at that size or a larger one.
    pub image: Option<Arc<CoveredImage>>,
}

impl Shot {
    /// Returns the image of a view from its file, at this size.
    pub(super) fn read(view: &TrainingView, size: UVec2) -> Result<Arc<CoveredImage>, DatasetError> {
        let image = view.load_covered()?;
        Ok(Arc::new(if image.size == size { image } else { reduced(&image, size) }))
    }

    /// Returns whether the image is in memory at the size of the view.
    pub(super) fn is_ready(&self) -> bool {
        self.image.as_ref().is_some_and(|image| image.size == self.view.size)
    }

    /// Returns the image at the size of the view, from memory or from its file.
    pub(super) fn image(&self, view: &TrainingView) -> Result<Arc<CoveredImage>, DatasetError> {
        match &self.image {
            Some(image) if image.size == self.view.size => Ok(image.clone()),
            Some(image) => Ok(Arc::new(reduced(image, self.view.size))),
            None => Self::read(view, self.view.size),
        }
    }

    /// Returns the bytes of the image at the size of the view.
    pub(super) fn bytes(&self) -> u64 {
        bytes(self.view.size)
    }
}

/// Returns the bytes of an image of this size in memory.
pub(super) fn bytes(size: UVec2) -> u64 {
    size.as_u64vec2().element_product().saturating_mul(size_of::<[u8; 4]>() as u64)
}
