//! What a trainer has found beside the scene.
//!
//! In: sums over views and notes on the GPU, the optional parts. Out: the loss, faults, exposures for reports,
//! codebooks for packing, counts and words for the lines of progress, gradients for tests.

use super::step::Trainer;
use crate::offline::compress::codebook::Centers;
use crate::offline::train::gpu::{Faults, Quantity, Totals};
use crate::offline::train::parts::cloning::Densifier;
use crate::offline::train::parts::codebooks::TrainedCodebooks;
use crate::offline::train::parts::exposure::TrainedExposures;
use crate::offline::train::reference::exposure::Exposure;
use crate::renderer::GpuError;

impl Trainer<'_> {
    /// Returns the sums over the views since the last call, and begins new ones.
    ///
    /// # Errors
    /// A lost device.
    pub fn totals(&mut self) -> Result<Totals, GpuError> {
        self.backward.totals(self.work.headless)
    }

    /// Returns the gradients that were not finite so far; `None` if there were none.
    ///
    /// # Errors
    /// A lost device.
    pub fn faults(&self) -> Result<Option<Faults>, GpuError> {
        self.work.parameters.faults(self.work.headless)
    }

    /// Returns the exposures of all cameras; none unless they are trained.
    ///
    /// # Errors
    /// A lost device.
    pub fn exposures(&self) -> Result<Vec<Exposure>, GpuError> {
        self.read_exposures(Quantity::Values)
    }

    /// Sets the exposures of all cameras, if they are trained.
    pub(crate) fn set_exposures(&self, exposures: &[Exposure]) {
        if let Some(trained) = self.parts.get::<TrainedExposures>() {
            trained.write(self.work.headless, exposures);
        }
    }

    /// Returns the gradients with respect to the exposures, accumulated since the last step.
    ///
    /// # Errors
    /// A lost device.
    pub fn exposure_gradients(&self) -> Result<Vec<Exposure>, GpuError> {
        self.read_exposures(Quantity::Gradients)
    }

    fn read_exposures(&self, what: Quantity) -> Result<Vec<Exposure>, GpuError> {
        let trained = self.parts.get::<TrainedExposures>();
        trained.map_or(Ok(Vec::new()), |exposures| exposures.read(self.work.headless, what))
    }

    /// Returns the codebooks as they are; `None` unless they are trained.
    ///
    /// # Errors
    /// A lost device.
    pub fn codebooks(&self) -> Result<Option<Centers>, GpuError> {
        let trained = self.parts.get::<TrainedCodebooks>();
        trained.map(|books| books.codebooks(self.work.headless)).transpose()
    }

    /// Returns the number of Gaussians, without free places if Gaussians are cloned.
    ///
    /// # Errors
    /// A lost device.
    pub fn live_count(&self) -> Result<usize, GpuError> {
        match self.parts.get::<Densifier>() {
            Some(_) => Densifier::live_count(&self.work),
            None => Ok(self.count() as usize),
        }
    }

    /// Returns the mean gradient of each Gaussian on the screen in the steps since the last densification; none unless
    /// Gaussians are cloned.
    ///
    /// # Errors
    /// A lost device.
    pub fn screen_gradients(&self) -> Result<Vec<f32>, GpuError> {
        self.parts.get::<Densifier>().map_or(Ok(Vec::new()), |densifier| densifier.gradients(&self.work))
    }

    /// Returns what the parts have done since the last report, in words; `None` if no part reports.
    pub(crate) fn report(&mut self) -> Option<String> {
        let reports: Vec<String> = self.parts.iter_mut().filter_map(|part| part.report()).collect();
        (!reports.is_empty()).then(|| reports.join(", "))
    }
}
