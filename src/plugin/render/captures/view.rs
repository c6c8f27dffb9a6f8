//! Views: converts Bevy's camera and an entity's transform to the renderer's conventions.
//!
//! In: a projection matrix (Bevy's: y up, looking along −z, reverse-z), the poses of a camera and of a capture. Out: a
//! [`CameraLens`], and a [`View`] (y down, looking along +z) that maps capture space directly to camera space.

use crate::view::View;
use glam::{Affine3A, DMat3, DMat4, DVec4, Mat4, UVec2, Vec2, Vec4};
use std::ops::Range;

/// A camera's lens: a pinhole, or parallel rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CameraLens {
    rays: Rays,
    /// How the depth buffer's value `d` gives depth in camera space: `z = (x + y d) / (z + w d)`. `None` if the depth
    /// also depends on the position in the picture.
    pub(crate) distance: Option<Vec4>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Rays {
    /// Rays from one point.
    Pinhole {
        /// `P00, P11, P02, P12`, as in [`View::projection`].
        projection: Vec4,
        /// Tangents of half the true field of view.
        tan_fov: Vec2,
    },
    /// Parallel rays.
    Parallel {
        /// `P00, P11, P03, P13`.
        projection: Vec4,
        /// Depth of the near plane in camera units.
        near: f32,
    },
}

impl CameraLens {
    /// Returns the lens of a projection matrix; `None` if skewed, mirrored or orthographic without reversed depth.
    pub(crate) fn of(clip_from_view: &Mat4) -> Option<Self> {
        let [x, y, _, _] = columns(clip_from_view);
        if !clip_from_view.is_finite() || (x.y, y.x) != (0.0, 0.0) || x.x <= 0.0 || y.y <= 0.0 {
            return None;
        }
        let last_row = clip_from_view.row(3);
        if last_row == Vec4::NEG_Z {
            Self::pinhole(clip_from_view)
        } else if last_row == Vec4::W {
            Self::parallel(clip_from_view)
        } else {
            None
        }
    }

    fn pinhole(clip_from_view: &Mat4) -> Option<Self> {
        let [x, y, z, w] = columns(clip_from_view);
        if (w.x, w.y) != (0.0, 0.0) {
            return None;
        }
        // Clip w is −z = depth. With depth and y reversed: ndc x = (x.x x − z.x depth) / depth, and downwards
        // ndc y = (y.y y + z.y depth) / depth.
        let projection = Vec4::new(x.x, y.y, -z.x, z.y);
        let rays = Rays::Pinhole { projection, tan_fov: Vec2::new(x.x.recip(), y.y.recip()) };
        // d = (w.z − z.z depth) / depth; z.z is 0 for an infinite far plane.
        let plain = (x.z, y.z) == (0.0, 0.0) && w.z > 0.0 && z.z >= 0.0;
        Some(Self { rays, distance: plain.then_some(Vec4::new(w.z, 0.0, z.z, 1.0)) })
    }

    fn parallel(clip_from_view: &Mat4) -> Option<Self> {
        let [x, y, z, w] = columns(clip_from_view);
        if (x.z, y.z) != (0.0, 0.0) || (z.x, z.y) != (0.0, 0.0) || z.z <= 0.0 {
            return None;
        }
        let projection = Vec4::new(x.x, y.y, w.x, -w.y);
        // d = w.z − z.z depth, which is 1 at the near plane.
        let rays = Rays::Parallel { projection, near: (w.z - 1.0) / z.z };
        Some(Self { rays, distance: Some(Vec4::new(w.z, -1.0, z.z, 0.0)) })
    }

    /// Returns the lens of a camera whose viewport maps depths to this range of the depth buffer, as `Viewport::depth`
    /// does.
    pub(crate) fn in_depth_range(self, range: &Range<f32>) -> Self {
        let length = range.end - range.start;
        // The value `d` of the whole range is (D − start) / length.
        let within = |distance: Vec4| {
            let [y, w] = [distance.y, distance.w].map(|factor| factor / length);
            Vec4::new(distance.x - y * range.start, y, distance.z - w * range.start, w)
        };
        Self { distance: self.distance.filter(|_| length > 0.0).map(within), ..self }
    }

