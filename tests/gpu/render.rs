//! Whole frames on the GPU: properties that hold for any scene, camera and device.
//!
//! In: synthetic scenes. Out: proof that frames match the CPU reference, independent of the division of the scene into
//! captures and parts, of the number of pairs and of opaque surfaces. Skipped where there is no GPU.

use crate::support::surfaces::depth_texture;
use crate::support::texture_bytes::texture_bytes;
use crate::support::trained::trained_mut;
use crate::support::{gpu, limited_device, packed_scene};
use bevy_gs4d::gaussian::{Gaussian, MARGINAL_CUTOFF, Parameters, SMALLEST_CUTOFF};
use bevy_gs4d::internal::reference::{self, Splat};
use bevy_gs4d::offline::compress::compress;
use bevy_gs4d::reference::Layer;
use bevy_gs4d::renderer::{
    ActiveList, CaptureUpload, Design, GpuCapture, GpuContext, GpuError, Headless, Instance, OpaqueDepth, Renderer,
    ShaderChecks, ViewParameters, ViewRenderer,
};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{ActiveSets, Environment, FilterKind, GaussianScene, RuntimeScene, Sliced, TemporalFilter};
use bevy_gs4d::view::{Appearance, Background, BlendSpace, Camera, Counts, Frame, RasterFov, View};
use glam::{Mat4, Quat, UVec2, Vec3};
use std::ops::Range;

const COLOR: [f32; 3] = [0.1, 0.4, 0.9];
const BACKGROUND: Background = Background::Color(COLOR);
const SIZE: UVec2 = UVec2::new(200, 150);
/// The camera of most tests; the scene lies between 1.5 and 4 units away.
const EYE: Vec3 = Vec3::new(2.2, 1.1, 1.4);
/// Initial capacity of a view in pairs.
const FIRST_CAPACITY: u32 = 1 << 16;

fn trained(count: usize) -> GaussianScene {
    synthesize(&SynthSettings { count, ..SynthSettings::default() })
}

fn scene(count: usize) -> RuntimeScene {
    trained(count).into_runtime().expect("a synthetic scene can be drawn")
}

/// Returns the same scene with larger Gaussians.
fn swollen(count: usize, factor: f32) -> RuntimeScene {
    let mut scene = scene(count);
    for gaussian in &mut scene.form.as_sliced_mut().expect("sliced").gaussians {
        gaussian.covariance = gaussian.covariance.map(|entry| entry * factor * factor);
    }
    scene
}

/// Returns the same scene at another scale.
fn scaled(count: usize, scale: f32) -> RuntimeScene {
    let mut scene = scene(count);
    for gaussian in &mut scene.form.as_sliced_mut().expect("sliced").gaussians {
        gaussian.mean = gaussian.mean.map(|value| value * scale);
        gaussian.velocity = gaussian.velocity.map(|value| value * scale);
        gaussian.covariance = gaussian.covariance.map(|entry| entry * scale * scale);
    }
    scene
}

/// Returns a scene of a range of the Gaussians of another scene.
fn part(scene: &RuntimeScene, range: Range<usize>) -> RuntimeScene {
    let mut part = scene.clone();
    let Sliced { gaussians, harmonics } = part.form.as_sliced_mut().expect("sliced");
    let stride = harmonics.coefficients * 3;
    harmonics.values = harmonics.values[range.start * stride..range.end * stride].to_vec();
    *gaussians = gaussians[range].to_vec();
    part
}

/// Returns a scene with one additional bright Gaussian.
fn with(scene: &RuntimeScene, gaussian: Gaussian) -> RuntimeScene {
    let mut more = scene.clone();
    let Sliced { gaussians, harmonics } = more.form.as_sliced_mut().expect("sliced");
    gaussians.push(gaussian);
    harmonics.values.extend(vec![0.7; harmonics.coefficients * 3]);
    more
}

fn look_from(eye: Vec3, size: UVec2, time: f32) -> View {
    Camera::look_at(eye, Vec3::new(0.0, 0.0, 0.2), Vec3::Z, 0.8, size).view(time, RasterFov::default())
}

fn project(scene: &RuntimeScene, view: &View) -> Vec<Splat> {
    reference::project(&Layer { scene, view: *view, appearance: Appearance::default() }, BlendSpace::Encoded)
}

/// Returns an instance of a capture with the default appearance, without a filter.
fn instance<'a>(capture: &'a GpuCapture, view: &View) -> Instance<'a> {
    Instance { capture, active: None, view: *view, appearance: Appearance::default() }
}

/// Returns parameters for frames over the background, without opaque surfaces.
fn parameters() -> ViewParameters<'static> {
    ViewParameters { background: BACKGROUND, ..ViewParameters::default() }
}

