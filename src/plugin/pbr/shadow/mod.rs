//! Shadows that captures cast.
//!
//! In: captures with [`CastsShadows`], lights with shadow maps, which Bevy draws. Out: the same maps, with captures among the
//! meshes, so that everything that receives shadows receives theirs.
//!
//! ```text
//! casts         which captures cast shadows, and how finely           main world
//! extract       they and their bounds                                 main world -> render world
//! light_lens    a light's view in the renderer's terms
//! light_views   the renderer of each view of a light                  kept from frame to frame
//! prepare       the captures in each view of each light               once per view and frame
//! draw          one compute pass, write_depth into the map            Core3d, after the shadow passes of meshes
//! ```
//!
//! A shadow map has one depth at each texel: captures are written where they absorb more than half of the light, at the depth where they
//! have absorbed half of it. They cast hard-edged shadows, which Bevy's filters soften like those of meshes.

mod casts;
mod draw;
mod extract;
mod light_lens;
mod light_views;
mod plugin;
mod prepare;

pub use casts::{CastsShadows, ShadowResolution};
pub(super) use plugin::CaptureShadowPlugin;
