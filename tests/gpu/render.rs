//! Whole frames on the GPU: properties that hold for any scene, camera and device.
//!
//! In: synthetic scenes. Out: proof that the GPU draws what the CPU reference draws, however the scene is divided,
//! however many pairs it has, and whatever is in front of it.

use crate::support::surfaces::depth_texture;
use crate::support::{gpu, limited_device, packed_scene};
use bevy_gs4d::gaussian::{Gaussian, Parameters};
use bevy_gs4d::offline::quantize::compress;
use bevy_gs4d::reference::{self, Layer, Splat};
use bevy_gs4d::renderer::{
    ActiveList, CaptureUpload, Design, GpuCapture, GpuContext, GpuError, Headless, Instance, OpaqueDepth, Renderer,
    ShaderChecks, ViewParameters, ViewRenderer,
};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{
    ActiveSets, Environment, FilterKind, GaussianScene, RuntimeScene, SceneForm, Sliced, TemporalFilter,
};
use bevy_gs4d::view::{Appearance, Background, BlendSpace, Camera, Counts, Frame, RasterFov, View};
use glam::{Mat4, Quat, UVec2, Vec3};
use std::ops::Range;

const COLOR: [f32; 3] = [0.1, 0.4, 0.9];
const BACKGROUND: Background = Background::Color(COLOR);
const SIZE: UVec2 = UVec2::new(200, 150);
/// The camera of most tests; the scene lies between 1.5 and 4 units away.
const EYE: Vec3 = Vec3::new(2.2, 1.1, 1.4);
/// Pairs that a view has room for before it has seen any.
const FIRST_ROOM: u32 = 1 << 16;

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

/// Returns some of the Gaussians of a scene.
fn part(scene: &RuntimeScene, range: Range<usize>) -> RuntimeScene {
    let mut part = scene.clone();
    let Sliced { gaussians, harmonics } = part.form.as_sliced_mut().expect("sliced");
    let stride = harmonics.coefficients * 3;
    harmonics.values = harmonics.values[range.start * stride..range.end * stride].to_vec();
    *gaussians = gaussians[range].to_vec();
    part
}

/// Returns a scene and one bright Gaussian more.
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

/// Returns a capture as trained, all of it.
fn instance<'a>(capture: &'a GpuCapture, view: &View) -> Instance<'a> {
    Instance { capture, active: None, view: *view, appearance: Appearance::default() }
}

/// Returns parameters for frames over the background, with nothing in front.
fn parameters() -> ViewParameters<'static> {
    ViewParameters { background: BACKGROUND, ..ViewParameters::default() }
}

/// Draws several captures on the CPU, cut behind a depth.
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
    assert!(numbers && frame.picture.pixels.iter().all(|pixel| pixel.is_finite()), "{what}: a value is not finite");
}

/// Checks that frames agree within 1e-3 (depths 5e-3), except for one pixel in two hundred, and those within fifty times as much: the two
/// sides round differently, and here and there a splat's alpha lies on 1/255, its last tile is one farther, or two splats at the same depth
/// change places.
fn assert_close(found: &Frame, expected: &Frame, what: &str) {
    assert_eq!(found.picture.size, expected.picture.size, "{what}: size");
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
    assert!(beyond * 200 <= apart.len(), "{what}: {beyond} of {} pixels differ, the worst by {worst}", apart.len());
    assert!(worst <= 0.05, "{what}: the worst of {beyond} pixels that differ does so by {worst}");
}

/// As [`assert_close`]; also checks that the counts agree.
fn assert_equivalent(found: &Frame, expected: &Frame, what: &str) {
    assert_close(found, expected, what);
    let (a, b) = (found.counts, expected.counts);
    assert!(a.visible.abs_diff(b.visible) <= 3, "{what}: {} splats are visible, not {}", a.visible, b.visible);
    assert!(a.pairs.abs_diff(b.pairs) <= 10 + b.pairs / 500, "{what}: there are {} pairs, not {}", a.pairs, b.pairs);
}

#[test]
fn the_gpu_draws_what_the_cpu_twin_draws() {
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
                assert!(frame.counts.visible > 500, "{what}: only {} splats are visible", frame.counts.visible);
            }
        }
    }
}

