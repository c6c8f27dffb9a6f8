//! Sums in twice the precision of a float64.
//!
//! In: numbers that are not negative, in any order, or sums of them. Out: their sum. It is rounded to a float64 once,
//! at the end, so that it does not depend on how the numbers are divided into shards, unless it is closer than about
//! 2⁻¹⁰⁰ of its size to the middle between two float64.

/// A sum: `sum` is the rounded total, and `rest` the error of the rounding. Default: of no numbers.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Total {
    sum: f64,
    rest: f64,
}

impl Total {
    /// Adds a number.
    pub(super) fn add(&mut self, value: f64) {
        self.merge(Self { sum: value, rest: 0.0 });
    }

    /// Adds the numbers of another sum.
    pub(super) fn merge(&mut self, other: Self) {
        let sum = self.sum + other.sum;
        // The exact difference between the sum and its rounded value (Knuth).
        let added = sum - self.sum;
        let error = (self.sum - (sum - added)) + (other.sum - added);
        let rest = error + (self.rest + other.rest);
        let total = sum + rest;
        *self = Self { sum: total, rest: rest - (total - sum) };
        if !self.rest.is_finite() {
            *self = Self { sum, rest: 0.0 };
        }
    }

    /// Returns the sum.
    pub(super) fn value(self) -> f64 {
        self.sum
    }

    /// Returns the sum in two numbers.
    pub(super) fn parts(self) -> [f64; 2] {
        [self.sum, self.rest]
    }

    /// Returns the sum of [`parts`](Self::parts).
    pub(super) fn of_parts([sum, rest]: [f64; 2]) -> Self {
        Self { sum, rest }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_does_not_depend_on_its_division() {
        // Numbers of very different sizes with all bits in use.
        let number = |k: u64| {
            (1.0 + (k.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 12) as f64 * 2f64.powi(-52)) * 2f64.powi(k as i32 % 60)
        };
        let numbers: Vec<f64> = (0..1000).map(number).collect();
        let of = |numbers: &[f64]| {
            numbers.iter().fold(Total::default(), |mut total, &value| {
                total.add(value);
                total
            })
        };
        let whole = of(&numbers).value();
        let plain: f64 = numbers.iter().sum();
        assert!((whole / plain - 1.0).abs() < 1e-12, "the sum is that of all numbers: {whole} and {plain}");
        for share in [1, 3, 10, 333, 999] {
            let mut total = Total::default();
            numbers.chunks(share).for_each(|numbers| total.merge(of(numbers)));
            assert_eq!(total.value().to_bits(), whole.to_bits(), "shares of {share}");
        }
        let reversed: Vec<f64> = numbers.iter().rev().copied().collect();
        assert_eq!(of(&reversed).value().to_bits(), whole.to_bits(), "in the other order");
    }

    #[test]
    fn sums_beyond_the_largest_number_are_infinite() {
        let mut total = Total::default();
        [1.0, f64::MAX, f64::MAX, 1.0].iter().for_each(|&value| total.add(value));
        assert_eq!(total.parts(), [f64::INFINITY, 0.0], "infinite, and not undefined");
    }
}
