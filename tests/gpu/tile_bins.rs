//! Tile bins against the global sort: scenes that exceed its buffers or its workgroup memory, and many copies of a
//! capture.
//!
//! In: scenes of many splats in few tiles, the bundled capture. Out: proof that both designs draw the same picture from
//! the first frame on, and that copies drawn by one dispatch equal copies drawn by separate dispatches. Skipped where
//! there is no GPU.

use crate::support::blob::blob;
use crate::support::gpu;
use crate::support::surfaces::{depth_texture, edge};
use bevy_gs4d::codec::ReadOptions;
use bevy_gs4d::codec::load;
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::offline::measure::SquaredError;
use bevy_gs4d::renderer::{ColorPrecision, Design, Headless, Instance, OpaqueDepth, ViewParameters};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{Form, RuntimeScene};
use bevy_gs4d::view::{Appearance, Background, Camera, DebugView, Frame, RasterFov, View};
use glam::{UVec2, Vec3};
use std::path::Path;

/// Returns a scene of faint Gaussians near the origin, in layers along the line of sight: `layer` Gaussians have the
/// same depth.
fn crowd(count: usize, layer: usize, deviation: f32) -> RuntimeScene {
    let gaussians = (0..count).map(|index| {
        let spread = |step: usize| (index * step % 97) as f32 / 97.0 - 0.5;
        let depth = (index / layer * 37 % 101) as f32 / 101.0;
        let mean = Vec3::new(0.1 * spread(31), depth, 0.1 * spread(57));
        Gaussian { mean_t: 0.0, ..blob(mean, Vec3::splat(deviation), 0.012) }
    });
    let values = (0..count).flat_map(|index| [3, 5, 7].map(|step| (index * step % 11) as f32 / 11.0)).collect();
    RuntimeScene::sliced(gaussians.collect(), Harmonics { coefficients: 1, degree: 0, degree_t: 0, values })
}

fn view(size: u32) -> View {
    Camera::look_at(Vec3::new(0.0, -3.0, 0.0), Vec3::ZERO, Vec3::Z, 0.8, UVec2::splat(size))
        .view(0.0, RasterFov::Reference)
}

/// Draws a scene after the release of all buffers.
fn first_frame(headless: &mut Headless, design: Design, scene: &RuntimeScene, view: &View) -> Frame {
    // A change of design releases all buffers.
    for (_, other) in Design::NAMES {
        headless.set_design(other);
    }
    headless.set_design(design);
    let capture = headless.upload(scene).expect("the scene fits");
    headless.render(&capture, view, Background::Color([0.1, 0.2, 0.3])).expect("the picture fits")
}

fn assert_same(found: &Frame, expected: &Frame, what: &str) {
    let pixels = found.picture.pixels.iter().zip(&expected.picture.pixels);
    let color = pixels.map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max);
    let depths = found.depth.iter().zip(&expected.depth);
    let depth = depths.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    println!("{what}: color {color:.1e} depth {depth:.1e}");
    assert!(color <= 1e-5, "{what}: color differs by {color}");
    assert!(depth <= 5e-5, "{what}: depth differs by {depth}");
    assert_eq!(found.counts.visible, expected.counts.visible, "{what}: visible splats");
}

#[test]
fn lists_longer_than_workgroup_memory_are_drawn_in_order() {
    let Some(mut headless) = gpu::headless() else { return };
    for (count, layer) in [(3000, 1), (5000, 50), (6000, 6000)] {
        let (scene, view) = (crowd(count, layer, 0.05), view(64));
        let expected = first_frame(&mut headless, Design::GlobalSort, &scene, &view);
        assert!(expected.counts.pairs as usize > 4 * 2048, "the lists exceed workgroup memory: {:?}", expected.counts);
        let found = first_frame(&mut headless, Design::TileBins, &scene, &view);
        assert_same(&found, &expected, &format!("{count} splats in layers of {layer}"));
    }
}

