//! The note about pictures that are empty because everything before their cameras is nearer than the near limit.
//!
//! In: a scene, views of it, the counts of their pictures. Out: the note on standard error, if there is such a picture.

use super::note::note;
use crate::gaussian::Gaussian;
use crate::offline::draw::Shot;
use crate::scene::RuntimeScene;
use crate::view::{Counts, View};

/// Largest number of Gaussians in a sample.
const SAMPLE: usize = 10_000;

/// The part of a scene that is kept to explain empty pictures.
pub(crate) struct NearSample {
    /// Some Gaussians.
    gaussians: Vec<Gaussian>,
    /// The marginal at and below which a Gaussian is not drawn.
    cutoff: f32,
    /// Near limit, capture units.
    near: f32,
}

impl NearSample {
    /// Takes an even sample of the Gaussians of a scene.
    pub(crate) fn of(scene: &RuntimeScene) -> Self {
        let step = scene.len() / SAMPLE + 1;
        let gaussians = (0..scene.len()).step_by(step).map(|index| scene.gaussian(index)).collect();
        let (cutoff, near) = (scene.trained_with.marginal_cutoff, scene.trained_with.near);
        Self { gaussians, cutoff, near }
    }

    /// Writes the note if a picture has no splat and something before its camera is too near.
    pub(crate) fn point_out(&self, views: &[(Shot, View)], counts: &[Counts]) {
        let is_hidden = |((_, view), counts): &(&(Shot, View), &Counts)| counts.visible == 0 && self.is_too_near(view);
        let hidden = views.iter().zip(counts).filter(is_hidden).count();
        if hidden > 0 {
            let (all, near) = (views.len(), self.near);
            note(&format!(
                "note: {hidden} of {all} pictures show nothing: everything before their cameras is nearer than the near limit of \
                 {near} units"
            ));
        }
    }

    /// Returns whether a Gaussian of the sample is in the picture of a view, but not beyond its near limit.
    fn is_too_near(&self, view: &View) -> bool {
        let [row_x, row_y] = view.clip_rows();
        self.gaussians.iter().filter(|gaussian| gaussian.marginal(view.time) > self.cutoff).any(|gaussian| {
            let mean = gaussian.mean_at(view.time);
            let depth = view.world_to_camera.transform_point3(mean).z;
            let at = mean.extend(1.0);
            (0.0..=view.near).contains(&depth) && row_x.dot(at).abs() <= depth && row_y.dot(at).abs() <= depth
        })
    }
}
