//! Births: Gaussians that begin anew where several cameras have seen that something is missing.
//!
//! In: the [`Sighted`] points of some moments, raw parameters, the seed of random numbers. Out: [`Birth`]s, with the
//! velocity of points that are found again at the moment before or after; [`Born`] Gaussians, which take the places of
//! those of the lowest opacity, so that the number of Gaussians stays. Each birth makes three Gaussians, close to each
//! other. Training then finds their shapes.

use super::triangulation::Sighted;
use crate::codec::import::columns::SH_C0;
use crate::gaussian::axes::moving;
use crate::offline::engine::layout::TrainedRecord;
use crate::scene::random::Random;
use glam::Vec3;
use std::cmp::Ordering;

/// Gaussians of a birth.
const EACH: usize = 3;
/// Spatial scale, pixels.
const SCALE: f32 = 2.0;
/// Temporal scale of a point that is found again at a moment beside its own, and of one that is not, in distances of
/// moments: where the second is at other moments is not known.
const FOUND_AGAIN: f32 = 1.0;
const ALONE: f32 = 0.5;
/// Largest distance of a point from itself a moment later, as a share of the width of the pictures.
const REACH: f32 = 0.04;
/// Largest difference of a channel between a point and itself a moment later.
const ALIKE: f32 = 0.2;
/// Largest distance of two moments beside each other, in distances of moments.
const BESIDE: f32 = 1.5;
/// Of so many Gaussians one is replaced at most.
const OF_ALL: usize = 8;

/// Something that has been missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Birth {
    /// Place at its time, capture space.
    pub position: Vec3,
    /// Capture units for each unit of time.
    pub velocity: Vec3,
    pub time: f32,
    /// RGB, 0 to 1.
    pub color: Vec3,
    /// Standard deviations, in capture units and in units of time.
    pub scale: f32,
    pub scale_t: f32,
}

/// A Gaussian that takes the place of another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Born {
    pub place: u32,
    pub record: TrainedRecord,
    /// The first coefficient of color; the others are 0.
    pub color: [f32; 3],
}

/// Returns at most so many births at the points of moments, which are in the order of their times: those that most
/// views have seen. `frame` is the distance between two moments.
pub(crate) fn births(moments: &[(f32, Vec<Sighted>)], frame: f32, most: usize) -> Vec<Birth> {
    let mut found = Vec::new();
    for (moment, (time, points)) in moments.iter().enumerate() {
        for (index, point) in points.iter().enumerate() {
            let velocity = velocity(moments, moment, index, frame);
            let scale_t = frame * if velocity.is_some() { FOUND_AGAIN } else { ALONE };
            let Sighted { position, color, pixel, views, .. } = *point;
            let velocity = velocity.unwrap_or(Vec3::ZERO);
            found.push((views, Birth { position, velocity, time: *time, color, scale: SCALE * pixel, scale_t }));
        }
    }
    // The sort is stable.
    found.sort_by(|(a, _), (b, _)| b.cmp(a));
    let is_sound = |birth: &Birth| {
        let scales = [birth.scale, birth.scale_t];
        birth.position.is_finite() && scales.iter().all(|scale| scale.is_finite() && *scale > 0.0)
    };
    found.into_iter().map(|(_, birth)| birth).filter(is_sound).take(most).collect()
}

/// Returns the velocity of a point that is found again at a moment beside its own, the mean if at both.
fn velocity(moments: &[(f32, Vec<Sighted>)], moment: usize, index: usize, frame: f32) -> Option<Vec3> {
    let (time, points) = moments.get(moment)?;
    let own = points.get(index)?;
    let towards = |other: Option<usize>| {
        let (other_time, others) = moments.get(other?)?;
        let elapsed = other_time - time;
        let place = again(own, others).filter(|_| elapsed != 0.0 && elapsed.abs() <= BESIDE * frame)?;
        // Of several points to which the same one is closest, only the closest to that one is it.
        let is_it = again(&others[place], points) == Some(index);
        is_it.then(|| (others[place].position - own.position) / elapsed)
    };
    let found: Vec<Vec3> = [moment.checked_sub(1), Some(moment + 1)].into_iter().filter_map(towards).collect();
    (!found.is_empty()).then(|| found.iter().sum::<Vec3>() / found.len() as f32)
}

