//! The interface of the optional parts of training.
//!
//! In: the [`Workspace`] of a training. Out: [`Part`], which says what a part adds to each step, to the state and to
//! the scene.

use crate::offline::engine::layout::LossUniforms;
use crate::offline::train::gpu::{GpuImage, Optimized, Quantity, RecordedView, Workspace};
use crate::offline::train::schedule::Step;
use crate::offline::train::trainer_error::TrainerError;
use crate::renderer::GpuError;
use crate::scene::GaussianScene;
use std::any::Any;
use std::fmt::Debug;

/// An optional part of training. The methods are in the order in which a step calls them, and do nothing unless a part
/// has its own; the parts of a training are called in the order of their list, `PARTS`.
pub(crate) trait Part: Any + Debug {
    /// Prepares the step before its views are drawn.
    ///
    /// # Errors
    /// Those of the part, a lost device.
    fn before_views(&mut self, _work: &Workspace<'_>, _step: &Step) -> Result<(), TrainerError> {
        Ok(())
    }

    /// Changes the settings of the loss of a view.
    fn adjust_loss(&self, _settings: &mut LossUniforms) {}

    /// Records the loss of a view in place of the loss of its picture as drawn. Returns whether it has.
    ///
    /// # Errors
    /// A picture that does not fit the GPU.
    fn record_loss(
        &mut self,
        _work: &Workspace<'_>,
        _view: &RecordedView<'_>,
        _image: &GpuImage,
        _encoder: &mut wgpu::CommandEncoder,
    ) -> Result<bool, GpuError> {
        Ok(false)
    }

    /// Records gradients of the part itself, after the backward pass of a view.
    fn record_view(&self, _work: &Workspace<'_>, _view: &RecordedView<'_>, _encoder: &mut wgpu::CommandEncoder) {}

    /// Adds the gradients of terms of the loss that depend on no view to those of the batch of a step, counted from 0.
    ///
    /// # Errors
    /// A lost device.
    fn accumulate(&mut self, _work: &Workspace<'_>, _index: usize) -> Result<(), GpuError> {
        Ok(())
    }

    /// Records commands before the optimizer, and changes the step that it makes with the parameters of the scene,
    /// `own`.
    fn before_optimizer(&self, _work: &Workspace<'_>, _pass: &mut wgpu::ComputePass<'_>, _own: &mut Step) {}

    /// Records commands after the optimizer: the step of the part's own parameters, changes of the scene's.
    fn record_step(&self, _work: &Workspace<'_>, _pass: &mut wgpu::ComputePass<'_>, _step: &Step) {}

    /// Records changes of the sliced Gaussians, each time that parameters have been sliced.
    fn record_slice(&self, _work: &Workspace<'_>, _pass: &mut wgpu::ComputePass<'_>) {}

    /// Records that the next views are drawn with the part's values as they are: after each step, and after a state has
    /// been read.
    fn refresh(&self, _work: &Workspace<'_>, _encoder: &mut wgpu::CommandEncoder) {}

    /// Moves, removes or adds Gaussians after a step. Returns whether parameters have changed.
    ///
    /// # Errors
    /// A lost device.
    fn after_step(&mut self, _work: &Workspace<'_>, _step: &Step) -> Result<bool, GpuError> {
        Ok(false)
    }

    /// Returns the parameters of the part, which a state holds with their moments.
    fn optimized(&self) -> Option<&Optimized> {
        None
    }

    /// Returns a further buffer of a state.
    fn buffer(&self) -> Option<&wgpu::Buffer> {
        None
    }

    /// Returns the neighbors of each Gaussian that the part has found, for a state; empty if it has found none, as in
    /// all parts but one.
    ///
    /// # Errors
    /// A lost device.
    fn neighbors(&self, _work: &Workspace<'_>) -> Result<Vec<u8>, GpuError> {
        Ok(Vec::new())
    }

    /// Takes the neighbors of a state. Its buffers have been written.
    fn resume(&mut self, _work: &Workspace<'_>, _neighbors: &[u8]) {}

    /// Writes the values of the part, or their gradients, into the scene that is read from a training.
    ///
    /// # Errors
    /// A lost device.
    fn write(&self, _work: &Workspace<'_>, _what: Quantity, _scene: &mut GaussianScene) -> Result<(), GpuError> {
        Ok(())
    }

    /// Returns what the part has done since the last report, in words.
    fn report(&mut self) -> Option<String> {
        None
    }
}
