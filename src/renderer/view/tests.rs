//! Counters and stamps of tile bins from frame to frame; the places of lists.
//!
//! In: synthetic scenes, frames with and without Gaussians, counters that the tests write. Out: proof that a frame depends on no counter and no
//! splat of an earlier frame, and that lists have places of their own. Skipped where there is no GPU.

use super::ViewRenderer;
use crate::gaussian::{Gaussian, Harmonics};
use crate::renderer::capture::GpuCapture;
use crate::renderer::device::GpuContext;
use crate::renderer::frame::Blending;
use crate::renderer::frame::Design;
use crate::renderer::frame::{Instance, OpaqueDepth, ViewParameters};
use crate::renderer::layout::Counters;
use crate::renderer::list_rooms::{ListPlace, ListRooms};
use crate::renderer::pipelines::Renderer;
use crate::renderer::shaders::ShaderChecks;
use crate::renderer::tile_bins::{BinVariant, Lists, MAX_SLOTS, TileBins};
use crate::scene::{Bounds, RuntimeScene};
use crate::view::{Appearance, Camera, RasterFov, View};
use depth_texture::uniform_depth;
use glam::{UVec2, Vec3};
use std::any::Any;
use std::thread;
use std::time::{Duration, Instant};

#[cfg_attr(
    all(feature = "cli", feature = "viewer"),
    expect(unreachable_pub, reason = "the integration tests include the same file")
)]
#[path = "../../../tests/support/depth_texture.rs"]
mod depth_texture;
#[cfg_attr(
    all(feature = "cli", feature = "viewer"),
    expect(unreachable_pub, reason = "the integration tests include the same file")
)]
#[path = "../../../tests/support/skip.rs"]
pub(crate) mod skip;

/// Four tiles in two bins; rows of 1024 bytes.
const SIZE: UVec2 = UVec2::new(64, 16);

struct Gpu {
    context: GpuContext,
    renderer: Renderer,
}

/// Returns a device; without an adapter, reports the skipped test and returns `None`.
fn gpu() -> Option<Gpu> {
    match GpuContext::headless(None) {
        Ok(context) => {
            let renderer = Renderer::new(&context.device, ShaderChecks::On).expect("the passes compile");
            Some(Gpu { context, renderer })
        }
        Err(error) => {
            skip::skip(error);
            None
        }
    }
}

/// Returns the tile bins of a view.
fn bins(view: &ViewRenderer) -> &TileBins {
    let design: &dyn Any = &*view.design;
    design.downcast_ref().expect("the view is drawn with tile bins")
}

impl Gpu {
    fn upload(&self, gaussians: Vec<Gaussian>) -> GpuCapture {
        let values = (0..gaussians.len() * 3).map(|index| (index % 11) as f32 / 11.0).collect();
        let harmonics = Harmonics { coefficients: 1, degree: 0, degree_t: 0, values };
        let scene = RuntimeScene::sliced(gaussians, harmonics);
        GpuCapture::upload(&self.context.device, &self.context.queue, &self.renderer, &scene).expect("the scene fits")
    }

    fn view(&self) -> ViewRenderer {
        let mut view = ViewRenderer::new(&self.context.device, &self.renderer);
        view.set_design(&self.renderer, Design::TileBins);
        view
    }

    /// Draws a frame and returns its counters.
    fn draw(&self, view: &mut ViewRenderer, capture: &GpuCapture, time: f32) -> Counters {
        self.draw_with(view, capture, seen(SIZE, time), &ViewParameters::default())
    }

    /// Draws a frame without depths behind a wall at this depth, and returns its counters.
    fn draw_behind(&self, view: &mut ViewRenderer, capture: &GpuCapture, size: UVec2, wall: f32) -> Counters {
        let GpuContext { device, queue, .. } = &self.context;
        let texture = uniform_depth(device, queue, size, 0.1 / wall);
        let distance = [0.1, 0.0, 0.0, 1.0];
        let opaque = Some(OpaqueDepth { texture: &texture, samples: 1, origin: UVec2::ZERO, distance });
        let parameters = ViewParameters { opaque, depths: false, ..ViewParameters::default() };
        self.draw_with(view, capture, seen(size, 0.0), &parameters)
    }

