//! Cuts: from one frame to the next, the camera's pose and the time change; some cuts also change the camera, the
//! design or the captures.
//!
//! In: a seed and a number of cuts. Out: the closing line, if the first frame after each cut equals the frames after
//! it; else the first cut for which it does not.
//!
//! A view has room for 65,536 pairs of splats and tiles, or for two pairs per Gaussian, before it has counted pairs,
//! and for 1.5 times the counted pairs afterwards (`renderer`, "Room"). Every tenth cut goes close to a crowd of large,
//! faint splats with more pairs, and every second of these cuts has a new camera or another design, whose room is that
//! of a new view. A frame with more pairs than the largest possible room is counted as overflowing; a run without such
//! a frame fails.

use crate::changes::{spread, unit};
use crate::checks::{self, difference, shows_something};
use crate::stage::{add, spawn_camera};
use crate::state::{Form, Viewer, scene};
use crate::support::random::Random;
use bevy::prelude::*;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::render_resource::PollType;
use bevy::render::renderer::RenderDevice;
use bevy_gs4d::prelude::*;
use bevy_gs4d::renderer::{Design, ViewStatistics};
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::testing::{self, Offscreen};
use std::collections::VecDeque;
use std::mem;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Size of the picture in pixels. Rows of this width are read back without padding.
const SIZE: UVec2 = UVec2::new(256, 192);
/// Largest allowed difference between two frames, in 255ths: a tile without room is blended in other steps, whose sums
/// are rounded differently.
const APART: u8 = 1;
/// Number of pairs for which a view has room before it has counted pairs.
const FIRST_ROOM: u32 = 1 << 16;
/// Numbers of updates after a cut: after a cut close to the crowd, until frames have room; after other cuts; after a
/// new capture, until its upload is complete.
const UPDATES: [usize; 3] = [4, 2, 10];
/// Bytes of captures that are uploaded in a frame, so that the upload of a new capture takes several frames.
const BUDGET: u64 = 48 << 10;
/// Largest number of captures in addition to the crowd.
const OTHERS: usize = 3;

/// A cut and the frames after it.
#[derive(Default)]
struct Cut {
    number: u64,
    /// Whether frames may equal those before the cut until the upload of a new capture is complete.
    appears: bool,
    /// Whether the first frame had more pairs than room.
    overflows: bool,
    frames: Vec<Vec<u8>>,
}

/// An app in which cuts are made.
struct Cutter {
    app: App,
    random: Random,
    camera: Entity,
    viewer: Viewer,
    crowd: Entity,
    others: VecDeque<Entity>,
    arrived: Arc<Mutex<Vec<Vec<u8>>>>,
    /// The largest number of pairs for which the view can have room.
    room: u32,
    updates: u64,
}

/// Makes `cuts` cuts.
///
/// # Errors
/// The first defect and the number of its cut.
pub fn run(seed: u64, cuts: u64) -> Result<String, String> {
    println!("cuts: seed {seed}");
    let began = Instant::now();
    let mut cutter = Cutter::new(seed)?;
    let (mut overflowing, mut worst, mut shown) = (0, 0, 0);
    let (mut last, mut before) = (Cut::default(), Vec::new());
    for number in 1..=cuts + 1 {
        let reproducible = |defect: String| format!("{defect}\n    again: --seed {seed} --cuts {number}");
        let next = cutter.cut(number).map_err(reproducible)?;
        let mut frames = next.frames.into_iter();
        // The last frame of a cut arrives after the first update of the next.
        last.frames.extend(frames.next());
        worst = worst.max(judge(&last, &before).map_err(reproducible)?);
        before = last.frames.pop().unwrap_or_default();
        overflowing += u64::from(last.overflows);
        shown += u64::from(shows_something(&before));
        last = Cut { frames: frames.collect(), ..next };
        if number.is_multiple_of(500) {
            println!("cut {number}: {overflowing} without room, worst {worst} of 255, {} s", began.elapsed().as_secs());
        }
    }
    if overflowing == 0 || 2 * shown < cuts {
        return Err(format!(
            "the run tests too little: {overflowing} frames lacked room, {shown} of {cuts} pictures are not empty"
        ));
    }
    let (updates, seconds) = (cutter.updates, began.elapsed().as_secs());
    Ok(format!(
        "cuts: {cuts} cuts, {overflowing} overflowing frames, worst difference {worst} of 255, {updates} updates, \
         {seconds} s"
    ))
}

/// Returns the largest difference between the last frame of a cut and its other frames. `before` is the last frame of
/// the cut before.
fn judge(cut: &Cut, before: &[u8]) -> Result<u8, String> {
    let Some((last, frames)) = cut.frames.split_last() else { return Ok(0) };
    let as_before = |frame: &&Vec<u8>| cut.appears && difference(frame, before) <= APART;
    let absent = frames.iter().take_while(as_before).count();
    let apart = frames[absent..].iter().map(|frame| difference(frame, last)).max().unwrap_or_default();
    if apart > APART {
        return Err(format!("a frame after cut {} differs by {apart} of 255 from the last frame", cut.number));
    }
    Ok(apart)
}

