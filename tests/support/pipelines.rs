//! The pipelines of an app.
//!
//! In: an app with a renderer. Out: the error of the first pipeline that does not compile.

use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_resource::{CachedPipelineState, PipelineCache};

/// Checks that no pipeline has failed to compile.
///
/// # Errors
/// The error of the first failed pipeline.
pub fn check_pipelines(app: &App) -> Result<(), String> {
    for pipeline in app.sub_app(RenderApp).world().resource::<PipelineCache>().pipelines() {
        if let CachedPipelineState::Err(failure) = &pipeline.state {
            return Err(format!("a pipeline failed: {failure}"));
        }
    }
    Ok(())
}