/// Draws the splats of several captures up to a depth on the CPU.
fn expected_frame(instances: &[(&RuntimeScene, View)], limit: f32) -> Frame {
    let splats: Vec<Splat> = instances.iter().flat_map(|(scene, view)| project(scene, view)).collect();
    let drawn = |splat: &Splat| splat.is_visible() && splat.depth <= limit;
    let mut order: Vec<u32> = (0..splats.len() as u32).filter(|&i| drawn(&splats[i as usize])).collect();
    reference::sort(&mut order, |&i| splats[i as usize].depth.to_bits());
    let view = &instances[0].1;
    let mut pairs = reference::bin(&splats, &order, view.tiles());
    reference::sort(&mut pairs, |pair| pair.tile);
    let ranges = reference::ranges(&pairs, view.tiles());
    let counts = Counts { visible: order.len() as u32, pairs: pairs.len() as u32 };
    reference::blend(&splats, &pairs, &ranges, view, BACKGROUND, None, BlendSpace::Encoded, counts)
}

fn assert_finite(frame: &Frame, what: &str) {
    let numbers = frame.transmittance.iter().chain(&frame.depth).all(|value| value.is_finite());
    assert!(numbers && frame.picture.pixels.iter().all(|pixel| pixel.is_finite()), "{what}: all values are finite");
}

/// Checks that frames agree within 1e-3 (depths 5e-3), except for one pixel in two hundred, which agree within fifty
/// times as much. GPU and CPU round differently: in a few pixels the alpha of a splat is close to 1/255, a splat covers
/// one tile more, or two splats at the same depth are exchanged.
fn assert_close(found: &Frame, expected: &Frame, what: &str) {
    assert_eq!(found.picture.size, expected.picture.size, "{what}: the sizes are equal");
    assert_finite(found, what);
    let apart: Vec<f32> = (0..expected.depth.len())
        .map(|i| {
            let color = (found.picture.pixels[i] - expected.picture.pixels[i]).abs().max_element();
            let left = (found.transmittance[i] - expected.transmittance[i]).abs();
            color.max(left).max((found.depth[i] - expected.depth[i]).abs() / 5.0)
        })
        .collect();
    let worst = apart.iter().copied().fold(0.0, f32::max);
    let beyond = apart.iter().filter(|apart| **apart > 1e-3).count();
    assert!(beyond * 200 <= apart.len(), "{what}: {beyond} of {} pixels differ, at most by {worst}", apart.len());
    assert!(worst <= 0.05, "{what}: {beyond} pixels differ, at most by {worst}, expected at most by 0.05");
}

/// Checks that frames agree as in [`assert_close`], and that their counts agree.
fn assert_equivalent(found: &Frame, expected: &Frame, what: &str) {
    assert_close(found, expected, what);
    let (a, b) = (found.counts, expected.counts);
    assert!(a.visible.abs_diff(b.visible) <= 3, "{what}: {} visible splats, expected {}", a.visible, b.visible);
    assert!(a.pairs.abs_diff(b.pairs) <= 10 + b.pairs / 500, "{what}: {} pairs, expected {}", a.pairs, b.pairs);
}

#[test]
fn frames_match_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = scene(3_000);
    let capture = headless.upload(&scene).expect("upload");
    for size in [UVec2::ONE, UVec2::new(17, 33), UVec2::new(70, 53), SIZE] {
        for eye in [EYE, Vec3::new(-0.4, -1.8, 0.6)] {
            for time in [0.0, 0.37, 1.0] {
                let view = look_from(eye, size, time);
                let frame = headless.render(&capture, &view, BACKGROUND).expect("render");
                let what = format!("{size} from {eye} at {time}");
                assert_equivalent(&frame, &reference::render(&scene, &view, BACKGROUND), &what);
                assert!(frame.counts.visible > 500, "{what}: the scene is visible: {:?}", frame.counts);
            }
        }
    }
}

#[test]
fn every_degree_of_color_matches_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    for (degree, degree_t) in [(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2)] {
        let settings = SynthSettings { count: 500, degree, degree_t, ..SynthSettings::default() };
        let scene = synthesize(&settings).into_runtime().expect("a scene that can be drawn");
        let view = look_from(EYE, UVec2::new(70, 53), 0.6);
        let capture = headless.upload(&scene).expect("upload");
        let frame = headless.render(&capture, &view, BACKGROUND).expect("render");
        let what = format!("degrees {degree} and {degree_t}");
        assert_equivalent(&frame, &reference::render(&scene, &view, BACKGROUND), &what);
    }
}

#[test]
fn shader_checks_do_not_change_the_picture() {
    let Some(mut checked) = gpu::headless() else { return };
    let context = GpuContext::headless(None).expect("a device exists, as the line above shows");
    let mut unchecked = Headless::new(context, ShaderChecks::Off).expect("the passes compile");
    let (scene, view) = (scene(3_000), look_from(EYE, SIZE, 0.5));
    let [with, without] = [&mut checked, &mut unchecked].map(|headless| {
        let capture = headless.upload(&scene).expect("upload");
        headless.render(&capture, &view, BACKGROUND).expect("render")
    });
    assert_equivalent(&without, &with, "without shader checks");
}

