//! A scene with its motion.
//!
//! In: a scene. Out: [`Columns`] of all its Gaussians with [`Motion`], color without harmonics in time, and the losses.
//!
//! Harmonics in time are replaced by their mean over the times at which the Gaussian is visible, which is nearer to its
//! color, weighted by opacity, than the color at its temporal mean, and than the color without them.

use super::error::ExportError;
use super::still::Ready;
use crate::codec::import::columns::{Columns, Motion};
use crate::gaussian::Gaussian;
use crate::scene::{FilterKind, GaussianScene, TrainedWith};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Returns all Gaussians. The temporal filter stays if `keeps_filter`.
///
/// # Errors
/// The first Gaussian that cannot be drawn; without a filter, a scene whose Gaussians only a filter activates.
pub(crate) fn moving(scene: &GaussianScene, keeps_filter: bool) -> Result<(Columns, Vec<String>), ExportError> {
    let ready = Ready::of(scene)?;
    let mut lost = Vec::new();
    let TrainedWith { origin, mip_filter, .. } = &scene.trained_with;
    let mut columns = Columns { origin: origin.place, mip_filter: *mip_filter, ..Columns::default() };
    match &scene.filter {
        Some(filter) if keeps_filter => columns.filter = Some(filter.clone()),
        Some(filter) if filter.kind != FilterKind::Support => {
            if filter.kind == FilterKind::Window {
                return Err(ExportError::Unsupported(
                    "its Gaussians are switched on and off at certain times, which this format cannot state; export a sequence (--sequence), or as .4dgs"
                        .to_owned(),
                ));
            }
            let share = 100.0 * (1.0 - filter.active_share());
            lost.push(format!(
                "The temporal filter is not exported: other players draw {share:.0} % more of the Gaussians, which training cameras do not see."
            ));
        }
        Some(_) | None => {}
    }
    let harmonics_t = if scene.trained_with.force_sh_3d { 0 } else { scene.form.color_degrees().degree_t };
    if harmonics_t > 0 && ready.harmonics.degree == 3 {
        lost.push(
            "Colors change over the life of a Gaussian; each is exported with the mean over the times at which it is visible.".to_owned(),
        );
    }
    let [first, last] = scene.trained_with.time_interval.map(f64::from);
    let reach = (-2.0 * f64::from(scene.trained_with.marginal_cutoff).ln()).sqrt();
    let mut harmonics = ready.harmonics_at_rest(ready.gaussians.len());
    let values = harmonics.coefficients * 3;
    harmonics.values.par_chunks_exact_mut(values).enumerate().for_each(|(index, colors)| {
        let Gaussian { mean_t, sigma_t, .. } = ready.gaussians[index];
        let (mean_t, half) = (f64::from(mean_t), reach * f64::from(sigma_t));
        let visible = [mean_t - half, mean_t + half].map(|time| time.clamp(first, last) - mean_t);
        ready.write_colors(index, |n| mean_cosine(TAU * n as f64 / (last - first), visible), colors);
    });
    let stills: Vec<_> = (0..ready.gaussians.len()).into_par_iter().map(|index| ready.still(index, 1.0)).collect();
    for (still, gaussian) in stills.into_iter().zip(ready.gaussians.iter()) {
        let &Gaussian { mean, velocity, mean_t, sigma_t, .. } = gaussian;
        columns.mean.push(mean);
        columns.log_scale.push(still.log_scale);
        columns.rotation.push(still.rotation);
        columns.opacity_logit.push(still.opacity_logit);
        columns.motion.push(Motion { velocity, mean_t, sigma_t });
    }
    Ok((Columns { harmonics, ..columns }, lost))
}

/// Returns the mean of `cos(frequency t)` over a range of times, which may be a single time.
fn mean_cosine(frequency: f64, [from, to]: [f64; 2]) -> f32 {
    let half = frequency * (to - from) / 2.0;
    let around = if half.abs() < 1e-6 { 1.0 } else { half.sin() / half };
    ((frequency * (from + to) / 2.0).cos() * around) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_a_cosine_is_that_of_many_samples() {
        for range in [[-0.2, 0.7], [0.1, 0.1], [-3.0, 4.0], [0.0, 1e-9]] {
            let sample = |i: usize| (TAU * (range[0] + (range[1] - range[0]) * (i as f64 + 0.5) / 1e5)).cos();
            let expected = (0..100_000).map(sample).sum::<f64>() / 1e5;
            let found = f64::from(mean_cosine(TAU, range));
            assert!((found - expected).abs() < 1e-6, "{range:?}: {found} is {expected}");
        }
    }
}
