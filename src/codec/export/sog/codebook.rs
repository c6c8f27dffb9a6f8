//! Codebooks of 256 numbers.
//!
//! In: numbers. Out: a [`Codebook`] with a small mean square error, by Lloyd's method from entries at even steps of the
//! cube root of the density, which is the best start for many entries; and the code of each number. The same numbers
//! always give the same codebook.

use rayon::prelude::*;

/// Entries of a codebook.
const ENTRIES: usize = 256;
/// Most bins of the density, and fewest numbers in one.
const BINS: usize = 1024;
const IN_A_BIN: usize = 8;
const STEPS: usize = 64;

/// Entries in ascending order.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Codebook {
    /// At most 256.
    entries: Vec<f32>,
}

impl Codebook {
    /// Returns a codebook for finite numbers.
    pub(super) fn of(numbers: impl IntoParallelIterator<Item = f32>) -> Self {
        let mut sorted: Vec<f32> = numbers.into_par_iter().collect();
        sorted.par_sort_unstable_by(f32::total_cmp);
        let mut distinct = sorted.clone();
        distinct.dedup();
        if distinct.len() <= ENTRIES {
            return Self { entries: distinct };
        }
        // Sums of the numbers before each.
        let mut sum = 0.0;
        let mut before = vec![0.0];
        before.extend(sorted.iter().map(|&number| {
            sum += f64::from(number);
            sum
        }));
        let mut entries = by_density(&sorted);
        for _ in 0..STEPS {
            let mut first = 0;
            let mut next = entries.clone();
            for index in 0..entries.len() {
                let end = entries.get(index + 1).map_or(sorted.len(), |above| {
                    let middle = f64::midpoint(entries[index], *above);
                    sorted.partition_point(|&number| f64::from(number) <= middle)
                });
                // An entry without numbers stays.
                if end > first {
                    next[index] = (before[end] - before[first]) / (end - first) as f64;
                    first = end;
                }
            }
            if next == entries {
                break;
            }
            entries = next;
        }
        Self { entries: entries.into_iter().map(|entry| entry as f32).collect() }
    }

    /// Returns the code of the entry nearest to a number.
    pub(super) fn code(&self, number: f32) -> u8 {
        let above = self.entries.partition_point(|&entry| entry < number).min(self.entries.len().saturating_sub(1));
        let below = above.saturating_sub(1);
        let distance = |index: usize| (f64::from(self.at(index as u8)) - f64::from(number)).abs();
        (if distance(below) <= distance(above) { below } else { above }) as u8
    }

    /// Returns the entry of a code; 0 beyond the last one.
    pub(super) fn at(&self, code: u8) -> f32 {
        self.entries.get(usize::from(code)).copied().unwrap_or_default()
    }

    /// Returns 256 entries: players expect as many, so the last one is repeated.
    pub(super) fn entries(&self) -> Vec<f32> {
        let last = self.entries.last().copied().unwrap_or_default();
        let mut entries = self.entries.clone();
        entries.resize(ENTRIES, last);
        entries
    }
}

/// Returns entries at even steps of the cube root of the density of more than 256 numbers in ascending order.
fn by_density(sorted: &[f32]) -> Vec<f64> {
    let bins = (sorted.len() / IN_A_BIN).min(BINS);
    let bound = |bin: usize| f64::from(sorted[bin * (sorted.len() - 1) / bins]);
    // Bins of as many numbers each: the density is the inverse of the width.
    let share = |bin: usize| (bound(bin + 1) - bound(bin)).powf(2.0 / 3.0);
    let step = (0..bins).map(share).sum::<f64>() / ENTRIES as f64;
    let (mut entries, mut passed) = (Vec::with_capacity(ENTRIES), 0.0);
    for bin in 0..bins {
        let share = share(bin);
        let next = |entries: &[f64]| step * (entries.len() as f64 + 0.5);
        while share > 0.0 && passed + share >= next(&entries) && entries.len() < ENTRIES {
            let part = (next(&entries) - passed) / share;
            entries.push(bound(bin) + (bound(bin + 1) - bound(bin)) * part);
        }
        passed += share;
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_to_256_distinct_numbers_are_kept() {
        let book = Codebook::of((0..1000).map(|i| (i % 200) as f32 * 0.3).collect::<Vec<_>>());
        for i in 0..200 {
            let number = i as f32 * 0.3;
            assert_eq!(book.at(book.code(number)), number, "an entry of its own");
        }
        assert_eq!(book.entries().len(), 256, "players expect 256 entries");
        let empty = Codebook::of(Vec::new());
        assert_eq!((empty.code(3.0), empty.at(0)), (0, 0.0), "no numbers, no entries");
    }

    #[test]
    fn the_code_is_that_of_the_nearest_entry() {
        let book = Codebook::of((0..5000).map(|i| (i as f32 * 0.01).sin() * i as f32).collect::<Vec<_>>());
        let entries = book.entries();
        assert!(entries.is_sorted(), "ascending");
        for i in 0..1000 {
            let number = (i as f32 - 500.0) * 11.0;
            let nearest = entries.iter().map(|entry| (entry - number).abs()).fold(f32::INFINITY, f32::min);
            assert_eq!((book.at(book.code(number)) - number).abs(), nearest, "the nearest to {number}");
        }
    }

    #[test]
    fn the_error_is_that_of_the_best_codebook_for_a_known_density() {
        // Quantiles of the normal distribution by the logistic one, whose density is alike.
        let numbers: Vec<f32> = (1..40_000).map(|i| (i as f32 / 40_000.0 / (1.0 - i as f32 / 40_000.0)).ln()).collect();
        let book = Codebook::of(numbers.clone());
        let error: f64 =
            numbers.iter().map(|&number| f64::from(book.at(book.code(number)) - number).powi(2)).sum::<f64>()
                / numbers.len() as f64;
        // Panter and Dite: (∫ p^(1/3))³ / (12 n²), with ∫ p^(1/3) = Γ(1/3)² / Γ(2/3) = 5.2999 for the logistic density.
        let best = 5.2999_f64.powi(3) / (12.0 * 256.0 * 256.0);
        assert!(error < 1.1 * best, "the mean square error is {error}, the best is about {best}");
    }
}
