//! The form and the colors that a scene is stored with.
//!
//! In: a scene, the form wanted, color degrees. Out: the scene in that form.

use super::OfflineError;
use crate::scene::{Form, GaussianScene, SceneForm};

/// A form to convert to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TargetForm {
    /// Can be pruned and fine-tuned.
    Trained,
    /// Smaller, draws the same.
    Runtime,
}

impl TargetForm {
    /// Every form with its name.
    pub const NAMES: [(&'static str, Self); 2] = [("trained", Self::Trained), ("runtime", Self::Runtime)];
}

/// What is changed in a scene. `None` keeps what is there.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ConvertSettings {
    /// The form wanted.
    pub form: Option<TargetForm>,
    /// Highest spatial degree of color to keep, 0 to 3.
    pub sh_degree: Option<u32>,
    /// Highest time degree of color to keep, 0 to 2.
    pub sh_degree_t: Option<u32>,
}

/// The scene in the form and with the color degrees that the settings ask for.
///
/// # Errors
/// [`OfflineError::NotTrained`] if a sliced scene is to become the trained form; a Gaussian that cannot be sliced.
pub fn convert(mut scene: GaussianScene, settings: &ConvertSettings) -> Result<GaussianScene, OfflineError> {
    if settings.form == Some(TargetForm::Runtime) {
        scene = scene.unpacked();
    }
    if let Some(kept) = scene.form.harmonics_mut() {
        kept.truncate(settings.sh_degree.unwrap_or(kept.degree), settings.sh_degree_t.unwrap_or(kept.degree_t));
    }
    match (settings.form, &scene.form) {
        (Some(TargetForm::Trained), SceneForm::Ready(_)) => Err(OfflineError::NotTrained),
        (Some(TargetForm::Runtime), SceneForm::Trained(_)) => Ok(scene.into_runtime()?.into()),
        _ => Ok(scene),
    }
}

/// Name of a form.
pub fn form_name(form: &SceneForm) -> &'static str {
    match form {
        SceneForm::Trained(_) => "trained",
        SceneForm::Ready(Form::Sliced(_)) => "runtime",
        SceneForm::Ready(Form::Packed(_)) => "packed",
    }
}
