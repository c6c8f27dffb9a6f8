//! The origin of a dataset.
//!
//! In: the places of cameras and the times of frames, in the coordinates of the files. Out: the [`Origin`] from which
//! places and times are counted in single precision, and a sentence about it. It is zero unless cameras or times are so
//! far from 0 that single precision would lose their digits: coordinates of maps (UTM), seconds since 1970.

use crate::scene::Origin;
use glam::DVec3;
use std::collections::HashSet;

/// Places and times that are farther from 0 than this many times their extent have an origin of their own: single
/// precision would leave them 14 of 24 bits, or fewer.
const FAR: f64 = 1024.0;
/// Cameras closer together than this share of their distance from 0 are at one place.
const ONE_PLACE: f64 = 1e-9;
/// The extent that counts for frames of a single time.
const STILL: f64 = 1024.0;
/// One of this many cameras may be far from the others.
const STRAY: usize = 10;

/// Returns the origin of cameras at these places (one for each frame, of any number of cameras) and of frames at these
/// times.
pub(crate) fn automatic(places: Vec<DVec3>, times: &[f64]) -> Origin {
    Origin { place: place(places).to_array(), time: time(times) }
}

/// Returns the center of the cameras, in whole units, if they are far from 0 and not at one place; else 0.
fn place(mut places: Vec<DVec3>) -> DVec3 {
    let mut seen = HashSet::new();
    places.retain(|place| seen.insert(place.to_array().map(f64::to_bits)));
    let middle = DVec3::from([0, 1, 2].map(|axis| median(&places, axis)));
    places.sort_by(|a, b| a.distance_squared(middle).total_cmp(&b.distance_squared(middle)));
    places.truncate(places.len() - places.len() / STRAY);
    let center = places.iter().sum::<DVec3>() / places.len().max(1) as f64;
    let extent = places.iter().map(|place| place.distance(center)).fold(0.0, f64::max);
    let distance = center.length();
    let is_far = distance > FAR * extent && extent > ONE_PLACE * distance;
    // The sum with 0 makes 0 of minus 0.
    if is_far && distance.is_finite() { center.round() + DVec3::ZERO } else { DVec3::ZERO }
}

/// Returns the coordinate in the middle.
fn median(places: &[DVec3], axis: usize) -> f64 {
    let mut values: Vec<f64> = places.iter().map(|place| place[axis]).collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Returns the first time, rounded down, if the times are far from 0; else 0.
fn time(times: &[f64]) -> f64 {
    let [first, last] =
        times.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[first, last], &time| [first.min(time), last.max(time)]);
    let span = if first < last { last - first } else { STILL };
    let farthest = first.abs().max(last.abs());
    if farthest.is_finite() && farthest > FAR * span { first.floor() } else { 0.0 }
}

/// Returns sentences about an origin that is not zero.
pub(crate) fn notes(origin: &Origin) -> Vec<String> {
    let Origin { place: [x, y, z], time } = *origin;
    let mut notes = Vec::new();
    if [x, y, z] != [0.0; 3] {
        notes.push(format!(
            "its cameras are far from 0 of its coordinates: the capture's origin is at {x}, {y}, {z} of them"
        ));
    }
    if time != 0.0 {
        notes.push(format!("its times are far from 0: the capture's time 0 is {time} of the dataset"));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns twelve cameras on a circle of radius 3 around a place.
    fn circle(center: DVec3) -> Vec<DVec3> {
        let at = |index: u32| DVec3::new(f64::from(index).cos(), f64::from(index).sin(), 0.25);
        (0..12).map(|index| center + 3.0 * at(index)).collect()
    }

    fn of_times(times: &[f64]) -> f64 {
        automatic(circle(DVec3::ZERO), times).time
    }

    #[test]
    fn cameras_far_from_0_have_an_origin_at_their_center() {
        let center = DVec3::new(500_000.25, 5_400_000.5, 300.0);
        let found = automatic(circle(center), &[0.0]);
        let off = DVec3::from(found.place).distance(center);
        assert!(off < 3.0 && found.place.iter().all(|value| value.fract() == 0.0), "whole units: {found:?}");
        assert_eq!(found.time, 0.0, "times are near 0");
        for near in [DVec3::ZERO, DVec3::X * 900.0, DVec3::splat(-1000.0)] {
            assert_eq!(automatic(circle(near), &[0.0]), Origin::default(), "cameras near {near} need none");
        }
        let mut strayed = circle(center);
        strayed[5] = DVec3::ZERO;
        let off = DVec3::from(automatic(strayed, &[0.0]).place).distance(center);
        assert!(off < 3.0, "one camera of twelve may be elsewhere: {off}");
        let mut near = circle(DVec3::ZERO);
        near[5] = center;
        assert_eq!(automatic(near, &[0.0]), Origin::default(), "one camera far away moves nothing");
    }

    #[test]
    fn cameras_at_one_place_have_no_origin() {
        let far = DVec3::new(500_000.0, 5_400_000.0, 300.0);
        for places in [vec![], vec![far], vec![far; 9], vec![far, far + 1e-9], vec![DVec3::splat(1e300), DVec3::ZERO]] {
            assert_eq!(automatic(places.clone(), &[]), Origin::default(), "{places:?}");
        }
        let rig: Vec<DVec3> = (0..99).map(|index| far + f64::from(u8::from(index == 7))).collect();
        assert_ne!(automatic(rig, &[]), Origin::default(), "each camera counts once, however many frames it has");
    }

    #[test]
    fn times_far_from_0_begin_at_the_first() {
        assert_eq!(
            of_times(&[1_700_000_002.5, 1_700_000_000.75, 1_700_000_004.0]),
            1_700_000_000.0,
            "seconds since 1970"
        );
        assert_eq!(of_times(&[-2_000_000.5, -2_000_000.0]), -2_000_001.0, "rounded down");
        assert_eq!(of_times(&[2e9; 3]), 2e9, "a still");
        for times in [&[][..], &[7.0], &[100_000.0], &[0.0, 1.0], &[1000.0, 1001.0], &[0.0, 1_700_000_000.0]] {
            assert_eq!(of_times(times), 0.0, "{times:?} need no origin");
        }
    }

    #[test]
    fn notes_name_what_is_not_zero() {
        assert!(notes(&Origin::default()).is_empty(), "nothing to say");
        let found = notes(&Origin { place: [500_000.0, -3.0, 0.0], time: 1_700_000_000.0 });
        assert!(found[0].contains("500000, -3, 0") && found[1].contains("1700000000"), "{found:?}");
    }
}
