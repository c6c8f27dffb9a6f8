//! An app that shows a state.
//!
//! In: a sequence of [`State`]s. Out: an app to which only the differences from one state to the next are applied, as
//! in a game, and its pictures.

use crate::checks;
use crate::state::{Placed, Source, State, Viewer, scene};
use crate::support::pipelines::check_pipelines;
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, PollType};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::time::TimeUpdateStrategy;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::offline;
use bevy_gs4d::prelude::*;
use bevy_gs4d::scene::GaussianScene;
use bevy_gs4d::testing::{self, Offscreen};
use image::RgbaImage;
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use wgpu::SubmissionIndex;

/// Size of the second camera's target in pixels.
const SECOND_SIZE: UVec2 = UVec2::new(80, 60);
/// Time from one update to the next.
const STEP: Duration = Duration::from_millis(20);
/// Longest time for a file to be loaded again.
const TIMEOUT: Duration = Duration::from_secs(120);
/// Number of updates after which a camera without a capture has freed all of its memory, with a margin.
const IDLE: usize = 130;
/// Largest number of frames that the GPU may be behind, as with a window. Without this limit the CPU would run ahead,
/// and wgpu keeps the command buffers of the largest number of frames that were ever in flight at once.
const FRAMES_IN_FLIGHT: usize = 3;

/// An app and the state that it shows.
pub struct Stage {
    app: App,
    /// Number of updates, without the updates for pictures.
    pub updates: u64,
    folder: TempDir,
    shown: State,
    captures: BTreeMap<u64, Entity>,
    cameras: Vec<(Entity, Offscreen)>,
    /// The submissions at the ends of the frames that the GPU may not have finished.
    in_flight: VecDeque<SubmissionIndex>,
}

impl Stage {
    /// Starts an app for a state, without its captures and cameras. `order` has the numbers of the captures in the
    /// order in which their splats of equal depth are drawn.
    ///
    /// # Errors
    /// The app cannot be started, or logs a message about captures.
    pub fn new(state: &State, order: &[u64]) -> Result<Self, String> {
        let mut app = checks::app(state.size);
        let folder = tempfile::tempdir().map_err(|error| format!("no temporary folder: {error}"))?;
        let mut places: Vec<Entity> = order.iter().map(|_| app.world_mut().spawn_empty().id()).collect();
        places.sort();
        let captures = order.iter().copied().zip(places).collect();
        let shown = State { captures: Vec::new(), cameras: Vec::new(), ..state.clone() };
        let mut stage =
            Self { app, updates: 0, folder, shown, captures, cameras: Vec::new(), in_flight: VecDeque::new() };
        stage.write_file(state)?;
        testing::settle(&mut stage.app).map_err(|error| error.to_string())?;
        // Other messages up to here are about the machine, such as a software driver.
        let logged = checks::take_logged();
        let own: Vec<&String> = logged.iter().filter(|message| message.contains("capture")).collect();
        if own.is_empty() { Ok(stage) } else { Err(format!("logged at the start: {own:?}")) }
    }

    /// Makes the app show a state from the next update on.
    ///
    /// # Errors
    /// A file that cannot be written, or is not loaded again.
    pub fn show(&mut self, state: &State) -> Result<(), String> {
        let is_written = self.shown.version != state.version;
        // Of two concurrent loads the older may end last.
        if is_written || !state.shows_file() {
            self.wait_for_file()?;
        }
        if is_written {
            self.write_file(state)?;
        }
        if is_written && self.shown.shows_file() {
            self.app.world().resource::<AssetServer>().reload(self.file());
        }
        let bias = if state.coarse { -16.0 } else { 16.0 };
        self.app.insert_resource(CaptureDetail { bias });
        self.resize(state.size);
        self.show_captures(&state.captures);
        self.show_cameras(&state.cameras);
        self.shown = state.clone();
        Ok(())
    }

    /// Runs one update.
    ///
    /// # Errors
    /// A condition of [`checks::check_running`] is violated after the update.
    pub fn update(&mut self) -> Result<(), String> {
        self.app.insert_resource(TimeUpdateStrategy::ManualDuration(STEP));
        self.app.update();
        self.updates += 1;
        self.wait_for_frame()?;
        checks::check_running(&self.app)
    }

    /// Returns the pictures of all cameras once everything has been loaded and drawn.
    ///
    /// # Errors
    /// The pictures cannot be drawn, or a check fails.
    pub fn pictures(&mut self) -> Result<Vec<RgbaImage>, String> {
        self.wait_for_file()?;
        let failed = |error: testing::TestingError| error.to_string();
        let mut pictures = vec![testing::picture(&mut self.app, Duration::ZERO).map_err(failed)?];
        for (_, target) in self.cameras.iter().skip(1) {
            pictures.push(testing::read(&mut self.app, target).map_err(failed)?);
        }
        checks::check_running(&self.app)?;
        check_pipelines(&self.app)?;
        Ok(pictures)
    }

    /// Returns the numbers of the captures in the order in which they are drawn: the order of their entities.
    pub fn order(&self) -> Vec<u64> {
        let mut order: Vec<(Entity, u64)> = self.captures.iter().map(|(number, entity)| (*entity, *number)).collect();
        order.sort();
        order.into_iter().map(|(_, number)| number).collect()
    }

    /// Waits until removed captures have freed their memory.
    ///
    /// # Errors
    /// The bytes, uploads and assets that remain.
    pub fn wait_until_empty(&mut self) -> Result<(), String> {
        for _ in 0..IDLE {
            self.update()?;
        }
        let statistics = self.app.world().resource::<CaptureStatistics>();
        let bytes = statistics.capture_bytes() + statistics.views().iter().map(|(_, view)| view.bytes).sum::<u64>();
        let uploads = statistics.uploaded_captures() + statistics.uploading_captures();
        let assets = self.app.world().resource::<Assets<GaussianCapture>>().len();
        if (bytes, uploads, assets) == (0, 0, 0) {
            return Ok(());
        }
        Err(format!("without a capture {bytes} bytes on the GPU, {uploads} uploads and {assets} assets are left"))
    }

