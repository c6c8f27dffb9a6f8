//! The score of the paper against closed forms.
//!
//! In: Gaussians of known volume, temporal mean and temporal variance, with given contributions or with the
//! contributions of small Gaussians to known pixels. Out: proof that the temporal factor, the volume factor, the
//! spatial score and their sum over views match the paper. The expected values are computed here in double precision,
//! derivatives of the marginal by finite differences.

use crate::support::trained::trained_mut;
use bevy_gs4d::internal::offline::score::{CpuEngine, ScoreEngine, Traits, ViewScore, Want, score};
use bevy_gs4d::offline::score::Variant;
use bevy_gs4d::offline::score::{ScoreError, ScoreSettings, Scores};
use bevy_gs4d::offline::work::NoProgress;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{GaussianScene, RuntimeScene};
use bevy_gs4d::view::{Background, Camera, RasterFov, View};
use glam::{UVec2, Vec3};

/// Raw parameters of one Gaussian that is not rotated.
#[derive(Debug, Clone, Copy)]
struct One {
    mean: [f32; 3],
    mean_t: f32,
    log_scale: [f32; 3],
    log_scale_t: f32,
    opacity: f32,
}

impl Default for One {
    fn default() -> Self {
        Self { mean: [0.0; 3], mean_t: 0.0, log_scale: [-9.0; 3], log_scale_t: 0.0, opacity: 0.6 }
    }
}

impl One {
    /// Returns the temporal variance: without rotation it is the square of the temporal scale.
    fn variance(&self) -> f64 {
        (2.0 * f64::from(self.log_scale_t)).exp()
    }

    /// Returns the product of the four activated scales.
    fn volume(&self) -> f64 {
        self.log_scale.iter().chain([&self.log_scale_t]).map(|&log| f64::from(log).exp()).product()
    }

    /// Returns the temporal factor of the paper at a time.
    fn steadiness(&self, time: f32) -> f64 {
        let step = 1e-3 * self.variance().sqrt();
        steadiness(second_derivative(self.marginal(), time.into(), step))
    }

    fn marginal(&self) -> impl Fn(f64) -> f64 {
        marginal(self.mean_t.into(), self.variance())
    }
}

/// Returns the unnormalized marginal.
fn marginal(mean: f64, variance: f64) -> impl Fn(f64) -> f64 {
    move |time| (-(time - mean).powi(2) / (2.0 * variance)).exp()
}

fn first_derivative(f: impl Fn(f64) -> f64, at: f64, step: f64) -> f64 {
    (f(at + step) - f(at - step)) / (2.0 * step)
}

fn second_derivative(f: impl Fn(f64) -> f64, at: f64, step: f64) -> f64 {
    (f(at + step) - 2.0 * f(at) + f(at - step)) / (step * step)
}

/// Returns `1 / (½ tanh |x| + ½)`, which is `1 + exp(−2 |x|)`.
fn steadiness(derivative: f64) -> f64 {
    1.0 + (-2.0 * derivative.abs()).exp()
}

/// Returns a scene in the trained form of these Gaussians.
fn scene(gaussians: &[One]) -> GaussianScene {
    let mut scene = synthesize(&SynthSettings { count: gaussians.len(), ..SynthSettings::default() });
    let parameters = &mut trained_mut(&mut scene).parameters;
    parameters.mean = gaussians.iter().map(|one| one.mean).collect();
    parameters.mean_t = gaussians.iter().map(|one| one.mean_t).collect();
    parameters.log_scale = gaussians.iter().map(|one| one.log_scale).collect();
    parameters.log_scale_t = gaussians.iter().map(|one| one.log_scale_t).collect();
    parameters.rotation_l = vec![[1.0, 0.0, 0.0, 0.0]; gaussians.len()];
    parameters.rotation_r = vec![[1.0, 0.0, 0.0, 0.0]; gaussians.len()];
    parameters.opacity_logit = gaussians.iter().map(|one| (one.opacity / (1.0 - one.opacity)).ln()).collect();
    scene
}

/// An engine that returns given sums, by the height of the view as index.
struct Given<'a>(&'a [ViewScore]);

impl ScoreEngine for Given<'_> {
    fn score(&mut self, view: &View, _: Want) -> Result<ViewScore, ScoreError> {
        Ok(self.0[view.size.y as usize - 1].clone())
    }
}

