//! The group of plugins: parts that are left out, and plugins in another order.
//!
//! In: apps with some of the plugins, added in any order. Out: proof that the app goes on, that captures load, play and
//! are drawn as far as the plugins allow it, and that the log has one warning with the remedy. The test that draws is
//! skipped without a GPU.

use crate::support::cpu_reference::{SIZE, eye};
use crate::support::fixtures::{lone, spawn};
use crate::support::logged::warnings_of;
use crate::support::no_gpu::no_gpu;
use crate::support::offscreen_app::{picture, spawn_camera};
use bevy::app::{PluginGroupBuilder, SubApp};
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::time::TimeUpdateStrategy;
use bevy_gs4d::asset::CaptureAssetPlugin;
use bevy_gs4d::pbr::CapturePbrPlugin;
use bevy_gs4d::picking_backend::CapturePickingPlugin;
use bevy_gs4d::playback::CapturePlaybackPlugin;
use bevy_gs4d::prelude::*;
use bevy_gs4d::render::CaptureRenderPlugin;
use bevy_gs4d::sound::CaptureSoundPlugin;
use bevy_gs4d::stereo::StereoPlugin;
use bevy_gs4d::testing;
use image::RgbaImage;
use std::time::Duration;

/// Returns the group without one of its parts.
fn without<P: Plugin>() -> PluginGroupBuilder {
    GaussianCapturePlugins.build().disable::<P>()
}

/// Starts an app, as a runner does, and returns the warnings of its start.
fn start(app: &mut App) -> Vec<String> {
    warnings_of(|| {
        app.finish();
        app.cleanup();
    })
}

/// Runs updates of a quarter of a second.
fn pass(app: &mut App, updates: usize) {
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(250)));
    for _ in 0..updates {
        app.update();
    }
}

/// Spawns a capture that plays. The app has been started.
fn play(app: &mut App) -> Entity {
    let capture = spawn(app, &lone(Vec3::X), ());
    app.world_mut().entity_mut(capture).insert(Playback::default());
    capture
}

fn time(app: &App, capture: Entity) -> f32 {
    app.world().get::<Playback>(capture).expect("captures have a playback").time
}

#[test]
fn every_part_of_the_group_can_be_left_out() {
    let parts = [
        without::<CapturePlaybackPlugin>(),
        without::<CaptureRenderPlugin>(),
        without::<StereoPlugin>(),
        without::<CapturePbrPlugin>(),
        without::<CapturePickingPlugin>(),
        without::<CaptureSoundPlugin>(),
    ];
    for (index, parts) in parts.into_iter().enumerate() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default(), parts));
        assert_eq!(start(&mut app), [""; 0], "nothing is missing without part {index}");
        let capture = play(&mut app);
        pass(&mut app, 3);
        let state = app.world().get::<CaptureState>(capture);
        assert_eq!(state, Some(&CaptureState::Ready), "captures are loaded without part {index}");
        let plays = index != 0;
        assert_eq!(time(&app, capture) > 0.0, plays, "captures play unless the part that plays them is left out");
    }
}

#[test]
fn without_the_part_that_plays_a_capture_has_the_time_that_the_game_sets() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), without::<CapturePlaybackPlugin>()));
    start(&mut app);
    let capture = play(&mut app);
    app.world_mut().entity_mut(capture).insert(Playback { time: 0.75, ..Playback::default() });
    pass(&mut app, 2);
    assert_eq!(time(&app, capture), 0.75, "the time stays as it is set");
}

#[test]
fn parts_without_the_part_that_loads_are_named_and_have_no_effect() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), without::<CaptureAssetPlugin>()));
    let warnings = start(&mut app);
    for part in ["CapturePlaybackPlugin", "CaptureRenderPlugin", "CaptureSoundPlugin", "CapturePickingPlugin"] {
        let about =
            warnings.iter().filter(|warning| warning.starts_with(part) && warning.contains("CaptureAssetPlugin"));
        assert_eq!(about.count(), 1, "one warning names {part} and what it needs: {warnings:?}");
    }
    app.world_mut().spawn(GaussianCapture3d::default());
    pass(&mut app, 2);
}

