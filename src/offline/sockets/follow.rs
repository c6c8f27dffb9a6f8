//! Following a point through the motions of a capture.
//!
//! In: a capture, a [`Placement`]. Out: the track of its socket over the time of the capture ([`Followed`]): steps
//! along the motion of the Gaussians around it, forward and backward from the time at which it was placed. Gaussians whose
//! lives end are replaced by those that are alive at each step. From both ends of the track the way back is followed,
//! too: how far it ends from the start is reported.

use super::error::SocketError;
use super::look::Look;
use super::motion::{Fit, Motion, fit};
use super::neighbors::{Cloud, Near};
use crate::offline::work::{Progress, proceed};
use crate::scene::{GaussianScene, Socket, SocketSample};
use glam::{DQuat, DVec3, Quat, Vec3};

/// Fewest neighbors that are followed.
const FEWEST: usize = 4;
/// Fewest neighbors that agree, as if all had the same weight.
const SUPPORT: f64 = 3.0;
/// Smallest and largest distance within which neighbors are, as parts of the size of the capture.
const REACH: [f64; 2] = [0.02, 0.1];
/// Largest distance from a point to what it is placed on, as a part of the size of the capture, unless that is around it.
const NEAREST: f64 = 0.01;
/// Length of the mean direction to the neighbors from which on they are on one side of a point: in the bundled island
/// 0.9 and more for points in the air, 0.8 and less on surfaces.
const ONE_SIDE: f64 = 0.85;
/// Factor by which neighbors may be farther away than at the start, where the capture becomes thin.
const THINNER: f64 = 2.0;
/// Largest estimate of the error, as a part of the size of the capture: beyond, the point is lost.
const LARGEST_ERROR: f64 = 0.1;
/// Smallest part of the colors at the start that are still around the point.
const LEAST_SHARE: f64 = 0.3;
/// Smallest distance within which colors are looked at, as a part of the size of the capture.
const LOOK: f64 = 0.01;
/// Smallest number of steps over the time interval.
const STEPS: f64 = 256.0;

/// Where and when a socket is placed, and how finely its track is sampled.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// The name of the socket.
    pub name: String,
    /// The position, capture space: on or in the part that is followed.
    pub position: [f32; 3],
    /// The time at which the position is meant, timestamp units.
    pub time: f32,
    /// Number of samples over the time interval, 2 to 65,535, evenly spaced. The time of the placement is another.
    pub samples: usize,
}

/// A socket that has been followed. Pairs are before and after the time at which it was placed.
#[derive(Debug, Clone, PartialEq)]
pub struct Followed {
    /// The socket, with its track.
    pub socket: Socket,
    /// The times before and after which it is lost, timestamp units; `None` if it was followed to the end of the time
    /// interval.
    pub lost: [Option<f32>; 2],
    /// The distances from the place of the start at which the ways back from the ends of the track arrive, capture
    /// units; `None` if there is no such way, or it is lost.
    pub returns: [Option<f32>; 2],
    /// The size of the capture, the diagonal of its middle, capture units: the measure of all distances.
    pub size: f32,
}

/// Follows a point over the whole time of a capture. Begins the task "following".
///
/// # Errors
/// A placement that no socket can have, a time outside the time interval, a place without visible Gaussians, a sequence
/// of stills, a Gaussian that cannot be drawn, an interruption.
pub fn follow(
    scene: &GaussianScene,
    placement: &Placement,
    progress: &mut dyn Progress,
) -> Result<Followed, SocketError> {
    follow_within(&Cloud::of(scene)?, scene.trained_with.time_interval, placement, progress)
}

/// As [`follow`], from the first to the last time of an interval, timestamp units, over which the samples are spread.
///
/// # Errors
/// As [`follow`].
pub(super) fn follow_within(
    cloud: &Cloud,
    [first, last]: [f32; 2],
    placement: &Placement,
    progress: &mut dyn Progress,
) -> Result<Followed, SocketError> {
    let Placement { name, position, time, samples } = placement.clone();
    let start = SocketSample { time, position, rotation: Quat::IDENTITY.to_array(), error: 0.0 };
    let mut socket = Socket { name, samples: vec![start] };
    socket.check().map_err(SocketError::Invalid)?;
    if !(2..Socket::MOST_SAMPLES).contains(&samples) {
        return Err(SocketError::Invalid("a number of samples of a socket that is not from 2 to 65535"));
    }
    if !(first..=last).contains(&time) {
        return Err(SocketError::Outside { time, first, last });
    }
    if cloud.is_still {
        return Err(SocketError::Still);
    }
    let follower = Follower::placed(cloud, &start)?;
    let moments = moments([first, last], time, samples);
    // Each way is gone back.
    progress.begin("following", 2 * moments.iter().map(Vec::len).sum::<usize>());
    let (mut lost, mut returns, mut tracks) = ([None; 2], [None; 2], [Vec::new(), Vec::new()]);
    for (way, times) in moments.iter().enumerate() {
        let track = follower.track(&start, times, progress)?;
        lost[way] = (track.len() < times.len()).then(|| track.last().unwrap_or(&start).time);
        returns[way] = follower.returned(&start, &track, progress)?;
        tracks[way] = track;
    }
    progress.finish();
    let [before, after] = tracks;
    socket.samples = before.into_iter().rev().chain([start]).chain(after).collect();
    Ok(Followed { socket, lost, returns, size: cloud.size as f32 })
}