/// Returns the scores of a scene, with given sums for a view at each of these times.
fn scores(scene: &GaussianScene, settings: &ScoreSettings, views: &[(f32, ViewScore)]) -> Scores {
    let (times, sums): (Vec<f32>, Vec<ViewScore>) = views.iter().cloned().unzip();
    let view = |(i, &time): (usize, &f32)| {
        let size = UVec2::new(1, i as u32 + 1);
        Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 0.8, size).view(time, RasterFov::Reference)
    };
    let views: Vec<View> = times.iter().enumerate().map(view).collect();
    let traits = Traits::of(scene).expect("a valid scene");
    Scores::accumulate(&mut Given(&sums), &traits, &views, settings, &mut NoProgress).expect("contributions")
}

/// Returns sums of a view to which each of `count` Gaussians contributes 1.
fn ones(count: usize) -> ViewScore {
    ViewScore { contribution: vec![1.0; count], energy: vec![1.0; count], removal: vec![1.0; count] }
}

fn value(scores: &Scores, variant: Variant, index: usize) -> f64 {
    scores.of(variant).expect("the trained form has the volume")[index].into()
}

#[track_caller]
fn assert_close(found: f64, expected: f64, what: &str) {
    assert!((found - expected).abs() <= 1e-5 * expected.abs(), "{what}: {found} instead of {expected}");
}

/// Returns one score of the only Gaussian of a scene, which contributes 1 to one view.
fn score_at(scene: &GaussianScene, variant: Variant, time: f32) -> f64 {
    value(&scores(scene, &ScoreSettings::default(), &[(time, ones(1))]), variant, 0)
}

#[test]
fn temporal_factors_follow_from_the_derivatives_of_the_marginal() {
    for log_scale_t in [-0.7f32, 0.0, 0.6] {
        let one = One { mean_t: 0.3, log_scale_t, ..One::default() };
        let scene = scene(&[one]);
        for distance in [0.0, 0.4, 1.0, 1.6, -0.8, -2.2f32] {
            let time = one.mean_t + distance * log_scale_t.exp();
            let what = format!("a temporal scale of exp({log_scale_t}), {distance} deviations away");
            assert_close(score_at(&scene, Variant::Full, time), one.steadiness(time), &format!("full, {what}"));
            let first = first_derivative(one.marginal(), time.into(), 1e-4);
            assert_close(
                score_at(&scene, Variant::FirstDerivative, time),
                steadiness(first),
                &format!("first derivative, {what}"),
            );
            assert_close(score_at(&scene, Variant::Sigma, time), one.variance(), &format!("sigma, {what}"));
        }
    }
}

#[test]
fn the_temporal_factor_is_normalized_to_the_range_from_1_to_2() {
    // A variance of 1: |p''| is 1 at the temporal mean, 0 one deviation away.
    let unit = scene(&[One::default()]);
    assert_close(score_at(&unit, Variant::Full, 0.0), 1.135_335_283_236_612_7, "1 / (½ tanh 1 + ½)");
    assert_close(score_at(&unit, Variant::Full, 1.0), 2.0, "the inflection point of the marginal");
    assert_close(score_at(&unit, Variant::Full, 9.0), 2.0, "far from the temporal mean");
    let brief = scene(&[One { log_scale_t: -3.0, ..One::default() }]);
    assert_close(score_at(&brief, Variant::Full, 0.0), 1.0, "a second derivative of 400");
}

#[test]
fn the_temporal_variance_follows_the_model() {
    let one = One { log_scale: [0.5; 3], log_scale_t: -0.4, mean_t: 0.2, ..One::default() };
    let time = 0.6f32;
    let expected = |variance: f64| {
        steadiness(second_derivative(marginal(one.mean_t.into(), variance), time.into(), 1e-3 * variance.sqrt()))
    };
    let changed = |change: fn(&mut bevy_gs4d::gaussian::Parameters)| {
        let mut scene = scene(&[one]);
        change(&mut trained_mut(&mut scene).parameters);
        scene
    };
    // One isoclinic rotation by the angle a mixes time with one axis of space: Σ_44 = cos² a s_t² + sin² a s². The
    // quaternion need not be of unit length.
    let turned = changed(|parameters| parameters.rotation_l[0] = [3.0 * 0.8, 3.0 * 0.6, 0.0, 0.0]);
    let variance = 0.64 * (-0.8f64).exp() + 0.36 * 1f64.exp();
    assert_close(score_at(&turned, Variant::Sigma, time), variance, "variance after a rotation in 4D");
    assert_close(score_at(&turned, Variant::Full, time), expected(variance), "factor after a rotation in 4D");
    let unrotated = changed(|parameters| parameters.rotation_r.clear());
    let variance = (-0.4f64).exp();
    assert_close(score_at(&unrotated, Variant::Sigma, time), variance, "variance without rotation: the temporal scale");
    assert_close(score_at(&unrotated, Variant::Full, time), expected(variance), "factor without rotation");
    let fixed = changed(|parameters| {
        parameters.rotation_r.clear();
        parameters.mean_t.clear();
        parameters.log_scale_t.clear();
    });
    assert_close(score_at(&fixed, Variant::Full, time), 2.0, "a static Gaussian does not change");
}

