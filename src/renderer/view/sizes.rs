//! Sizes: what the resources of a view have room for.
//!
//! In: what a frame needs. Out: [`Sizes`], by which buffers and targets are created.

use glam::UVec2;

/// What the resources of a view have room for.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Sizes {
    pub slots: u32,
    pub pairs: u32,
    /// Tiles along each side of a bin of the fast design.
    pub bin_side: u32,
    /// Splats in all bins of the fast design together.
    pub entries: u32,
    /// Instance uniforms.
    pub parts: u32,
    /// Size of the picture, pixels.
    pub picture: UVec2,
    /// Size of the target of depths: that of the picture, or one pixel if none are written.
    pub depths: UVec2,
}
