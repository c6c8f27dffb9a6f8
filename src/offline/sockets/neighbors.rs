//! The Gaussians that are drawn near a point at a time.
//!
//! In: the Gaussians of a capture, with its temporal filter; a point and a time. Out: the nearest [`Neighbor`]s,
//! weighted by their opacity at that time and by their distance; the colors around the point.

use super::look::Colored;
use super::motion::Neighbor;
use crate::codec::import::columns::SH_C0;
use crate::gaussian::{Gaussian, Harmonics, InvalidGaussian, lifespan_reach};
use crate::scene::{Bounds, Form, GaussianScene, SceneForm, TrainedWith};
use glam::{DVec3, Mat3, Vec3};
use rayon::prelude::*;

/// Number of neighbors: enough that the noise of single velocities averages out, few enough to be of one part.
const COUNT: usize = 48;
/// Smallest opacity at the time at which a Gaussian counts: fainter ones are haze or the remains of pruning.
const FAINTEST: f32 = 0.02;

/// Standard deviations up to which a Gaussian is seen.
const SEEN: f32 = 2.0;

/// The Gaussians of a capture that can be followed.
pub(super) struct Cloud {
    pieces: Vec<Piece>,
    /// The diagonal of the middle of the capture, capture units.
    pub size: f64,
    /// The length of the time interval, timestamp units.
    pub span: f64,
    /// Whether it is a sequence of stills: Gaussians that come and go, of which none moves.
    pub is_still: bool,
}

/// A Gaussian, and the times between which it is drawn.
struct Piece {
    gaussian: Gaussian,
    /// Its color, independent of direction and time, 0 to 1.
    color: Vec3,
    drawn: [f32; 2],
}

/// The Gaussians near a point.
pub(super) struct Near {
    /// The nearest first.
    pub neighbors: Vec<Neighbor>,
    /// The distance of the farthest of them, capture units.
    pub radius: f64,
}

impl Cloud {
    /// Returns the Gaussians of a scene.
    ///
    /// # Errors
    /// The first Gaussian that cannot be drawn.
    pub(super) fn of(scene: &GaussianScene) -> Result<Self, InvalidGaussian> {
        let TrainedWith { time_interval, marginal_cutoff, .. } = scene.trained_with;
        let (gaussians, colors) = (scene.gaussians()?, colors(scene));
        let reach = lifespan_reach(marginal_cutoff) as f32;
        let piece = |(index, gaussian): (usize, &Gaussian)| {
            let half = reach * gaussian.sigma_t;
            let [first, last] = match &scene.filter {
                Some(filter) => filter.window(index, time_interval).map(|time| time as f32),
                None => [f32::NEG_INFINITY, f32::INFINITY],
            };
            let drawn = [first.max(gaussian.mean_t - half), last.min(gaussian.mean_t + half)];
            let is_followed = gaussian.opacity > FAINTEST && gaussian.check().is_ok();
            is_followed.then_some(Piece { gaussian: *gaussian, color: *colors.get(index)?, drawn })
        };
        let pieces: Vec<Piece> = gaussians.iter().enumerate().filter_map(piece).collect();
        let core = Bounds::core(pieces.iter().map(|piece| piece.gaussian));
        let size = core.map_or(0.0, |core| 2.0 * f64::from(core.radius()));
        let moves = |piece: &Piece| piece.gaussian.velocity != [0.0; 3];
        let is_still =
            !pieces.iter().any(moves) && pieces.iter().any(|piece| piece.drawn.iter().all(|t| t.is_finite()));
        let span = f64::from(time_interval[1]) - f64::from(time_interval[0]);
        Ok(Self { pieces, size, span, is_still })
    }

