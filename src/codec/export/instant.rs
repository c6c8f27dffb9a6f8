//! A scene at one time.
//!
//! In: a scene and a time. Out: [`Columns`] of the Gaussians that are drawn then, at rest, with their positions,
//! opacities and colors of that time. Exact, except for rounding; parameters of static scenes are copied bit for bit.

use super::still::Ready;
use crate::codec::import::columns::Columns;
use crate::gaussian::InvalidGaussian;
use crate::gaussian::harmonics::time_cosine;
use crate::scene::{GaussianScene, TrainedWith};
use rayon::prelude::*;

/// Returns the Gaussians that are drawn at a time, which is in the unit of the scene. A packed scene is unpacked in
/// each call: callers with many times unpack it first.
///
/// # Errors
/// The first Gaussian that cannot be drawn.
pub(crate) fn at(scene: &GaussianScene, time: f32) -> Result<Columns, InvalidGaussian> {
    let ready = Ready::of(scene)?;
    let (cutoff, span) = (scene.trained_with.marginal_cutoff, scene.trained_with.period_of_colors());
    let active =
        scene.filter.as_ref().map(|filter| (filter, filter.segment_of(time, scene.trained_with.time_interval)));
    let is_drawn = |&index: &usize| {
        ready.gaussians[index].marginal(time) > cutoff
            && active.is_none_or(|(filter, segment)| filter.is_active(segment, index))
    };
    let drawn: Vec<usize> = (0..ready.gaussians.len()).into_par_iter().filter(is_drawn).collect();

    let mut harmonics = ready.harmonics_at_rest(drawn.len());
    let values = harmonics.coefficients * 3;
    harmonics.values.par_chunks_exact_mut(values).zip(&drawn).for_each(|(colors, &index)| {
        let tau = ready.gaussians[index].mean_t - time;
        ready.write_colors(index, |n| time_cosine(n, tau, span), colors);
    });
    let TrainedWith { origin, mip_filter, .. } = &scene.trained_with;
    let mut columns = Columns { harmonics, origin: origin.place, mip_filter: *mip_filter, ..Columns::default() };
    columns.mean = drawn.par_iter().map(|&index| ready.gaussians[index].mean_at(time).to_array()).collect();
    let stills: Vec<_> =
        drawn.par_iter().map(|&index| ready.still(index, ready.gaussians[index].marginal(time))).collect();
    for still in stills {
        columns.log_scale.push(still.log_scale);
        columns.rotation.push(still.rotation);
        columns.opacity_logit.push(still.opacity_logit);
    }
    Ok(columns)
}
