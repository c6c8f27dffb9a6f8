//! A panel that shows and edits captures, for the development of a game.
//!
//! In: an app with [`GaussianCapturePlugins`](crate::GaussianCapturePlugins), captures and a `Camera3d`. Out:
//! [`InspectorPlugin`], which draws the panel over the picture with `bevy_egui`, and [`Inspector`], its settings.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_gs4d::prelude::*;
//! use bevy_gs4d::inspector::InspectorPlugin;
//!
//! App::new().add_plugins((DefaultPlugins, GaussianCapturePlugins, InspectorPlugin)).run();
//! ```
//!
//! | section | shows and sets |
//! |---|---|
//! | warnings | captures that failed to load, that no camera sees or that have times without active Gaussians; cameras that cannot draw captures |
//! | capture | the selected capture and its loading state, with the reason of a failure |
//! | playback | play and pause, steps of one frame, the time below the marks of the key-frames, speed, repeat, range |
//! | stream | of a capture in chunk files: what is there, late and on its way |
//! | appearance | the capture's temporal filter, opacity, tint, exposure and crop box |
//! | view | the camera's debug view, blend space, written depth, multisampling and tonemapping |
//! | counts | Gaussians in total, active and visible, pairs, and the frame rate |
//! | memory | bytes of captures and of this view on the GPU |
//! | GPU time | milliseconds of each pass, measured only while the section is open |
//!
//! An open panel in which no value is edited marks no component as changed and does not seek.

mod appearance;
mod camera;
mod counts;
mod entity_selector;
mod listed;
mod memory;
mod playback;
mod plugin;
mod presentation;
mod settings;
mod stream;
mod timing;
mod warnings;

pub use plugin::InspectorPlugin;
pub use settings::Inspector;
