//! Parts: the chunk files of a capture that are drawn, as children of its entity.
//!
//! In: the streams, the playback of each entity with a capture in chunk files. Out: a child entity for each file that is
//! there and has Gaussians of the time, with the time of its parent; [`CaptureStreamState`]; messages.

use super::heads::playhead;
use super::messages::Announcer;
use super::settings::{CaptureStreamSettings, OnUnderrun, StreamBudget};
use super::state::CaptureStreamState;
use super::streams::{Stream, Streams};
use crate::plugin::asset::{CaptureState, Uploads};
use crate::plugin::component::{CapturePart, GaussianCapture, GaussianCapture3d};
use crate::plugin::playback::{Playback, Stall};
use crate::plugin::render::logged::warn_once_each;
use bevy::asset::{AssetId, Assets};
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::ecs::hierarchy::ChildOf;
use bevy::ecs::query::Without;
use bevy::ecs::system::{Commands, Query, Res};
use bevy::log::debug_span;
use std::collections::BTreeMap;

/// What is drawn of a capture in chunk files.
#[derive(Component, Default)]
#[require(CaptureStreamState, Stall)]
pub(super) struct Parts {
    /// The capture that the parts are of.
    capture: Option<AssetId<GaussianCapture>>,
    /// The time that is drawn, seconds since the capture's start; `None` before the first picture.
    shown: Option<f32>,
    /// Whether the most important Gaussians of the playback's time are missing.
    is_buffering: bool,
    /// Whether it has been said why those Gaussians may never be there.
    is_fault_reported: bool,
    /// The entities of files.
    entities: BTreeMap<usize, Entity>,
}

impl Parts {
    /// Moves on to `seconds`, unless the picture of before stays. `is_coarse`: whether the most important Gaussians of
    /// that time are there. Returns whether playback waits.
    fn show(&mut self, seconds: f32, is_coarse: bool, on_underrun: OnUnderrun) -> bool {
        if is_coarse || self.shown.is_some() && on_underrun == OnUnderrun::Coarse {
            self.shown = Some(seconds);
        }
        !is_coarse && (self.shown.is_none() || on_underrun == OnUnderrun::Stall)
    }

    /// Spawns and despawns parts, and gives all of them the time that is drawn.
    fn update(
        &mut self,
        parent: Entity,
        stream: &Stream,
        index: &GaussianCapture,
        captures: &Assets<GaussianCapture>,
        commands: &mut Commands,
        playing: &mut Query<&mut Playback>,
    ) {
        let shown = self.shown.unwrap_or_default();
        let needed = self.shown.into_iter().flat_map(|shown| stream.schedule.needed_at(shown.into()));
        let needed: BTreeMap<usize, _> = needed.filter_map(|file| Some((file, stream.resident(file)?))).collect();
        self.entities.retain(|file, part| {
            let stays = needed.contains_key(file);
            if !stays {
                commands.entity(*part).try_despawn();
            }
            stays
        });
        for (file, handle) in needed {
            let still = Playback::paused_at(captures.get(handle).map_or(0.0, |part| seconds_of(part, index, shown)));
            let part = self.entities.get(&file).copied();
            match part.and_then(|part| playing.get_mut(part).ok()) {
                Some(mut playback) => {
                    playback.set_if_neq(still);
                }
                None => {
                    let part = CapturePart { file: file as u32 };
                    let drawn = (GaussianCapture3d(handle.clone()), part, CaptureState::Ready, still);
                    self.entities.insert(file, commands.spawn((drawn, ChildOf(parent))).id());
                }
            }
        }
    }
}

/// Returns the time of a part, seconds since its start, at `seconds` of the index, which a game may have loaded with
/// another duration.
fn seconds_of(part: &GaussianCapture, index: &GaussianCapture, seconds: f32) -> f32 {
    if part.duration_seconds() == index.duration_seconds() { seconds } else { part.seconds_at(index.time_at(seconds)) }
}

/// What is known of an entity that shows a capture in chunk files, or has shown one.
type Shown = (
    Entity,
    Option<&'static GaussianCapture3d>,
    Option<&'static CaptureStreamSettings>,
    &'static mut Parts,
    &'static mut Stall,
    &'static mut CaptureStreamState,
);