/// Returns γ of each Gaussian. The time is one deviation from all temporal means, where the temporal factor is 2.
fn volume_factors(gaussians: &[One], settings: &ScoreSettings) -> Vec<f64> {
    let at_inflection: Vec<One> =
        gaussians.iter().map(|one| One { mean_t: 1.0 - one.log_scale_t.exp(), ..*one }).collect();
    let scores = scores(&scene(&at_inflection), settings, &[(1.0, ones(gaussians.len()))]);
    (0..gaussians.len()).map(|index| value(&scores, Variant::Full, index) / 2.0).collect()
}

#[test]
fn the_volume_factor_is_a_power_of_the_volume_over_the_reference_volume() {
    // Volumes of 4 · 4 · 8 · 8 = 2¹⁰ to 1, so that γ is (2¹⁰)^0.1 = 2.
    let ln2 = std::f32::consts::LN_2;
    let large = One {
        log_scale: [2.0 * ln2 - 5.0, 2.0 * ln2 - 5.0, 3.0 * ln2 - 5.0],
        log_scale_t: 3.0 * ln2,
        ..One::default()
    };
    let small = One { log_scale: [-5.0; 3], log_scale_t: 0.0, ..One::default() };
    let factors = volume_factors(&[large, small], &ScoreSettings::default());
    assert_close(factors[0], 2.0, "1024 times the reference volume");
    assert_close(factors[1], 1.0, "the reference volume");
    let squared = volume_factors(&[large, small], &ScoreSettings { volume_power: 0.2, ..ScoreSettings::default() });
    assert_close(squared[0], 4.0, "with twice the power");
    let without = volume_factors(&[large, small], &ScoreSettings { volume_power: 0.0, ..ScoreSettings::default() });
    assert_close(without[0], 1.0, "a power of 0 leaves the volume out");
}

#[test]
fn the_reference_volume_is_at_nine_tenths_of_the_descending_volumes() {
    // Number of Gaussians, ⌊0.9 N⌋ and the place of the reference volume for other ranks.
    for (count, rank, place) in [(10, 0.9, 9), (25, 0.9, 22), (7, 0.9, 6), (1, 0.9, 0), (25, 0.0, 0), (25, 0.5, 12)] {
        // Not sorted by volume.
        let gaussians: Vec<One> = (0..count)
            .map(|i| {
                let k = (i * 3 % count) as f32;
                One { log_scale: [-6.0 + 0.11 * k, -5.0 - 0.03 * k, -5.5], log_scale_t: 0.05 * k, ..One::default() }
            })
            .collect();
        let settings = ScoreSettings { volume_rank: rank, ..ScoreSettings::default() };
        let larger_than = |one: &&One| gaussians.iter().filter(|other| other.volume() > one.volume()).count();
        let reference = gaussians.iter().find(|one| larger_than(one) == place).expect("all volumes differ").volume();
        let factors = volume_factors(&gaussians, &settings);
        for (index, (one, found)) in gaussians.iter().zip(factors).enumerate() {
            let expected = (one.volume() / reference).powf(0.1);
            assert_close(found, expected, &format!("rank {rank} of {count} volumes, Gaussian {index}"));
        }
    }
}

/// Width and height of the pictures below, pixels: their center is pixel 16, 16.
const SIZE: UVec2 = UVec2::splat(33);
const FOV: f32 = 0.8;

/// Returns the variance on the screen of a round Gaussian that is `distance` straight ahead, with the low-pass, pixels
/// squared.
fn screen_variance(one: &One, distance: f64) -> f64 {
    let focal = f64::from(SIZE.x) / (2.0 * (f64::from(FOV) / 2.0).tan());
    (focal * f64::from(one.log_scale[0]).exp() / distance).powi(2) + 0.3
}

/// Returns the alpha of a Gaussian at a squared distance from its center in pixels; 0 if it is skipped there.
fn alpha(one: &One, time: f32, variance: f64, squared: f64) -> f64 {
    let alpha = f64::from(one.opacity) * one.marginal()(time.into()) * (-squared / (2.0 * variance)).exp();
    if alpha < 1.0 / 255.0 { 0.0 } else { alpha.min(0.99) }
}