#[test]
fn frames_are_reproducible_bit_for_bit() {
    let Some(mut headless) = gpu::headless() else { return };
    let (scene, view) = (scene(3_000), look_from(EYE, SIZE, 0.5));
    let capture = headless.upload(&scene).expect("upload");
    let first = headless.render(&capture, &view, BACKGROUND).expect("render");
    let other = look_from(-EYE, UVec2::new(33, 17), 0.1);
    headless.render(&capture, &other, Background::None).expect("render");
    assert!(headless.render(&capture, &view, BACKGROUND).expect("render") == first, "other frames have no effect");
}

#[test]
fn a_filter_applies_independent_of_earlier_frames() {
    let Some(mut headless) = gpu::headless() else { return };
    let (all, view) = (scene(3_000), look_from(EYE, SIZE, 0.5));
    let every_other = (0..3_000).map(|i| if i % 2 == 0 { 0 } else { 1 }).collect();
    let sets = ActiveSets::Intervals(every_other);
    let filter = TemporalFilter { kind: FilterKind::Support, segments: 1, count: 3_000, sets };
    let mut halved = all.clone();
    let Sliced { gaussians, harmonics } = halved.form.as_sliced_mut().expect("sliced");
    let colors = harmonics.values.chunks_exact(harmonics.coefficients * 3);
    harmonics.values = colors.step_by(2).flatten().copied().collect();
    *gaussians = all.iter().step_by(2).collect();
    let filtered = RuntimeScene { filter: Some(filter), ..all.clone() };
    let [all, halved, filtered] = [&all, &halved, &filtered].map(|scene| headless.upload(scene).expect("upload"));
    let expected = headless.render(&halved, &view, BACKGROUND).expect("render");
    for (before, capture) in
        [("the same capture", &filtered), ("a capture without a filter", &all), ("the same capture again", &filtered)]
    {
        headless.render(capture, &view, BACKGROUND).expect("render");
        let frame = headless.render(&filtered, &view, BACKGROUND).expect("render");
        assert!(frame == expected, "after {before}, exactly the active Gaussians are drawn");
    }
}

#[test]
fn a_scene_without_gaussians_shows_the_background() {
    let Some(mut headless) = gpu::headless() else { return };
    let empty = scene(0);
    let capture = headless.upload(&empty).expect("upload");
    let view = look_from(EYE, UVec2::new(33, 17), 0.5);
    let frame = headless.render(&capture, &view, BACKGROUND).expect("render");
    assert!(frame == reference::render(&empty, &view, BACKGROUND), "the frame matches the CPU reference");
    assert!(frame.picture.pixels.iter().all(|pixel| *pixel == Vec3::from(COLOR)), "every pixel is background");
    assert!(frame.transmittance.iter().all(|left| *left == 1.0), "every transmittance is 1");
    assert_eq!(frame.counts, Counts::default(), "there are no splats and no pairs");
}

#[test]
fn absent_and_transparent_gaussians_do_not_change_the_picture() {
    let Some(mut headless) = gpu::headless() else { return };
    let (scene, view) = (scene(1_000), look_from(EYE, SIZE, 0.5));
    let capture = headless.upload(&scene).expect("upload");
    let alone = headless.render(&capture, &view, BACKGROUND).expect("render");
    let large = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0];
    let present =
        Gaussian { mean: [0.0; 3], mean_t: 0.5, sigma_t: 1.0, covariance: large, opacity: 0.9, ..scene.gaussian(0) };
    // A marginal of 0.05 is reached at 2.4477 deviations.
    let absent = [
        Gaussian { mean_t: 0.4, sigma_t: 0.1 / 2.45, ..present },
        Gaussian { mean_t: -1e9, sigma_t: 1e-9, ..present },
        Gaussian { opacity: 0.0, ..present },
        Gaussian { opacity: 0.003, ..present },
        Gaussian { mean: (2.0 * EYE).to_array(), velocity: [0.0; 3], ..present },
    ];
    for (i, gaussian) in absent.into_iter().enumerate() {
        let capture = headless.upload(&with(&scene, gaussian)).expect("upload");
        let frame = headless.render(&capture, &view, BACKGROUND).expect("render");
        assert!(frame == alone, "Gaussian {i} is absent and does not change the frame");
    }
    let just_there = Gaussian { mean_t: 0.4, sigma_t: 0.1 / 2.44, ..present };
    let capture = headless.upload(&with(&scene, just_there)).expect("upload");
    let frame = headless.render(&capture, &view, BACKGROUND).expect("render");
    assert_eq!(frame.counts.visible, alone.counts.visible + 1, "a Gaussian just above the cut-off is visible");
    let expected = reference::render(&with(&scene, just_there), &view, BACKGROUND);
    assert_equivalent(&frame, &expected, "a Gaussian just above the cut-off");
    // In pixels with some transmittance: an opacity of 0.9 times a marginal of 0.051.
    let pairs = frame.transmittance.iter().zip(&alone.transmittance).filter(|(_, before)| **before > 0.01);
    let most = pairs.map(|(left, before)| 1.0 - left / before).fold(0.0, f32::max);
    assert!((0.03..0.047).contains(&most), "its largest alpha is {most}, expected 0.046");
}

