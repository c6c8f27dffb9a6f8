//! What segments must have in common to be one capture.
//!
//! In: segments, their places on the clock of all. Out: an error that names the first segment that differs, and what
//! differs; the time after which the colors of all repeat.

use super::clock::Place;
use super::error::{SegmentsError, Shared};
use super::segment::Segment;
use crate::scene::{ColorDegrees, GaussianScene};

/// Relative difference of the periods of colors that no picture shows.
const SAME_PERIOD: f64 = 1e-5;

/// Checks that all segments are drawn with the settings of the first.
///
/// # Errors
/// No segment, or the first that differs.
pub(super) fn require_alike(segments: &[Segment]) -> Result<(), SegmentsError> {
    let Some((first, others)) = segments.split_first() else { return Err(SegmentsError::Nothing) };
    let differing = others.iter().find_map(|other| Some((other, difference(&first.scene, &other.scene)?)));
    differing.map_or(Ok(()), |(other, what)| Err(other.differs(first, what)))
}

/// Returns what is not the same in two captures.
fn difference(a: &GaussianScene, b: &GaussianScene) -> Option<Shared> {
    let (own, other) = (&a.trained_with, &b.trained_with);
    let is_other_training =
        own.force_sh_3d != other.force_sh_3d || own.near != other.near || own.mip_filter != other.mip_filter;
    [
        (Shared::Up, a.playback.up != b.playback.up),
        (Shared::Background, own.background != other.background),
        (Shared::Environment, a.environment != b.environment),
        (Shared::Cutoff, own.marginal_cutoff != other.marginal_cutoff),
        (Shared::RasterFov, own.raster_fov != other.raster_fov),
        (Shared::Cameras, own.cameras != other.cameras),
        (Shared::ShDirection, own.sh_direction != other.sh_direction),
        (Shared::Training, is_other_training),
        (Shared::Degrees, degrees(a) != degrees(b)),
    ]
    .into_iter()
    .find_map(|(what, differs)| differs.then_some(what))
}

/// Returns the degrees of color in space and time that are evaluated.
fn degrees(scene: &GaussianScene) -> (u32, u32) {
    let ColorDegrees { degree, degree_t, .. } = scene.form.color_degrees();
    (degree, if degree == 3 && !scene.trained_with.force_sh_3d { degree_t } else { 0 })
}

/// Returns the time after which the colors of all segments repeat, on the clock of all; `None` if no color changes with
/// time.
///
/// # Errors
/// The first segment whose colors repeat after another time.
pub(super) fn color_period(segments: &[Segment], places: &[Place]) -> Result<Option<f32>, SegmentsError> {
    let Some(first) = segments.first().filter(|first| degrees(&first.scene).1 > 0) else { return Ok(None) };
    let period =
        |segment: &Segment, place: &Place| f64::from(segment.scene.trained_with.period_of_colors()) * place.scale;
    let usual = f64::from(first.scene.trained_with.period_of_colors());
    let is_other = |(segment, place): &(&Segment, &Place)| (period(segment, place) - usual).abs() > SAME_PERIOD * usual;
    match segments.iter().zip(places).find(is_other) {
        Some((other, _)) => Err(other.differs(first, Shared::ColorPeriod)),
        None => Ok(Some(first.scene.trained_with.period_of_colors())),
    }
}
