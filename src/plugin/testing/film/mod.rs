//! Datasets of training views, filmed in a Bevy scene.
//!
//! In: an app, a [`Film`] (cameras, times, lens, picture size) and a folder. Out: pictures with coverage and camera
//! files of the Blender form, by split, from which `gs4d train` and `gs4d eval` read; the tracks of named points.
//!
//! * `rig`: the poses of the cameras
//! * `hold_out`: the split of each picture
//! * `shooting`: draws the pictures with the app
//! * `points`: named points of the scene, and their tracks
//! * `files`: the files of the dataset
//! * `writer`: encodes and writes pictures while the next ones are drawn
//! * `error`: the reasons why a scene could not be filmed

mod error;
mod files;
mod hold_out;
mod points;
mod rig;
mod shooting;
mod writer;

pub use error::FilmError;
pub use hold_out::HoldOut;
pub use points::FilmedPoint;
pub use rig::Rig;
pub use shooting::{Film, Filmed, film};
