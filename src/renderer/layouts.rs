//! The bind group layouts of all passes.
//!
//! In: a device. Out: [`Layouts`], in the order of the shaders' bindings.

use super::bind::{Bind, group_layout};
use super::layout::{self, INSTANCES_BOUND};
use super::shaders::{Pixels, Storage};

/// Bind group layouts, in the order of the shaders' bindings.
#[derive(Debug)]
pub(super) struct Layouts {
    pub activate: wgpu::BindGroupLayout,
    pub filter: wgpu::BindGroupLayout,
    pub active: wgpu::BindGroupLayout,
    pub project: wgpu::BindGroupLayout,
    /// Geometry and color, indexed by the storage of the capture (order of [`Storage::ALL`]).
    pub captures: [[wgpu::BindGroupLayout; 2]; 3],
    pub sort: wgpu::BindGroupLayout,
    pub arguments: wgpu::BindGroupLayout,
    pub bin: wgpu::BindGroupLayout,
    pub ranges: wgpu::BindGroupLayout,
    pub blend: wgpu::BindGroupLayout,
    /// Uniforms, background, opaque depth and targets of the pixels, in the order of [`Pixels::ALL`].
    pub pixel: [wgpu::BindGroupLayout; 4],
    pub project_bin: wgpu::BindGroupLayout,
    pub sort_bins: wgpu::BindGroupLayout,
    pub colors: wgpu::BindGroupLayout,
    pub blend_blocks: wgpu::BindGroupLayout,
    /// `motion` of the reference design and of the fast design.
    pub motion: [wgpu::BindGroupLayout; 2],
}

impl Layouts {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        use Bind::{Depth, Depths, Read, Target, Uniform, UniformAt, Write};
        const FRAME: usize = size_of::<layout::FrameUniforms>();
        const INSTANCE: Bind = UniformAt(INSTANCES_BOUND as usize);
        const BEFORE: Bind = UniformAt(size_of::<layout::MotionUniforms>());
        let new = |label, bindings: &[Bind]| group_layout(device, label, bindings);
        let pixel = |pixels: Pixels| {
            let opaque = if pixels.multisampled { Depths } else { Depth };
            let targets = [pixels.precision.format(), wgpu::TextureFormat::Rg32Float].map(Target);
            new("gs4d pixel", &[Uniform(FRAME), Read, opaque, targets[0], targets[1]])
        };
        Self {
            activate: new("gs4d activate", &[UniformAt(size_of::<layout::Activation>()), Write, Write]),
            filter: new("gs4d filter", &[Read]),
            active: new("gs4d active list", &[Read]),
            project: new("gs4d project", &[INSTANCE, Write, Write]),
            captures: Storage::ALL.map(|storage| {
                let (geometry, color): (&[Bind], &[Bind]) = match storage {
                    Storage::Sliced => (&[Read, Read], &[Read]),
                    Storage::Packed => (&[Read, Read], &[Read]),
                    Storage::Coded => (&[Read, Read], &[Read, Read]),
                };
                [new("gs4d geometry", geometry), new("gs4d color", color)]
            }),
            sort: new(
                "gs4d sort",
                &[UniformAt(size_of::<layout::SortStep>()), Uniform(FRAME), Write, Read, Read, Write, Write, Write],
            ),
            arguments: new("gs4d arguments", &[Write]),
            bin: new("gs4d bin", &[Uniform(FRAME), Write, Read, Read, Write, Write, Write]),
            ranges: new("gs4d ranges", &[Uniform(FRAME), Read, Read, Write]),
            blend: new("gs4d blend", &[Read, Read, Read, Read, Read, Read]),
            pixel: Pixels::ALL.map(pixel),
            project_bin: new("gs4d project_bin", &[INSTANCE, Write, Write, Write, Write]),
            // The shader does not read the last buffer, the list of the visible splats. Because it is bound, the memory barrier for the
            // buffers that `project_bin` writes and `colors` reads comes before `sort_bins`, not between `sort_bins` and `colors`, so that
            // these two run at the same time.
            sort_bins: new("gs4d sort_bins", &[Uniform(FRAME), Read, Write, Read, Write, Write, Read]),
            colors: new("gs4d colors", &[INSTANCE, Read, Read, Write]),
            blend_blocks: new("gs4d blend_blocks", &[Read, Read, Read, Read, Read]),
            motion: [
                new("gs4d motion", &[INSTANCE, BEFORE, Read, Write]),
                new("gs4d motion", &[INSTANCE, BEFORE, Read, Read, Read, Write]),
            ],
        }
    }
}
