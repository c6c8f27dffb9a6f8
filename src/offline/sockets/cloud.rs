//! The Gaussians of a capture that can be followed.
//!
//! In: a capture, with its temporal filter; a time, a box or a point with a radius. Out: the Gaussians that are drawn
//! in the box at the time ([`Drawn`]); whether the point is on one of them; the colors around it.

use super::error::SocketError;
use super::look::Colored;
use super::moment::{Drawn, is_inside};
use crate::codec::import::columns::SH_C0;
use crate::gaussian::{Gaussian, Harmonics, lifespan_reach};
use crate::scene::{Bounds, Form, GaussianScene, SceneForm, TrainedWith};
use glam::{DVec3, Mat3, Vec3};
use rayon::prelude::*;

/// Smallest opacity at the time at which a Gaussian counts: fainter ones are haze or the remains of pruning.
const FAINTEST: f32 = 0.02;

/// Standard deviations up to which a Gaussian is seen.
const SEEN: f32 = 2.0;

/// The Gaussians of a capture that can be followed.
pub(super) struct Cloud {
    pieces: Vec<Piece>,
    /// The diagonal of the middle of the capture, capture units.
    pub size: f64,
    /// The first and the last time, timestamp units.
    pub interval: [f64; 2],
}

/// A Gaussian, and the times between which it is drawn.
struct Piece {
    gaussian: Gaussian,
    /// Its color, independent of direction and time, 0 to 1.
    color: Vec3,
    /// Timestamp units.
    drawn: [f64; 2],
}

impl Cloud {
    /// Returns the Gaussians of a scene.
    ///
    /// # Errors
    /// Parts of the scene that do not fit together; the first Gaussian that cannot be drawn, of a scene in the trained
    /// form. Of other forms such Gaussians are left out.
    pub(super) fn of(scene: &GaussianScene) -> Result<Self, SocketError> {
        scene.check().map_err(SocketError::Scene)?;
        let TrainedWith { time_interval, marginal_cutoff, .. } = scene.trained_with;
        let (gaussians, colors) = (scene.gaussians()?, colors(scene));
        let reach = lifespan_reach(marginal_cutoff);
        let piece = |(index, gaussian): (usize, &Gaussian)| {
            let (mean, half) = (f64::from(gaussian.mean_t), reach * f64::from(gaussian.sigma_t));
            let [first, last] = match &scene.filter {
                Some(filter) => filter.window(index, time_interval),
                None => [f64::NEG_INFINITY, f64::INFINITY],
            };
            let drawn = [first.max(mean - half), last.min(mean + half)];
            let color = colors.get(index).filter(|color| color.is_finite())?.clamp(Vec3::ZERO, Vec3::ONE);
            let is_followed = gaussian.opacity > FAINTEST && gaussian.check().is_ok();
            is_followed.then_some(Piece { gaussian: *gaussian, color, drawn })
        };
        let pieces: Vec<Piece> = gaussians.iter().enumerate().filter_map(piece).collect();
        let core = Bounds::core(pieces.iter().map(|piece| piece.gaussian));
        let size = core.map_or(0.0, |core| 2.0 * f64::from(core.radius()));
        Ok(Self { pieces, size, interval: time_interval.map(f64::from) })
    }

    /// Returns the length of the time interval, timestamp units.
    pub(super) fn span(&self) -> f64 {
        self.interval[1] - self.interval[0]
    }

    /// Returns the Gaussians that are drawn at `time` (timestamp units), of those whose means are in a box (capture
    /// space) if there is one.
    pub(super) fn drawn(&self, time: f64, bounds: Option<[DVec3; 2]>) -> Vec<Drawn> {
        let now = time as f32;
        let drawn = |piece: &Piece| {
            let Piece { gaussian, color, .. } = piece;
            let (mean, opacity) = (gaussian.mean_at(now).as_dvec3(), piece.opacity_at(now)?);
            let is_in_box = bounds.is_none_or(|bounds| is_inside(mean, bounds));
            (opacity > FAINTEST && mean.is_finite() && is_in_box).then(|| {
                let covariance = matrix(gaussian, 0.0).as_dmat3();
                let velocity = Vec3::from(gaussian.velocity).as_dvec3();
                let duration = f64::from(gaussian.sigma_t).min(self.span());
                Drawn { mean, opacity: opacity.into(), covariance, color: *color, velocity, duration }
            })
        };
        self.pieces.par_iter().filter_map(drawn).collect()
    }

    /// Returns whether a point in capture space is on a Gaussian that is drawn at `time` (timestamp units), or about
    /// `distance` (capture units) beside it: within [`SEEN`] standard deviations of the Gaussian, widened by that.
    pub(super) fn touches(&self, place: DVec3, time: f64, distance: f64) -> bool {
        let (at, now) = (place.as_vec3(), time as f32);
        let wider = (distance as f32 / SEEN).powi(2);
        self.pieces.par_iter().any(|piece| {
            let is_drawn = piece.opacity_at(now).is_some_and(|opacity| opacity > FAINTEST);
            let offset = piece.gaussian.mean_at(now) - at;
            is_drawn && offset.dot(matrix(&piece.gaussian, wider).inverse() * offset) <= SEEN * SEEN
        })
    }

    /// Returns the colors of the Gaussians that are drawn at `time` (timestamp units) around a point in capture space,
    /// weighted by their opacity at that time and by their distance, with a standard deviation of `radius` (capture
    /// units).
    pub(super) fn colors(&self, place: DVec3, time: f64, radius: f64) -> Vec<Colored> {
        let (at, now, limit) = (place.as_vec3(), time as f32, (9.0 * radius * radius) as f32);
        let colored = |piece: &Piece| {
            let opacity = f64::from(piece.opacity_at(now)?);
            let distance = piece.gaussian.mean_at(now).distance_squared(at);
            let near = (-0.5 * f64::from(distance) / (radius * radius)).exp();
            (distance <= limit).then_some(Colored { color: piece.color, weight: opacity * near })
        };
        self.pieces.par_iter().filter_map(colored).collect()
    }
}

impl Piece {
    /// Returns its opacity at a time (timestamp units), 0 to 1; `None` where it is not drawn.
    fn opacity_at(&self, now: f32) -> Option<f32> {
        let Self { gaussian, drawn: [first, last], .. } = self;
        (*first..=*last).contains(&f64::from(now)).then(|| gaussian.opacity * gaussian.marginal(now))
    }
}

/// Returns the covariance of a Gaussian, wider by this variance in all directions.
fn matrix(gaussian: &Gaussian, wider: f32) -> Mat3 {
    let [xx, xy, xz, yy, yz, zz] = gaussian.covariance;
    Mat3::from_cols_array_2d(&[[xx + wider, xy, xz], [xy, yy + wider, yz], [xz, yz, zz + wider]])
}

/// Returns the color of each Gaussian, independent of direction and time, mostly 0 to 1.
fn colors(scene: &GaussianScene) -> Vec<Vec3> {
    let all = |harmonics: &Harmonics| -> Vec<Vec3> {
        (0..scene.len()).map(|index| Vec3::from_slice(harmonics.of(index)) * SH_C0 + 0.5).collect()
    };
    match &scene.form {
        SceneForm::Trained(trained) => all(&trained.harmonics),
        SceneForm::Ready(Form::Sliced(sliced)) => all(&sliced.harmonics),
        SceneForm::Ready(Form::Packed(packed)) => all(&packed.clone().unpack().harmonics),
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
