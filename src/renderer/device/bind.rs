//! Bind group layouts and compute pipelines.
//!
//! In: kinds of bindings in the order of a shader's `@binding` numbers; a module, its entry point and its groups. Out: wgpu layouts and
//! pipelines.

use std::num::NonZeroU64;

/// The kind of a binding.
#[derive(Debug, Clone, Copy)]
pub enum Bind {
    /// Uniform buffer of this many bytes.
    Uniform(usize),
    /// Uniform buffer of this many bytes, at an offset given with the dispatch.
    UniformAt(usize),
    /// Storage buffer that is read.
    Read,
    /// Storage buffer that is read and written.
    Write,
    /// Depth texture.
    Depth,
    /// Multisampled depth texture.
    Depths,
    /// Float texture that is read without filtering.
    Texture,
    /// Storage texture that is written.
    Target(wgpu::TextureFormat),
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

/// Creates a compute pipeline with these bind group layouts. `None` stands for a group that the shader does not use.
pub fn pipeline(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    entry: &str,
    groups: &[Option<&wgpu::BindGroupLayout>],
) -> wgpu::ComputePipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("gs4d"),
        bind_group_layouts: groups,
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

/// Creates a bind group layout for compute shaders, with bindings numbered in order.
pub fn group_layout(device: &wgpu::Device, label: &str, bindings: &[Bind]) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = bindings.iter().enumerate().map(|(i, bind)| bind.entry(i as u32)).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}