    /// Returns the nearest Gaussians that are drawn at `time` (timestamp units) within `reach` (capture units) of a
    /// point in capture space.
    pub(super) fn near(&self, place: DVec3, time: f64, reach: f64) -> Near {
        let (at, now, limit) = (place.as_vec3(), time as f32, (reach * reach) as f32);
        let distance = |piece: &Piece| {
            let [first, last] = piece.drawn;
            if !(first..=last).contains(&now) {
                return None;
            }
            let distance = piece.gaussian.mean_at(now).distance_squared(at);
            (distance <= limit && piece.gaussian.opacity * piece.gaussian.marginal(now) > FAINTEST).then_some(distance)
        };
        let pieces = self.pieces.par_iter().enumerate();
        let mut found: Vec<(f32, usize)> =
            pieces.filter_map(|(index, piece)| Some((distance(piece)?, index))).collect();
        let nearer = |a: &(f32, usize), b: &(f32, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if found.len() > COUNT {
            found.select_nth_unstable_by(COUNT, nearer);
            found.truncate(COUNT);
        }
        found.sort_unstable_by(nearer);
        let radius = found.last().map_or(0.0, |(distance, _)| f64::from(*distance).sqrt());
        let neighbors = found.iter().filter_map(|(distance, index)| {
            let Piece { gaussian, .. } = self.pieces.get(*index)?;
            let spread = (0.5 * radius).max(f64::MIN_POSITIVE.sqrt().sqrt());
            let near = (-0.5 * f64::from(*distance) / (spread * spread)).exp();
            // The integral of the marginal; at most the whole time.
            let life = (f64::from(gaussian.sigma_t) * std::f64::consts::TAU.sqrt()).min(self.span);
            Some(Neighbor {
                mean: Vec3::from(gaussian.mean).as_dvec3(),
                mean_t: f64::from(gaussian.mean_t),
                velocity: Vec3::from(gaussian.velocity).as_dvec3(),
                life,
                weight: f64::from(gaussian.opacity * gaussian.marginal(now)) * near,
            })
        });
        Near { neighbors: neighbors.collect(), radius }
    }

    /// Returns whether a point in capture space is on a Gaussian that is drawn at `time` (timestamp units), or about
    /// `distance` (capture units) beside it: within [`SEEN`] standard deviations of the Gaussian, widened by that.
    pub(super) fn touches(&self, place: DVec3, time: f64, distance: f64) -> bool {
        let (at, now) = (place.as_vec3(), time as f32);
        let wider = (distance as f32 / SEEN).powi(2);
        self.pieces.par_iter().any(|Piece { gaussian, drawn: [first, last], .. }| {
            let is_drawn = (*first..=*last).contains(&now) && gaussian.opacity * gaussian.marginal(now) > FAINTEST;
            let offset = gaussian.mean_at(now) - at;
            let [xx, xy, xz, yy, yz, zz] = gaussian.covariance;
            let columns = [[xx + wider, xy, xz], [xy, yy + wider, yz], [xz, yz, zz + wider]];
            let covariance = Mat3::from_cols_array_2d(&columns);
            is_drawn && offset.dot(covariance.inverse() * offset) <= SEEN * SEEN
        })
    }

    /// Returns the colors of the Gaussians that are drawn at `time` (timestamp units) around a point in capture space,
    /// weighted by their opacity at that time and by their distance, with a standard deviation of `radius` (capture
    /// units).
    pub(super) fn colors(&self, place: DVec3, time: f64, radius: f64) -> Vec<Colored> {
        let (at, now, limit) = (place.as_vec3(), time as f32, (9.0 * radius * radius) as f32);
        let colored = |piece: &Piece| {
            let Piece { gaussian, color, drawn: [first, last] } = piece;
            if !(*first..=*last).contains(&now) {
                return None;
            }
            let distance = gaussian.mean_at(now).distance_squared(at);
            let near = (-0.5 * f64::from(distance) / (radius * radius)).exp();
            let weight = f64::from(gaussian.opacity * gaussian.marginal(now)) * near;
            (distance <= limit).then_some(Colored { color: *color, weight })
        };
        self.pieces.par_iter().filter_map(colored).collect()
    }
}

/// Returns the color of each Gaussian, independent of direction and time, 0 to 1.
fn colors(scene: &GaussianScene) -> Vec<Vec3> {
    let all = |harmonics: &Harmonics| -> Vec<Vec3> {
        (0..scene.len()).map(|index| Vec3::from_slice(harmonics.of(index)) * SH_C0 + 0.5).collect()
    };
    match (&scene.form, scene.form.harmonics()) {
        (SceneForm::Ready(Form::Packed(packed)), _) => all(&packed.clone().unpack().harmonics),
        (_, Some(harmonics)) => all(harmonics),
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{gaussian, scene};
    use super::*;

    #[test]
    fn points_are_on_gaussians_in_their_directions() {
        let disk =
            Gaussian { covariance: [1.0, 0.0, 0.0, 1.0, 0.0, 1e-6], ..gaussian(Vec3::ZERO, 0.5, Vec3::ZERO, 0.1) };
        let cloud = Cloud::of(&scene(vec![disk])).expect("it can be drawn");
        let touches = |place: [f64; 3], time| cloud.touches(DVec3::from(place), time, 0.1);
        assert!(touches([1.5, 0.0, 0.05], 0.5), "on the disk");
        assert!(!touches([0.0, 0.0, 0.3], 0.5), "above it");
        assert!(!touches([1.0, 0.0, 1.0], 0.5), "above it and aside");
        assert!(!touches([2.2, 0.0, 0.0], 0.5), "beside it");
        assert!(!touches([0.0; 3], 0.0), "before it is drawn");
    }
}
