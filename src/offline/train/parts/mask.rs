//! The term of the loss against opacity where images cover nothing.
//!
//! In: its weight. Out: [`MaskTerm`], with which the pass `loss` adds the term. Its CPU reference is
//! [`opacity_mask`](crate::offline::train::reference::loss::opacity_mask).

use super::part::Part;
use super::request::Request;
use crate::offline::engine::layout::LossUniforms;
use crate::offline::train::gpu::Workspace;
use crate::offline::train::trainer_error::TrainerError;

/// The opacity mask of the original 4DGS: images without a background of their own say where nothing is.
#[derive(Debug)]
pub(super) struct MaskTerm {
    weight: f32,
}

impl MaskTerm {
    /// Makes the part if the term has a weight.
    pub(super) fn make(_: &Workspace<'_>, request: &Request<'_>) -> Result<Option<Box<dyn Part>>, TrainerError> {
        let weight = request.settings.terms.mask;
        if weight > 0.0 { Ok(Some(Box::new(Self { weight: weight as f32 }))) } else { Ok(None) }
    }
}

impl Part for MaskTerm {
    fn adjust_loss(&self, settings: &mut LossUniforms) {
        settings.mask_weight = self.weight;
    }
}
