//! The iterations of loops on software drivers: Mesa's driver ends all loops of a thread after 65,535 iterations in all of its loops together.
//! Hardware has no such limit.
//!
//! In: nothing. Out: the limit, for the bounds of each design.

/// Iterations after which the driver ends the loops of a thread.
pub(super) const MOST_ITERATIONS: u64 = 65_535;
/// An upper bound of the iterations of a thread outside the loops over splats.
pub(super) const OTHERS: u64 = 400;