#[test]
fn a_dynamic_scene_is_empty_at_distant_times() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = scene(1_000);
    let capture = headless.upload(&scene).expect("upload");
    for time in [-1e6, 1e6] {
        let frame = headless.render(&capture, &look_from(EYE, SIZE, time), BACKGROUND).expect("render");
        assert_eq!(frame.counts, Counts::default(), "no splat is visible at {time}");
        assert_finite(&frame, &format!("at {time}"));
    }
}

#[test]
fn the_cutoff_of_the_scene_decides_which_tails_are_drawn() {
    let Some(mut headless) = gpu::headless() else { return };
    let view = look_from(EYE, UVec2::new(80, 60), 0.5);
    let mut visible = Vec::new();
    for cutoff in [SMALLEST_CUTOFF, MARGINAL_CUTOFF, 0.6] {
        let mut scene = scene(3_000);
        scene.trained_with.marginal_cutoff = cutoff;
        scene.filter = Some(TemporalFilter::support(scene.iter(), [0.0, 1.0], cutoff, 8));
        let capture = headless.upload(&scene).expect("upload");
        let expected = reference::render(&scene, &view, BACKGROUND);
        for design in [Design::GlobalSort, Design::TileBins] {
            headless.set_design(design);
            let frame = headless.render(&capture, &view, BACKGROUND).expect("render");
            assert_equivalent(&frame, &expected, &format!("{design:?}, cut-off {cutoff}"));
        }
        visible.push(expected.counts.visible);
    }
    assert!(visible[0] > visible[1] && visible[1] > visible[2], "a lower cut-off shows more tails: {visible:?}");
}

#[test]
fn a_small_scene_with_a_near_limit_and_the_filter_of_mip_splatting_matches_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    const SCALE: f32 = 0.01;
    let mut scene = scaled(3_000, SCALE);
    (scene.trained_with.near, scene.trained_with.mip_filter) = (0.002, true);
    let camera = Camera::look_at(EYE * SCALE, Vec3::new(0.0, 0.0, 0.2) * SCALE, Vec3::Z, 0.8, SIZE);
    let view = camera.view(0.37, scene.trained_with.optics());
    let capture = headless.upload(&scene).expect("upload");
    let frame = headless.render(&capture, &view, BACKGROUND).expect("render");
    assert_equivalent(&frame, &expected_frame(&[(&scene, view)], f32::INFINITY), "a small scene");
    assert!(frame.counts.visible > 500, "the scene is seen: {} splats", frame.counts.visible);
    let unfiltered = View { trained_pixel: f32::INFINITY, ..view };
    let dense = headless.render(&capture, &unfiltered, BACKGROUND).expect("render").transmittance;
    let left = |transmittance: &[f32]| transmittance.iter().sum::<f32>() / transmittance.len() as f32;
    let [filtered, dense] = [left(&frame.transmittance), left(&dense)];
    assert!(filtered > dense + 1e-3, "the filter reduces opacity: {filtered} of the background is left, else {dense}");
    let original = headless.render(&capture, &camera.view(0.37, RasterFov::default()), BACKGROUND).expect("render");
    assert_eq!(original.counts.visible, 0, "the near limit of the original hides everything");
}

#[test]
fn parts_of_a_scene_drawn_together_equal_the_scene() {
    let Some(mut headless) = gpu::headless() else { return };
    let (scene, view) = (scene(3_000), look_from(EYE, SIZE, 0.5));
    let whole = headless.upload(&scene).expect("upload");
    let whole = headless.render(&whole, &view, BACKGROUND).expect("render");
    // An empty capture between them has no slots.
    let cuts = [(0, 1_234), (1_234, 1_234), (1_234, 3_000)];
    let parts = cuts.map(|(first, last)| headless.upload(&part(&scene, first..last)).expect("upload"));
    let instances = parts.each_ref().map(|capture| instance(capture, &view));
    let frame = headless.render_all(&instances, &parameters()).expect("render");
    assert!(frame == whole, "the splats of all captures are blended in one order");
}

#[test]
fn captures_in_one_view_have_their_own_time_and_place() {
    let Some(mut headless) = gpu::headless() else { return };
    let (first, second) = (scene(1_500), part(&scene(3_000), 1_500..3_000));
    let view = look_from(EYE, SIZE, 0.2);
    let model = Mat4::from_scale_rotation_translation(
        Vec3::new(0.8, 1.3, 0.6),
        Quat::from_rotation_z(0.7),
        Vec3::new(0.3, -0.2, 0.4),
    );
    let moved = View::new(SIZE, 0.9, view.world_to_camera * model, view.projection, view.tan_fov);
    let captures = [&first, &second].map(|scene| headless.upload(scene).expect("upload"));
    let instances = [instance(&captures[0], &view), instance(&captures[1], &moved)];
    let frame = headless.render_all(&instances, &parameters()).expect("render");
    let expected = expected_frame(&[(&first, view), (&second, moved)], f32::INFINITY);
    assert_equivalent(&frame, &expected, "two captures");
}

