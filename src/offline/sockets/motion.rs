//! The rigid motion that the velocities of neighbors agree on.
//!
//! In: [`Neighbor`]s of a point at a time. Out: the [`Motion`] near that point, found by weighted least squares from
//! which neighbors that move otherwise are left out, and how sure its velocity is.
//!
//! A Gaussian moves in a straight line, tangent to the path of what it shows. Its velocity is therefore taken as that
//! of its mean at its own time, `mean_t`, and the motion is one that also changes with time: then a turn is followed
//! exactly, however long the lives of its Gaussians are.

use glam::{DMat3, DQuat, DVec3};

/// Number of times that neighbors which move otherwise are weighed down.
const ROUNDS: usize = 5;
/// The penalty on turning, as a part of what the spread of the neighbors in space contributes: it decides where they do
/// not, such as about a line of Gaussians.
const TURN_PENALTY: f64 = 1e-4;
/// The penalty on acceleration, as a part of what the spread of the neighbors in time contributes.
const CHANGE_PENALTY: f64 = 1e-3;
/// Largest deviation of a velocity that counts fully, in median deviations.
const USUAL: f64 = 2.0;
/// Smallest deviation that counts as one, as a part of the fastest velocity: the rounding of single precision.
const ROUNDING: f64 = 1e-6;

/// A Gaussian near a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Neighbor {
    /// Its mean at its own time, capture space.
    pub mean: DVec3,
    /// Its own time, timestamp units.
    pub mean_t: f64,
    /// Its velocity, capture units per timestamp unit.
    pub velocity: DVec3,
    /// How long it is there, timestamp units.
    pub life: f64,
    /// Its weight.
    pub weight: f64,
}

impl Neighbor {
    /// Returns its mean at a time, timestamp units.
    pub(super) fn at(&self, time: f64) -> DVec3 {
        self.mean + self.velocity * (time - self.mean_t)
    }
}

/// A rigid motion near a point, whose velocity changes steadily in time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motion {
    /// Where, capture space, and when, timestamp units, `velocity` is that of the motion.
    origin: DVec3,
    time: f64,
    velocity: DVec3,
    /// The angular velocity, radians per timestamp unit.
    pub turn: DVec3,
    /// The change of the velocity, capture units per squared timestamp unit.
    change: DVec3,
}

/// A motion, and how sure it is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fit {
    pub motion: Motion,
    /// The standard error of the velocity, capture units per timestamp unit.
    pub error: f64,
    /// The number of neighbors that agree, as if all had the same weight.
    pub supporters: f64,
    /// How long these are there, timestamp units.
    pub life: f64,
}

impl Motion {
    /// Returns the velocity at a place and a time, capture units per timestamp unit.
    fn velocity_at(&self, place: DVec3, time: f64) -> DVec3 {
        self.velocity + self.turn.cross(place - self.origin) + self.change * (time - self.time)
    }

    /// Returns where a place is after `duration`, with the velocities of the time `middle`: along a screw.
    pub(super) fn moved(&self, place: DVec3, middle: f64, duration: f64) -> DVec3 {
        let velocity = self.velocity_at(place, middle) * duration;
        let turn = self.turn * duration;
        let angle = turn.length();
        let (once, twice) = match angle < 1e-4 {
            true => (0.5, 1.0 / 6.0),
            false => ((1.0 - angle.cos()) / angle.powi(2), (angle - angle.sin()) / angle.powi(3)),
        };
        let across = turn.cross(velocity);
        place + velocity + across * once + turn.cross(across) * twice
    }

    /// Returns the rotation of `duration`.
    pub(super) fn turned(&self, duration: f64) -> DQuat {
        DQuat::from_scaled_axis(self.turn * duration)
    }

    /// Returns by how much the velocity of a neighbor deviates, capture units per timestamp unit.
    fn deviation(&self, neighbor: &Neighbor) -> f64 {
        (neighbor.velocity - self.velocity_at(neighbor.mean, neighbor.mean_t)).length()
    }
}

