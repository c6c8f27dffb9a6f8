//! The CPU reference of every GPU pass of a frame, with the same names and in the same order.
//!
//! In: [`Layer`]s and a [`Background`](crate::view::Background). Out: a [`Frame`](crate::view::Frame). The passes are
//! plain functions over slices and correspond to the files of `shaders/`: [`activate()`], [`project()`], `sort`, `bin`,
//! `sort` again, `ranges`, `blend`, `motion()`. `blend_backward()` and `gradients` take the gradient of a loss on a
//! frame back to the trained parameters.

pub(crate) mod activate;
pub(crate) mod bin;
pub(crate) mod blend;
pub(crate) mod blend_backward;
mod layer;
pub(crate) mod motion;
pub(crate) mod project;
mod render;
pub(crate) mod sort;
pub(crate) mod tile_lists;
mod workload;

pub(crate) use activate::activate;
pub(crate) use bin::Pair;
pub(crate) use blend::behind;
pub use layer::Layer;
pub(crate) use project::{Splat, project};
pub use render::{render, render_layers};
pub(crate) use tile_lists::{TileLists, tile_lists};
pub use workload::{Workload, workload};
