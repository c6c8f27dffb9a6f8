//! The systems that play timelines.
//!
//! In: loaded timelines and their players. Out: an entity for each track, with the capture, playback, fade and
//! visibility of the track's clip at the current time.

use super::asset::Timeline;
use super::clip::Clip;
use super::next::NextClip;
use super::player::{ClipFade, PlayedClip, TimelinePlayer, TimelineTrack};
use crate::plugin::asset::Uploads;
use crate::plugin::component::{GaussianCapture, GaussianCapture3d};
use crate::plugin::playback::clock::{FollowsClock, PlaybackClock};
use crate::plugin::playback::component::Playback;
use crate::plugin::playback::drive::{Following, Shown};
use crate::plugin::playback::messages::Announcer;
use crate::plugin::playback::stall::Stall;
use crate::plugin::playback::state::PlaybackState;
use bevy::asset::{AssetServer, Assets, LoadState, UntypedAssetId};
use bevy::camera::visibility::Visibility;
use bevy::ecs::change_detection::{DetectChangesMut, Mut};
use bevy::ecs::entity::Entity;
use bevy::ecs::hierarchy::Children;
use bevy::ecs::query::{With, Without};
use bevy::ecs::system::{Commands, Query, Res};
use bevy::ecs::world::EntityWorldMut;
use bevy::log::debug_span;
use bevy::time::Time;

/// Spawns an entity for every track without one, and makes the entities follow the player's clock.
pub(in crate::plugin::playback) fn bind_tracks(
    timelines: Res<Assets<Timeline>>,
    players: Query<(Entity, &TimelinePlayer, Option<&Children>)>,
    tracks: Query<(&TimelineTrack, Option<&FollowsClock>)>,
    mut commands: Commands,
) {
    for (player, handle, children) in &players {
        let Some(timeline) = timelines.get(&handle.0) else { continue };
        let follows = FollowsClock(player);
        let children = children.map_or(&[][..], |children| &children[..]);
        for &child in children {
            if tracks.get(child).is_ok_and(|(_, followed)| followed != Some(&follows)) {
                commands.entity(child).try_insert(follows);
            }
        }
        for track in timeline.tracks() {
            let plays = |child: &Entity| tracks.get(*child).is_ok_and(|(name, _)| name.0 == track.name);
            if !children.iter().any(plays) {
                let track = (TimelineTrack(track.name.clone()), follows);
                // Another system may despawn the player before.
                commands.entity(player).queue_silenced(move |mut player: EntityWorldMut| {
                    player.with_child(track);
                });
            }
        }
    }
}

/// Advances the playheads, followed players before their followers. Captures advance later: a timeline that follows a
/// capture is one frame behind. Playback begins once the captures of all clips can be drawn and the sounds are loaded,
/// and waits for a track that shows a clip and stalls.
pub(in crate::plugin::playback) fn advance_timelines(
    time: Res<Time>,
    timelines: Res<Assets<Timeline>>,
    captures: Res<Assets<GaussianCapture>>,
    uploads: Res<Uploads>,
    server: Res<AssetServer>,
    following: Following,
    clocks: Query<&PlaybackClock, Without<TimelinePlayer>>,
    others: Query<(&Playback, &PlaybackState), Without<TimelinePlayer>>,
    stalls: Query<(&Stall, &Visibility), With<TimelineTrack>>,
    mut players: Query<(
        Entity,
        &TimelinePlayer,
        &mut Playback,
        &mut PlaybackState,
        &mut PlaybackClock,
        Option<&Children>,
    )>,
    mut announcer: Announcer,
) {
    let _span = debug_span!("gs4d/timelines").entered();
    let order = following.order(players.iter().map(|(entity, ..)| entity));
    for player in order {
        let (id, mut state) = match players.get(player) {
            Ok((_, handle, _, state, ..)) if timelines.contains(&handle.0) => (handle.0.id(), state.clone()),
            Ok(_) | Err(_) => continue,
        };
        state.play_asset(id.untyped());
        let shown = |leader: Entity| {
            let by_timeline = players.get(leader).ok().map(|(.., clock, _)| Shown::by_clock(clock));
            let by_clock = || clocks.get(leader).ok().map(Shown::by_clock);
            let by_player = || others.get(leader).ok().map(|(playback, state)| Shown::by_player(playback, state));
            by_timeline.or_else(by_clock).or_else(by_player)
        };
        let drive = following.drive(player, &time, shown, &mut state);
        let Ok((entity, handle, mut playback, mut kept, mut clock, children)) = players.get_mut(player) else {
            continue;
        };
        let Some(timeline) = timelines.get(&handle.0) else { continue };
        let mut clips = timeline.tracks().iter().flat_map(|track| &track.clips);
        let holds =
            |(stall, visibility): (&Stall, &Visibility)| stall.holds_timeline && visibility != Visibility::Hidden;
        let awaited = children.is_some_and(|children| stalls.iter_many(children).any(holds))
            || state.is_unplayed()
                && (clips.any(|clip| awaits(clip, &captures, &uploads, &server))
                    || timeline.sounds().iter().any(|clip| loads(clip.sound.id(), &server)));
        let jumps = state.jumps;
        let (next, progress) = state.advance(*playback, drive.unless(awaited), timeline.duration_seconds());
        playback.set_if_neq(next);
        let mut shown = *clock;
        if state.jumps != jumps {
            shown.seek(state.seconds());
        } else {
            shown.set(state.seconds());
        }
        *kept = state;
        clock.set_if_neq(shown);
        announcer.report(entity, &progress, |announcer, leg| announcer.markers(entity, timeline.markers(), leg));
    }
}

