//! Free places for Gaussians, in training whose number of Gaussians changes: the buffers on the GPU have one size.
//!
//! In: a scene in the trained form. Out: the scene with free places up to its capacity, or without those that are left.

use crate::offline::prune::select::select;
use crate::offline::train::reference::cloning::FREE;
use crate::scene::{GaussianScene, SceneForm, Trained};

/// Returns the scene with free places behind its Gaussians, up to `capacity`. A scene without Gaussians, or in another
/// form, stays as it is.
pub(crate) fn with_places(scene: &GaussianScene, capacity: usize) -> GaussianScene {
    let count = scene.len();
    // A free place is a copy of the first Gaussian that is never drawn.
    let places: Vec<u32> = match count {
        0 => Vec::new(),
        count => (0..count as u32).chain((count..capacity).map(|_| 0)).collect(),
    };
    let mut scene = select(scene, &places);
    if let SceneForm::Trained(Trained { parameters, .. }) = &mut scene.form {
        parameters.opacity_logit.iter_mut().skip(count).for_each(|logit| *logit = FREE);
    }
    scene
}

/// Returns the scene without free places.
pub(crate) fn without_places(scene: GaussianScene) -> GaussianScene {
    let SceneForm::Trained(Trained { parameters, .. }) = &scene.form else { return scene };
    let logits = parameters.opacity_logit.iter().enumerate();
    let taken: Vec<u32> = logits.filter(|(_, logit)| **logit > FREE).map(|(index, _)| index as u32).collect();
    if taken.len() == parameters.len() { scene } else { select(&scene, &taken) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synth::{SynthSettings, synthesize};

    #[test]
    fn free_places_are_added_behind_the_gaussians_and_taken_away() {
        let scene = synthesize(&SynthSettings { count: 20, ..SynthSettings::default() });
        let larger = with_places(&scene, 50);
        assert_eq!(larger.len(), 50, "as many places as the capacity");
        larger.clone().into_runtime().expect("free places can be drawn");
        assert!(without_places(larger) == scene, "without them the scene is as before");
        assert!(with_places(&scene, 10) == scene, "no Gaussian is lost to a smaller capacity");
        let gone = with_places(&select(&scene, &[]), 50);
        assert_eq!(gone.len(), 0, "there is nothing to copy");
    }
}