    /// Returns the view of one capture through this lens: `size` in pixels, `time` in the capture's unit. `None` if the
    /// transforms flatten the capture or are not finite.
    pub(crate) fn view(
        &self,
        size: UVec2,
        time: f32,
        world_from_camera: Affine3A,
        world_from_capture: Affine3A,
    ) -> Option<View> {
        let flip = DMat4::from_diagonal(DVec4::new(1.0, -1.0, -1.0, 1.0));
        let double = |transform: Affine3A| Mat4::from(transform).as_dmat4();
        let camera_from_capture = flip * double(world_from_camera).inverse() * double(world_from_capture);
        let volume = DMat3::from_mat4(camera_from_capture).determinant();
        let single = camera_from_capture.as_mat4();
        if volume == 0.0 || !volume.is_finite() || !single.is_finite() || size.min_element() == 0 {
            return None;
        }
        let view = match self.rays {
            Rays::Pinhole { projection, tan_fov } => View::new(size, time, single, projection, tan_fov),
            Rays::Parallel { projection, near } => View::orthographic(size, time, single, projection, near),
        };
        view.camera_position.is_finite().then_some(view)
    }
}

fn columns(matrix: &Mat4) -> [Vec4; 4] {
    [matrix.x_axis, matrix.y_axis, matrix.z_axis, matrix.w_axis]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Camera, RasterFov};
    use bevy::camera::{CameraProjection, OrthographicProjection, PerspectiveProjection};
    use bevy::math::Rect;
    use glam::{Quat, Vec3};

    const SIZE: UVec2 = UVec2::new(320, 240);

    fn bevy_camera(eye: Vec3, target: Vec3) -> Affine3A {
        Affine3A::look_at_rh(eye, target, Vec3::Y).inverse()
    }

    fn perspective(fov_y: f32) -> Mat4 {
        Mat4::perspective_infinite_reverse_rh(fov_y, SIZE.x as f32 / SIZE.y as f32, 0.1)
    }

    /// Returns an off-center projection for a picture of 4 x 3 units with depths from 0.5 to 50.
    fn orthographic() -> Mat4 {
        let area = Rect::new(-1.0, -2.0, 3.0, 1.0);
        OrthographicProjection { near: 0.5, far: 50.0, area, ..OrthographicProjection::default_3d() }
            .get_clip_from_view()
    }

    /// Returns the renderer's normalized device coordinates of a point, with y down.
    fn seen(view: &View, point: Vec3) -> Vec2 {
        let depth = view.world_to_camera.transform_point3(point).z;
        let [x, y] = view.clip_rows();
        let divisor = if view.orthographic { 1.0 } else { depth };
        Vec2::new(x.dot(point.extend(1.0)), y.dot(point.extend(1.0))) / divisor
    }

    /// Returns Bevy's normalized device coordinates of a point, with y down.
    fn seen_by_bevy(clip_from_view: Mat4, camera: Affine3A, point: Vec3) -> Vec2 {
        let clip = clip_from_view * Mat4::from(camera.inverse()) * point.extend(1.0);
        Vec2::new(clip.x, -clip.y) / clip.w
    }

    #[test]
    fn a_bevy_camera_equals_the_camera_of_this_crate() {
        let (eye, target) = (Vec3::new(1.0, 2.0, 4.0), Vec3::new(0.2, 0.1, -0.3));
        let fov_x = 2.0 * ((0.7f32 / 2.0).tan() * 4.0 / 3.0).atan();
        let ours = Camera::look_at(eye, target, Vec3::Y, fov_x, SIZE).view(0.3, RasterFov::Corrected);
        let lens = CameraLens::of(&perspective(0.7)).expect("a pinhole");
        let theirs = lens.view(SIZE, 0.3, bevy_camera(eye, target), Affine3A::IDENTITY).expect("not flat");
        assert!(theirs.world_to_camera.abs_diff_eq(ours.world_to_camera, 1e-5), "poses agree");
        assert!(theirs.projection.abs_diff_eq(ours.projection, 1e-5), "projections agree");
        assert!(theirs.tan_fov.abs_diff_eq(ours.tan_fov, 1e-5), "fields of view agree");
        assert!(theirs.camera_position.abs_diff_eq(eye, 1e-5), "camera centers agree");
        assert_eq!(lens.distance, Some(Vec4::new(0.1, 0.0, 0.0, 1.0)), "the depth texture holds near / depth");
    }

    #[test]
    fn points_project_to_the_same_place_as_in_bevy() {
        let mut off_center = perspective(0.9);
        off_center.z_axis.x = 0.15;
        off_center.z_axis.y = -0.25;
        let camera = bevy_camera(Vec3::new(-1.0, 0.5, 3.0), Vec3::ZERO);
        let model = Affine3A::from_scale_rotation_translation(
            Vec3::new(1.0, 2.0, 0.5),
            Quat::from_rotation_z(0.6),
            Vec3::new(0.1, -0.2, 0.3),
        );
        for projection in [perspective(0.9), off_center, orthographic()] {
            let view =
                CameraLens::of(&projection).and_then(|lens| lens.view(SIZE, 0.0, camera, model)).expect("a view");
            for point in [Vec3::ZERO, Vec3::new(0.3, 0.2, -0.1), Vec3::new(-0.4, 0.1, 0.5)] {
                let expected = seen_by_bevy(projection, camera, model.transform_point3(point));
                assert!(seen(&view, point).abs_diff_eq(expected, 1e-5), "{point} is projected to {expected}");
            }
        }
    }

    #[test]
    fn depth_buffer_values_convert_to_depths_and_back() {
        let finite = Mat4::perspective_rh(0.9, 1.5, 40.0, 0.2);
        let bevy_s = PerspectiveProjection { near: 0.3, ..PerspectiveProjection::default() }.get_clip_from_view();
        for (name, projection) in [("infinite", bevy_s), ("finite far plane", finite), ("orthographic", orthographic())]
        {
            let distance = CameraLens::of(&projection).and_then(|lens| lens.distance).expect("a plain depth");
            for depth in [0.5, 1.0, 7.5, 39.0] {
                let clip = projection * Vec4::new(0.3, -0.2, -depth, 1.0);
                let d = clip.z / clip.w;
                let back = (distance.x + distance.y * d) / (distance.z + distance.w * d);
                assert!((back - depth).abs() < 1e-4 * depth, "{name}: depth {depth} converts back to {back}");
                let buffer = (distance.x - distance.z * depth) / (distance.w * depth - distance.y);
                assert!((buffer - d).abs() < 1e-6, "{name}: depth {depth} converts to {buffer}, Bevy's value is {d}");
            }
            let half = CameraLens::of(&projection).and_then(|lens| lens.in_depth_range(&(0.25..0.75)).distance);
            let half = half.expect("a plain depth");
            let depth = |d: f32| (half.x + half.y * d) / (half.z + half.w * d);
            let clip = projection * Vec4::new(0.3, -0.2, -7.5, 1.0);
            let back = depth(0.25 + 0.5 * clip.z / clip.w);
            assert!(
                (back - 7.5).abs() < 1e-3,
                "{name}: in half of the depth buffer, depth 7.5 converts back to {back}"
            );
        }
    }

    #[test]
    fn an_orthographic_lens_has_the_near_plane_of_the_projection() {
        let lens = CameraLens::of(&orthographic()).expect("a lens");
        let camera = bevy_camera(Vec3::ZERO, Vec3::NEG_Z);
        let view = lens.view(SIZE, 0.0, camera, Affine3A::IDENTITY).expect("not flat");
        assert!((view.near - 0.5).abs() < 1e-4, "the near plane is at 0.5, not {}", view.near);
        let behind = OrthographicProjection { near: -5.0, ..OrthographicProjection::default_3d() };
        let view =
            CameraLens::of(&behind.get_clip_from_view()).and_then(|l| l.view(SIZE, 0.0, camera, Affine3A::IDENTITY));
        assert!((view.expect("a view").near + 5.0).abs() < 1e-3, "the near plane may be behind the camera, at -5");
    }

    #[test]
    fn unsupported_projections_have_no_lens() {
        let forward = Mat4::orthographic_rh(-1.0, 1.0, -1.0, 1.0, 0.1, 10.0);
        assert_eq!(CameraLens::of(&forward), None, "orthographic without reversed depth");
        assert_eq!(CameraLens::of(&Mat4::NAN), None, "a matrix of NaN");
        let mut skewed = orthographic();
        skewed.z_axis.x = 0.1;
        assert_eq!(CameraLens::of(&skewed), None, "skewed parallel rays");
        let mut mirrored = perspective(0.7);
        mirrored.x_axis.x = -mirrored.x_axis.x;
        assert_eq!(CameraLens::of(&mirrored), None, "a mirrored projection");
        let plane = Vec3::new(0.1, 0.0, -1.0).normalize().extend(-0.4);
        let oblique = PerspectiveProjection { near_clip_plane: plane, ..PerspectiveProjection::default() };
        let lens = CameraLens::of(&oblique.get_clip_from_view()).expect("still a pinhole");
        assert_eq!(lens.distance, None, "its depth also depends on the position in the picture");
    }

    #[test]
    fn flat_and_broken_transforms_have_no_view() {
        let lens = CameraLens::of(&perspective(0.7)).expect("a pinhole");
        let camera = bevy_camera(Vec3::Z, Vec3::ZERO);
        let view = |model| lens.view(SIZE, 0.0, camera, model);
        assert_eq!(view(Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0))), None, "a scale of 0 has no view");
        assert_eq!(view(Affine3A::from_translation(Vec3::NAN)), None, "a translation of NaN has no view");
        assert!(view(Affine3A::from_scale(Vec3::splat(1e-3))).is_some(), "a small scale has a view");
        assert_eq!(
            lens.view(UVec2::new(0, 9), 0.0, camera, Affine3A::IDENTITY),
            None,
            "a picture without pixels has no view"
        );
    }
}
