//! Cameras at known places that look at the origin, without matrices of the crate.
//!
//! In: a place. Out: the axes of the camera by cross products, its rotation in other forms, the pixel of a point, and a
//! check of a view against all of them.

use bevy_gs4d::offline::dataset::TrainingView;
use bevy_gs4d::view::Lens;
use glam::{Vec3, Vec4Swizzles};

/// A point near the origin.
const POINT: [f64; 3] = [0.3, -0.2, 0.1];
/// Down in the world, so that cameras on the negative z axis are hardly turned.
const DOWN: [f64; 3] = [0.0, 1.0, 0.0];

/// A camera that looks at the origin: its place, and its axes to the right, down and forward in the world.
#[derive(Clone, Copy)]
pub(super) struct Looking {
    pub(super) position: [f64; 3],
    pub(super) right: [f64; 3],
    pub(super) down: [f64; 3],
    pub(super) forward: [f64; 3],
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn unit(vector: [f64; 3]) -> [f64; 3] {
    vector.map(|value| value / dot(vector, vector).sqrt())
}

impl Looking {
    pub(super) fn from(position: [f64; 3]) -> Self {
        let forward = unit(position.map(|value| -value));
        let right = unit(cross(DOWN, forward));
        Self { position, right, down: cross(forward, right), forward }
    }

    /// Returns one of several cameras on an arc before the origin.
    pub(super) fn on_arc(index: usize) -> Self {
        let angle = 0.1 * index as f64 - 0.4;
        Self::from([4.0 * angle.sin(), -0.5 + 0.05 * index as f64, -4.0 * angle.cos()])
    }

    /// Returns the rotation from the world to the camera, row by row, axes of OpenCV.
    pub(super) fn rotation(&self) -> [[f64; 3]; 3] {
        [self.right, self.down, self.forward]
    }

    /// Returns the translation from the world to the camera.
    pub(super) fn translation(&self) -> [f64; 3] {
        self.rotation().map(|axis| -dot(axis, self.position))
    }

    /// Returns the rotation as a quaternion (w, x, y, z). It turns by less than half a turn.
    pub(super) fn quaternion(&self) -> [f64; 4] {
        let [a, b, c] = self.rotation();
        let w = 0.5 * (1.0 + a[0] + b[1] + c[2]).sqrt();
        [w, (c[1] - b[2]) / (4.0 * w), (a[2] - c[0]) / (4.0 * w), (b[0] - a[1]) / (4.0 * w)]
    }

    /// Returns the axis of the rotation times its angle in radians.
    pub(super) fn vector(&self) -> [f64; 3] {
        let [w, x, y, z] = self.quaternion();
        let sine = dot([x, y, z], [x, y, z]).sqrt();
        [x, y, z].map(|value| value / sine * 2.0 * sine.atan2(w))
    }

    /// Returns the pixel of a point.
    pub(super) fn pixel(&self, point: [f64; 3], focal: [f64; 2], center: [f64; 2]) -> [f64; 2] {
        let from = [0, 1, 2].map(|axis| point[axis] - self.position[axis]);
        let depth = dot(from, self.forward);
        [focal[0] * dot(from, self.right) / depth + center[0], focal[1] * dot(from, self.down) / depth + center[1]]
    }

    /// Checks place, direction, lens and the pixel of a point of a view.
    #[track_caller]
    pub(super) fn check(&self, view: &TrainingView, focal: [f64; 2], center: [f64; 2]) {
        let name = &view.name;
        let to_world = view.camera.world_to_camera.inverse();
        let near = |found: Vec3, expected: [f64; 3]| found.abs_diff_eq(Vec3::from(expected.map(|v| v as f32)), 1e-4);
        let (place, forward) = (to_world.w_axis.xyz(), to_world.z_axis.xyz());
        assert!(near(place, self.position), "{name}: the camera is at {:?}, not {place}", self.position);
        assert!(near(forward, self.forward), "{name}: the camera looks to {:?}, not {forward}", self.forward);
        let (found_focal, found_center) = intrinsics(view);
        let off =
            |found: [f64; 2], expected: [f64; 2]| (found[0] - expected[0]).abs().max((found[1] - expected[1]).abs());
        assert!(off(found_focal, focal) < 1e-3, "{name}: the focal lengths are {focal:?}, not {found_focal:?}");
        assert!(off(found_center, center) < 1e-3, "{name}: the center is {center:?}, not {found_center:?}");
        let at = view.camera.world_to_camera.transform_point3(Vec3::from(POINT.map(|value| value as f32)));
        let found = [
            found_focal[0] * f64::from(at.x / at.z) + found_center[0],
            found_focal[1] * f64::from(at.y / at.z) + found_center[1],
        ];
        let expected = self.pixel(POINT, focal, center);
        assert!(off(found, expected) < 1e-2, "{name}: the point is at {expected:?}, not {found:?}");
    }
}

/// Returns the focal lengths and the principal point of a view.
pub(super) fn intrinsics(view: &TrainingView) -> ([f64; 2], [f64; 2]) {
    let Lens::Intrinsics { focal, center } = view.camera.lens else { panic!("{}: an intrinsics camera", view.name) };
    ([focal.x.into(), focal.y.into()], [center.x.into(), center.y.into()])
}
