//! The engine that scores and draws for a verb.
//!
//! In: `--engine`, `--renderer`, `--adapter` and `--checks`. Out: an [`Engine`], or a headless renderer.

use super::effects::Need;
use super::{Given, values};
use crate::cli::output::failure::Failure;
use crate::offline::engine::{Engine, EngineChoice, EngineSettings, GpuSettings};
use crate::renderer::{Design, GpuError, Headless, ShaderChecks};

/// Where to compute.
#[derive(clap::Args)]
#[command(next_help_heading = "Engine")]
pub(crate) struct EngineArgs {
    /// Where to score and draw: cpu, gpu, or auto: a hardware GPU if there is one, else the CPU.
    #[arg(long, value_name = "ENGINE", default_value = "auto", value_parser = values::one_of(&EngineChoice::NAMES))]
    engine: EngineChoice,
    #[command(flatten)]
    gpu: GpuArgs,
}

impl EngineArgs {
    /// Checks that no option of a GPU is given with `--engine cpu`.
    ///
    /// # Errors
    /// The first such option.
    pub(crate) fn check(&self, given: &Given) -> Result<(), Failure> {
        given.require(Need::Gpu, self.engine != EngineChoice::Cpu)
    }

    /// Returns the choice.
    pub(crate) fn choice(&self) -> EngineChoice {
        self.engine
    }

    /// Opens the engine, after [`check`](Self::check).
    ///
    /// # Errors
    /// The requested GPU cannot be used; an option of a GPU is given, and the engine is the CPU.
    pub(crate) fn open(&self, given: &Given) -> Result<Engine, Failure> {
        self.check(given)?;
        let engine = Engine::open(&EngineSettings { choice: self.engine, gpu: self.gpu.settings() })?;
        given.require(Need::FoundGpu, !matches!(engine, Engine::Cpu))?;
        Ok(engine)
    }
}

/// How views are drawn.
#[derive(clap::Args)]
pub(crate) struct DesignArgs {
    /// How views are drawn on a GPU; the pictures are the same. bins: tile bins; sort: a global sort; auto: bins, but
    /// sort on a software driver, where bins take about four times as long: it emulates the barriers of their sort.
    #[arg(long, value_name = "RENDERER", default_value = "auto", value_parser = values::one_of(&Design::NAMES))]
    pub renderer: Design,
}

/// How views are drawn, and on which GPU.
#[derive(clap::Args)]
pub(crate) struct RendererArgs {
    #[command(flatten)]
    design: DesignArgs,
    #[command(flatten)]
    gpu: GpuArgs,
}

/// The renderers to compare, and the GPU on which they draw.
#[derive(clap::Args)]
pub(crate) struct RenderersArgs {
    /// How views are drawn, one or more; the pictures are the same. bins: tile bins; sort: a global sort; auto: bins,
    /// but sort on a software driver, where bins take about four times as long: it emulates the barriers of their sort.
    #[arg(id = "renderer", long = "renderer", value_name = "RENDERER,..", default_value = "auto", value_delimiter = ',',
        value_parser = values::one_of(&Design::NAMES))]
    pub renderers: Vec<Design>,
    #[command(flatten)]
    gpu: GpuArgs,
}

impl RenderersArgs {
    /// Opens the adapter and compiles the passes.
    ///
    /// # Errors
    /// As [`RendererArgs::open`].
    pub(crate) fn open(&self) -> Result<Headless, GpuError> {
        self.gpu.settings().open()
    }
}

impl RendererArgs {
    /// Opens the adapter and compiles the passes.
    ///
    /// # Errors
    /// No such adapter, or one that cannot run the passes.
    pub(crate) fn open(&self) -> Result<Headless, GpuError> {
        let mut headless = self.gpu.settings().open()?;
        headless.set_design(self.design.renderer);
        Ok(headless)
    }
}

/// Which GPU draws, and whether shaders check array indices.
#[derive(clap::Args)]
#[command(next_help_heading = "GPU")]
struct GpuArgs {
    /// The adapter: part of its name, upper or lower case, or its index. A wrong value lists all adapters [default: the
    /// fastest].
    #[arg(long, value_name = "NAME|INDEX")]
    adapter: Option<String>,
    /// Have shaders check every array index (slower; to look for defects).
    #[arg(long)]
    checks: bool,
}

impl GpuArgs {
    fn settings(&self) -> GpuSettings {
        let checks = if self.checks { ShaderChecks::On } else { ShaderChecks::Off };
        GpuSettings { adapter: self.adapter.clone(), checks }
    }
}
