//! The pipelines: one [`Renderer`] for each device.
//!
//! In: a device. Out: compiled passes and the bind group layouts that they share with the buffers of views and captures.

use super::buffers::CODEBOOK_SCALES;
use super::shaders::{MULTISAMPLED, ShaderChecks, Storage, module};
use super::view::buffer;
use super::{GpuError, layout, note_created};
use std::num::NonZeroU64;

/// All pipelines and layouts.
#[derive(Debug)]
pub struct Renderer {
    pub(super) layouts: Layouts,
    pub(super) activate_count: wgpu::ComputePipeline,
    pub(super) activate_scan: wgpu::ComputePipeline,
    pub(super) activate_write: wgpu::ComputePipeline,
    /// By how a capture is stored, in the order of [`Storage::ALL`].
    project: [wgpu::ComputePipeline; 3],
    pub(super) sort_count: wgpu::ComputePipeline,
    pub(super) sort_scan: wgpu::ComputePipeline,
    pub(super) sort_visible: wgpu::ComputePipeline,
    pub(super) sort_scatter: wgpu::ComputePipeline,
    pub(super) bin_count: wgpu::ComputePipeline,
    pub(super) bin_scan: wgpu::ComputePipeline,
    pub(super) bin_offset: wgpu::ComputePipeline,
    pub(super) bin_emit: wgpu::ComputePipeline,
    pub(super) ranges: wgpu::ComputePipeline,
    pub(super) blend: wgpu::ComputePipeline,
    pub(super) blend_multisampled: wgpu::ComputePipeline,
    /// Stands in for a list of active Gaussians where all are drawn.
    pub(super) no_list: wgpu::BindGroup,
}

/// Bind group layouts, in the order of the shaders' bindings.
#[derive(Debug)]
pub(super) struct Layouts {
    pub activate: wgpu::BindGroupLayout,
    pub filter: wgpu::BindGroupLayout,
    pub active: wgpu::BindGroupLayout,
    pub project: wgpu::BindGroupLayout,
    /// By how a capture is stored, in the order of [`Storage::ALL`].
    pub captures: [wgpu::BindGroupLayout; 3],
    pub sort: wgpu::BindGroupLayout,
    pub arguments: wgpu::BindGroupLayout,
    pub bin: wgpu::BindGroupLayout,
    pub ranges: wgpu::BindGroupLayout,
    pub blend: wgpu::BindGroupLayout,
    pub blend_multisampled: wgpu::BindGroupLayout,
}

/// Kinds of bindings, to write layouts in one line each.
#[derive(Clone, Copy)]
pub(super) enum Bind {
    /// Uniform buffer of this many bytes.
    Uniform(usize),
    /// The same, at an offset given with the dispatch.
    UniformAt(usize),
    Read,
    Write,
    Depth,
    /// A multisampled depth.
    Depths,
    /// A texture that is read as it is.
    Texture,
    Target(wgpu::TextureFormat),
}

impl Renderer {
    /// Compiles every pass.
    ///
    /// # Errors
    /// When the device lacks a limit that the passes need, or a shader does not compile.
    pub fn new(device: &wgpu::Device, checks: ShaderChecks) -> Result<Self, GpuError> {
        check_limits(&device.limits())?;
        let layouts = Layouts::new(device);
        let shader = |name| module(device, name, &[], checks);
        let activate = shader("activate")?;
        let (sort, bin) = (shader("sort")?, shader("bin")?);
        let (ranges, blend) = (shader("ranges")?, shader("blend")?);
        let blend_multisampled = module(device, "blend", MULTISAMPLED, checks)?;
        let no_list = buffer(device, "gs4d no active list", 4, wgpu::BufferUsages::STORAGE);
        let pipeline = |module: &wgpu::ShaderModule, entry: &str, groups: &[&wgpu::BindGroupLayout]| {
            pipeline(device, module, entry, groups)
        };
        Ok(Self {
            activate_count: pipeline(&activate, "count", &[&layouts.activate, &layouts.filter]),
            activate_scan: pipeline(&activate, "scan", &[&layouts.activate, &layouts.filter]),
            activate_write: pipeline(&activate, "write", &[&layouts.activate, &layouts.filter]),
            project: {
                let mut all = Vec::new();
                for (storage, capture) in Storage::ALL.into_iter().zip(&layouts.captures) {
                    let shader = module(device, "project", storage.definitions(), checks)?;
                    all.push(pipeline(&shader, "project", &[&layouts.project, capture, &layouts.active]));
                }
                all.try_into().map_err(|_| GpuError::Device("a pipeline is missing".into()))?
            },
            sort_count: pipeline(&sort, "count", &[&layouts.sort]),
            sort_scan: pipeline(&sort, "scan", &[&layouts.sort]),
            sort_visible: pipeline(&sort, "visible", &[&layouts.sort, &layouts.arguments]),
            sort_scatter: pipeline(&sort, "scatter", &[&layouts.sort]),
            bin_count: pipeline(&bin, "count", &[&layouts.bin]),
            bin_scan: pipeline(&bin, "scan", &[&layouts.bin, &layouts.arguments]),
            bin_offset: pipeline(&bin, "offset", &[&layouts.bin]),
            bin_emit: pipeline(&bin, "emit", &[&layouts.bin]),
            ranges: pipeline(&ranges, "ranges", &[&layouts.ranges]),
            blend: pipeline(&blend, "blend", &[&layouts.blend]),
            blend_multisampled: pipeline(&blend_multisampled, "blend", &[&layouts.blend_multisampled]),
            no_list: bind_group(device, "gs4d no active list", &layouts.active, &[no_list.as_entire_binding()]),
            layouts,
        })
    }

