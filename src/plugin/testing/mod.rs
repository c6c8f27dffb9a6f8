//! Pictures of a Bevy app without a window: for tests of games, and for examples that write files.
//!
//! In: an app from [`app`], whose cameras draw into an [`Offscreen`] instead of the primary window. Out: pictures, each
//! at an exact time: time advances only by the requested steps. A software driver of Vulkan is enough.
//!
//! # Render a Bevy app to an image in ten lines
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_gs4d::{prelude::*, testing};
//! use std::time::Duration;
//!
//! let mut app = testing::app(UVec2::new(320, 240));
//! app.add_plugins(GaussianCapturePlugins);
//! let capture = app.world().resource::<AssetServer>().load("toybox.gs4d");
//! app.world_mut().spawn(GaussianCapture3d(capture));
//! let eye = Transform::from_xyz(0.0, 1.0, 4.0).looking_at(Vec3::ZERO, Vec3::Y);
//! app.world_mut().spawn((Camera3d::default(), eye));
//! let picture = testing::picture(&mut app, Duration::from_secs(1))?;
//! assert!(picture.pixels().any(|pixel| pixel.0[0] > 128), "something bright is visible");
//! # Ok::<(), testing::TestingError>(())
//! ```
//!
//! [`picture`] waits until every capture and timeline in the world has been loaded; [`wait_for`] adds other assets of a
//! game. Without a GPU, every function that draws returns [`TestingError::NoGpu`], with which a test can skip itself.
//!
//! # Play a game without drawing it
//!
//! [`step`] advances time frame by frame, [`press`], [`release`] and [`tap`] use the keyboard. Neither needs a GPU:
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_gs4d::{prelude::*, testing};
//! use std::time::Duration;
//!
//! let mut app = App::new();
//! app.add_plugins((MinimalPlugins, AssetPlugin::default(), bevy::input::InputPlugin, GaussianCapturePlugins));
//! let capture = app.world().resource::<AssetServer>().load("toybox.gs4d");
//! let player = app.world_mut().spawn(GaussianCapture3d(capture)).id();
//! testing::step(&mut app, Duration::from_millis(500))?;
//! testing::tap(&mut app, KeyCode::Space)?;
//! let playback = app.world().get::<Playback>(player).expect("every capture has one");
//! assert!((playback.time - 0.5).abs() < 1e-3, "half a second has passed");
//! # Ok::<(), testing::TestingError>(())
//! ```

mod error;
mod film;
mod gpu;
mod headless;
mod keys;
mod offscreen;
mod pipelines;
mod readback;
mod stepping;
mod waiting;
mod window;

pub use error::TestingError;
pub use film::{Film, FilmError, Filmed, FilmedPoint, HoldOut, Rig, film};
pub use gpu::has_gpu;
pub use headless::{app, app_with};
pub use image::{Rgba32FImage, RgbaImage};
pub use keys::{press, release, tap};
pub use offscreen::Offscreen;
pub use readback::{picture, pictures, read, read_hdr, save};
pub use stepping::step;
pub use waiting::{settle, wait_for};
