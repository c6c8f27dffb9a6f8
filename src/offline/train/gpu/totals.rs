//! Sums over views and invalid gradients, as the passes of training report them.
//!
//! In: the sums that `loss` writes, the notes that `project_backward` writes. Out: [`Totals`] and [`Faults`].

use crate::offline::measure::metrics::decibels;

/// Sums over the views since the last report.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Totals {
    /// Mean loss, without the terms of Gaussians alone.
    pub loss: f64,
    /// PSNR of all pixels together, dB.
    pub psnr: f64,
    /// Number of views.
    pub views: u64,
}

impl Totals {
    /// Returns the totals of the sums of losses and of squared errors, each a mean over the pixels of a view, and the
    /// number of views.
    pub(crate) fn of([loss, _, squares, views]: [f32; 4]) -> Self {
        let each = 1.0 / f64::from(views.max(1.0));
        let psnr = decibels(f64::from(squares) * each);
        Self { loss: f64::from(loss) * each, psnr, views: views as u64 }
    }
}

/// Gradients that were not finite and have been left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Faults {
    /// Their number.
    pub count: u32,
    /// The Gaussian and the view of the first.
    pub gaussian: u32,
    /// Number of that view.
    pub view: u32,
}

impl Faults {
    /// Returns the faults of the first three notes; `None` if there are none.
    pub(crate) fn of([count, gaussian, view]: [u32; 3]) -> Option<Self> {
        (count > 0).then(|| Self { count, gaussian: gaussian.saturating_sub(1), view })
    }
}
