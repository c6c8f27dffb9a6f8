//! The point that several cameras look at.
//!
//! In: the places and the directions of cameras. Out: the point that is closest to the axes of all of them.

use crate::gaussian::outer::outer;
use glam::{DMat3, DVec3};

/// Returns the point that is closest to the axes of all cameras, which are given by a place and a direction of length
/// 1; `None` if the axes are nearly parallel: if the determinant of the mean of the projections across them is not
/// above `parallel`.
pub(crate) fn closest(rays: impl Iterator<Item = (DVec3, DVec3)>, parallel: f64) -> Option<DVec3> {
    let (mut sum, mut at, mut count) = (DMat3::ZERO, DVec3::ZERO, 0.0_f64);
    for (origin, direction) in rays {
        let across = DMat3::IDENTITY - outer(direction, direction);
        sum += across;
        at += across * origin;
        count += 1.0;
    }
    ((sum * count.max(1.0).recip()).determinant() > parallel).then(|| sum.inverse() * at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_that_cross_have_their_crossing_and_parallel_ones_no_point() {
        let at = DVec3::new(1.0, -2.0, 0.5);
        let toward = |origin: DVec3| (origin, (at - origin).normalize());
        let found = closest([DVec3::X * 4.0, DVec3::Y, DVec3::Z * 3.0].into_iter().map(toward), 1e-3);
        assert!(found.is_some_and(|found| found.distance(at) < 1e-9), "{found:?} is {at}");
        let parallel = [0.0, 1.0, 2.0].map(|x| (DVec3::X * x, DVec3::Z));
        assert_eq!(closest(parallel.into_iter(), 1e-3), None, "parallel axes");
        assert_eq!(closest(std::iter::empty(), 1e-3), None, "no cameras");
    }
}
