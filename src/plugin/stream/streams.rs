//! Streams: the chunk files of each capture, loaded and given up as its players need them.
//!
//! In: captures whose scene is an index of chunk files, the playbacks of their entities, the next clips of timelines,
//! cameras, [`StreamBudget`]. Out: [`Streams`], which holds a handle to each file that is there or on its way: the asset
//! server loads files with their first handle, and frees them with their last.

use super::faults::{fault, without_folder};
use super::heads::{Leaders, playhead};
use super::settings::{CaptureStreamSettings, StreamBudget};
use super::shares::{OnTheWay, Sight, ask_in_turns, shares};
use super::state::CaptureStreamState;
use crate::codec::stream::{FileState, Playhead, StreamLimits, StreamSchedule, Throughput, Turn};
use crate::plugin::asset::{CaptureFailure, CaptureLoaderSettings, Uploads, load_part};
use crate::plugin::component::{GaussianCapture, GaussianCapture3d};
use crate::plugin::playback::{Cue, NextClip, Playback};
use crate::plugin::render::logged::error_once_each;
use crate::scene::{ChunkTable, ColorCodebooks};
use bevy::asset::{AssetId, AssetPath, AssetServer, Assets, Handle, RenderAssetUsages};
use bevy::camera::Camera;
use bevy::camera::visibility::ViewVisibility;
use bevy::ecs::change_detection::DetectChanges;
use bevy::ecs::entity::Entity;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::log::debug_span;
use bevy::platform::time::Instant;
use bevy::render::renderer::RenderDevice;
use bevy::tasks::IoTaskPool;
use bevy::transform::components::GlobalTransform;
use glam::Vec3;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

/// Longer frames count as this long, in seconds: an app that was suspended gives its requests time to end.
const LONGEST_FRAME: f64 = 1.0;

/// The streams of all captures in chunk files that entities show.
#[derive(Resource)]
pub(super) struct Streams {
    /// The time of schedules, seconds, and when it was that. It does not pass while the app stands still.
    now: f64,
    updated: Instant,
    /// How fast files arrive, of all streams together.
    throughput: Throughput,
    streams: BTreeMap<AssetId<GaussianCapture>, Stream>,
}

impl Default for Streams {
    fn default() -> Self {
        Self { now: 0.0, updated: Instant::now(), throughput: Throughput::default(), streams: BTreeMap::new() }
    }
}

impl Streams {
    /// Lets the time since the last frame pass, and returns the time.
    fn pass_time(&mut self) -> f64 {
        let updated = Instant::now();
        self.now += updated.duration_since(self.updated).as_secs_f64().min(LONGEST_FRAME);
        self.updated = updated;
        self.now
    }

    /// Begins the stream of a loaded capture, unless it has begun or the capture is not in chunk files. Returns `false` if
    /// the capture has no stream now: the files of an index that has been loaded again may be others, and those on a lost
    /// device are gone, so that they are loaded in the next frame, when those of before are no longer assets.
    fn begin(
        &mut self,
        id: AssetId<GaussianCapture>,
        capture: &GaussianCapture,
        server: &AssetServer,
        is_device_new: bool,
    ) -> bool {
        let Some(table) = &capture.scene().chunks else { return false };
        match self.streams.get(&id).map(|stream| Arc::ptr_eq(stream.schedule.table(), table)) {
            Some(is_same) => is_same && !is_device_new,
            None => {
                let index = server.get_path(id).map(AssetPath::into_owned);
                let codebooks = capture.scene().form.coded_colors().map(|colors| colors.codebooks.clone());
                let stream = Stream::new(table.clone(), capture.duration_seconds(), index);
                self.streams.insert(id, Stream { codebooks, ..stream });
                true
            }
        }
    }

    /// Returns the stream of a capture; `None` if it is not in chunk files.
    pub(super) fn of(&self, capture: AssetId<GaussianCapture>) -> Option<&Stream> {
        self.streams.get(&capture)
    }
}

/// The stream of a capture.
pub(super) struct Stream {
    pub(super) schedule: StreamSchedule,
    /// The index, in whose folder or file the chunk files are; `None` for an index that was not loaded from a file.
    index: Option<AssetPath<'static>>,
    /// The codebooks of colors, which the index has for all files.
    codebooks: Option<Arc<ColorCodebooks>>,
    files: HashMap<usize, Handle<GaussianCapture>>,
    /// Files that others had loaded, which are loaded again into pages.
    reloaded: HashSet<usize>,
    /// Its share of the memory on the GPU, bytes.
    share: u64,
}

