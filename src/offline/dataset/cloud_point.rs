//! A point that a training may begin with.
//!
//! In: its place, color, time and velocity in a file, in double precision. Out: a [`CloudPoint`], counted from an origin.

use crate::scene::Origin;
use glam::{DVec3, Vec3};

/// A point of a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CloudPoint {
    /// World space of the cameras, counted from their origin.
    pub position: Vec3,
    /// RGB, 0 to 1; `None` if the file has no colors.
    pub color: Option<Vec3>,
    /// In the unit of timestamps; `None` if the file has no times.
    pub time: Option<f32>,
    /// World units for each unit of timestamps; zero if the file has no velocities.
    pub velocity: Vec3,
}

impl CloudPoint {
    /// Returns a point with this place and time of a file.
    pub(crate) fn counted_from(origin: &Origin, place: [f64; 3], color: Option<Vec3>, time: Option<f64>) -> Self {
        Self {
            position: (DVec3::from(place) - DVec3::from(origin.place)).as_vec3(),
            color,
            time: time.map(|time| (time - origin.time) as f32),
            velocity: Vec3::ZERO,
        }
    }
}
