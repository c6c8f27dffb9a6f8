//! Metrics of pictures.
//!
//! In: synthetic pictures. Out: proof that metrics equal values computed by hand and by independent float64
//! implementations, that PSNR is finite, and that pictures of different sizes are refused.

use bevy_gs4d::internal::offline::measure::MS_SSIM_MIN_SIDE;
use bevy_gs4d::offline::measure::{ImageMetrics, MAX_PSNR, MetricSet, SizeMismatch, SquaredError};
use bevy_gs4d::offline::measure::{flip, ms_ssim, ssim};
use bevy_gs4d::view::Picture;
use glam::{UVec2, Vec3};
use proptest::prelude::*;

/// Returns a deterministic pattern; `k` changes it.
fn pattern(width: u32, height: u32, k: u32) -> Picture {
    let value = |x: u32, y: u32, c: u32| ((x * (7 + k) + y * (13 - k) + c * 29 + k * x * y) % 32) as f32 / 31.0;
    let pixel = |i: u32| Vec3::from([0, 1, 2].map(|c| value(i % width, i / width, c)));
    Picture { size: UVec2::new(width, height), pixels: (0..width * height).map(pixel).collect() }
}

/// Returns flat blocks with sharp borders.
fn blocks(width: u32, height: u32) -> Picture {
    let value = |x: u32, y: u32, c: u32| ((x / 9 * 5 + y / 7 * 3 + c * 7) % 16) as f32 / 15.0;
    let pixel = |i: u32| Vec3::from([0, 1, 2].map(|c| value(i % width, i / width, c)));
    Picture { size: UVec2::new(width, height), pixels: (0..width * height).map(pixel).collect() }
}

fn mixed(a: &Picture, b: &Picture, fraction: f32) -> Picture {
    let pixels = a.pixels.iter().zip(&b.pixels).map(|(p, q)| *p * (1.0 - fraction) + *q * fraction);
    Picture { size: a.size, pixels: pixels.collect() }
}

fn gray(value: f32) -> Picture {
    Picture::filled(UVec2::splat(8), Vec3::splat(value))
}

fn close(value: f64, expected: f64, tolerance: f64) -> bool {
    (value - expected).abs() <= tolerance
}

/// Returns the squared error of two pictures of one size.
#[track_caller]
fn error(a: &Picture, b: &Picture) -> SquaredError {
    SquaredError::of(a, b).expect("same size")
}

#[test]
fn psnr_is_averaged_over_channels_and_pooled_psnr_is_not() {
    let black = Picture::filled(UVec2::new(4, 3), Vec3::ZERO);
    let offset = Picture::filled(UVec2::new(4, 3), Vec3::new(0.1, 0.01, 0.001));
    // 20, 40 and 60 dB per channel.
    let error = error(&black, &offset);
    assert!(close(error.channel_psnr(), 40.0, 1e-5), "the mean of 20, 40 and 60 dB: {}", error.channel_psnr());
    assert!(close(error.mean_squared_error(), 0.010_101 / 3.0, 1e-9), "the mean of three channels");
    assert!(
        close(error.psnr(), -10.0 * (0.010_101f64 / 3.0).log10(), 1e-5),
        "the PSNR of the mean error: {}",
        error.psnr()
    );
}

#[test]
fn identical_pictures_have_the_largest_psnr_and_are_marked() {
    let a = pattern(23, 17, 0);
    let same = error(&a, &a);
    assert_eq!((same.channel_psnr(), same.psnr()), (MAX_PSNR, MAX_PSNR), "the largest PSNR, which is finite");
    assert!(same.is_identical(), "no value differs");
    assert_eq!(ssim(&a, &a), Ok(1.0), "exactly one");
    let metrics = ImageMetrics::of(&a, &a, MetricSet::PSNR).expect("same size");
    assert!(metrics.identical && metrics.psnr == MAX_PSNR, "the metrics mark identical pictures: {metrics:?}");
    // The smallest difference of floats: above 160 dB, and not identical.
    let mut b = a.clone();
    b.pixels[5].x = f32::from_bits(b.pixels[5].x.to_bits() + 1);
    let almost = error(&a, &b);
    assert!(!almost.is_identical(), "one value differs");
    assert!((160.0..MAX_PSNR).contains(&almost.psnr()), "below the largest PSNR: {}", almost.psnr());
    let tiny = error(&gray(0.0), &gray(1e-12));
    assert_eq!((tiny.is_identical(), tiny.psnr()), (false, MAX_PSNR), "an error of 1e-24 counts as 1e-20");
    let none = SquaredError::default();
    assert!(!none.is_identical() && none.psnr().is_nan(), "no pictures give no PSNR");
}

