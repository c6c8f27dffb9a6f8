//! Following a point through a capture.
//!
//! In: a capture, a [`Placement`]. Out: the track of its socket over the time of the capture ([`Followed`]): the small
//! thing that it is on, or the shape around it, is moved step by step, forward and backward from the time at which it
//! was placed, and the point with it. From both ends of the track the way back is followed, with what is there: how far
//! it ends from the start is reported.

use super::cloud::Cloud;
use super::error::SocketError;
use super::look::Look;
use super::moment::Moment;
use super::part::Part;
use super::shape::{SOLID, Shape};
use super::small::Small;
use crate::offline::work::{Progress, proceed};
use crate::scene::{GaussianScene, Socket, SocketSample};
use glam::{DQuat, DVec3, Quat, Vec3};

/// Number of Gaussians around a point that tell whether it is in the air.
const AROUND: usize = 48;
/// Largest distance of Gaussians from a point that is on them, as a part of the size of the capture.
const FARTHEST: f64 = 0.1;
/// Fewest Gaussians within that distance that are solid.
const FEWEST: usize = 4;
/// Largest distance from a point to what it is placed on, as a part of the size of the capture, unless that is around
/// it.
const NEAREST: f64 = 0.01;
/// Length of the mean direction to the Gaussians from which on they are on one side of a point: in the bundled island
/// 0.9 and more for points in the air, 0.8 and less on surfaces.
const ONE_SIDE: f64 = 0.85;
/// Largest estimate of the error, as a part of the size of the capture: beyond, the point is lost.
const LARGEST_ERROR: f64 = 0.1;
/// Smallest part of the colors at the start that are still around the point: about half of the least of eight points of
/// the streamers and lanterns of the film of the island.
const LEAST_SHARE: f64 = 0.25;
/// Smallest distance within which colors are looked at, as a part of the size of the capture.
const LOOK: f64 = 0.01;
/// Number of steps over the time interval, and how often each may be halved where the shape does not move as expected.
const STEPS: f64 = 64.0;
const HALVINGS: usize = 4;

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
/// A placement that no socket can have, a time outside the time interval, a place without visible Gaussians, a
/// Gaussian that cannot be drawn, an interruption.
pub fn follow(
    scene: &GaussianScene,
    placement: &Placement,
    progress: &mut dyn Progress,
) -> Result<Followed, SocketError> {
    follow_within(&Cloud::of(scene)?, scene.trained_with.time_interval, placement, progress)
}

