//! Tile bins: the fastest design, four dispatches in place of the global sorts.
//!
//! In: a prepared view. Out: its frame, the same picture as global sort draws, by these passes (shaders in `shaders/tile_bins/`):
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | `project_bin` | active list, Gaussians | splats, list of the visible splats, unordered bins of a few tiles |
//! | `sort_bins` | bins | pairs of each tile, in order of depth |
//! | `colors` | visible splats, color coefficients | colors of splats |
//! | `blend_blocks` | pairs, splats and their colors, opaque depth | color and transmittance, expected and median depth |
//!
//! In frames behind opaque surfaces, without depths, `find_surfaces` first finds the farthest surface of each tile, and `project_bin` leaves out
//! the splats that are hidden in all of their tiles. If the center of a capture is behind every surface of the picture, its Gaussians that are
//! behind all of them are not projected.
//!
//! Each bin is sorted by one workgroup, in workgroup memory. `blend_blocks` blends each tile in blocks of 8 x 4 pixels.
//!
//! All bins have room for as many splats as the fullest bin of earlier frames, and a reserve. Where this would take too much memory, since
//! few bins are full, and where a bin without room would take seconds, since there are many splats, `project_bin` only counts the splats of
//! each bin, and two more passes fill bins with room for exactly these:
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | `place_bins` | number of splats of each bin | place of each bin among the entries of all bins |
//! | `fill_bins` | list of the visible splats, splats, places of bins | unordered bins |
//!
//! `sort_bins` then copies the entries of long bins in order of parts before it sorts part by part, so that its time grows in proportion to them.
//!
//! All views of a device share the buffers of splats, pairs and entries ([`Scratch`]): views are drawn one after another.

mod bins;
mod buffers;
mod layouts;
mod loops;
mod passes;
mod record;
mod scratch;
mod stamps;
mod state;
mod variant;
mod view;

pub(super) use bins::MAX_SLOTS;
pub(super) use layouts::BinLayouts;
pub(super) use loops::is_always_complete;
pub(super) use passes::BinPasses;
pub(super) use scratch::Scratch;
pub(super) use variant::BinVariant;
pub use variant::{COUNTED, EIGHT_AT_ONCE, FEW_BINS, LARGE_BATCHES, Lists, OPAQUE};
pub(super) use view::TileBins;
