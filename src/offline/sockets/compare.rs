//! How far from known tracks points are that are followed.
//!
//! In: a capture, [`KnownPoint`]s. Out: a [`Comparison`]: each point is followed in both directions from the middle of
//! the times at which it is known; its distances from the known places, the part of these at which it is lost, and how far
//! the ways back miss the start.
//!
//! A point is compared while it is there: without the places beyond a gap in its track, of the stretch nearest to the
//! middle of the time interval.

use super::cloud::Cloud;
use super::error::SocketError;
use super::follow::{Followed, Placement, check_samples, follow_within};
use super::known_point::KnownPoint;
use crate::offline::work::Progress;
use crate::scene::GaussianScene;
use glam::Vec3;

/// Points that have been followed, beside their known tracks.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// The size of the capture, the diagonal of its middle, capture units: the measure of all distances.
    pub size: f32,
    /// The points, in the order in which they were given.
    pub points: Vec<Compared>,
}

/// A point that has been followed, beside its known track.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// Its name.
    pub name: String,
    /// The time at which it was placed, timestamp units.
    pub time: f32,
    /// The first and the last time of the known places, timestamp units.
    pub interval: [f32; 2],
    /// The number of known places.
    pub places: usize,
    /// The number of known places at whose times it was followed.
    pub followed: usize,
    /// The largest distance from a known place, capture units; `None` if it was not followed at all.
    pub largest: Option<f32>,
    /// The mean of the distances from the known places, capture units; `None` if it was not followed at all.
    pub mean: Option<f32>,
    /// The larger of the distances from the start at which the ways back from the ends of the track arrive, capture
    /// units; `None` if it was not followed at all, or is lost on a way back.
    pub way_back: Option<f32>,
}

impl Compared {
    /// Returns the part of the known places at which it is lost, 0 to 1.
    pub fn lost(&self) -> f64 {
        1.0 - self.followed as f64 / self.places as f64
    }
}

/// The known places of a point without a gap.
struct Stretch {
    /// The place nearest to the middle of their times, and its time.
    start: (f32, [f32; 3]),
    /// All places with their times.
    places: Vec<(f32, [f32; 3])>,
    /// The first and the last time.
    interval: [f32; 2],
}

/// Follows points and compares them with their known tracks. A track has as many samples as `samples` are over the time
/// interval of the capture, 2 to 65,535. Begins the task "comparing".
///
/// # Errors
/// A point without a known place at the times of the capture; as [`follow`](super::follow()), except that a place
/// without visible Gaussians is no error: the point is lost at once.
pub fn compare(
    scene: &GaussianScene,
    points: &[KnownPoint],
    samples: usize,
    progress: &mut dyn Progress,
) -> Result<Comparison, SocketError> {
    check_samples(samples)?;
    let cloud = Cloud::of(scene)?;
    progress.begin("comparing", points.len());
    let mut compared = Vec::with_capacity(points.len());
    for point in points {
        compared.push(of_point(&cloud, scene.trained_with.time_interval, point, samples, progress)?);
        progress.advance();
    }
    progress.finish();
    Ok(Comparison { size: cloud.size as f32, points: compared })
}

fn of_point(
    cloud: &Cloud,
    [first, last]: [f32; 2],
    point: &KnownPoint,
    samples: usize,
    progress: &mut dyn Progress,
) -> Result<Compared, SocketError> {
    let name = point.name.clone();
    let Some(Stretch { start: (time, position), places, interval }) = Stretch::of(point, [first, last]) else {
        return Err(SocketError::Unknown { name, first, last });
    };
    let share = (f64::from(interval[1]) - f64::from(interval[0])) / cloud.span();
    let samples = ((samples - 1) as f64 * share).ceil() as usize + 1;
    let placement = Placement { name: name.clone(), position, time, samples: samples.max(2) };
    let found = match follow_within(cloud, interval, &placement, progress) {
        Err(SocketError::NothingThere { .. }) => None,
        found => Some(found?),
    };
    let distance = |&(time, place): &(f32, [f32; 3])| {
        let sample = found.as_ref()?.socket.at(time)?;
        Some(Vec3::from(sample.position).distance(place.into()))
    };
    let distances: Vec<f32> = places.iter().filter_map(distance).collect();
    let sum: f64 = distances.iter().copied().map(f64::from).sum();
    Ok(Compared {
        name,
        time,
        interval,
        places: places.len(),
        followed: distances.len(),
        largest: distances.iter().copied().reduce(f32::max),
        mean: (!distances.is_empty()).then(|| (sum / distances.len() as f64) as f32),
        way_back: found.as_ref().and_then(|found| way_back(found, time)),
    })
}