#[test]
fn an_identical_channel_is_left_out_of_the_mean_of_the_channels() {
    let offset = Picture::filled(UVec2::splat(8), Vec3::new(0.1, 0.0, 0.001));
    let error = error(&gray(0.0), &offset);
    assert!(close(error.channel_psnr(), 40.0, 1e-5), "the mean of 20 and 60 dB: {}", error.channel_psnr());
    assert!(close(error.psnr(), -10.0 * (0.010_001f64 / 3.0).log10(), 1e-5), "three channels are pooled");
}

#[test]
fn merged_errors_equal_the_error_of_one_larger_picture() {
    let (a, b) = (pattern(12, 8, 0), pattern(12, 8, 3));
    let (c, d) = (pattern(12, 5, 1), blocks(12, 5));
    let stacked = |top: &Picture, bottom: &Picture| {
        let pixels = [&top.pixels[..], &bottom.pixels].concat();
        Picture { size: UVec2::new(12, 13), pixels }
    };
    let whole = error(&stacked(&a, &c), &stacked(&b, &d));
    let mut added = error(&a, &b);
    added.add(&c, &d).expect("same size");
    let collected: SquaredError = [error(&a, &b), error(&c, &d)].into_iter().collect();
    for parts in [added, collected] {
        assert!(close(parts.psnr(), whole.psnr(), 1e-9), "pooled: {} and {}", parts.psnr(), whole.psnr());
        assert!(close(parts.channel_psnr(), whole.channel_psnr(), 1e-9), "by channel");
    }
    // Twenty pictures of one error and four without: 24 / 20 in the mean, 0.79 dB.
    let mut all: SquaredError = std::iter::repeat_n(error(&gray(0.5), &gray(0.6)), 20).collect();
    let before = all.psnr();
    (0..4).for_each(|_| all.add(&gray(0.0), &gray(0.0)).expect("same size"));
    assert!(close(all.psnr() - before, 10.0 * 1.2f64.log10(), 1e-9), "identical pictures change PSNR by a constant");
    assert!(all.add(&a, &c).is_err() && close(all.psnr() - before, 10.0 * 1.2f64.log10(), 1e-9), "nothing is added");
}

#[test]
fn psnr_does_not_clamp_pictures() {
    let value = error(&gray(0.0), &gray(10.0)).channel_psnr();
    assert!(close(value, -20.0, 1e-9), "an error of ten is -20 dB, got {value}");
}

