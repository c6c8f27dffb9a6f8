//! Single passes, on a device without a renderer.
//!
//! In: the name of a pass, and buffers by their names in its shader. Out: the contents of these buffers after a
//! dispatch.

use super::composed::compose;
use crate::support::no_gpu::no_gpu;
use bevy_gs4d::renderer::GpuContext;
use bytemuck::Pod;
use std::borrow::Cow;
use std::collections::BTreeMap;
use wgpu::naga::{AddressSpace, StorageAccess};
use wgpu::util::DeviceExt;
use wgpu::{BufferBindingType, BufferUsages};

/// A device without a renderer.
pub struct Gpu(GpuContext);

/// A compiled pass. Every dispatch binds all buffers that the shader declares.
pub struct Pass<'a> {
    gpu: &'a GpuContext,
    resources: Vec<Resource>,
    layouts: Vec<wgpu::BindGroupLayout>,
    /// By entry point.
    pipelines: BTreeMap<String, wgpu::ComputePipeline>,
}

struct Resource {
    group: u32,
    binding: u32,
    name: String,
}

impl Gpu {
    /// Returns a device; without an adapter, reports the skipped test and returns `None`.
    pub fn new() -> Option<Self> {
        GpuContext::headless(None).map(Self).map_err(|_| no_gpu()).ok()
    }

    /// Returns a buffer with the given values. Without values, the buffer has 64 zero bytes, so that it can be bound.
    pub fn buffer<T: Pod>(&self, values: &[T]) -> wgpu::Buffer {
        let contents: &[u8] = if values.is_empty() { &[0; 64] } else { bytemuck::cast_slice(values) };
        self.0.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: None,
            contents,
            usage: BufferUsages::UNIFORM | BufferUsages::STORAGE | BufferUsages::COPY_SRC,
        })
    }

    /// Reads the values of a buffer.
    pub fn read<T: Pod>(&self, buffer: &wgpu::Buffer) -> Vec<T> {
        let GpuContext { device, queue, .. } = &self.0;
        let copy = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: buffer.size(),
            usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, buffer.size());
        queue.submit([encoder.finish()]);
        copy.slice(..).map_async(wgpu::MapMode::Read, |mapped| mapped.expect("the copy can be mapped"));
        device.poll(wgpu::PollType::wait_indefinitely()).expect("the device finishes");
        let bytes = copy.slice(..).get_mapped_range().to_vec();
        bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect()
    }

    /// Compiles every entry point of a pass. The bindings, all of which are buffers, are those that naga finds in the
    /// shader.
    pub fn pass(&self, name: &str) -> Pass<'_> {
        let device = &self.0.device;
        let module = compose(name, &[]).expect("the pass composes");
        let mut resources = Vec::new();
        let mut groups: BTreeMap<u32, Vec<wgpu::BindGroupLayoutEntry>> = BTreeMap::new();
        for (_, variable) in module.global_variables.iter() {
            let (Some(at), Some(name)) = (variable.binding, variable.name.clone()) else { continue };
            groups.entry(at.group).or_default().push(layout_entry(at.binding, variable.space));
            resources.push(Resource { group: at.group, binding: at.binding, name });
        }
        let group = |entries: &Vec<wgpu::BindGroupLayoutEntry>| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries })
        };
        let layouts: Vec<wgpu::BindGroupLayout> = groups.values().map(group).collect();
        let bind_group_layouts: Vec<_> = layouts.iter().map(Some).collect();
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &bind_group_layouts,
            immediate_size: 0,
        });
        let entries: Vec<String> = module.entry_points.iter().map(|entry| entry.name.clone()).collect();
        let source = wgpu::ShaderSource::Naga(Cow::Owned(module));
        let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(name), source });
        let pipeline = |entry: String| {
            let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(&entry),
                layout: Some(&layout),
                module: &shader,
                entry_point: Some(&entry),
                // As in the renderer.
                compilation_options: wgpu::PipelineCompilationOptions {
                    zero_initialize_workgroup_memory: false,
                    ..Default::default()
                },
                cache: None,
            });
            (entry, pipeline)
        };
        Pass { gpu: &self.0, resources, pipelines: entries.into_iter().map(pipeline).collect(), layouts }
    }
}

impl Pass<'_> {
    /// Dispatches `workgroups` workgroups of an entry point.
    pub fn dispatch(&self, entry: &str, workgroups: u32, buffers: &[(&str, &wgpu::Buffer)]) {
        let GpuContext { device, queue, .. } = self.gpu;
        let bound = |resource: &Resource| {
            let buffer = buffers.iter().find(|(name, _)| *name == resource.name);
            let (_, buffer) = buffer.unwrap_or_else(|| panic!("no buffer is given for `{}`", resource.name));
            wgpu::BindGroupEntry { binding: resource.binding, resource: buffer.as_entire_binding() }
        };
        let group = |(layout, index): (&wgpu::BindGroupLayout, u32)| {
            let entries: Vec<_> = self.resources.iter().filter(|one| one.group == index).map(bound).collect();
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
        };
        let groups: Vec<wgpu::BindGroup> = self.layouts.iter().zip(0..).map(group).collect();
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipelines[entry]);
            for (group, index) in groups.iter().zip(0..) {
                pass.set_bind_group(index, group, &[]);
            }
            pass.dispatch_workgroups(workgroups, 1, 1);
        }
        queue.submit([encoder.finish()]);
    }
}

fn layout_entry(binding: u32, space: AddressSpace) -> wgpu::BindGroupLayoutEntry {
    let ty = match space {
        AddressSpace::Uniform => BufferBindingType::Uniform,
        AddressSpace::Storage { access } => {
            BufferBindingType::Storage { read_only: !access.contains(StorageAccess::STORE) }
        }
        other => panic!("binding {binding} is not a buffer but {other:?}"),
    };
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    }
}
