//! The densification of the original 4DGS, within a fixed number of places (section 6 of the 4DGS model); CPU reference
//! of the moves that `shaders/offline/relocate.wgsl` carries out.
//!
//! In: raw parameters of as many places as the capture has at most, the mean gradient of each Gaussian on the screen,
//! the seed of random numbers. Out: raw parameters with Gaussians removed, cloned and split ([`densify`]), and the
//! places whose colors are copied and whose moments become 0. Opacities are lowered by [`reset_opacity`].
//!
//! * A place is free if its Gaussian has the opacity of the logit [`FREE`], at which it is never drawn and has no
//!   gradient.
//! * A Gaussian of an opacity below 0.005 is removed: its place is free.
//! * A Gaussian whose gradient is at least 0.0002 is cloned if it is small, because one Gaussian does not cover what
//!   the images show there; a large one covers too much, and is split into two whose means are drawn from it, in space
//!   and time, with all scales divided by 1.6. Gaussians with the largest gradients come first; when no place is free,
//!   the others stay as they are.
//! * After the first reset of opacity, Gaussians that are larger than a tenth of the extent of the cameras are removed.
//!
//! As in the original, gradients with respect to time are not used, and neither is the radius on the screen.

use crate::gaussian::slice::rotation_4d;
use crate::offline::engine::layout::TrainedRecord;
use crate::scene::random::Random;
use glam::DVec4;

/// The logit of opacity of a free place: far below the least opacity that is drawn, and such that its exponential is
/// finite.
pub const FREE: f32 = -80.0;
/// Mean gradient, in normalized device coordinates, from which a Gaussian is cloned or split.
const GRADIENT: f32 = 2e-4;
/// Largest spatial scale of a Gaussian that is cloned, as a share of the extent of the cameras.
const SMALL: f64 = 0.01;
/// Largest spatial scale of a Gaussian that stays, as a share of the extent.
const LARGE: f64 = 0.1;
/// Divisor of the scales of a Gaussian that is split.
const SMALLER: f64 = 1.6;
/// Opacity below which a Gaussian is removed.
const FAINT: f64 = 0.005;
/// Largest opacity after a reset.
const RESET: f64 = 0.01;

/// What a densification has changed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Densified {
    /// Places whose moments are 0, each with the place that its color is copied from, which is the same place if its
    /// color stays.
    pub moves: Vec<[u32; 2]>,
    /// Number of Gaussians that were cloned.
    pub cloned: usize,
    /// Number of Gaussians that were split.
    pub split: usize,
    /// Number of Gaussians that were removed.
    pub removed: usize,
}

/// Returns whether a place is free.
pub fn is_free(record: &TrainedRecord) -> bool {
    record.opacity_logit[0] <= FREE
}

/// Removes, clones and splits Gaussians. `gradients` has the mean gradient of each; `extent` is that of the cameras;
/// `removes_large`: whether large Gaussians are removed.
pub fn densify(
    records: &mut [TrainedRecord],
    gradients: &[f32],
    extent: f64,
    removes_large: bool,
    seed: u64,
) -> Densified {
    let mut densified = Densified::default();
    // The source of the color of each place whose moments are 0.
    let mut sources: Vec<Option<u32>> = vec![None; records.len()];
    for (index, (record, source)) in records.iter_mut().zip(&mut sources).enumerate() {
        if !is_free(record) && opacity(record) < FAINT {
            remove(record, source, index);
            densified.removed += 1;
        }
    }
    let (free, live): (Vec<usize>, Vec<usize>) = (0..records.len()).partition(|&index| is_free(&records[index]));
    let gradient = |index: usize| gradients.get(index).copied().filter(|gradient| gradient.is_finite()).unwrap_or(0.0);
    let mut grown: Vec<usize> = live.into_iter().filter(|&index| gradient(index) >= GRADIENT).collect();
    // The sort is stable: of equal gradients the first Gaussian comes first.
    grown.sort_by(|&a, &b| gradient(b).total_cmp(&gradient(a)));
    let mut random = Random::new(seed);
    for (index, place) in grown.into_iter().zip(free) {
        let parent = records[index];
        sources[place] = Some(index as u32);
        if largest(&parent) <= SMALL * extent {
            records[place] = parent;
            densified.cloned += 1;
        } else {
            for child in [index, place] {
                records[child] = part(&parent, &mut random);
            }
            sources[index] = Some(index as u32);
            densified.split += 1;
        }
    }
    for (index, (record, source)) in records.iter_mut().zip(&mut sources).enumerate() {
        if removes_large && !is_free(record) && largest(record) > LARGE * extent {
            remove(record, source, index);
            densified.removed += 1;
        }
    }
    let moved = sources.iter().enumerate().filter_map(|(place, source)| source.map(|source| [place as u32, source]));
    densified.moves = moved.collect();
    densified
}

