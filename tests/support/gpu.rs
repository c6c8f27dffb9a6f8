//! A GPU for tests.
//!
//! In: the default adapter. Out: a renderer on that adapter, with shader checks on in builds with debug assertions.

use crate::support::no_gpu::no_gpu;
use bevy_gs4d::renderer::{GpuContext, Headless, ShaderChecks};

/// Shader checks as in the plugin: a release build has none.
pub const CHECKS: ShaderChecks = if cfg!(debug_assertions) { ShaderChecks::On } else { ShaderChecks::Off };

/// Returns a renderer; without an adapter, reports the skipped test and returns `None`.
pub fn headless() -> Option<Headless> {
    match GpuContext::headless(None) {
        Ok(context) => Some(Headless::new(context, CHECKS).expect("the passes compile")),
        Err(_) => {
            no_gpu();
            None
        }
    }
}
