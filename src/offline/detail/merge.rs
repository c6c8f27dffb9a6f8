//! Merging many Gaussians to few that look nearly the same in pictures of few pixels.
//!
//! In: Gaussians ready to draw and their color, the number of merged Gaussians, the size of a pixel. Out: Gaussians in
//! the trained form.
//!
//! 1. Each Gaussian is a point of eight coordinates: its positions at the first and at the last time at which it is
//!    drawn, and these two times. Gaussians of different motion or lifespan are far apart. The set with the largest
//!    spread is divided until there are enough sets.
//! 2. Each set becomes one Gaussian with the mean and the covariance of the set in space and time. Color is averaged;
//!    the harmonics of time are about each Gaussian's own temporal mean, so that moving the mean by `Δμ` multiplies
//!    `cos(n ω (μ − t))` by `cos(n ω Δμ)`.
//! 3. Absorption is kept: a splat of opacity `o` and area `A` absorbs `A Li₂(o)`, the integral of `−ln(1 − o g)`. Areas
//!    are areas on the screen, with the low-pass.

use crate::gaussian::alpha::{ALPHA_MAX, ALPHA_MIN};
use crate::gaussian::axes::Axes;
use crate::gaussian::conic::LOW_PASS;
use crate::gaussian::harmonics::time_cosine;
use crate::gaussian::outer::outer;
use crate::gaussian::{Gaussian, Harmonics, Parameters, lifespan_reach};
use crate::scene::{Sliced, Trained};
use glam::{DMat3, DMat4, DVec3, DVec4};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Longest temporal deviation, lengths of the time interval: opacity is nearly constant.
const LONGEST: f64 = 100.0;
/// Coordinates of a Gaussian when sets are divided.
const AXES: usize = 8;

/// Merges Gaussians to at most `count`, for pictures with pixels of `pixel` capture units. `interval` is the time
/// interval of the capture, `cutoff` the marginal at and below which a Gaussian is not drawn, `radius` the radius of
/// the sphere about its bounds. Gaussians that are never drawn are left out.
pub(super) fn merge(
    sliced: &Sliced,
    interval: [f32; 2],
    cutoff: f32,
    radius: f32,
    count: usize,
    pixel: f64,
) -> Trained {
    let reach = lifespan_reach(cutoff);
    let Sliced { gaussians, harmonics } = sliced;
    let interval = interval.map(f64::from);
    let low_pass = f64::from(LOW_PASS) * pixel * pixel;
    let all = gaussians.iter().enumerate();
    let seen: Vec<Seen<'_>> = all.filter_map(|(index, one)| Seen::of(index, one, reach, interval, low_pass)).collect();
    let span = interval[1] - interval[0];
    let mut made = Trained {
        parameters: Parameters::default(),
        harmonics: Harmonics { coefficients: harmonics.evaluated(), values: Vec::new(), ..*harmonics },
    };
    for set in divide(&seen, f64::from(radius) / span, count) {
        push_merged(&mut made, &set, harmonics, span, low_pass);
    }
    made
}

/// A Gaussian that is drawn at some time.
#[derive(Debug, Clone, Copy)]
struct Seen<'a> {
    index: usize,
    gaussian: &'a Gaussian,
    /// The first and the last time at which the Gaussian is drawn, within the interval.
    from: f64,
    to: f64,
    /// Temporal deviation, at most [`LONGEST`] intervals.
    sigma_t: f64,
    /// Absorption of the Gaussian times its duration.
    weight: f64,
}

impl<'a> Seen<'a> {
    /// Returns the Gaussian; `None` if it is never drawn.
    fn of(index: usize, gaussian: &'a Gaussian, reach: f64, [start, end]: [f64; 2], low_pass: f64) -> Option<Self> {
        let sigma_t = f64::from(gaussian.sigma_t).min(LONGEST * (end - start));
        let (mean_t, lifespan) = (f64::from(gaussian.mean_t), reach * sigma_t);
        let (from, to) = (start.max(mean_t - lifespan), end.min(mean_t + lifespan));
        let absorbed = thickness(f64::from(gaussian.opacity)) * area(covariance(gaussian), low_pass);
        let weight = absorbed * sigma_t.min(end - start);
        let drawn = gaussian.opacity >= ALPHA_MIN && from <= to && weight > 0.0 && weight.is_finite();
        drawn.then_some(Self { index, gaussian, from, to, sigma_t, weight })
    }

