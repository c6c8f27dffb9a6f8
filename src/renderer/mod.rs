//! The renderer: plain wgpu, without Bevy.
//!
//! In: a [`RuntimeScene`](crate::scene::RuntimeScene) uploaded once ([`GpuCapture`]), views of it, and a device and an
//! encoder. Out: color, transmittance and depth textures ([`ViewRenderer`]), or pictures ([`Headless`]). `activate`
//! runs for each placed capture when its segment of time changes ([`ActiveList`]); a frame of a view is one compute
//! pass whose dispatches are sized on the GPU, without a read-back:
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | `activate` | temporal filter | list of the active Gaussians |
//! | `project` | that list, Gaussians, color coefficients | splats, depth keys |
//! | `sort` (8 steps of 4 bits) | depth keys | order of the visible splats |
//! | `bin` | splats in order | pairs (tile, splat), their number |
//! | `sort` (as many steps as tiles need) | pairs | pairs ordered by tile, then depth |
//! | `ranges` | pairs | first and last pair of each tile |
//! | `blend` | ranges, pairs, splats, opaque depth | color and transmittance, expected and median depth |
//!
//! If the views of the previous frame are given, `motion` then replaces the color of each splat by its motion, and `blend` runs once more,
//! into a target of motions.
//!
//! Two stable sorts, first by depth and then by tile, produce the original's order by (tile, depth, index), and move far
//! less data than a sort by 64-bit keys. No pass needs subgroups, and the results do not depend on the subgroup size.
//!
//! These passes are the reference design ([`Design::Reference`]), which has the order of the original. [`Design::Fast`] draws the same picture
//! in four dispatches: `project_bin` writes splats into unordered bins of a few tiles, `sort_bins` sorts each bin in workgroup memory and
//! writes the pairs of its tiles, `colors` computes the colors of the visible splats, and `blend_blocks` blends each tile in blocks of 8 x 4
//! pixels.
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
//! | reference | pairs of the farthest splats are not written | at the end of its list, `blend` continues with all remaining splats in depth order |
//! | fast | the pairs of whole bins, or the entries of a bin, are not written | `blend_blocks` searches all splats for the nearest splats of a tile |
//!
//! The result is exact, but slow: each tile visits every splat. On a device whose limits are too low for the pairs of a view, every frame is
//! drawn this way ([`ViewRenderer::is_short_of_room`]). Clients that read the lists of pairs need all pairs: [`Headless::draw`] draws again
//! with larger buffers, or returns an error.
//!
//! # Variants of passes
//!
//! Passes are compiled when a view first needs them. In an app ([`Renderer::compiling_in_background`]) another thread does this: captures appear
//! once the passes of their storage are compiled, and a view whose lists, bins or batches have changed draws with the variant that it has,
//! which draws the same picture, until the better one is compiled. A view with other targets or other surfaces (HDR, samples, debug views)
//! has no such variant, and compiles its passes at once.
//!
//! Mesa's software driver ends all loops of a thread after 65,535 iterations. There `blend` blends many splats in an iteration if a view has
//! many, and frames of the fast design that may exceed the iterations are drawn with the reference design: [`Headless`] draws such a frame
//! again, other views use the reference design from a number of splats on. Hardware has no such limit.

mod active;
pub(crate) mod bind;
mod capture;
mod compiling;
mod design;
mod device;
mod error;
mod headless;
pub(crate) mod layout;
mod layouts;
pub(crate) mod memory;
mod passes;
mod pipelines;
pub(crate) mod shaders;
mod statistics;
mod timing;
pub(crate) mod view;
mod work;

pub use active::ActiveList;
pub use capture::{CaptureUpload, GpuCapture};
pub use design::Design;
pub use device::GpuContext;
pub use error::GpuError;
pub use headless::Headless;
pub use pipelines::Renderer;
pub use shaders::{ColorPrecision, ShaderChecks, Storage};
pub use statistics::ViewStatistics;
pub use timing::{PassTime, Timings};
pub(crate) use view::FinishedFrame;
pub use view::{Instance, OpaqueDepth, ViewParameters, ViewRenderer};
pub use work::WorkCounters;