#[test]
fn every_degree_of_colour_is_drawn() {
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
    let context = GpuContext::headless(None).expect("there is one, as the line above shows");
    let mut unchecked = Headless::new(context, ShaderChecks::Off).expect("the passes compile");
    let (scene, view) = (scene(3_000), look_from(EYE, SIZE, 0.5));
    let [with, without] = [&mut checked, &mut unchecked].map(|headless| {
        let capture = headless.upload(&scene).expect("upload");
        headless.render(&capture, &view, BACKGROUND).expect("render")
    });
    assert_equivalent(&without, &with, "without checks");
}

#[test]
fn frames_repeat_to_the_bit() {
    let Some(mut headless) = gpu::headless() else { return };
    let (scene, view) = (scene(3_000), look_from(EYE, SIZE, 0.5));
    let capture = headless.upload(&scene).expect("upload");
    let first = headless.render(&capture, &view, BACKGROUND).expect("render");
    let other = look_from(-EYE, UVec2::new(33, 17), 0.1);
    headless.render(&capture, &other, Background::None).expect("render");
    assert!(headless.render(&capture, &view, BACKGROUND).expect("render") == first, "nothing is left of other frames");
}

#[test]
fn a_filter_holds_whatever_was_drawn_before() {
    let Some(mut headless) = gpu::headless() else { return };
    let (all, view) = (scene(3_000), look_from(EYE, SIZE, 0.5));
    let every_other = (0..3_000).map(|i| if i % 2 == 0 { 0 } else { 1 }).collect();
    let sets = ActiveSets::Intervals(every_other);
    let filter = TemporalFilter { kind: FilterKind::Support, segments: 1, count: 3_000, sets };
    let mut thinned = all.clone();
    let Sliced { gaussians, harmonics } = thinned.form.as_sliced_mut().expect("sliced");
    let colors = harmonics.values.chunks_exact(harmonics.coefficients * 3);
    harmonics.values = colors.step_by(2).flatten().copied().collect();
    *gaussians = all.iter().step_by(2).collect();
    let filtered = RuntimeScene { filter: Some(filter), ..all.clone() };
    let [all, thinned, filtered] = [&all, &thinned, &filtered].map(|scene| headless.upload(scene).expect("upload"));
    let expected = headless.render(&thinned, &view, BACKGROUND).expect("render");
    for (before, capture) in
        [("itself", &filtered), ("a larger capture without a filter", &all), ("nothing new", &filtered)]
    {
        headless.render(capture, &view, BACKGROUND).expect("render");
        let frame = headless.render(&filtered, &view, BACKGROUND).expect("render");
        assert!(frame == expected, "after {before} others than the active Gaussians show");
    }
}

#[test]
fn without_gaussians_the_background_shows() {
    let Some(mut headless) = gpu::headless() else { return };
    let empty = scene(0);
    let capture = headless.upload(&empty).expect("upload");
    let view = look_from(EYE, UVec2::new(33, 17), 0.5);
    let frame = headless.render(&capture, &view, BACKGROUND).expect("render");
    assert!(frame == reference::render(&empty, &view, BACKGROUND), "the reference draws the same");
    assert!(frame.picture.pixels.iter().all(|pixel| *pixel == Vec3::from(COLOR)), "every pixel is background");
    assert!(frame.transmittance.iter().all(|left| *left == 1.0), "nothing is in front of it");
    assert_eq!(frame.counts, Counts::default(), "no work");
}

#[test]
fn what_is_not_there_changes_no_bit() {
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
        assert!(frame == alone, "Gaussian {i} shows, though it is not there");
    }
    let just_there = Gaussian { mean_t: 0.4, sigma_t: 0.1 / 2.44, ..present };
    let capture = headless.upload(&with(&scene, just_there)).expect("upload");
    let frame = headless.render(&capture, &view, BACKGROUND).expect("render");
    assert_eq!(frame.counts.visible, alone.counts.visible + 1, "one that is just there counts");
    let expected = reference::render(&with(&scene, just_there), &view, BACKGROUND);
    assert_equivalent(&frame, &expected, "one that is just there");
    // Where something of the background is to be seen; an opacity of 0.9 times a marginal of 0.051.
    let pairs = frame.transmittance.iter().zip(&alone.transmittance).filter(|(_, before)| **before > 0.01);
    let most = pairs.map(|(left, before)| 1.0 - left / before).fold(0.0, f32::max);
    assert!((0.03..0.047).contains(&most), "and takes 0.046 of the light at its middle, not {most}");
}