impl Stream {
    fn new(table: Arc<ChunkTable>, duration: f32, index: Option<AssetPath<'static>>) -> Self {
        Self {
            schedule: StreamSchedule::new(table, duration.into()).in_pages(),
            index,
            codebooks: None,
            files: HashMap::new(),
            reloaded: HashSet::new(),
            share: 0,
        }
    }

    /// Returns the handle of a file that is there.
    pub(super) fn resident(&self, file: usize) -> Option<&Handle<GaussianCapture>> {
        self.files.get(&file).filter(|_| self.schedule.state(file) == FileState::Resident)
    }

    /// Returns why the most important Gaussians of a time of the index `id` may never be there, in seconds since the
    /// capture's start.
    pub(super) fn fault(&self, id: AssetId<GaussianCapture>, seconds: f64) -> Option<CaptureFailure> {
        match &self.index {
            Some(index) => fault(&self.schedule, seconds, self.share, index),
            None => Some(without_folder(id)),
        }
    }

    /// Returns the files on their way.
    fn on_the_way(&self) -> OnTheWay {
        OnTheWay { requests: self.schedule.requested(), host_bytes: self.schedule.host_bytes() }
    }

    /// Tells the schedule of the files of the index `own` that have arrived or failed since the last frame. Returns the
    /// bytes of those that have arrived.
    fn notice(
        &mut self,
        own: AssetId<GaussianCapture>,
        now: f64,
        server: &AssetServer,
        captures: &Assets<GaussianCapture>,
        uploads: &Uploads,
    ) -> u64 {
        let mut bytes = 0;
        let Self { schedule, files, reloaded, .. } = self;
        files.retain(|&file, handle| {
            if schedule.state(file) != FileState::Requested {
                return true;
            }
            let id = handle.id();
            let loaded = captures.get(id);
            let chunk = schedule.table().files.get(file).copied();
            let most = chunk.map_or(0, |chunk| chunk.gaussians);
            // Its Gaussians are in memory until the end of the frame in which it is loaded.
            let count = loaded.map_or(0, |capture| capture.scene().len() as u64);
            if count > most {
                let index = server.get_path(own).map(|path| path.to_string()).unwrap_or_default();
                error_once_each(&format!(
                    "{index}: its chunk file {}: {count} Gaussians, and the index says {most}, by which memory is \
                     counted, so that the file is not drawn: copy the index and all files of the capture again",
                    file + 1
                ));
            }
            let is_refused = count > most || loaded.is_some() && uploads.has_failed(id);
            if is_refused || server.get_load_state(id).is_some_and(|state| state.is_failed()) {
                schedule.failed(file, now);
                return false;
            }
            let is_uploaded = loaded.is_some() && !uploads.awaits(id);
            if is_uploaded && uploads.is_placed(id, own) {
                schedule.arrived(file);
                reloaded.remove(&file);
                bytes += chunk.map_or(0, |chunk| chunk.bytes);
            } else if is_uploaded && reloaded.insert(file) {
                // It was a capture by itself before it became a file of this one.
                server.get_path(id).into_iter().for_each(|path| server.reload(path));
            }
            true
        });
        bytes
    }

    /// Loads and gives up files of the index `id`.
    fn follow(
        &mut self,
        id: AssetId<GaussianCapture>,
        now: f64,
        heads: &[Playhead],
        limits: &StreamLimits,
        server: &AssetServer,
        uploads: &Uploads,
    ) {
        let plan = self.schedule.plan(now, heads, limits);
        for file in plan.give_up {
            self.files.remove(&file).into_iter().for_each(|handle| uploads.leave(handle.id()));
        }
        for file in plan.fetch {
            let Some(index) = &self.index else {
                self.schedule.failed(file, now);
                continue;
            };
            // A file is drawn, and neither picked nor saved.
            let codebooks = self.codebooks.clone();
            let drawn = move |settings: &mut CaptureLoaderSettings| {
                settings.asset_usage = RenderAssetUsages::RENDER_WORLD;
                settings.read.codebooks.clone_from(&codebooks);
            };
            if let Some(range) = self.schedule.table().range(file) {
                let mut settings = CaptureLoaderSettings::default();
                drawn(&mut settings);
                let part = load_part(server.clone(), index.clone(), file, range, settings);
                // In browsers requests stay on the thread of the page, and their task is what others may wait for.
                let handle = server.add_async(IoTaskPool::get().spawn(part));
                uploads.join(handle.id(), id, file);
                self.files.insert(file, handle);
                continue;
            }
            let path = path_beside(index, file, self.schedule.table().files.len());
            // The asset server stops reading a file whose last handle is dropped, but has one itself until the file is
            // open: over the web, until all of it is there. A load joins such a read. After a deadline, the file is
            // therefore read once more beside it.
            let is_stuck = self.schedule.failures_in_a_row(file) > 0 && server.get_path_id(&path).is_some();
            let handle = server.load_builder().with_settings(drawn).load(&path);
            uploads.join(handle.id(), id, file);
            self.files.insert(file, handle);
            if is_stuck {
                server.reload(path);
            }
        }
    }
}

