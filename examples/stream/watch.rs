//! Frames in real time, at most 60 a second, without a window.
//!
//! In: an app and the entity of a streamed capture. Out: what is there of the capture in each frame, and how long
//! frames and pictures take. Playback and the link have the same clock.

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_gs4d::prelude::*;
use std::thread;
use std::time::{Duration, Instant};

/// Shortest time from a frame to the next.
const FRAME: Duration = Duration::from_nanos(16_666_667);
/// Longest time until a picture is there.
pub const LIMIT: Duration = Duration::from_secs(30);

/// Runs an app in real time.
pub struct Watch<'a> {
    app: &'a mut App,
    player: Entity,
    /// When the next frame begins.
    next: Instant,
}

/// A frame.
pub struct Frame {
    /// The duration of the update, without the wait before it.
    pub seconds: f64,
    pub state: CaptureStreamState,
}

/// How long a picture has taken, seconds; infinite if longer than [`LIMIT`].
pub struct Arrival {
    /// Until the most important Gaussians were drawn.
    pub coarse: f64,
    /// Until all Gaussians were drawn.
    pub whole: f64,
}

impl<'a> Watch<'a> {
    /// Lets time pass in the app.
    pub fn new(app: &'a mut App, player: Entity) -> Self {
        app.insert_resource(TimeUpdateStrategy::Automatic);
        // Bevy's default: the time before the first frame is not played.
        app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(Duration::from_millis(250));
        Self { app, player, next: Instant::now() }
    }

    /// Runs a frame.
    ///
    /// # Errors
    /// A capture that cannot be loaded; the end of the app.
    pub fn frame(&mut self) -> Result<Frame> {
        thread::sleep(self.next.saturating_duration_since(Instant::now()));
        let began = Instant::now();
        self.next = began + FRAME;
        self.app.update();
        let seconds = began.elapsed().as_secs_f64();
        if self.app.should_exit().is_some() {
            return Err("the app ended: the log has the reason".into());
        }
        let player = self.app.world().entity(self.player);
        if let Some(CaptureState::Failed(error)) = player.get::<CaptureState>() {
            return Err(error.to_string().into());
        }
        Ok(Frame { seconds, state: player.get::<CaptureStreamState>().cloned().unwrap_or_default() })
    }

    /// Runs frames until the capture is drawn with all Gaussians, and returns how long that has taken since `began`.
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame).
    pub fn arrive(&mut self, began: Instant) -> Result<Arrival> {
        let mut arrival = Arrival { coarse: f64::INFINITY, whole: f64::INFINITY };
        let mut before = CaptureStreamState::default();
        while arrival.whole.is_infinite() && began.elapsed() < LIMIT {
            let state = self.frame()?.state;
            let seconds = began.elapsed().as_secs_f64();
            // Of new Gaussians the second frame is the first that is sure to draw all: buffers grow by the counts of an
            // earlier one.
            if before.is_coarse {
                arrival.coarse = arrival.coarse.min(seconds);
            }
            if before.is_whole() {
                arrival.whole = seconds;
            }
            before = state;
        }
        Ok(arrival)
    }

    /// Goes to a time of the capture, seconds.
    pub fn seek(&mut self, seconds: f32) {
        if let Some(mut playback) = self.app.world_mut().get_mut::<Playback>(self.player) {
            playback.seek(seconds);
        }
    }
}
