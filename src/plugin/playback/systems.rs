//! The systems that advance clocks and captures.
//!
//! In: Bevy's time, shared clocks, and the duration of each loaded capture. Out: [`Playback::time`] of every entity
//! with a capture, and messages about playback; a warning for each entity without the handle of a capture.

use super::clock::PlaybackClock;
use super::component::Playback;
use super::drive::{Following, Shown};
use super::markers::Markers;
use super::messages::Announcer;
use super::stall::Stall;
use super::state::PlaybackState;
use super::timeline::{TimelinePlayer, TimelineTrack};
use crate::plugin::asset::Uploads;
use crate::plugin::component::{GaussianCapture, GaussianCapture3d};
use bevy::asset::{AssetId, Assets};
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::{Changed, QueryFilter, Without};
use bevy::ecs::schedule::SystemSet;
use bevy::ecs::system::{Query, Res};
use bevy::log::{debug_span, warn};
use bevy::time::Time;

/// Sets of playback systems, in this order: all but the last in `Update`.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum PlaybackSystems {
    /// Clocks with [`ClockSource::Game`](super::ClockSource::Game) advance. Set manual clocks `.before` this set.
    Clocks,
    /// Timelines advance and set up their tracks.
    Timelines,
    /// Captures advance. Systems `.before` this set can change the speed; systems `.after` it read the time that will
    /// be drawn, and may still change it, of a capture in chunk files `.before`
    /// [`CaptureStreamSystems`](crate::stream::CaptureStreamSystems).
    Advance,
    /// Entities with a [`CaptureCollider`](super::CaptureCollider) get the mesh of the time of their capture. Systems
    /// `.after` this set, physics in `PostUpdate`, and in the next frame that in the fixed schedules, have that mesh. A
    /// time that is changed after this set, as by Bevy's animations, counts in the next frame.
    Colliders,
    /// In `PostUpdate`, after Bevy's animations, which may change the time, and before transforms are propagated:
    /// entities with a [`CaptureSocket`](super::CaptureSocket) get their transforms.
    Sockets,
}

/// Advances the clocks with [`ClockSource::Game`](super::ClockSource::Game).
pub(super) fn run_clocks(time: Res<Time>, mut clocks: Query<&mut PlaybackClock>) {
    let _span = debug_span!("gs4d/clocks").entered();
    for mut clock in &mut clocks {
        let mut next = *clock;
        next.advance(time.delta_secs_f64());
        clock.set_if_neq(next);
    }
}

/// Advances the playback of every loaded capture, followed captures before their followers. No time passes before the
/// first drawn frame of a capture, and while it is stalled.
pub(super) fn advance_captures(
    time: Res<Time>,
    captures: Res<Assets<GaussianCapture>>,
    uploads: Res<Uploads>,
    following: Following,
    clocks: Query<&PlaybackClock>,
    others: Query<(&Playback, &PlaybackState), (Without<GaussianCapture3d>, Without<TimelinePlayer>)>,
    mut players: Query<
        (Entity, &GaussianCapture3d, &mut Playback, &mut PlaybackState, Option<&Markers>, Option<&Stall>),
        Without<TimelinePlayer>,
    >,
    mut announcer: Announcer,
) {
    let _span = debug_span!("gs4d/playback").entered();
    let order = following.order(players.iter().map(|(entity, ..)| entity));
    for player in order {
        let Ok((_, handle, _, state, _, stall)) = players.get(player) else { continue };
        let (id, mut state) = (handle.0.id(), state.clone());
        let Some(capture) = captures.get(id) else { continue };
        state.play_asset(id.untyped());
        let awaited = stall.is_some_and(|stall| stall.waits)
            || state.is_unplayed() && (uploads.awaits(id) || uploads.is_blank(id, capture));
        let shown = |clock: Entity| {
            let by_player = |(playback, state): (&Playback, &PlaybackState)| Shown::by_player(playback, state);
            let by_clock = clocks.get(clock).ok().map(Shown::by_clock);
            let by_capture = || players.get(clock).ok().map(|(_, _, playback, state, ..)| by_player((playback, state)));
            by_clock.or_else(by_capture).or_else(|| others.get(clock).ok().map(by_player))
        };
        let drive = following.drive(player, &time, shown, &mut state).unless(awaited);
        let Ok((entity, handle, mut playback, mut kept, markers, _)) = players.get_mut(player) else { continue };
        let Some(capture) = captures.get(&handle.0) else { continue };
        let (next, progress) = state.advance(*playback, drive, capture.duration_seconds());
        *kept = state;
        // A playback that does not change is not marked as changed.
        playback.set_if_neq(next);
        let key_frames = capture.key_frames();
        announcer.report(entity, &progress, |announcer, leg| {
            if let Some(key_frames) = &key_frames {
                announcer.bounds(entity, key_frames, leg);
            }
            if let Some(Markers(markers)) = markers {
                announcer.markers(entity, markers, leg);
            }
        });
    }
}

/// Logs a warning for each entity with the default handle. Tracks get their handles from their timeline.
pub(super) fn warn_of_missing_handles(
    captures: Res<Assets<GaussianCapture>>,
    changed: Query<(Entity, &GaussianCapture3d), (Changed<GaussianCapture3d>, Without<TimelineTrack>)>,
) {
    for entity in without_handle(&captures, &changed) {
        warn!(
            "{entity} has a GaussianCapture3d with the default handle, which has no asset, so that nothing is drawn: \
             set the handle that AssetServer::load or Assets::add returns"
        );
    }
}

/// Returns the entities with the default handle, unless an asset has been inserted under that handle.
fn without_handle<F: QueryFilter>(
    captures: &Assets<GaussianCapture>,
    placed: &Query<(Entity, &GaussianCapture3d), F>,
) -> Vec<Entity> {
    let lacks = |id: AssetId<GaussianCapture>| id == AssetId::default() && !captures.contains(id);
    placed.iter().filter(|(_, capture)| lacks(capture.0.id())).map(|(entity, _)| entity).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::app::App;
    use bevy::asset::Handle;
    use bevy::ecs::system::RunSystemOnce;

    #[test]
    fn entities_with_the_default_handle_are_found() {
        let mut app = App::new();
        app.init_resource::<Assets<GaussianCapture>>();
        let reserved: Handle<GaussianCapture> = app.world().resource::<Assets<GaussianCapture>>().reserve_handle();
        let without = app.world_mut().spawn(GaussianCapture3d::default()).id();
        app.world_mut().spawn(GaussianCapture3d(reserved));
        app.world_mut().spawn(TimelineTrack::default());
        let find = |captures: Res<Assets<GaussianCapture>>,
                    placed: Query<(Entity, &GaussianCapture3d), Without<TimelineTrack>>| {
            without_handle(&captures, &placed)
        };
        let found = app.world_mut().run_system_once(find).expect("the system's resources exist");
        assert_eq!(found, [without], "an entity with a reserved handle and a track are not found");
    }
}
