//! Offsets of clocks, from differences between pairs of cameras.
//!
//! In: for pairs of cameras, how much later the same event is in one than in the other. Out: the [`Offset`] of each
//! camera to the median of all: the least squares over the pairs that agree with each other. A wrong pair is found
//! since the pairs of three cameras must add up; of two cameras alone, the pair is believed.

/// Most cameras of which all pairs are compared. Of more, cameras whose places differ by a power of two are.
const ALL: usize = 16;
/// Rounds of reweighting. Wrong pairs of whole seconds cease to move the others by a millisecond after about 20.
const ROUNDS: usize = 40;
/// Part of the tolerance below which errors are all alike.
const ALIKE: f64 = 1.0 / 15.0;
/// Number of compared pairs from which a camera needs two that agree: any offset fits one pair.
const SEVERAL: usize = 3;

/// The difference between the clocks of two cameras.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pair {
    /// The cameras.
    pub a: usize,
    pub b: usize,
    /// Time of an event by `b`, less its time by `a`.
    pub seconds: f64,
    /// Trust, above 0.
    pub weight: f64,
}

impl Pair {
    /// Returns whether the pair is of two of so many cameras, and has numbers that can be used.
    fn is_usable(&self, count: usize) -> bool {
        let is_weighed = self.weight > 0.0 && self.weight.is_finite();
        self.a != self.b && self.a.max(self.b) < count && self.seconds.is_finite() && is_weighed
    }

    /// Returns the absolute difference from these offsets.
    fn error(&self, offsets: &[f64]) -> f64 {
        (offsets[self.b] - offsets[self.a] - self.seconds).abs()
    }
}

/// The offset of the clock of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Offset {
    /// How late the clock is against the median of all, in the unit of the pairs. To be subtracted from the times of
    /// the frames.
    pub seconds: f64,
    /// Root of the mean squared error of the pairs of the camera that are trusted.
    pub residual: f64,
}

/// Returns the pairs of cameras to compare: all, or so many that all cameras hang together in many ways.
pub(crate) fn compared(count: usize) -> Vec<(usize, usize)> {
    let of = |a: usize| {
        let is_compared = move |b: &usize| count <= ALL || (b - a).is_power_of_two();
        (a + 1..count).filter(is_compared).map(move |b| (a, b))
    };
    (0..count).flat_map(of).collect()
}

/// Returns the offset of each camera; `None` for a camera that no trusted pair connects with the largest group of
/// cameras. Pairs are trusted whose error is at most `tolerance`. Takes the cube of the number of cameras.
pub(crate) fn offsets(count: usize, pairs: &[Pair], tolerance: f64) -> Vec<Option<Offset>> {
    let pairs: Vec<Pair> = pairs.iter().filter(|pair| pair.is_usable(count)).copied().collect();
    let trusted = trusted(count, &pairs, tolerance);
    let groups = groups(count, &trusted);
    let mut sizes = vec![0_usize; count];
    groups.iter().for_each(|&group| sizes[group] += 1);
    // The first of the largest groups.
    let Some(largest) = (0..count).rev().max_by_key(|&group| sizes[group]).filter(|&group| sizes[group] > 1) else {
        return vec![None; count];
    };
    let solved = least_squares(count, &trusted);
    let is_inside = |camera: &usize| groups[*camera] == largest;
    let zero = median((0..count).filter(is_inside).map(|camera| solved[camera]).collect());
    let offset = |camera| Offset { seconds: solved[camera] - zero, residual: residual(camera, &trusted, &solved) };
    (0..count).map(|camera| is_inside(&camera).then(|| offset(camera))).collect()
}

/// Returns the pairs that agree with each other: those near the offsets of the least sum of absolute errors.
fn trusted(count: usize, pairs: &[Pair], tolerance: f64) -> Vec<Pair> {
    let mut solved = least_squares(count, pairs);
    for _ in 0..ROUNDS {
        let reweighted = |pair: &Pair| {
            let weight = pair.weight * tolerance / pair.error(&solved).max(tolerance * ALIKE);
            Pair { weight, ..*pair }
        };
        solved = least_squares(count, &pairs.iter().map(reweighted).collect::<Vec<_>>());
    }
    let close: Vec<Pair> = pairs.iter().filter(|pair| pair.error(&solved) <= tolerance).copied().collect();
    let (all, kept) = (degrees(count, pairs), degrees(count, &close));
    let is_supported = |camera: usize| all[camera] < SEVERAL || kept[camera] > 1;
    close.into_iter().filter(|pair| is_supported(pair.a) && is_supported(pair.b)).collect()
}

/// Returns the number of pairs of each camera.
fn degrees(count: usize, pairs: &[Pair]) -> Vec<usize> {
    let mut degrees = vec![0; count];
    pairs.iter().flat_map(|pair| [pair.a, pair.b]).for_each(|camera| degrees[camera] += 1);
    degrees
}

/// Returns the root of the mean squared error of the pairs of a camera.
fn residual(camera: usize, pairs: &[Pair], offsets: &[f64]) -> f64 {
    let own = pairs.iter().filter(|pair| pair.a == camera || pair.b == camera);
    let (sum, count) = own.fold((0.0, 0.0), |(sum, count), pair| (sum + pair.error(offsets).powi(2), count + 1.0));
    (sum / f64::max(count, 1.0)).sqrt()
}