impl Stretch {
    /// Returns the places of a point without a gap nearest to the middle of an interval of time; `None` if it has none in
    /// the interval.
    fn of(point: &KnownPoint, [first, last]: [f32; 2]) -> Option<Self> {
        let middle = first.midpoint(last);
        let far = |time: f32| (time - middle).abs();
        let within: Vec<(f32, Option<[f32; 3]>)> =
            point.track.iter().copied().filter(|(time, _)| (first..=last).contains(time)).collect();
        let nearest = |stretch: &[(f32, Option<[f32; 3]>)]| {
            stretch.iter().map(|(time, _)| far(*time)).fold(f32::INFINITY, f32::min)
        };
        let stretches = within.split(|(_, place)| place.is_none());
        let stretch = stretches.min_by(|a, b| nearest(a).total_cmp(&nearest(b)))?;
        let places: Vec<(f32, [f32; 3])> =
            stretch.iter().filter_map(|(time, place)| Some((*time, (*place)?))).collect();
        let interval = [places.first()?.0, places.last()?.0];
        let off = |time: f32| (time - interval[0].midpoint(interval[1])).abs();
        let start = *places.iter().min_by(|a, b| off(a.0).total_cmp(&off(b.0)))?;
        Some(Self { start, places, interval })
    }
}

/// Returns the larger of the distances at which the ways back to the time `start` arrive; `None` if one is lost.
fn way_back(followed: &Followed, start: f32) -> Option<f32> {
    let [first, last] = followed.socket.reach()?;
    let ways = [first < start, start < last].into_iter().zip(followed.returns).filter(|(is_way, _)| *is_way);
    ways.map(|(_, arrived)| arrived).try_fold(0.0, |largest: f32, arrived| Some(largest.max(arrived?)))
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{body, place};
    use super::*;
    use crate::offline::work::NoProgress;
    use glam::DVec3;

    /// A point of the body.
    const POINT: DVec3 = DVec3::new(0.3, 0.25, -0.1);

    /// Returns a point with a place at 41 times from 0 to 1.
    fn known(place: impl Fn(f64) -> Option<DVec3>) -> KnownPoint {
        let at = |index: u32| {
            let time = f64::from(index) / 40.0;
            (time as f32, place(time).map(|place| place.as_vec3().to_array()))
        };
        KnownPoint { name: "hand".into(), track: (0..=40).map(at).collect() }
    }

    fn compared(end: f64, point: KnownPoint) -> (Compared, f32) {
        let mut found = compare(&body(end), &[point], 61, &mut NoProgress).expect("it is compared");
        (found.points.remove(0), found.size)
    }

    #[test]
    fn a_point_on_its_track_is_near_it_over_the_whole_time_and_arrives_where_it_began() {
        let (found, size) = compared(f64::INFINITY, known(|time| Some(place(POINT, time))));
        assert_eq!((found.time, found.interval), (0.5, [0.0, 1.0]), "from the middle to both ends");
        assert_eq!((found.places, found.followed, found.lost()), (41, 41, 0.0), "never lost");
        let [largest, mean, way_back] =
            [found.largest, found.mean, found.way_back].map(|distance| distance.expect("it is followed") / size);
        assert!(largest < 0.01 && way_back < 0.01, "{largest} of the size off, {way_back} on the way back");
        assert!(mean > 0.0 && mean <= largest, "the mean {mean} is at most the largest {largest}");
    }

    #[test]
    fn distances_are_those_from_the_known_track() {
        let off = |time: f64| DVec3::X * (0.8 * (time - 0.5));
        let (found, size) = compared(f64::INFINITY, known(|time| Some(place(POINT, time) + off(time))));
        let (largest, mean) = (found.largest.expect("it is followed"), found.mean.expect("it is followed"));
        assert!((largest - 0.4).abs() < 0.01 * size, "0.4 at both ends, not {largest}");
        assert!((mean - 0.205).abs() < 0.01 * size, "half of it in the mean, not {mean}");
    }

    #[test]
    fn what_ends_before_its_track_is_lost_for_the_rest_of_it() {
        let (found, _) = compared(0.7, known(|time| Some(place(POINT, time))));
        assert!((0.04..0.41).contains(&found.lost()), "the body ends soon after 0.7, and {} are lost", found.lost());
        let nothing = known(|_| Some(DVec3::splat(9.0)));
        let (found, _) = compared(0.7, nothing);
        assert_eq!((found.followed, found.lost()), (0, 1.0), "nothing is there");
        assert_eq!((found.largest, found.mean, found.way_back), (None, None, None), "there is no distance");
    }

    #[test]
    fn a_point_is_compared_from_gap_to_gap_around_the_middle() {
        let there = |time: f64| (time < 0.1 || (0.55..0.76).contains(&time)).then(|| place(POINT, time));
        let (found, _) = compared(f64::INFINITY, known(there));
        let [first, middle, last] = [22.0, 26.0, 30.0].map(|index: f64| (index / 40.0) as f32);
        assert_eq!((found.time, found.interval, found.places), (middle, [first, last], 9), "the nearest stretch alone");
        let (found, _) = compared(f64::INFINITY, known(|time| (time == 0.5).then(|| place(POINT, time))));
        assert_eq!((found.interval, found.largest, found.lost()), ([0.5; 2], Some(0.0), 0.0), "a single place");
    }

    #[test]
    fn a_point_without_a_place_at_the_times_of_the_capture_is_refused() {
        let mut later = known(|time| Some(place(POINT, time)));
        later.track.iter_mut().for_each(|(time, _)| *time += 2.0);
        for point in [known(|_| None), later] {
            let error = compare(&body(0.7), &[point], 61, &mut NoProgress).expect_err("nothing can be compared");
            assert!(error.to_string().contains("the point hand has no known place"), "{error}");
        }
    }
}
