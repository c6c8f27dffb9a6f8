//! Sounds through Bevy's audio.
//!
//! In: the [`SoundState`] of each sound, once a frame. Out: a child of its entity with an `AudioPlayer`, whose samples
//! follow the state; they are made in the thread of the audio device. It is a child, since the entity may have other
//! audio.

use super::component::{CaptureSound, SoundState, TimelineSound};
use super::device_clock::DeviceClock;
use super::follower::{SoundCue, SoundFollower};
use super::systems::CaptureSoundSystems;
use bevy::app::{App, Update};
use bevy::asset::{Asset, Assets};
use bevy::audio::{
    AddAudioSource, AudioPlayer, AudioPlugin, ChannelCount, Decodable, GlobalVolume, Sample, SampleRate, Source,
};
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::ecs::hierarchy::ChildOf;
use bevy::ecs::query::{Has, With};
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::ecs::system::{Commands, Local, Query, ResMut};
use bevy::ecs::world::EntityWorldMut;
use bevy::log::warn;
use bevy::platform::time::Instant;
use bevy::reflect::TypePath;
use std::num::{NonZeroU16, NonZeroU32};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Frames a second that are made.
const RATE: NonZeroU32 = NonZeroU32::new(48_000).expect("not 0");
const CHANNELS: NonZeroU16 = NonZeroU16::new(2).expect("not 0");
/// Frames that are made at once: less than 3 ms.
const BLOCK: usize = 128;

/// A sound that follows its state.
#[derive(Asset, TypePath, Clone)]
struct FollowedSound(Arc<Mutex<SoundCue>>, Instant);

/// What the audio device plays of an entity.
#[derive(Component)]
pub(super) struct Followed {
    cue: Arc<Mutex<SoundCue>>,
    /// The child that plays it, which the game may have despawned.
    child: Entity,
}

/// Adds the systems, if the app has Bevy's audio.
pub(super) fn add(app: &mut App) {
    if !app.is_plugin_added::<AudioPlugin>() || !app.world().contains_resource::<GlobalVolume>() {
        warn!(
            "CaptureSoundPlugin needs Bevy's AudioPlugin, which this app does not have, so that nothing is heard: add \
             DefaultPlugins"
        );
        return;
    }
    app.add_audio_source::<FollowedSound>().add_systems(Update, hear.after(CaptureSoundSystems));
}

/// Tells the audio device the state of each sound.
fn hear(
    mut sounds: ResMut<Assets<FollowedSound>>,
    played: Query<(Entity, &SoundState, Option<&Followed>, (Has<CaptureSound>, Has<TimelineSound>))>,
    players: Query<(), With<AudioPlayer<FollowedSound>>>,
    mut began: Local<Option<Instant>>,
    mut commands: Commands,
) {
    let began = *began.get_or_insert_with(Instant::now);
    for (entity, state, followed, (of_capture, of_timeline)) in &played {
        let is_played = of_capture || of_timeline;
        let cue = state.cue(began.elapsed().as_secs_f64());
        match followed {
            Some(Followed { child, .. }) if !is_played => {
                commands.entity(*child).try_despawn();
                commands.entity(entity).try_remove::<Followed>();
            }
            Some(Followed { cue: shared, child }) if players.contains(*child) => {
                *shared.lock().unwrap_or_else(PoisonError::into_inner) = cue;
            }
            _ if is_played => {
                let shared = Arc::new(Mutex::new(cue));
                let player = AudioPlayer(sounds.add(FollowedSound(shared.clone(), began)));
                // Another system may despawn the entity before.
                commands.entity(entity).queue_silenced(move |mut entity: EntityWorldMut| {
                    let parent = ChildOf(entity.id());
                    let child = entity.world_scope(|world| world.spawn((player, parent)).id());
                    entity.insert(Followed { cue: shared, child });
                });
            }
            _ => {}
        }
    }
}

impl Decodable for FollowedSound {
    type Decoder = FollowedSamples;

    fn decoder(&self) -> FollowedSamples {
        let (clock, follower) = (DeviceClock::default(), SoundFollower::new(RATE.get()));
        FollowedSamples { sound: self.clone(), clock, follower, block: [[0.0; 2]; BLOCK], next: 2 * BLOCK }
    }
}

/// The samples of a sound, without an end.
struct FollowedSamples {
    sound: FollowedSound,
    clock: DeviceClock,
    follower: SoundFollower,
    block: [[f32; 2]; BLOCK],
    /// The index of the next sample in the block.
    next: usize,
}

impl Iterator for FollowedSamples {
    type Item = Sample;

    fn next(&mut self) -> Option<Sample> {
        if self.next == 2 * BLOCK {
            let FollowedSound(cue, began) = &self.sound;
            let cue = cue.lock().unwrap_or_else(PoisonError::into_inner).clone();
            let now = self.clock.next(began.elapsed().as_secs_f64(), BLOCK as f64 / f64::from(RATE.get()));
            self.follower.fill(&cue, now, &mut self.block);
            self.next = 0;
        }
        let sample = self.block.as_flattened().get(self.next).copied();
        self.next += 1;
        sample
    }
}

impl Source for FollowedSamples {
    fn current_span_len(&self) -> Option<usize> {
        None
    }

    fn channels(&self) -> ChannelCount {
        CHANNELS
    }

    fn sample_rate(&self) -> SampleRate {
        RATE
    }

    fn total_duration(&self) -> Option<Duration> {
        None
    }
}