/// Returns the first camera of the group of each camera. Pairs connect cameras to groups.
fn groups(count: usize, pairs: &[Pair]) -> Vec<usize> {
    let mut groups: Vec<usize> = (0..count).collect();
    for pair in pairs {
        let (a, b) = (groups[pair.a], groups[pair.b]);
        if a != b {
            groups.iter_mut().filter(|group| **group == a.max(b)).for_each(|group| *group = a.min(b));
        }
    }
    groups
}

/// Returns the offsets of the least weighted sum of squared errors. The first camera of each group is at 0.
fn least_squares(count: usize, pairs: &[Pair]) -> Vec<f64> {
    let (mut matrix, mut right) = (vec![0.0; count * count], vec![0.0; count]);
    for &Pair { a, b, seconds, weight } in pairs {
        matrix[a * count + a] += weight;
        matrix[b * count + b] += weight;
        matrix[a * count + b] -= weight;
        matrix[b * count + a] -= weight;
        right[b] += weight * seconds;
        right[a] -= weight * seconds;
    }
    // Pairs leave the sum of a group free.
    for (camera, _) in groups(count, pairs).into_iter().enumerate().filter(|(camera, group)| camera == group) {
        matrix[camera * count + camera] += 1.0;
    }
    solve(&mut matrix, &mut right);
    right
}

/// Solves a system with a symmetric, positive definite matrix (rows one after the other), by its Cholesky factor, which
/// takes the place of the lower triangle. The solution takes the place of the right side.
fn solve(matrix: &mut [f64], right: &mut [f64]) {
    let count = right.len();
    for row in 0..count {
        let (above, own) = matrix.split_at_mut(row * count);
        for column in 0..row {
            let other = &above[column * count..][..=column];
            let sum: f64 = own[..column].iter().zip(other).map(|(a, b)| a * b).sum();
            own[column] = (own[column] - sum) / other[column];
        }
        let sum: f64 = own[..row].iter().map(|value| value * value).sum();
        own[row] = (own[row] - sum).max(f64::MIN_POSITIVE).sqrt();
    }
    for row in 0..count {
        let sum: f64 = (0..row).map(|column| matrix[row * count + column] * right[column]).sum();
        right[row] = (right[row] - sum) / matrix[row * count + row];
    }
    for row in (0..count).rev() {
        let sum: f64 = (row + 1..count).map(|below| matrix[below * count + row] * right[below]).sum();
        right[row] = (right[row] - sum) / matrix[row * count + row];
    }
}

/// Returns the median, of two in the middle their mean; 0 of nothing.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let (low, high) = (values.len().saturating_sub(1) / 2, values.len() / 2);
    values.get(low).zip(values.get(high)).map_or(0.0, |(a, b)| a.midpoint(*b))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns all pairs of cameras with these offsets.
    fn pairs(truth: &[f64]) -> Vec<Pair> {
        let pair = |(a, b)| Pair { a, b, seconds: truth[b] - truth[a], weight: 1.0 + (a + b) as f64 };
        compared(truth.len()).into_iter().map(pair).collect()
    }

    #[test]
    fn wrong_pairs_are_dropped() {
        let truth = [0.0, 0.25, -0.5, 1.0, 0.0];
        let mut pairs = pairs(&truth);
        // One of the four pairs of cameras 0 and 1, and of 2 and 3.
        pairs[0].seconds += 7.0;
        pairs[7].seconds -= 0.1;
        for (found, truth) in offsets(5, &pairs, 0.005).iter().zip(truth) {
            let found = found.expect("all cameras are connected");
            assert!((found.seconds - truth).abs() < 1e-9, "{found:?}, not {truth}");
            assert!(found.residual < 1e-9, "what is left agrees: {found:?}");
        }
    }

    #[test]
    fn a_camera_without_agreeing_pairs_has_no_offset() {
        let mut all = pairs(&[0.0, 0.1, 0.0, 0.0, 0.0, 0.0]);
        all.retain(|pair| pair.b != 5);
        for (index, pair) in all.iter_mut().filter(|pair| pair.b == 4).enumerate() {
            pair.seconds += (index * index) as f64 - 1.5;
        }
        let found = offsets(6, &all, 0.005);
        assert_eq!(found[4], None, "its pairs contradict each other");
        assert_eq!(found[5], None, "it has no pair");
        let late = found[1].expect("connected").seconds;
        assert!((late - 0.1).abs() < 1e-9, "the others are not disturbed: {late}");
    }

    #[test]
    fn residuals_tell_how_well_pairs_agree() {
        let mut pairs = pairs(&[0.0; 3]);
        pairs.iter_mut().for_each(|pair| pair.weight = 1.0);
        pairs[1].seconds = 0.003;
        let found = offsets(3, &pairs, 0.005)[0].expect("connected");
        // A contradiction of 3 ms is shared by three pairs.
        assert!((found.residual - 0.001).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn many_cameras_are_compared_with_few_and_hang_together() {
        let truth: Vec<f64> = (0..40).map(|camera| f64::from(camera) * 0.01 - 0.195).collect();
        let pairs = pairs(&truth);
        assert!(pairs.len() < 40 * 6, "{} pairs", pairs.len());
        for (found, truth) in offsets(40, &pairs, 0.005).iter().zip(truth) {
            let found = found.expect("all cameras are connected").seconds;
            assert!((found - truth).abs() < 1e-9, "{found}, not {truth}");
        }
    }

    #[test]
    fn nothing_compared_gives_no_offsets() {
        let wrong = Pair { a: 0, b: 9, seconds: f64::NAN, weight: 1.0 };
        assert_eq!(offsets(2, &[wrong], 0.005), [None, None], "a pair of no use");
        assert!(offsets(0, &[], 0.005).is_empty(), "no cameras");
    }
}