/// Returns where a file is, of `of` files beside an index.
fn path_beside(index: &AssetPath<'_>, file: usize, of: usize) -> AssetPath<'static> {
    let path = index.path().with_file_name(ChunkTable::file_name(file, of));
    AssetPath::from(path).with_source(index.source().clone_owned())
}

/// What is known of an entity whose capture may be in chunk files.
type Placed = (
    Entity,
    &'static GaussianCapture3d,
    &'static Playback,
    &'static GlobalTransform,
    &'static ViewVisibility,
    Option<&'static CaptureStreamSettings>,
    Option<&'static CaptureStreamState>,
);

/// Begins and ends streams, and loads and gives up their files.
pub(super) fn fetch_files(
    captures: Res<Assets<GaussianCapture>>,
    server: Res<AssetServer>,
    uploads: Res<Uploads>,
    budget: Res<StreamBudget>,
    placed: Query<Placed>,
    leaders: Leaders,
    tracks: Query<(&NextClip, &GlobalTransform)>,
    cameras: Query<(&Camera, &GlobalTransform)>,
    device: Option<Res<RenderDevice>>,
    mut streams: ResMut<Streams>,
) {
    let _span = debug_span!("gs4d/stream").entered();
    let before = streams.now;
    let now = streams.pass_time();
    // The Gaussians of files were on the device only.
    let is_device_new = device.is_some_and(|device| device.is_changed());
    let mut wanted: BTreeMap<AssetId<GaussianCapture>, (Vec<Playhead>, Sight)> = BTreeMap::new();
    let eyes: Vec<Vec3> =
        cameras.iter().filter(|(camera, _)| camera.is_active).map(|(_, place)| place.translation()).collect();
    for (entity, handle, playback, place, visibility, settings, state) in &placed {
        let id = handle.0.id();
        let Some(capture) = captures.get(id) else { continue };
        if !streams.begin(id, capture, &server, is_device_new) {
            wanted.remove(&id);
            continue;
        }
        let (heads, sight) = wanted.entry(id).or_default();
        heads.push(playhead(playback, leaders.speed(entity), capture.duration_seconds()));
        // The picture that stays needs its files.
        let held = state.filter(|state| !state.is_coarse).and_then(|state| state.seconds);
        let preload = settings.iter().flat_map(|settings| settings.preload.iter().copied());
        heads.extend(held.into_iter().chain(preload).map(|seconds| Playhead::still(seconds.into())));
        sight.add(visibility.get(), place.translation(), &eyes);
    }
    let ahead = f64::from(budget.ahead_seconds);
    let cues =
        tracks.iter().filter_map(|(next, place)| Some((next.0.as_ref().filter(|cue| cue.after <= ahead)?, place)));
    for (cue, place) in cues {
        let id = cue.capture.id();
        let Some(capture) = captures.get(id) else { continue };
        if streams.begin(id, capture, &server, is_device_new) {
            let Cue { seconds, velocity, range, after: delay, .. } = *cue;
            let (heads, sight) = wanted.entry(id).or_default();
            heads.push(Playhead { seconds, velocity, range, turn: Turn::Stop, delay });
            sight.add(false, place.translation(), &eyes);
        }
    }
    streams.streams.retain(|id, _| {
        let stays = wanted.contains_key(id);
        if !stays {
            uploads.end_stream(*id);
        }
        stays
    });
    let is_busy = streams.streams.values().any(|stream| stream.schedule.requested() > 0);
    let notice = |(id, stream): (&_, &mut Stream)| stream.notice(*id, now, &server, &captures, &uploads);
    let arrived = streams.streams.iter_mut().map(notice).sum();
    let needed = streams
        .streams
        .values()
        .zip(wanted.values())
        .map(|(stream, (heads, _))| stream.schedule.bytes_per_second(heads))
        .sum();
    streams.throughput.add(now - before, is_busy, arrived, needed);
    let throughput = streams.throughput;
    let shares = shares(wanted.values().map(|(_, sight)| sight));
    // Those that are wanted, in the same order.
    let asking = streams.streams.values_mut().zip(&wanted).zip(shares);
    let mut asking: Vec<_> = asking.map(|((stream, (id, (heads, _))), share)| (*id, stream, heads, share)).collect();
    asking.sort_by(|(.., a), (.., b)| b.total_cmp(a));
    let mut on_the_way: Vec<OnTheWay> = asking.iter().map(|(_, stream, ..)| stream.on_the_way()).collect();
    let most = OnTheWay { requests: budget.requests as usize, host_bytes: budget.host_bytes };
    ask_in_turns(most, &mut on_the_way, |number, OnTheWay { requests, host_bytes }| {
        let (id, stream, heads, share) = &mut asking[number];
        let gpu_bytes = (budget.gpu_bytes as f64 * *share) as u64;
        uploads.grant(*id, gpu_bytes);
        stream.share = gpu_bytes;
        let has_room = stream.schedule.has_room(gpu_bytes, budget.ahead_seconds.into());
        let layer_seconds = throughput.layer_seconds(has_room);
        // Pages may lack the memory to grow.
        let gpu_bytes = uploads.paged(*id).map_or(gpu_bytes, |bytes| bytes.min(gpu_bytes));
        let ahead = budget.ahead_seconds.into();
        let long_bytes = throughput.long_bytes();
        let limits = StreamLimits { gpu_bytes, host_bytes, requests, ahead, layer_seconds, long_bytes };
        stream.follow(*id, now, heads, &limits, &server, &uploads);
        stream.on_the_way()
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plugin::asset::CaptureAssetPlugin;
    use crate::scene::ChunkFile;
    use bevy::MinimalPlugins;
    use bevy::app::App;
    use bevy::asset::io::{AssetReader, AssetReaderError, AssetSourceBuilder, PathStream, Reader, VecReader};
    use bevy::asset::{AssetApp, AssetPlugin};
    use std::future::pending;
    use std::path::Path;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    /// An asset source whose reads never end. It counts them.
    #[derive(Default, Clone)]
    struct Endless(Arc<AtomicUsize>);

    impl AssetReader for Endless {
        async fn read<'a>(&'a self, _: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
            self.0.fetch_add(1, Ordering::Relaxed);
            pending::<Result<VecReader, AssetReaderError>>().await
        }

        async fn read_meta<'a>(&'a self, path: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
            Err::<VecReader, _>(AssetReaderError::NotFound(path.to_owned()))
        }

        async fn read_directory<'a>(&'a self, path: &'a Path) -> Result<Box<PathStream>, AssetReaderError> {
            Err(AssetReaderError::NotFound(path.to_owned()))
        }

        async fn is_directory<'a>(&'a self, _: &'a Path) -> Result<bool, AssetReaderError> {
            Ok(false)
        }
    }

    #[test]
    fn a_file_whose_read_does_not_end_is_read_again() {
        let source = Endless::default();
        let reads = source.0.clone();
        let mut app = App::new();
        app.register_asset_source("endless", AssetSourceBuilder::new(move || Box::new(source.clone())));
        app.add_plugins((MinimalPlugins, AssetPlugin::default(), CaptureAssetPlugin));
        let files = vec![ChunkFile { stretches: [0, 0], layer: 0, gaussians: 1, bytes: 1 }];
        let table = ChunkTable { stretches: 1, gaussian_bytes: 88, files, utilities: Vec::new(), first_byte: None };
        let mut stream = Stream::new(table.into(), 1.0, Some("endless://index.gs4d".into()));
        // The first request, its deadline, and the second request.
        for (now, is_requested, count) in [(0.0, true, 1), (31.0, false, 1), (31.5, true, 2)] {
            let server = app.world().resource::<AssetServer>().clone();
            let uploads = Uploads::default();
            stream.follow(
                AssetId::default(),
                now,
                &[Playhead::still(0.0)],
                &StreamLimits::default(),
                &server,
                &uploads,
            );
            let state = (stream.files.len() == 1, stream.schedule.requested() == 1);
            assert_eq!(state, (is_requested, is_requested), "at {now} s the file is on its way, or is not");
            let began = Instant::now();
            while reads.load(Ordering::Relaxed) < count {
                assert!(began.elapsed() < Duration::from_secs(60), "at {now} s the file has been read {count} times");
                app.update();
                std::thread::sleep(Duration::from_millis(2));
            }
            app.update();
        }
        assert_eq!(reads.load(Ordering::Relaxed), 2, "once for each request");
        assert_eq!((stream.schedule.failures(), stream.schedule.failures_in_a_row(0)), (1, 1), "one has failed");
    }
}
