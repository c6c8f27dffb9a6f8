//! GPU times on devices without timestamps inside passes, such as some of Metal.
//!
//! In: a device without the feature. Out: proof that the frame is measured as a whole. Skipped without a GPU, or on a
//! GPU without timestamps.

use crate::support::fixtures::{spawn, synthetic};
use crate::support::no_gpu::no_gpu;
use crate::support::offscreen_app::spawn_camera;
use crate::support::skip::skip;
use bevy::prelude::*;
use bevy::render::renderer::RenderDevice;
use bevy::render::settings::{Backends, RenderCreation, WgpuFeatures, WgpuSettings};
use bevy::render::{RenderApp, RenderPlugin};
use bevy_gs4d::GaussianCapturePlugins;
use bevy_gs4d::render::CaptureStatistics;
use bevy_gs4d::testing;

#[test]
fn a_device_without_timestamps_inside_passes_measures_the_whole_frame() {
    if !testing::has_gpu() {
        return no_gpu();
    }
    let backends = if cfg!(target_os = "linux") { Backends::VULKAN } else { Backends::PRIMARY };
    let disabled_features = Some(WgpuFeatures::TIMESTAMP_QUERY_INSIDE_PASSES);
    let settings = WgpuSettings { backends: Some(backends), disabled_features, ..default() };
    let mut app = testing::app_with(UVec2::new(64, 48), |plugins| {
        plugins.set(RenderPlugin {
            render_creation: RenderCreation::Automatic(Box::new(settings)),
            synchronous_pipeline_compilation: true,
            ..default()
        })
    });
    app.add_plugins(GaussianCapturePlugins);
    spawn(&mut app, &synthetic(500, 1, false), Transform::default());
    let eye = Transform::from_xyz(0.5, -3.0, 1.5).looking_at(Vec3::ZERO, Vec3::Z);
    let camera = spawn_camera(&mut app, Msaa::Off, eye);
    testing::settle(&mut app).expect("the app draws without an error");
    let features = app.sub_app(RenderApp).world().resource::<RenderDevice>().features();
    if !features.contains(WgpuFeatures::TIMESTAMP_QUERY) {
        return skip("the GPU has no timestamps");
    }
    assert!(!features.contains(WgpuFeatures::TIMESTAMP_QUERY_INSIDE_PASSES), "the feature is disabled");
    let statistics = app.world().resource::<CaptureStatistics>().clone();
    statistics.measure(true);
    for _ in 0..20 {
        app.update();
    }
    let passes = statistics.view(camera).expect("the camera draws").passes;
    let names: Vec<&str> = passes.iter().map(|pass| pass.name).collect();
    assert_eq!(names, ["frame"], "one time of the whole frame");
    assert!(passes[0].milliseconds > 0.0, "the frame takes {} ms", passes[0].milliseconds);
}