#[test]
fn a_capture_larger_than_a_binding_is_drawn_in_parts() {
    let Some(mut headless) = gpu::headless() else { return };
    let Some(mut limited) = limited_device::headless() else { return };
    let (scene, view) = (scene(5_000), look_from(EYE, SIZE, 0.5));
    assert!(
        size_of_val(&scene.form.harmonics().expect("whole").values[..]) as u64 > limited_device::BINDING,
        "the color coefficients exceed one binding"
    );
    let [whole, parts] = [&mut headless, &mut limited].map(|headless| {
        let capture = headless.upload(&scene).expect("upload");
        assert_eq!(capture.len(), scene.len(), "all Gaussians are uploaded");
        headless.render(&capture, &view, BACKGROUND).expect("render")
    });
    assert!(whole == parts, "a capture in parts equals the whole capture");
}

#[test]
fn the_active_gaussians_of_a_capture_in_parts_are_those_of_the_whole() {
    let Some(mut headless) = gpu::headless() else { return };
    let Some(mut limited) = limited_device::headless() else { return };
    let scene = packed_scene::scene(5_000, 3, 2);
    assert!(
        size_of_val(&scene.form.harmonics().expect("whole").values[..]) as u64 > limited_device::BINDING,
        "the color coefficients exceed one binding"
    );
    let [whole, parts] = [&headless, &limited].map(|headless| headless.upload(&scene).expect("upload"));
    for time in [0.05, 0.5, 0.95, 0.3] {
        let view = look_from(EYE, SIZE, time);
        let whole = headless.render(&whole, &view, BACKGROUND).expect("render");
        let parts = limited.render(&parts, &view, BACKGROUND).expect("render");
        assert!(whole.counts.visible > 0 && whole == parts, "at {time}: a capture in parts equals the whole capture");
    }
}

#[test]
fn frames_beyond_the_limits_of_a_device_are_refused_without_side_effects() {
    let Some(mut limited) = limited_device::headless() else { return };
    let scene = scene(1_000);
    let view = look_from(EYE, SIZE, 0.5);
    let capture = limited.upload(&scene).expect("upload");
    let before = limited.render(&capture, &view, BACKGROUND).expect("render");

    let large = limited.upload(&swollen(3_000, 10.0)).expect("upload");
    let view_of_all = look_from(EYE, UVec2::new(640, 480), 0.5);
    let refused = limited.draw(&large, &view_of_all, BACKGROUND).expect_err("more pairs than a binding holds");
    assert!(matches!(refused, GpuError::TooLarge { what: "the pairs of splats and tiles", .. }), "{refused}");
    limited.set_design(Design::Auto);

    let many = limited.upload(&self::scene(50_000)).expect("upload");
    let refused = limited.render(&many, &view, BACKGROUND).expect_err("more splats than a binding holds");
    assert!(matches!(refused, GpuError::TooLarge { what: "the splats", .. }), "{refused}");

    for size in [UVec2::new(0, 5), UVec2::new(5, 1 << 20)] {
        let refused = limited.render(&capture, &look_from(EYE, size, 0.5), BACKGROUND).expect_err("no such picture");
        assert!(matches!(refused, GpuError::Size { .. }), "{size}: {refused}");
    }
    assert!(limited.render(&capture, &view, BACKGROUND).expect("render") == before, "later frames are unchanged");
}

/// Returns a scene, a view from afar, and a view so close that its pairs exceed the initial capacity.
fn afar_and_close() -> (RuntimeScene, View, View) {
    (swollen(3_000, 5.0), look_from(20.0 * EYE, UVec2::new(64, 48), 0.5), look_from(EYE, UVec2::new(240, 180), 0.5))
}

#[test]
fn the_capacity_of_pairs_grows_for_a_close_view() {
    let Some(mut headless) = gpu::headless() else { return };
    let (scene, afar, close) = afar_and_close();
    let capture = headless.upload(&scene).expect("upload");
    for (view, grows) in [(&afar, false), (&close, true), (&afar, false), (&close, true)] {
        let frame = headless.render(&capture, view, BACKGROUND).expect("render");
        let pairs = frame.counts.pairs;
        assert_eq!(pairs > FIRST_CAPACITY, grows, "{pairs} pairs exceed the initial capacity only in the close view");
        assert_equivalent(&frame, &reference::render(&scene, view, BACKGROUND), &format!("{pairs} pairs"));
    }
}

