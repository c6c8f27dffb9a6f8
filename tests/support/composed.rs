//! The compute passes of the renderer and of the offline half, composed.
//!
//! In: the name of a pass, definitions. Out: a naga module.

use bevy_gs4d::internal::{offline, renderer};
use bevy_gs4d::renderer::GpuError;
use wgpu::naga::Module;

/// Returns the names of all passes.
pub fn pass_names() -> impl Iterator<Item = &'static str> {
    renderer::shaders::SHADERS.names().chain(offline::shaders::SHADERS.names())
}

/// Composes a pass with these definitions.
pub fn compose(name: &str, definitions: &[&str]) -> Result<Module, GpuError> {
    if offline::shaders::SHADERS.names().any(|pass| pass == name) {
        offline::shaders::SHADERS.compose(name, definitions)
    } else {
        renderer::shaders::SHADERS.compose(name, definitions)
    }
}
