//! The cameras of a film.
//!
//! In: a center and counts, or a path. Out: a [`Rig`] of camera poses, evenly spread and the same in every run.

use bevy::transform::components::Transform;
use glam::{Quat, UVec2, Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// Camera poses in Bevy's axes: y is up, a camera looks along -z.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    pub(super) poses: Vec<Transform>,
    /// Whether the poses are those of one camera at successive times.
    pub(super) is_path: bool,
}

impl Rig {
    /// Returns `count` cameras on the upper half of a sphere, from the top to the horizon, that look at its center.
    /// They are spread evenly (a Fibonacci spiral).
    pub fn hemisphere(center: Vec3, radius: f32, count: usize) -> Self {
        let golden_angle = PI * (3.0 - 5.0_f32.sqrt());
        let place = |index: usize| {
            let y = 1.0 - (index as f32 + 0.5) / count as f32;
            let (sin, cos) = ((index as f32 * golden_angle) % TAU).sin_cos();
            Vec3::new(cos, 0.0, sin) * (1.0 - y * y).sqrt() + Vec3::Y * y
        };
        Self::inward(center, (0..count).map(|index| center + radius * place(index)))
    }

    /// Returns `count` cameras on a horizontal circle that look at `center`. The circle is `height` above the center.
    pub fn ring(center: Vec3, radius: f32, height: f32, count: usize) -> Self {
        let place = |index: usize| {
            let (sin, cos) = (TAU * index as f32 / count as f32).sin_cos();
            Vec3::new(radius * cos, height, radius * sin)
        };
        Self::inward(center, (0..count).map(|index| center + place(index)))
    }

    /// Returns an upright grid of cameras that look at `center`: `counts` columns and rows, row by row from the top
    /// left, `extent` wide and high, at `distance` from the center in the direction `yaw` around the vertical (radians;
    /// 0 is +z).
    pub fn grid(center: Vec3, distance: f32, yaw: f32, extent: Vec2, counts: UVec2) -> Self {
        let turn = Quat::from_rotation_y(yaw);
        // A single column or row is in the middle.
        let at = |index: u32, count: u32| if count > 1 { index as f32 / (count - 1) as f32 - 0.5 } else { 0.0 };
        let cells = (0..counts.y).flat_map(|row| (0..counts.x).map(move |column| (column, row)));
        let place = |(column, row)| {
            let plane = Vec2::new(at(column, counts.x), -at(row, counts.y)) * extent;
            center + turn * plane.extend(distance)
        };
        Self::inward(center, cells.map(place))
    }

    /// Returns cameras with these poses.
    pub fn fixed(poses: Vec<Transform>) -> Self {
        Self { poses, is_path: false }
    }

    /// Returns one camera that moves: it has one pose for each time of the film, in order.
    pub fn path(poses: Vec<Transform>) -> Self {
        Self { poses, is_path: true }
    }

    fn inward(center: Vec3, places: impl Iterator<Item = Vec3>) -> Self {
        let look = |place| Transform::from_translation(place).looking_at(center, Vec3::Y);
        Self::fixed(places.map(look).collect())
    }

    /// Returns the poses: of the cameras in their order, or of the one camera of a path.
    pub fn poses(&self) -> &[Transform] {
        &self.poses
    }

    /// Returns the indices of the poses that are filmed at a time.
    pub(super) fn at(&self, time: usize) -> std::ops::Range<usize> {
        if self.is_path { time..time + 1 } else { 0..self.poses.len() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_camera_is_at_its_distance_and_looks_at_the_center() {
        let center = Vec3::new(1.0, 2.0, -3.0);
        let grid = Rig::grid(center, 4.0, 0.7, Vec2::new(2.0, 1.0), UVec2::new(3, 2));
        let rigs = [Rig::hemisphere(center, 4.0, 40), Rig::ring(center, 3.0, 1.0, 7), grid];
        for (rig, count) in rigs.iter().zip([40, 7, 6]) {
            assert_eq!(rig.poses().len(), count, "the number of cameras");
            for pose in rig.poses() {
                let to_center = (center - pose.translation).normalize();
                assert!(pose.forward().dot(to_center) > 0.9999, "{pose:?} looks at the center");
                assert!(pose.right().y.abs() < 1e-4, "{pose:?} is level");
            }
        }
        let distances = |rig: &Rig| rig.poses.iter().map(|pose| pose.translation.distance(center)).collect::<Vec<_>>();
        assert!(distances(&rigs[0]).iter().all(|d| (d - 4.0).abs() < 1e-4), "on the sphere");
        assert!(distances(&rigs[1]).iter().all(|d| (d - 10.0_f32.sqrt()).abs() < 1e-4), "on the ring");
        assert!(distances(&rigs[2]).iter().all(|d| *d > 4.0), "the grid is on a plane in front of the center");
    }

    #[test]
    fn cameras_of_a_hemisphere_are_apart_and_above_the_center() {
        let poses = Rig::hemisphere(Vec3::ZERO, 1.0, 100).poses;
        // A hemisphere of 100 equal caps: their centers are about 2 · sqrt(2 / 100) = 0.28 apart.
        for (index, pose) in poses.iter().enumerate() {
            assert!(pose.translation.y > 0.0, "camera {index} is above the center");
            let others = poses.iter().enumerate().filter(|(other, _)| *other != index);
            let nearest = others.map(|(_, other)| other.translation.distance(pose.translation)).fold(9.0, f32::min);
            assert!((0.15..0.35).contains(&nearest), "the neighbor of camera {index} is {nearest} away");
        }
    }
}