/// Returns whether a clip's capture is being loaded, or uploaded for the first time. A failed capture is not awaited.
fn awaits(clip: &Clip, captures: &Assets<GaussianCapture>, uploads: &Uploads, server: &AssetServer) -> bool {
    let id = clip.capture.id();
    if captures.contains(id) {
        return uploads.awaits(id);
    }
    loads(id, server)
}

/// Returns whether an asset is being loaded.
fn loads(id: impl Into<UntypedAssetId>, server: &AssetServer) -> bool {
    matches!(server.get_load_state(id), Some(LoadState::NotLoaded | LoadState::Loading))
}

/// What changes of the entity of a track besides its clip.
type Tracked = (&'static TimelineTrack, &'static mut Visibility, &'static mut ClipFade, &'static mut NextClip);

/// Sets the clip, fade and visibility of every track's entity at the current time, and what it plays next.
pub(in crate::plugin::playback) fn update_tracks(
    timelines: Res<Assets<Timeline>>,
    captures: Res<Assets<GaussianCapture>>,
    players: Query<(&TimelinePlayer, &PlaybackClock, &Playback, &Children)>,
    mut entities: Query<(Tracked, Parts<'static>), Without<TimelinePlayer>>,
) {
    let _span = debug_span!("gs4d/tracks").entered();
    for (handle, clock, playback, children) in &players {
        let Some(timeline) = timelines.get(&handle.0) else { continue };
        let (time, duration) = (clock.seconds, timeline.duration_seconds());
        for &child in children {
            let Ok(((track, mut visibility, mut fade, mut next), parts)) = entities.get_mut(child) else { continue };
            // A reload, or another timeline, may have no such track.
            let track = timeline.track(&track.0);
            next.set_if_neq(track.map(|track| NextClip::of(track, time, playback, duration)).unwrap_or_default());
            let Some(track) = track else {
                visibility.set_if_neq(Visibility::Hidden);
                release(parts);
                continue;
            };
            let Some(clip) = track.clip_at(time) else {
                visibility.set_if_neq(Visibility::Hidden);
                continue;
            };
            let visible = clip.shows(time, duration);
            visibility.set_if_neq(if visible { Visibility::Inherited } else { Visibility::Hidden });
            fade.set_if_neq(ClipFade(clip.fade_at(time)));
            set_clip(parts, clip, captures.get(&clip.capture));
        }
    }
}

/// The components that change with the clip.
type Parts<'a> = (&'a mut PlayedClip, &'a mut GaussianCapture3d, &'a mut Playback, &'a mut PlaybackState);

/// Releases the capture of the entity of a track that no longer exists.
fn release(
    (mut played, mut capture, _, mut state): (
        Mut<PlayedClip>,
        Mut<GaussianCapture3d>,
        Mut<Playback>,
        Mut<PlaybackState>,
    ),
) {
    capture.set_if_neq(GaussianCapture3d::default());
    if played.0.is_some() {
        played.0 = None;
        *state = state.restarted();
    }
}

/// Sets the clip of an entity if the clip has changed. `loaded` is the clip's capture, `None` until it has been loaded.
fn set_clip(
    (mut played, mut capture, mut playback, mut state): (
        Mut<PlayedClip>,
        Mut<GaussianCapture3d>,
        Mut<Playback>,
        Mut<PlaybackState>,
    ),
    clip: &Clip,
    loaded: Option<&GaussianCapture>,
) {
    let wanted = clip.playback(loaded.map(GaussianCapture::duration_seconds));
    if played.0.as_ref() != Some(clip) {
        capture.set_if_neq(GaussianCapture3d(clip.capture.clone()));
        playback.set_if_neq(wanted);
        // The start of a clip is not a seek from the end of the clip before.
        *state = state.restarted();
        played.0 = Some(clip.clone());
    } else if playback.offset != wanted.offset {
        // The offset depends on the capture's duration, which is unknown until the capture is loaded.
        playback.offset = wanted.offset;
    }
}
