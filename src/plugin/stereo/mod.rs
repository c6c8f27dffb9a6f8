//! Stereo: a head with two eyes, for views side by side and for pairs of pictures.
//!
//! In: a [`StereoRig`] on the head's entity and where its eyes draw ([`EyeTargets`]). Out: two cameras, children of the head, that
//! keep their distance and their half of the target. Nothing here knows of captures: each eye is a camera like any other, and what
//! is one for both (time, which Gaussians are active) is so for any two cameras.
//!
//! Both eyes look straight ahead through symmetric frusta, so that what is far away is at the same place in both pictures. A point
//! at depth `z` is `focal length · ipd / z` pixels further right in the left eye's.
//!
//! ```no_run
//! use bevy::camera::RenderTarget;
//! use bevy::prelude::*;
//! use bevy_gs4d::stereo::{EyeTargets, StereoPlugin, StereoRig, spawn_stereo};
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
//! App::new().add_plugins((DefaultPlugins, StereoPlugin)).add_systems(Startup, setup).run();
//! ```
//!
//! A headset brings its own cameras, with the lenses it has; this is for everything else.

mod plugin;
mod rig;

pub use plugin::StereoPlugin;
pub use rig::{Eye, EyeTargets, SideBySide, Stereo, StereoRig, spawn_stereo};