/// Returns the closest of the points with a similar color within reach.
fn again(own: &Sighted, others: &[Sighted]) -> Option<usize> {
    let distances = others.iter().map(|other| (other.position.distance(own.position), other.color)).enumerate();
    let within = distances
        .filter(|(_, (far, color))| *far <= REACH * own.width && (*color - own.color).abs().max_element() < ALIKE);
    within.min_by(|(_, (a, _)), (_, (b, _))| a.total_cmp(b)).map(|(index, _)| index)
}

/// Returns the Gaussians of births, in the places of those of the lowest opacity; at most an eighth of all Gaussians is
/// replaced, and the last births are left out.
pub(crate) fn take_over(records: &[TrainedRecord], births: &[Birth], seed: u64) -> Vec<Born> {
    let births = &births[..births.len().min(records.len() / OF_ALL / EACH)];
    let mut random = Random::new(seed);
    let mut born = Vec::with_capacity(births.len() * EACH);
    for (birth, places) in births.iter().zip(faintest(records, births.len() * EACH).chunks_exact(EACH)) {
        for (copy, &place) in places.iter().enumerate() {
            let [[x, y], [z, _]] = [(); 2].map(|()| random.normal_pair());
            let beside = if copy == 0 { Vec3::ZERO } else { birth.scale * Vec3::new(x, y, z) };
            let color = ((birth.color - 0.5) / SH_C0).to_array();
            born.push(Born { place, record: record_of(birth, beside), color });
        }
    }
    born
}

/// Returns the indices of so many Gaussians of the lowest opacity, the lowest first.
fn faintest(records: &[TrainedRecord], count: usize) -> Vec<u32> {
    let logit = |index: u32| records[index as usize].opacity_logit[0];
    // Of equal opacities the first Gaussian comes first.
    let order = |a: &u32, b: &u32| -> Ordering { logit(*a).total_cmp(&logit(*b)).then(a.cmp(b)) };
    let mut indices: Vec<u32> = (0..records.len() as u32).collect();
    if count < indices.len() {
        indices.select_nth_unstable_by(count, order);
        indices.truncate(count);
    }
    indices.sort_unstable_by(order);
    indices
}

