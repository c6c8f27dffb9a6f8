//! A capture without what a list of edits removes.
//!
//! In: a [`GaussianCapture`], an [`EditList`]. Out: another capture, to be shown in its place, and the number of
//! Gaussians that each edit removes; or a [`CaptureEditError`].

use super::capture::GaussianCapture;
use crate::scene::GaussianScene;
use crate::scene::edit::{EditError, EditList, Edited, apply};

/// Why a list of edits cannot be applied to a capture.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureEditError {
    /// The Gaussians have been dropped from memory.
    #[error(
        "the Gaussians of the capture are on the GPU only: load it with RenderAssetUsages::default() in CaptureLoaderSettings, or \
         edit it before it is drawn"
    )]
    Released,
    /// The capture is the index of chunk files.
    #[error("the capture is the index of chunk files, which has no Gaussians: edit it before it is split into files")]
    Chunks,
    /// The parts of the capture do not fit together.
    #[error("the parts of the capture do not fit together: {0}")]
    Scene(&'static str),
    /// The edits cannot be applied to its scene.
    #[error(transparent)]
    Edit(#[from] EditError),
}

impl GaussianCapture {
    /// Returns the capture without the Gaussians that a list of edits removes, and how many each edit removes of those
    /// that the edits before it have left. What remains keeps its bits, as in [`scene::edit`](crate::scene::edit). If a
    /// Gaussian is removed, levels of detail are left out; if none is, the result shares its scene with this capture.
    ///
    /// Every Gaussian is looked at and those that remain are copied: for large captures, call it in a task.
    ///
    /// # Errors
    /// A capture whose Gaussians are not in [memory](Self::is_released) or in chunk files, or whose parts do not fit
    /// together; edits that leave no Gaussian, an edit that asks what the training cameras see.
    ///
    /// # Examples
    ///
    /// ```
    /// use bevy_gs4d::prelude::*;
    /// use bevy_gs4d::scene::edit::EditList;
    /// use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
    ///
    /// let scene = synthesize(&SynthSettings { count: 500, ..SynthSettings::default() });
    /// let capture = GaussianCapture::new(scene.into_runtime()?);
    /// let list = EditList::parse(b"[remove_box(min: (0, -9, -9), max: (9, 9, 9))]")?;
    /// let (left, removed) = capture.edited(&list)?;
    /// assert_eq!(left.scene().len() + removed[0], 500, "the other half is left");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn edited(&self, list: &EditList) -> Result<(Self, Vec<usize>), CaptureEditError> {
        if self.is_released() {
            return Err(CaptureEditError::Released);
        }
        if self.scene().chunks.is_some() {
            return Err(CaptureEditError::Chunks);
        }
        let scene = GaussianScene::from(self.scene().clone());
        scene.check().map_err(CaptureEditError::Scene)?;
        let Edited { scene, removed, .. } = apply(scene, list, None)?;
        if removed.iter().all(|count| *count == 0) {
            return Ok((self.clone(), removed));
        }
        let scene = scene.into_runtime().map_err(EditError::from)?;
        Ok((Self::new(scene).with_usages(self.usages()), removed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Packing;
    use crate::scene::synth::{SynthSettings, synthesize};
    use bevy::asset::RenderAssetUsages;

    fn list(text: &str) -> EditList {
        EditList::parse(text.as_bytes()).expect("the text is a list")
    }

    #[test]
    fn a_capture_is_edited_as_its_scene_is_in_each_form() {
        let trained = synthesize(&SynthSettings { count: 900, degree: 1, ..SynthSettings::default() });
        let sliced = trained.clone().into_runtime().expect("a synthetic scene can be drawn");
        let packed = sliced.clone().pack(&Packing::default()).expect("the scene fits");
        let edits =
            list("[remove_box(min: (0, -9, -9), max: (9, 9, 9)), remove_sphere(center: (-1, 0, 0), radius: 0.5)]");
        let of_trained = apply(trained, &edits, None).expect("some are left");
        let of_trained = of_trained.scene.into_runtime().expect("they can be drawn");
        for (scene, expected) in [(sliced, Some(of_trained)), (packed, None)] {
            let of_scene = apply(scene.clone().into(), &edits, None).expect("some are left");
            let capture = GaussianCapture::new(scene).with_usages(RenderAssetUsages::RENDER_WORLD);
            let (edited, removed) = capture.edited(&edits).expect("some are left");
            assert_eq!(removed, of_scene.removed, "as many are removed");
            assert!(removed.iter().all(|count| *count > 0), "each edit removes some: {removed:?}");
            let of_scene = of_scene.scene.into_runtime().expect("they can be drawn");
            assert_eq!(*edited.scene(), of_scene, "the same are left");
            assert!(expected.is_none_or(|expected| expected == of_scene), "as of the trained form");
            assert_eq!(edited.usages(), capture.usages(), "the usages stay");
            assert!(edited.bounds() != capture.bounds(), "the bounds are those of what is left");
        }
    }

    #[test]
    fn without_an_effect_the_scene_is_shared_and_faults_are_errors() {
        let scene = synthesize(&SynthSettings { count: 50, degree: 0, ..SynthSettings::default() });
        let mut capture = GaussianCapture::new(scene.into_runtime().expect("a synthetic scene can be drawn"));
        for (text, removed) in [("[]", &[][..]), ("[keep_sphere(center: (0, 0, 0), radius: 99)]", &[0][..])] {
            let (same, counts) = capture.edited(&list(text)).expect("all are left");
            assert!(std::ptr::eq(same.scene(), capture.scene()), "{text}: the scene is shared");
            assert_eq!(counts, removed, "{text}: nothing is removed");
        }
        let everything = capture.edited(&list("[keep_sphere(center: (99, 0, 0), radius: 1)]"));
        assert!(
            matches!(everything, Err(CaptureEditError::Edit(EditError::Everything { number: 1, .. }))),
            "none is left"
        );
        let floaters = capture.edited(&list("[remove_floaters(cameras_below: 3, distance_below: 1)]"));
        assert!(
            matches!(floaters, Err(CaptureEditError::Edit(EditError::NotSeen { number: 1, .. }))),
            "without cameras"
        );
        capture.release();
        let released = capture.edited(&list("[]"));
        assert!(matches!(released, Err(CaptureEditError::Released)), "there is nothing to edit");
    }
}
