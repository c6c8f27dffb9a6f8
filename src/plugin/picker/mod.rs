//! Picker: finds the capture, the Gaussian and the point that a ray hits.
//!
//! In: a ray in world space, and all visible captures at their current times, with their temporal filter, opacity, fade
//! and crop. Out: a [`CaptureHit`], found by [`RuntimeScene::pick`](crate::scene::RuntimeScene::pick): the Gaussian at
//! which half of the light along the ray is absorbed.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! use bevy_gs4d::picker::CapturePicker;
//!
//! #[derive(Component)]
//! struct Marker;
//!
//! /// Puts the marker where the camera's view direction meets a capture.
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
//! `Camera::viewport_to_world` returns the ray under the cursor. A ray costs a few arithmetic operations per Gaussian
//! of every capture whose box it meets, on all cores: cast a few rays per frame, not one per pixel.

mod capture_picker;

#[cfg(feature = "picking")]
pub(crate) use capture_picker::Aim;
#[cfg(all(test, feature = "picking"))]
pub(crate) use capture_picker::tests::aim_at;
pub use capture_picker::{CaptureHit, CapturePicker};
