//! The conversion of a scene for drawing, at once or in steps.
//!
//! In: a [`GaussianScene`]. Out: a [`RuntimeScene`], whose Gaussians and colors can all be drawn. Levels of detail are
//! converted in the same way.

use super::form::{Form, SceneForm, Trained};
use super::gaussian_scene::GaussianScene;
use super::runtime_scene::{Level, RuntimeScene};
use super::sliced::Sliced;
use crate::gaussian::{Gaussian, InvalidGaussian, SliceSettings};
use std::borrow::Cow;
use std::sync::Arc;

impl GaussianScene {
    /// Returns the Gaussians in the runtime form, without their color.
    ///
    /// # Errors
    /// The first Gaussian that cannot be drawn, of a scene in the trained form.
    pub(crate) fn gaussians(&self) -> Result<Cow<'_, [Gaussian]>, InvalidGaussian> {
        match &self.form {
            SceneForm::Trained(Trained { parameters, .. }) => {
                let prefilter_var = self.trained_with.prefilter_var;
                Ok(Cow::Owned(parameters.slice(&SliceSettings { prefilter_var, ..SliceSettings::default() })?))
            }
            SceneForm::Ready(Form::Sliced(sliced)) => Ok(Cow::Borrowed(&sliced.gaussians)),
            SceneForm::Ready(packed @ Form::Packed(_)) => Ok(Cow::Owned(packed.iter().collect())),
        }
    }

    /// Converts the scene for drawing: slices the Gaussians if they are in the trained form. Colors are moved, not
    /// copied.
    ///
    /// # Errors
    /// The first Gaussian that cannot be drawn, or has a color coefficient that is not finite.
    pub fn into_runtime(self) -> Result<RuntimeScene, InvalidGaussian> {
        Conversion::of(self)?.finish()
    }

    /// Converts as [`into_runtime`](Self::into_runtime) does, with slice settings other than the scene's own. They
    /// apply to the trained form only.
    ///
    /// # Errors
    /// The first Gaussian that cannot be drawn, or has a color coefficient that is not finite.
    pub fn into_runtime_with(self, settings: &SliceSettings) -> Result<RuntimeScene, InvalidGaussian> {
        Conversion::new(self, *settings)?.finish()
    }
}

/// A scene that is being converted.
pub(crate) struct Conversion {
    scene: GaussianScene,
    settings: SliceSettings,
    /// The Gaussians of a trained scene that have been sliced.
    sliced: Vec<Gaussian>,
    /// Numbers of Gaussians and of color values that have been converted or checked.
    gaussians: usize,
    values: usize,
    /// The size in pixels of the level that is being converted, and its conversion; the levels before and after it.
    level: Option<(f32, Box<Self>)>,
    before: Vec<Level>,
    after: std::vec::IntoIter<Level>,
}

impl Conversion {
    /// Begins the conversion of a scene, with its own settings of the slice.
    ///
    /// # Errors
    /// A packed scene whose parts do not fit together.
    pub(crate) fn of(scene: GaussianScene) -> Result<Self, InvalidGaussian> {
        let prefilter_var = scene.trained_with.prefilter_var;
        Self::new(scene, SliceSettings { prefilter_var, ..SliceSettings::default() })
    }

    /// Begins the conversion of a scene.
    ///
    /// # Errors
    /// A packed scene whose parts do not fit together.
    pub(super) fn new(mut scene: GaussianScene, settings: SliceSettings) -> Result<Self, InvalidGaussian> {
        if let SceneForm::Ready(Form::Packed(packed)) = &scene.form {
            packed.check().map_err(|reason| InvalidGaussian { index: 0, reason })?;
        }
        let after = std::mem::take(&mut scene.levels).into_iter();
        let (sliced, gaussians, values, level, before) = Default::default();
        Ok(Self { scene, settings, sliced, gaussians, values, level, before, after })
    }

    /// Does one step, which converts at most about `bytes`. Returns whether steps remain.
    ///
    /// # Errors
    /// The first Gaussian that cannot be drawn, or has a color coefficient that is not finite.
    pub(crate) fn advance(&mut self, bytes: usize) -> Result<bool, InvalidGaussian> {
        if self.gaussians < self.scene.len() {
            self.advance_gaussians((bytes / size_of::<Gaussian>()).max(1))?;
            return Ok(true);
        }
        if let Some(harmonics) = self.scene.form.harmonics()
            && self.values < harmonics.values.len()
        {
            let end = harmonics.values.len().min(self.values.saturating_add((bytes / size_of::<f32>()).max(1)));
            let values = harmonics.values.get(self.values..end).unwrap_or_default();
            if let Some(bad) = values.iter().position(|value| !value.is_finite()) {
                let index = (self.values + bad) / (harmonics.coefficients * 3).max(1);
                return Err(InvalidGaussian { index, reason: "a color coefficient that is not finite" });
            }
            self.values = end;
            return Ok(true);
        }
        if let Some((pixels, mut level)) = self.level.take() {
            if level.advance(bytes)? {
                self.level = Some((pixels, level));
            } else {
                self.before.push(Level { pixels, scene: Arc::new(level.finish()?) });
            }
            return Ok(true);
        }
        let Some(Level { pixels, scene }) = self.after.next() else { return Ok(false) };
        self.level = Some((pixels, Box::new(Self::of(Arc::unwrap_or_clone(scene).into())?)));
        Ok(true)
    }

    /// Converts at most `count` further Gaussians.
    fn advance_gaussians(&mut self, count: usize) -> Result<(), InvalidGaussian> {
        let all = self.scene.len();
        let range = self.gaussians..all.min(self.gaussians.saturating_add(count));
        let end = range.end;
        match &self.scene.form {
            SceneForm::Trained(Trained { parameters, .. }) if range.len() == all => {
                self.sliced = parameters.slice(&self.settings)?;
            }
            SceneForm::Trained(Trained { parameters, .. }) => {
                self.sliced.reserve_exact(all - self.sliced.len());
                self.sliced.extend(parameters.slice_some(range, &self.settings)?);
            }
            SceneForm::Ready(form) => form.check_some(range)?,
        }
        self.gaussians = end;
        Ok(())
    }

    /// Does all remaining steps, and returns the scene.
    ///
    /// # Errors
    /// As [`advance`](Self::advance).
    pub(crate) fn finish(mut self) -> Result<RuntimeScene, InvalidGaussian> {
        while self.advance(usize::MAX)? {}
        let Self { scene, sliced, before: levels, .. } = self;
        GaussianScene { levels, ..scene }.into_ready(|form| {
            Ok(match form {
                SceneForm::Trained(Trained { harmonics, .. }) => Form::Sliced(Sliced { gaussians: sliced, harmonics }),
                SceneForm::Ready(form) => form,
            })
        })
    }
}
