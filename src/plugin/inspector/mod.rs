//! A panel to watch and steer captures with, for the development of a game.
//!
//! In: an app with [`GaussianCapturePlugin`](crate::GaussianCapturePlugin), captures and a `Camera3d`. Out:
//! [`InspectorPlugin`], which draws the panel over the picture with `bevy_egui`, and [`Inspector`], what a game sets of it.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_gs4d::prelude::*;
//! use bevy_gs4d::inspector::InspectorPlugin;
//!
//! App::new().add_plugins((DefaultPlugins, GaussianCapturePlugin, InspectorPlugin)).run();
//! ```
//!
//! | section | shows and sets |
//! |---|---|
//! | capture | which capture the panel is about, whether it has been loaded, and if not, why |
//! | playback | play and pause, steps of a frame, the time under the marks of the filter's key-frames, speed, repeat, range |
//! | look | the capture's filter, opacity, tint, exposure and crop box |
//! | view | the camera's debug view, blend space, written depth, multisampling and tonemapping |
//! | counts | Gaussians in total, active and visible, pairs, and the frame rate |
//! | memory | what captures and this view take on the GPU |
//! | GPU time | milliseconds of each pass, measured only while the section is open |
//!
//! What nobody touches stays as it is: an open panel marks no component as changed and seeks nothing.

mod appearance;
mod camera;
mod chooser;
mod counts;
mod memory;
mod playback;
mod plugin;
mod presentation;
mod timing;

pub use plugin::{Inspector, InspectorPlugin};
