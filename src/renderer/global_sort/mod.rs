//! Global sort: the design with the order of the original rasterizer.
//!
//! In: a prepared view. Out: its frame, by these passes (shaders in `shaders/global_sort/`):
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | `project` | active list, Gaussians, color coefficients | splats, depth keys |
//! | `sort` (8 steps of 4 bits) | depth keys | order of the visible splats |
//! | `bin` | splats in order | pairs (tile, splat), their number |
//! | `sort` (as many steps as tiles need) | pairs | pairs ordered by tile, then depth |
//! | `ranges` | pairs | first and last pair of each tile |
//! | `blend` | ranges, pairs, splats, opaque depth | color and transmittance, expected and median depth |
//!
//! Two stable sorts, first by depth and then by tile, produce the original's order by (tile, depth, index), and move far
//! less data than a sort by 64-bit keys. No pass needs subgroups, and the results do not depend on the subgroup size.
//!
//! If a frame has more pairs than the buffers can hold, the pairs of the farthest splats are not written: at the end of its list, `blend`
//! continues with all remaining splats in depth order.

mod at_once;
mod buffers;
mod finished;
mod layouts;
mod passes;
mod record;

pub use at_once::AtOnce;
pub(super) use at_once::at_once;
pub(super) use buffers::SortBuffers;
pub use finished::{FinishedFrame, PassBuffers};
pub(super) use layouts::SortLayouts;
pub(super) use passes::SortPasses;

/// Names of the timed passes of a frame, in order. The last two are the passes of motions.
pub(super) const TIMED_PASSES: &[&str] =
    &["project", "sort (depth)", "bin", "sort (tile)", "ranges", "blend", "motion", "blend (motion)"];
