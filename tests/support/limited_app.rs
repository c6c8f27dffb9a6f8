//! Headless Bevy apps whose device is limited.
//!
//! In: the size of a picture, and a change of the settings of the device. Out: an app that draws with such a device.

use crate::support::offscreen_app::app;
use bevy::prelude::*;
use bevy::render::renderer::RenderDevice;
use bevy::render::settings::{Backends, RenderCreation, WgpuLimits, WgpuSettings};
use bevy::render::{RenderApp, RenderPlugin};
use bevy_gs4d::GaussianCapturePlugins;
use bevy_gs4d::testing;

/// Returns the settings of the devices of tests.
pub fn device_settings() -> WgpuSettings {
    let backends = if cfg!(target_os = "linux") { Backends::VULKAN } else { Backends::PRIMARY };
    WgpuSettings { backends: Some(backends), ..default() }
}

/// Returns an app whose device is changed by `adjust`, which receives the limits of this GPU; without a GPU, reports
/// the skipped test and returns `None`.
pub fn limited_app(size: UVec2, adjust: impl FnOnce(&mut WgpuSettings, WgpuLimits)) -> Option<App> {
    let mut plain = app(size)?;
    testing::settle(&mut plain).expect("the app draws without an error");
    let limits = plain.sub_app(RenderApp).world().resource::<RenderDevice>().limits();
    drop(plain);
    let mut settings = device_settings();
    adjust(&mut settings, limits);
    let mut app = testing::app_with(size, |plugins| {
        plugins.set(RenderPlugin {
            render_creation: RenderCreation::Automatic(Box::new(settings)),
            synchronous_pipeline_compilation: true,
            ..default()
        })
    });
    app.add_plugins(GaussianCapturePlugins).insert_resource(ClearColor(Color::BLACK));
    Some(app)
}
