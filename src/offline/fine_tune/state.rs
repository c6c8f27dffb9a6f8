//! What is trained, read from the GPU and written back.
//!
//! In: a [`Trainer`](super::Trainer). Out: the scene or its gradients; [`TrainerState`], from which training goes on to the bit.

use super::records::{set_harmonics, set_parameters};
use super::trainer::Trainer;
use crate::renderer::GpuError;
use crate::renderer::layout::TrainedRecord;
use crate::scene::{GaussianScene, SceneForm, TemporalFilter, Trained};

/// Parameters, moments and neighbors, as they are on the GPU.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TrainerState {
    /// Raw parameters, their first and their second moments; the same of the color coefficients, and of the entries of codebooks if colors
    /// are [tied](Trainer::tie); then what rounding changes of each Gaussian, if geometry is [rounded](Trainer::round).
    pub buffers: Vec<Vec<u8>>,
    /// The neighbors of each Gaussian; empty if no term needs them.
    pub neighbors: Vec<u8>,
    /// The temporal filter.
    pub filter: Option<TemporalFilter>,
}

impl Trainer<'_> {
    /// Returns the scene as it is.
    ///
    /// # Errors
    /// A lost device.
    pub fn scene(&self) -> Result<GaussianScene, GpuError> {
        let (records, values) = (self.read(&self.geometry.values)?, self.read(&self.color.values)?);
        Ok(self.with(&records, &values))
    }

    /// Returns the gradients accumulated since the last step, as raw parameters and color coefficients.
    ///
    /// # Errors
    /// A lost device.
    pub fn gradients(&self) -> Result<GaussianScene, GpuError> {
        let (records, values) = (self.read(&self.geometry.gradients)?, self.read(&self.color.gradients)?);
        let mut gradients = self.with(&records, &values);
        if let SceneForm::Trained(Trained { harmonics, .. }) = &mut gradients.form {
            let (used, own) = (harmonics.evaluated() * 3, harmonics.coefficients * 3);
            // Coefficients that are not evaluated change nothing.
            harmonics.values.chunks_exact_mut(own.max(1)).for_each(|values| values[used..].fill(0.0));
        }
        Ok(gradients)
    }

    /// Returns parameters, moments and neighbors, to resume from.
    ///
    /// # Errors
    /// A lost device.
    pub fn state(&self) -> Result<TrainerState, GpuError> {
        let buffers = self.stored().into_iter().map(|buffer| self.read(buffer)).collect::<Result<_, _>>()?;
        Ok(TrainerState { buffers, neighbors: self.neighbors()?, filter: self.scene.filter.clone() })
    }

    /// Replaces parameters, moments and filter by those of [`state`](Self::state), and neighbors if it has some that are needed. Returns
    /// whether they are of as many Gaussians, of as many entries if colors are tied, and rounded if these are; if not, nothing is replaced.
    pub fn resume(&mut self, state: &TrainerState) -> bool {
        let buffers = self.stored();
        let fits = |(bytes, buffer): (&Vec<u8>, &&wgpu::Buffer)| bytes.len() as u64 == buffer.size();
        if state.buffers.len() != buffers.len() || !state.buffers.iter().zip(&buffers).all(fits) {
            return false;
        }
        let neighbors: Vec<u32> = bytemuck::pod_collect_to_vec(&state.neighbors);
        if neighbors.iter().any(|&index| index as usize >= self.capture.len()) {
            return false;
        }
        if state.filter != self.scene.filter
            && state.filter.clone().is_none_or(|filter| self.set_filter(filter).is_err())
        {
            return false;
        }
        for (bytes, buffer) in state.buffers.iter().zip(self.stored()) {
            self.headless.context().queue.write_buffer(buffer, 0, bytes);
        }
        if self.regularizer.as_ref().is_some_and(|made| made.neighbors.size() == state.neighbors.len() as u64) {
            self.set_neighbors(&state.neighbors);
        }
        if let Some(tied) = &self.tied {
            let mut encoder = self.encoder("gs4d expand");
            self.expand(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()), tied);
            self.headless.context().queue.submit([encoder.finish()]);
        }
        self.slice();
        true
    }

    /// Returns the buffers of a state, in its order.
    fn stored(&self) -> Vec<&wgpu::Buffer> {
        let all = [Some(&self.geometry), Some(&self.color), self.tied.as_ref().map(|tied| &tied.entries)];
        let optimized = all.into_iter().flatten().flat_map(|o| [&o.values, &o.moments[0], &o.moments[1]]);
        optimized.chain(self.rounder.as_ref().map(|rounder| &rounder.changes)).collect()
    }

    /// Sets all moments to 0, as before the first step.
    pub fn forget_moments(&mut self) {
        let mut encoder = self.encoder("gs4d moments");
        for moments in self.geometry.moments.iter().chain(&self.color.moments) {
            encoder.clear_buffer(moments, 0, None);
        }
        self.headless.context().queue.submit([encoder.finish()]);
    }

    pub(super) fn read(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
        self.headless.copy_out(buffer, buffer.size())
    }

    /// Returns the scene with these records and color coefficients, as they are on the GPU.
    fn with(&self, records: &[u8], values: &[u8]) -> GaussianScene {
        let mut scene = self.scene.clone();
        if let SceneForm::Trained(Trained { parameters, harmonics }) = &mut scene.form {
            let records: Vec<TrainedRecord> = bytemuck::pod_collect_to_vec(records);
            set_parameters(parameters, &records);
            let stride = self.color.stride as usize * 4;
            set_harmonics(harmonics, &bytemuck::pod_collect_to_vec::<u8, f32>(values), stride);
        }
        scene
    }
}
