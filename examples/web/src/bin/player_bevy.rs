//! The player of a page as a Bevy app: the model of a game in a browser.
//!
//! In: a canvas, then a file, then cameras and times. Out: pictures on the canvas. The page calls [`Player`] from
//! JavaScript (`page/player.js`), as it calls the player without Bevy; a system of the app applies the calls. A capture
//! in chunk files at an address is streamed by the app itself, as in a game.

use bevy::asset::AssetMetaCheck;
use bevy::camera::PerspectiveProjection;
use bevy::camera::primitives::Aabb;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy::render::renderer::RenderQueue;
use bevy_gs4d::prelude::*;
use bevy_gs4d::scene::{Bounds, RuntimeScene};
use bevy_gs4d::stream::{CaptureStreamState, HttpRangesPlugin};
use gs4d_web::{About, Opening, OpeningStep, report_panics};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use wasm_bindgen::prelude::wasm_bindgen;
use web_sys::HtmlCanvasElement;

/// Frames from a call until its picture has been given to the device.
const FRAMES: u32 = 2;

/// Seconds after the time that is drawn whose files are loaded ahead: the page has the clock, and the app is at rest.
const AHEAD: [f32; 4] = [0.5, 1.0, 2.0, 4.0];

/// A player on a canvas.
#[wasm_bindgen]
pub struct Player {
    /// Where the file is that is being opened; `None`: on this device.
    address: Option<String>,
    opening: Option<Opening>,
    /// What to tell about the capture once it is shown.
    about: Option<About>,
    shared: Shared,
}

/// What the page and the app tell each other.
#[derive(Resource, Clone, Default)]
struct Shared(Arc<Mutex<State>>);

#[derive(Default)]
struct State {
    /// From the page: a scene to show, the camera and the time to draw, and the bias of the level of detail.
    scene: Option<Box<RuntimeScene>>,
    /// From the page: where a capture in chunk files is. From the app: its place, once its first picture can be drawn.
    address: Option<String>,
    place: Option<Bounds>,
    shot: Option<Shot>,
    detail: f32,
    /// The background in place of that of the capture, which is `trained`.
    background: Option<[f32; 3]>,
    trained: [f32; 3],
    /// From the app: whether the scene is shown, why not, the frames until the last picture is on the canvas, and
    /// whether only the device has to finish it.
    shown: bool,
    failed: Option<String>,
    left: u32,
    submitted: bool,
}

struct Shot {
    time: f32,
    camera: Transform,
    /// Vertical field of view, radians.
    fov: f32,
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[wasm_bindgen]
impl Player {
    /// Starts an app that draws on a canvas, which has an id. The app chooses the format and the size of its pictures.
    ///
    /// # Errors
    /// None: it has the signature of the player without Bevy.
    pub async fn create(canvas: HtmlCanvasElement, _format: &str) -> Result<Player, String> {
        report_panics();
        let shared = Shared::default();
        let window = Window {
            canvas: Some(format!("#{}", canvas.id())),
            fit_canvas_to_parent: true,
            prevent_default_event_handling: false,
            ..default()
        };
        App::new()
            .add_plugins((
                HttpRangesPlugin,
                DefaultPlugins
                    .set(WindowPlugin { primary_window: Some(window), ..default() })
                    // A server answers a request for a file that is not there with an error in the console.
                    .set(AssetPlugin { meta_check: AssetMetaCheck::Never, ..default() }),
                GaussianCapturePlugins,
            ))
            .insert_resource(shared.clone())
            .insert_resource(ClearColor(Color::BLACK))
            .add_systems(Startup, setup)
            .add_systems(Update, apply_calls)
            .run();
        Ok(Self { address: None, opening: None, about: None, shared })
    }

    /// Sets the bias of the level of detail: captures count as two to this power as large.
    pub fn set_detail(&mut self, bias: f32) {
        self.shared.state().detail = bias;
    }

