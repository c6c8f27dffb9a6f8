//! Headless Bevy apps for tests.
//!
//! In: the size of a picture. Out: an app that draws into a picture without a window, a camera of the app, and the
//! picture.

use crate::support::flat::FlatPlugin;
use crate::support::no_gpu::no_gpu;
use bevy::app::PluginGroupBuilder;
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy_gs4d::GaussianCapturePlugins;
use bevy_gs4d::testing::{self, Offscreen};
use image::RgbaImage;
use std::time::Duration;

/// Vertical field of view of every test camera, radians.
pub const FOV_Y: f32 = 0.8;

/// Returns an app without a window; without a GPU, reports the skipped test and returns `None`.
pub fn app(size: UVec2) -> Option<App> {
    if as_shipped() { app_with(size, shipped_plugins) } else { unpipelined_app(size) }
}

/// Returns the app of [`app`] without pipelined rendering, also with `GS4D_AS_SHIPPED`, for tests that count frames.
pub fn unpipelined_app(size: UVec2) -> Option<App> {
    app_with(size, |plugins| plugins)
}

fn app_with(size: UVec2, adjust: fn(PluginGroupBuilder) -> PluginGroupBuilder) -> Option<App> {
    if !testing::has_gpu() {
        no_gpu();
        return None;
    }
    let mut app = testing::app_with(size, adjust);
    app.add_plugins((GaussianCapturePlugins, FlatPlugin)).insert_resource(ClearColor(Color::BLACK));
    Some(app)
}

/// Returns whether apps run as shipped games do: without shader checks, with pipelined rendering, with pipelines
/// compiled in the background.
fn as_shipped() -> bool {
    let wanted = std::env::var_os("GS4D_AS_SHIPPED").is_some();
    assert!(!wanted || !cfg!(debug_assertions), "GS4D_AS_SHIPPED needs a build without debug assertions");
    wanted
}

fn shipped_plugins(plugins: PluginGroupBuilder) -> PluginGroupBuilder {
    plugins
        .enable::<PipelinedRenderingPlugin>()
        .set(RenderPlugin { synchronous_pipeline_compilation: false, ..default() })
}

/// Spawns a camera without tonemapping and dithering, so that its pixels can be compared.
pub fn spawn_camera(app: &mut App, msaa: Msaa, transform: Transform) -> Entity {
    let target = app.world().resource::<Offscreen>().target();
    let lens = Projection::Perspective(PerspectiveProjection { fov: FOV_Y, ..default() });
    let appearance = (Tonemapping::None, DebandDither::Disabled);
    app.world_mut().spawn((Camera3d::default(), target, msaa, lens, appearance, transform)).id()
}

/// Runs frames. The app must not exit.
pub fn run_frames(app: &mut App, frames: usize) {
    for frame in 0..frames {
        app.update();
        assert!(app.should_exit().is_none(), "the app goes on in frame {frame}; the log has the reason of its end");
    }
}

/// Returns the picture after another `seconds` seconds.
pub fn picture(app: &mut App, seconds: f32) -> RgbaImage {
    testing::picture(app, Duration::from_secs_f32(seconds)).expect("the app draws without an error")
}