    fn draw_with(
        &self,
        view: &mut ViewRenderer,
        capture: &GpuCapture,
        seen: View,
        parameters: &ViewParameters<'_>,
    ) -> Counters {
        let GpuContext { device, queue, .. } = &self.context;
        let instances = [Instance { capture, active: None, view: seen, appearance: Appearance::default() }];
        view.prepare(device, queue, &self.renderer, &instances, parameters).expect("the frame fits");
        assert_eq!(view.design(), Design::TileBins, "the scene is small enough for every driver");
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        view.record(&self.renderer, &mut encoder, &instances);
        queue.submit([encoder.finish()]);
        let (counters, offset) = view.design.counters().expect("a prepared view");
        bytemuck::pod_read_unaligned(&self.read(size_of::<Counters>() as u64, |encoder, to| {
            encoder.copy_buffer_to_buffer(counters, offset, to, 0, to.size());
        }))
    }

    /// Returns color and transmittance of each pixel of the last frame.
    fn picture(&self, view: &ViewRenderer) -> Vec<[f32; 4]> {
        let (color, _) = view.textures().expect("a frame");
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(SIZE.x * 16), rows_per_image: None };
        let bytes = self.read(u64::from(SIZE.element_product() * 16), |encoder, buffer| {
            let size = color.size();
            encoder.copy_texture_to_buffer(color.as_image_copy(), wgpu::TexelCopyBufferInfo { buffer, layout }, size);
        });
        bytemuck::pod_collect_to_vec(&bytes)
    }

    fn read(&self, size: u64, copy: impl FnOnce(&mut wgpu::CommandEncoder, &wgpu::Buffer)) -> Vec<u8> {
        let GpuContext { device, queue, .. } = &self.context;
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let descriptor = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
        let buffer = device.create_buffer(&descriptor);
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        copy(&mut encoder, &buffer);
        queue.submit([encoder.finish()]);
        buffer.slice(..).map_async(wgpu::MapMode::Read, |mapped| mapped.expect("the copy can be mapped"));
        device.poll(wgpu::PollType::wait_indefinitely()).expect("the device finishes");
        buffer.slice(..).get_mapped_range().to_vec()
    }
}

/// Returns the largest difference of a value of two pictures.
fn largest_difference(found: &[[f32; 4]], expected: &[[f32; 4]]) -> f32 {
    let apart = found.iter().zip(expected).flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b).abs()));
    apart.fold(0.0, f32::max)
}

fn seen(size: UVec2, time: f32) -> View {
    let camera = Camera::look_at(Vec3::new(0.0, -3.0, 0.0), Vec3::ZERO, Vec3::Z, 0.8, size);
    camera.view(time, RasterFov::Reference)
}

/// Returns faint Gaussians around the origin that are present at all times.
fn crowd(count: usize) -> Vec<Gaussian> {
    let one = |index: usize| {
        let spread = |step: usize| (index * step % 97) as f32 / 97.0 - 0.5;
        Gaussian {
            mean: [0.1 * spread(31), (index * 37 % 101) as f32 / 101.0, 0.1 * spread(57)],
            mean_t: 0.0,
            velocity: [0.0; 3],
            sigma_t: f32::INFINITY,
            covariance: [1e-3, 0.0, 0.0, 1e-3, 0.0, 1e-3],
            opacity: 0.012,
            padding: 0.0,
        }
    };
    (0..count).map(one).collect()
}