/// Makes each entity whose capture is in chunk files ready for parts. Its playback waits for the first picture.
pub(super) fn begin_parts(
    streams: Res<Streams>,
    placed: Query<(Entity, &GaussianCapture3d), (Without<Parts>, Without<CapturePart>)>,
    mut commands: Commands,
) {
    for (entity, handle) in &placed {
        if streams.of(handle.0.id()).is_some() {
            commands.entity(entity).try_insert((Parts::default(), Stall(true)));
        }
    }
}

/// Shows what is there of each capture in chunk files.
pub(super) fn show_parts(
    streams: Res<Streams>,
    captures: Res<Assets<GaussianCapture>>,
    uploads: Res<Uploads>,
    budget: Res<StreamBudget>,
    mut placed: Query<Shown>,
    mut playing: Query<&mut Playback>,
    mut commands: Commands,
    mut announcer: Announcer,
) {
    let _span = debug_span!("gs4d/parts").entered();
    for (entity, handle, settings, mut parts, mut stall, mut state) in &mut placed {
        let id = handle.map(|handle| handle.0.id());
        let stream = id.and_then(|id| Some((id, streams.of(id)?, captures.get(id)?)));
        if stream.is_none() || parts.capture != id {
            for part in std::mem::take(&mut parts.entities).into_values() {
                commands.entity(part).try_despawn();
            }
            *parts = Parts { capture: id, ..Parts::default() };
        }
        let Some((id, stream, index)) = stream else {
            commands.entity(entity).try_remove::<(Parts, Stall, CaptureStreamState)>();
            continue;
        };
        let Ok(playback) = playing.get(entity).copied() else { continue };
        let on_underrun = settings.map(|settings| settings.on_underrun).unwrap_or_default();
        let (schedule, had_picture) = (&stream.schedule, parts.shown.is_some());
        let coverage = schedule.coverage(playback.time.into());
        let waits = parts.show(playback.time, coverage.is_coarse, on_underrun);
        if coverage.is_coarse && !had_picture {
            uploads.show_stream(id);
        }
        match coverage.is_coarse {
            true if parts.is_buffering || !had_picture => announcer.buffered(entity, playback.time),
            false if !parts.is_buffering => announcer.buffering(entity, playback.time),
            _ => {}
        }
        parts.is_buffering = !coverage.is_coarse;
        if parts.is_buffering
            && !parts.is_fault_reported
            && let Some(fault) = stream.fault(id, playback.time.into(), &budget)
        {
            parts.is_fault_reported = true;
            warn_once_each(&fault.to_string());
            announcer.failed(entity, fault);
        }
        if had_picture && waits && !stall.0 {
            announcer.stalled(entity, playback.time);
        }
        stall.set_if_neq(Stall(waits));
        parts.update(entity, stream, index, &captures, &mut commands, &mut playing);
        state.set_if_neq(CaptureStreamState {
            seconds: parts.shown,
            needed: coverage.files,
            resident: coverage.resident,
            share: coverage.share(),
            is_coarse: coverage.is_coarse,
            retries: schedule.needed_at(playback.time.into()).filter(|file| schedule.waits(*file)).count(),
            buffered_seconds: schedule.buffered(&playhead(&playback, index.duration_seconds())) as f32,
            requests: schedule.requested(),
            gpu_bytes: schedule.gpu_bytes(),
            host_bytes: schedule.host_bytes(),
            failures: schedule.failures(),
        });
    }
}

/// Despawns parts that no entity draws: those of a scene file, and those whose parent has another capture.
pub(super) fn despawn_strays(
    parts: Query<(Entity, Option<&ChildOf>, &CapturePart)>,
    parents: Query<&Parts>,
    mut commands: Commands,
) {
    for (entity, parent, part) in &parts {
        let parts = parent.and_then(|parent| parents.get(parent.0).ok());
        let is_known = parts.is_some_and(|parts| parts.entities.get(&(part.file as usize)) == Some(&entity));
        if !is_known {
            commands.entity(entity).try_despawn();
        }
    }
}
