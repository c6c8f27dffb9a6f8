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
//! less data than a sort by 64-bit keys. No pass needs subgroups, and the results do not depend on the subgroup
//! size; on software drivers whose subgroups have 8 threads, `blend` loads splats by them.

mod at_once;
mod buffers;
mod finished;
mod layouts;
mod passes;
mod record;
mod view;

pub use at_once::AtOnce;
pub use finished::{FinishedFrame, PassBuffers};
pub(super) use layouts::SortLayouts;
pub(super) use passes::SortPasses;
pub(super) use view::GlobalSort;
