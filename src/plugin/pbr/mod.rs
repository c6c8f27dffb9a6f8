//! Captures among Bevy's lit meshes: the parts that need Bevy's lights and materials.
//!
//! In: an app in which captures are drawn, with Bevy's `PbrPlugin`. Out: the same app, in which captures and meshes
//! form one scene, with common order, fog, light and shadows.

mod contact_shadow;
mod in_range;
mod order;
mod plugin;
mod shade;
mod shadow;

pub use contact_shadow::CaptureContactShadow;
pub use plugin::CapturePbrPlugin;
pub use shade::{CaptureLight, ReceivesShadows};
pub use shadow::{CastsShadows, ShadowResolution};