#[test]
fn long_before_and_after_nothing_of_a_lively_scene_is_left() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = scene(1_000);
    let capture = headless.upload(&scene).expect("upload");
    for time in [-1e6, 1e6] {
        let frame = headless.render(&capture, &look_from(EYE, SIZE, time), BACKGROUND).expect("render");
        assert_eq!(frame.counts, Counts::default(), "no splat at {time}");
        assert_finite(&frame, "long ago");
    }
}

#[test]
fn two_captures_are_one_scene() {
    let Some(mut headless) = gpu::headless() else { return };
    let (scene, view) = (scene(3_000), look_from(EYE, SIZE, 0.5));
    let whole = headless.upload(&scene).expect("upload");
    let whole = headless.render(&whole, &view, BACKGROUND).expect("render");
    // An empty one between them takes no slots.
    let cuts = [(0, 1_234), (1_234, 1_234), (1_234, 3_000)];
    let parts = cuts.map(|(first, last)| headless.upload(&part(&scene, first..last)).expect("upload"));
    let instances = parts.each_ref().map(|capture| instance(capture, &view));
    let frame = headless.render_all(&instances, &parameters()).expect("render");
    assert!(frame == whole, "captures interleave as if they were one");
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
        "colour does not fit one binding"
    );
    let [whole, parts] = [&mut headless, &mut limited].map(|headless| {
        let capture = headless.upload(&scene).expect("upload");
        assert_eq!(capture.len(), scene.len(), "all Gaussians are uploaded");
        headless.render(&capture, &view, BACKGROUND).expect("render")
    });
    assert!(whole == parts, "parts are drawn as the whole");
}

#[test]
fn what_does_not_fit_the_device_is_refused_and_does_no_harm() {
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
    assert!(limited.render(&capture, &view, BACKGROUND).expect("render") == before, "what fits is drawn as before");
}

/// Returns a scene, a view from afar, and a view so close that the room for pairs of the first guess is far too small.
fn afar_and_close() -> (RuntimeScene, View, View) {
    (swollen(3_000, 5.0), look_from(20.0 * EYE, UVec2::new(64, 48), 0.5), look_from(EYE, UVec2::new(240, 180), 0.5))
}

#[test]
fn a_close_up_makes_room_for_its_pairs() {
    let Some(mut headless) = gpu::headless() else { return };
    let (scene, afar, close) = afar_and_close();
    let capture = headless.upload(&scene).expect("upload");
    for (view, grows) in [(&afar, false), (&close, true), (&afar, false), (&close, true)] {
        let frame = headless.render(&capture, view, BACKGROUND).expect("render");
        assert_eq!(frame.counts.pairs > FIRST_ROOM, grows, "{} pairs", frame.counts.pairs);
        assert_equivalent(&frame, &reference::render(&scene, view, BACKGROUND), "after growing");
    }
}

