//! A capture in chunk files, as the page plays it.
//!
//! In: the scene of an index, what the page plays, the bytes of files. Out: which files the page fetches, and which it
//! fetches no further; the files in the pages of the capture on the GPU. What comes next is decided by
//! `bevy_gs4d::codec::stream`, as in a game.

use bevy_gs4d::codec::stream::{
    FileState, Obstacle, Playhead, StreamLimits, StreamPlan, StreamSchedule, Throughput, Turn,
};
use bevy_gs4d::codec::{CodecError, Loading, ReadOptions};
use bevy_gs4d::gaussian::Gaussian;
use bevy_gs4d::renderer::{ActiveList, ChunkFiles, FileUpload, GpuCapture, Renderer, ViewRenderer};
use bevy_gs4d::scene::{Bounds, ChunkTable, Importances, RuntimeScene};
use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;
use std::sync::Arc;

/// Bytes on the GPU of the Gaussians of a capture in chunk files.
const GPU_BYTES: u64 = 512 << 20;
/// Bytes in memory of files on their way.
const HOST_BYTES: u64 = 128 << 20;
/// Seconds of playing that are loaded ahead.
const AHEAD: f64 = 10.0;
/// Files on their way at once: browsers open six connections to a server.
const REQUESTS: usize = 4;
/// Longer frames count as this long, seconds: a page that was hidden gives its requests time to end.
const LONGEST_FRAME: f64 = 1.0;
/// Gaussians of the first files by which the place of the capture is estimated.
const SAMPLE: usize = 20_000;

/// A capture in chunk files that is played.
pub struct Streamed {
    /// By this number the page calls it.
    pub id: u32,
    index: RuntimeScene,
    schedule: StreamSchedule,
    throughput: Throughput,
    /// The clock of the page at the last plan, the time of the schedule, which does not pass while the page is hidden, and the
    /// bytes that have arrived since. Seconds.
    planned: f64,
    now: f64,
    arrived: u64,
    /// Files that have been received, the first is being read or uploaded.
    received: VecDeque<Received>,
    /// Numbers of Gaussians and importances of the files in pages.
    files: BTreeMap<usize, (usize, Importances)>,
    /// The time that is drawn, seconds since the start and in the capture's unit; `None` before the first picture.
    shown: Option<(f64, f32)>,
    /// The time that is played, seconds since the start.
    wanted: f64,
    /// Some Gaussians of the files of the first picture.
    sample: Vec<Gaussian>,
}

/// A file that has been received.
struct Received {
    file: usize,
    state: State,
}

enum State {
    Reading(Box<Loading>),
    Read(Box<RuntimeScene>),
    Uploading(Box<FileUpload<RuntimeScene>>),
}

/// What a step of files has done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stepped {
    /// Nothing: no file has been received.
    Nothing,
    /// A part of the work, with the bytes that were uploaded.
    Part(u64),
    /// A file has been added to what is drawn, or could not be, with the bytes that were uploaded.
    File(u64),
}

/// Where files are uploaded to.
#[derive(Clone, Copy)]
pub struct Target<'a> {
    pub device: &'a wgpu::Device,
    pub queue: &'a wgpu::Queue,
    pub renderer: &'a Renderer,
    /// Most bytes of a step.
    pub bytes: u64,
}

impl Streamed {
    /// Returns the stream of an index, of which no file is there; `None` for any other capture.
    pub fn new(id: u32, index: &RuntimeScene) -> Option<Self> {
        let schedule = StreamSchedule::new(index.chunks.clone()?, index.playback.duration_seconds.into()).in_pages();
        Some(Self {
            id,
            index: index.clone(),
            schedule,
            throughput: Throughput::default(),
            planned: f64::INFINITY,
            now: 0.0,
            arrived: 0,
            received: VecDeque::new(),
            files: BTreeMap::new(),
            shown: None,
            wanted: 0.0,
            sample: Vec::new(),
        })
    }

    fn table(&self) -> &Arc<ChunkTable> {
        self.schedule.table()
    }

    /// Returns the number of Gaussians of all files.
    pub fn gaussians(&self) -> u64 {
        self.table().files.iter().map(|file| file.gaussians).sum()
    }

    /// Returns the box around most Gaussians of the first picture, once.
    pub fn take_core(&mut self) -> Option<Bounds> {
        Bounds::core(std::mem::take(&mut self.sample).into_iter())
    }

