//! A scene with some of its Gaussians.
//!
//! In: a scene of any form, the indices of the Gaussians that it keeps. Out: the same scene with these alone: their
//! values, color and part of the temporal filter keep their bits.

use super::form::{Form, SceneForm, Trained};
use super::gaussian_scene::GaussianScene;
use super::sliced::Sliced;
use crate::gaussian::Parameters;

impl GaussianScene {
    /// Returns the scene with only the Gaussians at these indices, in this order, without levels of detail. A packed
    /// scene stays packed: the indices are then ascending, and the blocks that lose Gaussians are filled with invisible
    /// ones, so that the scene may have more than `keep` names.
    ///
    /// # Panics
    /// If an index is not below the length of the scene.
    pub(crate) fn select(&self, keep: &[u32]) -> Self {
        let filter = |keep: &[u32]| self.filter.as_ref().map(|filter| filter.select(keep));
        let (form, filter) = match &self.form {
            SceneForm::Trained(Trained { parameters, harmonics }) => {
                let parameters = select_parameters(parameters, keep);
                (SceneForm::Trained(Trained { parameters, harmonics: harmonics.select(keep) }), filter(keep))
            }
            SceneForm::Ready(Form::Sliced(Sliced { gaussians, harmonics })) => {
                let sliced = Sliced { gaussians: rows(gaussians, keep), harmonics: harmonics.select(keep) };
                (SceneForm::Ready(Form::Sliced(sliced)), filter(keep))
            }
            SceneForm::Ready(Form::Packed(packed)) => {
                let (packed, order) = packed.select(keep);
                (SceneForm::Ready(Form::Packed(packed)), filter(&order))
            }
        };
        Self {
            form,
            environment: self.environment.clone(),
            filter,
            trained_with: self.trained_with.clone(),
            playback: self.playback,
            levels: Vec::new(),
            sockets: self.sockets.clone(),
            colliders: self.colliders.clone(),
            sound: self.sound.clone(),
            chunks: None,
        }
    }
}

fn select_parameters(parameters: &Parameters, keep: &[u32]) -> Parameters {
    Parameters {
        mean: rows(&parameters.mean, keep),
        mean_t: rows(&parameters.mean_t, keep),
        log_scale: rows(&parameters.log_scale, keep),
        log_scale_t: rows(&parameters.log_scale_t, keep),
        rotation_l: rows(&parameters.rotation_l, keep),
        rotation_r: rows(&parameters.rotation_r, keep),
        opacity_logit: rows(&parameters.opacity_logit, keep),
    }
}

/// Returns these rows of an attribute; an attribute that the model does not have stays empty.
fn rows<T: Copy>(values: &[T], keep: &[u32]) -> Vec<T> {
    if values.is_empty() { Vec::new() } else { keep.iter().map(|&index| values[index as usize]).collect() }
}
