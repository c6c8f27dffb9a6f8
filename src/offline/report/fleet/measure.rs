//! The figures that bakes are compared by.
//!
//! In: the figures of one bake. Out: each measure of it, with the name, the unit and the digits that tables show.

use super::bake::{Bake, Figures, Reported};

/// A figure that bakes are compared by.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measure {
    /// Name for programs.
    pub id: &'static str,
    /// Name for people, with the unit.
    pub head: &'static str,
    /// Number of digits after the point.
    pub digits: usize,
    /// Whether bakes differ by factors rather than by differences. Values are then above zero.
    pub is_factor: bool,
    /// The smallest deviation from the median of an outlier, also if most bakes are alike: a difference, or a factor.
    pub least: f64,
    of: Of,
}

/// All measures, in the order of the tables.
pub(crate) const MEASURES: [Measure; 8] = [
    by_factor("gaussians", "Gaussians", 0, |figures| Some(figures.gaussians as f64)),
    by_difference("kept", "kept, %", 1, 2.0, |figures| {
        Some(100.0 * figures.gaussians as f64 / reported(figures)?.gaussians? as f64)
    }),
    by_factor("megabytes", "MB", 3, |figures| Some(figures.bytes as f64 / 1e6)),
    by_factor("bytes_per_gaussian", "bytes each", 1, |figures| Some(figures.bytes as f64 / figures.gaussians as f64)),
    by_difference("psnr", "PSNR, dB", 2, 0.5, |figures| Some(reported(figures)?.psnr?.after)),
    by_difference("loss", "loss, dB", 2, 0.1, |figures| reported(figures)?.psnr.map(|psnr| psnr.before - psnr.after)),
    by_difference("ssim", "SSIM", 4, 0.005, |figures| reported(figures)?.ssim),
    by_factor("seconds", "seconds", 1, |figures| Some(reported(figures)?.seconds)),
];

type Of = fn(&Figures) -> Option<f64>;

const fn by_factor(id: &'static str, head: &'static str, digits: usize, of: Of) -> Measure {
    Measure { id, head, digits, is_factor: true, least: 1.1, of }
}

const fn by_difference(id: &'static str, head: &'static str, digits: usize, least: f64, of: Of) -> Measure {
    Measure { id, head, digits, is_factor: false, least, of }
}

fn reported(figures: &Figures) -> Option<&Reported> {
    figures.reported.as_ref()
}

impl Measure {
    /// Returns the value of a bake; `None` if it is not known, not finite, or not above zero where values are compared
    /// by factors.
    pub(crate) fn of(&self, bake: &Bake) -> Option<f64> {
        let value = (self.of)(bake.figures.as_ref()?)?;
        (value.is_finite() && (!self.is_factor || value > 0.0)).then_some(value)
    }

    /// Returns a value as tables show it.
    pub(crate) fn shown(&self, value: f64) -> String {
        format!("{value:.*}", self.digits)
    }
}