/// Records and submits a frame of a view, and waits for it.
pub fn draw_frame(
    context: &GpuContext,
    renderer: &Renderer,
    view: &mut ViewRenderer,
    instances: &[Instance<'_>],
    background: Background,
) {
    let GpuContext { device, queue, .. } = context;
    let parameters = ViewParameters { background, ..ViewParameters::default() };
    view.prepare(device, queue, renderer, instances, &parameters).expect("prepare");
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    view.record(renderer, &mut encoder, instances);
    queue.submit([encoder.finish()]);
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the device finishes");
}

/// Returns the largest difference between the colors of a view and of a frame.
fn difference(context: &GpuContext, view: &ViewRenderer, expected: &Frame) -> f32 {
    let pixels = read_color(context, view).into_iter().zip(&expected.picture.pixels);
    pixels.map(|(a, b)| (Vec3::from(a) - *b).abs().max_element()).fold(0.0, f32::max)
}

#[test]
fn frames_that_exceed_the_capacity_of_pairs_are_complete() {
    let Some(mut headless) = gpu::headless() else { return };
    let (scene, _, close) = afar_and_close();
    let capture = headless.upload(&scene).expect("upload");
    let renderer = Renderer::new(&headless.context().device, ShaderChecks::On).expect("the passes compile");
    for design in [Design::GlobalSort, Design::TileBins] {
        headless.set_design(design);
        // The second frame has the capacity that the first frame needed.
        headless.render(&capture, &close, BACKGROUND).expect("render");
        let expected = headless.render(&capture, &close, BACKGROUND).expect("render");
        let GpuContext { device, queue, .. } = headless.context();
        let capture = GpuCapture::upload(device, queue, &renderer, &scene).expect("upload");
        let mut view = ViewRenderer::new(device, &renderer);
        view.set_design(&renderer, design);
        let instances = [instance(&capture, &close)];
        let mut first_bytes = None;
        // The first frame counts, the second starts the read-back of the counts, the third has them.
        for frame in 0..3 {
            draw_frame(headless.context(), &renderer, &mut view, &instances, BACKGROUND);
            let statistics = view.statistics();
            let bytes = statistics.bytes + statistics.shared_bytes;
            let room = *first_bytes.get_or_insert(bytes);
            // Four bytes for each pair in tile bins, more in the global sort.
            let needed = u64::from(expected.counts.pairs - FIRST_CAPACITY) * 4;
            let grown = bytes >= room + needed;
            assert_eq!(grown, frame == 2, "{design:?}, frame {frame}: {bytes} bytes, {room} in the first frame");
            let apart = difference(headless.context(), &view, &expected);
            assert!(apart < 1e-4, "{design:?}, frame {frame}, {bytes} bytes: colors differ by {apart}");
        }
        assert!(!view.is_short_of_room(), "{design:?}: the pairs are within the limits of the device");
    }
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn frames_with_more_pairs_than_the_device_allows_are_complete() {
    let Some(mut headless) = gpu::headless() else { return };
    let Some(mut limited) = limited_device::headless() else { return };
    let (scene, view) = (swollen(6_000, 10.0), look_from(EYE, UVec2::new(400, 300), 0.5));
    for design in [Design::GlobalSort, Design::TileBins] {
        let [expected, found] = [(&mut headless, 1), (&mut limited, 2)].map(|(headless, frames)| {
            headless.set_design(design);
            let capture = headless.upload(&scene).expect("upload");
            vec![(); frames]
                .into_iter()
                .map(|()| headless.render(&capture, &view, BACKGROUND).expect("render"))
                .collect::<Vec<_>>()
        });
        let pairs = expected[0].counts.pairs;
        assert!(u64::from(pairs) * 4 > limited_device::BINDING, "{pairs} pairs exceed a binding");
        for (frame, found) in found.iter().enumerate() {
            assert_eq!(found.counts, expected[0].counts, "{design:?}, frame {frame}: the counts are equal");
            let pixels = found.picture.pixels.iter().zip(&expected[0].picture.pixels);
            let apart = pixels.map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max);
            assert!(apart < 1e-4, "{design:?}, frame {frame}: colors differ by {apart}");
        }
    }
    let GpuContext { device, queue, .. } = limited.context();
    let renderer = Renderer::new(device, ShaderChecks::On).expect("the passes compile");
    let capture = GpuCapture::upload(device, queue, &renderer, &scene).expect("upload");
    let mut crowded = ViewRenderer::new(device, &renderer);
    for _ in 0..4 {
        draw_frame(limited.context(), &renderer, &mut crowded, &[instance(&capture, &view)], BACKGROUND);
    }
    assert!(crowded.is_short_of_room(), "the view reports that its pairs exceed the limits of the device");
}

#[test]
fn a_capture_uploaded_in_chunks_equals_a_capture_uploaded_at_once() {
    const CHUNK: u64 = 10_000;
    let Some(headless) = gpu::headless() else { return };
    let GpuContext { device, queue, .. } = headless.context();
    let renderer = Renderer::new(device, ShaderChecks::On).expect("the passes compile");
    let view = look_from(EYE, UVec2::new(64, 48), 0.4);
    let draw = |capture: &GpuCapture| {
        let mut active = ActiveList::new(device, &renderer, capture).expect("the capture has a filter");
        assert!(active.prepare(queue, capture, view.time), "a new list must be recorded");
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        active.record(&renderer, &mut encoder, capture);
        queue.submit([encoder.finish()]);
        let mut drawn = ViewRenderer::new(device, &renderer);
        let instances = [Instance { active: Some(&active), ..instance(capture, &view) }];
        draw_frame(headless.context(), &renderer, &mut drawn, &instances, Background::Environment);
        read_color(headless.context(), &drawn)
    };
    let whole = packed_scene::scene(5_000, 3, 1);
    let packed = |codebooks: &[usize]| {
        let (packed, _) = compress(whole.clone(), &packed_scene::settings(codebooks)).expect("compression succeeds");
        packed.into_runtime().expect("drawable")
    };
    let map = Environment { width: 90, height: 50, texels: (0..90 * 50 * 3).map(|i| i as f32 / 13_500.0).collect() };
    for (form, scene) in [("sliced", whole.clone()), ("packed", packed(&[])), ("coded", packed(&[64, 32]))] {
        let scene = RuntimeScene { environment: Some(map.clone()), ..scene };
        let at_once = GpuCapture::upload(device, queue, &renderer, &scene).expect("the scene fits the GPU");
        let mut upload = CaptureUpload::new(device, &renderer, &scene).expect("the scene fits the GPU");
        let (all, mut chunks) = (upload.bytes_left(), 0);
        while upload.bytes_left() > 0 {
            let written = upload.advance(queue, &renderer, CHUNK);
            assert!((1..=CHUNK).contains(&written), "{form}: a chunk has {written} bytes, expected 1 to {CHUNK}");
            chunks += 1;
        }
        assert!(chunks >= all.div_ceil(CHUNK), "{form}: {all} bytes need more than {chunks} chunks");
        let in_chunks = upload.finish(queue, &renderer);
        assert_eq!(in_chunks.bytes(), all, "{form}: all bytes are uploaded");
        assert!(draw(&in_chunks) == draw(&at_once), "{form}: the pictures are equal");
    }
}

#[test]
fn the_bytes_of_a_gaussian_are_known_before_it_is_uploaded() {
    const COUNT: usize = 5_000;
    let Some(headless) = gpu::headless() else { return };
    let GpuContext { device, queue, .. } = headless.context();
    let renderer = Renderer::new(device, ShaderChecks::On).expect("the passes compile");
    let bits = packed_scene::scene(COUNT, 3, 1);
    let RuntimeScene { trained_with, .. } = &bits;
    // Forty segments are smaller as intervals.
    let sets = TemporalFilter::support(bits.iter(), trained_with.time_interval, trained_with.marginal_cutoff, 40);
    let intervals = RuntimeScene { filter: Some(sets), ..bits.clone() };
    let whole = RuntimeScene { filter: None, ..packed_scene::scene(COUNT, 1, 0) };
    let (packed, _) = compress(bits.clone(), &packed_scene::settings(&[])).expect("compression succeeds");
    let packed = packed.into_runtime().expect("drawable");
    for (form, scene) in [("bits", bits), ("intervals", intervals), ("no filter", whole), ("packed", packed)] {
        let capture = GpuCapture::upload(device, queue, &renderer, &scene).expect("the scene fits the GPU");
        let list = scene.filter.as_ref().map_or(0, |filter| {
            let active = filter.active_counts(0..filter.count).into_iter().max().unwrap_or_default();
            u64::from(active) * 4
        });
        let (own, count) = (capture.bytes() + list, scene.len() as u64);
        let each = u64::from(GaussianScene::from(scene).gaussian_bytes());
        assert!(own <= each * count, "{form}: {own} bytes of {count} Gaussians, {each} of each");
        assert!(each * count < own + 8 * count, "{form}: {each} bytes of each are far more than {own} of all");
    }
}

#[test]
fn a_picture_that_grows_step_by_step_needs_few_new_buffers() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = scene(500);
    let capture = headless.upload(&scene).expect("upload");
    for design in [Design::GlobalSort, Design::TileBins] {
        headless.set_design(design);
        let (mut created, mut changes) = (headless.work().created(), 0);
        // Growing, then shrinking.
        for step in (0..40).chain((0..40).rev()) {
            let view = look_from(EYE, UVec2::new(90 + 2 * step, 70 + step), 0.5);
            // As in a resized window, each frame has another depth texture, which needs a bind group. The texture
            // contains no surfaces.
            let surfaces = depth_texture(headless.context(), view.size, 0.0);
            let distance = [0.1, 0.0, 0.0, 1.0];
            let opaque = OpaqueDepth { texture: &surfaces, samples: 1, origin: UVec2::ZERO, distance };
            let parameters = ViewParameters { opaque: Some(opaque), ..parameters() };
            let frame = headless.render_all(&[instance(&capture, &view)], &parameters).expect("render");
            let now = headless.work().created();
            (created, changes) = (now, changes + u32::from(now > created + 1));
            if step % 20 == 17 {
                let expected = reference::render(&scene, &view, BACKGROUND);
                assert_equivalent(&frame, &expected, &format!("{design:?}, {}", view.size));
            }
        }
        assert!((1..=6).contains(&changes), "{design:?}: buffers are created {changes} times, expected 1 to 6");
    }
}

