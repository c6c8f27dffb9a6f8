//! The sizes of the resources of a view.
//!
//! In: the picture size that a frame needs, and the limits of the device. Out: [`Sizes`], by which buffers and targets are created.

use crate::renderer::device::memory::binding_limit;
use crate::renderer::layout::BLOCK;
use glam::UVec2;

/// The sizes of the resources of a view.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::renderer) struct Sizes {
    pub slots: u32,
    pub pairs: u32,
    /// Entries of all tile bins together; 0 for the global sort.
    pub entries: u32,
    /// Room for entries that are ordered before they are sorted, if bins are counted; otherwise 0.
    pub ordered: u32,
    /// Number of instance uniforms.
    pub parts: u32,
    /// Size of the largest picture, pixels.
    pub picture: UVec2,
    /// Size of the target of depths: the size of the largest picture, or one pixel if depths are not written.
    pub depths: UVec2,
}

/// Once a picture has grown, the sides of the largest picture are multiples of this number of pixels: a picture keeps growing while a window
/// is resized.
const PICTURE_STEP: u32 = 256;

/// Returns the size of targets for a picture of size `needed`, given the current size `made` of targets. `limit` is the largest side of a
/// texture.
pub(in crate::renderer) fn grown(made: UVec2, needed: UVec2, limit: u32) -> UVec2 {
    // The first picture may be the only one: exact size.
    if made == UVec2::ZERO {
        return needed;
    }
    let steps = needed.map(|side| side.next_multiple_of(PICTURE_STEP).min(limit));
    UVec2::select(needed.cmple(made), made, steps)
}

/// Returns the largest number of pairs that fit into one binding and one dispatch.
pub(crate) fn max_pairs(device: &wgpu::Device) -> u32 {
    let limits = device.limits();
    let bound = u32::try_from(binding_limit(&limits) / 4).unwrap_or(u32::MAX);
    // One workgroup processes a block of pairs.
    bound.min(limits.max_compute_workgroups_per_dimension.saturating_mul(BLOCK))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_grow_in_steps_and_do_not_shrink() {
        let (first, limit) = (UVec2::new(640, 360), 1000);
        assert_eq!(grown(UVec2::ZERO, first, limit), first, "the first size is exact");
        assert_eq!(grown(first, UVec2::new(641, 300), limit), UVec2::new(768, 360), "only the larger side grows");
        assert_eq!(grown(UVec2::new(768, 360), UVec2::new(700, 100), limit), UVec2::new(768, 360), "the size is kept");
        assert_eq!(grown(first, UVec2::new(900, 360), limit), UVec2::new(1000, 360), "sides stay within the limit");
    }
}