#[test]
fn plugins_added_before_those_of_bevy_are_set_up_when_the_app_starts() {
    let mut app = App::new();
    app.add_plugins((GaussianCapturePlugins, MinimalPlugins, AssetPlugin::default()));
    let warnings = start(&mut app);
    let said =
        matches!(&warnings[..], [one] if one.contains("before Bevy's AssetPlugin") && one.contains("add them after"));
    assert!(said, "one warning with the remedy: {warnings:?}");
    let capture = play(&mut app);
    pass(&mut app, 3);
    assert!(time(&app, capture) > 0.0, "captures play");
}

#[test]
fn an_app_without_assets_or_without_time_goes_on_with_a_warning() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, GaussianCapturePlugins));
    let warnings = start(&mut app);
    let said = matches!(&warnings[..], [one] if one.contains("AssetPlugin") && one.contains("add DefaultPlugins"));
    assert!(said, "without assets, one warning with the remedy: {warnings:?}");
    pass(&mut app, 2);

    let mut app = App::new();
    app.add_plugins((TaskPoolPlugin::default(), AssetPlugin::default(), GaussianCapturePlugins));
    let warnings = start(&mut app);
    let said = matches!(&warnings[..], [one] if one.contains("TimePlugin") && one.contains("add DefaultPlugins"));
    assert!(said, "without time, one warning with the remedy: {warnings:?}");
    let capture = play(&mut app);
    pass(&mut app, 2);
    assert_eq!(time(&app, capture), 0.0, "without time, captures stay at their first moment");
}

#[test]
fn a_renderer_that_is_added_later_is_a_warning() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), GaussianCapturePlugins));
    // As RenderPlugin does.
    app.insert_sub_app(RenderApp, SubApp::new());
    let warnings = start(&mut app);
    let said = matches!(&warnings[..], [one] if one.starts_with("Bevy's RenderPlugin was added after"));
    assert!(said, "one warning with the remedy: {warnings:?}");
    let capture = play(&mut app);
    pass(&mut app, 3);
    assert!(time(&app, capture) > 0.0, "captures play");
}

#[test]
fn the_stereo_plugin_may_be_added_before_or_after() {
    for before in [true, false] {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default()));
        if before {
            app.add_plugins((StereoPlugin, GaussianCapturePlugins));
        } else {
            app.add_plugins((GaussianCapturePlugins, StereoPlugin));
        }
        app.update();
        assert!(app.is_plugin_added::<StereoPlugin>(), "adding the stereo plugin again is allowed");
    }
}

/// Returns the picture of a capture.
fn seen(mut app: App) -> RgbaImage {
    app.insert_resource(ClearColor(Color::BLACK));
    testing::settle(&mut app).expect("an app without captures is drawn");
    spawn(&mut app, &lone(Vec3::X), ());
    spawn_camera(&mut app, Msaa::Off, eye());
    picture(&mut app, 0.0)
}

#[test]
fn captures_are_drawn_whatever_the_order_of_the_plugins() {
    if !testing::has_gpu() {
        return no_gpu();
    }
    let mut usual = testing::app(SIZE);
    usual.add_plugins(GaussianCapturePlugins);
    let expected = seen(usual);
    assert!(expected.pixels().any(|pixel| pixel.0[0] > 200), "the capture is drawn");
    let first = testing::app_with(SIZE, |plugins| {
        plugins
            .add_before::<AssetPlugin>(CaptureAssetPlugin)
            .add_before::<AssetPlugin>(CapturePlaybackPlugin)
            .add_before::<AssetPlugin>(CaptureRenderPlugin)
            .add_before::<AssetPlugin>(CapturePbrPlugin)
            .add_before::<AssetPlugin>(CapturePickingPlugin)
    });
    assert!(seen(first) == expected, "plugins before those of Bevy draw the same picture");
}
