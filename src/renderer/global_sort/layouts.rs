//! The bind group layouts of global sort.
//!
//! In: a device. Out: [`SortLayouts`], in the order of the shaders' bindings.

use crate::renderer::device::bind::Bind;
use crate::renderer::device::bind::Bind::{Read, Uniform, UniformAt, Write};
use crate::renderer::device::bind::group_layout;
use crate::renderer::layout::{FrameUniforms, INSTANCES_BOUND, MotionUniforms, SortStep};

/// Bind group layouts, in the order of the shaders' bindings.
#[derive(Debug)]
pub(in crate::renderer) struct SortLayouts {
    pub project: wgpu::BindGroupLayout,
    pub sort: wgpu::BindGroupLayout,
    pub arguments: wgpu::BindGroupLayout,
    pub bin: wgpu::BindGroupLayout,
    pub ranges: wgpu::BindGroupLayout,
    pub blend: wgpu::BindGroupLayout,
    pub motion: wgpu::BindGroupLayout,
}

impl SortLayouts {
    pub(in crate::renderer) fn new(device: &wgpu::Device) -> Self {
        const FRAME: Bind = Uniform(size_of::<FrameUniforms>());
        const INSTANCE: Bind = UniformAt(INSTANCES_BOUND as usize);
        const STEP: Bind = UniformAt(size_of::<SortStep>());
        const BEFORE: Bind = UniformAt(size_of::<MotionUniforms>());
        let new = |label, bindings: &[Bind]| group_layout(device, label, bindings);
        Self {
            project: new("gs4d project", &[INSTANCE, Write, Write]),
            sort: new("gs4d sort", &[STEP, FRAME, Write, Read, Read, Write, Write, Write]),
            arguments: new("gs4d arguments", &[Write]),
            bin: new("gs4d bin", &[FRAME, Write, Read, Read, Write, Write, Write]),
            ranges: new("gs4d ranges", &[FRAME, Read, Read, Write]),
            blend: new("gs4d blend", &[Read, Read, Read, Read, Read, Read]),
            motion: new("gs4d motion", &[INSTANCE, BEFORE, Read, Write]),
        }
    }
}
