//! The trained form of scenes.
//!
//! In: a scene in the trained form. Out: its raw parameters and colors.

use bevy_gs4d::scene::{GaussianScene, SceneForm, Trained};

/// Returns the trained form of a scene.
pub fn trained(scene: &GaussianScene) -> &Trained {
    let SceneForm::Trained(trained) = &scene.form else { panic!("the scene is in the trained form") };
    trained
}

/// Returns the trained form of a scene, to be changed.
pub fn trained_mut(scene: &mut GaussianScene) -> &mut Trained {
    let SceneForm::Trained(trained) = &mut scene.form else { panic!("the scene is in the trained form") };
    trained
}
