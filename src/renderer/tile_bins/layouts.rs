//! The bind group layouts of tile bins.
//!
//! In: a device. Out: [`BinLayouts`], in the order of the shaders' bindings.

use crate::renderer::device::bind::Bind::{self, Read, Uniform, UniformAt, Write};
use crate::renderer::device::bind::group_layout;
use crate::renderer::layout::{FrameUniforms, INSTANCES_BOUND, MotionUniforms};

/// Bind group layouts, in the order of the shaders' bindings.
#[derive(Debug)]
pub(in crate::renderer) struct BinLayouts {
    /// Of `find_surfaces`, after the group of the pixels.
    pub find_surfaces: wgpu::BindGroupLayout,
    pub project_bin: wgpu::BindGroupLayout,
    /// Of `place_bins` and `fill_bins`.
    pub fill_bins: wgpu::BindGroupLayout,
    pub sort_bins: wgpu::BindGroupLayout,
    pub colors: wgpu::BindGroupLayout,
    pub blend_blocks: wgpu::BindGroupLayout,
    pub motion: wgpu::BindGroupLayout,
}

impl BinLayouts {
    pub(in crate::renderer) fn new(device: &wgpu::Device) -> Self {
        const FRAME: Bind = Uniform(size_of::<FrameUniforms>());
        const INSTANCE: Bind = UniformAt(INSTANCES_BOUND as usize);
        const BEFORE: Bind = UniformAt(size_of::<MotionUniforms>());
        let new = |label, bindings: &[Bind]| group_layout(device, label, bindings);
        Self {
            find_surfaces: new("gs4d find_surfaces", &[Write, Write]),
            project_bin: new("gs4d project_bin", &[INSTANCE, Write, Write, Write, Write, Read]),
            fill_bins: new("gs4d fill_bins", &[FRAME, Read, Write, Write, Read]),
            // The shader does not read the last but one buffer, the list of the visible splats. Because it is bound, the memory barrier for the
            // buffers that `project_bin` writes and `colors` reads comes before `sort_bins`, not between `sort_bins` and `colors`, so that
            // these two run at the same time.
            sort_bins: new("gs4d sort_bins", &[FRAME, Read, Write, Read, Write, Write, Read, Write]),
            colors: new("gs4d colors", &[INSTANCE, Read, Read, Write]),
            blend_blocks: new("gs4d blend_blocks", &[Read, Read, Read, Read, Read]),
            motion: new("gs4d motion", &[INSTANCE, BEFORE, Read, Read, Read, Write]),
        }
    }
}