#[test]
fn overflowing_bins_are_drawn_completely_in_the_first_frame() {
    let Some(mut headless) = gpu::headless() else { return };
    // The initial capacity of bins of 2 x 2 tiles is 4096 splats; some bins contain all 6000 splats.
    let (scene, view) = (crowd(6000, 1, 0.05), view(400));
    let expected = first_frame(&mut headless, Design::GlobalSort, &scene, &view);
    let found = first_frame(&mut headless, Design::TileBins, &scene, &view);
    assert_same(&found, &expected, "the first frame");
    let capture = headless.upload(&scene).expect("the scene fits");
    for number in 2..6 {
        let found = headless.render(&capture, &view, Background::Color([0.1, 0.2, 0.3])).expect("the picture fits");
        assert_same(&found, &expected, &format!("frame {number}, with larger bins"));
    }
}

#[test]
fn overflowing_bins_grow_in_the_next_frame() {
    let Some(mut headless) = gpu::headless() else { return };
    let (scene, view) = (crowd(6000, 1, 0.05), view(400));
    let capture = headless.upload(&scene).expect("the scene fits");
    headless.set_design(Design::TileBins);
    let mut bytes = |views: &[View]| headless.time(&capture, views, 0).expect("the picture fits").bytes;
    // Each call draws each view once, and releases the buffers first.
    let [first, second, again] = [1, 2, 1].map(|count| bytes(&vec![view; count]));
    // 8 bytes per entry, 169 bins: first 4096 entries each, then 1.5 * 6000.
    assert_eq!(second - first, 8 * 169 * (9000 - 4096), "the second frame has larger bins");
    assert_eq!(again, first, "the first frame of another call has the initial capacity");
}

/// Returns a scene with a crowd of `shown` Gaussians in the middle, among Gaussians behind the camera. Some of the
/// shown cover the picture.
fn crowd_among_many(shown: usize, all: usize) -> RuntimeScene {
    let mut scene = crowd(all, 7, 0.01);
    let Form::Sliced(sliced) = &mut scene.form else { panic!("single precision") };
    for (index, gaussian) in sliced.gaussians.iter_mut().enumerate() {
        // Every 13th Gaussian is shown, so that the workgroups and the lists of visible splats have gaps.
        if index % 13 > 0 || index / 13 >= shown {
            gaussian.mean[1] = -10.0;
        } else if index / 13 % 1_500 == 0 {
            *gaussian = Gaussian { mean_t: 0.0, ..blob(Vec3::from(gaussian.mean), Vec3::splat(0.6), 0.012) };
        }
    }
    scene
}