    /// Waits until at most [`FRAMES_IN_FLIGHT`] frames are in flight.
    fn wait_for_frame(&mut self) -> Result<(), String> {
        let world = self.app.world();
        let (device, queue) = (world.resource::<RenderDevice>(), world.resource::<RenderQueue>());
        self.in_flight.push_back(queue.submit([]));
        if self.in_flight.len() <= FRAMES_IN_FLIGHT {
            return Ok(());
        }
        let wait = PollType::Wait { submission_index: self.in_flight.pop_front(), timeout: None };
        device.poll(wait).map(|_| ()).map_err(|error| format!("the GPU does not finish: {error}"))
    }

    fn file(&self) -> PathBuf {
        self.folder.path().join("changing.gs4d")
    }

    /// Writes the file completely or not at all.
    fn write_file(&self, state: &State) -> Result<(), String> {
        let scene = GaussianScene::from(state.file_scene());
        offline::work::save(&self.file(), &scene, &WriteSettings { level: 1 }).map_err(|error| error.to_string())
    }

    /// Updates the app until the newest version of the file has been loaded, if a capture shows the file.
    fn wait_for_file(&mut self) -> Result<(), String> {
        if !self.shown.shows_file() {
            return Ok(());
        }
        let (expected, began) = (self.shown.file_scene(), Instant::now());
        let is_loaded = |app: &App| {
            let captures = app.world().resource::<Assets<GaussianCapture>>();
            captures.iter().any(|(_, capture)| *capture.scene() == expected)
        };
        while !is_loaded(&self.app) {
            if began.elapsed() > TIMEOUT {
                return Err("a changed file was not loaded again in time".to_owned());
            }
            self.update()?;
        }
        Ok(())
    }

    fn resize(&mut self, size: UVec2) {
        if self.shown.size == size {
            return;
        }
        let image = self.app.world().resource::<Offscreen>().image.clone();
        let extent = Extent3d { width: size.x, height: size.y, ..default() };
        self.app
            .world_mut()
            .resource_mut::<Assets<Image>>()
            .get_mut(&image)
            .expect("the app has this image")
            .resize(extent);
        self.app.insert_resource(Offscreen { image, size });
    }

    fn show_captures(&mut self, captures: &[Placed]) {
        for gone in self.shown.captures.iter().filter(|shown| captures.iter().all(|kept| kept.number != shown.number)) {
            if let Some(entity) = self.captures.remove(&gone.number) {
                self.app.world_mut().despawn(entity);
            }
        }
        for placed in captures {
            let before = self.shown.captures.iter().find(|shown| shown.number == placed.number);
            let Some(before) = before else {
                let capture = GaussianCapture3d(self.load(placed.source));
                let world = self.app.world_mut();
                let entity = *self.captures.entry(placed.number).or_insert_with(|| world.spawn_empty().id());
                world.entity_mut(entity).insert((capture, placed.pose, placed.playback, placed.settings));
                continue;
            };
            let Some(&entity) = self.captures.get(&placed.number) else { continue };
            let mut entity = self.app.world_mut().entity_mut(entity);
            if before.playback != placed.playback {
                let mut playback = placed.playback;
                // The app has advanced the time since: only a seek sets it.
                if playback.time == before.playback.time
                    && let Some(now) = entity.get::<Playback>()
                {
                    playback.time = now.time;
                }
                entity.insert(playback);
            }
            if before.settings != placed.settings {
                entity.insert(placed.settings);
            }
        }
    }

    fn load(&mut self, source: Source) -> Handle<GaussianCapture> {
        let server = self.app.world().resource::<AssetServer>();
        match source {
            Source::Bundled => server.load(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/toybox.gs4d")),
            Source::File => server.load(self.file()),
            Source::Made(form, seed) => add(&mut self.app, GaussianCapture::new(scene(form, seed))),
        }
    }

    fn show_cameras(&mut self, cameras: &[Viewer]) {
        while self.cameras.len() > cameras.len() {
            if let Some((entity, _)) = self.cameras.pop() {
                self.app.world_mut().despawn(entity);
            }
        }
        for (index, viewer) in cameras.iter().enumerate() {
            if index == self.cameras.len() {
                let target = match index {
                    0 => self.app.world().resource::<Offscreen>().clone(),
                    _ => Offscreen::new(&mut self.app.world_mut().resource_mut::<Assets<Image>>(), SECOND_SIZE),
                };
                self.cameras.push((spawn_camera(&mut self.app, &target, viewer), target));
            } else if self.shown.cameras.get(index) != Some(viewer) {
                self.app.world_mut().entity_mut(self.cameras[index].0).insert(components(viewer));
            }
        }
    }
}

/// Adds a capture to the assets.
pub fn add(app: &mut App, capture: GaussianCapture) -> Handle<GaussianCapture> {
    app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(capture)
}

/// Spawns a camera without tonemapping and dithering, so that its pixels can be compared.
pub fn spawn_camera(app: &mut App, target: &Offscreen, viewer: &Viewer) -> Entity {
    let camera = (Camera3d::default(), target.target(), Tonemapping::None, DebandDither::Disabled);
    app.world_mut().spawn((camera, components(viewer))).id()
}

fn components(viewer: &Viewer) -> impl Bundle + use<> {
    (viewer.pose, viewer.msaa, viewer.settings, viewer.lens.projection())
}
