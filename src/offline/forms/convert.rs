//! Conversion of a scene to another form or to lower color degrees.
//!
//! In: a scene, a target form, color degrees. Out: the scene in that form, with those degrees.

use super::FormError;
use crate::scene::merge_neighbors::merge_neighbors;
use crate::scene::{ColorDegrees, Form, GaussianScene, SceneForm, TemporalFilter};

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

/// Changes of a scene; `None` keeps the form or the degree. Default: all `None`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ConvertSettings {
    /// Target form.
    pub form: Option<TargetForm>,
    /// Highest spatial degree of color to keep, 0 to 3.
    pub sh_degree: Option<u32>,
    /// Highest time degree of color to keep, 0 to 2.
    pub sh_degree_t: Option<u32>,
    /// Merge Gaussians of consecutive frames that differ by at most this part of their scales, opacities and colors; 0
    /// merges equal ones.
    pub merge: Option<f32>,
}

/// Converts a scene to the form and the color degrees of the settings. Levels of detail are dropped, since they were
/// made from the unconverted scene.
///
/// # Errors
/// [`FormError::NotTrained`] if a scene in the runtime or the packed form is converted to the trained form; a Gaussian
/// that cannot be sliced.
pub fn convert(mut scene: GaussianScene, settings: &ConvertSettings) -> Result<GaussianScene, FormError> {
    scene.levels.clear();
    if settings.form == Some(TargetForm::Runtime) {
        scene = scene.unpacked();
    }
    let ColorDegrees { degree, degree_t, .. } = scene.form.color_degrees();
    scene.form.truncate_colors(settings.sh_degree.unwrap_or(degree), settings.sh_degree_t.unwrap_or(degree_t));
    if let Some(tolerance) = settings.merge {
        merge(&mut scene, tolerance)?;
    }
    match (settings.form, &scene.form) {
        (Some(TargetForm::Trained), SceneForm::Ready(_)) => Err(FormError::NotTrained),
        (Some(TargetForm::Runtime), SceneForm::Trained(_)) => Ok(scene.into_runtime()?.into()),
        _ => Ok(scene),
    }
}

/// Merges the Gaussians of consecutive frames that are alike within a tolerance; see [`ConvertSettings::merge`].
///
/// # Errors
/// [`FormError::NoFrames`] for a scene whose Gaussians have no windows of time, or that is packed.
pub(crate) fn merge(scene: &mut GaussianScene, tolerance: f32) -> Result<(), FormError> {
    let frames = scene.filter.as_ref().filter(|filter| filter.is_of_capture());
    let (SceneForm::Ready(Form::Sliced(sliced)), Some(filter)) = (&scene.form, frames) else {
        return Err(FormError::NoFrames);
    };
    let (merged, filter) = merge_neighbors(sliced, filter, tolerance).ok_or(FormError::NoFrames)?;
    (scene.form, scene.filter) = (SceneForm::Ready(Form::Sliced(merged)), Some(filter));
    Ok(())
}

/// Returns an error if the temporal filter of a scene is part of the capture, so that `what` would change it.
///
/// # Errors
/// [`FormError::Windows`].
pub(crate) fn require_no_windows(filter: Option<&TemporalFilter>, what: &'static str) -> Result<(), FormError> {
    match filter {
        Some(filter) if filter.is_of_capture() => Err(FormError::Windows { what }),
        _ => Ok(()),
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