    fn mean_at(&self, time: f64) -> DVec3 {
        let [mean, velocity] = [self.gaussian.mean, self.gaussian.velocity].map(|v| DVec3::from(v.map(f64::from)));
        mean + velocity * (time - f64::from(self.gaussian.mean_t))
    }

    /// Returns the coordinates of the Gaussian; a timestamp unit is `speed` capture units long.
    fn place(&self, speed: f64) -> [f64; AXES] {
        let ([a, b, c], [d, e, f]) = (self.mean_at(self.from).to_array(), self.mean_at(self.to).to_array());
        [a, b, c, d, e, f, speed * self.from, speed * self.to]
    }
}

/// A set of Gaussians.
struct Set {
    /// Indices of the Gaussians in a list.
    members: Vec<u32>,
    /// Weighted sum of the squared distances from the middle, along `axis`.
    spread: f64,
    /// The coordinate with the largest spread.
    axis: usize,
    /// Weighted mean of that coordinate.
    middle: f64,
}

impl Set {
    fn of(members: Vec<u32>, places: &[[f64; AXES]], seen: &[Seen<'_>]) -> Self {
        let weight = |&member: &u32| seen[member as usize].weight;
        let total: f64 = members.iter().map(weight).sum();
        let along = |axis: usize| {
            let place = |member: &u32| places[*member as usize][axis];
            let middle = members.iter().map(|m| weight(m) * place(m)).sum::<f64>() / total;
            let spread = members.iter().map(|m| weight(m) * (place(m) - middle).powi(2)).sum::<f64>();
            (spread, axis, middle)
        };
        // The mean of one place can differ from it by rounding: a set of one is never divided.
        let axes = if members.len() > 1 { 0..AXES } else { 0..0 };
        let (spread, axis, middle) = axes.map(along).fold((0.0, 0, 0.0), |a, b| if b.0 > a.0 { b } else { a });
        Self { members, spread, axis, middle }
    }
}

impl Ord for Set {
    /// Orders sets by spread; equal spreads by the first member, so that the division is the same on every machine.
    fn cmp(&self, other: &Self) -> Ordering {
        self.spread.total_cmp(&other.spread).then_with(|| other.members.first().cmp(&self.members.first()))
    }
}

impl PartialOrd for Set {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Set {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Set {}

/// Divides Gaussians into at most `count` sets of close Gaussians.
fn divide<'a>(seen: &[Seen<'a>], speed: f64, count: usize) -> Vec<Vec<Seen<'a>>> {
    if seen.is_empty() || count == 0 {
        return Vec::new();
    }
    let places: Vec<[f64; AXES]> = seen.iter().map(|one| one.place(speed)).collect();
    let mut sets = BinaryHeap::from([Set::of((0..seen.len() as u32).collect(), &places, seen)]);
    while sets.len() < count
        && let Some(widest) = sets.pop()
    {
        if widest.spread <= 0.0 {
            sets.push(widest);
            break;
        }
        let below = |member: &u32| places[*member as usize][widest.axis] < widest.middle;
        let (mut low, mut high): (Vec<u32>, Vec<u32>) = widest.members.into_iter().partition(below);
        // Rounding can put all members on one side.
        if low.is_empty() {
            low = high.split_off(high.len() / 2);
        } else if high.is_empty() {
            high = low.split_off(low.len() / 2);
        }
        for half in [low, high] {
            if !half.is_empty() {
                sets.push(Set::of(half, &places, seen));
            }
        }
    }
    let mut sets = sets.into_vec();
    sets.sort_unstable_by_key(|set| set.members.first().copied());
    sets.iter().map(|set| set.members.iter().map(|&member| seen[member as usize]).collect()).collect()
}

