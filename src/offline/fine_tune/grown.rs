//! What training from pictures alone has done to Gaussians, beside the steps of the optimizer.
//!
//! In: the counts of some steps. Out: their sums ([`Grown`]).

use std::ops::AddAssign;

/// Numbers of Gaussians, summed over some steps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Grown {
    pub relocated: usize,
    pub cloned: usize,
    pub split: usize,
    pub removed: usize,
}

impl AddAssign for Grown {
    fn add_assign(&mut self, other: Self) {
        self.relocated += other.relocated;
        self.cloned += other.cloned;
        self.split += other.split;
        self.removed += other.removed;
    }
}
