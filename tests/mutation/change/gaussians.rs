//! Gaussians at the ends of what readers accept and renderers draw.
//!
//! In: the values of one Gaussian in one section of a package. Out: other values: needles, sheets and Gaussians of
//! every size, faint and bright ones, far away and fast.

use super::numbers;
use crate::support::random::Random;
use glam::Vec3;

/// Opacity at which alpha is just visible, and its logit.
const FAINT: f32 = 1.0 / 255.0;
const FAINT_LOGIT: f32 = -5.537_334;

/// Returns whether the values of a section are changed here.
pub fn has(name: &str) -> bool {
    const NAMES: [&str; 13] = [
        "mean",
        "mean_t",
        "velocity",
        "log_scale",
        "log_scale_t",
        "sigma_t",
        "covariance",
        "opacity_logit",
        "opacity",
        "sh_dc",
        "sh_rest",
        "packed_ranges",
        "codebook_scales",
    ];
    NAMES.contains(&name)
}

/// Changes the values of a Gaussian in a section.
pub fn change(name: &str, values: &mut [f32], random: &mut Random) {
    match name {
        "log_scale" => {
            let (longest, thinner) = (between(-8.0, 44.0, random), between(0.0, 24.0, random));
            let long = random.below(values.len());
            let thin = |at| if at == long { longest } else { longest - thinner * between(0.0, 1.0, random) };
            values.iter_mut().zip((0..).map(thin)).for_each(|(value, scale)| *value = scale);
        }
        "covariance" => values.copy_from_slice(&needle(random)[..values.len().min(6)]),
        "log_scale_t" => values.fill(between(-10.0, 20.0, random)),
        "sigma_t" => values.fill(10.0f32.powf(between(-8.0, 12.0, random))),
        "mean_t" => values.fill(between(-1.0, 2.0, random)),
        "opacity_logit" => values.fill(opacity(FAINT_LOGIT, 30.0, random)),
        "opacity" => values.fill(opacity(FAINT, 1.0, random).clamp(0.0, 1.0)),
        "packed_ranges" => values.fill_with(|| between(-20.0, 40.0, random)),
        _ => {
            let most = if random.one_in(3) { 32.0 } else { 4.0 };
            values.fill_with(|| magnitude(-3.0, most, random));
        }
    }
    if random.one_in(8) {
        values[random.below(values.len())] = numbers::float(random);
    }
}

/// Returns the covariance of a needle or a sheet: xx, xy, xz, yy, yz, zz.
fn needle(random: &mut Random) -> [f32; 6] {
    let mut direction = || Vec3::from([(); 3].map(|()| between(-1.0, 1.0, random))).normalize_or(Vec3::X);
    let (along, across) = (direction(), direction());
    let long = 10.0f32.powf(between(-5.0, 18.0, random));
    let [wide, thin] = [(); 2].map(|()| long * 10.0f32.powf(-between(0.0, 8.0, random)));
    let entry = |a: usize, b: usize| {
        let round = if a == b { thin * thin } else { 0.0 };
        long * along[a] * (long * along[b]) + wide * across[a] * (wide * across[b]) + round
    };
    [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
}

/// Returns an opacity or its logit: next to the value at which alpha is just visible, the largest, or one between.
fn opacity(faint: f32, most: f32, random: &mut Random) -> f32 {
    match random.below(3) {
        0 => faint * (1.0 + between(-1e-5, 1e-5, random)),
        1 => most,
        _ => between(faint, most, random),
    }
}

/// Returns a number of either sign, between two powers of ten.
fn magnitude(low: f32, high: f32, random: &mut Random) -> f32 {
    let sign = if random.one_in(2) { -1.0 } else { 1.0 };
    sign * 10.0f32.powf(between(low, high, random))
}

fn between(low: f32, high: f32, random: &mut Random) -> f32 {
    low + (high - low) * (random.below(1 << 20) as f32 / (1 << 20) as f32)
}
