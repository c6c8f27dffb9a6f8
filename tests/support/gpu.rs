//! A GPU for tests.
//!
//! In: the usual adapter. Out: a renderer on it, with shader checks on as long as debug assertions are.

use crate::support::no_gpu::no_gpu;
use bevy_gs4d::renderer::{GpuContext, Headless, ShaderChecks};

/// As the plugin chooses them: a build as shipped does not check.
pub const CHECKS: ShaderChecks = if cfg!(debug_assertions) { ShaderChecks::On } else { ShaderChecks::Off };

/// Returns a renderer; `None` if there is no adapter, which is reported.
pub fn headless() -> Option<Headless> {
    match GpuContext::headless(None) {
        Ok(context) => Some(Headless::new(context, CHECKS).expect("the passes compile")),
        Err(_) => {
            no_gpu();
            None
        }
    }
}
