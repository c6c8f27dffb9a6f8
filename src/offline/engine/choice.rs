//! Drawing on the GPU or, without a hardware GPU, by the CPU reference.
//!
//! In: [`EngineSettings`]. Out: an [`Engine`], which prepares a scene for drawing ([`Draw`]), once for many views. This
//! is the only place that chooses between GPU and CPU.

use super::EngineError;
use super::memory::require;
use crate::reference;
use crate::renderer::{GpuCapture, GpuContext, GpuError, Headless, ShaderChecks};
use crate::scene::RuntimeScene;
use crate::view::{Background, Picture, View};
use serde::Serialize;
use std::fmt;

/// The choice between GPU and CPU. Default: [`EngineChoice::Auto`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum EngineChoice {
    /// On the GPU if an adapter is named; else on the fastest adapter if it is a hardware GPU that can run the passes,
    /// or on the CPU.
    #[default]
    Auto,
    /// On the CPU.
    Cpu,
    /// On the GPU.
    Gpu,
}

impl EngineChoice {
    /// Every choice with its name.
    pub const NAMES: [(&'static str, Self); 3] = [("auto", Self::Auto), ("cpu", Self::Cpu), ("gpu", Self::Gpu)];
}

/// Which GPU to use, and with which checks.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct GpuSettings {
    /// Part of the name of the adapter, upper or lower case, or its index. Default: `None`, the fastest adapter.
    pub adapter: Option<String>,
    /// Whether the shaders that draw check their array indices. Default: [`ShaderChecks::Off`].
    pub checks: ShaderChecks,
}

impl GpuSettings {
    /// Opens the adapter and compiles the passes.
    ///
    /// # Errors
    /// No such adapter, or one that cannot run the passes.
    pub fn open(&self) -> Result<Headless, GpuError> {
        Headless::new(GpuContext::headless(self.adapter.as_deref())?, self.checks)
    }

    /// Opens the fastest adapter; `None` if it is a software driver, which is slower than the CPU reference, or cannot
    /// run the passes.
    fn open_hardware(&self) -> Option<Headless> {
        let context = GpuContext::headless(None).ok()?;
        let software = context.info.device_type == wgpu::DeviceType::Cpu;
        if software { None } else { Headless::new(context, self.checks).ok() }
    }
}

/// Which engine to open.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct EngineSettings {
    /// The choice between GPU and CPU. Default: [`EngineChoice::Auto`].
    pub choice: EngineChoice,
    /// Settings of the GPU, if it is used.
    pub gpu: GpuSettings,
}

/// The CPU or a GPU, on which scenes are drawn and scored.
#[derive(Debug)]
pub enum Engine {
    /// The CPU reference.
    Cpu,
    /// A GPU.
    Gpu(Box<Headless>),
}

impl Engine {
    /// Opens the engine that the settings select.
    ///
    /// # Errors
    /// The requested GPU cannot be used.
    pub fn open(settings: &EngineSettings) -> Result<Self, GpuError> {
        let gpu = |headless| Self::Gpu(Box::new(headless));
        match settings.choice {
            EngineChoice::Cpu => Ok(Self::Cpu),
            EngineChoice::Auto if settings.gpu.adapter.is_none() => {
                Ok(settings.gpu.open_hardware().map_or(Self::Cpu, gpu))
            }
            EngineChoice::Auto | EngineChoice::Gpu => settings.gpu.open().map(gpu),
        }
    }

    /// Returns the renderer of a GPU; `None` for the CPU.
    pub(crate) fn headless(&self) -> Option<&Headless> {
        match self {
            Self::Cpu => None,
            Self::Gpu(headless) => Some(headless),
        }
    }

    /// Returns `cpu` or `gpu`.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu(_) => "gpu",
        }
    }

    /// Returns a readable description: the CPU and its threads, or the adapter.
    pub fn name(&self) -> String {
        match self {
            Self::Cpu => format!("CPU, {} threads", rayon::current_num_threads()),
            Self::Gpu(headless) => AdapterDescription::of(headless).to_string(),
        }
    }

    /// Prepares a scene for drawing.
    ///
    /// # Errors
    /// The scene does not fit the GPU.
    pub fn drawing<'a>(
        &'a mut self,
        scene: &'a RuntimeScene,
        background: Background,
    ) -> Result<Box<dyn Draw + 'a>, EngineError> {
        Ok(match self {
            Self::Cpu => Box::new(CpuDrawing { scene, background }),
            Self::Gpu(headless) => Box::new(drawing_on_gpu(headless, scene, background)?),
        })
    }
}

/// Prepares a scene for drawing on a GPU.
///
/// # Errors
/// The scene does not fit the GPU.
pub(crate) fn drawing_on_gpu<'a>(
    headless: &'a mut Headless,
    scene: &RuntimeScene,
    background: Background,
) -> Result<impl Draw + use<'a>, EngineError> {
    let capture = headless.upload(scene)?;
    Ok(GpuDrawing { headless, capture, background })
}

/// A scene prepared for drawing.
pub trait Draw {
    /// Draws a view: RGB, not clamped.
    ///
    /// # Errors
    /// A picture that does not fit the memory or the GPU, a lost device.
    fn draw(&mut self, view: &View) -> Result<Picture, EngineError>;
}

/// A scene drawn by the CPU reference.
struct CpuDrawing<'a> {
    scene: &'a RuntimeScene,
    background: Background,
}

impl Draw for CpuDrawing<'_> {
    fn draw(&mut self, view: &View) -> Result<Picture, EngineError> {
        require(view.size, None)?;
        Ok(reference::render(self.scene, view, self.background).picture)
    }
}

/// A scene uploaded to the GPU.
struct GpuDrawing<'a> {
    headless: &'a mut Headless,
    capture: GpuCapture,
    background: Background,
}

impl Draw for GpuDrawing<'_> {
    fn draw(&mut self, view: &View) -> Result<Picture, EngineError> {
        require(view.size, Some(self.headless))?;
        Ok(self.headless.render(&self.capture, view, self.background)?.picture)
    }
}

/// The adapter of a GPU engine. `Display` gives one line.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct AdapterDescription {
    /// Name of the adapter.
    pub name: String,
    /// The graphics API.
    pub backend: String,
    /// Name of the driver.
    pub driver: String,
    /// Further information from the driver, such as its version.
    pub driver_info: String,
}

impl AdapterDescription {
    /// Describes the adapter of a headless renderer.
    pub fn of(headless: &Headless) -> Self {
        let info = &headless.context().info;
        Self {
            name: info.name.clone(),
            backend: info.backend.to_string(),
            driver: info.driver.clone(),
            driver_info: info.driver_info.clone(),
        }
    }
}

impl fmt::Display for AdapterDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({}, {} {})", self.name, self.backend, self.driver, self.driver_info)
    }
}
