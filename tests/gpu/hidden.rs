//! Work that is saved behind opaque surfaces.
//!
//! In: a list of `blend_blocks` in which splats behind a surface precede splats in front of it, as no sorted list has
//! them; depth textures for `find_surfaces`; scenes behind walls. Out: proof that a pixel visits no batch after the
//! first whose last splat is hidden: it does not show the later splats; the farthest surface of each tile; that splats
//! behind a wall are left out before they are sorted, and no others. Skipped where there is no GPU.

use crate::support::composed::compose;
use crate::support::gpu;
use crate::support::surfaces::{depth_texture, edge};
use bevy_gs4d::internal::renderer::MULTISAMPLED;
use bevy_gs4d::internal::renderer::{BIN_COUNTERS, FrameUniforms, SplatShape, VisibleSplat};
use bevy_gs4d::internal::renderer::{Blending, EIGHT_AT_ONCE, LARGE_BATCHES};
use bevy_gs4d::renderer::{Design, GpuContext, Instance, OpaqueDepth, ViewParameters};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::view::{Appearance, Background, Camera, RasterFov};
use bytemuck::{Pod, Zeroable};
use glam::{UVec2, Vec3};
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

/// Returns the pipeline of a pass, with bind group layouts of the bindings that it uses.
fn pipeline(device: &wgpu::Device, pass: &str, definitions: &[&str]) -> wgpu::ComputePipeline {
    let source = wgpu::ShaderSource::Naga(Cow::Owned(compose(pass, definitions).expect("it composes")));
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some(pass),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

/// Returns the depth of the farthest surface of each tile and of the picture, by `find_surfaces`. `size` is that of the
/// picture, its tiles, and the samples of the surface.
fn find_surfaces(
    context: &GpuContext,
    definitions: &[&str],
    surface: &wgpu::TextureView,
    (size, tiles, samples): (UVec2, UVec2, u32),
) -> (Vec<f32>, f32) {
    let GpuContext { device, queue, .. } = context;
    let pipeline = pipeline(device, "find_surfaces", definitions);
    let frame = FrameUniforms {
        size: size.to_array(),
        tiles: tiles.to_array(),
        opaque_samples: samples,
        opaque_distance: [NEAR, 0.0, 0.0, 1.0],
        ..FrameUniforms::zeroed()
    };
    let frame = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents: bytemuck::bytes_of(&frame),
        usage: wgpu::BufferUsages::UNIFORM,
    });
    let surfaces = u64::from(4 * tiles.element_product());
    let counters = u64::from(4 * BIN_COUNTERS);
    let buffer = |size, usage| {
        device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
    };
    let [written, counted] =
        [surfaces, counters].map(|size| buffer(size, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC));
    let copy = buffer(surfaces + counters, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
    let group = |index, entries: &[wgpu::BindGroupEntry<'_>]| {
        let layout = &pipeline.get_bind_group_layout(index);
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries })
    };
    let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
    let pixels = [entry(0, frame.as_entire_binding()), entry(2, wgpu::BindingResource::TextureView(surface))];
    let written_to = [entry(0, written.as_entire_binding()), entry(1, counted.as_entire_binding())];
    let groups = [group(0, &pixels), group(1, &written_to)];
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &groups[0], &[]);
        pass.set_bind_group(1, &groups[1], &[]);
        pass.dispatch_workgroups(tiles.x.div_ceil(2), tiles.y.div_ceil(2), 1);
    }
    encoder.copy_buffer_to_buffer(&written, 0, &copy, 0, surfaces);
    encoder.copy_buffer_to_buffer(&counted, 0, &copy, surfaces, counters);
    queue.submit([encoder.finish()]);
    copy.slice(..).map_async(wgpu::MapMode::Read, |mapped| mapped.expect("the copy can be mapped"));
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the device finishes");
    let orders: Vec<u32> = bytemuck::pod_collect_to_vec(&copy.slice(..).get_mapped_range());
    // The inverse of `depth_order` for positive depths.
    let depth = |order: u32| f32::from_bits(order ^ 0x8000_0000);
    let (of_tiles, counters) = orders.split_at(tiles.element_product() as usize);
    (of_tiles.iter().copied().map(depth).collect(), depth(counters[2]))
}

