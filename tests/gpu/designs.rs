//! Changes of the design of a view.
//!
//! In: a synthetic scene, a view whose design changes between frames. Out: proof that a design does not interpret the
//! counters or the buffers of the other design. Skipped where there is no GPU.

use crate::render::draw_frame;
use crate::support::gpu;
use bevy_gs4d::renderer::{Design, GpuCapture, Instance, Renderer, ViewRenderer};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::view::{Appearance, Background, Camera, RasterFov};
use glam::{UVec2, Vec3};

const FRAMES: usize = 8;

#[test]
fn counters_of_another_design_do_not_change_the_buffers_of_a_view() {
    let Some(headless) = gpu::headless() else { return };
    let context = headless.context();
    let renderer = Renderer::new(&context.device, gpu::CHECKS).expect("the passes compile");
    let mut scene =
        synthesize(&SynthSettings { count: 3_000, ..SynthSettings::default() }).into_runtime().expect("drawable");
    // Large splats: many pairs, far more than splats in a bin.
    for gaussian in &mut scene.form.as_sliced_mut().expect("sliced").gaussians {
        gaussian.covariance = gaussian.covariance.map(|entry| 25.0 * entry);
    }
    let capture = GpuCapture::upload(&context.device, &context.queue, &renderer, &scene).expect("the scene fits");
    let camera = Camera::look_at(Vec3::new(2.2, 1.1, 1.4), Vec3::ZERO, Vec3::Z, 0.8, UVec2::new(320, 240));
    let seen = camera.view(0.5, RasterFov::default());
    let instances = [Instance { capture: &capture, active: None, view: seen, appearance: Appearance::default() }];
    // The bytes of a view after each frame.
    let draw = |view: &mut ViewRenderer, design: Design| {
        view.set_design(&renderer, design);
        let bytes = (0..FRAMES).map(|frame| {
            draw_frame(context, &renderer, view, &instances, Background::None);
            assert!(!view.is_short_of_room(), "{design:?}, frame {frame}: the device has room");
            view.statistics().bytes
        });
        bytes.collect::<Vec<_>>()
    };
    for (first, second) in [(Design::GlobalSort, Design::TileBins), (Design::TileBins, Design::GlobalSort)] {
        let fresh = draw(&mut ViewRenderer::new(&context.device, &renderer), second);
        let most = fresh.iter().copied().max().expect("frames");
        let mut view = ViewRenderer::new(&context.device, &renderer);
        draw(&mut view, first);
        let visible = view.statistics().visible;
        assert!(view.statistics().pairs > 30 * visible && visible > 1000, "many pairs: {:?}", view.statistics());
        let changed = draw(&mut view, second);
        assert!(
            changed.iter().all(|&bytes| bytes <= most),
            "{second:?} after {first:?}: {changed:?} bytes, a view that never had another design has {fresh:?}"
        );
        assert_eq!(changed.last(), fresh.last(), "{second:?} after {first:?}: the sizes become those of a fresh view");
        assert_eq!(view.statistics().visible, visible, "{second:?} after {first:?}: counters arrive again");
    }
}

#[test]
fn the_buffers_of_passes_are_those_of_the_reference_design() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = synthesize(&SynthSettings { count: 500, ..SynthSettings::default() }).into_runtime().expect("drawable");
    let capture = headless.upload(&scene).expect("the scene fits");
    let camera = Camera::look_at(Vec3::new(2.2, 1.1, 1.4), Vec3::ZERO, Vec3::Z, 0.8, UVec2::new(64, 48));
    let view = camera.view(0.5, RasterFov::default());
    headless.set_design(Design::TileBins);
    headless.render(&capture, &view, Background::None).expect("the picture fits");
    assert!(headless.finished().is_none(), "tile bins have none of these buffers");
    headless.set_design(Design::GlobalSort);
    let counts = headless.render(&capture, &view, Background::None).expect("the picture fits").counts;
    let frame = headless.finished().expect("the global sort has them");
    let bytes = headless.copy_out(frame.counters, 8).expect("counters");
    let found: Vec<u32> =
        bytes.chunks_exact(4).map(|word| u32::from_ne_bytes(word.try_into().expect("four bytes"))).collect();
    assert_eq!(found, [counts.visible, counts.pairs], "the counters are those of the frame");
    assert!(frame.buffers.order.size() >= 4 * u64::from(counts.visible), "the order has room for the visible splats");
}