/// Adds the Gaussian that replaces a set.
fn push_merged(made: &mut Trained, set: &[Seen<'_>], harmonics: &Harmonics, span: f64, low_pass: f64) {
    let total: f64 = set.iter().map(|one| one.weight).sum();
    let mean = |value: &dyn Fn(&Seen<'_>) -> f64| set.iter().map(|one| one.weight * value(one)).sum::<f64>() / total;
    let mean_3 = |value: &dyn Fn(&Seen<'_>) -> DVec3| {
        set.iter().fold(DVec3::ZERO, |sum, one| sum + value(one) * one.weight) / total
    };
    // Temporal mean and deviation.
    let mean_t = mean(&|one| f64::from(one.gaussian.mean_t));
    let variance_t = mean(&|one| one.sigma_t.powi(2) + (f64::from(one.gaussian.mean_t) - mean_t).powi(2));
    let sigma_t = variance_t.sqrt().min(LONGEST * span);
    // Position and motion over the time that is shown: Gaussians of a far longer lifespan would otherwise add positions
    // that are not shown.
    let middle = |one: &Seen<'_>| 0.5 * (one.from + one.to);
    let shown = |one: &Seen<'_>| one.sigma_t.min((one.to - one.from) / 12f64.sqrt()).powi(2);
    let center_t = mean(&middle);
    let center = mean_3(&|one| one.mean_at(middle(one)));
    let velocity_of = |one: &Seen<'_>| DVec3::from(one.gaussian.velocity.map(f64::from));
    let along = mean(&|one| shown(one) + (middle(one) - center_t).powi(2));
    let moved =
        mean_3(&|one| velocity_of(one) * shown(one) + (one.mean_at(middle(one)) - center) * (middle(one) - center_t));
    let velocity = if along > 0.0 { moved / along } else { mean_3(&velocity_of) };
    let spread = set.iter().fold(DMat3::ZERO, |sum, one| {
        let (apart, own) = (one.mean_at(middle(one)) - center, velocity_of(one));
        sum + (covariance(one.gaussian) + outer(own, own) * shown(one) + outer(apart, apart)) * one.weight
    });
    let conditional = spread * total.recip() - outer(velocity, velocity) * along;
    // Opacity.
    let thick = total / (area(conditional, low_pass) * sigma_t.min(span));
    let opacity = opacity_of(thick);

    let Parameters { mean: means, mean_t: times, log_scale, log_scale_t, rotation_l, rotation_r, opacity_logit } =
        &mut made.parameters;
    let least = (conditional.x_axis.x + conditional.y_axis.y + conditional.z_axis.z).max(0.0).sqrt() * 1e-4;
    let Axes { scale, left, right } =
        Axes::of(joint_covariance(conditional, velocity, sigma_t.powi(2)), least.max(1e-12));
    let [x, y, z, t] = scale.map(f64::ln).as_vec4().to_array();
    means.push((center + velocity * (mean_t - center_t)).as_vec3().to_array());
    times.push(mean_t as f32);
    log_scale.push([x, y, z]);
    log_scale_t.push(t);
    let single = |quaternion: DVec4| quaternion.as_vec4().to_array();
    rotation_l.push(single(left));
    rotation_r.push(single(right));
    opacity_logit.push((opacity / (1.0 - opacity)).ln() as f32);
    made.harmonics.values.extend(merged_color(set, total, harmonics, mean_t, span));
}

/// Returns the covariance in space and time of a Gaussian with this covariance in space at each time, this velocity and
/// this temporal variance.
fn joint_covariance(conditional: DMat3, velocity: DVec3, variance_t: f64) -> DMat4 {
    let block = conditional + outer(velocity, velocity) * variance_t;
    let across = velocity * variance_t;
    DMat4::from_cols(
        block.x_axis.extend(across.x),
        block.y_axis.extend(across.y),
        block.z_axis.extend(across.z),
        across.extend(variance_t),
    )
}

/// Returns the color of a set, the coefficients that are evaluated.
fn merged_color(set: &[Seen<'_>], total: f64, harmonics: &Harmonics, mean_t: f64, span: f64) -> Vec<f32> {
    let mut sums = vec![0.0f64; harmonics.evaluated() * 3];
    for one in set {
        let apart = (f64::from(one.gaussian.mean_t) - mean_t) as f32;
        // 16 coefficients of three channels for each harmonic of time.
        for (harmonic, block) in sums.chunks_mut(48).enumerate() {
            let factor = one.weight / total * f64::from(time_cosine(harmonic, apart, span as f32));
            let values = &harmonics.of(one.index)[harmonic * 48..];
            block.iter_mut().zip(values).for_each(|(sum, &value)| *sum += factor * f64::from(value));
        }
    }
    sums.into_iter().map(|sum| sum as f32).collect()
}

fn covariance(gaussian: &Gaussian) -> DMat3 {
    let [xx, xy, xz, yy, yz, zz] = gaussian.covariance.map(f64::from);
    DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz])
}

/// Returns the area of a splat without its factor 2π, capture units squared: a mean over directions, with the low-pass.
fn area(covariance: DMat3, low_pass: f64) -> f64 {
    let m = covariance + DMat3::from_diagonal(DVec3::splat(low_pass));
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis];
    // The root of the mean square over three axes; the sum of the principal minors does not depend on the axes.
    let minors = x.x * y.y - x.y * x.y + x.x * z.z - x.z * x.z + y.y * z.z - y.z * y.z;
    (minors.max(0.0) / 3.0).sqrt()
}