    /// Returns the importances of the Gaussians that are there.
    pub fn importances(&self) -> Importances {
        Importances::of_all(self.files.values().map(|(count, importances)| (*count, importances)))
    }

    /// Returns where a file is in the file of the index, bytes; `None` if it is beside the index.
    pub fn file_range(&self, file: usize) -> Option<Range<u64>> {
        self.table().range(file)
    }

    /// Returns the name of a file, which may be beside the index.
    pub fn file_name(&self, file: usize) -> String {
        ChunkTable::file_name(file, self.table().files.len())
    }

    /// Decides what to fetch, and frees the pages of what is given up. `now` is the clock of the page; `seconds` the time
    /// that is played, at `velocity` times its speed.
    pub fn plan(&mut self, capture: &mut GpuCapture, now: f64, seconds: f64, velocity: f64, loops: bool) -> StreamPlan {
        self.wanted = seconds;
        let (range, turn) = ([0.0, self.schedule.duration()], if loops { Turn::Loop } else { Turn::Stop });
        let head = Playhead { seconds, velocity, range, turn, delay: 0.0 };
        // The picture that stays while the next is on its way needs its files.
        let held = self.shown.filter(|_| !self.has_picture(seconds)).map(|(shown, _)| Playhead::still(shown));
        let heads: Vec<Playhead> = [head].into_iter().chain(held).collect();
        let (is_busy, needed) = (self.schedule.requested() > 0, self.schedule.bytes_per_second(&heads));
        let passed = (now - self.planned).clamp(0.0, LONGEST_FRAME);
        (self.planned, self.now) = (now, self.now + passed);
        self.throughput.add(passed, is_busy, std::mem::take(&mut self.arrived), needed);
        let layer_seconds = self.throughput.layer_seconds(self.schedule.has_room(GPU_BYTES, AHEAD));
        let limits = StreamLimits {
            gpu_bytes: GPU_BYTES,
            host_bytes: HOST_BYTES,
            requests: REQUESTS,
            ahead: AHEAD,
            layer_seconds,
            long_bytes: self.throughput.long_bytes(),
        };
        let plan = self.schedule.plan(self.now, &heads, &limits);
        for file in &plan.give_up {
            self.forget(capture, *file);
        }
        plan
    }

    fn forget(&mut self, capture: &mut GpuCapture, file: usize) {
        self.received.retain(|received| received.file != file);
        self.files.remove(&file);
        capture.remove_file(file);
    }

    /// Notes that a file could not be fetched or read. It is asked for again later.
    pub fn fail(&mut self, capture: &mut GpuCapture, file: usize) {
        self.forget(capture, file);
        self.schedule.failed(file, self.now);
    }

    /// Takes the bytes of a file that was asked for.
    pub fn receive(&mut self, capture: &mut GpuCapture, file: usize, bytes: Vec<u8>) {
        if self.schedule.state(file) != FileState::Requested {
            return;
        }
        self.arrived += bytes.len() as u64;
        if self.table().files.get(file).is_none_or(|chunk| chunk.bytes != bytes.len() as u64) {
            return self.fail(capture, file);
        }
        let codebooks = self.index.form.coded_colors().map(|colors| colors.codebooks.clone());
        let options = ReadOptions { codebooks, ..ReadOptions::default() };
        match Loading::new(self.file_name(file), bytes, &options) {
            Ok(loading) => self.received.push_back(Received { file, state: State::Reading(Box::new(loading)) }),
            Err(_) => self.fail(capture, file),
        }
    }