/// Returns the raw parameters of a Gaussian of a birth, with the opacity 0.5.
fn record_of(birth: &Birth, beside: Vec3) -> TrainedRecord {
    let Birth { position, velocity, time, scale, scale_t, .. } = *birth;
    let (log_scale, log_scale_t, [rotation_l, rotation_r]) = moving(scale * scale, scale_t, velocity);
    TrainedRecord {
        mean: (position + beside).to_array(),
        mean_t: time,
        log_scale,
        log_scale_t,
        rotation_l,
        rotation_r,
        opacity_logit: [0.0; 4],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::{Parameters, SliceSettings};

    const FRAME: f32 = 0.25;

    fn sighted(position: Vec3, color: Vec3, views: usize) -> Sighted {
        Sighted { position, color, pixel: 0.01, width: 6.4, views }
    }

    fn faint(logit: f32) -> TrainedRecord {
        TrainedRecord { opacity_logit: [logit, 0.0, 0.0, 0.0], ..TrainedRecord::default() }
    }

    #[test]
    fn a_point_that_is_found_again_has_a_velocity() {
        let at = |moment: u8| Vec3::new(0.1 * f32::from(moment), 0.2, 0.0);
        let moment = |moment: u8| {
            let other = sighted(Vec3::splat(f32::from(moment)), Vec3::Z, 3);
            (FRAME * f32::from(moment), vec![other, sighted(at(moment), Vec3::X, 5)])
        };
        let found = births(&[moment(0), moment(1), moment(2)], FRAME, 4);
        assert_eq!(found.len(), 4, "no more than wanted");
        for (birth, index) in found.iter().zip(0..3) {
            assert_eq!(birth.position, at(index), "points that more views have seen come first");
            assert!(birth.velocity.distance(Vec3::X * 0.4) < 1e-5, "a tenth in a quarter: {}", birth.velocity);
            assert_eq!((birth.time, birth.scale_t), (FRAME * f32::from(index), FRAME), "at its moment");
        }
        assert_eq!((found[3].velocity, found[3].scale_t), (Vec3::ZERO, 0.5 * FRAME), "others are too far away");
        let far = births(&[moment(0), (0.5, moment(1).1)], FRAME, 9);
        assert!(far.iter().all(|birth| birth.velocity == Vec3::ZERO), "two frames later");
    }

    #[test]
    fn births_take_the_places_of_the_faintest() {
        let mut records: Vec<TrainedRecord> = (0..60).map(|index| faint(1.0 + index as f32)).collect();
        [41, 7, 30].into_iter().for_each(|index| records[index] = faint(-5.0));
        [2, 50, 51].into_iter().for_each(|index| records[index] = faint(-80.0));
        let color = Vec3::new(1.0, 0.5, 0.0);
        let birth =
            |x: f32| Birth { position: Vec3::X * x, velocity: Vec3::ZERO, time: 0.5, color, scale: 0.1, scale_t: 0.25 };
        let born = take_over(&records, &[birth(1.0), birth(2.0), birth(3.0)], 4);
        let places: Vec<u32> = born.iter().map(|born| born.place).collect();
        assert_eq!(places, [2, 50, 51, 7, 30, 41], "free places, then faded ones; an eighth of sixty is two births");
        for (born, x) in born.iter().zip([1.0, 1.0, 1.0, 2.0, 2.0, 2.0]) {
            let TrainedRecord { mean, mean_t, log_scale, log_scale_t, rotation_l, rotation_r, opacity_logit } =
                born.record;
            assert!(Vec3::from(mean).distance(Vec3::X * x) < 0.6, "beside its place: {mean:?}");
            assert_eq!((mean_t, log_scale, log_scale_t), (0.5, [0.1f32.powi(2).ln() * 0.5; 3], 0.25f32.ln()), "scales");
            assert_eq!([rotation_l, rotation_r], [[1.0, 0.0, 0.0, 0.0]; 2], "no rotation");
            assert_eq!(opacity_logit, [0.0; 4], "half transparent");
            assert!((Vec3::from(born.color) * SH_C0 + 0.5).distance(color) < 1e-6, "its color");
        }
        assert_eq!(born[0].record.mean, [1.0, 0.0, 0.0], "the first of three is in the place itself");
        assert_eq!(take_over(&records, &[birth(1.0)], 4), born[..3], "the same for the same seed");
        assert_eq!(take_over(&[], &[birth(1.0)], 4), [], "nothing to replace");
    }

    #[test]
    fn a_moving_gaussian_has_its_velocity_and_scales() {
        for velocity in [Vec3::new(2.0, -1.0, 0.5), Vec3::NEG_Z * 30.0, Vec3::splat(1e-4), Vec3::ZERO] {
            let (log_scale, log_scale_t, [l, r]) = moving(0.02 * 0.02, 0.03, velocity);
            let parameters = Parameters {
                mean: vec![[0.0; 3]],
                mean_t: vec![0.0],
                log_scale: vec![log_scale],
                log_scale_t: vec![log_scale_t],
                rotation_l: vec![l],
                rotation_r: vec![r],
                opacity_logit: vec![0.0],
            };
            let found = parameters.slice(&SliceSettings::default()).expect("the Gaussian can be drawn")[0];
            let error = Vec3::from(found.velocity).distance(velocity);
            assert!(error < 1e-2 * velocity.length() + 1e-3, "{velocity}: {:?}", found.velocity);
            assert!((found.sigma_t / 0.03 - 1.0).abs() < 1e-3, "{velocity}: the temporal scale is {}", found.sigma_t);
            let [xx, .., zz] = found.covariance;
            assert!((xx.sqrt() / 0.02 - 1.0).abs() < 0.05, "{velocity}: the scale across is {}", xx.sqrt());
            assert!((zz.sqrt() / 0.02 - 1.0).abs() < 0.05, "{velocity}: the scale down is {}", zz.sqrt());
        }
    }
}
