//! The scene of a trainer as it is.
//!
//! In: parameters and gradients on the GPU. Out: pictures; the scene and its gradients on the host.

use super::step::Trainer;
use crate::offline::train::gpu::Quantity;
use crate::offline::train::gpu::records::{set_harmonics, set_parameters};
use crate::renderer::GpuError;
use crate::scene::{GaussianScene, SceneForm, TemporalFilter, Trained};
use crate::view::{Background, Frame, View};

impl Trainer<'_> {
    /// Returns the number of Gaussians, with free places.
    pub fn count(&self) -> u32 {
        self.work.parameters.count()
    }

    /// Draws the scene as it is.
    ///
    /// # Errors
    /// A picture that does not fit the GPU, a lost device.
    pub fn draw(&mut self, view: &View, background: Background) -> Result<Frame, GpuError> {
        self.work.headless.render(&self.work.capture, view, background)
    }

    /// Draws a view of the scene, so that later frames have room for at least as many pairs.
    ///
    /// # Errors
    /// As [`draw`](Self::draw).
    pub fn make_room(&mut self, view: &View) -> Result<(), GpuError> {
        self.work.headless.draw(&self.work.capture, view, Background::None)
    }

    /// Replaces the temporal filter.
    ///
    /// # Errors
    /// A filter of another number of Gaussians.
    pub fn set_filter(&mut self, filter: TemporalFilter) -> Result<(), GpuError> {
        let interval = self.work.scene.trained_with.time_interval;
        self.work.headless.replace_filter(&mut self.work.capture, &filter, interval)?;
        self.work.scene.filter = Some(filter);
        Ok(())
    }

    /// Returns the scene as it is.
    ///
    /// # Errors
    /// A lost device.
    pub fn scene(&self) -> Result<GaussianScene, GpuError> {
        self.read(Quantity::Values)
    }

    /// Returns the gradients accumulated since the last step, as raw parameters, color coefficients and texels of the
    /// environment map.
    ///
    /// # Errors
    /// A lost device.
    pub fn gradients(&self) -> Result<GaussianScene, GpuError> {
        let mut gradients = self.read(Quantity::Gradients)?;
        if let SceneForm::Trained(Trained { harmonics, .. }) = &mut gradients.form {
            let (used, own) = (harmonics.evaluated() * 3, harmonics.coefficients * 3);
            // Coefficients that are not evaluated change nothing.
            harmonics.values.chunks_exact_mut(own.max(1)).for_each(|values| values[used..].fill(0.0));
        }
        Ok(gradients)
    }

    /// Returns the scene with what is trained as it is on the GPU.
    fn read(&self, what: Quantity) -> Result<GaussianScene, GpuError> {
        let (headless, buffers) = (&*self.work.headless, &self.work.parameters);
        let mut scene = self.work.scene.clone();
        if let SceneForm::Trained(Trained { parameters, harmonics }) = &mut scene.form {
            set_parameters(parameters, &buffers.read_records(headless, what)?);
            set_harmonics(harmonics, &buffers.read_colors(headless, what)?, buffers.stride() as usize * 4);
        }
        self.parts.iter().try_for_each(|part| part.write(&self.work, what, &mut scene))?;
        Ok(scene)
    }
}