/// Checks the number of samples of a track.
///
/// # Errors
/// It is not from 2 to 65,535.
pub(super) fn check_samples(samples: usize) -> Result<(), SocketError> {
    match (2..Socket::MOST_SAMPLES).contains(&samples) {
        true => Ok(()),
        false => Err(SocketError::Invalid("a number of samples of a socket that is not from 2 to 65535")),
    }
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
    check_samples(samples)?;
    if !(first..=last).contains(&time) {
        return Err(SocketError::Outside { time, first, last });
    }
    let (follower, part) = Follower::placed(cloud, &start)?;
    let times = moments([first, last], time, samples);
    let begin = Step { time: time.into(), place: place_of(&start), rotation: DQuat::IDENTITY, error: 0.0 };
    let ends = [first, last].map(f64::from);
    // Each way is gone back.
    progress.begin("following", 2 * ends.iter().map(|end| follower.steps(begin.time, *end)).sum::<usize>());
    let (mut lost, mut returns, mut tracks) = ([None; 2], [None; 2], [Vec::new(), Vec::new()]);
    for side in [0, 1] {
        let walked = follower.walk(Some(part.clone()), begin, ends[side], progress)?;
        let mut track = sampled(&walked, &times[side]);
        let end = walked.last().copied().filter(|end| end.time != begin.time);
        if track.len() < times[side].len() {
            let before = track.last().map_or(time, |sample| sample.time);
            // The last step is the end of the track.
            track.extend(end.filter(|end| end.time as f32 != before).map(|end| end.sample(end.time as f32)));
            lost[side] = Some(track.last().map_or(time, |sample| sample.time));
        }
        tracks[side] = track;
        let end = end.unwrap_or(begin);
        let there = if end.time == begin.time { None } else { part.again(cloud, end.place, end.time) };
        let back = follower.walk(there, end, begin.time, progress)?;
        let arrived = back.last().filter(|step| end.time != begin.time && step.time == begin.time);
        returns[side] = arrived.map(|step| step.place.distance(begin.place) as f32);
        skip(follower.steps(begin.time, ends[side]) - follower.steps(begin.time, end.time), progress);
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
    /// What the point looked like when it was placed; `None` of a small thing, which is lost where its Gaussians end.
    look: Option<Look>,
}

/// Where the point is at a time.
#[derive(Clone, Copy)]
struct Step {
    /// Timestamp units.
    time: f64,
    place: DVec3,
    rotation: DQuat,
    /// Capture units.
    error: f64,
}

impl<'a> Follower<'a> {
    /// Returns the follower of a point, and what it is on.
    ///
    /// # Errors
    /// It is in the air, or too few Gaussians are near it.
    fn placed(cloud: &'a Cloud, start: &SocketSample) -> Result<(Self, Part<'a>), SocketError> {
        let (place, time) = (place_of(start), f64::from(start.time));
        if let Some(small) = Small::around(cloud, place, time) {
            return Ok((Self { cloud, look: None }, Part::Small(small)));
        }
        let reach = FARTHEST * cloud.size;
        let nothing = |distance: f64| SocketError::NothingThere { distance: distance as f32, time: start.time };
        let moment = Moment::of(cloud.drawn(time, Some([place - reach, place + reach])));
        let near = || moment.nearest(place).take_while(|(_, square)| *square <= reach * reach);
        let is_solid = |(index, _): &(usize, f64)| moment.all[*index].opacity > SOLID;
        if cloud.size <= 0.0 || near().filter(is_solid).take(FEWEST).count() < FEWEST {
            return Err(nothing(reach));
        }
        let near: Vec<(usize, f64)> = near().take(AROUND).collect();
        let spread = 0.25 * near.last().map_or(0.0, |(_, square)| square.max(f64::MIN_POSITIVE.sqrt()));
        let (mut sum, mut towards, mut squares) = (0.0, DVec3::ZERO, 0.0);
        for &(index, square) in &near {
            let weight = moment.all[index].opacity * (-0.5 * square / spread).exp();
            sum += weight;
            towards += (moment.all[index].mean - place).normalize_or_zero() * weight;
            squares += square * weight;
        }
        let nearest = NEAREST * cloud.size;
        if towards.length() > ONE_SIDE * sum && !cloud.touches(place, time, nearest) {
            return Err(nothing(nearest));
        }
        let around = (squares / sum).sqrt().max(LOOK * cloud.size);
        let look = Look::of(cloud.colors(place, time, around), around);
        let shape = Shape::around(cloud, place, time).ok_or_else(|| nothing(reach))?;
        Ok((Self { cloud, look: Some(look) }, Part::Shape(shape)))
    }

    /// Returns the steps of a part from a place and a time to another time, or to the last one before the point is
    /// lost; the start alone without a part. Advances the task by [`steps`](Self::steps).
    fn walk(
        &self,
        part: Option<Part<'_>>,
        start: Step,
        end: f64,
        progress: &mut dyn Progress,
    ) -> Result<Vec<Step>, SocketError> {
        let (count, duration) = (self.steps(start.time, end), end - start.time);
        let mut walked = vec![start];
        let Some(mut part) = part else {
            skip(count, progress);
            return Ok(walked);
        };
        for step in 1..=count {
            let time = if step == count { end } else { start.time + duration * step as f64 / count as f64 };
            // The next is the last of these, each with the number of times that it may still be halved.
            let mut targets = vec![(time, HALVINGS)];
            while let Some((time, halvings)) = targets.pop() {
                proceed(progress)?;
                let before = walked.last().map_or(start.time, |step| step.time);
                if part.advance(time, halvings == 0) {
                    let rotation = (part.rotation() * start.rotation).normalize();
                    walked.push(Step { time, place: part.place(), rotation, error: part.error() });
                } else if let Some(halvings) = halvings.checked_sub(1) {
                    targets.extend([(time, halvings), (0.5 * (before + time), halvings)]);
                    continue;
                } else {
                    skip(count + 1 - step, progress);
                    return Ok(walked);
                }
                if !part.is_held() || !walked.last().is_some_and(|step| self.is_there(step)) {
                    walked.pop();
                    skip(count + 1 - step, progress);
                    return Ok(walked);
                }
            }
            progress.advance();
        }
        Ok(walked)
    }

    /// Returns the number of steps between two times.
    fn steps(&self, from: f64, to: f64) -> usize {
        ((to - from).abs() / self.cloud.span() * STEPS).ceil() as usize
    }

    /// Returns whether what the point was placed on is still around it.
    fn is_there(&self, step: &Step) -> bool {
        let Self { cloud, look, .. } = self;
        let is_sure = step.place.is_finite() && step.error <= LARGEST_ERROR * cloud.size;
        let is_alike = |look: &Look| look.share(&cloud.colors(step.place, step.time, look.radius)) >= LEAST_SHARE;
        is_sure && look.as_ref().is_none_or(is_alike)
    }
}

impl Step {
    /// Returns the sample at a time.
    fn sample(&self, time: f32) -> SocketSample {
        SocketSample {
            time,
            position: self.place.as_vec3().to_array(),
            rotation: self.rotation.as_quat().normalize().to_array(),
            error: self.error as f32,
        }
    }
}

/// Returns the place of a sample.
fn place_of(sample: &SocketSample) -> DVec3 {
    Vec3::from(sample.position).as_dvec3()
}

/// Advances a task by steps that are not taken.
fn skip(steps: usize, progress: &mut dyn Progress) {
    (0..steps).for_each(|_| progress.advance());
}

/// Returns the samples at these times, which are in the order of the steps, up to the last step. Between steps places
/// are on curves that pass them without a bend (Catmull and Rom), and rotations turn steadily.
fn sampled(walked: &[Step], times: &[f32]) -> Vec<SocketSample> {
    let mut samples = Vec::with_capacity(times.len());
    let mut next = 1;
    for &time in times {
        let now = f64::from(time);
        let is_after = |step: &Step| (step.time - walked[0].time).abs() < (now - walked[0].time).abs();
        while walked.get(next).is_some_and(is_after) {
            next += 1;
        }
        let Some(after) = walked.get(next) else { break };
        let before = walked[next - 1];
        let duration = after.time - before.time;
        let part = (now - before.time) / duration;
        let slope = |earlier: Option<&Step>, later: Option<&Step>| match (earlier, later) {
            (Some(earlier), Some(later)) => (later.place - earlier.place) / (later.time - earlier.time) * duration,
            _ => after.place - before.place,
        };
        let begin = slope(next.checked_sub(2).map(|index| &walked[index]), Some(after));
        let end = slope(Some(&before), walked.get(next + 1));
        let (square, cube) = (part * part, part * part * part);
        let place = before.place
            + (after.place - before.place) * (3.0 * square - 2.0 * cube)
            + begin * (part - 2.0 * square + cube)
            + end * (cube - square);
        let rotation = before.rotation.slerp(after.rotation, part);
        let error = before.error + (after.error - before.error) * part;
        samples.push(Step { time: now, place, rotation, error }.sample(time));
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{TURN, body, colored, gaussian, place, scene};
    use super::*;
    use crate::gaussian::Gaussian;
    use crate::offline::work::NoProgress;
    use crate::offline::work::progress::InterruptedProgress;
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
        assert_eq!((found.lost, found.returns[0]), ([None; 2], None), "to the end of the interval");
        assert!(found.returns[1].expect("there is a way back") < 1e-6, "and back: {:?}", found.returns);
        let at_rest = |sample: &SocketSample| Vec3::from(sample.position).length() < 1e-6 && sample.error < 1e-6;
        assert!(found.socket.samples.iter().all(at_rest), "it does not move: {:?}", found.socket);
    }

    #[test]
    fn stripes_that_move_along_a_sheet_are_followed_though_no_gaussian_moves() {
        let (mut gaussians, mut values) = (Vec::new(), Vec::new());
        let slide = 0.3 * Vec3::X;
        for (column, row, generation) in
            (0..40).flat_map(|x| (0..12).flat_map(move |y| (0..22).map(move |t| (x, y, t))))
        {
            let time = 0.05 * generation as f32;
            let place = Vec3::new(0.04 * column as f32, 0.04 * row as f32, 0.0);
            gaussians.push(Gaussian {
                covariance: [4e-4, 0.0, 0.0, 4e-4, 0.0, 1e-6],
                ..gaussian(place + slide * time, time, Vec3::ZERO, 0.03)
            });
            values.extend(if column % 6 < 3 { [1.5, 1.2, -1.0] } else { [-1.0, -1.0, 1.0] });
        }
        let sheet = colored(gaussians, values);
        let start = Vec3::new(0.82, 0.22, 0.0) + slide * 0.5;
        let placement = Placement { name: "patch".into(), position: start.to_array(), time: 0.5, samples: 21 };
        let Followed { socket, lost, size, .. } = followed(&sheet, &placement).expect("it is there");
        assert_eq!(lost, [None; 2], "from end to end");
        for sample in &socket.samples {
            let off = Vec3::from(sample.position).distance(start + slide * (sample.time - 0.5)) / size;
            assert!(off < 0.01, "at {} it is {off} of the size off", sample.time);
        }
    }

    #[test]
    fn samples_between_steps_are_on_a_smooth_curve() {
        let step = |time: f64| Step {
            time,
            place: DVec3::new(time * time, time, 0.0),
            rotation: DQuat::from_rotation_z(time),
            error: time,
        };
        let walked: Vec<Step> = (0..=10).map(|index| step(0.1 * f64::from(index))).collect();
        for sample in sampled(&walked, &[0.15, 0.33, 0.4, 0.77]) {
            let exact = step(sample.time.into());
            assert!(Vec3::from(sample.position).abs_diff_eq(exact.place.as_vec3(), 1e-5), "a parabola: {sample:?}");
            let angle = Quat::from_array(sample.rotation).angle_between(exact.rotation.as_quat());
            assert!(angle < 1e-3 && (sample.error - sample.time).abs() < 1e-6, "turned steadily: {sample:?}");
        }
        let back: Vec<Step> = walked.iter().rev().copied().collect();
        assert_eq!(sampled(&back, &[0.9, 0.2, -0.1]).len(), 2, "backward, to the last step");
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
        let jumps = colored(gaussians, values);
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
    }
}