/// Returns the absorption of a splat of this opacity for each 2π of its area: `Li₂(o)`, the sum of `oᵏ / k²`.
fn thickness(opacity: f64) -> f64 {
    let opacity = opacity.clamp(0.0, f64::from(ALPHA_MAX));
    if opacity > 0.5 {
        let rest = 1.0 - opacity;
        return std::f64::consts::PI.powi(2) / 6.0 - opacity.ln() * rest.ln() - thickness(rest);
    }
    let mut power = 1.0;
    (1..=40).fold(0.0, |sum, k| {
        power *= opacity;
        sum + power / f64::from(k * k)
    })
}

/// Returns the opacity with this absorption, at most [`ALPHA_MAX`]: the inverse of [`thickness`].
fn opacity_of(thick: f64) -> f64 {
    let (mut low, mut high) = (0.0, f64::from(ALPHA_MAX));
    for _ in 0..48 {
        let middle = 0.5 * (low + high);
        if thickness(middle) < thick {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::MARGINAL_CUTOFF;
    use crate::gaussian::SliceSettings;

    const PIXEL: f64 = 0.05;

    fn gaussian(mean: [f32; 3]) -> Gaussian {
        Gaussian {
            mean,
            mean_t: 0.4,
            velocity: [0.3, -0.2, 0.1],
            sigma_t: 0.1,
            covariance: [0.04, 0.01, -0.005, 0.03, 0.002, 0.01],
            opacity: 0.6,
            padding: 0.0,
        }
    }

    fn sliced(gaussians: &[Gaussian]) -> Sliced {
        let values = (0..gaussians.len()).flat_map(|index| [0.1, 0.2, 0.3].map(|v| v + index as f32)).collect();
        let harmonics = Harmonics { coefficients: 1, degree: 0, degree_t: 0, values };
        Sliced { gaussians: gaussians.to_vec(), harmonics }
    }

    fn merged(gaussians: &[Gaussian], count: usize) -> (Vec<Gaussian>, Harmonics) {
        let Trained { parameters, harmonics } =
            merge(&sliced(gaussians), [0.0, 1.0], MARGINAL_CUTOFF, 1.0, count, PIXEL);
        (parameters.slice(&SliceSettings::default()).expect("it can be drawn"), harmonics)
    }

    fn apart(a: &[f32], b: &[f32]) -> f32 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn merging_one_gaussian_returns_it() {
        let always = Gaussian { velocity: [0.0; 3], sigma_t: f32::INFINITY, ..gaussian([1.0, 2.0, 3.0]) };
        for one in [gaussian([1.0, 2.0, 3.0]), Gaussian { sigma_t: 3.0, ..gaussian([0.0; 3]) }, always] {
            let (found, harmonics) = merged(&[one], 5);
            assert_eq!(found.len(), 1, "one Gaussian is returned");
            assert!(apart(&found[0].mean, &one.mean) < 1e-5, "mean {:?}", found[0].mean);
            assert!(apart(&found[0].velocity, &one.velocity) < 1e-4, "velocity {:?}", found[0].velocity);
            assert!(apart(&found[0].covariance, &one.covariance) < 1e-5, "covariance {:?}", found[0].covariance);
            assert!((found[0].opacity - one.opacity).abs() < 1e-4, "opacity {}", found[0].opacity);
            assert!((found[0].sigma_t - one.sigma_t.min(100.0)).abs() < 1e-3 * found[0].sigma_t, "duration");
            assert!(apart(&harmonics.values, &[0.1, 0.2, 0.3]) < 1e-6, "color");
        }
    }

    #[test]
    fn merging_two_equal_gaussians_doubles_the_absorption() {
        let one = Gaussian { opacity: 0.3, ..gaussian([0.5; 3]) };
        let (found, harmonics) = merged(&[one, one], 1);
        assert_eq!(found.len(), 1, "the two are merged");
        assert!(apart(&found[0].covariance, &one.covariance) < 1e-5, "the shape is kept");
        assert!(apart(&found[0].velocity, &one.velocity) < 1e-4, "the motion is kept");
        let absorbed = thickness(f64::from(found[0].opacity));
        assert!((absorbed - 2.0 * thickness(0.3)).abs() < 1e-4, "opacity {}", found[0].opacity);
        assert!(apart(&harmonics.values, &[0.6, 0.7, 0.8]) < 1e-6, "the color is the mean");
    }

    #[test]
    fn a_merged_gaussian_has_mean_and_covariance_of_the_set() {
        let [a, b] = [[0.2, 0.0, 0.0], [-0.2, 0.0, 0.0]].map(gaussian);
        let (found, _) = merged(&[a, b], 1);
        let mut expected = a.covariance;
        expected[0] += 0.04;
        assert!(apart(&found[0].mean, &[0.0; 3]) < 1e-5, "the mean lies between the two");
        assert!(
            apart(&found[0].covariance, &expected) < 1e-5,
            "the covariance includes the distance: {:?}",
            found[0].covariance
        );
    }

    #[test]
    fn gaussians_of_different_motion_or_lifespan_are_not_merged() {
        let here = gaussian([0.0; 3]);
        let later = Gaussian { mean_t: 0.9, sigma_t: 0.02, ..here };
        let earlier = Gaussian { mean_t: 0.1, sigma_t: 0.02, ..here };
        let other = Gaussian { velocity: [-0.9, 0.8, 0.0], ..here };
        for [a, b] in [[later, earlier], [here, other]] {
            let (found, _) = merged(&[a, a, a, b, b, b], 2);
            let times: Vec<f32> = found.iter().map(|one| one.mean_t).collect();
            assert_eq!(found.len(), 2, "one for each kind");
            let kept = found.iter().all(|one| {
                [a, b]
                    .iter()
                    .any(|old| (one.mean_t - old.mean_t).abs() < 1e-4 && apart(&one.velocity, &old.velocity) < 1e-3)
            });
            assert!(kept, "each merged Gaussian is of one kind: {times:?}");
        }
    }

    #[test]
    fn harmonics_of_time_are_moved_with_the_temporal_mean() {
        let [early, late] = [0.3, 0.5].map(|mean_t| Gaussian { mean_t, velocity: [0.0; 3], ..gaussian([0.0; 3]) });
        let values: Vec<f32> = (0..2).flat_map(|_| (0..96).map(|at| if at < 48 { 0.0 } else { 1.0 })).collect();
        let harmonics = Harmonics { coefficients: 32, degree: 3, degree_t: 1, values };
        let both = Sliced { gaussians: vec![early, late], harmonics };
        let made = merge(&both, [0.0, 1.0], MARGINAL_CUTOFF, 1.0, 1, PIXEL);
        let expected = time_cosine(1, 0.1, 1.0);
        let found = &made.harmonics.values[48..];
        assert!(found.iter().all(|value| (value - expected).abs() < 1e-5), "{} of {expected}", found[0]);
    }

    #[test]
    fn thickness_and_opacity_are_inverse() {
        for opacity in [0.01, 0.3, 0.5, 0.7, 0.98] {
            assert!(
                (opacity_of(thickness(opacity)) - opacity).abs() < 1e-9,
                "the inverse of the absorption of {opacity}"
            );
        }
        assert!((thickness(0.5) - 0.582_240_526).abs() < 1e-8, "Li2 of one half");
        assert!((opacity_of(99.0) - f64::from(ALPHA_MAX)).abs() < 1e-9, "opacity is at most ALPHA_MAX");
    }

    #[test]
    fn gaussians_that_are_never_drawn_are_left_out() {
        let faint = Gaussian { opacity: 0.001, ..gaussian([0.0; 3]) };
        let past = Gaussian { mean_t: -9.0, sigma_t: 0.1, ..gaussian([0.0; 3]) };
        let (found, harmonics) = merged(&[faint, past], 4);
        assert!(found.is_empty() && harmonics.values.is_empty(), "no Gaussian is returned");
    }
}
