//! Shadows that captures cast.
//!
//! In: captures with [`CastsShadows`]; lights with shadow maps, which Bevy draws. Out: the same maps with captures
//! among the meshes, so that all receivers of shadows also receive the shadows of captures.
//!
//! ```text
//! casts         the component, with resolution and bias               main world
//! extract       the casting captures and their bounds                 main world -> render world
//! light_lens    a light's view in the renderer's conventions
//! light_views   the renderer of each view of a light                  kept from frame to frame
//! prepare       the captures in each view of each light               once per view and frame
//! draw          one compute pass, write_depth into the map            Core3d, after the shadow passes of meshes
//! ```
//!
//! A shadow map has one depth per texel: captures are written at texels where they absorb more than half of the light,
//! at the farther of their median and expected depth. Their shadows have hard edges, which Bevy's filters soften like
//! the edges of mesh shadows.

mod casts;
mod draw;
mod extract;
mod light_lens;
mod light_views;
mod plugin;
mod prepare;

pub use casts::{CastsShadows, ShadowResolution};
pub(super) use plugin::build;
