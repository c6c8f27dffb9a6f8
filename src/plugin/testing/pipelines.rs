//! The compile state of an app's pipelines, for the main world.
//!
//! In: the pipeline cache of the render world, after every frame. Out: [`PipelineReport`], which both worlds share:
//! with pipelined rendering the render world is on another thread and the main world cannot access it.

use super::error::TestingError;
use super::gpu::has_gpu;
use bevy::app::App;
use bevy::ecs::resource::Resource;
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::ecs::system::Res;
use bevy::render::render_resource::{CachedPipelineState, PipelineCache};
use bevy::render::{Render, RenderApp, RenderSystems};
use bevy::shader::ShaderCacheError;
use std::sync::{Arc, Mutex, PoisonError};

/// The state of all pipelines after the newest drawn frame.
#[derive(Resource, Clone, Default)]
struct PipelineReport(Arc<Mutex<State>>);

#[derive(Clone, Default)]
enum State {
    /// No frame has been drawn yet, or some pipelines are still being compiled.
    #[default]
    Waiting,
    Ready,
    Failed(String),
}

/// Adds the report to an app that has a renderer. Call this before the app's first update.
pub(super) fn watch_pipelines(app: &mut App) {
    if app.world().contains_resource::<PipelineReport>() {
        return;
    }
    let Some(renderer) = app.get_sub_app_mut(RenderApp) else { return };
    let report = PipelineReport::default();
    renderer.insert_resource(report.clone()).add_systems(Render, report_pipelines.in_set(RenderSystems::Cleanup));
    app.insert_resource(report);
}

/// Checks that the app can draw.
///
/// # Errors
/// [`TestingError::NoGpu`], [`TestingError::NoRenderer`].
pub(super) fn require_renderer(app: &mut App) -> Result<(), TestingError> {
    watch_pipelines(app);
    if app.world().contains_resource::<PipelineReport>() {
        return Ok(());
    }
    Err(if has_gpu() { TestingError::NoRenderer } else { TestingError::NoGpu })
}

/// Returns whether every pipeline is compiled. An app without a renderer has none.
///
/// # Errors
/// A pipeline that cannot be compiled.
pub(super) fn pipelines_are_ready(app: &App) -> Result<bool, TestingError> {
    let Some(report) = app.world().get_resource::<PipelineReport>() else { return Ok(true) };
    match &*report.0.lock().unwrap_or_else(PoisonError::into_inner) {
        State::Waiting => Ok(false),
        State::Ready => Ok(true),
        State::Failed(failure) => Err(TestingError::Pipeline(failure.clone())),
    }
}

fn report_pipelines(report: Res<PipelineReport>, cache: Option<Res<PipelineCache>>) {
    let state = cache.map_or(State::Waiting, |cache| state_of(&cache));
    *report.0.lock().unwrap_or_else(PoisonError::into_inner) = state;
}

fn state_of(cache: &PipelineCache) -> State {
    for pipeline in cache.pipelines() {
        match &pipeline.state {
            // Bevy compiles these again later: the shader is still being loaded.
            CachedPipelineState::Err(
                ShaderCacheError::ShaderNotLoaded(_) | ShaderCacheError::ShaderImportNotYetAvailable,
            ) => return State::Waiting,
            CachedPipelineState::Err(failure) => return State::Failed(failure.to_string()),
            _ => {}
        }
    }
    if cache.waiting_pipelines().count() == 0 { State::Ready } else { State::Waiting }
}
