//! Views: Bevy's camera and an entity's transform in the renderer's terms.
//!
//! In: a projection matrix (Bevy's: y up, looking along −z, reverse-z), the poses of a camera and of a capture. Out: a [`Lens`],
//! and a [`View`] (y down, looking along +z) that leads from capture space straight to camera space.

use crate::gaussian::View;
use glam::{Affine3A, DMat3, DMat4, DVec4, Mat4, UVec2, Vec2, Vec4};

/// A pinhole camera's lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lens {
    /// `P00, P11, P02, P12`, as in [`View::projection`].
    projection: Vec4,
    /// Tangents of half the true field of view.
    tan_fov: Vec2,
    /// With it, `z = near / depth` in the depth texture; nothing where the depth texture holds something else.
    pub(super) near: Option<f32>,
}

impl Lens {
    /// The lens behind a projection matrix; nothing for one that is not a pinhole's (orthographic, skewed or mirrored).
    pub(super) fn of(clip_from_view: &Mat4) -> Option<Self> {
        let [x, y, z, w] = [clip_from_view.x_axis, clip_from_view.y_axis, clip_from_view.z_axis, clip_from_view.w_axis];
        let pinhole = (x.w, y.w, z.w, w.w) == (0.0, 0.0, -1.0, 0.0);
        let straight = (x.y, y.x, w.x, w.y) == (0.0, 0.0, 0.0, 0.0);
        if !pinhole || !straight || !clip_from_view.is_finite() || x.x <= 0.0 || y.y <= 0.0 {
            return None;
        }
        // Clip w is −z = depth. With depth and y turned round: ndc x = (x.x x − z.x depth) / depth, and downwards
        // ndc y = (y.y y + z.y depth) / depth.
        let projection = Vec4::new(x.x, y.y, -z.x, z.y);
        let plain_depth = (x.z, y.z, z.z) == (0.0, 0.0, 0.0) && w.z > 0.0;
        Some(Self { projection, tan_fov: Vec2::new(x.x.recip(), y.y.recip()), near: plain_depth.then_some(w.z) })
    }

    /// The view of one capture through this lens: `size` in pixels, `time` in the capture's unit. Nothing where the transforms
    /// flatten the capture or are not finite.
    pub(super) fn view(
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
        let view = View::new(size, time, single, self.projection, self.tan_fov);
        view.camera_position.is_finite().then_some(view)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::{Camera, RasterFov};
    use glam::{Quat, Vec3};

    const SIZE: UVec2 = UVec2::new(320, 240);

    fn bevy_camera(eye: Vec3, target: Vec3) -> Affine3A {
        Affine3A::look_at_rh(eye, target, Vec3::Y).inverse()
    }

    fn perspective(fov_y: f32) -> Mat4 {
        Mat4::perspective_infinite_reverse_rh(fov_y, SIZE.x as f32 / SIZE.y as f32, 0.1)
    }

    /// Where the renderer puts a point: normalised device coordinates with y down.
    fn seen(view: &View, point: Vec3) -> Vec2 {
        let depth = view.world_to_camera.transform_point3(point).z;
        let [x, y] = view.clip_rows();
        Vec2::new(x.dot(point.extend(1.0)), y.dot(point.extend(1.0))) / depth
    }

    /// Where Bevy puts it, likewise.
    fn seen_by_bevy(clip_from_view: Mat4, camera: Affine3A, point: Vec3) -> Vec2 {
        let clip = clip_from_view * Mat4::from(camera.inverse()) * point.extend(1.0);
        Vec2::new(clip.x, -clip.y) / clip.w
    }

    #[test]
    fn a_bevy_camera_is_the_same_camera_as_ours() {
        let (eye, target) = (Vec3::new(1.0, 2.0, 4.0), Vec3::new(0.2, 0.1, -0.3));
        let fov_x = 2.0 * ((0.7f32 / 2.0).tan() * 4.0 / 3.0).atan();
        let ours = Camera::look_at(eye, target, Vec3::Y, fov_x, SIZE).view(0.3, RasterFov::Corrected);
        let lens = Lens::of(&perspective(0.7)).expect("a pinhole");
        let theirs = lens.view(SIZE, 0.3, bevy_camera(eye, target), Affine3A::IDENTITY).expect("not flat");
        assert!(theirs.world_to_camera.abs_diff_eq(ours.world_to_camera, 1e-5), "poses agree");
        assert!(theirs.projection.abs_diff_eq(ours.projection, 1e-5), "projections agree");
        assert!(theirs.tan_fov.abs_diff_eq(ours.tan_fov, 1e-5), "fields of view agree");
        assert!(theirs.camera_position.abs_diff_eq(eye, 1e-5), "camera centres agree");
        assert_eq!(lens.near, Some(0.1), "the depth texture holds near / depth");
    }

    #[test]
    fn points_land_where_bevy_puts_them() {
        let mut off_center = perspective(0.9);
        off_center.z_axis.x = 0.15;
        off_center.z_axis.y = -0.25;
        let camera = bevy_camera(Vec3::new(-1.0, 0.5, 3.0), Vec3::ZERO);
        let model = Affine3A::from_scale_rotation_translation(
            Vec3::new(1.0, 2.0, 0.5),
            Quat::from_rotation_z(0.6),
            Vec3::new(0.1, -0.2, 0.3),
        );
        for projection in [perspective(0.9), off_center] {
            let view = Lens::of(&projection).and_then(|lens| lens.view(SIZE, 0.0, camera, model)).expect("a view");
            for point in [Vec3::ZERO, Vec3::new(0.3, 0.2, -0.1), Vec3::new(-0.4, 0.1, 0.5)] {
                let expected = seen_by_bevy(projection, camera, model.transform_point3(point));
                assert!(seen(&view, point).abs_diff_eq(expected, 1e-5), "{point} must be seen at {expected}");
            }
        }
    }

    #[test]
    fn what_is_no_pinhole_has_no_lens() {
        assert_eq!(Lens::of(&Mat4::orthographic_rh(-1.0, 1.0, -1.0, 1.0, 10.0, 0.1)), None, "orthographic");
        assert_eq!(Lens::of(&Mat4::NAN), None, "not a number");
        let mut oblique = perspective(0.7);
        oblique.x_axis.z = 0.1;
        assert_eq!(Lens::of(&oblique).expect("still a pinhole").near, None, "but its depth is not near / depth");
    }

    #[test]
    fn flat_and_broken_transforms_have_no_view() {
        let lens = Lens::of(&perspective(0.7)).expect("a pinhole");
        let camera = bevy_camera(Vec3::Z, Vec3::ZERO);
        let view = |model| lens.view(SIZE, 0.0, camera, model);
        assert_eq!(view(Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0))), None, "scaled to nothing");
        assert_eq!(view(Affine3A::from_translation(Vec3::NAN)), None, "not a number");
        assert!(view(Affine3A::from_scale(Vec3::splat(1e-3))).is_some(), "small is not flat");
        assert_eq!(lens.view(UVec2::new(0, 9), 0.0, camera, Affine3A::IDENTITY), None, "no pixels");
    }
}
