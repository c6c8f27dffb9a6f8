//! Drawing many views of one scene after the other.
//!
//! In: scenes and views. Out: pictures, from the GPU.

use crate::failure::Failure;
use crate::gpu::{self, GpuArgs};
use bevy_gs4d::frame::Background;
use bevy_gs4d::gaussian::View;
use bevy_gs4d::gpu::{GpuCapture, Headless};
use bevy_gs4d::picture::Picture;
use bevy_gs4d::scene::RuntimeScene;
use serde_json::Value;

/// A GPU, and the scene that it draws.
pub struct Drawing {
    headless: Headless,
    subject: Option<(GpuCapture, Background)>,
}

impl Drawing {
    /// Opens the GPU.
    ///
    /// # Errors
    /// No such adapter, or one that cannot run the passes.
    pub fn open(gpu: &GpuArgs) -> Result<Self, Failure> {
        Ok(Self { headless: gpu.open()?, subject: None })
    }

    /// Puts a scene on the GPU, instead of the one before.
    ///
    /// # Errors
    /// When it does not fit.
    pub fn take(&mut self, scene: &RuntimeScene, background: Option<[f32; 3]>) -> Result<(), Failure> {
        // Both at once may not fit.
        self.subject = None;
        let background = background.map_or(Background::trained(scene), Background::Color);
        self.subject = Some((self.headless.upload(scene)?, background));
        Ok(())
    }

    /// Draws a view of the scene taken last.
    ///
    /// # Errors
    /// No scene was taken; a picture that does not fit; a lost device.
    pub fn draw(&mut self, view: &View) -> Result<Picture, Failure> {
        let (capture, background) = self.subject.as_ref().ok_or_else(|| Failure::new("no scene to draw"))?;
        Ok(self.headless.render(capture, view, *background)?.picture)
    }

    /// The name of the GPU, for people.
    pub fn adapter(&self) -> String {
        gpu::adapter_name(&self.headless)
    }

    /// The GPU, for programs.
    pub fn adapter_json(&self) -> Value {
        gpu::adapter_json(&self.headless)
    }
}
