//! A GPU for tests, or the word that there is none.

use crate::skip::skip;
use bevy_gs4d::renderer::{GpuContext, Headless, ShaderChecks};

/// A renderer with shader checks on; nothing, said aloud, where there is no adapter.
pub fn headless() -> Option<Headless> {
    match GpuContext::headless(None) {
        Ok(context) => Some(Headless::new(context, ShaderChecks::On).expect("the passes compile")),
        Err(error) => {
            skip(format_args!("no GPU adapter: {error}"));
            None
        }
    }
}
