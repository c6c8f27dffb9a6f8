//! The renderer: plain wgpu, without Bevy.
//!
//! In: a [`RuntimeScene`](crate::scene::RuntimeScene) uploaded once ([`GpuCapture`]), views of it, and a device and an
//! encoder. Out: color, transmittance and depth textures ([`ViewRenderer`]), or pictures ([`Headless`]). `activate`
//! runs for each placed capture, when its segment of time changes ([`ActiveList`]); a frame of a view is one compute
//! pass, sized on the GPU, without a read-back:
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
//! If the views of the frame before are given, `motion` then puts the motion of each splat in place of its color, and `blend` runs once more,
//! into a target of motions.
//!
//! Two stable sorts, first by depth and then by tile, give the original's order by (tile, depth, index), and move far
//! less data than a sort by its 64-bit keys. No pass needs subgroups, and the results do not depend on their size.
//!
//! That is the reference design ([`Design::Reference`]), whose order is the original's. [`Design::Fast`] draws the same picture
//! in four dispatches: `project_bin` puts splats into bins of a few tiles without order, `sort_bins` sorts each bin in workgroup memory and
//! writes the pairs of its tiles, `colors` computes the colors of the visible splats, and `blend_blocks` blends each tile in blocks of 8 x 4
//! pixels.
//!
//! # Room
//!
//! How many pairs a frame has, and how they are spread over bins, only the GPU knows, once it has projected the splats. Room that is enough
//! for anything would be a pair of each Gaussian with each tile: 5 · 10⁹ for 667,000 Gaussians at 1920 x 1080, which no GPU has. A view has
//! room for what earlier frames have counted, and a reserve; counts arrive two frames late. A frame that needs more, as the first sight of a
//! capture or a cut may, lacks nothing all the same, and neither stops nor waits:
//!
//! | | without room | what the last pass does |
//! |---|---|---|
//! | reference | pairs of the farthest splats are not written | `blend` goes on through the splats in their order, where lists end |
//! | fast | the pairs of whole bins, or entries of a bin, are not written | `blend_blocks` searches all splats for the nearest ones of a tile |
//!
//! This is exact, and slow: a tile looks at every splat. On a device that has no room at all for a view it stays so
//! ([`ViewRenderer::is_short_of_room`]). Clients that read the lists of pairs need all of them: [`Headless::draw`] draws again with more room,
//! or returns an error.

mod active;
pub mod bind;
mod capture;
mod design;
mod device;
mod error;
mod headless;
pub mod layout;
pub mod memory;
mod pipelines;
pub mod shaders;
mod statistics;
mod timing;
mod view;
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
pub use view::{FinishedFrame, Instance, OpaqueDepth, PassBuffers, ViewParameters, ViewRenderer};
pub use work::WorkCounters;
