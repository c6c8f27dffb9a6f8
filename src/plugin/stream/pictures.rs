//! Pictures: what is drawn of each capture in chunk files.
//!
//! In: the streams, the playback of each entity with a capture in chunk files. Out: [`StreamedPicture`], the time that is
//! drawn, with what is known of the Gaussians of that time; [`CaptureStreamState`]; messages. The render world draws those
//! Gaussians of the files that are there.

use super::heads::{Leaders, playhead};
use super::messages::Announcer;
use super::settings::{CaptureStreamSettings, OnUnderrun};
use super::state::CaptureStreamState;
use super::streams::{Stream, Streams};
use crate::plugin::asset::Uploads;
use crate::plugin::component::{GaussianCapture, GaussianCapture3d, StreamedPicture};
use crate::plugin::playback::{Playback, Stall};
use crate::plugin::render::logged::warn_once_each;
use crate::scene::Bounds;
use bevy::asset::{AssetId, Assets};
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::Without;
use bevy::ecs::system::{Commands, Query, Res};
use bevy::log::debug_span;

/// What has been shown of a capture in chunk files.
#[derive(Component, Default)]
#[require(CaptureStreamState, Stall, StreamedPicture)]
pub(super) struct Showing {
    /// The capture that is shown.
    capture: Option<AssetId<GaussianCapture>>,
    /// The time that is drawn, seconds since the capture's start; `None` before the first picture.
    shown: Option<f32>,
    /// Whether the most important Gaussians of the playback's time are missing.
    is_buffering: bool,
    /// Whether it has been said why those Gaussians may never be there.
    is_fault_reported: bool,
}

impl Showing {
    /// Moves on to `seconds`, unless the picture of before stays. `is_coarse`: whether the most important Gaussians of
    /// that time are there. Returns whether playback waits.
    fn show(&mut self, seconds: f32, is_coarse: bool, on_underrun: OnUnderrun) -> bool {
        if is_coarse || self.shown.is_some() && on_underrun == OnUnderrun::Coarse {
            self.shown = Some(seconds);
        }
        !is_coarse && (self.shown.is_none() || on_underrun == OnUnderrun::Stall)
    }

    /// Returns what is drawn.
    fn picture(&self, stream: &Stream, index: &GaussianCapture, captures: &Assets<GaussianCapture>) -> StreamedPicture {
        let Some(shown) = self.shown else { return StreamedPicture::default() };
        let (mut bounds, mut extents, mut all) = (None, 0.0, 0.0);
        for number in stream.schedule.needed_at(shown.into()) {
            let Some(file) = stream.resident(number).and_then(|handle| captures.get(handle)) else { continue };
            let own = file.bounds_at(seconds_of(file, index, shown));
            bounds = bounds.into_iter().chain(own).reduce(Bounds::union);
            let gaussians = stream.schedule.table().files.get(number).map_or(0, |chunk| chunk.gaussians) as f32;
            (extents, all) = (extents + gaussians * file.extent(), all + gaussians);
        }
        StreamedPicture { seconds: self.shown, bounds, extent: extents / f32::max(all, 1.0) }
    }
}

/// Returns the time of a file, seconds since its start, at `seconds` of the index, which a game may have loaded with
/// another duration.
fn seconds_of(file: &GaussianCapture, index: &GaussianCapture, seconds: f32) -> f32 {
    if file.duration_seconds() == index.duration_seconds() { seconds } else { file.seconds_at(index.time_at(seconds)) }
}

/// What is known of an entity that shows a capture in chunk files, or has shown one.
type Shown = (
    Entity,
    Option<&'static GaussianCapture3d>,
    Option<&'static CaptureStreamSettings>,
    &'static mut Showing,
    &'static mut Stall,
    &'static mut StreamedPicture,
    &'static mut CaptureStreamState,
);

/// Makes each entity whose capture is in chunk files ready for pictures. Its playback waits for the first.
pub(super) fn begin_pictures(
    streams: Res<Streams>,
    placed: Query<(Entity, &GaussianCapture3d), Without<Showing>>,
    mut commands: Commands,
) {
    for (entity, handle) in &placed {
        if streams.of(handle.0.id()).is_some() {
            commands.entity(entity).try_insert((Showing::default(), Stall { waits: true, ..Stall::default() }));
        }
    }
}

/// Shows what is there of each capture in chunk files.
pub(super) fn show_pictures(
    streams: Res<Streams>,
    captures: Res<Assets<GaussianCapture>>,
    uploads: Res<Uploads>,
    mut placed: Query<Shown>,
    playing: Query<&Playback>,
    leaders: Leaders,
    mut commands: Commands,
    mut announcer: Announcer,
) {
    let _span = debug_span!("gs4d/pictures").entered();
    for (entity, handle, settings, mut showing, mut stall, mut picture, mut state) in &mut placed {
        let id = handle.map(|handle| handle.0.id());
        let stream = id.and_then(|id| Some((id, streams.of(id)?, captures.get(id)?)));
        if stream.is_none() || showing.capture != id {
            *showing = Showing { capture: id, ..Showing::default() };
        }
        let Some((id, stream, index)) = stream else {
            commands.entity(entity).try_remove::<(Showing, Stall, StreamedPicture, CaptureStreamState)>();
            continue;
        };
        let Ok(playback) = playing.get(entity).copied() else { continue };
        let on_underrun = settings.map(|settings| settings.on_underrun).unwrap_or_default();
        let (schedule, had_picture) = (&stream.schedule, showing.shown.is_some());
        let coverage = schedule.coverage(playback.time.into());
        let waits = showing.show(playback.time, coverage.is_coarse, on_underrun);
        if coverage.is_coarse && !had_picture {
            uploads.show_stream(id);
        }
        match coverage.is_coarse {
            true if showing.is_buffering || !had_picture => announcer.buffered(entity, playback.time),
            false if !showing.is_buffering => announcer.buffering(entity, playback.time),
            _ => {}
        }
        showing.is_buffering = !coverage.is_coarse;
        let fault = showing.is_buffering.then(|| stream.fault(id, playback.time.into())).flatten();
        // What is missing may never come: other tracks of a timeline do not wait for it.
        let holds_timeline = waits && on_underrun == OnUnderrun::Stall && fault.is_none();
        if let Some(fault) = fault.filter(|_| !showing.is_fault_reported) {
            showing.is_fault_reported = true;
            warn_once_each(&fault.to_string());
            announcer.failed(entity, fault);
        }
        if had_picture && waits && !stall.waits {
            announcer.stalled(entity, playback.time);
        }
        stall.set_if_neq(Stall { waits, holds_timeline });
        picture.set_if_neq(showing.picture(stream, index, &captures));
        let head = playhead(&playback, leaders.speed(entity), index.duration_seconds());
        state.set_if_neq(CaptureStreamState {
            seconds: showing.shown,
            needed: coverage.files,
            resident: coverage.resident,
            share: coverage.share(),
            is_coarse: coverage.is_coarse,
            retries: schedule.needed_at(playback.time.into()).filter(|file| schedule.waits(*file)).count(),
            buffered_seconds: schedule.buffered(&head) as f32,
            requests: schedule.requested(),
            gpu_bytes: schedule.gpu_bytes(),
            host_bytes: schedule.host_bytes(),
            failures: schedule.failures(),
        });
    }
}
