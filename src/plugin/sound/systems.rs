//! The systems that keep sounds at the time that is drawn.
//!
//! In: players of timelines with sounds, entities with a [`CaptureSound`], their times. Out: an entity for each sound
//! of a timeline; the [`SoundState`] of every sound.

use super::component::{CaptureSound, Heard, Lack, SoundState, TimelineSound};
use super::decoding::DecodedSounds;
use crate::plugin::component::{GaussianCapture, GaussianCapture3d, SoundTrack};
use crate::plugin::playback::{Playback, PlaybackClock, PlaybackState, Timeline, TimelinePlayer};
use bevy::asset::Assets;
use bevy::ecs::entity::Entity;
use bevy::ecs::hierarchy::{ChildOf, Children};
use bevy::ecs::query::Without;
use bevy::ecs::schedule::SystemSet;
use bevy::ecs::system::{Commands, Query, Res, ResMut};
use bevy::ecs::world::EntityWorldMut;
use bevy::log::{debug_span, warn};
use bevy::time::{Real, Time};
use std::collections::HashSet;

/// The set of the systems that update sounds: in `Update`, after
/// [`PlaybackSystems::Advance`](crate::playback::PlaybackSystems::Advance).
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub struct CaptureSoundSystems;

/// Spawns an entity for each sound of a timeline, and despawns those of sounds that a reload has removed.
pub(super) fn bind_sounds(
    timelines: Res<Assets<Timeline>>,
    players: Query<(Entity, &TimelinePlayer, Option<&Children>)>,
    sounds: Query<&TimelineSound>,
    mut commands: Commands,
) {
    for (player, handle, children) in &players {
        let Some(timeline) = timelines.get(&handle.0) else { continue };
        let (count, mut found) = (timeline.sounds().len(), HashSet::new());
        for &child in children.map_or(&[][..], |children| &children[..]) {
            match sounds.get(child) {
                Ok(TimelineSound(index)) if *index < count => _ = found.insert(*index),
                Ok(_) => commands.entity(child).try_despawn(),
                Err(_) => {}
            }
        }
        for index in (0..count).filter(|index| !found.contains(index)) {
            // Another system may despawn the player before.
            commands.entity(player).queue_silenced(move |mut player: EntityWorldMut| {
                player.with_child(TimelineSound(index));
            });
        }
    }
}

/// Sets the state of each sound of a timeline.
pub(super) fn follow_timelines(
    time: Res<Time<Real>>,
    timelines: Res<Assets<Timeline>>,
    tracks: Res<Assets<SoundTrack>>,
    players: Query<(&TimelinePlayer, &PlaybackClock, &Playback)>,
    mut sounds: Query<(&TimelineSound, Option<&ChildOf>, &mut SoundState)>,
) {
    let _span = debug_span!("gs4d/timeline sounds").entered();
    for (TimelineSound(index), parent, mut state) in &mut sounds {
        let found =
            parent.and_then(|parent| players.get(parent.parent()).ok()).and_then(|(handle, clock, playback)| {
                let clip = timelines.get(&handle.0)?.sounds().get(*index)?;
                Some((clip, clock, playback))
            });
        let Some((clip, clock, playback)) = found else {
            state.rest();
            continue;
        };
        state.sound = tracks.get(&clip.sound).map(|track| track.0.clone());
        let seconds = clock.seconds - f64::from(clip.start);
        let heard = Heard { seconds, jumps: clock.jumps, playing: playback.playing, volume: clip.volume };
        state.advance(heard, time.delta_secs_f64());
    }
}

/// Sets the state of each sound that is played beside a capture.
pub(super) fn follow_captures(
    time: Res<Time<Real>>,
    captures: Res<Assets<GaussianCapture>>,
    tracks: Res<Assets<SoundTrack>>,
    mut decoded: ResMut<DecodedSounds>,
    mut played: Query<(
        Entity,
        &CaptureSound,
        Option<&GaussianCapture3d>,
        Option<(&Playback, &PlaybackState)>,
        &mut SoundState,
    )>,
) {
    let _span = debug_span!("gs4d/capture sounds").entered();
    let mut kept = HashSet::new();
    for (entity, sound, handle, player, mut state) in &mut played {
        let loaded = handle.and_then(|handle| Some((handle.0.id(), captures.get(&handle.0)?)));
        let Some(((id, capture), (playback, player))) = loaded.zip(player) else {
            if handle.is_none() {
                warn_once(
                    &mut state,
                    Lack::Capture,
                    &format!(
                        "{entity} has a CaptureSound and no GaussianCapture3d, so that nothing is heard: insert both on one \
                     entity"
                    ),
                );
            }
            state.rest();
            continue;
        };
        let file = capture.scene().sound.as_ref().filter(|_| sound.track.is_none());
        state.sound = match &sound.track {
            Some(track) => tracks.get(track).map(|track| track.0.clone()),
            None => file.and_then(|file| decoded.get(id, file)),
        };
        match file {
            Some(_) => _ = kept.insert(id),
            None if sound.track.is_none() => warn_once(
                &mut state,
                Lack::Sound,
                &format!(
                    "{entity} has a CaptureSound without a track, and its capture carries no sound, so that nothing is heard: \
                 `gs4d sound` puts one into a package; a capture in chunk files needs a track"
                ),
            ),
            None => {}
        }
        let heard =
            Heard { seconds: player.seconds(), jumps: player.jumps(), playing: playback.playing, volume: sound.volume };
        state.advance(heard, time.delta_secs_f64());
    }
    decoded.keep(&kept);
}

/// Makes sounds silent whose [`CaptureSound`] or [`TimelineSound`] has been removed.
pub(super) fn rest_removed(mut removed: Query<&mut SoundState, (Without<CaptureSound>, Without<TimelineSound>)>) {
    for mut state in &mut removed {
        *state = SoundState::default();
    }
}

/// Logs a warning of what a sound lacks, unless the last one was of the same.
fn warn_once(state: &mut SoundState, lack: Lack, warning: &str) {
    if state.lack.replace(lack) != Some(lack) {
        warn!("{warning}");
    }
}
