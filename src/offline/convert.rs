//! The form and the colors that a scene is stored with.
//!
//! In: a scene, a target form, color degrees. Out: the scene in that form, with those degrees.

use super::OfflineError;
use crate::scene::{ColorDegrees, Form, GaussianScene, SceneForm};

/// A form to convert to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TargetForm {
    /// The trained form, which can be pruned and fine-tuned.
    Trained,
    /// The runtime form: smaller, with the same pictures.
    Runtime,
}

impl TargetForm {
    /// Every form with its name.
    pub const NAMES: [(&'static str, Self); 2] = [("trained", Self::Trained), ("runtime", Self::Runtime)];
}

/// What to change in a scene; `None` keeps what it has. Default: all `None`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ConvertSettings {
    /// Target form.
    pub form: Option<TargetForm>,
    /// Highest spatial degree of color to keep, 0 to 3.
    pub sh_degree: Option<u32>,
    /// Highest time degree of color to keep, 0 to 2.
    pub sh_degree_t: Option<u32>,
}

/// Converts a scene to the form and the color degrees of the settings. Levels of detail are dropped: they are of the scene as it was.
///
/// # Errors
/// [`OfflineError::NotTrained`] if a scene in the runtime or the packed form is to become the trained form; a Gaussian
/// that cannot be sliced.
pub fn convert(mut scene: GaussianScene, settings: &ConvertSettings) -> Result<GaussianScene, OfflineError> {
    scene.levels.clear();
    if settings.form == Some(TargetForm::Runtime) {
        scene = scene.unpacked();
    }
    let ColorDegrees { degree, degree_t, .. } = scene.form.color_degrees();
    scene.form.truncate_colors(settings.sh_degree.unwrap_or(degree), settings.sh_degree_t.unwrap_or(degree_t));
    match (settings.form, &scene.form) {
        (Some(TargetForm::Trained), SceneForm::Ready(_)) => Err(OfflineError::NotTrained),
        (Some(TargetForm::Runtime), SceneForm::Trained(_)) => Ok(scene.into_runtime()?.into()),
        _ => Ok(scene),
    }
}

/// Returns the name of a form.
pub(crate) fn form_name(form: &SceneForm) -> &'static str {
    match form {
        SceneForm::Trained(_) => "trained",
        SceneForm::Ready(Form::Sliced(_)) => "runtime",
        SceneForm::Ready(Form::Packed(_)) => "packed",
    }
}
