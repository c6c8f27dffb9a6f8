//! Captures among Bevy's lit meshes: what needs its lights and materials.
//!
//! In: an app in which captures are drawn, Bevy's `PbrPlugin`. Out: the same app, in which captures and meshes belong to one scene.

mod order;
mod plugin;

pub(crate) use plugin::CapturePbrPlugin;