#[test]
fn a_frame_without_gaussians_leaves_no_counters_behind() {
    let Some(gpu) = gpu() else { return };
    let (capture, empty, mut view) = (gpu.upload(crowd(500)), gpu.upload(Vec::new()), gpu.view());
    let expected = gpu.draw(&mut view, &capture, 0.0);
    assert!(expected.visible == 500 && expected.padding == expected.pairs, "all pairs are written: {expected:?}");
    for frame in 0..8 {
        // Both sets of counters see each kind of frame after each kind.
        let full = frame % 3 == 0;
        let found = gpu.draw(&mut view, if full { &capture } else { &empty }, 0.0);
        let expected = if full { expected } else { Counters::default() };
        assert_eq!(found, expected, "frame {frame} counts only its own splats");
    }
}

#[test]
fn the_number_of_pairs_saturates() {
    let Some(gpu) = gpu() else { return };
    let (capture, mut view) = (gpu.upload(crowd(500)), gpu.view());
    // The buffers have grown by then.
    let expected = [(); 6].map(|()| gpu.draw(&mut view, &capture, 0.0))[5];
    let picture = gpu.picture(&view);
    let TileBins { state, buffers } = bins(&view);
    let counters = buffers.as_ref().expect("a prepared view").bins[1 - state.parity()].clone();
    gpu.context.queue.write_buffer(&counters, 0, &(u32::MAX - 10).to_ne_bytes());
    let found = gpu.draw(&mut view, &capture, 0.0);
    let saturated = Counters { pairs: u32::MAX, padding: 0, ..expected };
    assert_eq!(found, saturated, "a count above 2^32 does not wrap, and no pairs are written");
    let apart = largest_difference(&gpu.picture(&view), &picture);
    assert!(apart <= 1e-6, "tiles without pairs search all splats; the frame differs by {apart}");
    for _ in 0..2 {
        assert_eq!(gpu.draw(&mut view, &capture, 0.0), expected, "later frames count their own pairs");
    }
}

#[test]
fn splats_of_a_frame_with_the_same_stamp_are_not_drawn() {
    let Some(gpu) = gpu() else { return };
    let mut gaussians = crowd(6_000);
    // A quarter is present at time 0 only.
    for gaussian in gaussians.iter_mut().step_by(4) {
        gaussian.sigma_t = 0.1;
    }
    let capture = gpu.upload(gaussians);
    let mut fresh = gpu.view();
    let counters = gpu.draw(&mut fresh, &capture, 1.0);
    assert_eq!(counters.visible, 4_500, "three quarters are present at time 1");
    let expected = gpu.picture(&fresh);
    let mut view = gpu.view();
    assert_eq!(gpu.draw(&mut view, &capture, 0.0).visible, 6_000, "all are present at time 0");
    // As after 65,534 more frames of any view. The bins are still too small for the splats, so that tiles search them.
    let TileBins { state, buffers } = bins(&view);
    buffers.as_ref().expect("a prepared view").claim.skip_to(state.frame + 0xffff);
    gpu.draw(&mut view, &capture, 1.0);
    let apart = largest_difference(&gpu.picture(&view), &expected);
    assert!(apart <= 1e-6, "the frame with the stamp of the first frame differs by {apart}");
}

