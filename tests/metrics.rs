//! Picture metrics against values worked out by hand and by an independent float64 implementation.

use bevy_gs4d::{
    metrics::{SizeMismatch, psnr, psnr_pooled, ssim},
    picture::Picture,
};
use glam::{UVec2, Vec3};
use proptest::prelude::*;

/// A deterministic pattern; `k` changes it.
fn pattern(width: u32, height: u32, k: u32) -> Picture {
    let value = |x: u32, y: u32, c: u32| ((x * (7 + k) + y * (13 - k) + c * 29 + k * x * y) % 32) as f32 / 31.0;
    let pixel = |i: u32| Vec3::from([0, 1, 2].map(|c| value(i % width, i / width, c)));
    Picture { size: UVec2::new(width, height), pixels: (0..width * height).map(pixel).collect() }
}

fn mixed(a: &Picture, b: &Picture, share: f32) -> Picture {
    let pixels = a.pixels.iter().zip(&b.pixels).map(|(p, q)| *p * (1.0 - share) + *q * share);
    Picture { size: a.size, pixels: pixels.collect() }
}

fn gray(value: f32) -> Picture {
    Picture::filled(UVec2::splat(8), Vec3::splat(value))
}

fn close(value: f64, expected: f64, tolerance: f64) -> bool {
    (value - expected).abs() <= tolerance
}

#[test]
fn psnr_is_averaged_over_channels_and_pooled_is_not() {
    let black = Picture::filled(UVec2::new(4, 3), Vec3::ZERO);
    let offset = Picture::filled(UVec2::new(4, 3), Vec3::new(0.1, 0.01, 0.001));
    // 20, 40 and 60 dB per channel.
    let mean = psnr(&black, &offset).expect("same size");
    assert!(close(mean, 40.0, 1e-5), "{mean}");
    let pooled = psnr_pooled(&black, &offset).expect("same size");
    assert!(close(pooled, -10.0 * (0.010_101f64 / 3.0).log10(), 1e-5), "{pooled}");
}

#[test]
fn identical_pictures_are_infinitely_close_and_fully_similar() {
    let a = pattern(23, 17, 0);
    assert_eq!(psnr(&a, &a), Ok(f64::INFINITY), "no error in any channel");
    assert_eq!(psnr_pooled(&a, &a), Ok(f64::INFINITY), "no error at all");
    assert_eq!(ssim(&a, &a), Ok(1.0), "exactly one");
}

#[test]
fn nothing_is_clamped() {
    let value = psnr(&gray(0.0), &gray(10.0)).expect("same size");
    assert!(close(value, -20.0, 1e-9), "an error of ten is -20 dB, got {value}");
}

#[test]
fn values_equal_an_independent_implementation() {
    let (a, n) = (pattern(23, 17, 0), pattern(23, 17, 3));
    let b = mixed(&a, &n, 0.25);
    let expected = [
        (psnr(&a, &b), 19.791447065582492),
        (psnr_pooled(&a, &b), 19.791445079419375),
        (ssim(&a, &b), 0.9420089934323176),
    ];
    for (value, expected) in expected {
        let value = value.expect("same size");
        assert!(close(value, expected, 1e-5), "{value} instead of {expected}");
    }
    let unlike = ssim(&a, &n).expect("same size");
    assert!(close(unlike, 0.223360054258584, 1e-6), "{unlike}");
}

#[test]
fn pictures_smaller_than_the_window_are_padded_with_zeros() {
    let crop = |picture: &Picture| {
        let pixels = (0..4).flat_map(|y| (0..3).map(move |x| (x, y))).map(|(x, y)| picture.pixel(x, y));
        Picture { size: UVec2::new(3, 4), pixels: pixels.collect() }
    };
    let (a, n) = (pattern(23, 17, 0), pattern(23, 17, 3));
    let small = ssim(&crop(&a), &crop(&mixed(&a, &n, 0.25))).expect("same size");
    assert!(close(small, 0.9744796503400363, 1e-6), "{small}");
    // Flat pictures: the padding alone gives them variance near the border.
    let flat = ssim(&gray(0.5), &gray(0.25)).expect("same size");
    assert!(close(flat, 0.6446087998709114, 1e-6), "{flat}");
    let opposite = ssim(&gray(0.0), &gray(1.0)).expect("same size");
    assert!(close(opposite, 1.4559654893168737e-6, 1e-9), "{opposite}");
}

#[test]
fn pictures_of_other_sizes_are_refused() {
    let (a, b) = (pattern(4, 6, 0), pattern(6, 4, 0));
    let mismatch = SizeMismatch { first: UVec2::new(4, 6), second: UVec2::new(6, 4) };
    assert_eq!(psnr(&a, &b), Err(mismatch), "as many pixels, other shape");
    assert_eq!(psnr_pooled(&a, &b), Err(mismatch), "pooled");
    assert_eq!(ssim(&a, &b), Err(mismatch), "similarity");
    assert!(mismatch.to_string().contains("4x6") && mismatch.to_string().contains("6x4"), "{mismatch}");
    let empty = Picture { size: UVec2::ZERO, pixels: Vec::new() };
    assert!(psnr(&empty, &empty).is_err() && ssim(&empty, &empty).is_err(), "no pixels, no number");
    let short = Picture { size: a.size, pixels: Vec::new() };
    assert!(psnr(&a, &short).is_err() && ssim(&short, &a).is_err(), "fewer pixels than the size says");
}

/// Two pictures of the same small random size.
fn two_pictures() -> impl Strategy<Value = (Picture, Picture)> {
    (1u32..20, 1u32..20).prop_flat_map(|(width, height)| {
        let values = proptest::collection::vec(proptest::array::uniform6(0.0f32..1.0), (width * height) as usize);
        values.prop_map(move |values| {
            let half = |from: usize| Picture {
                size: UVec2::new(width, height),
                pixels: values.iter().map(|v| Vec3::new(v[from], v[from + 1], v[from + 2])).collect(),
            };
            (half(0), half(3))
        })
    })
}

proptest! {
    #[test]
    fn metrics_are_symmetric_and_bounded((a, b) in two_pictures()) {
        prop_assert_eq!(psnr(&a, &b), psnr(&b, &a));
        prop_assert_eq!(ssim(&a, &b), ssim(&b, &a));
        let similarity = ssim(&a, &b).expect("same size");
        prop_assert!((-1.0..=1.0 + 1e-12).contains(&similarity), "{}", similarity);
        let (mean, pooled) = (psnr(&a, &b).expect("same size"), psnr_pooled(&a, &b).expect("same size"));
        prop_assert!(mean >= pooled - 1e-9, "{} below {}", mean, pooled);
    }
}
