//! The state of training. Resumed training gives the same result to the bit.
//!
//! In: the bytes of buffers on the GPU. Out: [`TrainerState`], and a trainer that goes on from one.

use super::step::Trainer;
use crate::offline::train::gpu::Optimized;
use crate::renderer::GpuError;
use crate::scene::TemporalFilter;

/// Parameters, moments and neighbors, as they are on the GPU.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TrainerState {
    /// Raw parameters, their first and their second moments; the same of the color coefficients; then the buffers of
    /// the optional parts, in the order of their list `PARTS`: of those with parameters of
    /// their own these and both moments, of others what they add up.
    pub buffers: Vec<Vec<u8>>,
    /// The neighbors of each Gaussian; empty if no term needs them.
    pub neighbors: Vec<u8>,
    /// The temporal filter.
    pub filter: Option<TemporalFilter>,
}

impl TrainerState {
    /// Returns whether the buffers have the sizes of these on the GPU, and every neighbor is one of `count` Gaussians.
    fn fits(&self, buffers: &[&wgpu::Buffer], count: u32) -> bool {
        let fits = |(bytes, buffer): (&Vec<u8>, &&wgpu::Buffer)| bytes.len() as u64 == buffer.size();
        let neighbors: Vec<u32> = bytemuck::pod_collect_to_vec(&self.neighbors);
        self.buffers.len() == buffers.len()
            && self.buffers.iter().zip(buffers).all(fits)
            && neighbors.iter().all(|&index| index < count)
    }
}

impl Trainer<'_> {
    /// Returns parameters, moments and neighbors, to resume from.
    ///
    /// # Errors
    /// A lost device.
    pub fn state(&self) -> Result<TrainerState, GpuError> {
        let read = |buffer: &wgpu::Buffer| self.work.headless.copy_out(buffer, buffer.size());
        let buffers = self.stored().into_iter().map(read).collect::<Result<_, _>>()?;
        let neighbors = self.parts.iter().map(|part| part.neighbors(&self.work));
        let neighbors = neighbors.collect::<Result<Vec<_>, _>>()?.concat();
        Ok(TrainerState { buffers, neighbors, filter: self.work.scene.filter.clone() })
    }

    /// Replaces parameters, moments and filter by those of [`state`](Self::state), and neighbors if it has some that
    /// are needed. Returns whether they are of as many Gaussians and of the same optional parts; if not, nothing is
    /// replaced.
    pub fn resume(&mut self, state: &TrainerState) -> bool {
        if !state.fits(&self.stored(), self.count()) {
            return false;
        }
        if state.filter != self.work.scene.filter
            && state.filter.clone().is_none_or(|filter| self.set_filter(filter).is_err())
        {
            return false;
        }
        for (bytes, buffer) in state.buffers.iter().zip(self.stored()) {
            self.work.queue().write_buffer(buffer, 0, bytes);
        }
        self.parts.iter_mut().for_each(|part| part.resume(&self.work, &state.neighbors));
        self.refresh();
        true
    }

    /// Sets all moments to 0, as before the first step.
    pub fn forget_moments(&mut self) {
        let mut encoder = self.work.encoder("gs4d moments");
        self.optimized().for_each(|optimized| optimized.forget_moments(&mut encoder));
        self.work.queue().submit([encoder.finish()]);
    }

    /// Returns the buffers of a state, in its order.
    fn stored(&self) -> Vec<&wgpu::Buffer> {
        let others = self.parts.iter().filter_map(|part| part.buffer());
        self.optimized().flat_map(Optimized::stored).chain(others).collect()
    }

    /// Returns everything that the optimizer changes.
    fn optimized(&self) -> impl Iterator<Item = &Optimized> {
        self.work.parameters.optimized().chain(self.parts.iter().filter_map(|part| part.optimized()))
    }
}