/// Returns the times of the samples before a time, the latest first, and after it.
fn moments([first, last]: [f32; 2], time: f32, samples: usize) -> [Vec<f32>; 2] {
    let step = (f64::from(last) - f64::from(first)) / (samples - 1) as f64;
    let moment = |index: usize| match index + 1 == samples {
        true => last,
        false => (f64::from(first) + step * index as f64) as f32,
    };
    let all = || (0..samples).map(moment);
    let mut before: Vec<f32> = all().filter(|&moment| moment < time).collect();
    let mut after: Vec<f32> = all().filter(|&moment| moment > time).collect();
    // Times that are far from zero have few digits.
    before.dedup();
    after.dedup();
    before.reverse();
    [before, after]
}

/// What is followed through.
struct Follower<'a> {
    cloud: &'a Cloud,
    /// The distance within which neighbors are, capture units.
    reach: f64,
    /// What the point looked like when it was placed.
    look: Look,
}

/// A point on its way.
#[derive(Clone, Copy)]
struct State {
    place: DVec3,
    rotation: DQuat,
    /// Timestamp units.
    time: f64,
    /// The motion of the step before.
    motion: Option<Motion>,
    /// The variance of the place, squared capture units.
    variance: f64,
    /// The time since the start, timestamp units.
    elapsed: f64,
}

impl<'a> Follower<'a> {
    /// Returns the follower of a point.
    ///
    /// # Errors
    /// It is in the air, or too few that agree are near it.
    fn placed(cloud: &'a Cloud, start: &SocketSample) -> Result<Self, SocketError> {
        let [least, most] = REACH.map(|part| part * cloud.size);
        let (place, time) = (Vec3::from(start.position).as_dvec3(), f64::from(start.time));
        let Near { neighbors, radius } = cloud.near(place, time, most);
        let sum: f64 = neighbors.iter().map(|neighbor| neighbor.weight).sum();
        let towards = neighbors.iter().map(|one| (one.at(time) - place).normalize_or_zero() * one.weight);
        let (nearest, is_beside) = (NEAREST * cloud.size, towards.sum::<DVec3>().length() > ONE_SIDE * sum);
        if is_beside && !cloud.touches(place, time, nearest) {
            return Err(SocketError::NothingThere { distance: nearest as f32, time: start.time });
        }
        let squares = neighbors.iter().map(|neighbor| neighbor.weight * neighbor.at(time).distance_squared(place));
        let around = (squares.sum::<f64>() / sum).sqrt().max(LOOK * cloud.size);
        let look = Look::of(cloud.colors(place, time, around), around);
        let follower = Self { cloud, reach: (THINNER * radius).clamp(least, most), look };
        match follower.motion(place, time, None) {
            Some(_) => Ok(follower),
            None => Err(SocketError::NothingThere { distance: most as f32, time: start.time }),
        }
    }

    /// Returns the frames at these times, one after the other, until the point is lost. Advances the task.
    fn track(
        &self,
        start: &SocketSample,
        times: &[f32],
        progress: &mut dyn Progress,
    ) -> Result<Vec<SocketSample>, SocketError> {
        let mut samples = Vec::with_capacity(times.len());
        let mut state = State {
            place: Vec3::from(start.position).as_dvec3(),
            rotation: DQuat::IDENTITY,
            time: start.time.into(),
            motion: None,
            variance: 0.0,
            elapsed: 0.0,
        };
        for &time in times {
            proceed(progress)?;
            let Some(next) = self.at(state, time.into()).filter(|next| self.is_there(next)) else { break };
            state = next;
            samples.push(state.sample(time));
            progress.advance();
        }
        Ok(samples)
    }

    /// Returns how far from the start the way back along a track arrives, capture units; `None` for a track without
    /// samples, and for a way on which the point is lost.
    fn returned(
        &self,
        start: &SocketSample,
        track: &[SocketSample],
        progress: &mut dyn Progress,
    ) -> Result<Option<f32>, SocketError> {
        let Some((end, rest)) = track.split_last() else { return Ok(None) };
        let times: Vec<f32> = rest.iter().rev().chain([start]).map(|sample| sample.time).collect();
        let back = self.track(end, &times, progress)?;
        let arrived = back.last().filter(|sample| sample.time == start.time);
        Ok(arrived.map(|sample| Vec3::from(sample.position).distance(start.position.into())))
    }