/// Returns the sum over the pixels of a picture of a function of the squared distance from its center.
fn over_pixels(f: impl Fn(f64) -> f64) -> f64 {
    (0..33 * 33).map(|i| f(f64::from((i % 33 - 16i32).pow(2) + (i / 33 - 16i32).pow(2)))).sum()
}

/// Returns the contribution of each Gaussian to a view from a place toward a point.
fn contributions(gaussians: &[One], eye: Vec3, target: Vec3, time: f32) -> Vec<f64> {
    let runtime: RuntimeScene = scene(gaussians).into_runtime().expect("a valid scene");
    let view = Camera::look_at(eye, target, Vec3::Y, FOV, SIZE).view(time, RasterFov::Reference);
    let score = score(&runtime, &view, Background::Color([0.2; 3]), Want::Contribution);
    score.contribution.into_iter().map(f64::from).collect()
}

#[test]
fn the_spatial_score_is_the_sum_of_alpha_over_pixels() {
    let eye = Vec3::new(0.0, 0.0, -2.0);
    // A splat of the smallest size that the low-pass allows is blended into nine pixels.
    let point = One { mean_t: 0.2, log_scale_t: -0.5, ..One::default() };
    let time = 0.5;
    let peak = f64::from(point.opacity) * point.marginal()(time.into());
    let nine = peak * (1.0 + 4.0 * (-1.0 / 0.6f64).exp() + 4.0 * (-2.0 / 0.6f64).exp());
    let found = contributions(&[point], eye, Vec3::ZERO, time)[0];
    assert!((found - nine).abs() < 1e-4 * nine, "a point in nine pixels: {found} instead of {nine}");

    // At the temporal mean, an opacity of 0.999 is clamped at the center.
    for (log_scale, opacity, time) in [(-2.3, 0.6, 0.5), (-2.8, 0.3, 0.5), (-2.3, 0.999, 0.2), (-3.5, 0.05, 0.9)] {
        let round = One { log_scale: [log_scale; 3], opacity, ..point };
        let variance = screen_variance(&round, 2.0);
        let expected = over_pixels(|squared| alpha(&round, time, variance, squared));
        let found = contributions(&[round], eye, Vec3::ZERO, time)[0];
        assert_close(found, expected, &format!("a scale of exp({log_scale}), an opacity of {opacity}"));
    }
}

#[test]
fn the_spatial_score_counts_the_transmittance_in_front() {
    let back = One { log_scale: [-2.5; 3], opacity: 0.7, ..One::default() };
    let front = One { mean: [0.0, 0.0, -0.5], log_scale: [-3.5; 3], opacity: 0.9, ..One::default() };
    let (of_back, of_front) = (screen_variance(&back, 2.0), screen_variance(&front, 1.5));
    let in_front = |squared| alpha(&front, 0.1, of_front, squared);
    let expected =
        [over_pixels(|squared| alpha(&back, 0.1, of_back, squared) * (1.0 - in_front(squared))), over_pixels(in_front)];
    let found = contributions(&[back, front], Vec3::new(0.0, 0.0, -2.0), Vec3::ZERO, 0.1);
    assert_close(found[1], expected[1], "the Gaussian in front");
    assert_close(found[0], expected[0], "the Gaussian behind it");
}

#[test]
fn the_score_sums_the_product_of_all_factors_over_views() {
    let gaussians = [
        One { mean: [-10.0, 0.0, 0.0], mean_t: 0.1, log_scale: [-2.6; 3], log_scale_t: -0.3, opacity: 0.6 },
        One { mean: [10.0, 0.0, 0.0], mean_t: 0.6, log_scale: [-3.1; 3], log_scale_t: 0.2, opacity: 0.8 },
    ];
    // Each view shows one of the two Gaussians, at the center; two views are at the same time.
    let shown = [(0, 0.4, Vec3::Z), (0, 0.4, -Vec3::Z), (0, 1.0, Vec3::Z), (1, 0.4, Vec3::Z), (1, 0.0, -Vec3::Z)];
    let view = |&(index, time, side): &(usize, f32, Vec3)| {
        let target = Vec3::from(gaussians[index].mean);
        Camera::look_at(target + 2.0 * side, target, Vec3::Y, FOV, SIZE).view(time, RasterFov::Reference)
    };
    let views: Vec<View> = shown.iter().map(view).collect();
    let (scene, background) = (scene(&gaussians), Background::Color([0.5; 3]));
    let runtime = scene.clone().into_runtime().expect("a valid scene");
    let traits = Traits::of(&scene).expect("a valid scene");
    let mut engine = CpuEngine { scene: &runtime, background };
    let scores = Scores::accumulate(&mut engine, &traits, &views, &ScoreSettings::default(), &mut NoProgress);
    let scores = scores.expect("the views show the scene");
    // The reference of two volumes is the smaller volume.
    let reference = gaussians.iter().map(One::volume).fold(f64::INFINITY, f64::min);
    for (index, one) in gaussians.iter().enumerate() {
        let variance = screen_variance(one, 2.0);
        let spatial = |time| over_pixels(|squared| alpha(one, time, variance, squared));
        let gamma = (one.volume() / reference).powf(0.1);
        let own = || shown.iter().filter(|view| view.0 == index).map(|view| view.1);
        let sum: f64 = own().map(|time| one.steadiness(time) * gamma * spatial(time)).sum();
        assert_close(value(&scores, Variant::Full, index), sum, &format!("full, Gaussian {index}"));
        let sum: f64 = own().map(spatial).sum();
        assert_close(value(&scores, Variant::Spatial, index), sum, &format!("spatial, Gaussian {index}"));
        // Views that do not show the Gaussian count too.
        let sum: f64 = shown.iter().map(|view| one.steadiness(view.1) * gamma).sum();
        assert_close(value(&scores, Variant::Temporal, index), sum, &format!("temporal, Gaussian {index}"));
    }
}

