//! Why a scene cannot be trained.
//!
//! In: the form of a scene, training views. Out: the reason in words, if there is one.

use crate::offline::dataset::TrainingView;
use crate::scene::SceneForm;

/// Returns why a scene of this form cannot be trained on these views; `None` if it can be.
pub(crate) fn obstacle(form: &SceneForm, views: &[TrainingView]) -> Option<String> {
    if !matches!(form, SceneForm::Trained(_)) {
        return Some("the scene is not in the trained form".to_owned());
    }
    let missing = views.iter().find(|view| !view.image.is_file())?;
    Some(format!("{} is missing", missing.image.display()))
}
