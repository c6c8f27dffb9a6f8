//! A finished frame of global sort, for further passes of clients: scoring, a backward pass.
//!
//! In: the buffers of a view. Out: [`FinishedFrame`], which borrows them.

/// Resources of a finished frame on the GPU.
#[derive(Debug, Clone, Copy)]
pub struct FinishedFrame<'a> {
    /// Uniform buffer: one [`FrameUniforms`](crate::renderer::layout::FrameUniforms).
    pub frame: &'a wgpu::Buffer,
    /// Uniform buffer: one [`InstanceUniforms`](crate::renderer::layout::InstanceUniforms) for each part of the first instance, then of the
    /// others, each at a multiple of [`INSTANCE_STRIDE`](crate::renderer::layout::INSTANCE_STRIDE).
    pub instances: &'a wgpu::Buffer,
    /// Storage buffer: one [`Counters`](crate::renderer::layout::Counters).
    pub counters: &'a wgpu::Buffer,
    /// Buffers that the passes have written. After a frame with motions, colors of splats are their motions.
    pub buffers: &'a PassBuffers,
    /// Color over the background and transmittance, `Rgba32Float`. May be larger than the picture, like the depth.
    pub color: &'a wgpu::TextureView,
    /// Expected and median depth, `Rg32Float`.
    pub depth: &'a wgpu::TextureView,
    /// Capacity of the buffers in splats.
    pub slots: u32,
    /// Capacity of the buffers in pairs.
    pub pairs: u32,
}

/// Storage buffers of a frame that a later pass can read.
#[derive(Debug)]
pub struct PassBuffers {
    /// First and last + 1 pair of each tile, two words each.
    pub tile_ranges: wgpu::Buffer,
    /// Splat of each pair, ordered by tile, then depth.
    pub pair_splats: wgpu::Buffer,
    /// One [`SplatRecord`](crate::renderer::layout::SplatRecord) for each slot.
    pub splats: wgpu::Buffer,
    /// Slots of the visible splats, by depth.
    pub order: wgpu::Buffer,
    /// First pair of each visible splat, by depth.
    pub offsets: wgpu::Buffer,
    /// Depth key of each slot; [`INVISIBLE`](crate::renderer::layout::INVISIBLE) for a slot without a splat.
    pub depth_keys: wgpu::Buffer,
}