    /// Sets the background: three numbers from 0 to 1, sRGB-encoded; without them, that of the capture.
    pub fn set_background(&mut self, color: Option<Vec<f32>>) {
        self.shared.state().background = color.and_then(|color| color.try_into().ok());
    }

    /// Sets where the file is that is opened next: an absolute address; without it, on this device.
    pub fn set_address(&mut self, address: Option<String>) {
        self.address = address;
    }

    /// Returns the length of the index, bytes, if chunk files follow it in the file that is being received, and the app
    /// can fetch them.
    pub fn index_length(&mut self) -> Option<f64> {
        self.address.as_ref()?;
        self.opening.as_mut()?.index_length().map(|length| length as f64)
    }

    /// Ends receiving at the index: the app fetches the files that follow.
    ///
    /// # Errors
    /// A message about an index that is damaged, or has not been received.
    pub fn end_at_index(&mut self) -> Result<(), String> {
        self.opening.as_mut().ok_or("no file is being received")?.end_at_index()
    }

    /// Begins to open a file, whose length is 0 if it is not known. The capture that is shown stays until the file is
    /// open.
    pub fn open(&mut self, name: &str, length: usize) {
        // The memory of a file that was being opened is free before that of the next is needed.
        self.opening = None;
        (self.opening, self.about) = (Some(Opening::new(name, length)), None);
    }

    /// Receives bytes of the file. [`step`](Self::step) begins once all have been received.
    ///
    /// # Errors
    /// A message about a file that is larger than the memory.
    pub fn receive(&mut self, piece: &[u8]) -> Result<(), String> {
        self.opening.as_mut().ok_or("no file is being opened")?.receive(piece)
    }

    /// Does one step of opening. Returns what there is to tell about the capture when it is shown.
    ///
    /// # Errors
    /// A message about a file of an unknown format, a damaged file, or a capture that the device cannot draw.
    pub fn step(&mut self) -> Result<Option<About>, String> {
        if let Some(mut opening) = self.opening.take() {
            match opening.advance()? {
                OpeningStep::Part => self.opening = Some(opening),
                OpeningStep::Scene(scene) => {
                    let mut about = About::of(&scene);
                    let mut state = self.shared.state();
                    (state.address, state.place) = (None, None);
                    if let Some(table) = &scene.chunks {
                        let Some(address) = self.address.clone() else {
                            let remedy = "leave engine=bevy out of the link, or join the files by gs4d join";
                            return Err(format!(
                                "it is the index of a capture in chunk files, which this player fetches from addresses \
                                 alone: {remedy}"
                            ));
                        };
                        about.place(table.files.iter().map(|file| file.gaussians).sum(), None);
                        state.address = Some(address);
                    }
                    self.about = Some(about);
                    (state.scene, state.shown, state.failed) = (Some(scene), false, None);
                }
            }
            return Ok(None);
        }
        let mut state = self.shared.state();
        match state.failed.take() {
            Some(message) => Err(message),
            None if state.shown => {
                let mut about = self.about.take().ok_or("no file is being opened")?;
                if let place @ Some(_) = state.place.take() {
                    about.place(about.gaussians.into(), place);
                }
                Ok(Some(about))
            }
            None => Ok(None),
        }
    }

    /// Returns whether a step does nothing yet: the app has to show the capture.
    pub fn waits(&self) -> bool {
        let state = self.shared.state();
        self.opening.is_none() && !state.shown && state.failed.is_none()
    }

    /// Returns the part of the opening that is done, 0 to 1.
    pub fn progress(&self) -> f32 {
        self.opening.as_ref().map_or(1.0, Opening::progress)
    }

    /// Returns whether the last picture is on the canvas.
    pub fn is_ready(&self) -> bool {
        self.shared.state().left == 0
    }

    /// Returns the first fault since the last call.
    pub fn fault(&self) -> Option<String> {
        self.shared.state().failed.take()
    }

