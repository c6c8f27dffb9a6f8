//! A palette of coefficients of degree 1 and above.
//!
//! In: a row of numbers for each Gaussian. Out: [`Palette`]: rows that stand for similar ones, and the label of each
//! Gaussian. The rows are divided in two where they differ most until there are enough parts, then each row moves to
//! the nearest part among its neighbors in that order. The time is that of sorting, unlike that of k-means over all
//! pairs, and the same rows always give the same palette.

use rayon::prelude::*;

/// Largest number of rows of a palette: labels have 16 bits.
const MOST: usize = 1 << 16;
/// Parts on either side of the part of a row that are searched for a nearer one, and the number of such passes.
const NEIGHBORS: usize = 16;
const STEPS: usize = 3;
/// Rows that are divided by one thread.
const ALONE: usize = 4096;

/// Rows, and a label for each Gaussian.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Palette {
    pub rows: Vec<f32>,
    pub labels: Vec<u16>,
}

/// Rows with their mean and the sum of their squared distances to it.
struct Part<'i> {
    members: &'i mut [u32],
    mean: Vec<f64>,
    /// For each column.
    spread: Vec<f64>,
}

impl Palette {
    /// Returns the palette of rows of `width` numbers; that of few Gaussians has them all.
    pub(super) fn of(values: &[f32], width: usize) -> Self {
        Self::with(values, width, MOST)
    }

    /// Returns a palette of at most `most` rows.
    fn with(values: &[f32], width: usize, most: usize) -> Self {
        let count = values.len() / width.max(1);
        let mut members: Vec<u32> = (0..count as u32).collect();
        let mut lengths = Vec::new();
        if count > 0 {
            lengths = Part::of(values, width, &mut members).divided(values, width, most.min(count));
        }
        let mut labels = vec![0; count];
        let mut rest = &members[..];
        for (label, &length) in lengths.iter().enumerate() {
            let (own, others) = rest.split_at(length);
            for &member in own {
                labels[member as usize] = label as u16;
            }
            rest = others;
        }
        let mut rows = means(values, width, &labels, vec![0.0; lengths.len() * width]);
        for _ in 0..STEPS {
            let moved: Vec<u16> =
                values.par_chunks_exact(width).zip(&labels).map(|(row, &label)| nearest(row, label, &rows)).collect();
            if moved == labels {
                break;
            }
            labels = moved;
            rows = means(values, width, &labels, rows);
        }
        Self { rows, labels }
    }
}

impl<'i> Part<'i> {
    fn of(values: &[f32], width: usize, members: &'i mut [u32]) -> Self {
        let (mut sums, mut squares) = (vec![0.0; width], vec![0.0; width]);
        for &member in &*members {
            let row = &values[member as usize * width..][..width];
            for ((sum, square), &value) in sums.iter_mut().zip(&mut squares).zip(row) {
                *sum += f64::from(value);
                *square += f64::from(value) * f64::from(value);
            }
        }
        let count = members.len() as f64;
        let mean: Vec<f64> = sums.iter().map(|sum| sum / count).collect();
        let spread = squares.iter().zip(&mean).map(|(square, mean)| (square - mean * mean * count).max(0.0)).collect();
        Self { members, mean, spread }
    }

    /// Divides the rows into at most `parts` parts, puts the members of each together, and returns their lengths.
    fn divided(self, values: &[f32], width: usize, parts: usize) -> Vec<usize> {
        let widest =
            (1..width).fold(0, |most, column| if self.spread[column] > self.spread[most] { column } else { most });
        let all = self.members.len();
        if parts < 2 || all < 2 || self.spread[widest] == 0.0 {
            return vec![all];
        }
        let above = |member: u32| f64::from(values[member as usize * width + widest]) > self.mean[widest];
        let (low, high): (Vec<u32>, Vec<u32>) = self.members.iter().partition(|&&member| !above(member));
        let middle = low.len();
        for (place, member) in self.members.iter_mut().zip(low.into_iter().chain(high)) {
            *place = member;
        }
        if middle == 0 || middle == all {
            return vec![all];
        }
        let (low, high) = self.members.split_at_mut(middle);
        let [low, high] = [low, high].map(|members| Part::of(values, width, members));
        let [low_error, high_error] = [&low, &high].map(|part| part.spread.iter().sum::<f64>());
        let share = if low_error + high_error > 0.0 { low_error / (low_error + high_error) } else { 0.5 };
        // Each has at least one part, and at most as many as rows.
        let least = parts.saturating_sub(all - middle).max(1);
        let most = middle.min(parts - 1).max(least);
        let low_parts = ((parts as f64 * share).round() as usize).clamp(least, most);
        let divide_low = || low.divided(values, width, low_parts);
        let divide_high = || high.divided(values, width, parts - low_parts);
        let (mut lengths, others) =
            if all > ALONE { rayon::join(divide_low, divide_high) } else { (divide_low(), divide_high()) };
        lengths.extend(others);
        lengths
    }
}

