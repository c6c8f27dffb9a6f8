//! Gaussians that cannot be drawn, which files of trainers have now and then: other players draw the rest of the file.
//!
//! In: decoded [`Columns`]. Out: the columns without them, and a sentence that says how many they were; limits in place
//! of infinite logits and scales.

use super::columns::{Columns, logit};
use crate::gaussian::Harmonics;
use rayon::prelude::*;

/// The logarithm of a scale of 0: far below a pixel in any unit.
const POINT: f32 = -30.0;
/// The logarithm of the largest scale, with which covariances, sums of squares, are finite in single precision.
const LARGEST: f32 = 40.0;

/// Removes the Gaussians that cannot be drawn, and returns a sentence about them if there are any. Opacities of 0 and 1
/// and scales of 0, which have no finite logit and logarithm, become the nearest ones that have.
pub(crate) fn keep_drawable(columns: &mut Columns) -> Option<String> {
    keep_drawable_and(columns, |_| {})
}

/// As [`keep_drawable`]; `others` receives the indices of the Gaussians that stay, to remove the same ones elsewhere.
pub(crate) fn keep_drawable_and(columns: &mut Columns, others: impl FnOnce(&[usize])) -> Option<String> {
    columns.opacity_logit.par_iter_mut().for_each(|value| {
        if value.is_infinite() {
            *value = logit(if *value > 0.0 { 1.0 } else { 0.0 });
        }
    });
    columns.log_scale.par_iter_mut().flatten().for_each(|value| {
        if *value == f32::NEG_INFINITY {
            *value = POINT;
        }
    });
    let all = columns.len();
    let is_drawable = |&index: &usize| {
        let finite = |values: &[f32]| values.iter().all(|value| value.is_finite());
        finite(&columns.mean[index])
            && finite(&columns.log_scale[index])
            && columns.log_scale[index].iter().all(|&scale| scale <= LARGEST)
            && columns.opacity_logit[index].is_finite()
            && is_direction(columns.rotation[index])
            && finite(columns.harmonics.of(index))
            && columns
                .motion
                .get(index)
                .is_none_or(|motion| finite(&motion.velocity) && motion.mean_t.is_finite() && motion.sigma_t > 0.0)
    };
    // Usually none is removed, and nothing is copied.
    if (0..all).into_par_iter().all(|index| is_drawable(&index)) {
        return None;
    }
    let kept: Vec<usize> = (0..all).into_par_iter().filter(is_drawable).collect();
    keep(columns, &kept);
    others(&kept);
    let removed = all - kept.len();
    Some(format!(
        "{removed} of {all} Gaussians have values that cannot be drawn (not finite, or no rotation); they are left out."
    ))
}

/// Keeps the Gaussians with these indices, and removes the others.
pub(crate) fn keep(columns: &mut Columns, kept: &[usize]) {
    columns.mean = select(&columns.mean, kept);
    columns.log_scale = select(&columns.log_scale, kept);
    columns.rotation = select(&columns.rotation, kept);
    columns.opacity_logit = select(&columns.opacity_logit, kept);
    if !columns.motion.is_empty() {
        columns.motion = select(&columns.motion, kept);
    }
    if let Some(filter) = &columns.filter {
        let kept: Vec<u32> = kept.iter().map(|&index| index as u32).collect();
        columns.filter = Some(filter.select(&kept));
    }
    let values = kept.par_iter().flat_map_iter(|&index| columns.harmonics.of(index).iter().copied()).collect();
    columns.harmonics = Harmonics { values, ..columns.harmonics };
}

fn is_direction(quaternion: [f32; 4]) -> bool {
    let squared: f64 = quaternion.iter().map(|&component| f64::from(component).powi(2)).sum();
    squared.is_finite() && squared > 1e-20
}

fn select<T: Copy + Send + Sync>(from: &[T], kept: &[usize]) -> Vec<T> {
    kept.par_iter().map(|&index| from[index]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussians_that_cannot_be_drawn_are_left_out_and_counted() {
        let mut columns = Columns {
            mean: vec![[0.0; 3], [1.0, f32::NAN, 0.0], [2.0; 3], [3.0; 3], [4.0; 3]],
            log_scale: vec![[-1.0; 3], [-1.0; 3], [f32::NEG_INFINITY, -1.0, -1.0], [-1.0; 3], [f32::INFINITY; 3]],
            rotation: vec![[1.0, 0.0, 0.0, 0.0], [1.0; 4], [1.0; 4], [0.0; 4], [1.0; 4]],
            opacity_logit: vec![f32::INFINITY, 0.0, f32::NEG_INFINITY, 0.0, 0.0],
            harmonics: Harmonics {
                coefficients: 1,
                degree: 0,
                degree_t: 0,
                values: (0..15).map(|i| i as f32).collect(),
            },
            ..Columns::default()
        };
        let lost = keep_drawable(&mut columns).expect("three are removed");
        assert!(lost.starts_with("3 of 5 Gaussians"), "they are counted: {lost}");
        assert_eq!(columns.mean, [[0.0; 3], [2.0; 3]], "the others stay in order");
        assert_eq!(columns.harmonics.values, [0.0, 1.0, 2.0, 6.0, 7.0, 8.0], "with their colors");
        assert!(columns.opacity_logit[0] > 15.0 && columns.opacity_logit[1] < -15.0, "opaque and invisible");
        assert_eq!(columns.log_scale[1], [POINT, -1.0, -1.0], "a scale of 0");
        let before = columns.clone();
        assert_eq!((keep_drawable(&mut columns), columns), (None, before), "nothing is removed a second time");
    }
}
