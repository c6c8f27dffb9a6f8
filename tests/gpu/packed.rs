//! The packed form on the GPU.
//!
//! In: packed synthetic scenes. Out: proof that the GPU decodes them like the CPU reference, and that scenes with the same
//! codebooks share their buffer. Skipped where there is no
//! GPU.

use crate::support::gpu;
use crate::support::packed_scene::{BLACK, scene, settings, view};
use bevy_gs4d::offline::compress::compress;
use bevy_gs4d::reference;
use bevy_gs4d::renderer::GpuError;
use bevy_gs4d::scene::{CodedColors, Form, PackedColors, PackedScene};
use std::sync::Arc;

#[test]
fn packed_scenes_match_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    for (degree, degree_t, codebooks) in
        [(3, 2, &[64, 32, 16, 8][..]), (3, 2, &[]), (3, 1, &[50]), (2, 0, &[16, 16]), (1, 0, &[8]), (0, 0, &[2])]
    {
        let (packed, _) = compress(scene(5_000, degree, degree_t), &settings(codebooks)).expect("compression succeeds");
        let packed = packed.into_runtime().expect("drawable");
        let capture = headless.upload(&packed).expect("the scene fits the GPU");
        for time in [0.0, 0.33, 0.8] {
            let found = headless.render(&capture, &view(time), BLACK).expect("the view is drawn");
            let expected = reference::render(&packed, &view(time), BLACK);
            let pixels = found.picture.pixels.iter().zip(&expected.picture.pixels);
            let apart = pixels.map(|(a, b)| (*a - *b).abs().max_element());
            let worst = apart.clone().fold(0.0, f32::max);
            let far = apart.filter(|apart| *apart > 1e-3).count();
            let what = format!("degree {degree} and {degree_t}, {codebooks:?}, at {time}");
            // A pixel may differ by more if rounding decides whether a splat is blended.
            assert!(far <= 20 && worst <= 0.05, "{what}: {far} pixels differ, at most by {worst}");
            assert!(found.counts.visible > 500, "{what}: the scene is visible: {:?}", found.counts);
        }
    }
}

#[test]
fn captures_with_the_same_codebooks_share_their_buffer() {
    let Some(mut headless) = gpu::headless() else { return };
    let (packed, _) = compress(scene(2_000, 3, 0), &settings(&[64, 32])).expect("compression succeeds");
    let first = packed.into_runtime().expect("drawable");
    let (second, mut other) = (first.clone(), first.clone());
    let Form::Packed(scene) = &mut other.form else { panic!("the scene is packed") };
    coded(scene, |colors| colors.codebooks = Arc::new((*colors.codebooks).clone()));
    let scenes = [first, second, other];
    let captures = scenes.each_ref().map(|scene| headless.upload(scene).expect("the scene fits the GPU"));
    // 16 coefficients of three colors in half precision.
    let codebooks = (64 + 32) * 16 * 3 * 2;
    assert_eq!(captures[0].bytes() - captures[1].bytes(), codebooks, "the second capture has no codebooks of its own");
    assert_eq!(captures[0].bytes(), captures[2].bytes(), "equal codebooks that are another allocation are not shared");
    let pictures = captures
        .each_ref()
        .map(|capture| headless.render(capture, &view(0.3), BLACK).expect("the view is drawn").picture);
    assert!(pictures[1] == pictures[0] && pictures[2] == pictures[0], "one picture");
}

/// Damages the codebook colors of a scene.
fn coded(packed: &mut PackedScene, spoil: impl FnOnce(&mut CodedColors)) {
    let PackedColors::Coded(colors) = &mut packed.colors else { panic!("the colors are coded") };
    spoil(colors);
}

#[test]
fn inconsistent_packed_scenes_are_not_uploaded() {
    let Some(headless) = gpu::headless() else { return };
    let (packed, _) = compress(scene(600, 2, 0), &settings(&[16, 8])).expect("compression succeeds");
    let good = packed.into_runtime().expect("drawable");
    assert!(headless.upload(&good).is_ok(), "the undamaged scene is uploaded");
    let spoils: [fn(&mut PackedScene); 4] = [
        |packed| packed.ranges.truncate(4),
        |packed| packed.records.truncate(256),
        |packed| coded(packed, |colors| colors.records[599][1] |= 0xffff),
        |packed| coded(packed, |colors| Arc::make_mut(&mut colors.codebooks).words.truncate(7)),
    ];
    for (index, spoil) in spoils.into_iter().enumerate() {
        let mut bad = good.clone();
        let Form::Packed(packed) = &mut bad.form else { panic!("the scene is packed") };
        spoil(packed);
        assert!(matches!(headless.upload(&bad), Err(GpuError::Scene(_))), "damaged scene {index} is refused");
    }
}