#[test]
fn gaussians_behind_the_farthest_surface_are_not_projected_if_the_center_of_the_capture_is_behind_it() {
    let Some(gpu) = gpu() else { return };
    let mut gaussians = crowd(500);
    // More tiles than a thread tests: surfaces hide the splat in every tile, and it is sorted all the same.
    let mut wide = gaussians[0];
    (wide.mean, wide.covariance, wide.opacity) = ([0.0, 1.5, 0.0], [4.0, 0.0, 0.0, 1e-3, 0.0, 4.0], 0.5);
    gaussians.push(wide);
    let (mut capture, mut view) = (gpu.upload(gaussians), gpu.view());
    let size = UVec2::splat(400);
    let mut visible = |bounds, wall| {
        capture.bounds = bounds;
        gpu.draw_behind(&mut view, &capture, size, wall).visible
    };
    let bounds = |center: f32| {
        let [min, max] = [-0.5, 0.5].map(|side| Vec3::new(side, center + side, side));
        Some(Bounds { min, max })
    };
    assert_eq!(visible(None, 100.0), 501, "all are in front of the wall");
    assert_eq!(visible(None, 1.0), 1, "a wall before everything: the wide splat is projected");
    assert_eq!(visible(bounds(1.0), 1.0), 0, "the center is behind the wall: nothing is projected");
    assert_eq!(visible(bounds(1.0), 100.0), 501, "the wall of the last frame is forgotten");
    assert_eq!(visible(bounds(-9.0), 1.0), 1, "the center is in front of the wall: the test is left out");
    // The camera is 3 units before the origin. The wall is among the Gaussians.
    let among = visible(bounds(-9.0), 3.5);
    assert!((2..501).contains(&among), "some are in front of the wall: {among}");
    assert_eq!(visible(bounds(1.0), 3.5), among - 1, "those in front of the wall, without the wide splat behind it");
}

#[test]
fn views_share_their_buffers_and_draw_as_alone() {
    let Some(gpu) = gpu() else { return };
    let captures = [gpu.upload(crowd(200)), gpu.upload(crowd(6_000))];
    let alone = captures.each_ref().map(|capture| {
        let mut view = gpu.view();
        // The buffers have grown by then.
        for _ in 0..6 {
            gpu.draw(&mut view, capture, 0.5);
        }
        (gpu.picture(&view), view.statistics().shared_bytes)
    });
    let [(_, small), (_, large)] = &alone;
    assert!(large > small, "more splats take more memory: {large} and {small} bytes");
    let mut views = [gpu.view(), gpu.view()];
    for frame in 0..8 {
        for ((view, capture), (expected, _)) in views.iter_mut().zip(&captures).zip(&alone) {
            gpu.draw(view, capture, 0.5);
            let apart = largest_difference(&gpu.picture(view), expected);
            assert!(apart <= 1e-6, "frame {frame} differs by {apart} from that of a view alone");
        }
    }
    let shared = views.each_ref().map(|view| view.statistics().shared_bytes);
    assert_eq!(shared, [*large; 2], "both views use the same buffers, as large as those of the larger view alone");
    let [mut left, larger] = views;
    drop(larger);
    gpu.draw(&mut left, &captures[0], 0.5);
    assert_eq!(left.statistics().shared_bytes, *small, "the room of a view that is gone is freed");
}

#[test]
fn the_design_of_a_view_suits_the_number_of_splats() {
    let Some(gpu) = gpu() else { return };
    let most = MAX_SLOTS as usize;
    let software = gpu.renderer.is_software;
    let mut view = ViewRenderer::new(&gpu.context.device, &gpu.renderer);
    let mut chosen = |wanted, slots| {
        view.set_design(&gpu.renderer, wanted);
        view.choose_design(&gpu.context.device, &gpu.renderer, slots);
        view.design()
    };
    let auto = gpu.renderer.resolve(Design::Auto);
    assert_eq!(chosen(Design::Auto, 1_000), auto, "the design of the device");
    assert_eq!(chosen(Design::Auto, most), auto, "bins can number this many splats");
    assert_eq!(chosen(Design::Auto, most + 1), Design::GlobalSort, "bins cannot number this many splats");
    assert_eq!(chosen(Design::Auto, 1_000), auto, "the design of the device again");
    assert_eq!(chosen(Design::GlobalSort, 1_000), Design::GlobalSort, "the design that is set");
    assert_eq!(chosen(Design::TileBins, 1_000), Design::TileBins, "the design that is set");
    let crowded = if software { Design::GlobalSort } else { Design::TileBins };
    assert_eq!(chosen(Design::TileBins, 1_000_000), crowded, "software drivers end the loops over so many splats");
    assert_eq!(chosen(Design::TileBins, 1_000), Design::TileBins, "fewer splats again");
}