    /// Returns whether what the point was placed on is still around it.
    fn is_there(&self, state: &State) -> bool {
        let Self { cloud, look, .. } = self;
        look.share(&cloud.colors(state.place, state.time, look.radius)) >= LEAST_SHARE
    }

    /// Returns the point at another time; `None` if it is lost before.
    fn at(&self, mut state: State, time: f64) -> Option<State> {
        let way = time - state.time;
        let steps = (way.abs() / self.cloud.span * STEPS).ceil().max(1.0);
        for _ in 0..steps as usize {
            state = self.step(&state, way / steps)?;
        }
        Some(State { time, ..state })
    }

    /// Returns the point after a step: along the motion in the middle of the step.
    fn step(&self, state: &State, duration: f64) -> Option<State> {
        let State { place, time, .. } = *state;
        let begin = self.motion(place, time, state.motion.as_ref())?.motion;
        let middle = time + 0.5 * duration;
        let halfway = begin.moved(place, time + 0.25 * duration, 0.5 * duration);
        let Fit { motion, error, life, .. } = self.motion(halfway, middle, Some(&begin))?;
        let length = duration.abs();
        // The velocities of Gaussians are wrong for as long as they live: errors add up within lives, and as random
        // steps beyond.
        let memory = life.min(state.elapsed + 0.5 * length);
        let variance = state.variance + 2.0 * error * error * memory * length;
        (variance.sqrt() <= LARGEST_ERROR * self.cloud.size).then(|| State {
            place: motion.moved(place, middle, duration),
            rotation: (motion.turned(duration) * state.rotation).normalize(),
            time: time + duration,
            motion: Some(motion),
            variance,
            elapsed: state.elapsed + length,
        })
    }

    /// Returns the motion at a place and a time; `None` if too few neighbors agree.
    fn motion(&self, place: DVec3, time: f64, before: Option<&Motion>) -> Option<Fit> {
        let Near { neighbors, radius } = self.cloud.near(place, time, self.reach);
        if neighbors.len() < FEWEST {
            return None;
        }
        fit(&neighbors, place, time, radius, before).filter(|fit| fit.supporters >= SUPPORT)
    }
}

