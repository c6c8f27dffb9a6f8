//! Views without colors, as for shadow maps.
//!
//! In: a synthetic scene, drawn with colors and without. Out: proof that depths and transmittance do not depend on
//! colors, and that tile bins leave the colors out. Skipped where there is no GPU.

use crate::support::gpu::{self, CHECKS};
use crate::support::texture_bytes::texture_bytes;
use bevy_gs4d::renderer::{Design, GpuCapture, GpuContext, Instance, Renderer, ViewParameters, ViewRenderer};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::view::{Appearance, Background, Camera, RasterFov, View};
use glam::{UVec2, Vec3};

/// Rows of this width need no padding in any format.
const SIZE: UVec2 = UVec2::new(128, 96);

/// Draws a frame, and returns the colors with transmittance, and the depths.
fn draw(context: &GpuContext, renderer: &Renderer, mut view: ViewRenderer, one: Instance<'_>) -> [Vec<f32>; 2] {
    let GpuContext { device, queue, .. } = context;
    let parameters = ViewParameters { background: Background::None, ..ViewParameters::default() };
    view.prepare(device, queue, renderer, &[one], &parameters).expect("prepare");
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    view.record(renderer, &mut encoder, &[one]);
    queue.submit([encoder.finish()]);
    let targets = [view.color(), view.depth()].map(|target| target.expect("a frame was prepared"));
    targets.map(|target| texture_bytes(context, target).chunks_exact(4).map(bytemuck::pod_read_unaligned).collect())
}

#[test]
fn depths_and_transmittance_do_not_depend_on_colors() {
    let Some(headless) = gpu::headless() else { return };
    let context = headless.context();
    let renderer = Renderer::new(&context.device, CHECKS).expect("the passes compile");
    let scene = synthesize(&SynthSettings { count: 2_000, ..SynthSettings::default() });
    let scene = scene.into_runtime().expect("a synthetic scene can be drawn");
    let capture = GpuCapture::upload(&context.device, &context.queue, &renderer, &scene).expect("upload");
    let view: View =
        Camera::look_at(Vec3::new(2.2, 1.1, 1.4), Vec3::ZERO, Vec3::Z, 0.9, SIZE).view(0.5, RasterFov::Corrected);
    let one = Instance { capture: &capture, active: None, view, appearance: Appearance::default() };
    for design in [Design::GlobalSort, Design::TileBins] {
        let new = || {
            let mut view = ViewRenderer::new(&context.device, &renderer);
            view.set_design(&renderer, design);
            view
        };
        let [colors, depths] = draw(context, &renderer, new(), one);
        let [without, same_depths] = draw(context, &renderer, new().without_colors(), one);
        assert!(depths.iter().any(|depth| *depth > 0.0), "{design:?}: the scene is drawn");
        assert!(depths == same_depths, "{design:?}: the depths are equal");
        let transmittances = |colors: &[f32]| colors.iter().skip(3).step_by(4).copied().collect::<Vec<_>>();
        assert!(transmittances(&colors) == transmittances(&without), "{design:?}: the transmittances are equal");
        let is_dark = without.chunks_exact(4).all(|pixel| pixel[..3] == [0.0; 3]);
        assert_eq!(is_dark, design == Design::TileBins, "{design:?}: only tile bins leave the colors out");
    }
}
