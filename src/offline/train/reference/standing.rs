//! Gaussians that stand; CPU reference of `shaders/offline/standing.wgsl`.
//!
//! In: the raw parameters and the color of a native 4D Gaussian, the times of [`Standing`]. Out: the same Gaussian at
//! rest, if its temporal scale is at least two time intervals.
//!
//! What stands has one form: its temporal mean in the middle of the interval; a temporal scale of three intervals, so
//! that its opacity is the same at all times but for 1.4 percent; no velocity; no color that depends on time. Training
//! would let it drift away from that, and flicker.
//!
//! * The temporal scale is the part of `s_t` that is along the axis of time, `s_t |l · r|`: the last scale of a
//!   Gaussian that moves fast is along its path in space and time, and can be large without a long life.
//! * A Gaussian of two equal quaternions is at rest. Of all of them the one of their mean, with the signs aligned, is
//!   closest to `L(l) R(r)`: the trace of the product of both rotations is `4 (l · m) (r · m)`, which is largest at the
//!   bisector `m`. Its shape is that of the slice but for the square of the angle between both quaternions.
//! * It stands where it was in the middle of the interval.

use crate::gaussian::rotation_4d;
use crate::offline::engine::layout::TrainedRecord;
use glam::{DMat4, DVec3, DVec4};

/// Least temporal scale of a Gaussian that is brought to rest, in time intervals.
const LEAST: f32 = 2.0;
/// Temporal scale of what stands, in time intervals.
pub const STANDING_TIME_SCALE: f32 = 3.0;
/// Number of values of a color that do not depend on time: those of 16 coefficients.
const WITHOUT_TIME: usize = 48;

/// The times of what stands, in the unit of timestamps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standing {
    /// Temporal mean.
    pub middle: f32,
    /// Least temporal scale of a Gaussian that is brought to rest.
    pub least_scale_t: f32,
    /// Logarithm of the temporal scale of what stands.
    pub log_scale_t: f32,
}

impl Standing {
    /// Returns the times for this time interval; `None` if it is empty, as that of a still.
    pub fn of([start, end]: [f32; 2]) -> Option<Self> {
        let span = end - start;
        let times = Self {
            middle: (start + end) / 2.0,
            least_scale_t: LEAST * span,
            log_scale_t: (STANDING_TIME_SCALE * span).ln(),
        };
        (span > 0.0).then_some(times)
    }
}

