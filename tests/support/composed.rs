//! The compute passes of the renderer and of the offline half, composed.
//!
//! In: the name of a pass, definitions. Out: a naga module.

use bevy_gs4d::internal::{offline, renderer};
use bevy_gs4d::renderer::GpuError;
use wgpu::naga::Module;
use wgpu::naga::front::wgsl::parse_str;

/// Returns the passes of the renderer, of scoring and training, and of the optional parts of training.
fn sets() -> impl Iterator<Item = &'static renderer::ShaderSet> {
    [&renderer::SHADERS, &offline::engine::SHADERS].into_iter().chain(offline::train::PART_SHADERS)
}

/// Returns the names of all passes.
pub fn pass_names() -> impl Iterator<Item = &'static str> {
    sets().flat_map(|set| set.names())
}

/// Returns the WGSL text of a pass with these definitions.
pub fn text_of(name: &str, definitions: &[&str]) -> Result<String, GpuError> {
    let set = sets().find(|set| set.names().any(|pass| pass == name));
    set.unwrap_or(&renderer::SHADERS).compose(name, definitions)
}

/// Composes a pass with these definitions.
pub fn compose(name: &str, definitions: &[&str]) -> Result<Module, GpuError> {
    let text = text_of(name, definitions)?;
    parse_str(&text).map_err(|error| GpuError::Shader { name: "parsed", reason: error.emit_to_string(&text) })
}