/// Returns the motion of neighbors of the point `origin` at `time`, at distances of about `radius`; `None` without
/// neighbors. `before` is the motion a moment ago: where two parts meet, the one that goes on with it is followed.
pub(super) fn fit(
    neighbors: &[Neighbor],
    origin: DVec3,
    time: f64,
    radius: f64,
    before: Option<&Motion>,
) -> Option<Fit> {
    let fastest = neighbors.iter().map(|neighbor| neighbor.velocity.length()).fold(0.0, f64::max);
    let least = (fastest * ROUNDING).max(f64::MIN_POSITIVE.sqrt());
    let mut weights: Vec<f64> = neighbors.iter().map(|neighbor| neighbor.weight).collect();
    if let Some(before) = before {
        weights = agreement(neighbors, before, least);
    }
    let mut motion = solve(neighbors, &weights, origin, time, radius)?;
    for _ in 0..ROUNDS {
        weights = agreement(neighbors, &motion, least);
        motion = solve(neighbors, &weights, origin, time, radius)?;
    }
    let sum: f64 = weights.iter().sum();
    let squares: f64 = weights.iter().map(|weight| weight * weight).sum();
    let of_all = |value: &dyn Fn(&Neighbor) -> f64| {
        neighbors.iter().zip(&weights).map(|(neighbor, weight)| weight * value(neighbor)).sum::<f64>() / sum
    };
    let variance = of_all(&|neighbor| motion.deviation(neighbor).powi(2));
    let supporters = sum * sum / squares;
    // The motion itself takes the freedom of three velocities.
    let error = (variance / (supporters - 3.0).max(1.0)).sqrt();
    Some(Fit { motion, error, supporters, life: of_all(&|neighbor| neighbor.life) })
}

/// Returns the weight of each neighbor, lower the more it deviates from a motion.
fn agreement(neighbors: &[Neighbor], motion: &Motion, least: f64) -> Vec<f64> {
    let deviations: Vec<f64> = neighbors.iter().map(|neighbor| motion.deviation(neighbor)).collect();
    let mut sorted: Vec<(f64, f64)> = deviations.iter().copied().zip(neighbors.iter().map(|n| n.weight)).collect();
    sorted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * sorted.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut sum = 0.0;
    let reaches = |(_, weight): &&(f64, f64)| {
        sum += weight;
        sum >= half
    };
    let median = sorted.iter().find(reaches).map_or(0.0, |(deviation, _)| *deviation);
    let usual = (USUAL * median).max(least);
    neighbors
        .iter()
        .zip(deviations)
        .map(|(neighbor, deviation)| neighbor.weight / (1.0 + (deviation / usual).powi(2)))
        .collect()
}

/// Returns the motion of least squares: `velocity = v + turn × (mean − origin) + change (mean_t − time)`. The constant
/// part is eliminated by weighted means, the change by its own equation.
fn solve(neighbors: &[Neighbor], weights: &[f64], origin: DVec3, time: f64, radius: f64) -> Option<Motion> {
    let all = || neighbors.iter().zip(weights);
    let sum: f64 = weights.iter().sum();
    if sum.is_nan() || sum <= 0.0 {
        return None;
    }
    let place = all().map(|(neighbor, weight)| (neighbor.mean - origin) * *weight).sum::<DVec3>() / sum;
    let moment = all().map(|(neighbor, weight)| (neighbor.mean_t - time) * weight).sum::<f64>() / sum;
    let velocity = all().map(|(neighbor, weight)| neighbor.velocity * *weight).sum::<DVec3>() / sum;
    // Sums over neighbors of products of the place d, the time t and the velocity v, each less its mean.
    let (mut dd, mut dv, mut td, mut tv, mut tt) = (DMat3::ZERO, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO, 0.0);
    for (neighbor, &weight) in all() {
        let (d, t) = (neighbor.mean - origin - place, neighbor.mean_t - time - moment);
        let v = neighbor.velocity - velocity;
        dd += (DMat3::IDENTITY * d.length_squared() - outer(d)) * weight;
        dv += d.cross(v) * weight;
        td += d * (t * weight);
        tv += v * (t * weight);
        tt += t * t * weight;
    }
    let spread = tt + CHANGE_PENALTY * (tt + sum * moment * moment);
    let spread = spread.max(f64::MIN_POSITIVE.sqrt());
    let turning = dd + DMat3::IDENTITY * (TURN_PENALTY * sum * (radius * radius).max(f64::MIN_POSITIVE.sqrt()));
    // The part of the turn that a change in time explains.
    let explained = (DMat3::IDENTITY * td.length_squared() - outer(td)) * spread.recip();
    let turn = (turning - explained).inverse() * (dv - td.cross(tv) / spread);
    if !turn.is_finite() {
        return None;
    }
    let change = (tv + td.cross(turn)) / spread;
    Some(Motion { origin, time, velocity: velocity - turn.cross(place) - change * moment, turn, change })
}

