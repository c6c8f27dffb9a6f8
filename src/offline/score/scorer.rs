//! The choice of the engine that scores views.
//!
//! In: an [`Engine`], a scene. Out: a [`ScoreEngine`] on the GPU or on the CPU.

use super::engine::{CpuEngine, ScoreEngine};
use super::gpu::GpuEngine;
use crate::offline::engine::{Engine, EngineError};
use crate::renderer::ShaderChecks;
use crate::scene::RuntimeScene;
use crate::view::Background;

/// Prepares a scene for scoring, once for many views.
///
/// # Errors
/// The scene does not fit the GPU.
pub(crate) fn scorer<'a>(
    engine: &'a mut Engine,
    scene: &'a RuntimeScene,
    background: Background,
) -> Result<Box<dyn ScoreEngine + 'a>, EngineError> {
    Ok(match engine {
        Engine::Cpu => Box::new(CpuEngine { scene, background }),
        Engine::Gpu(headless) => Box::new(GpuEngine::new(headless, scene, background, ShaderChecks::Off)?),
    })
}