/// Lowers every opacity to at most 0.01.
pub fn reset_opacity(records: &mut [TrainedRecord]) {
    let most = (RESET / (1.0 - RESET)).ln() as f32;
    records.iter_mut().for_each(|record| record.opacity_logit[0] = record.opacity_logit[0].min(most));
}

/// Frees the place of a Gaussian.
fn remove(record: &mut TrainedRecord, source: &mut Option<u32>, place: usize) {
    record.opacity_logit[0] = FREE;
    source.get_or_insert(place as u32);
}

fn opacity(record: &TrainedRecord) -> f64 {
    1.0 / (1.0 + (-f64::from(record.opacity_logit[0])).exp())
}

/// Returns the largest spatial scale.
fn largest(record: &TrainedRecord) -> f64 {
    let [x, y, z] = record.log_scale;
    f64::from(x.max(y).max(z)).exp()
}

/// Returns a Gaussian with smaller scales whose mean is drawn from the 4D Gaussian `parent`.
fn part(parent: &TrainedRecord, random: &mut Random) -> TrainedRecord {
    let unit = |rotation: [f32; 4]| DVec4::from_array(rotation.map(f64::from)).normalize_or(DVec4::X);
    let [x, y, z] = parent.log_scale.map(|scale| f64::from(scale).exp());
    let scale = DVec4::new(x, y, z, f64::from(parent.log_scale_t).exp());
    let [[a, b], [c, d]] = [(); 2].map(|()| random.normal_pair().map(f64::from));
    let offset = rotation_4d(unit(parent.rotation_l), unit(parent.rotation_r)) * (scale * DVec4::new(a, b, c, d));
    let smaller = SMALLER.ln() as f32;
    let [x, y, z] = parent.mean.map(f64::from);
    TrainedRecord {
        mean: [x + offset.x, y + offset.y, z + offset.z].map(|value| value as f32),
        mean_t: (f64::from(parent.mean_t) + offset.w) as f32,
        log_scale: parent.log_scale.map(|scale| scale - smaller),
        log_scale_t: parent.log_scale_t - smaller,
        ..*parent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXTENT: f64 = 4.0;

    /// Returns a Gaussian of this opacity and spatial scale; its place on the x axis names it.
    fn record(opacity: f32, scale: f32, at: f32) -> TrainedRecord {
        TrainedRecord {
            mean: [at, 0.0, 0.0],
            log_scale: [scale.ln(), (0.5 * scale).ln(), (0.1 * scale).ln()],
            log_scale_t: 0.2f32.ln(),
            rotation_l: [1.0, 0.0, 0.0, 0.0],
            rotation_r: [1.0, 0.0, 0.0, 0.0],
            opacity_logit: [(opacity / (1.0 - opacity)).ln(), 0.0, 0.0, 0.0],
            ..TrainedRecord::default()
        }
    }

    fn free() -> TrainedRecord {
        TrainedRecord { opacity_logit: [FREE, 0.0, 0.0, 0.0], ..record(0.5, 0.01, -1.0) }
    }

    #[test]
    fn small_gaussians_are_cloned_and_large_ones_split_where_gradients_are_large() {
        let before = [record(0.5, 0.03, 1.0), free(), record(0.5, 0.2, 2.0), record(0.5, 0.2, 3.0), free(), free()];
        let mut records = before;
        let found = densify(&mut records, &[3e-4, 1.0, 2e-4, 1.9e-4, 0.0, 0.0], EXTENT, false, 5);
        assert_eq!((found.cloned, found.split, found.removed), (1, 1, 0), "one of each");
        assert_eq!(found.moves, [[1, 0], [2, 2], [4, 2]], "the clone and both parts begin without moments");
        assert_eq!(records[1], before[0], "a clone has all parameters of its source");
        assert_eq!([records[0], records[3], records[5]], [before[0], before[3], before[5]], "the others stay");
        for part in [records[2], records[4]] {
            let [scale, scale_t] = [part.log_scale[1], part.log_scale_t].map(f32::exp);
            assert!((scale - 0.1 / 1.6).abs() < 1e-6 && (scale_t - 0.2 / 1.6).abs() < 1e-6, "smaller: {part:?}");
            assert_eq!(part.opacity_logit, before[2].opacity_logit, "of the same opacity");
            assert!(part.mean != before[2].mean && part.mean_t != before[2].mean_t, "elsewhere: {part:?}");
        }
        assert_ne!(records[2].mean, records[4].mean, "each at its own place");
    }

    #[test]
    fn parts_are_drawn_from_the_gaussian_in_space_and_time() {
        // A rotation in the planes of x and t and of y and z.
        let parent = TrainedRecord { rotation_r: [0.8, 0.0, 0.0, 0.6], ..record(0.5, 0.4, 0.0) };
        let unit = |rotation: [f32; 4]| DVec4::from_array(rotation.map(f64::from));
        let scale = DVec4::new(0.4, 0.2, 0.04, 0.2);
        let factor = rotation_4d(unit(parent.rotation_l), unit(parent.rotation_r)) * glam::DMat4::from_diagonal(scale);
        let expected = factor * factor.transpose();
        let mut random = Random::new(3);
        let mut sum = glam::DMat4::ZERO;
        const DRAWN: usize = 20_000;
        for _ in 0..DRAWN {
            let TrainedRecord { mean: [x, y, z], mean_t, .. } = part(&parent, &mut random);
            let at = DVec4::new(x.into(), y.into(), z.into(), mean_t.into());
            sum += glam::DMat4::from_cols(at * at.x, at * at.y, at * at.z, at * at.w) * (1.0 / DRAWN as f64);
        }
        assert!(expected.x_axis.w.abs() > 0.02, "space and time depend on each other: {expected}");
        assert!(sum.abs_diff_eq(expected, 6e-3), "the covariance is {sum}, expected {expected}");
    }

    #[test]
    fn the_largest_gradients_take_the_last_free_places() {
        let mut records: Vec<_> = (0..5).map(|index| record(0.5, 0.01, index as f32)).collect();
        records.push(free());
        records.push(record(0.004, 0.01, 9.0));
        let found = densify(&mut records, &[1e-3, 3e-3, 3e-3, 2e-3, f32::NAN, 0.0, 1.0], EXTENT, false, 5);
        assert_eq!((found.cloned, found.removed), (2, 1), "one place was free, one Gaussian is removed first");
        assert_eq!(found.moves, [[5, 1], [6, 2]], "of equal gradients the first");
        let full = densify(&mut records, &[1.0; 7], EXTENT, false, 5);
        assert_eq!(full, Densified::default(), "nothing grows when all places are taken");
        let mut all = vec![record(0.5, 0.01, 0.0), free()];
        assert_eq!(densify(&mut all, &[], EXTENT, false, 5), Densified::default(), "nothing grows without gradients");
    }

    #[test]
    fn faint_and_large_gaussians_are_removed() {
        let before = [record(0.004, 0.01, 1.0), record(0.006, 0.01, 2.0), record(0.5, 0.41, 3.0), free()];
        let mut records = before;
        let found = densify(&mut records, &[0.0; 4], EXTENT, false, 5);
        assert_eq!((found.removed, found.moves), (1, vec![[0, 0]]), "the faint one, without moments");
        assert!(is_free(&records[0]) && records[1..] == before[1..], "its place is free");
        let found = densify(&mut records, &[0.0; 4], EXTENT, true, 5);
        assert_eq!((found.removed, found.moves), (1, vec![[2, 2]]), "the large one, later on");
        assert_eq!(records.map(|record| is_free(&record)), [true, false, true, true], "places that are free now");
    }

    #[test]
    fn a_reset_lowers_opacities_and_fills_no_place() {
        let mut records = [record(0.9, 0.01, 0.0), record(0.007, 0.01, 1.0), free()];
        let before = records;
        reset_opacity(&mut records);
        assert!((opacity(&records[0]) - 0.01).abs() < 1e-6, "at most 0.01: {}", opacity(&records[0]));
        assert_eq!(records[1..], before[1..], "others stay");
    }
}