/// Reads red, green and blue of every pixel of a texture whose rows need no padding.
pub fn read_color(context: &GpuContext, view: &ViewRenderer) -> Vec<[f32; 3]> {
    let bytes = texture_bytes(context, view.color().expect("a frame was prepared"));
    bytes.chunks_exact(16).map(|pixel| bytemuck::pod_read_unaligned(&pixel[..12])).collect()
}

#[test]
fn opaque_surfaces_hide_splats_behind_them() {
    let Some(mut headless) = gpu::headless() else { return };
    let (scene, view) = (scene(3_000), look_from(EYE, SIZE, 0.5));
    let capture = headless.upload(&scene).expect("upload");
    let instances = [instance(&capture, &view)];
    let all = headless.render_all(&instances, &parameters()).expect("render");
    let near = 0.1;
    let origin = UVec2::new(5, 7);
    let mut cut_at = |depth: f32| {
        let texture = depth_texture(headless.context(), SIZE + origin, depth);
        let opaque = OpaqueDepth { texture: &texture, samples: 1, origin, distance: [near, 0.0, 0.0, 1.0] };
        headless.render_all(&instances, &ViewParameters { opaque: Some(opaque), ..parameters() }).expect("render")
    };
    // Reverse z: the surface is `near / depth` away.
    for distance in [2.3, 2.7, 3.1] {
        let depth = near / distance;
        let what = format!("a surface at {distance}");
        let expected = expected_frame(&[(&scene, view)], near / depth);
        let cut = cut_at(depth);
        assert_close(&cut, &expected, &what);
        let shown = expected.counts.visible;
        let total = all.counts.visible;
        assert!(shown > 100 && shown + 100 < total, "{what} divides the scene: {shown} of {total} splats are in front");
        assert_eq!(cut.counts, all.counts, "{what}: the surface does not change the counts");
    }
    assert!(cut_at(0.0) == all, "depth 0 is no surface");
    let hidden = cut_at(1.0);
    assert!(hidden.transmittance.iter().all(|left| *left == 1.0), "a surface at the near plane hides all splats");
    let again = headless.render_all(&instances, &parameters()).expect("render");
    assert!(again == all, "without a surface, the frame is the same as before");
}