/// If room for as many splats as the fullest bin has would be too large for all bins, bins are counted before they are
/// filled.
#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn bins_with_exact_room_match_the_reference_design() {
    let Some(mut headless) = gpu::headless() else { return };
    // The first guess of equal rooms is too large for all pictures. In the first, later frames have equal rooms; in the
    // others the fullest bin is too full for that. A workgroup counts the splats of 529 and of 1920 bins in workgroup
    // memory, but not those of 2176.
    for (size, shown, all) in [
        (UVec2::splat(1456), 1_000, 132_000),
        (UVec2::new(4096, 1900), 3_000, 104_000),
        (UVec2::new(8192, 1050), 3_000, 104_000),
    ] {
        let scene = crowd_among_many(shown, all);
        let camera = Camera::look_at(Vec3::new(0.0, -3.0, 0.0), Vec3::ZERO, Vec3::Z, 0.8, size);
        let view = camera.view(0.0, RasterFov::Reference);
        let capture = headless.upload(&scene).expect("the scene fits");
        let parameters = ViewParameters { depths: false, ..ViewParameters::default() };
        // Two instances, whose splats are in the same bins.
        let instance = Instance { capture: &capture, active: None, view, appearance: Appearance::default() };
        let mut draw = |design| {
            headless.set_design(design);
            headless.render_all(&[instance, instance], &parameters).expect("the picture fits")
        };
        let expected = draw(Design::GlobalSort);
        assert!(expected.counts.visible as usize >= 2 * shown * 9 / 10, "the crowd is visible: {:?}", expected.counts);
        for frame in 1..3 {
            let found = draw(Design::TileBins);
            let difference = difference(&found, &expected);
            println!("{size}, {shown} splats, frame {frame}: {difference:.1e}, {:?}", found.counts);
            assert!(difference <= 1e-5, "{size}, {shown} splats, frame {frame}: differs by {difference}");
            assert_eq!(found.counts, expected.counts, "{size}, {shown} splats, frame {frame}: the counts are the same");
        }
        assert_eq!(headless.design(), Design::TileBins, "{size}, {shown} splats: drawn by tile bins");
    }
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn a_crowd_in_one_bin_does_not_enlarge_the_others() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = crowd(6_000, 7, 0.001);
    let capture = headless.upload(&scene).expect("the scene fits");
    headless.set_design(Design::TileBins);
    let size = UVec2::new(4096, 1100);
    let camera = Camera::look_at(Vec3::new(0.0, -30.0, 0.0), Vec3::ZERO, Vec3::Z, 0.8, size);
    let view = camera.view(0.0, RasterFov::Reference);
    let timings = headless.time(&capture, &[view; 4], 0).expect("the picture fits");
    // Equal rooms are at most 2^23 entries, 67 MB. Room for 1.5 * 6000 splats in each of 1152 bins would be 83 MB.
    let most = 16 * u64::from(size.element_product()) + 80 * 8192 + 8 * (1 << 23) + (1 << 20);
    assert_eq!(headless.design(), Design::TileBins, "drawn by tile bins");
    assert!(timings.bytes <= most, "the view takes {} bytes, expected at most {most}", timings.bytes);
}

/// Returns the largest difference between two frames in color and transmittance.
fn difference(found: &Frame, expected: &Frame) -> f32 {
    let colors = found.picture.pixels.iter().zip(&expected.picture.pixels).map(|(a, b)| (*a - *b).abs().max_element());
    let left = found.transmittance.iter().zip(&expected.transmittance).map(|(a, b)| (a - b).abs());
    colors.chain(left).fold(0.0, f32::max)
}

#[test]
fn every_variant_of_blending_matches_the_reference_design() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = synthesize(&SynthSettings { count: 4_000, ..SynthSettings::default() });
    let scene = scene.into_runtime().expect("a scene that can be drawn");
    let size = UVec2::new(131, 97);
    let camera = Camera::look_at(Vec3::new(2.0, 1.0, 1.2), Vec3::ZERO, Vec3::Z, 0.8, size);
    let view = camera.view(0.4, RasterFov::Reference);
    let capture = headless.upload(&scene).expect("the scene fits");
    let instances = [Instance { capture: &capture, active: None, view, appearance: Appearance::default() }];
    // A surface through the middle of the scene.
    let (near, distance) = (0.1, 2.5);
    let texture = depth_texture(headless.context(), size, near / distance);
    let surface = OpaqueDepth { texture: &texture, samples: 1, origin: UVec2::ZERO, distance: [near, 0.0, 0.0, 1.0] };
    let (samples, _) = edge(headless.context(), size, near, distance, 0.3);
    let samples = samples.create_view(&wgpu::TextureViewDescriptor::default());
    let slanted = OpaqueDepth { texture: &samples, samples: 4, ..surface };
    for debug in [DebugView::Color, DebugView::Depth, DebugView::Overdraw, DebugView::Velocity] {
        for opaque in [None, Some(surface), Some(slanted)] {
            for background in [Background::None, Background::Color([0.3, 0.2, 0.1])] {
                let parameters = ViewParameters { background, opaque, debug, ..ViewParameters::default() };
                headless.set_design(Design::GlobalSort);
                let expected = headless.render_all(&instances, &parameters).expect("the picture fits");
                assert!(expected.counts.visible > 1000, "the scene is visible: {:?}", expected.counts);
                headless.set_design(Design::TileBins);
                for depths in [true, false] {
                    let parameters = ViewParameters { depths, ..parameters };
                    let found = headless.render_all(&instances, &parameters).expect("the picture fits");
                    let samples = opaque.map_or(0, |opaque| opaque.samples);
                    let what = format!("{debug:?}, samples of the surface {samples}, depths {depths}");
                    assert_eq!(found.depth.is_empty(), !depths, "{what}: depths are present if enabled");
                    let difference = difference(&found, &expected);
                    println!("{what}: {difference:.1e}");
                    assert!(difference <= 1e-5, "{what}: differs by {difference}");
                    // Splats that are hidden in all of their tiles are left out of frames without depths.
                    let shows_color = matches!(debug, DebugView::Color | DebugView::Velocity);
                    if opaque.is_some() && shows_color && !depths {
                        let [left, all] = [found.counts.visible, expected.counts.visible];
                        assert!(0 < left && left < all, "{what}: {left} of {all} splats are left");
                    } else {
                        assert_eq!(found.counts, expected.counts, "{what}: the counts are the same");
                    }
                }
            }
        }
    }
}

