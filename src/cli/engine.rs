//! What draws and scores for a verb: the GPU where there is a real one, else the CPU.
//!
//! In: `--engine`, the options of the GPU. Out: an [`Engine`]; this is the one place that chooses.

use super::failure::Failure;
use super::gpu::{self, GpuArgs};
use super::values;
use crate::offline::quality::{CpuDraw, Draw};
use crate::offline::score::{CpuEngine, GpuEngine, ScoreEngine};
use crate::renderer::{Headless, ShaderChecks};
use crate::scene::RuntimeScene;
use crate::view::{Background, Picture, View};
use std::error::Error;

/// Where to compute.
#[derive(clap::Args)]
#[command(next_help_heading = "Engine")]
pub struct EngineArgs {
    /// Where to score and draw: cpu, gpu, or auto: the GPU unless there is none but a software driver.
    #[arg(long, value_name = "ENGINE", default_value = "auto", value_parser = values::one_of(&ENGINES))]
    engine: EngineName,
    #[command(flatten)]
    gpu: GpuArgs,
}

#[derive(Clone, Copy)]
enum EngineName {
    Auto,
    Cpu,
    Gpu,
}

const ENGINES: [(&str, EngineName); 3] =
    [("auto", EngineName::Auto), ("cpu", EngineName::Cpu), ("gpu", EngineName::Gpu)];

/// What draws and scores.
pub enum Engine {
    /// The CPU twins.
    Cpu,
    /// A GPU.
    Gpu(Box<Headless>),
}

impl EngineArgs {
    /// Opens it.
    ///
    /// # Errors
    /// A GPU was asked for that cannot be used.
    pub fn open(&self) -> Result<Engine, Failure> {
        match self.engine {
            EngineName::Cpu => Ok(Engine::Cpu),
            EngineName::Gpu => Ok(Engine::Gpu(Box::new(self.gpu.open()?))),
            EngineName::Auto if self.gpu.is_chosen() => Ok(Engine::Gpu(Box::new(self.gpu.open()?))),
            EngineName::Auto => {
                Ok(self.gpu.open_hardware().map_or(Engine::Cpu, |headless| Engine::Gpu(Box::new(headless))))
            }
        }
    }
}

impl Engine {
    /// Its name, for people.
    pub fn name(&self) -> String {
        match self {
            Self::Cpu => format!("CPU, {} threads", rayon::current_num_threads()),
            Self::Gpu(headless) => gpu::adapter_name(headless),
        }
    }

    /// Gets ready to score a scene.
    ///
    /// # Errors
    /// It does not fit.
    pub fn scorer<'a>(
        &'a mut self,
        scene: &'a RuntimeScene,
        background: Background,
    ) -> Result<Box<dyn ScoreEngine + 'a>, Failure> {
        Ok(match self {
            Self::Cpu => Box::new(CpuEngine { scene, background }),
            Self::Gpu(headless) => Box::new(GpuEngine::new(headless, scene, background, ShaderChecks::Off)?),
        })
    }
}

impl Draw for Engine {
    fn draw(
        &mut self,
        scene: &RuntimeScene,
        views: &[View],
        background: Background,
        each: &mut dyn FnMut(usize, Picture),
    ) -> Result<(), Box<dyn Error + Send + Sync>> {
        match self {
            Self::Cpu => CpuDraw.draw(scene, views, background, each),
            Self::Gpu(headless) => {
                let capture = headless.upload(scene)?;
                for (number, view) in views.iter().enumerate() {
                    each(number, headless.render(&capture, view, background)?.picture);
                }
                Ok(())
            }
        }
    }
}