#[test]
fn invalid_gaussians_are_refused_before_upload() {
    let poisons: [(&str, fn(&mut Parameters)); 8] = [
        ("mean", |p| p.mean[7][1] = f32::NAN),
        ("temporal mean", |p| p.mean_t[7] = f32::NEG_INFINITY),
        ("scale", |p| p.log_scale[7][2] = f32::NAN),
        ("scale", |p| p.log_scale[7][0] = 100.0),
        ("temporal scale", |p| p.log_scale_t[7] = f32::NAN),
        ("rotation", |p| p.rotation_l[7] = [0.0; 4]),
        ("right rotation", |p| p.rotation_r[7][3] = f32::NAN),
        ("opacity", |p| p.opacity_logit[7] = f32::NAN),
    ];
    for (reason, poison) in poisons {
        let mut scene = trained(20);
        poison(&mut trained_mut(&mut scene).parameters);
        let error = scene.into_runtime().expect_err(reason);
        assert!(
            error.index == 7 && error.reason.contains(reason),
            "the error names Gaussian 7 and its {reason}: {error}"
        );
    }
    let poisons: [(&str, fn(&mut Sliced)); 7] = [
        ("temporal scale", |s| s.gaussians[7].sigma_t = 0.0),
        ("temporal scale", |s| s.gaussians[7].sigma_t = f32::NAN),
        ("velocity", |s| s.gaussians[7].velocity[0] = f32::INFINITY),
        ("scale", |s| s.gaussians[7].covariance[5] = f32::INFINITY),
        ("opacity", |s| s.gaussians[7].opacity = 1.5),
        ("opacity", |s| s.gaussians[7].opacity = f32::NAN),
        ("coefficient", |s| s.harmonics.values[7 * 48 * 3 + 5] = f32::INFINITY),
    ];
    for (reason, poison) in poisons {
        let mut scene = scene(20);
        poison(scene.form.as_sliced_mut().expect("sliced"));
        let error = GaussianScene::from(scene).into_runtime().expect_err(reason);
        assert!(
            error.index == 7 && error.reason.contains(reason),
            "the error names Gaussian 7 and its {reason}: {error}"
        );
    }
}

/// Returns a scene in which every tenth Gaussian has this scale along the first `axes` axes.
fn extreme(scale: f32, axes: usize) -> RuntimeScene {
    let mut scene = trained(500);
    for log_scale in trained_mut(&mut scene).parameters.log_scale.iter_mut().step_by(10) {
        log_scale[..axes].fill(scale.ln());
    }
    scene.into_runtime().expect("the scales are finite")
}

#[test]
fn extreme_scales_do_not_produce_non_finite_pixels() {
    let Some(mut headless) = gpu::headless() else { return };
    let view = look_from(EYE, SIZE, 0.5);
    for scale in [1e-20, 1e10, 1e18] {
        for axes in [1, 3] {
            let scene = extreme(scale, axes);
            let capture = headless.upload(&scene).expect("upload");
            let frame = headless.render(&capture, &view, BACKGROUND).expect("render");
            let what = format!("scales of {scale:e} along {axes} axes");
            assert_finite(&frame, &what);
            let expected = reference::render(&scene, &view, BACKGROUND);
            assert_finite(&expected, &what);
            if scale < 1.0 {
                assert_equivalent(&frame, &expected, &what);
            }
        }
    }
}