/// Records and submits a frame of a view, and waits for it.
fn draw_frame(
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

/// Returns the largest difference of the picture of a view from another.
fn difference(context: &GpuContext, view: &ViewRenderer, expected: &Frame) -> f32 {
    let pixels = read_color(context, view).into_iter().zip(&expected.picture.pixels);
    pixels.map(|(a, b)| (Vec3::from(a) - *b).abs().max_element()).fold(0.0, f32::max)
}

#[test]
fn a_view_draws_all_pairs_before_it_has_room_for_them() {
    let Some(mut headless) = gpu::headless() else { return };
    let (scene, _, close) = afar_and_close();
    let capture = headless.upload(&scene).expect("upload");
    let renderer = Renderer::new(&headless.context().device, ShaderChecks::On).expect("the passes compile");
    for design in [Design::Reference, Design::Fast] {
        headless.set_design(design);
        // A later frame: the first one has made room.
        headless.render(&capture, &close, BACKGROUND).expect("render");
        let expected = headless.render(&capture, &close, BACKGROUND).expect("render");
        let GpuContext { device, queue, .. } = headless.context();
        let capture = GpuCapture::upload(device, queue, &renderer, &scene).expect("upload");
        let mut view = ViewRenderer::new(device, &renderer);
        view.set_design(&renderer, design);
        let instances = [instance(&capture, &close)];
        // The first frame counts, the second asks for the count, the third has it.
        for frame in 0..3 {
            draw_frame(headless.context(), &renderer, &mut view, &instances, BACKGROUND);
            let room = view.finished().expect("a frame").pairs;
            assert_eq!(room >= expected.counts.pairs, frame == 2, "{design:?}, frame {frame}: room for {room} pairs");
            let apart = difference(headless.context(), &view, &expected);
            assert!(apart < 1e-4, "{design:?}, frame {frame}, with room for {room} pairs: {apart} apart");
        }
        assert!(!view.is_short_of_room(), "{design:?}: the device has room");
    }
}

#[test]
fn what_a_device_has_no_room_for_is_drawn_all_the_same() {
    let Some(mut headless) = gpu::headless() else { return };
    let Some(mut limited) = limited_device::headless() else { return };
    let (scene, view) = (swollen(6_000, 10.0), look_from(EYE, UVec2::new(400, 300), 0.5));
    for design in [Design::Reference, Design::Fast] {
        let [expected, found] = [(&mut headless, 1), (&mut limited, 2)].map(|(headless, frames)| {
            headless.set_design(design);
            let capture = headless.upload(&scene).expect("upload");
            vec![(); frames]
                .into_iter()
                .map(|()| headless.render(&capture, &view, BACKGROUND).expect("render"))
                .collect::<Vec<_>>()
        });
        let pairs = expected[0].counts.pairs;
        assert!(u64::from(pairs) * 4 > limited_device::BINDING, "{pairs} pairs are more than a binding holds");
        for (frame, found) in found.iter().enumerate() {
            assert_eq!(found.counts, expected[0].counts, "{design:?}, frame {frame}: counts");
            let pixels = found.picture.pixels.iter().zip(&expected[0].picture.pixels);
            let apart = pixels.map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max);
            assert!(apart < 1e-4, "{design:?}, frame {frame}: {apart} apart");
        }
    }
    let GpuContext { device, queue, .. } = limited.context();
    let renderer = Renderer::new(device, ShaderChecks::On).expect("the passes compile");
    let capture = GpuCapture::upload(device, queue, &renderer, &scene).expect("upload");
    let mut crowded = ViewRenderer::new(device, &renderer);
    for _ in 0..4 {
        draw_frame(limited.context(), &renderer, &mut crowded, &[instance(&capture, &view)], BACKGROUND);
    }
    assert!(crowded.is_short_of_room(), "and that it stays slow can be told");
}

#[test]
fn what_is_uploaded_in_pieces_is_what_is_uploaded_at_once() {
    const PIECE: u64 = 10_000;
    let Some(headless) = gpu::headless() else { return };
    let GpuContext { device, queue, .. } = headless.context();
    let renderer = Renderer::new(device, ShaderChecks::On).expect("the passes compile");
    let view = look_from(EYE, UVec2::new(64, 48), 0.4);
    let draw = |capture: &GpuCapture| {
        let mut active = ActiveList::new(device, &renderer, capture).expect("it has a filter");
        assert!(active.prepare(queue, capture, view.time), "the list is new");
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
        let (packed, _) = compress(whole.clone(), &packed_scene::settings(codebooks)).expect("it is compressed");
        packed.into_runtime().expect("drawable")
    };
    let map = Environment { width: 90, height: 50, texels: (0..90 * 50 * 3).map(|i| i as f32 / 13_500.0).collect() };
    for (form, scene) in [("sliced", whole.clone()), ("packed", packed(&[])), ("coded", packed(&[64, 32]))] {
        let scene = RuntimeScene { environment: Some(map.clone()), ..scene };
        let at_once = GpuCapture::upload(device, queue, &renderer, &scene).expect("it fits");
        let mut upload = CaptureUpload::new(device, &renderer, &scene).expect("it fits");
        let (all, mut pieces) = (upload.bytes_left(), 0);
        while upload.bytes_left() > 0 {
            let written = upload.advance(queue, &renderer, PIECE);
            assert!((1..=PIECE).contains(&written), "{form}: {written} bytes in a piece");
            pieces += 1;
        }
        assert!(pieces >= all.div_ceil(PIECE), "{form}: {all} bytes in {pieces} pieces");
        let in_pieces = upload.finish(queue, &renderer);
        assert_eq!(in_pieces.bytes(), all, "{form}: all of it");
        assert!(draw(&in_pieces) == draw(&at_once), "{form}: the pictures differ");
    }
}