impl Cutter {
    fn new(seed: u64) -> Result<Self, String> {
        let mut app = checks::app(SIZE);
        app.insert_resource(CaptureUploadBudget { bytes_per_frame: BUDGET });
        let mut viewer = Viewer::default();
        viewer.settings.design = Design::GlobalSort;
        let target = app.world().resource::<Offscreen>().clone();
        let camera = spawn_camera(&mut app, &target, &viewer);
        let crowd = spawn(&mut app, crowd(), Transform::default());
        testing::settle(&mut app).map_err(|error| error.to_string())?;
        checks::take_logged();
        let arrived = Arc::new(Mutex::new(Vec::new()));
        let sink = arrived.clone();
        app.world_mut().spawn(Readback::texture(target.image)).observe(move |event: On<ReadbackComplete>| {
            sink.lock().unwrap_or_else(PoisonError::into_inner).push(event.data.clone());
        });
        let (random, others) = (Random::new(seed), VecDeque::new());
        let mut cutter = Self { app, random, camera, viewer, crowd, others, arrived, room: 0, updates: 0 };
        cutter.update()?;
        Ok(cutter)
    }

    /// Makes a cut, and returns the frames that have arrived since. The first of them is the last frame of the cut
    /// before.
    fn cut(&mut self, number: u64) -> Result<Cut, String> {
        let close = number % 10 == 9;
        let mut appears = None;
        match number % 10 {
            5 if self.others.len() < OTHERS => appears = Some(self.spawn_other()),
            5 => {
                if let Some(oldest) = self.others.pop_front() {
                    self.app.world_mut().despawn(oldest);
                }
            }
            _ => self.go(close, number % 20 == 9),
        }
        self.update()?;
        let room = self.room;
        let updates = match appears {
            Some(_) => UPDATES[2],
            None => UPDATES[usize::from(!close)],
        };
        for _ in 1..updates {
            self.update()?;
        }
        if let Some(entity) = appears
            && self.app.world().get::<CaptureState>(entity) != Some(&CaptureState::Ready)
        {
            return Err(format!("the capture of cut {number} is not ready after {updates} updates"));
        }
        let frames = mem::take(&mut *self.arrived.lock().unwrap_or_else(PoisonError::into_inner));
        if frames.len() != updates {
            return Err(format!("{} frames arrived in {updates} updates", frames.len()));
        }
        Ok(Cut { number, appears: appears.is_some(), overflows: close && self.pairs() > room, frames })
    }

    /// Moves the camera, `close` to the crowd or far from it, and sets all captures to other times. `renew` makes the
    /// view a new one.
    fn go(&mut self, close: bool, renew: bool) {
        let distance = if close { 0.8 + 1.6 * unit(&mut self.random) } else { 8.0 + 30.0 * unit(&mut self.random) };
        let place = distance * spread(&mut self.random).normalize_or(Vec3::X);
        self.viewer.pose = Transform::from_translation(place).looking_at(0.3 * spread(&mut self.random), Vec3::Z);
        let captures: Vec<Entity> = self.others.iter().copied().chain([self.crowd]).collect();
        for capture in captures {
            let moment = Playback::paused_at(2.0 * unit(&mut self.random));
            self.app.world_mut().entity_mut(capture).insert(moment);
        }
        if !renew {
            self.app.world_mut().entity_mut(self.camera).insert(self.viewer.pose);
            return;
        }
        self.room = 0;
        if self.random.below(2) == 0 {
            let binned = self.viewer.settings.design == Design::TileBins;
            self.viewer.settings.design = if binned { Design::GlobalSort } else { Design::TileBins };
            self.app.world_mut().entity_mut(self.camera).insert((self.viewer.pose, self.viewer.settings));
        } else {
            let target = self.app.world().resource::<Offscreen>().clone();
            self.app.world_mut().despawn(self.camera);
            self.camera = spawn_camera(&mut self.app, &target, &self.viewer);
        }
    }

    /// Spawns a capture near the crowd.
    fn spawn_other(&mut self) -> Entity {
        let form = [Form::Single, Form::Filtered, Form::Packed][self.random.below(3)];
        let pose = Transform::from_translation(spread(&mut self.random));
        let entity = spawn(&mut self.app, scene(form, self.random.bits() % 1000), pose);
        self.others.push_back(entity);
        entity
    }

    /// Runs one update, until the GPU has drawn it and its counters have arrived.
    fn update(&mut self) -> Result<(), String> {
        self.app.update();
        self.updates += 1;
        let device = self.app.world().resource::<RenderDevice>().wgpu_device();
        device.poll(PollType::wait_indefinitely()).map_err(|error| format!("the GPU does not finish: {error}"))?;
        let total = self.view().map_or(0, |view| view.total);
        let counted = self.pairs().saturating_add(self.pairs() / 2);
        self.room = self.room.max(FIRST_ROOM).max(total.saturating_mul(2)).max(counted);
        checks::check_running(&self.app)
    }

    fn view(&self) -> Option<ViewStatistics> {
        self.app.world().resource::<CaptureStatistics>().view(self.camera)
    }

    /// Returns the number of pairs of the newest frame that has been counted.
    fn pairs(&self) -> u32 {
        self.view().map_or(0, |view| view.pairs)
    }
}

/// Returns large Gaussians, so faint that the farthest is also visible.
fn crowd() -> RuntimeScene {
    let settings = SynthSettings { count: 3000, seed: 2, degree: 0, degree_t: 0, duration_seconds: 2.0 };
    let mut scene = synthesize(&settings).into_runtime().expect("synthetic scenes can be drawn");
    for gaussian in &mut scene.form.as_sliced_mut().expect("synthetic scenes are sliced").gaussians {
        gaussian.covariance = gaussian.covariance.map(|entry| 250.0 * entry);
        (gaussian.opacity, gaussian.sigma_t, gaussian.velocity) = (0.006, f32::INFINITY, [0.0; 3]);
    }
    scene
}

fn spawn(app: &mut App, scene: RuntimeScene, pose: Transform) -> Entity {
    let capture = add(app, GaussianCapture::new(scene));
    app.world_mut().spawn((GaussianCapture3d(capture), Playback::paused_at(1.0), pose)).id()
}