/// Returns the product of a column and a row of the same vector.
fn outer(vector: DVec3) -> DMat3 {
    DMat3::from_cols(vector * vector.x, vector * vector.y, vector * vector.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns neighbors of the origin, at times of their own, that move as `velocity` says of a place and a time.
    fn neighbors(count: usize, velocity: impl Fn(DVec3, f64) -> DVec3) -> Vec<Neighbor> {
        let neighbor = |index: usize| {
            let part = |of: f64| (index as f64 * of).sin();
            let (mean, mean_t) = (DVec3::new(part(1.3), part(2.7), part(4.9)), 0.1 * part(7.3));
            Neighbor { mean, mean_t, velocity: velocity(mean, mean_t), life: 0.25, weight: 1.0 }
        };
        (1..=count).map(neighbor).collect()
    }

    #[test]
    fn a_screw_with_acceleration_is_found() {
        let (drift, turn, change) =
            (DVec3::new(0.5, -1.0, 0.25), DVec3::new(0.0, 2.0, 3.0), DVec3::new(-3.0, 0.0, 1.0));
        let found = neighbors(40, |place, time| drift + turn.cross(place) + change * time);
        let Fit { motion, error, supporters, .. } = fit(&found, DVec3::X, 0.5, 1.0, None).expect("there are neighbors");
        assert!(motion.turn.abs_diff_eq(turn, 2e-2), "the turn is {}", motion.turn);
        let velocity = motion.velocity_at(DVec3::X, 0.0);
        assert!(velocity.abs_diff_eq(drift + turn.cross(DVec3::X), 2e-2), "the velocity is {velocity}");
        assert!(error < 1e-2 && supporters > 20.0, "most agree: {supporters}, within {error}");
    }

    #[test]
    fn neighbors_of_another_part_are_left_out() {
        let mut found = neighbors(40, |_, _| DVec3::Y);
        found.iter_mut().step_by(4).for_each(|neighbor| neighbor.velocity = DVec3::new(9.0, 0.0, 0.0));
        let motion = fit(&found, DVec3::ZERO, 0.0, 1.0, None).expect("there are neighbors").motion;
        let velocity = motion.velocity_at(DVec3::ZERO, 0.0);
        assert!(velocity.abs_diff_eq(DVec3::Y, 2e-2), "the velocity is {velocity}");
    }

    #[test]
    fn the_part_that_was_followed_is_followed_on() {
        let before = fit(&neighbors(40, |_, _| DVec3::Y), DVec3::ZERO, 0.0, 1.0, None).expect("neighbors").motion;
        let mut found = neighbors(50, |_, _| DVec3::X);
        found.iter_mut().step_by(2).for_each(|neighbor| neighbor.velocity = DVec3::Y);
        let motion = fit(&found, DVec3::ZERO, 0.0, 1.0, Some(&before)).expect("there are neighbors").motion;
        let velocity = motion.velocity_at(DVec3::ZERO, 0.0);
        assert!(velocity.abs_diff_eq(DVec3::Y, 5e-2), "the velocity is {velocity}");
    }

    #[test]
    fn gaussians_at_rest_and_on_a_line_do_not_turn() {
        let mut found = neighbors(20, |_, _| DVec3::ZERO);
        let still = fit(&found, DVec3::ONE, 3.0, 1.0, None).expect("there are neighbors");
        assert_eq!((still.motion.turn, still.error), (DVec3::ZERO, 0.0), "nothing moves");
        for neighbor in &mut found {
            *neighbor = Neighbor { mean: DVec3::X * neighbor.mean.x, mean_t: 0.0, velocity: DVec3::Z, ..*neighbor };
        }
        let line = fit(&found, DVec3::ZERO, 0.5, 1.0, None).expect("there are neighbors").motion;
        assert!(line.turn.length() < 1e-9, "a line that moves as a whole does not turn, but by {}", line.turn);
        let moved = line.moved(DVec3::ZERO, 0.5, 0.5);
        assert!(moved.abs_diff_eq(DVec3::Z * 0.5, 1e-9), "it moves to {moved}");
        assert!(fit(&[], DVec3::ZERO, 0.0, 1.0, None).is_none(), "no neighbors have no motion");
    }

    #[test]
    fn a_turn_about_a_point_is_exact() {
        let motion =
            Motion { origin: DVec3::ZERO, time: 0.0, velocity: DVec3::ZERO, turn: DVec3::Z, change: DVec3::ZERO };
        let quarter = std::f64::consts::FRAC_PI_2;
        let moved = motion.moved(DVec3::X, 0.0, quarter);
        assert!(moved.abs_diff_eq(DVec3::Y, 1e-12), "a quarter of a turn leads to {moved}");
        assert!((motion.turned(quarter) * DVec3::X).abs_diff_eq(DVec3::Y, 1e-12), "and turns the frame as well");
    }
}
