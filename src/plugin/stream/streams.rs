//! Streams: the chunk files of each capture, loaded and given up as its players need them.
//!
//! In: captures whose scene is an index of chunk files, the playbacks of their entities, cameras, [`StreamBudget`]. Out:
//! [`Streams`], which holds a handle to each file that is there or on its way: the asset server loads files with their
//! first handle, and frees them with their last.

use super::heads::{playhead, still};
use super::settings::{CaptureStreamSettings, StreamBudget};
use super::shares::{Sight, shares};
use super::state::CaptureStreamState;
use crate::codec::stream::{FileState, Playhead, StreamLimits, StreamSchedule};
use crate::plugin::asset::{CaptureLoaderSettings, Uploads};
use crate::plugin::component::{CapturePart, GaussianCapture, GaussianCapture3d};
use crate::plugin::playback::Playback;
use crate::scene::ChunkTable;
use bevy::asset::{AssetId, AssetPath, AssetServer, Assets, Handle, RenderAssetUsages};
use bevy::camera::Camera;
use bevy::camera::visibility::ViewVisibility;
use bevy::ecs::hierarchy::Children;
use bevy::ecs::query::{With, Without};
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::log::debug_span;
use bevy::platform::time::Instant;
use bevy::transform::components::GlobalTransform;
use glam::Vec3;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// The streams of all captures in chunk files that entities show.
#[derive(Resource)]
pub(super) struct Streams {
    /// The zero of the clock of schedules.
    began: Instant,
    streams: BTreeMap<AssetId<GaussianCapture>, Stream>,
}

impl Default for Streams {
    fn default() -> Self {
        Self { began: Instant::now(), streams: BTreeMap::new() }
    }
}

impl Streams {
    /// Returns the stream of a capture; `None` if it is not in chunk files.
    pub(super) fn of(&self, capture: AssetId<GaussianCapture>) -> Option<&Stream> {
        self.streams.get(&capture)
    }
}

/// The stream of a capture.
pub(super) struct Stream {
    pub(super) schedule: StreamSchedule,
    /// The index, in whose folder the files are; `None` for an index that was not loaded from a file.
    index: Option<AssetPath<'static>>,
    files: HashMap<usize, Handle<GaussianCapture>>,
}

impl Stream {
    fn new(table: Arc<ChunkTable>, duration: f32, index: Option<AssetPath<'static>>) -> Self {
        Self { schedule: StreamSchedule::new(table, duration.into()), index, files: HashMap::new() }
    }

    /// Returns the handle of a file that is there.
    pub(super) fn resident(&self, file: usize) -> Option<&Handle<GaussianCapture>> {
        self.files.get(&file).filter(|_| self.schedule.state(file) == FileState::Resident)
    }

    /// Tells the schedule of the files that have arrived or failed since the last frame.
    fn notice(&mut self, now: f64, server: &AssetServer, captures: &Assets<GaussianCapture>, uploads: &Uploads) {
        let Self { schedule, files, .. } = self;
        files.retain(|&file, handle| {
            if schedule.state(file) != FileState::Requested {
                return true;
            }
            let id = handle.id();
            let is_loaded = captures.contains(id);
            if server.get_load_state(id).is_some_and(|state| state.is_failed()) || is_loaded && uploads.has_failed(id) {
                schedule.failed(file, now);
                return false;
            }
            if is_loaded && !uploads.awaits(id) {
                schedule.arrived(file);
            }
            true
        });
    }

    /// Loads and gives up files.
    fn follow(&mut self, now: f64, heads: &[Playhead], limits: &StreamLimits, server: &AssetServer) {
        let plan = self.schedule.plan(now, heads, limits);
        for file in plan.give_up {
            self.files.remove(&file);
        }
        for file in plan.fetch {
            let Some(path) = self.path(file) else {
                self.schedule.failed(file, now);
                continue;
            };
            // A file is drawn, and neither picked nor saved.
            let drawn = |settings: &mut CaptureLoaderSettings| settings.asset_usage = RenderAssetUsages::RENDER_WORLD;
            self.files.insert(file, server.load_builder().with_settings(drawn).load(path));
        }
    }

    /// Returns where a file is.
    fn path(&self, file: usize) -> Option<AssetPath<'static>> {
        let index = self.index.as_ref()?;
        let name = ChunkTable::file_name(file, self.schedule.table().files.len());
        let path = index.path().with_file_name(name);
        Some(AssetPath::from(path).with_source(index.source().clone_owned()))
    }
}

