//! The CPU reference of every GPU pass of a frame, with the same names and in the same order.
//!
//! In: [`Layer`]s and a [`Background`](crate::view::Background). Out: a [`Frame`](crate::view::Frame). The passes are plain
//! functions over slices and correspond to the files of `shaders/`: [`activate()`], [`project()`], [`sort`], [`bin`],
//! `sort` again, [`ranges`], [`blend`], [`motion()`]. [`blend_backward()`] and [`gradients`] take the gradient of a loss
//! on a frame back to the trained parameters.

mod activate;
mod bin;
mod blend;
mod blend_backward;
mod layer;
mod motion;
mod project;
mod render;
mod sort;
mod tile_lists;
mod workload;

pub use activate::activate;
pub use bin::{Pair, bin, ranges};
pub use blend::{behind, blend};
pub use blend_backward::{PixelGradients, blend_backward, gradients};
pub use layer::Layer;
pub use motion::motion;
pub use project::{Splat, project};
pub use render::{render, render_layers};
pub use sort::sort;
pub use tile_lists::{TileLists, tile_lists};
pub use workload::{Workload, workload};