#[test]
fn every_variant_combines_its_sums_as_defined() {
    let gaussians = [
        One { mean_t: 0.1, log_scale: [-4.0; 3], log_scale_t: -0.3, ..One::default() },
        One { mean_t: 0.6, log_scale: [-3.0; 3], log_scale_t: 0.2, ..One::default() },
        One { mean_t: 0.9, log_scale: [-5.0; 3], log_scale_t: 0.5, ..One::default() },
    ];
    let of = |contribution: [f32; 3], energy: [f32; 3], removal: [f32; 3]| ViewScore {
        contribution: contribution.to_vec(),
        energy: energy.to_vec(),
        removal: removal.to_vec(),
    };
    // Views not in the order of time; the first and the third are at the same time.
    let views = [
        (0.5, of([1.0, 0.0, 8.0], [0.5, 0.0, 4.0], [0.25, 0.0, 3.0])),
        (0.9, of([4.0, 3.0, 1.0], [1.5, 2.0, 0.5], [1.25, 1.0, 0.1])),
        (0.5, of([2.0, 5.0, 0.5], [0.5, 1.0, 0.2], [0.75, 2.0, 0.3])),
        (0.2, of([0.0, 7.0, 2.0], [0.0, 3.0, 0.7], [0.0, 2.5, 0.9])),
    ];
    let scores = scores(&scene(&gaussians), &ScoreSettings::default(), &views);
    let reference = gaussians[2].volume();
    for (index, one) in gaussians.iter().enumerate() {
        let gamma = (one.volume() / reference).powf(0.1);
        let first = |time: f32| steadiness(first_derivative(one.marginal(), time.into(), 1e-4));
        let contribution = |view: usize| f64::from(views[view].1.contribution[index]);
        // Contributions by time.
        let times = [(0.5, contribution(0) + contribution(2)), (0.9, contribution(1)), (0.2, contribution(3))];
        let weighted = times.map(|(time, sum)| one.steadiness(time) * gamma * sum);
        let plain = times.map(|(_, sum)| sum);
        let norm = |values: [f64; 3]| values.iter().map(|v| v * v).sum::<f64>().sqrt();
        let peak = |values: [f64; 3]| values.into_iter().fold(0.0, f64::max);
        let root = |column: fn(&ViewScore) -> &Vec<f32>| {
            views.iter().map(|(_, view)| f64::from(column(view)[index])).sum::<f64>().sqrt()
        };
        let (energy, removal) = (root(|view| &view.energy), root(|view| &view.removal));
        for variant in Variant::ALL {
            let expected = match variant {
                Variant::Spatial => plain.iter().sum(),
                Variant::Temporal => views.iter().map(|(time, _)| one.steadiness(*time) * gamma).sum(),
                Variant::Full => weighted.iter().sum(),
                Variant::FirstDerivative => times.map(|(time, sum)| first(time) * gamma * sum).iter().sum(),
                Variant::Sigma => plain.iter().map(|sum| one.variance() * gamma * sum).sum(),
                Variant::Norm2 => norm(plain),
                Variant::Peak => peak(plain),
                Variant::FullNorm2 => norm(weighted),
                Variant::FullPeak => peak(weighted),
                Variant::Energy => energy,
                Variant::Removal => removal,
                Variant::EnergyRemoval => (energy * removal).sqrt(),
            };
            assert_close(value(&scores, variant, index), expected, &format!("{variant}, Gaussian {index}"));
        }
    }
}
