//! Stereo: a head with two eyes, for side-by-side views and for pairs of pictures.
//!
//! In: a [`StereoRig`] on the head's entity, and the targets of its eyes ([`EyeTargets`]). Out: two cameras, children
//! of the head, at the given distance and, for side-by-side views, each with its half of the target. Captures need no
//! special support for stereo: each eye is an ordinary camera, and all work that does not depend on the camera (time,
//! active Gaussians) is done once for all cameras.
//!
//! Both eyes look straight ahead through symmetric frusta, so that distant points are at the same place in both
//! pictures. A point at depth `z` is `focal length · ipd / z` pixels further right in the picture of the left eye.
//!
//! ```no_run
//! use bevy::camera::RenderTarget;
//! use bevy::prelude::*;
//! use bevy_gs4d::GaussianCapturePlugins;
//! use bevy_gs4d::stereo::{EyeTargets, StereoRig, spawn_stereo};
//!
//! fn setup(mut commands: Commands) {
//!     let window = EyeTargets::SideBySide(RenderTarget::default());
//!     let stereo = spawn_stereo(&mut commands, StereoRig::default(), window);
//!     commands.entity(stereo.head).insert(Transform::from_xyz(0.0, 1.6, 3.0));
//!     for eye in stereo.eyes {
//!         commands.entity(eye).insert(Msaa::Off);
//!     }
//! }
//!
//! App::new().add_plugins((DefaultPlugins, GaussianCapturePlugins)).add_systems(Startup, setup).run();
//! ```
//!
//! A headset has its own cameras and lenses; this module is for screens and pictures.

mod plugin;
mod rig;

pub use plugin::StereoPlugin;
pub use rig::{Eye, EyeTargets, SideBySide, Stereo, StereoRig, spawn_stereo};