/// What is known of an entity whose capture may be in chunk files.
type Placed = (
    &'static GaussianCapture3d,
    &'static Playback,
    &'static GlobalTransform,
    &'static ViewVisibility,
    Option<&'static CaptureStreamSettings>,
    Option<&'static CaptureStreamState>,
    Option<&'static Children>,
);

/// Begins and ends streams, and loads and gives up their files.
pub(super) fn fetch_files(
    captures: Res<Assets<GaussianCapture>>,
    server: Res<AssetServer>,
    uploads: Res<Uploads>,
    budget: Res<StreamBudget>,
    placed: Query<Placed, Without<CapturePart>>,
    seen: Query<&ViewVisibility, With<CapturePart>>,
    cameras: Query<(&Camera, &GlobalTransform)>,
    mut streams: ResMut<Streams>,
) {
    let _span = debug_span!("gs4d/stream").entered();
    let now = streams.began.elapsed().as_secs_f64();
    let mut wanted: BTreeMap<AssetId<GaussianCapture>, (Vec<Playhead>, Sight)> = BTreeMap::new();
    let eyes: Vec<Vec3> =
        cameras.iter().filter(|(camera, _)| camera.is_active).map(|(_, place)| place.translation()).collect();
    for (handle, playback, place, visibility, settings, state, children) in &placed {
        let id = handle.0.id();
        let Some(capture) = captures.get(id) else { continue };
        let Some(table) = &capture.scene().chunks else { continue };
        let duration = capture.duration_seconds();
        match streams.streams.get(&id).map(|stream| Arc::ptr_eq(stream.schedule.table(), table)) {
            Some(true) => {}
            // The files of an index that has been loaded again may be others: they are loaded in the next frame, when
            // those of before are no longer assets.
            Some(false) => {
                wanted.remove(&id);
                continue;
            }
            None => {
                let index = server.get_path(id).map(AssetPath::into_owned);
                streams.streams.insert(id, Stream::new(table.clone(), duration, index));
            }
        }
        let (heads, sight) = wanted.entry(id).or_default();
        heads.push(playhead(playback, duration));
        // The picture that stays needs its files.
        let held = state.filter(|state| !state.is_coarse).and_then(|state| state.seconds);
        let preload = settings.iter().flat_map(|settings| settings.preload.iter().copied());
        heads.extend(held.into_iter().chain(preload).map(still));
        // The index itself is everywhere.
        let mut parts = children.into_iter().flatten().filter_map(|child| seen.get(*child).ok());
        let is_seen = visibility.get() && (parts.clone().next().is_none() || parts.any(|part| part.get()));
        sight.add(is_seen, place.translation(), &eyes);
    }
    streams.streams.retain(|id, _| {
        let stays = wanted.contains_key(id);
        if !stays {
            uploads.end_stream(*id);
        }
        stays
    });
    for stream in streams.streams.values_mut() {
        stream.notice(now, &server, &captures, &uploads);
    }
    let shares = shares(wanted.values().map(|(_, sight)| sight));
    let on_the_way = |stream: &Stream| (stream.schedule.requested(), stream.schedule.host_bytes());
    let mut ways: HashMap<_, _> = streams.streams.iter().map(|(id, stream)| (*id, on_the_way(stream))).collect();
    // Those with the largest shares ask first.
    let mut order: Vec<_> = wanted.iter().zip(shares).collect();
    order.sort_by(|(_, a), (_, b)| b.total_cmp(a));
    for ((id, (heads, _)), share) in order {
        let others = ways.iter().filter(|(other, _)| *other != id).map(|(_, way)| *way);
        let (requests, host) = others.fold((0, 0u64), |(a, b), (c, d)| (a + c, b.saturating_add(d)));
        let limits = StreamLimits {
            gpu_bytes: (budget.gpu_bytes as f64 * share) as u64,
            host_bytes: budget.host_bytes.saturating_sub(host),
            requests: (budget.requests as usize).saturating_sub(requests),
            ahead: budget.ahead_seconds.into(),
        };
        if let Some(stream) = streams.streams.get_mut(id) {
            stream.follow(now, heads, &limits, &server);
            ways.insert(*id, on_the_way(stream));
        }
    }
}
