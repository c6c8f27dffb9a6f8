//! Sizes: what the resources of a view have room for.
//!
//! In: what a frame needs. Out: [`Sizes`], by which buffers and targets are created.

use crate::renderer::layout::BLOCK;
use crate::renderer::memory::binding_limit;
use glam::UVec2;

/// What the resources of a view have room for.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Sizes {
    pub slots: u32,
    pub pairs: u32,
    /// Splats in all bins of the fast design together.
    pub entries: u32,
    /// Instance uniforms.
    pub parts: u32,
    /// Size of the largest picture, pixels.
    pub picture: UVec2,
    /// Size of the target of depths: that of the largest picture, or one pixel if none are written.
    pub depths: UVec2,
}

/// Sides of the largest picture are multiples of this, pixels, once a picture has grown: it will go on growing while a window is dragged.
const PICTURE_STEP: u32 = 256;

/// Returns the size of the largest picture for which there should be room, with room for `made` and a picture that is `needed`. `limit` is
/// the largest side of a texture.
pub(super) fn grown(made: UVec2, needed: UVec2, limit: u32) -> UVec2 {
    // The first picture may be the only one.
    if made == UVec2::ZERO {
        return needed;
    }
    let steps = needed.map(|side| side.next_multiple_of(PICTURE_STEP).min(limit));
    UVec2::select(needed.cmple(made), made, steps)
}

/// Returns the number of pairs that fit one binding and one dispatch.
pub(crate) fn max_pairs(device: &wgpu::Device) -> u32 {
    let limits = device.limits();
    let bound = u32::try_from(binding_limit(&limits) / 4).unwrap_or(u32::MAX);
    // One workgroup processes a block of them.
    bound.min(limits.max_compute_workgroups_per_dimension.saturating_mul(BLOCK))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_for_pictures_grows_in_steps_and_stays() {
        let (first, limit) = (UVec2::new(640, 360), 1000);
        assert_eq!(grown(UVec2::ZERO, first, limit), first, "the first as it is");
        assert_eq!(grown(first, UVec2::new(641, 300), limit), UVec2::new(768, 360), "the side that has grown");
        assert_eq!(grown(UVec2::new(768, 360), UVec2::new(700, 100), limit), UVec2::new(768, 360), "there is room");
        assert_eq!(grown(first, UVec2::new(900, 360), limit), UVec2::new(1000, 360), "no more than a texture holds");
    }
}
