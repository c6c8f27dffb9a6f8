//! Views of a capture and the results of drawing them: the innermost ring, which contains nothing about Gaussians.
//!
//! In: cameras ([`Camera`]; at one time, a [`View`]), how a capture was trained to be drawn ([`Optics`]), and how
//! captures are shown ([`Appearance`], [`Thinning`], [`Background`], [`BlendSpace`], [`DebugView`]). Out: the types of a
//! drawn view, [`Picture`] and [`Frame`].

mod appearance;
mod camera;
mod frame;
mod optics;
mod picture;
pub mod srgb;
mod thinning;
#[expect(clippy::module_inception, reason = "the type `View` has its own file, like the other types")]
mod view;

pub use appearance::{Appearance, Background, BlendSpace, DebugView, Lighting};
pub use camera::{Camera, Lens};
pub use frame::{Counts, Frame};
pub use optics::{NEAR, Optics, RasterFov};
pub use picture::Picture;
pub use thinning::Thinning;
pub use view::{TILE_SIZE, View, tiles};
