//! Drawing many views of one scene, one after the other.
//!
//! In: an engine, a scene, views. Out: pictures.

use super::engine::Engine;
use super::failure::Failure;
use crate::reference;
use crate::renderer::{GpuCapture, Headless};
use crate::scene::RuntimeScene;
use crate::view::{Background, Picture, View};

/// A scene that is ready to be drawn.
pub struct Drawing<'a> {
    on: On<'a>,
    background: Background,
}

enum On<'a> {
    Cpu(&'a RuntimeScene),
    Gpu(&'a mut Headless, Box<GpuCapture>),
}

impl<'a> Drawing<'a> {
    /// Puts the scene where it is drawn.
    ///
    /// # Errors
    /// When it does not fit.
    pub fn of(engine: &'a mut Engine, scene: &'a RuntimeScene, background: Background) -> Result<Self, Failure> {
        let on = match engine {
            Engine::Cpu => On::Cpu(scene),
            Engine::Gpu(headless) => {
                let capture = headless.upload(scene)?;
                On::Gpu(headless, Box::new(capture))
            }
        };
        Ok(Self { on, background })
    }

    /// Draws a view.
    ///
    /// # Errors
    /// A picture that does not fit, a lost device.
    pub fn draw(&mut self, view: &View) -> Result<Picture, Failure> {
        match &mut self.on {
            On::Cpu(scene) => Ok(reference::render(scene, view, self.background).picture),
            On::Gpu(headless, capture) => Ok(headless.render(capture, view, self.background)?.picture),
        }
    }
}