    /// Draws the capture at a time, in its own unit, from a camera: a pose of sixteen numbers, and a lens of two.
    ///
    /// # Errors
    /// A message about other counts of numbers.
    pub fn draw(&mut self, time: f32, pose: &[f32], lens: &[f32]) -> Result<(), String> {
        let pose: &[f32; 16] = pose.try_into().map_err(|_| "a pose has sixteen numbers".to_owned())?;
        let [_, tan] = *lens else { return Err("a lens of this player has two numbers".to_owned()) };
        // Cameras of Bevy look along -z, with y up.
        let flip = Mat4::from_diagonal(Vec4::new(1.0, -1.0, -1.0, 1.0));
        let camera = Transform::from_matrix(Mat4::from_cols_array(pose).inverse() * flip);
        let mut state = self.shared.state();
        state.shot = Some(Shot { time, camera, fov: 2.0 * tan.atan() });
        state.left = FRAMES;
        Ok(())
    }
}

/// Spawns the camera.
fn setup(mut commands: Commands) {
    // Captures need no multisampling, and their colors are not mapped.
    commands.spawn((Camera3d::default(), Msaa::Off, Tonemapping::None));
}

/// Applies the calls of the page.
fn apply_calls(
    mut commands: Commands,
    shared: Res<Shared>,
    queue: Option<Res<RenderQueue>>,
    mut clear: ResMut<ClearColor>,
    mut detail: ResMut<CaptureDetail>,
    server: Res<AssetServer>,
    mut captures: ResMut<Assets<GaussianCapture>>,
    mut shown: Query<(Entity, &GaussianCapture3d, &CaptureState, &mut Playback, Option<&Aabb>)>,
    mut failures: MessageReader<CaptureFailed>,
    mut streamed: Query<&mut CaptureStreamSettings, With<CaptureStreamState>>,
    mut camera: Single<(&mut Transform, &mut Projection), With<Camera3d>>,
) {
    let mut state = shared.state();
    // That files are missing is no state of the entity.
    if let Some(failed) = failures.read().last().filter(|_| !state.shown) {
        state.failed = Some(failed.error.to_string());
    }
    detail.bias = state.detail;
    let [red, green, blue] = state.background.unwrap_or(state.trained);
    let color = Color::srgb(red, green, blue);
    if clear.0 != color {
        clear.0 = color;
    }
    if let Some(scene) = state.scene.take() {
        for (entity, ..) in &shown {
            commands.entity(entity).despawn();
        }
        state.trained = scene.trained_with.background;
        let capture = match state.address.take() {
            Some(address) => server.load(address),
            None => captures.add(GaussianCapture::new(*scene)),
        };
        let settings = CaptureStreamSettings::default();
        commands.spawn((GaussianCapture3d(capture), Playback { playing: false, ..default() }, settings));
        return;
    }
    let Ok((_, GaussianCapture3d(capture), loaded, mut playback, place)) = shown.single_mut() else { return };
    match loaded {
        CaptureState::Ready => {
            if !state.shown && !streamed.is_empty() {
                state.place = place.map(|place| Bounds { min: place.min().into(), max: place.max().into() });
            }
            state.shown = true;
        }
        CaptureState::Failed(failure) if !state.shown => state.failed = Some(failure.to_string()),
        _ => {}
    }
    if state.left > 1 {
        state.left -= 1;
    } else if let (1, false, Some(queue)) = (state.left, state.submitted, queue) {
        state.submitted = true;
        let shared = shared.clone();
        queue.on_submitted_work_done(move || {
            let mut state = shared.state();
            (state.left, state.submitted) = (0, false);
        });
    }
    if let (Some(shot), Some(capture)) = (state.shot.take(), captures.get(capture)) {
        playback.time = capture.seconds_at(shot.time);
        for mut settings in &mut streamed {
            let (now, duration) = (playback.time, capture.duration_seconds());
            settings.preload =
                AHEAD.iter().map(|ahead| (now + ahead).rem_euclid(duration.max(f32::MIN_POSITIVE))).collect();
        }
        let (transform, projection) = &mut *camera;
        **transform = shot.camera;
        **projection = Projection::Perspective(PerspectiveProjection { fov: shot.fov, ..default() });
    }
}

fn main() {}
