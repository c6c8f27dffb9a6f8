//! The playback plugin: the order of its systems.
//!
//! In: an app with Bevy's `AssetPlugin` and `TimePlugin`. Out: advancing clocks, timelines and captures.

use super::clock::PlaybackClock;
use super::collider::{CaptureColliderChanged, ColliderState, update_colliders};
use super::component::Playback;
use super::messages::{
    MarkerReached, PlaybackEnded, PlaybackLooped, PlaybackPaused, PlaybackSeeked, PlaybackStarted, SegmentBoundCrossed,
};
use super::socket::{CaptureSocket, place_sockets};
use super::systems::{PlaybackSystems, advance_captures, run_clocks, warn_of_missing_handles};
use super::timeline::{Timeline, TimelineLoader, TimelinePlayer, advance_timelines, bind_tracks, update_tracks};
use crate::plugin::asset::{set_up, set_up_late};
use crate::plugin::component::GaussianCapture3d;
use bevy::app::{AnimationSystems, App, Last, Plugin, PostUpdate, Update};
use bevy::asset::AssetApp;
use bevy::ecs::query::Changed;
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::ecs::schedule::common_conditions::{any_match_filter, any_with_component};
use bevy::log::warn;
use bevy::time::Time;
use bevy::transform::TransformSystems;

/// Plays captures and timelines. Part of [`GaussianCapturePlugins`](crate::GaussianCapturePlugins). Without it,
/// captures show the time that the game sets in their [`Playback`].
#[derive(Debug, Default, Clone, Copy)]
pub struct CapturePlaybackPlugin;

impl Plugin for CapturePlaybackPlugin {
    fn build(&self, app: &mut App) {
        set_up::<Self>(app, add);
    }

    fn finish(&self, app: &mut App) {
        set_up_late::<Self>(app, "CapturePlaybackPlugin", add);
        if !app.world().contains_resource::<Time>() {
            warn!(
                "CapturePlaybackPlugin needs Bevy's TimePlugin, which this app does not have, so that captures stay at \
                 their first moment: add DefaultPlugins or MinimalPlugins, or TimePlugin itself"
            );
            app.init_resource::<Time>();
        }
    }
}

fn add(app: &mut App) {
    use PlaybackSystems::{Advance, Clocks, Colliders, Sockets, Timelines};
    require_playback(app);
    app.init_asset::<Timeline>()
        .init_asset_loader::<TimelineLoader>()
        .add_message::<PlaybackStarted>()
        .add_message::<PlaybackPaused>()
        .add_message::<PlaybackSeeked>()
        .add_message::<SegmentBoundCrossed>()
        .add_message::<MarkerReached>()
        .add_message::<PlaybackLooped>()
        .add_message::<PlaybackEnded>()
        .add_message::<CaptureColliderChanged>()
        .configure_sets(Update, (Clocks, Timelines, Advance, Colliders).chain())
        .configure_sets(PostUpdate, Sockets.after(AnimationSystems).before(TransformSystems::Propagate))
        .add_systems(
            Update,
            (
                run_clocks.run_if(any_with_component::<PlaybackClock>).in_set(Clocks),
                (bind_tracks, advance_timelines, update_tracks)
                    .chain()
                    .run_if(any_with_component::<TimelinePlayer>)
                    .in_set(Timelines),
                advance_captures.in_set(Advance),
                update_colliders.run_if(any_with_component::<ColliderState>).in_set(Colliders),
            ),
        )
        .add_systems(PostUpdate, place_sockets.run_if(any_with_component::<CaptureSocket>).in_set(Sockets))
        // The game may still set a handle in the same frame.
        .add_systems(Last, warn_of_missing_handles.run_if(any_match_filter::<Changed<GaussianCapture3d>>));
}