/// A trained capture drawn without depths, as by benchmarks and cameras that need no depth, in small and large
/// pictures.
#[test]
fn the_bundled_capture_without_depths_matches_the_reference_design() {
    let Some(mut headless) = gpu::headless() else { return };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/toybox.gs4d");
    let scene = load(&path, &ReadOptions::default()).expect("the bundled capture").into_runtime();
    let scene = scene.expect("a scene that can be drawn");
    let capture = headless.upload(&scene).expect("the scene fits");
    for (size, time) in [(400, 0.1), (400, 0.6), (530, 0.3)] {
        let camera = Camera::look_at(Vec3::new(-3.57, 1.3, 1.69), Vec3::ZERO, Vec3::Z, 0.8, UVec2::splat(size));
        let view = camera.view(time, RasterFov::Reference);
        let instances = [Instance { capture: &capture, active: None, view, appearance: Appearance::default() }];
        let [expected, found] = [Design::GlobalSort, Design::TileBins].map(|design| {
            headless.set_design(design);
            let parameters = ViewParameters { depths: design == Design::GlobalSort, ..ViewParameters::default() };
            headless.render_all(&instances, &parameters).expect("the picture fits")
        });
        assert!(expected.counts.visible > 10_000, "the capture is visible: {:?}", expected.counts);
        let error = SquaredError::of(&found.picture, &expected.picture).expect("pictures of one size");
        let decibels = error.psnr();
        println!("{size}, {time}: {decibels:.1} dB, at most {:.1e}", difference(&found, &expected));
        assert!(decibels >= 100.0, "{size} pixels at {time}: PSNR {decibels} dB, expected at least 100");
    }
}

#[test]
fn half_precision_colors_are_rounded_single_precision_colors() {
    let Some(mut headless) = gpu::headless() else { return };
    let (scene, view) = (crowd(2000, 7, 0.05), view(130));
    let capture = headless.upload(&scene).expect("the scene fits");
    let instances = [Instance { capture: &capture, active: None, view, appearance: Appearance::default() }];
    for design in [Design::GlobalSort, Design::TileBins] {
        headless.set_design(design);
        let [single, half] = [ColorPrecision::Single, ColorPrecision::Half].map(|precision| {
            let parameters = ViewParameters { precision, ..ViewParameters::default() };
            headless.render_all(&instances, &parameters).expect("the picture fits")
        });
        let (step, most) = (difference(&half, &single), single.picture.pixels.iter().map(|p| p.max_element()));
        let most = most.fold(1.0, f32::max);
        // Half precision has ten fraction bits; drivers may round towards zero.
        println!("{design:?}: half differs by {step:.1e} of {most:.1e}");
        assert!(step <= most * 2.0_f32.powi(-10), "{design:?}: half precision differs by {step}");
        assert!(step > 0.0, "{design:?}: half precision is used");
        assert_eq!(half.depth, single.depth, "{design:?}: depths do not depend on the precision of color");
    }
}