/// Blends a list whose first batch is behind the surface and whose other splats are in front of it. Returns the red of
/// each pixel.
fn blend(context: &GpuContext, definitions: &[&str], surface: &wgpu::TextureView, samples: u32) -> Vec<f32> {
    let GpuContext { device, queue, .. } = context;
    let pipeline = pipeline(device, "blend_blocks", definitions);
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
fn find_surfaces_finds_the_farthest_surface_of_each_tile() {
    let Some(headless) = gpu::headless() else { return };
    let context = headless.context();
    // The last row and column of tiles are not whole.
    let size = UVec2::new(75, 40);
    let tiles = UVec2::new(5, 3);
    let is_at = |found: f32, depth: f32| (found / depth - 1.0).abs() < 1e-5;
    const FAR: f32 = 3.4e38;
    let whole = depth_texture(context, size, NEAR / SURFACE);
    let (found, farthest) = find_surfaces(context, &[], &whole, (size, tiles, 1));
    assert!(is_at(farthest, SURFACE), "the farthest of the picture: {farthest}");
    assert_eq!(found.len(), 15, "a depth for each tile");
    let is_wall = found.iter().all(|&found| is_at(found, SURFACE));
    assert!(is_wall, "a wall before everything; pixels outside the picture do not count: {found:?}");
    let (found, farthest) = find_surfaces(context, &[], &whole, (size, tiles, 0));
    assert!(is_at(farthest, FAR), "no surfaces: {farthest}");
    assert!(found.iter().all(|&found| is_at(found, FAR)), "no surfaces: {found:?}");
    let (samples, column) = edge(context, size, NEAR, SURFACE, 0.0);
    let samples = samples.create_view(&wgpu::TextureViewDescriptor::default());
    let (found, farthest) = find_surfaces(context, MULTISAMPLED, &samples, (size, tiles, 4));
    assert!(is_at(farthest, FAR), "half of the picture has no surface: {farthest}");
    for (tile, found) in found.into_iter().enumerate() {
        let end = 16 * (tile as u32 % tiles.x + 1);
        let expected = if end <= column { SURFACE } else { FAR };
        assert!(is_at(found, expected), "tile {tile}: {found}, expected {expected}: a sample without a surface is far");
    }
}

#[test]
fn splats_that_surfaces_hide_are_left_out_before_they_are_sorted() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = synthesize(&SynthSettings { count: 3_000, ..SynthSettings::default() });
    let scene = scene.into_runtime().expect("a scene that can be drawn");
    let capture = headless.upload(&scene).expect("the scene fits");
    let size = UVec2::new(190, 120);
    let camera = Camera::look_at(Vec3::new(2.0, 1.0, 1.2), Vec3::ZERO, Vec3::Z, 0.8, size);
    let view = camera.view(0.4, RasterFov::Reference);
    let instances = [Instance { capture: &capture, active: None, view, appearance: Appearance::default() }];
    let background = Background::Color([0.3, 0.2, 0.1]);
    let open = ViewParameters { background, depths: false, ..ViewParameters::default() };
    headless.set_design(Design::TileBins);
    let all = headless.render_all(&instances, &open).expect("the picture fits").counts;
    assert!(all.visible > 1_000, "the scene is visible without a wall: {all:?}");
    for (samples, distance) in [(1, 0.2), (4, 0.2), (1, 2.4), (4, 2.4)] {
        let texture = match samples {
            1 => depth_texture(headless.context(), size, NEAR / distance),
            _ => edge(headless.context(), size, NEAR, distance, 0.3).0.create_view(&Default::default()),
        };
        let opaque = OpaqueDepth { texture: &texture, samples, origin: UVec2::ZERO, distance: [NEAR, 0.0, 0.0, 1.0] };
        let behind = ViewParameters { opaque: Some(opaque), ..open };
        let [expected, found] = [Design::GlobalSort, Design::TileBins].map(|design| {
            headless.set_design(design);
            headless.render_all(&instances, &behind).expect("the picture fits")
        });
        let what = format!("{samples} samples at {distance}");
        let apart = |(a, b): (&Vec3, &Vec3)| (*a - *b).abs().max_element();
        let apart = found.picture.pixels.iter().zip(&expected.picture.pixels).map(apart).fold(0.0, f32::max);
        assert!(apart <= 1e-5, "{what}: the picture differs by {apart}");
        match (samples, distance < 1.0) {
            (1, true) => assert_eq!(found.counts.visible, 0, "{what}: nothing is sorted behind a wall"),
            _ => assert!((1..all.visible).contains(&found.counts.visible), "{what}: some are left: {:?}", found.counts),
        }
    }
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