/// Makes [`Playback`] a required component of captures: it has the time that is played, and the time that is drawn.
pub(crate) fn require_playback(app: &mut App) {
    // `CapturePlaybackPlugin` and `CaptureRenderPlugin` both register it: an error says that the other did.
    let _ = app.try_register_required_components::<GaussianCapture3d, Playback>();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plugin::asset::{CaptureAssetPlugin, CaptureFailure, Uploads};
    use crate::plugin::component::GaussianCapture;
    use crate::plugin::playback::clock::FollowsClock;
    use crate::plugin::playback::markers::{Marker, Markers};
    use crate::plugin::playback::timeline::{Clip, TimelineTrack, Track};
    use crate::scene::synth::{SynthSettings, synthesize};
    use bevy::MinimalPlugins;
    use bevy::asset::{AssetPlugin, AssetServer, Assets, Handle};
    use bevy::ecs::bundle::Bundle;
    use bevy::ecs::entity::Entity;
    use bevy::ecs::observer::On;
    use bevy::ecs::resource::Resource;
    use bevy::ecs::system::{Commands, ResMut};
    use bevy::time::TimeUpdateStrategy;
    use std::io;
    use std::sync::mpsc;
    use std::time::{Duration, Instant};

    /// Longest time for a task.
    const TIMEOUT: Duration = Duration::from_secs(60);

    /// The names of the reached markers.
    #[derive(Resource, Default)]
    struct Reached(Vec<String>);

    /// Returns an app in which captures wait for uploads, and the uploads, which the test completes.
    fn app() -> (App, Uploads) {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default(), CaptureAssetPlugin, CapturePlaybackPlugin));
        app.init_resource::<Reached>();
        app.add_observer(|marker: On<MarkerReached>, mut reached: ResMut<Reached>| reached.0.push(marker.name.clone()));
        let uploads = app.world().resource::<Uploads>().clone();
        uploads.expect();
        // No time passes in the first update.
        pass(&mut app, 1);
        (app, uploads)
    }

    /// Runs updates of a quarter of a second.
    fn pass(app: &mut App, updates: usize) {
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(250)));
        for _ in 0..updates {
            app.update();
        }
    }

    /// Adds a capture of two seconds.
    fn capture(app: &mut App) -> Handle<GaussianCapture> {
        let settings = SynthSettings { count: 20, degree: 0, duration_seconds: 2.0, ..SynthSettings::default() };
        let scene = synthesize(&settings).into_runtime().expect("a synthetic scene can be drawn");
        app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(GaussianCapture::new(scene))
    }

    fn spawn(app: &mut App, capture: &Handle<GaussianCapture>, bundle: impl Bundle) -> Entity {
        app.world_mut().spawn((GaussianCapture3d(capture.clone()), bundle)).id()
    }

    /// Spawns the player of a timeline with one track for each capture, and a marker at its start.
    fn spawn_timeline(app: &mut App, captures: &[&Handle<GaussianCapture>]) -> Entity {
        let clip = |capture: &Handle<GaussianCapture>| Clip {
            capture: capture.clone(),
            start: 0.0,
            range: [0.0, 2.0],
            speed: 1.0,
            fade: [0.0; 2],
        };
        let tracks = captures.iter().enumerate();
        let tracks = tracks.map(|(index, capture)| Track { name: index.to_string(), clips: vec![clip(capture)] });
        let markers = vec![Marker { time: 0.0, name: "start".into() }];
        let timeline = Timeline::new(tracks.collect(), markers, None).expect("the timeline is valid");
        let timeline = app.world_mut().resource_mut::<Assets<Timeline>>().add(timeline);
        app.world_mut().spawn(TimelinePlayer(timeline)).id()
    }

    fn time(app: &App, player: Entity) -> f32 {
        app.world().get::<Playback>(player).expect("every player has a playback").time
    }

    fn reached(app: &App) -> &[String] {
        &app.world().resource::<Reached>().0
    }

    #[test]
    fn a_capture_stays_at_its_first_moment_until_it_is_drawn() {
        let (mut app, uploads) = app();
        let capture = capture(&mut app);
        let player = spawn(&mut app, &capture, Markers::new([(0.0, "start"), (0.5, "middle")]));
        let backwards = spawn(&mut app, &capture, Playback { speed: -1.0, time: 2.0, ..Playback::once() });
        let follower = spawn(&mut app, &capture, FollowsClock(player));
        let song = app.world_mut().spawn(PlaybackClock::default()).id();
        let singer = spawn(&mut app, &capture, FollowsClock(song));
        pass(&mut app, 3);
        let times = |app: &App| [player, backwards, follower, singer].map(|entity| time(app, entity));
        assert_eq!(times(&app), [0.0, 2.0, 0.0, 0.75], "only the follower of a clock advances");
        assert_eq!(reached(&app), [""; 0], "no marker is reached before the first drawn frame");
        uploads.finish(capture.id());
        pass(&mut app, 2);
        assert_eq!(times(&app), [0.5, 1.5, 0.5, 1.25], "after the upload all captures advance");
        assert_eq!(reached(&app), ["start", "middle"], "playback reaches all markers");
        uploads.begin(capture.id(), false);
        pass(&mut app, 2);
        assert_eq!(times(&app), [1.0, 1.0, 1.0, 1.75], "captures advance while the capture is uploaded again");
    }

    #[test]
    fn a_capture_whose_upload_fails_still_plays() {
        let (mut app, uploads) = app();
        let capture = capture(&mut app);
        let player = spawn(&mut app, &capture, ());
        pass(&mut app, 1);
        uploads.fail(capture.id(), CaptureFailure::NotLoaded("no room".to_owned()));
        pass(&mut app, 2);
        assert_eq!(time(&app, player), 0.5, "playback does not wait for a failed upload");
    }

    #[test]
    fn a_timeline_stays_at_its_start_until_all_its_captures_are_drawn() {
        let (mut app, uploads) = app();
        let [first, second] = [(); 2].map(|()| capture(&mut app));
        let player = spawn_timeline(&mut app, &[&first, &second]);
        pass(&mut app, 2);
        uploads.finish(first.id());
        pass(&mut app, 2);
        assert_eq!((time(&app, player), reached(&app).len()), (0.0, 0), "the timeline waits for the second capture");
        uploads.finish(second.id());
        pass(&mut app, 1);
        assert_eq!(time(&app, player), 0.25, "the timeline advances once all captures are uploaded");
        assert_eq!(reached(&app), ["start"], "the marker at the start is reached");
    }

    #[test]
    fn a_timeline_that_is_despawned_in_its_first_frame_leaves_no_track() {
        let (mut app, _) = app();
        let capture = capture(&mut app);
        let player = spawn_timeline(&mut app, &[&capture]);
        let despawn = move |mut commands: Commands| commands.entity(player).try_despawn();
        // The player is there when its tracks are requested.
        app.add_systems(Update, despawn.before_ignore_deferred(PlaybackSystems::Timelines));
        pass(&mut app, 1);
        let mut tracks = app.world_mut().query::<&TimelineTrack>();
        assert_eq!(tracks.iter(app.world()).count(), 0, "no entity of a track is left");
    }

    #[test]
    fn a_timeline_waits_for_captures_that_load_and_not_for_failed_ones() {
        let (mut app, uploads) = app();
        let there = capture(&mut app);
        uploads.finish(there.id());
        let (give_up, gate) = mpsc::channel::<io::Error>();
        let load =
            async move { Err::<GaussianCapture, _>(gate.recv_timeout(TIMEOUT).unwrap_or_else(io::Error::other)) };
        let server = app.world().resource::<AssetServer>().clone();
        let loading = server.add_async(load);
        let player = spawn_timeline(&mut app, &[&there, &loading]);
        pass(&mut app, 3);
        assert_eq!(time(&app, player), 0.0, "the timeline waits for the capture that is still loading");
        give_up.send(io::Error::other("the disk is full")).expect("the task receives the error");
        let began = Instant::now();
        while !server.get_load_state(loading.id()).is_some_and(|state| state.is_failed()) {
            assert!(began.elapsed() < TIMEOUT, "the failed load state arrives in time");
            app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
            app.update();
        }
        pass(&mut app, 1);
        assert_eq!(time(&app, player), 0.25, "the timeline plays without the failed capture");
    }
}