/// Brings a Gaussian to rest if it lives long enough. `color` is all values of its color. Returns whether it stands.
pub fn stand(record: &mut TrainedRecord, color: &mut [f32], times: &Standing) -> bool {
    let vector = |values: [f32; 4]| DVec4::from(values.map(f64::from));
    let (left, right) = (vector(record.rotation_l).normalize(), vector(record.rotation_r).normalize());
    let cosine = left.dot(right);
    let [x, y, z] = record.log_scale;
    let scale = vector([x, y, z, record.log_scale_t]).map(f64::exp);
    // False of a quaternion of length zero, too.
    let lives_long = scale.w * cosine.abs() >= f64::from(times.least_scale_t);
    if lives_long {
        let factor = rotation_4d(left, right) * DMat4::from_diagonal(scale);
        let coupling = (factor * factor.transpose()).w_axis;
        let elapsed = f64::from(times.middle) - f64::from(record.mean_t);
        let place = DVec3::from(record.mean.map(f64::from)) + coupling.truncate() / coupling.w * elapsed;
        let rotation = (left + right * 1.0f64.copysign(cosine)).normalize().as_vec4().to_array();
        record.mean = place.as_vec3().to_array();
        (record.mean_t, record.log_scale_t) = (times.middle, times.log_scale_t);
        (record.rotation_l, record.rotation_r) = (rotation, rotation);
        color.iter_mut().skip(WITHOUT_TIME).for_each(|value| *value = 0.0);
    }
    lives_long
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::{Gaussian, Parameters, SliceSettings};
    use glam::Vec3;

    const INTERVAL: [f32; 2] = [1.0, 5.0];

    /// Returns a Gaussian that lives for so many intervals around the time 2; its quaternions differ by about this
    /// angle.
    fn record(intervals: f32, angle: f32) -> TrainedRecord {
        let [w, x, y, z] = [0.5f32, -0.1, 0.7, 0.3];
        TrainedRecord {
            mean: [0.1, 0.2, 0.3],
            mean_t: 2.0,
            log_scale: [0.3f32, 0.2, 0.05].map(f32::ln),
            log_scale_t: (4.0 * intervals).ln(),
            rotation_l: [w, x, y, z],
            rotation_r: [w + 0.5 * angle, x - 0.6 * angle, y, z + 0.4 * angle],
            opacity_logit: [0.4, 0.0, 0.0, 0.0],
        }
    }

    fn sliced(record: &TrainedRecord) -> Gaussian {
        let parameters = Parameters {
            mean: vec![record.mean],
            mean_t: vec![record.mean_t],
            log_scale: vec![record.log_scale],
            log_scale_t: vec![record.log_scale_t],
            rotation_l: vec![record.rotation_l],
            rotation_r: vec![record.rotation_r],
            opacity_logit: vec![record.opacity_logit[0]],
        };
        parameters.slice(&SliceSettings::default()).expect("the parameters are valid")[0]
    }

    /// Returns a Gaussian brought to rest, and whether it was.
    fn stood(mut record: TrainedRecord) -> (TrainedRecord, bool) {
        let times = Standing::of(INTERVAL).expect("the interval is not empty");
        let stands = stand(&mut record, &mut [], &times);
        (record, stands)
    }

    #[test]
    fn a_gaussian_of_a_long_life_stands_where_it_was_in_the_middle() {
        for sign in [1.0, -1.0] {
            let mut before = record(2.5, 1e-2);
            before.rotation_r = before.rotation_r.map(|component| sign * component);
            let (after, stands) = stood(before);
            assert!(stands, "it lives longer than two intervals");
            assert_eq!(after.rotation_l, after.rotation_r, "both quaternions are the same");
            let (own, found) = (sliced(&before), sliced(&after));
            let velocity = Vec3::from(own.velocity);
            assert!(velocity.length() > 1e-3, "it moved: {velocity}");
            assert!(Vec3::from(found.velocity).length() < 1e-12, "it is at rest: {:?}", found.velocity);
            let (was, is) = (own.mean_at(3.0), Vec3::from(found.mean));
            assert!(was.distance(is) < 1e-6, "it stands at {is}, and was at {was} in the middle");
            assert!((found.mean_t - 3.0).abs() < 1e-6 && (found.sigma_t / 12.0 - 1.0).abs() < 1e-5, "its times");
            let largest = own.covariance[0].max(own.covariance[3]).max(own.covariance[5]);
            for (was, is) in own.covariance.iter().zip(found.covariance) {
                assert!((was - is).abs() < 1e-3 * largest, "its shape: {:?}, not {own:?}", found.covariance);
            }
            let faintest = INTERVAL.map(|time| found.marginal(time)).into_iter().fold(1.0, f32::min);
            assert!(faintest > 0.985, "its opacity hardly depends on time: {faintest}");
        }
    }

    #[test]
    fn a_gaussian_that_stands_stays_as_it_is() {
        let (once, _) = stood(record(2.5, 1e-2));
        let (twice, stands) = stood(once);
        assert!(stands, "it still lives long");
        assert_eq!((twice.mean_t, twice.log_scale_t), (once.mean_t, once.log_scale_t), "its times");
        let moved = Vec3::from(twice.mean).distance(Vec3::from(once.mean));
        let pairs = twice.rotation_l.iter().zip(once.rotation_l);
        let turned = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(moved == 0.0 && turned < 1e-6, "it neither moves nor turns: {moved}, {turned}");
    }

    #[test]
    fn other_gaussians_are_left_alone() {
        let short = record(1.9, 1e-2);
        assert_eq!(stood(short), (short, false), "a life of less than two intervals");
        // A scale of 20 along its path in space and time, a tenth of it along the axis of time.
        let (rotation_l, rotation_r) = ([1.0, 0.0, 0.0, 0.0], [0.1, 0.995, 0.0, 0.0]);
        let fast = TrainedRecord { rotation_l, rotation_r, ..record(5.0, 0.0) };
        assert_eq!(stood(fast), (fast, false), "a fast Gaussian of a short life");
        let none = TrainedRecord { rotation_r: [0.0; 4], ..record(9.0, 0.0) };
        assert_eq!(stood(none), (none, false), "a quaternion of length zero");
        assert_eq!(Standing::of([2.0, 2.0]), None, "a still has no interval");
    }

    #[test]
    fn what_stands_has_no_color_in_time() {
        let times = Standing::of(INTERVAL).expect("the interval is not empty");
        for values in [3, 48, 96, 144] {
            let mut color = vec![0.5; values];
            assert!(stand(&mut record(3.0, 0.0), &mut color, &times), "it lives long");
            let kept = color.iter().filter(|&&value| value == 0.5).count();
            assert_eq!(kept, values.min(48), "{values} values: those of 16 coefficients stay");
            let mut color = vec![0.5; values];
            assert!(!stand(&mut record(0.3, 0.0), &mut color, &times), "it lives shortly");
            assert!(color.iter().all(|&value| value == 0.5), "{values} values of another Gaussian stay");
        }
    }
}