#[test]
fn a_picture_that_grows_pixel_by_pixel_needs_new_buffers_now_and_then() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = scene(500);
    let capture = headless.upload(&scene).expect("upload");
    for design in [Design::Reference, Design::Fast] {
        headless.set_design(design);
        let (mut created, mut changes) = (headless.work().created(), 0);
        // Wider and higher, and back again.
        for step in (0..40).chain((0..40).rev()) {
            let view = look_from(EYE, UVec2::new(90 + 2 * step, 70 + step), 0.5);
            // As in a window, the surfaces are another texture each time, which takes a bind group. There are none.
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
        assert!((1..=6).contains(&changes), "{design:?}: buffers have been made {changes} times");
    }
}

/// Reads red, green and blue of every pixel; rows must need no padding.
fn read_color(context: &GpuContext, view: &ViewRenderer) -> Vec<[f32; 3]> {
    let texture = view.color().expect("a frame was prepared").texture();
    let (size, row) = (texture.size(), texture.width() * 16);
    assert_eq!(row % wgpu::COPY_BYTES_PER_ROW_ALIGNMENT, 0, "rows without padding");
    let buffer = context.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(row) * u64::from(size.height),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
    let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo { buffer: &buffer, layout },
        size,
    );
    context.queue.submit([encoder.finish()]);
    buffer.slice(..).map_async(wgpu::MapMode::Read, |mapped| mapped.expect("the copy can be mapped"));
    context.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device finishes");
    let bytes = buffer.slice(..).get_mapped_range().to_vec();
    bytes.chunks_exact(16).map(|pixel| bytemuck::pod_read_unaligned(&pixel[..12])).collect()
}

#[test]
fn opaque_surfaces_hide_what_is_behind_them() {
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
        assert!(shown > 100 && shown + 100 < all.counts.visible, "{what}: it lies within the scene, {shown} in front");
        assert_eq!(cut.counts, all.counts, "{what}: the cut is per pixel, after the counting");
    }
    assert!(cut_at(0.0) == all, "infinitely far away is no surface");
    let hidden = cut_at(1.0);
    assert!(hidden.transmittance.iter().all(|left| *left == 1.0), "a surface at the near plane hides everything");
    let again = headless.render_all(&instances, &parameters()).expect("render");
    assert!(again == all, "without the surface everything is back");
}

#[test]
fn poison_is_refused_before_it_reaches_the_gpu() {
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
        let SceneForm::Trained(trained) = &mut scene.form else { panic!("synthetic scenes are in the trained form") };
        poison(&mut trained.parameters);
        let error = scene.into_runtime().expect_err(reason);
        assert!(error.index == 7 && error.reason.contains(reason), "{reason}: {error}");
    }
    let poisons: [(&str, fn(&mut Sliced)); 7] = [
        ("temporal scale", |s| s.gaussians[7].sigma_t = 0.0),
        ("temporal scale", |s| s.gaussians[7].sigma_t = f32::NAN),
        ("velocity", |s| s.gaussians[7].velocity[0] = f32::INFINITY),
        ("scale", |s| s.gaussians[7].covariance[5] = f32::INFINITY),
        ("opacity", |s| s.gaussians[7].opacity = 1.5),
        ("opacity", |s| s.gaussians[7].opacity = f32::NAN),
        ("colour", |s| s.harmonics.values[7 * 48 * 3 + 5] = f32::INFINITY),
    ];
    for (reason, poison) in poisons {
        let mut scene = scene(20);
        poison(scene.form.as_sliced_mut().expect("sliced"));
        let error = GaussianScene::from(scene).into_runtime().expect_err(reason);
        assert!(error.index == 7 && error.reason.contains(reason), "{reason}: {error}");
    }
}

/// Returns a scene in which every tenth Gaussian has another scale along one axis, or along all three.
fn extreme(scale: f32, axes: usize) -> RuntimeScene {
    let mut scene = trained(500);
    let SceneForm::Trained(trained) = &mut scene.form else { panic!("synthetic scenes are in the trained form") };
    for log_scale in trained.parameters.log_scale.iter_mut().step_by(10) {
        log_scale[..axes].fill(scale.ln());
    }
    scene.into_runtime().expect("extreme, but finite")
}

#[test]
fn extreme_scales_leave_no_hole_in_the_picture() {
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
