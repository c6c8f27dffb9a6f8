//! Apps without a renderer, in which captures play and every playback event is recorded.
//!
//! In: captures of a given duration with key-frames, time steps. Out: the playback components, and events in
//! [`event_log`].
//!
//! [`event_log`]: super::event_log

use crate::support::event_log::record;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_gs4d::playback::{MarkerReached, SegmentBoundCrossed};
use bevy_gs4d::prelude::*;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{FilterKind, GaussianScene, TemporalFilter};
use std::time::Duration;

/// Returns an app whose time advances only by [`pass`], with assets in `folder`.
pub fn app(folder: &str) -> App {
    app_with(AssetPlugin { file_path: folder.into(), ..default() })
}

/// Returns the app of [`app`] with other settings of `AssetPlugin`.
pub fn app_with(assets: AssetPlugin) -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, assets, GaussianCapturePlugins));
    // Tests also make steps longer than Bevy's limit of a quarter of a second.
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(Duration::MAX);
    record::<PlaybackStarted>(&mut app, Last);
    record::<PlaybackPaused>(&mut app, Last);
    record::<PlaybackSeeked>(&mut app, Last);
    record::<SegmentBoundCrossed>(&mut app, Last);
    record::<MarkerReached>(&mut app, Last);
    record::<PlaybackLooped>(&mut app, Last);
    record::<PlaybackEnded>(&mut app, Last);
    // No time passes in the first update, with any strategy.
    pass(&mut app, 0.0);
    app
}

/// Runs one update that advances time by `seconds`.
pub fn pass(app: &mut App, seconds: f64) {
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(seconds)));
    app.update();
}

/// Returns a scene of `seconds` seconds with a filter of `segments` segments.
pub fn scene(seconds: f32, segments: u32) -> GaussianScene {
    let count = 20;
    let settings = SynthSettings { count, degree: 0, duration_seconds: seconds, ..SynthSettings::default() };
    let bits = vec![u32::MAX >> (32 - count); segments as usize];
    let filter = TemporalFilter::from_bits(FilterKind::Support, segments, count, bits);
    GaussianScene { filter: Some(filter), ..synthesize(&settings) }
}

/// Adds a capture of [`scene`] to the assets.
pub fn capture(app: &mut App, seconds: f32, segments: u32) -> Handle<GaussianCapture> {
    let scene = scene(seconds, segments).into_runtime().expect("a synthetic scene can be drawn");
    app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(GaussianCapture::new(scene))
}

/// Returns a copy of a component of an entity.
pub fn get<C: Component + Clone>(app: &App, entity: Entity) -> C {
    app.world().get::<C>(entity).expect("the entity has this component").clone()
}

/// Changes a component of an entity.
pub fn change<C: Component<Mutability = bevy::ecs::component::Mutable>>(
    app: &mut App,
    entity: Entity,
    change: impl FnOnce(&mut C),
) {
    change(&mut app.world_mut().get_mut::<C>(entity).expect("the entity has this component"));
}
