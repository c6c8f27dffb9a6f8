//! A frame of a view, as both designs see it.
//!
//! In: captures with a [`View`](crate::view::View) each, a background, the depth of opaque surfaces. Out: what a design prepares and records
//! ([`Preparation`], [`Sizes`], [`Recording`]), and the trait that it implements, [`ViewDesign`].

mod blending;
mod design;
mod parameters;
mod recording;
mod sizes;
mod view_design;

pub use blending::Blending;
pub use design::Design;
pub use parameters::{Instance, OpaqueDepth, ViewParameters};
pub(super) use recording::*;
pub(super) use sizes::{Sizes, grown, max_pairs};
pub(super) use view_design::{CountedFrame, Preparation, ViewDesign};
