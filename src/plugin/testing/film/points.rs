//! Named points of a filmed scene.
//!
//! In: entities with a [`FilmedPoint`], at each time of a film. Out: their [`Tracks`], which tell where each point is:
//! what follows the motion of a capture is compared with them.

use super::error::FilmError;
use bevy::camera::visibility::{InheritedVisibility, Visibility};
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::ecs::world::World;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use bevy::transform::components::{GlobalTransform, Transform};
use glam::Vec3;
use serde::Serialize;
use std::collections::BTreeMap;

/// A named point of a scene, whose track [`film`](super::film()) writes to `points.json` in the folder of the dataset.
/// Spawn it as a child of a thing that moves, on its surface; the name is its own.
///
/// At each of [`Film::times`](super::Film::times) the file has the place of the entity in the world. Where the entity
/// is hidden or does not exist, the point is not there, and the file has `null`: hide a point while what it is on
/// cannot be seen. `times` in the file are those of the camera files, 0 to 1, and `seconds` are the seconds of 0 and 1:
///
/// ```json
/// { "seconds": [0.0, 4.0], "times": [0.0, 0.5, 1.0], "points": { "hand": [[0.1, 1.0, 0.0], [0.2, 1.1, 0.0], null] } }
/// ```
///
/// `gs4d socket CAPTURE --points DATASET/points.json` compares the sockets of a capture that was trained on the film
/// with these tracks. Default: no name.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::testing::FilmedPoint;
///
/// fn setup(mut commands: Commands) {
///     // In its place a mesh that moves.
///     let arm = Transform::default();
///     commands.spawn((arm, children![(FilmedPoint::new("hand"), Transform::from_xyz(0.0, -0.6, 0.1))]));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, Reflect, Debug, Default, Clone, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::testing"]
#[require(Transform, Visibility)]
pub struct FilmedPoint(pub String);

impl FilmedPoint {
    /// Returns a point of this name.
    pub fn new(name: impl Into<String>) -> Self {
        Self(name.into())
    }
}

/// Returns the place of each point that is visible, world space, with its name.
pub(super) fn places(world: &mut World) -> Vec<(String, Vec3)> {
    let mut points = world.query::<(&FilmedPoint, &GlobalTransform, &InheritedVisibility)>();
    let visible = points.iter(world).filter(|(_, pose, visibility)| visibility.get() && pose.translation().is_finite());
    visible.map(|(point, pose, _)| (point.0.clone(), pose.translation())).collect()
}

/// The places of points at the times of a film.
#[derive(Debug, Default, Serialize)]
pub(super) struct Tracks {
    /// From 0, the first time of the film, to 1, its last.
    times: Vec<f64>,
    /// The place of each point at each time, world space; `None` where it is not there.
    points: BTreeMap<String, Vec<Option<[f32; 3]>>>,
}

impl Tracks {
    /// Adds the places of points at a time.
    ///
    /// # Errors
    /// Two points of one name.
    pub(super) fn add(&mut self, time: f64, places: Vec<(String, Vec3)>) -> Result<(), FilmError> {
        let before = self.times.len();
        self.times.push(time);
        for (name, place) in places {
            if self.points.get(&name).is_some_and(|track| track.len() > before) {
                return Err(FilmError::SamePoint(name));
            }
            let track = self.points.entry(name).or_default();
            // The point may be a new one.
            track.resize(before, None);
            track.push(Some(place.to_array()));
        }
        self.points.values_mut().for_each(|track| track.resize(before + 1, None));
        Ok(())
    }

    /// Returns whether there is no point.
    pub(super) fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places<const N: usize>(places: [(&str, f32); N]) -> Vec<(String, Vec3)> {
        places.into_iter().map(|(name, x)| (name.to_owned(), Vec3::X * x)).collect()
    }

    #[test]
    fn points_have_a_place_or_none_at_each_time() {
        let mut tracks = Tracks::default();
        assert!(tracks.is_empty(), "no point yet");
        for (time, found) in [
            (0.0, places([("a", 1.0)])),
            (0.5, places([("b", 2.0), ("a", 3.0)])),
            (0.75, places([])),
            (1.0, places([("b", 4.0)])),
        ] {
            tracks.add(time, found).expect("names differ");
        }
        assert_eq!(tracks.times, [0.0, 0.5, 0.75, 1.0], "all times");
        let at = |x: f32| Some([x, 0.0, 0.0]);
        let expected = [("a", [at(1.0), at(3.0), None, None]), ("b", [None, at(2.0), None, at(4.0)])];
        let expected = expected.map(|(name, places)| (name.to_owned(), places.to_vec()));
        assert_eq!(tracks.points, BTreeMap::from(expected), "of points that come late, and of those that go");
    }

    #[test]
    fn two_points_of_one_name_are_refused() {
        let error = Tracks::default().add(0.0, places([("a", 1.0), ("a", 2.0)])).expect_err("two points are named a");
        assert!(error.to_string().contains("are named a at the same time"), "the name: {error}");
    }
}
