//! The state of training. Resumed training gives the same result to the bit.
//!
//! In: the bytes of buffers on the GPU, read by a trainer. Out: [`TrainerState`].

use crate::scene::TemporalFilter;

/// Parameters, moments and neighbors, as they are on the GPU.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TrainerState {
    /// Raw parameters, their first and their second moments; the same of the color coefficients, of the environment map if there is one,
    /// of the exposures of cameras if they are [trained](super::Trainer::set_exposure), and of the entries of codebooks if colors are
    /// [tied](super::Trainer::tie); then what rounding changes of each Gaussian, if geometry is [rounded](super::Trainer::round), and the
    /// sums of gradients on the screen, if the scene grows [as the original](super::Trainer::set_cloning).
    pub buffers: Vec<Vec<u8>>,
    /// The neighbors of each Gaussian; empty if no term needs them.
    pub neighbors: Vec<u8>,
    /// The temporal filter.
    pub filter: Option<TemporalFilter>,
}

impl TrainerState {
    /// Returns whether the buffers have the sizes of these on the GPU, and every neighbor is one of `count` Gaussians.
    pub(super) fn fits(&self, buffers: &[&wgpu::Buffer], count: u32) -> bool {
        let fits = |(bytes, buffer): (&Vec<u8>, &&wgpu::Buffer)| bytes.len() as u64 == buffer.size();
        let neighbors: Vec<u32> = bytemuck::pod_collect_to_vec(&self.neighbors);
        self.buffers.len() == buffers.len()
            && self.buffers.iter().zip(buffers).all(fits)
            && neighbors.iter().all(|&index| index < count)
    }
}
