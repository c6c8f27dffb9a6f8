//! Outliers: figures that lie far from those of the other bakes.
//!
//! In: the values of one measure. Out: their median, the range of usual values, and the values outside it.
//!
//! The rule is robust: a few extreme values, or a few bakes that failed, do not move it. The deviation that counts as
//! usual is the median of the absolute deviations from the median, times 1.4826, which is the standard deviation of
//! normally distributed values. Values beyond [`LIMIT`] of it are outliers, unless they are closer to the median than
//! [`Measure::least`]. Measures that differ by factors are compared by their logarithms.

use super::measure::Measure;

/// Number of usual deviations from the median beyond which a value is an outlier.
pub(crate) const LIMIT: f64 = 3.5;
/// From the median of absolute deviations to the standard deviation, for normally distributed values.
const TO_DEVIATION: f64 = 1.4826;
/// Smallest number of values that are compared. Fewer have no outliers.
pub(crate) const FEWEST: usize = 5;

/// The usual values of a measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Usual {
    /// The middle value.
    pub median: f64,
    /// The smallest usual value.
    pub low: f64,
    /// The largest usual value.
    pub high: f64,
}

/// A value outside the usual values.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Outlier {
    /// The measure.
    pub measure: Measure,
    /// The value.
    pub value: f64,
    /// The usual values.
    pub usual: Usual,
}

impl Usual {
    /// Returns the usual values of a measure among all its values; `None` if there are fewer than [`FEWEST`].
    pub(crate) fn of(measure: &Measure, values: &[f64]) -> Option<Self> {
        if values.len() < FEWEST {
            return None;
        }
        let scaled = |value: f64| if measure.is_factor { value.ln() } else { value };
        let values: Vec<f64> = values.iter().copied().map(scaled).collect();
        let middle = median(&values)?;
        let deviations: Vec<f64> = values.iter().map(|value| (value - middle).abs()).collect();
        let reach = (LIMIT * TO_DEVIATION * median(&deviations)?).max(scaled(measure.least));
        let unscaled = |value: f64| if measure.is_factor { value.exp() } else { value };
        Some(Self { median: unscaled(middle), low: unscaled(middle - reach), high: unscaled(middle + reach) })
    }

    /// Returns whether a value is usual.
    pub(crate) fn has(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

impl Outlier {
    /// Returns what is unusual, in words.
    pub(crate) fn words(&self) -> String {
        let Self { measure, value, usual } = self;
        let shown = |value: f64| measure.shown(value);
        format!("{} {}, usually {} to {}", measure.head, shown(*value), shown(usual.low), shown(usual.high))
    }

    /// Returns whether the value is above the usual values; otherwise it is below.
    pub(crate) fn is_high(&self) -> bool {
        self.value > self.usual.high
    }
}

/// Returns the median of values; `None` of none.
fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() % 2 {
        0 => Some((sorted.get(middle.checked_sub(1)?)? + sorted.get(middle)?) / 2.0),
        _ => sorted.get(middle).copied(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::report::fleet::measure::MEASURES;

    fn measure(id: &str) -> &'static Measure {
        const ALL: &[Measure] = &MEASURES;
        ALL.iter().find(|measure| measure.id == id).expect("a measure of this name")
    }

    #[test]
    fn extreme_values_do_not_hide_each_other() {
        let values = [31.8, 32.0, 32.4, 31.5, 32.2, 31.9, 12.0, 11.0];
        let usual = Usual::of(measure("psnr"), &values).expect("enough values");
        let unusual: Vec<f64> = values.into_iter().filter(|&value| !usual.has(value)).collect();
        assert_eq!(unusual, [12.0, 11.0], "both low values stand out, of {usual:?}");
    }

    #[test]
    fn small_differences_among_like_bakes_are_usual() {
        let usual = Usual::of(measure("psnr"), &[32.0, 32.0, 32.0, 32.0, 32.0, 32.3, 30.0]).expect("enough values");
        assert!(usual.has(32.3), "0.3 dB are less than the smallest deviation of an outlier: {usual:?}");
        assert!(!usual.has(30.0), "2 dB are: {usual:?}");
    }

    #[test]
    fn sizes_are_compared_by_factors() {
        let values = [1.0, 2.0, 4.0, 1.0, 2.0, 4.0, 2.0, 1.0, 4.0];
        let usual = Usual::of(measure("megabytes"), &values).expect("enough values");
        assert!((usual.median - 2.0).abs() < 1e-9, "the middle value: {usual:?}");
        assert!((usual.low * usual.high - 4.0).abs() < 1e-9, "as far below by a factor as above: {usual:?}");
        assert!(!usual.has(100.0) && !usual.has(0.02), "fifty times more and less stand out: {usual:?}");
    }

    #[test]
    fn few_values_have_no_outliers() {
        assert_eq!(Usual::of(measure("psnr"), &[30.0, 30.0, 30.0, 1.0]), None, "four values are too few");
    }
}