    /// `project` for captures stored this way.
    pub(super) fn project(&self, storage: Storage) -> &wgpu::ComputePipeline {
        &self.project[storage as usize]
    }

    /// The bind group of one part of a capture, its buffers in the order of the shader's bindings.
    pub(super) fn capture_bind_group(
        &self,
        device: &wgpu::Device,
        storage: Storage,
        buffers: &[&wgpu::Buffer],
    ) -> wgpu::BindGroup {
        let resources: Vec<_> = buffers.iter().map(|buffer| buffer.as_entire_binding()).collect();
        bind_group(device, "gs4d capture", &self.layouts.captures[storage as usize], &resources)
    }
}

impl Layouts {
    fn new(device: &wgpu::Device) -> Self {
        use Bind::{Depth, Depths, Read, Target, Uniform, UniformAt, Write};
        const FRAME: usize = size_of::<layout::Frame>();
        const INSTANCE: Bind = UniformAt(size_of::<layout::Instance>());
        let new = |label, bindings: &[Bind]| group_layout(device, label, bindings);
        let blend = |depth| {
            let targets = [wgpu::TextureFormat::Rgba32Float, wgpu::TextureFormat::Rg32Float].map(Target);
            [Uniform(FRAME), Read, Read, Read, Read, depth, targets[0], targets[1]]
        };
        Self {
            activate: new("gs4d activate", &[UniformAt(size_of::<layout::Activation>()), Write, Write]),
            filter: new("gs4d filter", &[Read]),
            active: new("gs4d active list", &[Read]),
            project: new("gs4d project", &[INSTANCE, Write, Write]),
            captures: [
                new("gs4d capture", &[Read, Read]),
                new("gs4d capture", &[Read, Read, Read]),
                new("gs4d capture", &[Read, Read, Read, Read, Uniform(16 * CODEBOOK_SCALES)]),
            ],
            sort: new(
                "gs4d sort",
                &[UniformAt(size_of::<layout::SortStep>()), Uniform(FRAME), Write, Read, Read, Write, Write, Write],
            ),
            arguments: new("gs4d arguments", &[Write]),
            bin: new("gs4d bin", &[Uniform(FRAME), Write, Read, Read, Write, Write, Write]),
            ranges: new("gs4d ranges", &[Uniform(FRAME), Read, Read, Write]),
            blend: new("gs4d blend", &blend(Depth)),
            blend_multisampled: new("gs4d blend", &blend(Depths)),
        }
    }
}

impl Bind {
    fn entry(self, binding: u32) -> wgpu::BindGroupLayoutEntry {
        let buffer = |ty, has_dynamic_offset, size: usize| wgpu::BindingType::Buffer {
            ty,
            has_dynamic_offset,
            min_binding_size: NonZeroU64::new(size as u64),
        };
        let ty = match self {
            Self::Uniform(size) => buffer(wgpu::BufferBindingType::Uniform, false, size),
            Self::UniformAt(size) => buffer(wgpu::BufferBindingType::Uniform, true, size),
            Self::Read => buffer(wgpu::BufferBindingType::Storage { read_only: true }, false, 0),
            Self::Write => buffer(wgpu::BufferBindingType::Storage { read_only: false }, false, 0),
            Self::Depth | Self::Depths => wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Depth,
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: matches!(self, Self::Depths),
            },
            Self::Texture => wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable: false },
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: false,
            },
            Self::Target(format) => wgpu::BindingType::StorageTexture {
                access: wgpu::StorageTextureAccess::WriteOnly,
                format,
                view_dimension: wgpu::TextureViewDimension::D2,
            },
        };
        wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
    }
}

/// A compute pipeline over these groups.
pub(super) fn pipeline(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    entry: &str,
    groups: &[&wgpu::BindGroupLayout],
) -> wgpu::ComputePipeline {
    let groups: Vec<_> = groups.iter().map(|group| Some(*group)).collect();
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("gs4d"),
        bind_group_layouts: &groups,
        immediate_size: 0,
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(entry),
        layout: Some(&layout),
        module,
        entry_point: Some(entry),
        // Every pass writes its workgroup memory before it reads it.
        compilation_options: wgpu::PipelineCompilationOptions {
            zero_initialize_workgroup_memory: false,
            ..Default::default()
        },
        cache: None,
    })
}

/// A bind group layout whose bindings are numbered in order.
pub(super) fn group_layout(device: &wgpu::Device, label: &str, bindings: &[Bind]) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = bindings.iter().enumerate().map(|(i, bind)| bind.entry(i as u32)).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

/// A bind group whose bindings are numbered in order.
pub(super) fn bind_group(
    device: &wgpu::Device,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    resources: &[wgpu::BindingResource<'_>],
) -> wgpu::BindGroup {
    let entries: Vec<_> = resources
        .iter()
        .enumerate()
        .map(|(i, resource)| wgpu::BindGroupEntry { binding: i as u32, resource: resource.clone() })
        .collect();
    note_created();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
}

fn check_limits(limits: &wgpu::Limits) -> Result<(), GpuError> {
    let needs = [
        ("max_compute_invocations_per_workgroup", limits.max_compute_invocations_per_workgroup, 256),
        ("max_compute_workgroup_size_x", limits.max_compute_workgroup_size_x, 256),
        ("max_storage_buffers_per_shader_stage", limits.max_storage_buffers_per_shader_stage, 8),
        // Three arrays of `blend`.
        ("max_compute_workgroup_storage_size", limits.max_compute_workgroup_storage_size, 16 * 256 * 3 + 16),
    ];
    for (what, found, needed) in needs {
        if found < needed {
            return Err(GpuError::Limit { what, found: found.into(), needed: needed.into() });
        }
    }
    Ok(())
}
