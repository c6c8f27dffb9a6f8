//! Picking: which capture a ray hits, which of its Gaussians, and where.
//!
//! In: a ray in the world, and all captures that are visible, at the moment they show, with their filter, opacity, fade and crop.
//! Out: a [`CaptureHit`], which [`RuntimeScene::pick`](crate::scene::RuntimeScene::pick) finds: the Gaussian at which half of the light
//! along the ray has been held back.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! use bevy_gs4d::picking::CapturePicker;
//!
//! #[derive(Component)]
//! struct Marker;
//!
//! /// Puts the marker where the camera looks.
//! fn aim(
//!     picker: CapturePicker,
//!     camera: Single<&GlobalTransform, With<Camera3d>>,
//!     mut marker: Single<&mut Transform, With<Marker>>,
//! ) {
//!     let ray = Ray3d::new(camera.translation(), camera.forward());
//!     if let Some(hit) = picker.cast(ray) {
//!         marker.translation = hit.point;
//!     }
//! }
//! ```
//!
//! For what is under the cursor take the ray of `Camera::viewport_to_world`. A ray costs about as much as a few arithmetic operations
//! for each Gaussian of every capture whose box it meets, on all cores: cast a few each frame, not one for each pixel.

mod picker;

pub use picker::{CaptureHit, CapturePicker};