#[test]
fn a_view_draws_with_another_variant_until_the_wanted_one_is_compiled() {
    let Some(Gpu { context, renderer }) = gpu() else { return };
    let gpu = Gpu { context, renderer: renderer.compiling_in_background() };
    let capture = gpu.upload(crowd(200));
    let mut view = gpu.view();
    gpu.draw(&mut view, &capture, 0.5);
    let (device, drawn) = (&gpu.context.device, std::iter::once((capture.storage, false)));
    let compiled = bins(&view).state.variant;
    let wanted = BinVariant { lists: Lists::Short, large_batches: !compiled.large_batches, ..compiled };
    assert_ne!(wanted, compiled, "another variant");
    let variant = || gpu.renderer.bin_variant(device, drawn.clone(), wanted).expect("the passes compile");
    assert_eq!(variant(), compiled, "the compiled variant draws the same picture");
    let start = Instant::now();
    while variant() != wanted {
        assert!(start.elapsed() < Duration::from_secs(300), "the wanted variant is compiled in the background");
        thread::sleep(Duration::from_millis(5));
    }
    let surfaces = BinVariant { blending: Blending::ColorBehindSurfaces, ..wanted };
    let found = gpu.renderer.bin_variant(device, drawn.clone(), surfaces).expect("the passes compile");
    assert_eq!(found, surfaces, "no compiled variant draws the same picture: the wanted one is compiled at once");
}

#[test]
fn substitutes_draw_the_same_picture() {
    for few_bins in [false, true] {
        let wanted = BinVariant { few_bins, blending: Blending::ColorBehindSamples, ..BinVariant::default() };
        let substitutes: Vec<BinVariant> = wanted.substitutes().collect();
        let same = |other: &BinVariant| (other.blending, other.precision) == (wanted.blending, wanted.precision);
        assert!(substitutes.iter().all(same), "the surfaces and targets are those of the view: {substitutes:?}");
        let few = substitutes.iter().any(|other| other.few_bins);
        assert_eq!(few, few_bins, "counters for few bins have no room for many: {substitutes:?}");
        let counted = BinVariant { counted: true, ..wanted };
        assert!(counted.substitutes().all(|other| other.counted), "bins that are not counted may have no room");
    }
}

#[test]
fn lists_are_beside_each_other_and_leave_their_places() {
    let Some(gpu) = gpu() else { return };
    let device = &gpu.context.device;
    let rooms = ListRooms::default();
    let take = |length| rooms.place(device, &gpu.renderer, length);
    let [alone, second, third] = [(); 3].map(|()| take(20_000));
    assert!(!alone.is_beside(&second) && second.is_beside(&third), "the first long list has a buffer of its own");
    assert_eq!([alone.first(), second.first(), third.first()], [0, 0, 20_000], "places follow each other");
    assert_eq!(second.buffer().size(), 64 * 80_000, "room for the lists of one dispatch");
    drop(second);
    let (next, longer) = (take(20_000), take(20_001));
    assert_eq!((next.first(), next.is_beside(&third)), (0, true), "the place is free again");
    assert!(!longer.is_beside(&third), "lists of another length are in another buffer");
    let others: Vec<ListPlace> = (0..63).map(|_| take(20_000)).collect();
    let first: Vec<u32> = others.iter().filter(|list| list.is_beside(&third)).map(ListPlace::first).collect();
    let expected: Vec<u32> = (2..64).map(|index| 20_000 * index).collect();
    assert_eq!(first, expected, "62 more lists in the buffer, and one in the next");
    let large = [(); 2].map(|()| take(1 << 20));
    assert_eq!(large[1].buffer().size(), 8 << 20, "room for two lists of 4 MiB");
    let short = [(); 2].map(|()| take(0));
    assert!(short[0].is_beside(&short[1]), "short lists are beside each other from the first on");
}
