//! The renderer: plain wgpu, without Bevy.
//!
//! In: a [`RuntimeScene`](crate::scene::RuntimeScene) put on the GPU once ([`GpuCapture`]), views of it, and somebody's device and
//! encoder. Out: colour, transmittance and depth textures ([`ViewRenderer`]), or pictures ([`Headless`]). A frame is one compute
//! pass, sized on the GPU, without a read-back:
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | `project` | Gaussians, colour coefficients | splats, depth keys |
//! | `sort` (8 steps of 4 bits) | depth keys | order of the visible splats |
//! | `bin` | splats in order | pairs (tile, splat), their number |
//! | `sort` (as many steps as tiles need) | pairs | pairs ordered by tile, then depth |
//! | `ranges` | pairs | first and last pair of each tile |
//! | `blend` | ranges, pairs, splats, opaque depth | colour and transmittance, expected depth |
//!
//! Sorting by depth first and by tile after, both stably, gives the original's order by (tile, depth, index) with far less to
//! move than its 64-bit keys. No pass needs subgroups, and the results do not depend on their size.

mod buffers;
mod capture;
mod context;
mod error;
mod headless;
pub mod layout;
mod renderer;
mod score;
pub mod shaders;
mod timing;
mod view;

pub use capture::GpuCapture;
pub use context::GpuContext;
pub use error::GpuError;
pub use headless::Headless;
pub use renderer::Renderer;
pub use score::{GpuEngine, Scorer};
pub use shaders::{ShaderChecks, Storage};
pub use timing::{PassTime, Timings};
pub use view::{Instance, OpaqueDepth, ViewRenderer};
