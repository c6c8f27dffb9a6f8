//! The search for the smallest number of Gaussians within a loss of PSNR.
//!
//! In: the number of all Gaussians, the least PSNR, a function that measures the PSNR of a number. Out: the smallest
//! number, and every number tried ([`Trial`]).

use serde::Serialize;

/// A number of Gaussians that was tried.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Trial {
    /// Number of Gaussians kept.
    pub count: usize,
    /// PSNR, dB.
    pub psnr: f64,
}

/// Returns the smallest count, up to `total`, whose PSNR is at or above `floor`, and every count tried, in order.
/// Bisects to within `tolerance`, or one Gaussian; `total` itself is assumed to reach `floor`.
///
/// # Errors
/// Those of `measure`, which returns the PSNR of a count.
pub fn smallest_count<E>(
    total: usize,
    tolerance: usize,
    floor: f64,
    mut measure: impl FnMut(usize) -> Result<f64, E>,
) -> Result<(usize, Vec<Trial>), E> {
    let (mut too_few, mut enough) = (0, total);
    let mut trials = Vec::new();
    while enough - too_few > tolerance.max(1) {
        let count = too_few + (enough - too_few) / 2;
        let psnr = measure(count)?;
        trials.push(Trial { count, psnr });
        if psnr >= floor {
            enough = count;
        } else {
            too_few = count;
        }
    }
    Ok((enough, trials))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    #[test]
    fn the_search_ends_just_above_the_smallest_count() {
        for wanted in [1, 2, 37, 500, 801, 1000] {
            let psnr = |count: usize| Ok::<_, Infallible>(if count >= wanted { 30.0 } else { 29.0 });
            let (found, trials) = smallest_count(1000, 2, 29.5, psnr).expect("cannot fail");
            assert!((wanted..=wanted + 2).contains(&found), "{found} for {wanted}");
            assert!(trials.len() <= 10, "bisection takes at most 10 trials: {trials:?}");
        }
        let (all, _) = smallest_count(1000, 2, 31.0, |_| Ok::<_, Infallible>(30.0)).expect("cannot fail");
        assert_eq!(all, 1000, "every Gaussian is needed");
    }
}