    /// Does one step with the files that have been received.
    ///
    /// # Errors
    /// A message about a device that cannot draw the capture, or pages that are gone.
    pub fn step(
        &mut self,
        capture: &mut GpuCapture,
        active: &mut Option<ActiveList>,
        to: Target<'_>,
    ) -> Result<Stepped, String> {
        let Some(Received { file, state }) = self.received.pop_front() else { return Ok(Stepped::Nothing) };
        let (state, uploaded) = match state {
            State::Reading(loading) => match read(loading) {
                Ok(state) => (state, 0),
                Err(_) => {
                    self.fail(capture, file);
                    return Ok(Stepped::File(0));
                }
            },
            State::Read(scene) => {
                if capture.paged_bytes().is_none() {
                    self.open(capture, &scene, to)?;
                    *active = ActiveList::new(to.device, to.renderer, capture);
                }
                if !capture.has_room(scene.len()) {
                    // The schedule has given up others for it, or it is larger than the index says.
                    self.fail(capture, file);
                    return Ok(Stepped::File(0));
                }
                if !self.has_first_picture() {
                    let step = scene.len() / SAMPLE + 1;
                    self.sample.extend((0..scene.len()).step_by(step).map(|index| scene.gaussian(index)));
                }
                let known = (scene.len(), Importances::of(&scene));
                let Ok(upload) = FileUpload::new(capture, file, *scene) else {
                    self.fail(capture, file);
                    return Ok(Stepped::File(0));
                };
                self.files.insert(file, known);
                (State::Uploading(Box::new(upload)), 0)
            }
            State::Uploading(mut upload) => {
                let uploaded = upload.advance(to.queue, to.renderer, capture, to.bytes);
                let uploaded = uploaded.map_err(|e| self.of_file(file, &e.to_string()))?;
                if upload.is_complete(capture) {
                    self.schedule.arrived(file);
                    return Ok(Stepped::File(uploaded));
                }
                (State::Uploading(upload), uploaded)
            }
        };
        self.received.push_front(Received { file, state });
        Ok(Stepped::Part(uploaded))
    }

    /// Makes the pages of the capture, given the first file.
    fn open(&self, capture: &mut GpuCapture, first: &RuntimeScene, to: Target<'_>) -> Result<(), String> {
        let Target { device, queue, renderer, .. } = to;
        let files = ChunkFiles { table: self.table(), index: Some(&self.index), first };
        capture.open_pages(device, queue, renderer, files, GPU_BYTES).map_err(|e| e.to_string())?;
        ViewRenderer::check_room(device, capture.most_paged().unwrap_or_default()).map_err(|e| e.to_string())
    }

    fn of_file(&self, file: usize, message: &str) -> String {
        format!("{}: {message}", self.file_name(file))
    }

    /// Returns whether the most important Gaussians of a time are there, seconds since the start.
    pub fn has_picture(&self, seconds: f64) -> bool {
        self.schedule.coverage(seconds).is_coarse
    }

    /// Returns whether the first picture can be drawn.
    pub fn has_first_picture(&self) -> bool {
        self.has_picture(self.wanted)
    }

    /// Returns whether a step has nothing to do.
    pub fn is_idle(&self) -> bool {
        self.received.is_empty()
    }

    /// Returns the time to draw in the capture's unit: that of the last plan, which is `time`, or that of the picture before,
    /// until the most important Gaussians are there.
    pub fn time_of_picture(&mut self, time: f32) -> f32 {
        if self.has_picture(self.wanted) {
            self.shown = Some((self.wanted, time));
        }
        self.shown.map_or(time, |(_, shown)| shown)
    }

    /// Returns the share of the Gaussians of a time that is there.
    pub fn share(&self, seconds: f64) -> f32 {
        self.schedule.coverage(seconds).share()
    }

    /// Returns why the picture of a time may never be there.
    pub fn obstacle(&self, seconds: f64) -> Option<String> {
        Some(match self.schedule.obstacle(seconds, GPU_BYTES)? {
            Obstacle::OverBudget { needed } => format!(
                "its first layer at {seconds:.1} s takes {} MiB on the GPU, and the page has {}: cut the capture with \
                 shorter chunks or more layers",
                needed >> 20,
                GPU_BYTES >> 20
            ),
            Obstacle::Failing { file } => {
                let (name, remedy) = match self.file_range(file) {
                    None => {
                        let remedy = "the folder of the index needs all files that were made with it";
                        (format!("file {}", self.file_name(file)), remedy)
                    }
                    Some(_) => {
                        (format!("chunk file {}", file + 1), "the file has to be whole, and its server to send it")
                    }
                };
                format!("its {name} could not be loaded {} times in a row: {remedy}", Obstacle::MANY)
            }
        })
    }
}

/// Does one step of reading a file.
fn read(mut loading: Box<Loading>) -> Result<State, CodecError> {
    if loading.advance(Loading::STEP)? {
        return Ok(State::Reading(loading));
    }
    Ok(State::Read(Box::new(loading.finish()?)))
}
