//! The app without a window.
//!
//! In: the size of a picture. Out: an app with Bevy's default plugins and an [`Offscreen`], in which no time passes.

use super::gpu::{backends, has_gpu};
use super::offscreen::Offscreen;
use super::window::add_window;
use bevy::DefaultPlugins;
use bevy::app::{App, PluginGroup, PluginGroupBuilder};
use bevy::asset::{AssetPlugin, Assets, UnapprovedPathMode};
use bevy::image::Image;
use bevy::log::{DEFAULT_FILTER, LogPlugin};
use bevy::render::RenderPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::settings::{RenderCreation, WgpuSettings};
use bevy::time::{Time, TimeUpdateStrategy, Virtual};
use bevy::window::{ExitCondition, WindowPlugin};
use bevy::winit::WinitPlugin;
use glam::UVec2;
use std::time::Duration;

/// Returns an app with Bevy's `DefaultPlugins` and an [`Offscreen`] of `size` pixels. No time passes in the app.
///
/// Add plugins, resources and systems to it as to any app; [`picture`](super::picture) runs it. Cameras whose target is
/// the primary window draw into the picture, one over the other in their order: the picture includes a user interface
/// and a `Camera2d` over the scene. The window is an entity that no display shows. Without a GPU nothing is drawn; all
/// other systems run.
pub fn app(size: UVec2) -> App {
    app_with(size, |plugins| plugins)
}

/// Returns the app of [`app`] with changed `DefaultPlugins`: `adjust` receives the plugin group that [`app`] adds.
pub fn app_with(size: UVec2, adjust: impl FnOnce(PluginGroupBuilder) -> PluginGroupBuilder) -> App {
    let settings = WgpuSettings { backends: has_gpu().then(backends), ..WgpuSettings::default() };
    let plugins = DefaultPlugins
        .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..WindowPlugin::default() })
        // Bevy logs each abandoned readback as a warning.
        .set(LogPlugin { filter: format!("{DEFAULT_FILTER},bevy_render::gpu_readback=error"), ..LogPlugin::default() })
        .set(AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..AssetPlugin::default() })
        .set(RenderPlugin {
            render_creation: RenderCreation::Automatic(Box::new(settings)),
            synchronous_pipeline_compilation: true,
            ..RenderPlugin::default()
        })
        .disable::<WinitPlugin>()
        // Without pipelining, each update draws its own frame.
        .disable::<PipelinedRenderingPlugin>();
    let mut app = App::new();
    app.add_plugins(adjust(plugins)).insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    // Bevy's default limits steps to a quarter of a second.
    app.world_mut().get_resource_or_init::<Time<Virtual>>().set_max_delta(Duration::MAX);
    let offscreen = Offscreen::new(&mut app.world_mut().get_resource_or_init::<Assets<Image>>(), size);
    add_window(&mut app, &offscreen);
    app.insert_resource(offscreen);
    app
}
