//! The bind group layouts of all passes.
//!
//! In: a device. Out: [`Layouts`], in the order of the shaders' bindings.

use super::device::bind::{Bind, group_layout};
use super::global_sort::SortLayouts;
use super::layout;
use super::shaders::{Pixels, Storage};
use super::tile_bins::BinLayouts;

/// Bind group layouts, in the order of the shaders' bindings.
#[derive(Debug)]
pub(super) struct Layouts {
    pub activate: wgpu::BindGroupLayout,
    pub filter: wgpu::BindGroupLayout,
    pub active: wgpu::BindGroupLayout,
    /// Geometry and color, indexed by the storage of the capture (order of [`Storage::ALL`]).
    pub captures: [[wgpu::BindGroupLayout; 2]; 3],
    /// Uniforms, background, opaque depth and targets of the pixels, in the order of [`Pixels::ALL`].
    pub pixel: [wgpu::BindGroupLayout; 4],
    pub global_sort: SortLayouts,
    pub tile_bins: BinLayouts,
}

impl Layouts {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        use Bind::{Depth, Depths, Read, Target, Uniform, UniformAt, Write};
        const FRAME: usize = size_of::<layout::FrameUniforms>();
        let new = |label, bindings: &[Bind]| group_layout(device, label, bindings);
        let pixel = |pixels: Pixels| {
            let opaque = if pixels.multisampled { Depths } else { Depth };
            let targets = [pixels.precision.format(), wgpu::TextureFormat::Rg32Float].map(Target);
            new("gs4d pixel", &[Uniform(FRAME), Read, opaque, targets[0], targets[1]])
        };
        Self {
            activate: new("gs4d activate", &[UniformAt(size_of::<layout::Activation>()), Write, Write, Read]),
            filter: new("gs4d filter", &[Read]),
            active: new("gs4d active list", &[Read]),
            captures: Storage::ALL.map(|storage| {
                let color: &[Bind] = if storage == Storage::Coded { &[Read, Read] } else { &[Read] };
                [new("gs4d geometry", &[Read, Read]), new("gs4d color", color)]
            }),
            pixel: Pixels::ALL.map(pixel),
            global_sort: SortLayouts::new(device),
            tile_bins: BinLayouts::new(device),
        }
    }
}