impl State {
    fn sample(&self, time: f32) -> SocketSample {
        SocketSample {
            time,
            position: self.place.as_vec3().to_array(),
            rotation: self.rotation.as_quat().normalize().to_array(),
            error: self.variance.sqrt() as f32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{TURN, body, gaussian, place, scene};
    use super::*;
    use crate::gaussian::{Gaussian, Harmonics};
    use crate::offline::work::NoProgress;
    use crate::offline::work::progress::InterruptedProgress;
    use crate::scene::RuntimeScene;
    use crate::scene::random::Random;

    fn placement(point: DVec3, time: f32, samples: usize) -> Placement {
        let position = place(point, time.into()).as_vec3().to_array();
        Placement { name: "hand".into(), position, time, samples }
    }

    fn followed(scene: &GaussianScene, placement: &Placement) -> Result<Followed, SocketError> {
        follow(scene, placement, &mut NoProgress)
    }

    #[test]
    fn a_point_of_a_body_is_followed_over_the_clip_within_a_hundredth_of_its_size() {
        let point = DVec3::new(0.3, 0.25, -0.1);
        let Followed { socket, lost, returns, size } =
            followed(&body(f64::INFINITY), &placement(point, 0.4, 61)).expect("it is there");
        assert_eq!((lost, socket.reach()), ([None; 2], Some([0.0, 1.0])), "followed from end to end");
        assert_eq!(socket.check(), Ok(()), "the socket can be stored");
        for sample in &socket.samples {
            let (time, found) = (f64::from(sample.time), Vec3::from(sample.position).as_dvec3());
            let off = found.distance(place(point, time)) / f64::from(size);
            assert!(off < 0.01, "at {time} it is {off} of the size off");
            let turned = DQuat::from_scaled_axis(TURN * (time - f64::from(0.4f32))).as_quat();
            let angle = turned.angle_between(Quat::from_array(sample.rotation));
            assert!(angle < 0.03, "at {time} the frame is {angle} off");
            assert!(f64::from(sample.error) < 0.01 * f64::from(size), "at {time} the estimate is {}", sample.error);
        }
        for way in returns {
            let off = way.expect("the way back arrives") / size;
            assert!(off < 0.01, "forward and backward differ by {off} of the size");
        }
    }

    #[test]
    fn a_point_is_lost_where_its_part_ends_and_the_time_is_told() {
        let found = followed(&body(0.5), &placement(DVec3::ZERO, 0.2, 41)).expect("it is there");
        let end = found.lost[1].expect("nothing is there later");
        assert!((0.4..0.75).contains(&end), "the last Gaussians end soon after 0.5, it is lost at {end}");
        assert_eq!((found.lost[0], found.socket.reach()), (None, Some([0.0, end])), "the track ends there");
    }

    #[test]
    fn what_stands_is_followed_without_error() {
        let mut random = Random::new(3);
        let mut still = || Vec3::from([(); 3].map(|()| random.in_range(-1.0, 1.0)));
        let means = std::iter::once(Vec3::ZERO).chain((0..900).map(|_| still()));
        let gaussians = means.map(|mean| gaussian(mean, 0.0, Vec3::ZERO, f32::INFINITY));
        let found = followed(&scene(gaussians.collect()), &placement(DVec3::ZERO, 0.0, 11)).expect("it is there");
        assert_eq!((found.lost, found.returns), ([None; 2], [None, Some(0.0)]), "to the end of the interval and back");
        let at_rest = |sample: &SocketSample| (sample.position, sample.error) == ([0.0; 3], 0.0);
        assert!(found.socket.samples.iter().all(at_rest), "it does not move: {:?}", found.socket);
    }

    #[test]
    fn a_part_that_jumps_between_gaussians_at_rest_is_lost_at_once() {
        let mut random = Random::new(5);
        let mut within = |size: f32| Vec3::from([(); 3].map(|()| random.in_range(-size, size)));
        let mut gaussians: Vec<Gaussian> =
            (0..900).map(|_| gaussian(within(1.0), 0.5, Vec3::splat(1e-3), f32::INFINITY)).collect();
        let room = gaussians.len();
        for moment in 0..20 {
            let (time, place) = (moment as f32 / 19.0, Vec3::X * (0.2 * moment as f32 - 1.0));
            let ball = (0..40).map(|_| gaussian(place + within(0.06), time, Vec3::splat(1e-3), 0.018));
            gaussians.extend(ball);
        }
        let yellow = |index: usize| if index < room { [0.0; 3] } else { [1.5, 1.2, -1.0] };
        let values: Vec<f32> = (0..gaussians.len()).flat_map(yellow).collect();
        let harmonics = Harmonics { coefficients: 1, values, ..Harmonics::default() };
        let jumps = GaussianScene::from(RuntimeScene::sliced(gaussians, harmonics));
        let position = (Vec3::X * -1.0).to_array();
        let placement = Placement { name: "ball".into(), position, time: 0.0, samples: 61 };
        let found = followed(&jumps, &placement).expect("it is there");
        let lost = found.lost[1].expect("the ball goes away, and its Gaussians do not move");
        assert!(lost < 0.1, "lost before the second jump, and not after {lost}");
    }

    #[test]
    fn placements_that_cannot_be_followed_are_refused() {
        let body = body(0.5);
        let good = placement(DVec3::ZERO, 0.2, 5);
        let refusal = |placement: Placement| followed(&body, &placement).expect_err("must be refused");
        let far = refusal(Placement { position: [9.0, 0.0, 0.0], ..good.clone() });
        assert!(matches!(far, SocketError::NothingThere { .. }), "far from everything: {far}");
        let beside = place(DVec3::ZERO, 0.2) + 0.75 * DVec3::X;
        let beside = refusal(Placement { position: beside.as_vec3().to_array(), ..good.clone() });
        assert!(matches!(beside, SocketError::NothingThere { .. }), "beside the body, whose radius is 0.5: {beside}");
        let late = refusal(placement(DVec3::ZERO, 0.95, 5));
        assert!(matches!(late, SocketError::NothingThere { .. }), "after the end of everything: {late}");
        let outside = refusal(Placement { time: 1.5, ..good.clone() });
        assert!(matches!(outside, SocketError::Outside { .. }), "outside the interval: {outside}");
        for bad in [
            Placement { name: " ".into(), ..good.clone() },
            Placement { samples: 1, ..good.clone() },
            Placement { position: [f32::NAN; 3], ..good.clone() },
        ] {
            assert!(matches!(refusal(bad.clone()), SocketError::Invalid(_)), "{bad:?} is no socket");
        }
        let stopped = follow(&body, &good, &mut InterruptedProgress).expect_err("it is interrupted");
        assert!(matches!(stopped, SocketError::Interrupted(_)), "interrupted: {stopped}");
        let frames = scene((0..50).map(|time| gaussian(Vec3::ZERO, time as f32 / 50.0, Vec3::ZERO, 0.02)).collect());
        let stills = followed(&frames, &good).expect_err("must be refused");
        assert!(matches!(stills, SocketError::Still), "stills do not move: {stills}");
    }
}
