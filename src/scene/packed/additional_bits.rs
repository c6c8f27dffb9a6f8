//! Additional bits for an unusually large range.
//!
//! In: the size of the range of an attribute, and the usual size. Out: a number of bits.

/// Returns the number of bits, at most 16, to add for values in a range of `size`, so that their steps are no coarser
/// than in a range of the `usual` size.
pub(super) fn additional_bits(size: f64, usual: f64) -> u32 {
    let times = size / usual;
    if times.is_finite() { times.log2().ceil().clamp(0.0, 16.0) as u32 } else { 0 }
}
