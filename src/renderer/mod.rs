//! The renderer: plain wgpu.
//!
//! In: a [`RuntimeScene`](crate::scene::RuntimeScene) uploaded once ([`GpuCapture`]), views of it, and a device and an
//! encoder. Out: color, transmittance and depth textures ([`ViewRenderer`]), or pictures ([`Headless`]). `activate`
//! runs for each placed capture when its segment of time changes ([`ActiveList`]); a frame of a view is one compute
//! pass whose dispatches are sized on the GPU, without a read-back:
//!
//! | design | passes |
//! |---|---|
//! | tile bins ([`Design::TileBins`]), on GPUs | `project_bin` puts splats into bins of a few tiles, `sort_bins` sorts each bin in workgroup memory, `colors` computes colors, `blend_blocks` blends |
//! | global sort ([`Design::GlobalSort`]), on software drivers | `project`, `sort` by depth, `bin` into pairs of a tile and a splat, `sort` by tile, `ranges`, `blend` |
//!
//! Before them `activate` lists the active Gaussians of a capture; after them, if the views of the previous frame are given, `motion` replaces the
//! color of each splat by its motion, and the last pass runs once more, into a target of motions. All designs draw the same picture. The folders
//! `global_sort` and `tile_bins` have a design each: variants, pipelines, buffers, recording; `view` chooses the design of a frame, has the
//! trait through which it asks the design, `ViewDesign`, and what every view has: sizes, uniforms, targets, statistics.
//!
//! The Gaussians of a capture in chunk files are in pages of its buffers, which files take and leave ([`FileUpload`]); its list has those of the
//! files that are there, in their order, so that such a capture is drawn as one that is loaded whole.
//!
//! # Buffer capacity
//!
//! The number of pairs of a frame, and their distribution over bins, is known only on the GPU, after projection. The upper bound, a pair of
//! each Gaussian with each tile, is 5 · 10⁹ pairs for 667,000 Gaussians at 1920 x 1080, more than any GPU can store. A view has a capacity for
//! the counts of earlier frames and a reserve; counts arrive two frames late. A frame that needs more, for example the first frame of a
//! capture or after a cut, is drawn completely and without waiting:
//!
//! | design | if the capacity is exceeded | last pass |
//! |---|---|---|
//! | global sort | pairs of the farthest splats are not written | at the end of its list, `blend` continues with all remaining splats in depth order |
//! | tile bins | the pairs of whole bins, or the entries of a bin, are not written | `blend_blocks` searches all splats for the nearest splats of a tile |
//!
//! The result is exact, but slow: each tile visits every splat. On a device whose limits are too low for the pairs of a view, every frame is
//! drawn this way ([`ViewRenderer::is_short_of_room`]). Clients that read the lists of pairs need all pairs: [`Headless::draw`] draws again
//! with larger buffers, or returns an error.
//!
//! # Variants of passes
//!
//! Passes are compiled when a view first needs them. In an app ([`Renderer::compiling_in_background`]) another thread does this: captures appear
//! once the passes of their storage are compiled, and a view whose lists, bins or batches have changed draws with the variant that it has,
//! which draws the same picture, until the better one is compiled. A view with other targets or other surfaces (HDR, samples, debug views),
//! or whose bins are to be counted for the first time, has no such variant, and compiles its passes at once.
//!
//! Mesa's software driver ends all loops of a thread after 65,535 iterations. There `blend` blends many splats in an iteration if a view has
//! many, and frames of tile bins that may exceed the iterations are drawn with the global sort: [`Headless`] draws such a frame
//! again, other views use the global sort from a number of splats on. Hardware has no such limit.

mod active;
mod capture;
mod compiler;
mod compiling;
pub(crate) mod device;
pub(crate) mod frame;
pub(crate) mod global_sort;
mod headless;
mod iterations;
pub(crate) mod layout;
mod layouts;
mod list_rooms;
mod passes;
mod pipelines;
pub(crate) mod shaders;
mod statistics;
pub(crate) mod tile_bins;
mod timing;
pub(crate) mod view;
mod wgsl;

pub use active::ActiveList;
pub use capture::{CaptureUpload, ChunkFiles, FileUpload, GpuCapture};
pub use device::{GpuContext, GpuError, WorkCounters, silence_wayland};
pub use frame::{Design, Instance, OpaqueDepth, ViewParameters};
pub(crate) use global_sort::FinishedFrame;
pub use headless::Headless;
pub use pipelines::Renderer;
pub use shaders::{ColorPrecision, ShaderChecks, Storage};
pub use statistics::ViewStatistics;
pub use timing::{Measured, PassTime, Timings};
pub use view::ViewRenderer;
