//! The renderer's pipelines, as a resource of the render world.
//!
//! In: Bevy's render device, once when rendering starts and again after a lost device. Out: [`CaptureRenderer`], or the
//! reason for its absence in [`CaptureStatistics`].

use super::statistics::CaptureStatistics;
use crate::renderer::device::memory::catch_known;
use crate::renderer::{Renderer, ShaderChecks};
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Commands, Res};
use bevy::log::error;
use bevy::render::renderer::RenderDevice;

/// The renderer's pipelines; absent if this GPU cannot run them.
#[derive(Resource)]
pub struct CaptureRenderer(pub(crate) Renderer);

/// Compiles the renderer's pipelines. Shaders check their array indices in debug builds.
pub(super) fn init_renderer(mut commands: Commands, device: Res<RenderDevice>, statistics: Res<CaptureStatistics>) {
    let checks = if cfg!(debug_assertions) { ShaderChecks::On } else { ShaderChecks::Off };
    let device = device.wgpu_device();
    match catch_known(device, 0, || Renderer::new(device, checks)).flatten() {
        Ok(renderer) => {
            statistics.set_renderer_missing(None);
            let renderer = renderer.counting(statistics.work()).compiling_in_background();
            commands.insert_resource(CaptureRenderer(renderer));
        }
        Err(failure) => {
            error!("captures are not drawn: {failure}");
            statistics.set_renderer_missing(Some(failure.to_string()));
            commands.remove_resource::<CaptureRenderer>();
        }
    }
}