#[test]
fn values_equal_an_independent_implementation() {
    let (a, n) = (pattern(23, 17, 0), pattern(23, 17, 3));
    let b = mixed(&a, &n, 0.25);
    let expected = [
        (error(&a, &b).channel_psnr(), 19.791447065582492),
        (error(&a, &b).psnr(), 19.791445079419375),
        (ssim(&a, &b).expect("same size"), 0.9420089934323176),
    ];
    for (value, expected) in expected {
        assert!(close(value, expected, 1e-5), "{value} instead of {expected}");
    }
    let different = ssim(&a, &n).expect("same size");
    assert!(close(different, 0.223360054258584, 1e-6), "{different}");
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
fn similarity_at_five_scales_equals_an_independent_implementation() {
    let (a, n) = (blocks(192, 180), pattern(192, 180, 3));
    let value = |a: &Picture, b: &Picture| ms_ssim(a, b).expect("same size").expect("large enough");
    for (other, expected) in [(mixed(&a, &n, 0.25), 0.9453459110134244), (n, 0.020016371180708016)] {
        let value = value(&a, &other);
        assert!(close(value, expected, 1e-5), "{value} instead of {expected}");
    }
    let least = blocks(MS_SSIM_MIN_SIDE, MS_SSIM_MIN_SIDE);
    let least_value = value(&least, &mixed(&least, &pattern(MS_SSIM_MIN_SIDE, MS_SSIM_MIN_SIDE, 3), 0.25));
    assert!(close(least_value, 0.9455034368401481, 1e-5), "one window at the coarsest scale: {least_value}");
    assert!(close(value(&a, &a), 1.0, 1e-12), "identical");
    let negative = Picture { size: a.size, pixels: a.pixels.iter().map(|p| Vec3::ONE - *p).collect() };
    assert_eq!(value(&a, &negative), 0.0, "negative similarity counts as 0");
    let small = blocks(MS_SSIM_MIN_SIDE, MS_SSIM_MIN_SIDE - 1);
    assert_eq!(ms_ssim(&small, &small), Ok(None), "too few pixels for five scales");
}

#[test]
fn flip_equals_an_independent_implementation() {
    let (a, n, b) = (pattern(40, 30, 0), pattern(40, 30, 3), blocks(40, 30));
    let (large, fine) = (blocks(192, 180), pattern(192, 180, 3));
    // The published evaluator gives 0.40389833, 0.22517820, 0.86294371, 0.22081998 and 0.39843717.
    for (reference, test, expected) in [
        (&a, &n, 0.4038979749482898),
        (&a, &mixed(&a, &n, 0.25), 0.22517817701350548),
        (&b, &a, 0.8629436623796588),
        (&b, &mixed(&b, &a, 0.1), 0.2208201521865226),
        (&large, &mixed(&large, &fine, 0.25), 0.39843508483739337),
    ] {
        let value = flip(reference, test).expect("same size");
        assert!(close(value, expected, 1e-5), "{value} instead of {expected}");
    }
}

#[test]
fn flip_of_flat_pictures_is_the_difference_of_color_alone() {
    let flat = |color| Picture::filled(UVec2::new(12, 9), color);
    let value = |a, b| flip(&flat(a), &flat(b)).expect("same size");
    assert_eq!(value(Vec3::splat(0.3), Vec3::splat(0.3)), 0.0, "identical");
    assert!(close(value(Vec3::Y, Vec3::Z), 1.0, 1e-9), "green and blue are farthest apart");
    assert!(close(value(Vec3::ZERO, Vec3::ONE), 0.9673797618501423, 1e-6), "black and white");
    assert!(close(value(Vec3::splat(0.5), Vec3::splat(0.6)), 0.2850130525308668, 1e-5), "two grays");
}

#[test]
fn pictures_of_other_sizes_are_refused() {
    let (a, b) = (pattern(4, 6, 0), pattern(6, 4, 0));
    let mismatch = SizeMismatch { first: UVec2::new(4, 6), second: UVec2::new(6, 4) };
    assert_eq!(SquaredError::of(&a, &b), Err(mismatch), "the same number of pixels, another shape");
    assert_eq!(ssim(&a, &b), Err(mismatch), "similarity");
    assert_eq!(ms_ssim(&a, &b), Err(mismatch), "similarity at five scales");
    assert_eq!(flip(&a, &b), Err(mismatch), "flip");
    assert!(mismatch.to_string().contains("4x6") && mismatch.to_string().contains("6x4"), "{mismatch}");
    let empty = Picture { size: UVec2::ZERO, pixels: Vec::new() };
    assert!(
        SquaredError::of(&empty, &empty).is_err() && ssim(&empty, &empty).is_err(),
        "pictures without pixels are refused"
    );
    let short = Picture { size: a.size, pixels: Vec::new() };
    assert!(SquaredError::of(&a, &short).is_err() && ssim(&short, &a).is_err(), "fewer pixels than the size requires");
}

/// Generates two pictures of the same small random size.
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
        let [error, mirrored] = [(&a, &b), (&b, &a)].map(|(a, b)| SquaredError::of(a, b).expect("same size"));
        prop_assert_eq!(error, mirrored, "the order of the pictures does not change the error");
        prop_assert_eq!(ssim(&a, &b), ssim(&b, &a), "nor the similarity");
        let similarity = ssim(&a, &b).expect("same size");
        prop_assert!((-1.0..=1.0 + 1e-12).contains(&similarity), "{}", similarity);
        let (mean, pooled) = (error.channel_psnr(), error.psnr());
        prop_assert!(mean.is_finite() && pooled.is_finite(), "{} and {} are finite", mean, pooled);
        // Holds unless an identical channel is left out.
        let differs = a.pixels.iter().zip(&b.pixels).fold(Vec3::ZERO, |sum, (p, q)| sum + (*p - *q).abs());
        prop_assert!(differs.min_element() == 0.0 || mean >= pooled - 1e-9, "{} below {}", mean, pooled);
        let (there, back) = (flip(&a, &b).expect("same size"), flip(&b, &a).expect("same size"));
        prop_assert!((there - back).abs() < 1e-12, "{} and {}", there, back);
        prop_assert!((0.0..=1.0 + 1e-9).contains(&there), "{}", there);
    }
}