/// Returns the label, among that given and its neighbors, of the row nearest to a row.
fn nearest(row: &[f32], label: u16, rows: &[f32]) -> u16 {
    let count = rows.len() / row.len();
    let first = usize::from(label).saturating_sub(NEIGHBORS);
    let end = (usize::from(label) + NEIGHBORS + 1).min(count);
    let distance = |other: usize| {
        let other = &rows[other * row.len()..][..row.len()];
        row.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum::<f32>()
    };
    let mut best = (distance(usize::from(label)), label);
    for other in first..end {
        let found = distance(other);
        if found < best.0 {
            best = (found, other as u16);
        }
    }
    best.1
}

/// Returns the mean of the rows with each label; that of `before` for labels without rows.
fn means(values: &[f32], width: usize, labels: &[u16], before: Vec<f32>) -> Vec<f32> {
    let mut sums = vec![0.0; before.len()];
    let mut counts = vec![0u32; before.len() / width];
    for (row, &label) in values.chunks_exact(width).zip(labels) {
        counts[usize::from(label)] += 1;
        for (sum, &value) in sums[usize::from(label) * width..][..width].iter_mut().zip(row) {
            *sum += f64::from(value);
        }
    }
    let mut rows = before;
    for ((row, sums), &count) in rows.chunks_exact_mut(width).zip(sums.chunks_exact(width)).zip(&counts) {
        if count > 0 {
            for (value, sum) in row.iter_mut().zip(sums) {
                *value = (sum / f64::from(count)) as f32;
            }
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random::Random;

    #[test]
    fn few_rows_are_all_in_the_palette() {
        let values: Vec<f32> = (0..300 * 9).map(|i| (i as f32 * 0.7).sin()).collect();
        let Palette { rows, labels } = Palette::of(&values, 9);
        assert_eq!(rows.len(), values.len(), "as many rows as Gaussians");
        for (row, &label) in values.chunks(9).zip(&labels) {
            assert_eq!(rows[usize::from(label) * 9..][..9], *row, "a row of its own");
        }
        assert_eq!(Palette::of(&[1.0; 900], 9).rows, [1.0; 9], "equal rows are one");
        assert!(Palette::of(&[], 9).labels.is_empty(), "no rows");
    }

    #[test]
    fn rows_around_a_few_centers_get_these_centers() {
        let mut random = Random::new(3);
        let mut number = |size: f32| (random.unit() - 0.5) * size;
        let centers: Vec<f32> = (0..500 * 24).map(|_| number(1.0)).collect();
        let values: Vec<f32> = (0..20_000)
            .flat_map(|i| centers[i % 500 * 24..][..24].to_vec())
            .map(|center| center + number(0.01))
            .collect();
        let Palette { rows, labels } = Palette::with(&values, 24, 2000);
        assert!(rows.len() <= 2000 * 24, "{} numbers", rows.len());
        let error = |(row, &label): (&[f32], &u16)| {
            let squares = row.iter().zip(&rows[usize::from(label) * 24..]).map(|(a, b)| f64::from(a - b).powi(2));
            (squares.sum::<f64>() / 24.0).sqrt()
        };
        let errors: Vec<f64> = values.chunks(24).zip(&labels).map(error).collect();
        // The nearest part of a row can be too far away in the order to be found.
        let (near, far): (Vec<f64>, Vec<f64>) = errors.into_iter().partition(|&error| error < 0.1);
        assert!(far.len() <= 20, "{} of 20,000 rows have the center of others", far.len());
        let mean = (near.iter().map(|error| error * error).sum::<f64>() / near.len() as f64).sqrt();
        assert!(mean < 0.003, "the noise alone has 0.0029: {mean}");
        assert_eq!(Palette::with(&values, 24, 2000), Palette { rows, labels }, "the same palette each time");
    }
}