#[test]
fn pictures_of_many_tiles_have_larger_bins() {
    let Some(mut headless) = gpu::headless() else { return };
    // 8281 tiles are too many for bins of 2 x 2 tiles.
    let (scene, view) = (crowd(500, 1, 0.1), view(1456));
    let expected = first_frame(&mut headless, Design::GlobalSort, &scene, &view);
    let found = first_frame(&mut headless, Design::TileBins, &scene, &view);
    assert_same(&found, &expected, "1456 x 1456");
    assert_eq!(found.counts, expected.counts, "the counts are the same");
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn large_parts_with_several_gaussians_per_thread_match_the_reference_design() {
    let Some(mut headless) = gpu::headless() else { return };
    // From a million Gaussians on, `project_bin` uses the variant for few bins.
    for (count, shown) in [(300_000, 97), (1_100_000, 397)] {
        let (mut scene, view) = (crowd(count, 1000, 0.02), view(256));
        let Form::Sliced(sliced) = &mut scene.form else { panic!("single precision") };
        // Some Gaussians are visible, some are behind the camera, some are absent; also whole workgroups of each kind.
        for (index, gaussian) in sliced.gaussians.iter_mut().enumerate() {
            if index % 3 == 0 || (100_000..120_000).contains(&index) {
                (gaussian.mean_t, gaussian.sigma_t) = (10.0, 0.1);
            }
            if index % shown > 0 && !(50_000..51_500).contains(&index) {
                gaussian.mean[1] = -10.0;
            }
        }
        let expected = first_frame(&mut headless, Design::GlobalSort, &scene, &view);
        assert!(expected.counts.visible > 2000, "the scene is visible: {:?}", expected.counts);
        let found = first_frame(&mut headless, Design::TileBins, &scene, &view);
        assert_same(&found, &expected, &format!("{count} Gaussians"));
        assert_eq!(found.counts, expected.counts, "{count} Gaussians: the counts are the same");
    }
}

#[test]
fn copies_drawn_by_one_dispatch_equal_copies_drawn_separately() {
    let Some(mut headless) = gpu::headless() else { return };
    let synthetic = |seed| {
        let settings = SynthSettings { count: 40, seed, ..SynthSettings::default() };
        synthesize(&settings).into_runtime().expect("a scene that can be drawn")
    };
    let (scene, other) = (synthetic(1), synthetic(2));
    let [copied, same, other] = [&scene, &scene, &other].map(|scene| headless.upload(scene).expect("the scene fits"));
    // More copies than one dispatch draws, with another capture between them; each at its own place, time and opacity.
    let places = (0..150).map(|index| {
        let (column, row) = (index % 15, index / 15);
        let eye = Vec3::new(0.7 * column as f32 - 5.0, -9.0, 0.8 * row as f32 - 4.0);
        let camera = Camera::look_at(eye, eye + Vec3::Y, Vec3::Z, 0.8, UVec2::new(150, 110));
        let view = camera.view(0.2 + 0.004 * index as f32, RasterFov::Reference);
        let opacity = 1.0 - 0.004 * index as f32;
        (index, view, Appearance { opacity, ..Appearance::default() })
    });
    let places: Vec<_> = places.collect();
    let instances = |alternate: bool| -> Vec<Instance<'_>> {
        let capture = |index: usize| match index {
            75 => &other,
            _ if alternate && index % 2 == 1 => &same,
            _ => &copied,
        };
        let place = |&(index, view, appearance): &(usize, View, Appearance)| Instance {
            capture: capture(index),
            active: None,
            view,
            appearance,
        };
        places.iter().map(place).collect()
    };
    for (_, design) in Design::NAMES {
        headless.set_design(design);
        let [together, alone] = [false, true].map(|alternate| {
            let parameters = ViewParameters { depths: false, ..ViewParameters::default() };
            headless.render_all(&instances(alternate), &parameters).expect("the picture fits")
        });
        assert!(together.counts.visible > 2000, "{design:?}: the copies are visible: {:?}", together.counts);
        assert_eq!(together.counts, alone.counts, "{design:?}: the counts are the same");
        let difference = difference(&together, &alone);
        assert!(difference <= 1e-6, "{design:?}: pictures differ by {difference}");
    }
}
