//! The offline half: from a trained checkpoint and its training views to a small, fast capture, with the loss of quality.
//!
//! In: a [`GaussianScene`], the views it was trained on, an [`Engine`](engine::Engine) that scores and draws them on
//! the GPU or the CPU. Out: a smaller scene, packages, pictures, measurements. Build scripts and editors can call every
//! function as the command does: functions report their [`Progress`] and return data.
//!
//! | module | what it does |
//! |---|---|
//! | [`dataset`], [`splits`] | reads views and divides them into training, validation and test views |
//! | [`belonging`] | checks that images show the capture |
//! | [`picture_file`] | decodes pictures for all other modules |
//! | [`engine`] | opens the GPU or the CPU reference |
//! | [`score`] | sums what every Gaussian contributes to the training views |
//! | [`prune`], [`prune_by_views`] | keeps the Gaussians of the highest scores |
//! | [`search`], [`trained_search`], [`quality`] | finds the best score and the smallest count that a loss allows |
//! | [`temporal_filter`] | finds the active Gaussians of each segment of time |
//! | [`fine_tune`](mod@fine_tune) | trains the remaining Gaussians, to compensate for the removed Gaussians |
//! | [`quantize`], [`convert`] | changes the form that a scene is stored in |
//! | [`detail`](mod@detail) | makes the same capture with fewer Gaussians, for pictures of few pixels |
//! | [`bake`](mod@bake), [`report`] | runs all steps in order, resumable, and writes a report |
//! | [`metrics`], [`evaluation`], [`fidelity`], [`comparison`] | measures how close pictures are |
//! | [`ablation`] | tabulates the loss by every score, ratio and filter |
//! | [`files`] | refuses outputs that are inputs or cannot be written, before anything is computed |
//! | [`stages`], [`store`], [`stored`] | run stages and keep their results, from which interrupted work resumes |
//! | [`orbit`], [`render`] | draws a scene from all sides, many pictures at a time |

pub mod ablation;
pub mod bake;
pub mod belonging;
pub mod comparison;
pub mod convert;
pub mod dataset;
pub mod detail;
pub mod engine;
mod error;
pub mod evaluation;
pub mod fidelity;
pub mod files;
pub mod fine_tune;
mod memory_check;
pub mod metrics;
pub mod orbit;
mod package_size;
pub mod picture_file;
mod progress;
pub mod prune;
pub mod prune_by_views;
pub mod quality;
pub mod quantize;
pub mod render;
pub mod report;
mod save;
pub mod score;
pub mod search;
pub mod splits;
pub mod stages;
pub mod store;
pub mod stored;
mod subject;
pub mod temporal_filter;
mod temporary_file;
mod test_comparison;
mod trained_pixel;
pub mod trained_search;

pub use error::OfflineError;
pub use progress::{NoProgress, Progress};
pub use save::{save, write_beside, write_png, write_settings};
pub use subject::Subject;
pub use trained_pixel::trained_pixel;

use crate::gaussian::{Gaussian, InvalidGaussian, SliceSettings};
use crate::scene::{Form, GaussianScene, SceneForm, Trained};
use std::borrow::Cow;

/// Returns the Gaussians of a scene in the runtime form, without its color.
///
/// # Errors
/// The first Gaussian that cannot be drawn.
pub fn sliced(scene: &GaussianScene) -> Result<Cow<'_, [Gaussian]>, InvalidGaussian> {
    match &scene.form {
        SceneForm::Trained(Trained { parameters, .. }) => {
            let prefilter_var = scene.trained_with.prefilter_var;
            Ok(Cow::Owned(parameters.slice(&SliceSettings { prefilter_var, ..SliceSettings::default() })?))
        }
        SceneForm::Ready(Form::Sliced(sliced)) => Ok(Cow::Borrowed(&sliced.gaussians)),
        SceneForm::Ready(packed @ Form::Packed(_)) => Ok(Cow::Owned(packed.iter().collect())),
    }
}
