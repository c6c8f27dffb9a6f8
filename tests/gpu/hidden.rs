//! The end of lists behind opaque surfaces.
//!
//! In: a list of `blend_blocks` in which splats behind a surface precede splats in front of it, as no sorted list has them. Out: proof that a
//! pixel visits no batch after the first whose last splat is hidden: it does not show the later splats. Skipped where there is no GPU.

use crate::support::composed::compose;
use crate::support::gpu;
use crate::support::surfaces::{depth_texture, edge};
use bevy_gs4d::internal::renderer::layout::{FrameUniforms, SplatShape, VisibleSplat};
use bevy_gs4d::internal::renderer::tile_bins::{Blending, EIGHT_AT_ONCE, LARGE_BATCHES};
use bevy_gs4d::renderer::GpuContext;
use bytemuck::{Pod, Zeroable};
use glam::UVec2;
use std::borrow::Cow;
use wgpu::util::DeviceExt;

/// One tile.
const SIZE: UVec2 = UVec2::splat(16);
const SPLATS: usize = 1024;
/// No batch is larger.
const BATCH: usize = 256;
const NEAR: f32 = 0.1;
/// Depths of the surface and of splats behind it and in front of it.
const SURFACE: f32 = 1.0;
const BEHIND: f32 = 2.0;
const IN_FRONT: f32 = 0.5;

/// Blends a list whose first batch is behind the surface and whose other splats are in front of it. Returns the red of each pixel.
fn blend(context: &GpuContext, definitions: &[&str], surface: &wgpu::TextureView, samples: u32) -> Vec<f32> {
    let GpuContext { device, queue, .. } = context;
    let source = wgpu::ShaderSource::Naga(Cow::Owned(compose("blend_blocks", definitions).expect("it composes")));
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("blend_blocks"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let buffer = |contents: &[u8], usage| {
        device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: None, contents, usage })
    };
    fn bytes<T: Pod>(values: &[T]) -> &[u8] {
        bytemuck::cast_slice(values)
    }
    let storage = |contents: &[u8]| buffer(contents, wgpu::BufferUsages::STORAGE);
    let frame = FrameUniforms {
        size: SIZE.to_array(),
        tiles: [1, 1],
        slots: SPLATS as u32,
        opaque_samples: samples,
        opaque_distance: [NEAR, 0.0, 0.0, 1.0],
        binning: [2 | (1 << 8), SPLATS as u32, 0, 1],
        ..FrameUniforms::zeroed()
    };
    let shapes: Vec<SplatShape> = (0..SPLATS)
        .map(|index| SplatShape {
            place: [8.0, 8.0, 0.5, if index < BATCH { BEHIND } else { IN_FRONT }],
            conic: [1e-3, 0.0, 1e-3, 0.0],
        })
        .collect();
    let target = device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: SIZE.x, height: SIZE.y, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let written = target.create_view(&wgpu::TextureViewDescriptor::default());
    let frame = buffer(bytemuck::bytes_of(&frame), wgpu::BufferUsages::UNIFORM);
    let environment = storage(&[0; 16]);
    let lists = [
        storage(bytes(&[[0, SPLATS as u32]])),
        storage(bytes(&(0..SPLATS as u32).collect::<Vec<_>>())),
        storage(bytes(&shapes)),
        storage(bytes(&vec![[1.0_f32; 4]; SPLATS])),
        storage(bytes(&vec![VisibleSplat::zeroed(); SPLATS])),
    ];
    let group = |index: u32, resources: &[(u32, wgpu::BindingResource<'_>)]| {
        let entries: Vec<_> = resources
            .iter()
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
            .collect();
        let layout = &pipeline.get_bind_group_layout(index);
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
    };
    let pixels = group(
        0,
        &[
            (0, frame.as_entire_binding()),
            (1, environment.as_entire_binding()),
            (2, wgpu::BindingResource::TextureView(surface)),
            (3, wgpu::BindingResource::TextureView(&written)),
        ],
    );
    let bound: Vec<_> = (0..).zip(lists.iter().map(wgpu::Buffer::as_entire_binding)).collect();
    let lists = group(1, &bound);
    // Rows of copied textures are multiples of 256 bytes.
    let copy = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(256 * SIZE.y),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &pixels, &[]);
        pass.set_bind_group(1, &lists, &[]);
        pass.dispatch_workgroups(1, 1, 1);
    }
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(256), rows_per_image: None };
    encoder.copy_texture_to_buffer(
        target.as_image_copy(),
        wgpu::TexelCopyBufferInfo { buffer: &copy, layout },
        target.size(),
    );
    queue.submit([encoder.finish()]);
    copy.slice(..).map_async(wgpu::MapMode::Read, |mapped| mapped.expect("the copy can be mapped"));
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the device finishes");
    let read = copy.slice(..).get_mapped_range().to_vec();
    read.chunks_exact(16).map(|pixel| bytemuck::pod_read_unaligned(&pixel[..4])).collect()
}

#[test]
fn a_pixel_visits_no_batch_behind_its_surfaces() {
    let Some(headless) = gpu::headless() else { return };
    let context = headless.context();
    let large = context.device.limits().max_compute_workgroup_storage_size >= 32 * 1024;
    let variants = |batches: &'static [&'static str]| [&[][..], batches].into_iter().take(if large { 2 } else { 1 });
    let surface = depth_texture(context, SIZE, NEAR / SURFACE);
    let behind = Blending::ColorBehindSurfaces.definitions();
    for batches in variants(EIGHT_AT_ONCE) {
        let red = blend(context, &[behind, batches].concat(), &surface, 1);
        assert!(red.iter().all(|&red| red == 0.0), "{batches:?}: the surface ends the list, found {:?}", &red[..16]);
        // Without a surface all splats are blended.
        let open = blend(context, &[behind, batches].concat(), &surface, 0);
        assert!(open.iter().all(|&red| red > 0.5), "{batches:?}: without a surface, found {:?}", &open[..16]);
    }
    // Samples of a surface cover the left half. The right half blends the whole list.
    let (samples, column) = edge(context, SIZE, NEAR, SURFACE, 0.0);
    let samples = samples.create_view(&wgpu::TextureViewDescriptor::default());
    let behind = Blending::ColorBehindSamples.definitions();
    for batches in variants(LARGE_BATCHES) {
        let red = blend(context, &[behind, batches].concat(), &samples, 4);
        for (index, &red) in red.iter().enumerate() {
            let x = index as u32 % SIZE.x;
            if x != column {
                assert_eq!(red == 0.0, x < column, "{batches:?}, column {x}: red is {red}");
            }
        }
    }
}
